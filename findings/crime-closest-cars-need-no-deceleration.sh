#!/usr/bin/env bash
# CommonRoad-CriMe: the deceleration to safety time is negative for whoever does not keep it, and least for the closest.
#
# Expected: DST is the deceleration by which a car comes to a safety time (2 s by default) behind the one in front: the larger
# the closer and the faster it is, and 0 for one that is slower; where the safety time is lost already it is none, or infinite.
# What happens: 3 dv^2 / (2 (gap - v t)) is used on both sides of its pole. At 20 m/s, behind a car at 15 m/s, it is 7.5 m/s² at
# 35 m, 37.5 m/s² at 31 m, -37.5 m/s² at 29 m and -1.5 m/s² at 5 m. A car at 15 m/s, 35 m behind one at
# 20 m/s, has -7.5 m/s², and one at 10 m/s at 60 m +7.5 m/s², although the gap grows.
# Why it matters: who follows at less than 2 s is most of motorway traffic. By the measure's own order (larger is more
# critical) a car 5 m from the crash comes after every car that keeps its distance.
#
# Output seen:
#   commonroad-crime 0.4.5
#   20 m/s, 60 m behind a car at 15 m/s, so 4.0 s (safety time 2 s): DST +1.25 m/s²
#   20 m/s, 35 m behind a car at 15 m/s, so 2.3 s (safety time 2 s): DST +7.50 m/s²
#   20 m/s, 31 m behind a car at 15 m/s, so 2.1 s (safety time 2 s): DST +37.50 m/s²
#   20 m/s, 29 m behind a car at 15 m/s, so 1.9 s (safety time 2 s): DST -37.50 m/s²
#   20 m/s, 20 m behind a car at 15 m/s, so 1.3 s (safety time 2 s): DST -3.75 m/s²
#   20 m/s,  5 m behind a car at 15 m/s, so 0.3 s (safety time 2 s): DST -1.50 m/s²
#   15 m/s, 35 m behind a car at 20 m/s, so 1.8 s (safety time 2 s): DST -7.50 m/s²
#   10 m/s, 60 m behind a car at 20 m/s, so 3.0 s (safety time 2 s): DST +7.50 m/s²
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
from commonroad_crime.measure import DST

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def scene(gap, ego, other):
    made, along = Scenario(0.1), np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) for side in (1.75, 0.0, -1.75))
    made.add_objects(Lanelet(left, middle, right, 1))
    cars = ((10, 0.0, ego, 0.0), (11, gap + 4.5, other, 0.0))
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


ok = True
for gap, ego, other, seen in ((60.0, 20.0, 15.0, 1.25), (35.0, 20.0, 15.0, 7.5), (31.0, 20.0, 15.0, 37.5), (29.0, 20.0, 15.0, -37.5),
                              (20.0, 20.0, 15.0, -3.75), (5.0, 20.0, 15.0, -1.5), (35.0, 15.0, 20.0, -7.5), (60.0, 10.0, 20.0, 7.5)):
    config = scene(gap, ego, other)
    found = float(DST(config).compute(vehicle_id=11, time_step=0, verbose=False))
    print(f'{ego:.0f} m/s, {gap:2.0f} m behind a car at {other:.0f} m/s, so {gap / other:.1f} s '
          f'(safety time {config.acceleration.safety_time} s): DST {found:+.2f} m/s²')
    ok = ok and abs(found - seen) < 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
