#!/usr/bin/env bash
# commonroad-prediction: a braking car is predicted to drive backwards, at positive speed.
#
# Expected: with constant acceleration -3 m/s2 a car at 5 m/s stops after 1.7 s and stays.
# What happens: the acceleration goes on after standstill. The car reverses, its velocity is the
# norm of its components and so grows again (4.3 m/s after 3 s): a state whose velocity says
# forward and whose places go back, more than 6 m within 2 s.
# Why it matters: a lead vehicle that brakes hard (the critical case) is predicted into the ego
# behind it; speed-based metrics see a lead that pulls away.
#
# Output seen:
#   commonroad-prediction 0.1.2
#   step 0: x 20.48 m, velocity 4.70 m/s, orientation 0.00 rad
#   step 6: x 22.77 m, velocity 2.90 m/s, orientation 0.00 rad
#   step 12: x 23.97 m, velocity 1.10 m/s, orientation 0.00 rad
#   step 18: x 24.09 m, velocity 0.70 m/s, orientation 0.00 rad
#   step 24: x 23.13 m, velocity 2.50 m/s, orientation 0.00 rad
#   step 30: x 21.09 m, velocity 4.30 m/s, orientation 0.00 rad
#   step 36: x 17.96 m, velocity 6.10 m/s, orientation 0.00 rad
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-prediction==0.1.2 commonroad-io==2024.3 commonroad-drivability-checker==2025.4.0 commonroad-clcs==2025.2.0 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
print('commonroad-prediction', version('commonroad-prediction'))
import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import InitialState
from crpred.utility.config import PredictorParams


def lane(centre):
    along = np.gradient(centre, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return Lanelet(centre + 2.0 * left, centre, centre - 2.0 * left, 1)


def scenario(centre, *cars):
    made = Scenario(0.1)
    made.add_objects(LaneletNetwork.create_from_lanelet_list([lane(centre)]))
    for number, (place, heading, speed, acceleration, yaw_rate) in enumerate(cars):
        state = InitialState(time_step=0, position=np.array(place), orientation=heading, velocity=speed,
                             acceleration=acceleration, yaw_rate=yaw_rate, slip_angle=0.0)
        made.add_objects(DynamicObstacle(10 + number, ObstacleType.CAR, Rectangle(4.5, 1.8), state))
    return made


straight = np.column_stack([np.arange(0.0, 500.0, 2.0), np.zeros(250)])
from crpred.basic_models.constant_acceleration_predictor import ConstantAccelerationLinearPredictor

params = PredictorParams(num_steps_prediction=40)
car = ConstantAccelerationLinearPredictor(params).predict(
    scenario(straight, ((20.0, 0.0), 0.0, 5.0, -3.0, 0.0)), 0).dynamic_obstacles[0]
states = car.prediction.trajectory.state_list
for s in states[::6]:
    print(f'step {s.time_step}: x {s.position[0]:.2f} m, velocity {s.velocity:.2f} m/s, orientation {s.orientation:.2f} rad')
x, v = np.array([s.position[0] for s in states]), np.array([s.velocity for s in states])
ok = x.max() - x[-1] > 6.0 and v.min() >= 0.0 and v[-1] > 5.0 and abs(states[-1].orientation) < 1e-6
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
