#!/usr/bin/env bash
# CommonRoad-CriMe: on a road that runs north on the map a car needs 0 m to stop, and its braking jerk is a lateral one.
#
# Expected: longitudinal jerk (LongJ) and lateral jerk (LatJ) are along and across the vehicle; a car that begins to brake by
# 5 m/s³ on a straight road has 5 and 0 m/s³, and a stopping distance (MSD) of v^2 / 2a, whichever way the road runs.
# What happens: the jerk along the vehicle is divided by the cosine and the sine of the lane's heading on the map: it is 5 and
# 0 m/s³ eastwards, 3.54 and 3.54 m/s³ to the north-east, 0 and 5 m/s³ northwards. A jerk across the vehicle is in neither.
# The speed for MSD is multiplied by that cosine: half of the distance to the north-east, 0 m northwards.
# Why it matters: northwards no scene is critical by MSD and PSD, which divides by it; comfort limits differ along and
# across, and passengers of a car that brakes northwards are, by these measures, thrown to the side.
#
# Output seen:
#   commonroad-crime 0.4.5
#   east: LongJ 5.00 m/s³, LatJ 0.00 m/s³, MSD 4.26 m
#   north-east: LongJ 3.54 m/s³, LatJ 3.54 m/s³, MSD 2.13 m
#   north: LongJ 0.00 m/s³, LatJ 5.00 m/s³, MSD 0.00 m
#   west: LongJ 5.00 m/s³, LatJ 0.00 m/s³, MSD 4.26 m
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
from commonroad_crime.measure import MSD, LatJ, LongJ

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def braking(heading):
    """A car at 10 m/s, at first, on a straight road with some heading, that brakes with a jerk of 5 m/s³."""
    along, aside = np.array([math.cos(heading), math.sin(heading)]), np.array([-math.sin(heading), math.cos(heading)])
    made, places = Scenario(0.1), np.linspace(-50.0, 250.0, 301)[:, None]
    made.add_objects(Lanelet(*(places * along + side * aside for side in (1.75, 0.0, -1.75)), 1))
    t = 0.1 * np.arange(8)
    states = [dict(time_step=k, position=(10.0 * t[k] - 5.0 * t[k] ** 3 / 6.0) * along, orientation=heading,
                   velocity=10.0 - 2.5 * t[k] ** 2, acceleration=-5.0 * t[k], yaw_rate=0.0) for k in range(8)]
    shape, path = Rectangle(4.5, 1.8), Trajectory(1, [CustomState(**state) for state in states[1:]])
    made.add_objects(DynamicObstacle(10, ObstacleType.CAR, shape, InitialState(slip_angle=0.0, **states[0]),
                                     TrajectoryPrediction(path, shape)))
    made.assign_obstacles_to_lanelets()
    config = CriMeConfiguration()
    config.update(ego_id=10, sce=made)
    return config


ok, east = True, 0.0
for name, degrees in (('east', 0.0), ('north-east', 45.0), ('north', 90.0), ('west', 180.0)):
    heading = math.radians(degrees)
    along, across, stop = (float(measure(braking(heading)).compute(time_step=2, verbose=False)) for measure in (LongJ, LatJ, MSD))
    print(f'{name}: LongJ {along:.2f} m/s³, LatJ {across:.2f} m/s³, MSD {stop:.2f} m')
    east = stop if degrees == 0.0 else east
    ok = ok and abs(along - abs(5.0 * math.cos(heading))) < 0.01 and abs(across - abs(5.0 * math.sin(heading))) < 0.01
    ok = ok and east > 4.0 and abs(stop - east * math.cos(heading) ** 2) < 0.02
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
