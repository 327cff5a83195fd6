#!/usr/bin/env bash
# CommonRoad-CriMe: the worst-case time to collision of two cars that drive at each other is longer the closer they are.
#
# Expected: WTTC is the first time at which the two, each accelerating as it can in the worst direction, may touch: head-on at
# 30 m/s each 1.3 s from 100 m, 0.8 s from 60 m and 0.4 s from 30 m.
# What happens: the equation of fourth degree is solved, and of its positive roots the first in the list is taken, which is
# not the smallest. Where the two are fast and close they may touch, are past each other, and may touch again
# when they have turned: three roots, of which the last is taken. Head-on it is 3.8 s from 60 m and 4.6 s from 30 m; 20 m
# behind a car that stands, at 40 m/s, 2.8 s instead of 0.4 s. With one root, as from 100 m, it is right.
# Why it matters: WTTC is a lower bound by which scenes are left out as harmless; of the most critical ones it is ten times
# too large, the more the closer they are.
#
# Output seen:
#   commonroad-crime 0.4.5
#   head-on at 30 m/s each, 100 m: WTTC 1.3 s, may touch from 1.30 s on
#   head-on at 30 m/s each, 60 m: WTTC 3.8 s, may touch from 0.83 s on
#   head-on at 30 m/s each, 30 m: WTTC 4.6 s, may touch from 0.43 s on
#   at 40 m/s behind one that stands, 40 m: WTTC 0.8 s, may touch from 0.77 s on
#   at 40 m/s behind one that stands, 20 m: WTTC 2.8 s, may touch from 0.40 s on
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
from commonroad_crime.measure import WTTC

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def scene(distance, ego, other, heading):
    made, along = Scenario(0.1), np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) for side in (1.75, 0.0, -1.75))
    made.add_objects(Lanelet(left, middle, right, 1))
    cars = ((10, 0.0, ego, 0.0), (11, distance, other, heading))
    for name, start, speed, toward in cars:
        along = np.array([math.cos(toward), math.sin(toward)])
        states = [dict(time_step=k, position=[start, 0.0] + 0.1 * speed * k * along, orientation=toward, velocity=speed,
                       acceleration=0.0, yaw_rate=0.0) for k in range(8)]
        path = Trajectory(1, [CustomState(**state) for state in states[1:]])
        shape = Rectangle(4.5, 1.8)
        made.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, InitialState(slip_angle=0.0, **states[0]),
                                         TrajectoryPrediction(path, shape)))
    made.assign_obstacles_to_lanelets()
    config = CriMeConfiguration()
    config.update(ego_id=10, sce=made)
    return config


def first_touch(config, distance, ego, other, heading):
    """The first time at which discs around both, growing by the largest acceleration, touch, in steps of a millisecond."""
    both = 2.0 * config.vehicle.params.longitudinal.a_max
    radii = 2.0 * math.hypot(4.5 / 6.0, 1.8 / 2.0)
    t = np.arange(0.0, 10.0, 1e-3)
    apart = np.hypot(distance + (other * math.cos(heading) - ego) * t, other * math.sin(heading) * t)
    return float(t[apart <= radii + 0.5 * both * t**2][0])


ok = True
for text, ego, other, heading, distances in (('head-on at 30 m/s each', 30.0, 30.0, math.pi, (100.0, 60.0, 30.0)),
                                             ('at 40 m/s behind one that stands', 40.0, 0.0, 0.0, (40.0, 20.0))):
    for distance in distances:
        config = scene(distance, ego, other, heading)
        found = float(WTTC(config).compute(vehicle_id=11, time_step=0, verbose=False))
        first = first_touch(config, distance, ego, other, heading)
        print(f'{text}, {distance:.0f} m: WTTC {found:.1f} s, may touch from {first:.2f} s on')
        ok = ok and (abs(found - first) < 0.1 if distance == distances[0] else found > 4.0 * first and found > 2.0)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
