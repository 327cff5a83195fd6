#!/usr/bin/env bash
# CommonRoad-CriMe: of cars that appear late in a recording, no collision is found.
#
# Expected: a scene has the same criticality whether its first time step is 0, 30 or 100. A car at 10 m/s,
# 25.5 m behind one at 2 m/s, touches it after 3.2 s and can wait 2.6 s before it brakes.
# What happens: time steps are counted up to the number of states of the ego's trajectory, as if it began
# at step 0. For a trajectory of 60 states from step 100 on nothing is left to look at: DCE, TTCE, TTC* and TTB
# are infinite and TIT and TET are 0. From step 30 on the collision is past the end of the loop as well, and DCE
# is the distance of the last step that is still looked at. TTC and THW of the same scenes are right.
# Why it matters: in recorded traffic cars come into view at any step; those that come late are never
# critical, and statistics over a recording hang on where it was cut.
#
# Output seen:
#   commonroad-crime 0.4.5
#   first step   0: TTC 3.19 s, THW 2.60 s, DCE 0.00 m, TTCE 3.20 s, TTC* 3.20 s, TTB 2.60 s, TIT 1.92, TET 2.00 s
#   first step  30: TTC 3.19 s, THW 2.60 s, DCE 2.30 m, TTCE 2.90 s, TTC* inf s, TTB inf s, TIT 1.55, TET 1.80 s
#   first step 100: TTC 3.19 s, THW 2.60 s, DCE inf m, TTCE inf s, TTC* inf s, TTB inf s, TIT 0.00, TET 0.00 s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check --no-compile --no-deps casadi==3.8.2 commonroad-clcs==2025.2.0 commonroad-crime==0.4.5 commonroad-drivability-checker==2025.3.1 commonroad-io==2024.3 commonroad-reach==2025.2.0 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 ImageIO==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 opencv-python-headless==4.14.0.94 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 seaborn==0.13.2 shapely==2.2.0 six==1.17.0 tqdm==4.70.1 antlr4-python3-runtime==4.9.3
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
from commonroad_crime.measure import DCE, TET, THW, TIT, TTB, TTC, TTCE, TTCStar

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def scene(first):
    """A car at 10 m/s behind one at 2 m/s on a straight lane, both seen for 6 s from some step on."""
    made, along = Scenario(0.1), np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) for side in (1.75, 0.0, -1.75))
    made.add_objects(Lanelet(left, middle, right, 1))
    for name, start, speed in ((10, 0.0, 10.0), (11, 30.0, 2.0)):
        states = [dict(time_step=first + k, position=np.array([start + 0.1 * speed * k, 0.0]), orientation=0.0,
                       velocity=speed, acceleration=0.0, yaw_rate=0.0) for k in range(61)]
        path = Trajectory(first + 1, [CustomState(**state) for state in states[1:]])
        shape = Rectangle(4.5, 1.8)
        made.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, InitialState(slip_angle=0.0, **states[0]),
                                         TrajectoryPrediction(path, shape)))
    made.assign_obstacles_to_lanelets()
    return made


def asked(measure, first):
    config = CriMeConfiguration()
    config.update(ego_id=10, sce=scene(first))
    of = {} if measure in (TTCStar, TTB) else dict(vehicle_id=11)
    return float(measure(config).compute(time_step=first, verbose=False, **of))


named = {TTC: 'TTC {:.2f} s', THW: 'THW {:.2f} s', DCE: 'DCE {:.2f} m', TTCE: 'TTCE {:.2f} s', TTCStar: 'TTC* {:.2f} s',
         TTB: 'TTB {:.2f} s', TIT: 'TIT {:.2f}', TET: 'TET {:.2f} s'}
found = {}
for first in (0, 30, 100):
    found[first] = {measure: asked(measure, first) for measure in named}
    print(f'first step {first:3d}: ' + ', '.join(text.format(found[first][measure]) for measure, text in named.items()))
early, late = found[0], found[100]
ok = early[DCE] == 0.0 and abs(early[TTCE] - 3.2) < 0.01 and abs(early[TTCStar] - 3.2) < 0.01 and early[TET] > 1.9
ok = ok and all(late[measure] == math.inf for measure in (DCE, TTCE, TTCStar, TTB)) and late[TIT] == late[TET] == 0.0
ok = ok and all(late[measure] == early[measure] for measure in (TTC, THW)) and found[30][DCE] > 2.0
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
