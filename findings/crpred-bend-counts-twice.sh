#!/usr/bin/env bash
# commonroad-prediction: a car that keeps its lane in a bend is predicted off the road.
#
# Expected: the "curvilinear" constant velocity model, in coordinates along the lane, keeps a
# car on the centre line that drives along it with the yaw rate of the bend, v / R.
# What happens: the measured yaw rate is added to the heading relative to the lane, which turns
# by itself: the bend counts twice. In a bend of R = 50 m at 10 m/s the car is 0.9 m inside
# after 1 s, off its lane after 2 s and 15 m off after 4 s; the "linear" model keeps the lane.
# A car that drives straight on (yaw rate 0) on the same lane is predicted to follow the bend.
# Why it matters: predictions of good measurements are worse than those of none; every car in a
# bend is predicted across the neighbouring lane.
#
# Output seen:
#   commonroad-prediction 0.1.2
#   ConstantVelocityCurvilinearPredictor, yaw rate 0.2 rad/s: inside of the centre line after 1, 2, 4 s 0.90, 3.75, 14.79 m
#   ConstantVelocityCurvilinearPredictor, yaw rate 0.0 rad/s: inside of the centre line after 1, 2, 4 s -0.00, -0.00, -0.00 m
#   ConstantVelocityLinearPredictor, yaw rate 0.2 rad/s: inside of the centre line after 1, 2, 4 s -0.00, -0.00, -0.00 m
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
from crpred.basic_models.constant_velocity_predictor import (ConstantVelocityCurvilinearPredictor,
                                                             ConstantVelocityLinearPredictor)

radius, speed = 50.0, 10.0
angle = np.linspace(0.0, 1.5 * np.pi, 400)
bend = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
place, heading = tuple(bend[40]), float(angle[40])
params, found = PredictorParams(num_steps_prediction=40), {}
for model, yaw_rate in ((ConstantVelocityCurvilinearPredictor, speed / radius),
                        (ConstantVelocityCurvilinearPredictor, 0.0), (ConstantVelocityLinearPredictor, speed / radius)):
    car = model(params).predict(scenario(bend, (place, heading, speed, 0.0, yaw_rate)), 0).dynamic_obstacles[0]
    off = [radius - float(np.hypot(s.position[0], s.position[1] - radius)) for s in car.prediction.trajectory.state_list]
    found[model.__name__, yaw_rate > 0] = off
    print(f'{model.__name__}, yaw rate {yaw_rate:.1f} rad/s: inside of the centre line after 1, 2, 4 s '
          f'{off[9]:.2f}, {off[19]:.2f}, {off[39]:.2f} m')
twice = found['ConstantVelocityCurvilinearPredictor', True]
others = found['ConstantVelocityCurvilinearPredictor', False], found['ConstantVelocityLinearPredictor', True]
ok = twice[9] > 0.8 and twice[19] > 2.0 and twice[39] > 10.0 and all(max(map(abs, off)) < 0.05 for off in others)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
