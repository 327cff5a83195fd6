#!/usr/bin/env bash
# CommonRoad-CriMe: headway and TTC are right only where the road runs east on the map.
#
# Expected: a scene and the same scene turned on the map have the same headway and TTC. A car at
# 10 m/s, 30 m (25.5 m between the bodies) behind one that stands: 25.5 m and 2.55 s.
# What happens: HW adds half the length of the vehicles to x and to y of their places on the map,
# whatever their heading; TTC multiplies speeds by the cosine of the lanelet's direction on the
# map. Westwards the headway is 34.5 m, half the lengths being added instead of taken away; on
# the diagonal 23.6 m and a TTC of 3.3 s; northwards the TTC is 4e16 s. TTC* of the same scenes,
# by shapes, and THW are 2.6 s in all directions.
# Why it matters: criticality computed over recorded maps depends on which way the streets run;
# BTN, STN and CPI are made of the same distances and speeds, and are 0 for some directions.
#
# Output seen:
#   commonroad-crime 0.4.5
#   heading   0: HW 25.50 m, TTC 2.55 s, TTC* 2.60 s
#   heading  45: HW 23.64 m, TTC 3.34 s, TTC* 2.60 s
#   heading  90: HW 25.50 m, TTC 4.2e+16 s, TTC* 2.60 s
#   heading 180: HW 34.50 m, TTC 3.45 s, TTC* 2.60 s
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


from commonroad_crime.measure import HW, TTC, TTCStar

found = {}
for heading in (0, 45, 90, 180):
    gap, ttc = (asked(measure, heading, 30.0, vehicle_id=11) for measure in (HW, TTC))
    star = asked(TTCStar, heading, 30.0)
    found[heading] = gap, ttc, star
    print(f'heading {heading:3d}: HW {gap:.2f} m, TTC {ttc:{".2f" if ttc < 1e3 else ".1e"}} s, TTC* {star:.2f} s')
ok = abs(found[0][0] - 25.5) < 0.1 and abs(found[0][1] - 2.55) < 0.05 and found[180][0] > 34.0 and found[180][1] > 3.4
ok = ok and found[45][0] < 24.0 and 3.2 < found[45][1] < 3.5 and found[90][1] > 1e9
ok = ok and all(abs(star - 2.6) < 0.01 for *_, star in found.values())
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
