#!/usr/bin/env bash
# CommonRoad-CriMe: asking for the time to the zebra crossing puts road works on the road, after which other measures fail.
#
# Expected: TTZ is the distance to the crossing by the speed, and the scenario is afterwards what it was.
# What happens: of each crosswalk an obstacle (a construction zone) is made, added to the scenario for a TTC, and stays: one
# more with each call. Its state has no time step, so that whatever builds a collision checker from the scenario
# (TTC*, TTB and others) raises AssertionError from then on, where TTC* was inf before. The crosswalk's polygon,
# already as it lies on the map, is turned by its heading once more: 10 m across the road and 4 m along it become 4 m
# and 10 m. The time is that to its middle, 2.78 s where the front reaches the crossing after 2.58 s.
# Why it matters: measures are computed one after another on a scenario; which of them work hangs on their order, and a
# scenario that is saved afterwards has a road that is closed at its crossings.
#
# Output seen:
#   commonroad-crime 0.4.5
#   before: 0 static obstacles, TTC* inf s
#   TTZ 2.78 s; the front is at the crossing after 2.58 s
#   after 1: 1 static obstacles, constructionZone; TTC* AssertionError: <Occupancy/time_step>:
#   TTZ 2.78 s; the front is at the crossing after 2.58 s
#   after 2: 2 static obstacles, constructionZone; TTC* AssertionError: <Occupancy/time_step>:
#   crosswalk: 4.0 m along the road, 10.0 m across it
#   obstacle: 10.0 m along the road, 4.0 m across it
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps casadi==3.8.2 commonroad-clcs==2025.2.0 commonroad-crime==0.4.5 commonroad-drivability-checker==2025.3.1 commonroad-io==2024.3 commonroad-reach==2025.2.0 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 Cython==3.3.1 fonttools==4.68.0 ImageIO==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 opencv-python-headless==4.14.0.94 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 seaborn==0.13.2 shapely==2.2.0 six==1.17.0 tqdm==4.70.1 antlr4-python3-runtime==4.9.3
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import contextlib
import logging
import math
from importlib.metadata import version

import numpy as np
from commonroad.geometry.shape import Rectangle
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet, LaneletType
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState
from commonroad.scenario.trajectory import Trajectory
from commonroad_crime.data_structure.configuration import CriMeConfiguration
from commonroad_crime.measure import TTZ, TTCStar

logging.disable(logging.CRITICAL)
print('commonroad-crime', version('commonroad-crime'))


def scene():
    """Two cars at 10 m/s, far from each other, and 30 m ahead of the first a crosswalk of 4 m over 10 m of road."""
    made, along = Scenario(0.1), np.linspace(-50.0, 250.0, 301)
    left, middle, right = (np.column_stack([along, np.full_like(along, side)]) for side in (5.0, 0.0, -5.0))
    made.add_objects(Lanelet(left, middle, right, 1))
    over = np.linspace(-5.0, 5.0, 11)
    bounds = (np.column_stack([np.full_like(over, 30.0 + side), over]) for side in (-2.0, 0.0, 2.0))
    made.add_objects(Lanelet(*bounds, 2, lanelet_type={LaneletType.CROSSWALK}))
    cars = ((10, 0.0, 10.0, 0.0), (11, 200.0, 10.0, 0.0))
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


def star(config):
    try:
        return f'{float(TTCStar(config).compute(time_step=0, verbose=False))} s'
    except AssertionError as error:
        return f'AssertionError: {str(error)[:22]}'


before = star(scene())
config = scene()
print(f'before: {len(config.scenario.static_obstacles)} static obstacles, TTC* {before}')
ok = before == 'inf s'
for calls in (1, 2):
    with contextlib.redirect_stdout(None):
        times = float(TTZ(config).compute(time_step=0, verbose=False))
    print(f'TTZ {times:.2f} s; the front is at the crossing after {(28.0 - 2.25) / 10.0:.2f} s')
    blocks = config.scenario.static_obstacles
    after = star(config)
    print(f'after {calls}: {len(blocks)} static obstacles, {blocks[0].obstacle_type.value}; TTC* {after}')
    ok = ok and abs(times - 2.775) < 0.01 and len(blocks) == calls and after.startswith('AssertionError')
lies = blocks[0].obstacle_shape.rotate_translate_local(blocks[0].initial_state.position, blocks[0].initial_state.orientation)
for name, vertices in (('crosswalk', config.scenario.lanelet_network.find_lanelet_by_id(2).polygon.vertices), ('obstacle', lies.vertices)):
    along, across = np.ptp(vertices, axis=0)
    print(f'{name}: {along:.1f} m along the road, {across:.1f} m across it')
ok = ok and abs(along - 10.0) < 0.01 and abs(across - 4.0) < 0.01
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
