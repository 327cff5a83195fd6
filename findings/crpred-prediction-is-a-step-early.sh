#!/usr/bin/env bash
# commonroad-prediction: constant velocity puts the car one time step ahead.
#
# Expected: predict(scenario, 0) starts at the state that the obstacle has at step 0,
# or at step 1 with the state after one step.
# What happens: the first predicted state carries the time step of the initial state and
# the place one step later. At every step the car is v * dt too far on: 2 m at 20 m/s
# and 0.1 s. The obstacle then has two places at step 0, the initial state's and the
# prediction's; the same in all four motion models.
# Why it matters: the bumper gap to a lead vehicle is too large, the one to a follower too
# small, by more than a usual safety margin.
#
# Output seen:
#   commonroad-prediction 0.1.2
#   ConstantVelocityLinearPredictor: step 0, +2.00 m; step 10, +2.00 m
#   ConstantVelocityCurvilinearPredictor: step 0, +2.00 m; step 10, +2.00 m
#   ConstantAccelerationLinearPredictor: step 0, +2.00 m; step 10, +2.00 m
#   ConstantAccelerationCurvilinearPredictor: step 0, +2.00 m; step 10, +2.00 m
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
from crpred.basic_models.constant_acceleration_predictor import (ConstantAccelerationCurvilinearPredictor,
                                                                 ConstantAccelerationLinearPredictor)
from crpred.basic_models.constant_velocity_predictor import (ConstantVelocityCurvilinearPredictor,
                                                             ConstantVelocityLinearPredictor)

params, found = PredictorParams(num_steps_prediction=40), []
for model in (ConstantVelocityLinearPredictor, ConstantVelocityCurvilinearPredictor,
              ConstantAccelerationLinearPredictor, ConstantAccelerationCurvilinearPredictor):
    car = model(params).predict(scenario(straight, ((20.0, 0.0), 0.0, 20.0, 0.0, 0.0)), 0).dynamic_obstacles[0]
    first = car.prediction.trajectory.state_list[0]
    found.append((first.time_step, float(first.position[0]) - 20.0, float(car.state_at_time(10).position[0]) - 40.0))
    print(f'{model.__name__}: step {first.time_step}, {found[-1][1]:+.2f} m; step 10, {found[-1][2]:+.2f} m')
ok = all(step == 0 and abs(at_0 - 2.0) < 1e-3 and abs(at_10 - 2.0) < 1e-3 for step, at_0, at_10 in found)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
