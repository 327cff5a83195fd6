#!/usr/bin/env bash
# CommonRoad-CriMe: the harder the car in front brakes, the less deceleration is required.
#
# Expected: at 20 m/s, 35 m behind a car at 15 m/s, the required longitudinal acceleration is about -0.4 m/s²; if
# that car brakes at 4 m/s², it is 4 m/s² stronger. On a lane to the east it is the same as on any other, and of a
# car that drives away from the ego it is 0.
# What happens: the acceleration of the other car is taken as the square root of its square, so that braking
# counts as speeding up: -0.35 m/s² for the steady car and 0 for the braking one. The relative speed is squared
# too: a car that drives away at 5 m/s asks for as much braking as one that is closed in on at 5 m/s. Where
# the lane's direction on the map is exactly 0, all are 0, since 0 is read as "no direction".
# Why it matters: emergency braking of the car in front, for which the measure is made, counts as harmless.
#
# Output seen:
#   commonroad-crime 0.4.5
#   lane at 5 degrees: in front steady -0.35, braking at 4 m/s² 0.00, driving away -0.35 m/s²
#   lane at 0 degrees: in front steady 0.00, braking at 4 m/s² 0.00, driving away 0.00 m/s²
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 commonroad-clcs==2025.2.0 commonroad-crime==0.4.5 commonroad-drivability-checker==2025.3.1 commonroad-io==2024.3 commonroad-reach==2025.2.0 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 ImageIO==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 opencv-python-headless==4.14.0.94 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 seaborn==0.13.2 shapely==2.2.0 six==1.17.0 tqdm==4.70.1 antlr4-python3-runtime==4.9.3
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import logging
import math
from importlib.metadata import version

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure import ALongReq

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def required(degrees, speed, braking):
    """Of an ego at 20 m/s, 35.5 m behind a car with some speed and deceleration."""
    heading = math.radians(degrees)
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    made, along = Scenario(0.1), np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) @ turn.T for side in (1.75, 0.0, -1.75))
    made.add_objects(Lanelet(left, middle, right, 1))
    for name, start, v, a in ((10, 0.0, 20.0, 0.0), (11, 40.0, speed, -braking)):
        states = [dict(time_step=k, position=turn @ [start + 0.1 * v * k + 0.005 * a * k * k, 0.0], orientation=heading,
                       velocity=v + 0.1 * a * k, acceleration=a, yaw_rate=0.0) for k in range(11)]
        path = Trajectory(1, [CustomState(**state) for state in states[1:]])
        shape = Rectangle(4.5, 1.8)
        made.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, InitialState(slip_angle=0.0, **states[0]),
                                         TrajectoryPrediction(path, shape)))
    made.assign_obstacles_to_lanelets()
    config = CriMeConfiguration()
    config.update(ego_id=10, sce=made)
    return float(ALongReq(config).compute(vehicle_id=11, time_step=0, verbose=False))


found = {}
for degrees in (5, 0):
    found[degrees] = [required(degrees, *other) for other in ((15.0, 0.0), (15.0, 4.0), (25.0, 0.0))]
    print('lane at {} degrees: in front steady {:.2f}, braking at 4 m/s² {:.2f}, driving away {:.2f} m/s²'.format(
        degrees, *found[degrees]))
steady, harder, away = found[5]
ok = -0.4 < steady < -0.3 and harder == 0.0 and away == steady and found[0] == [0.0, 0.0, 0.0]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
