#!/usr/bin/env bash
# drivability checker: a car 3 m beside the road is on it, and each way to make the road's edge has another end of the map.
#
# Expected: boundary_collision, a part of valid_solution, raises for a vehicle off the road, the more surely the
# farther; create_road_boundary_obstacle makes "the road boundary" by one of three methods, with one answer.
# What happens: the official check's boundary is a band around the road, not all that is no road. A car whose way lies
# across the edge, or its middle 1 m beyond, is rejected; at 3 m, no part of it near the road, it "stays in lanes". The default
# method is a wall of no width along both sides: 1 m beyond is fine again, and at the map's ends it is open, so that a car may
# drive on out of the map, which the official check rejects. aligned_triangulation fills all around.
# Why it matters: starts, samples and predictions beside the road pass as drivable, and a planner that checks its
# trajectories by the default finds those good that leave at the map's end, until the check of the solution rejects them.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   triangle 20250106
#   in the lane: boundary_collision says on it, obb_rectangles (default) on it, aligned_triangulation on it
#   across the edge: boundary_collision says off the road, obb_rectangles (default) off the road, aligned_triangulation off the road
#   1 m beyond the edge: boundary_collision says off the road, obb_rectangles (default) on it, aligned_triangulation off the road
#   3 m beyond the edge: boundary_collision says on it, obb_rectangles (default) on it, aligned_triangulation off the road
#   on past the end: boundary_collision says off the road, obb_rectangles (default) on it, aligned_triangulation off the road
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2 commonroad-clcs==2025.2.0 triangle==20250106
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
from importlib.metadata import version

import numpy as np
from commonroad.common.solution import CostFunction, PlanningProblemSolution, Solution, VehicleModel, VehicleType
from commonroad.common.util import Interval
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.boundary.boundary import create_road_boundary_obstacle
from commonroad_dc.feasibility.solution_checker import CollisionException, boundary_collision
from commonroad_dc.pycrcc import CollisionChecker, RectOBB

for name in ('commonroad-drivability-checker', 'triangle'):
    print(name, version(name))
LENGTH, WIDTH, CAR_LENGTH, CAR_WIDTH = 200.0, 3.5, 4.508, 1.61
x = np.linspace(0.0, LENGTH, 201)
left, right = np.c_[x, np.full_like(x, WIDTH)], np.c_[x, np.zeros_like(x)]
road = Scenario(0.1, ScenarioID.from_benchmark_id('ZAM_Straight-1_1_T-1', '2020a'))
road.add_objects(Lanelet(left, (left + right) / 2, right, 1))


def official(start, y):
    """Two seconds at 20 m/s along the road."""
    initial = InitialState(time_step=0, position=np.array([start, y]), orientation=0.0, velocity=20.0,
                           yaw_rate=0.0, slip_angle=0.0, acceleration=0.0)
    goal = GoalRegion([CustomState(time_step=Interval(0, 20))])
    states = [KSState(time_step=k, position=np.array([start + 2.0 * k, y]), velocity=20.0, steering_angle=0.0, orientation=0.0) for k in range(21)]
    solution = PlanningProblemSolution(1, VehicleModel.KS, VehicleType.BMW_320i, CostFunction.JB1, Trajectory(0, states))
    try:
        return boundary_collision(road, PlanningProblemSet([PlanningProblem(1, initial, goal)]), Solution(road.scenario_id, [solution]))
    except CollisionException:
        return True


def by_method(method, start, y):
    _, boundary = create_road_boundary_obstacle(road, method=method)
    checker = CollisionChecker()
    checker.add_collision_object(boundary)
    return any(checker.collide(RectOBB(CAR_LENGTH / 2, CAR_WIDTH / 2, 0.0, start + 2.0 * k, y)) for k in range(21))


WAYS = {'in the lane': (50.0, WIDTH / 2), 'across the edge': (50.0, WIDTH), '1 m beyond the edge': (50.0, WIDTH + 1.0),
        '3 m beyond the edge': (50.0, WIDTH + 3.0), 'on past the end': (180.0, WIDTH / 2)}
EXPECTED = {'in the lane': (False, False, False), 'across the edge': (True, True, True), '1 m beyond the edge': (True, False, True),
            '3 m beyond the edge': (False, False, True), 'on past the end': (True, False, True)}
ok = True
for way, place in WAYS.items():
    answers = official(*place), by_method('obb_rectangles', *place), by_method('aligned_triangulation', *place)
    words = ['off the road' if answer else 'on it' for answer in answers]
    print(f'{way}: boundary_collision says {words[0]}, obb_rectangles (default) {words[1]}, aligned_triangulation {words[2]}')
    ok = ok and tuple(map(bool, answers)) == EXPECTED[way]
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
