#!/usr/bin/env bash
# commonroad-reach: static obstacles that are polygons or circles are not there.
#
# Expected: a blocked road bounds what can be reached in front of the block, whatever shape the block has; a
# shape that is not supported raises, as it does for dynamic obstacles.
# What happens: of the static obstacles only rectangles and groups of shapes are handed to the collision checker;
# polygons and circles are left out without a word. A block 35 m ahead of a car at 15 m/s bounds what it reaches in 2 s
# if it is a rectangle, a group of one, or a polygon that is a dynamic obstacle and does not move. For a static
# polygon or circle the set is that of an empty road, 19 m longer and 70 % larger. Both backends agree.
# A circle as a dynamic obstacle is there, with half of its radius (that of commonroad-io's Shapely object).
# Why it matters: kerbs, building sites and what comes from point clouds are static polygons. "Not
# reachable" is what proofs of safety and driving corridors rest on.
#
# Output seen:
#   commonroad-reach 2025.2.1
#   Python static  none         reaches  53.2 m, 222 m²
#   Python static  rectangle    reaches  34.2 m, 131 m²
#   Python dynamic rectangle    reaches  34.2 m, 131 m²
#   Python static  group of one reaches  34.2 m, 131 m²
#   Python static  polygon      reaches  53.2 m, 222 m²
#   Python dynamic polygon      reaches  34.2 m, 131 m²
#   Python static  circle       reaches  53.2 m, 222 m²
#   Python dynamic circle       reaches  37.6 m, 147 m²
#   C++    static  none         reaches  53.2 m, 222 m²
#   C++    static  rectangle    reaches  34.2 m, 131 m²
#   C++    dynamic rectangle    reaches  34.2 m, 131 m²
#   C++    static  group of one reaches  34.2 m, 131 m²
#   C++    static  polygon      reaches  53.2 m, 222 m²
#   C++    dynamic polygon      reaches  34.2 m, 131 m²
#   C++    static  circle       reaches  53.2 m, 222 m²
#   C++    dynamic circle       reaches  37.6 m, 147 m²
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv --without-pip "$dir/venv"
python3 -m pip --python "$dir/venv/bin/python" --quiet --disable-pip-version-check install --no-compile --no-deps commonroad-clcs==2025.2.0 commonroad-drivability-checker==2025.4.0 commonroad-reach==2025.2.1 joblib==1.6.0 threadpoolctl==3.8.0 scikit-learn==1.9.1 triangle==20250106 methodtools==0.4.7 wirerope==1.0.0 Cython==3.3.1 opencv-python-headless==4.14.0.94 commonroad-io==2024.3 commonroad-route-planner==2025.1.0 commonroad-vehicle-models==3.0.2 contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 imageio==2.38.1 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 antlr4-python3-runtime==4.9.3 osqp==0.6.7.post3 packaging==26.4 pandas==3.1.1 pillow==13.0.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==4.0.0 PyYAML==6.0.4 qdldl==0.1.9.post1 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import contextlib
import io
import os
from importlib.metadata import version

import numpy as np
from commonroad.common.util import Interval
from commonroad.geometry.shape import Circle, Polygon, Rectangle, ShapeGroup
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_reach.data_structure.configuration_builder import ConfigurationBuilder
from commonroad_reach.data_structure.reach.reach_interface import ReachableSetInterface

print('commonroad-reach', version('commonroad-reach'))
BLOCK, STEPS = 40.0, 20
CORNERS = np.array([[-5.0, -3.4], [5.0, -3.4], [5.0, 3.4], [-5.0, 3.4]])
SHAPES = {'none': None, 'rectangle': Rectangle(10.0, 6.8), 'group of one': ShapeGroup([Rectangle(10.0, 6.8)]),
          'polygon': Polygon(CORNERS), 'circle': Circle(3.4)}


def at(x, velocity):
    return InitialState(time_step=0, position=np.array([x, 0.0]), orientation=0.0, velocity=velocity, acceleration=0.0,
                        yaw_rate=0.0, slip_angle=0.0)


def reach(shape, dynamic, backend):
    """How far ahead of its start a car at 15 m/s can be after 2 s, and the area it can be in."""
    scenario = Scenario(0.1)
    x = np.arange(-50.0, 601.0, 5.0)
    scenario.add_objects(Lanelet(np.c_[x, 0 * x + 3.5], np.c_[x, 0 * x], np.c_[x, 0 * x - 3.5], 1))
    if shape is not None and dynamic:
        stays = [KSState(time_step=k, position=np.array([BLOCK, 0.0]), orientation=0.0, velocity=0.0, steering_angle=0.0)
                 for k in range(1, 61)]
        scenario.add_objects(DynamicObstacle(10, ObstacleType.CAR, shape, at(BLOCK, 0.0),
                                             TrajectoryPrediction(Trajectory(1, stays), shape)))
    elif shape is not None:
        scenario.add_objects(StaticObstacle(10, ObstacleType.PARKED_VEHICLE, shape, at(BLOCK, 0.0)))
    goal = CustomState(time_step=Interval(0, 1000), position=Rectangle(20.0, 7.0, np.array([400.0, 0.0])))
    with contextlib.redirect_stdout(io.StringIO()):
        settings = ConfigurationBuilder(path_root=os.getcwd()).build_configuration('block')
        settings.planning.steps_computation, settings.reachable_set.mode_computation = STEPS, backend
        settings.update(scenario=scenario, planning_problem=PlanningProblem(1, at(0.0, 15.0), GoalRegion([goal])))
        found = ReachableSetInterface(settings)
        found.compute_reachable_sets()
    boxes = [area.bounds for area in found.drivable_area_at_step(STEPS)]
    return (round(max(b[2] for b in boxes) - settings.planning.p_lon_initial, 1),
            round(sum((b[2] - b[0]) * (b[3] - b[1]) for b in boxes)))


found = {}
for backend, language in ((1, 'Python'), (2, 'C++')):
    for name, shape in SHAPES.items():
        for dynamic in ((False,) if name in ('none', 'group of one') else (False, True)):
            found[name, dynamic, backend] = far, area = reach(shape, dynamic, backend)
            print(f'{language:6s} {"dynamic" if dynamic else "static "} {name:12s} reaches {far:5.1f} m, {area} m²')
ok = True
for backend in (1, 2):
    free, blocked = found['none', False, backend], found['rectangle', False, backend]
    ok = ok and blocked[0] < BLOCK - 5.0 < BLOCK < free[0]
    ok = ok and found['polygon', False, backend] == found['circle', False, backend] == free
    ok = ok and all(found[key + (backend,)] == blocked
                    for key in (('group of one', False), ('rectangle', True), ('polygon', True)))
    ok = ok and blocked[0] + 3.0 < found['circle', True, backend][0] < free[0]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
