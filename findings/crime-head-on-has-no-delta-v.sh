#!/usr/bin/env bash
# CommonRoad-CriMe: Delta-v of a head-on crash is 0, and largest for two cars that drive along together.
#
# Expected: two equal cars that stick together change their speed by half of their relative velocity: at
# 20 m/s each 0 m/s if both drive the same way, 14.1 m/s at right angles, 20 m/s head-on.
# What happens: the speeds are added with the cosine of the angle between the headings where they should be
# subtracted: 20 m/s for the car in front that is just as fast, 0 m/s for oncoming traffic. Running into
# a standing car is right (10 m/s) by the same formula, which is why it is easily believed.
# Why it matters: ranked by severity, the worst crashes come last and car-following comes first.
#
# Output seen:
#   commonroad-crime 0.4.5
#   other car at 20 m/s, heading   0 from the ego's: Delta-v 20.00 m/s, of the relative velocity  0.00 m/s
#   other car at 20 m/s, heading  90 from the ego's: Delta-v 10.00 m/s, of the relative velocity 14.14 m/s
#   other car at 20 m/s, heading 180 from the ego's: Delta-v 0.00 m/s, of the relative velocity 20.00 m/s
#   other car at  0 m/s, heading   0 from the ego's: Delta-v 10.00 m/s, of the relative velocity 10.00 m/s
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
from commonroad_crime.measure import DeltaV

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def delta_v(speed, heading):
    """Of an ego at 20 m/s heading east and an equal car with some speed and heading."""
    made, along = Scenario(0.1), np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) for side in (1.75, 0.0, -1.75))
    made.add_objects(Lanelet(left, middle, right, 1))
    for name, start, v, toward in ((10, 0.0, 20.0, 0.0), (11, 30.0, speed, heading)):
        along = np.array([math.cos(toward), math.sin(toward)])
        states = [dict(time_step=k, position=[start, 0.0] + 0.1 * v * k * along, orientation=toward, velocity=v,
                       acceleration=0.0, yaw_rate=0.0) for k in range(8)]
        path = Trajectory(1, [CustomState(**state) for state in states[1:]])
        shape = Rectangle(4.5, 1.8)
        made.add_objects(DynamicObstacle(name, ObstacleType.CAR, shape, InitialState(slip_angle=0.0, **states[0]),
                                         TrajectoryPrediction(path, shape)))
    made.assign_obstacles_to_lanelets()
    config = CriMeConfiguration()
    config.update(ego_id=10, sce=made)
    return float(DeltaV(config).compute(time_step=0, vehicle_id=11, verbose=False))


found, right = {}, {}
for speed, heading in ((20.0, 0), (20.0, 90), (20.0, 180), (0.0, 0)):
    angle = math.radians(heading)
    found[speed, heading] = delta_v(speed, angle)
    right[speed, heading] = 0.5 * math.hypot(20.0 - speed * math.cos(angle), speed * math.sin(angle))
    print(f"other car at {speed:2.0f} m/s, heading {heading:3d} from the ego's: Delta-v {found[speed, heading]:.2f} m/s, "
          f'of the relative velocity {right[speed, heading]:5.2f} m/s')
ok = abs(found[20.0, 0] - 20.0) < 0.01 and abs(found[20.0, 90] - 10.0) < 0.01 and abs(found[20.0, 180]) < 0.01
ok = ok and abs(found[0.0, 0] - right[0.0, 0]) < 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
