#!/usr/bin/env bash
# CommonRoad-CriMe: a car brakes harder where its road runs diagonally on the map.
#
# Expected: the Time-To-Brake does not hang on how the map is turned. By the deceleration of
# 8 m/s² in CriMe's settings, a car at 10 m/s, 40 m behind one that stands, can wait 2.9 s.
# What happens: the settings limit x and y of the acceleration on the map, each by 8 m/s². Along
# an axis that is 8 m/s²; at 45 degrees both add up to 11.3 m/s² (as much as the vehicle's own
# limit of 11.5 lets through), and the TTB, in steps of 0.1 s, is 0.2 s later.
# Why it matters: TTB, and the TTR that is the largest of it and others, of streets in different
# directions, or of the same street on a map that was turned, cannot be compared.
#
# Output seen:
#   commonroad-crime 0.4.5
#   heading   0: TTB 2.80 s
#   heading  45: TTB 3.00 s
#   heading  90: TTB 2.80 s
#   heading 135: TTB 3.00 s
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps casadi==3.8.2 commonroad-clcs==2025.2.0 commonroad-crime==0.4.5 commonroad-drivability-checker==2025.3.1 commonroad-io==2024.3 commonroad-reach==2025.2.0 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 ImageIO==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 opencv-python-headless==4.14.0.94 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 seaborn==0.13.2 shapely==2.2.0 six==1.17.0 tqdm==4.70.1 antlr4-python3-runtime==4.9.3
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

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def scene(heading, gap):
    """A car at 10 m/s towards one that stands, on a straight lane that runs in some direction."""
    turn = np.array([[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]])
    along = np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) @ turn.T for side in (1.75, 0.0, -1.75))
    made = Scenario(0.1)
    made.add_objects(Lanelet(left, middle, right, 1))
    for name, start, speed in ((10, 0.0, 10.0), (11, gap, 0.0)):
        states = [dict(time_step=k, position=turn @ [start + 0.1 * speed * k, 0.0], orientation=heading, velocity=speed,
                       acceleration=0.0, yaw_rate=0.0) for k in range(81)]
        path = Trajectory(1, [CustomState(**state) for state in states[1:]])
        shape = Rectangle(4.5, 1.8)
        made.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, InitialState(slip_angle=0.0, **states[0]),
                                         TrajectoryPrediction(path, shape)))
    made.assign_obstacles_to_lanelets()
    return made


def asked(measure, heading, gap, **of):
    config = CriMeConfiguration()
    config.update(ego_id=10, sce=scene(math.radians(heading), gap))
    return float(measure(config).compute(time_step=0, verbose=False, **of))


from commonroad_crime.measure import TTB

found = {}
for heading in (0, 45, 90, 135):
    found[heading] = asked(TTB, heading, 40.0)
    print(f'heading {heading:3d}: TTB {found[heading]:.2f} s')
ok = all(abs(found[h] - (2.8 if h % 90 == 0 else 3.0)) < 0.01 for h in found)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
