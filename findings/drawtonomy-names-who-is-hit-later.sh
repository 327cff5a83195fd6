#!/usr/bin/env bash
# drawtonomy-commonroad: the verdict of a drive into two cars begins with the one and names the other.
#
# Expected: `timeSteps` and `obstacleId` of a failed obstacle check are of one collision: the first, or
# that with the obstacle that is named.
# What happens: `timeSteps` runs from the first step at which anything is hit to the last, through steps
# at which nothing is; `obstacleId` is whoever comes first in the scenario's list (dynamic obstacles
# before static ones, each by its place in the file), hit first or not. A car that drives into one at
# 20 m and then into one at 60 m has the steps of both, and the id of the second if that was added first.
# Why it matters: the collision that the page marks at its first step is not with the obstacle it shows.
#
# Output seen:
#   drawtonomy-commonroad 0.3.0, commonroad-drivability-checker 2025.4.0
#   the car at 60 m first in the file: steps 16 to 64, obstacle 60
#   the car at 20 m first in the file: steps 16 to 64, obstacle 20
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps drawtonomy-commonroad==0.3.0 commonroad-drivability-checker==2025.4.0 commonroad-io==2024.3 commonroad-vehicle-models==3.0.2 antlr4-python3-runtime==4.9.3 contourpy==1.3.3 cycler==0.12.1 fonttools==4.65.0 iso3166==3.0.0 kiwisolver==1.5.1 lxml==6.1.3 matplotlib==3.11.2 networkx==3.6.1 numpy==2.4.6 omegaconf==2.4.0 packaging==26.3 pillow==12.3.0 Polygon3==3.0.9.1 protobuf==3.20.2 pyparsing==3.3.3 python-dateutil==3.0.0 PyYAML==6.0.3 rtree==1.4.1 scipy==1.17.1 shapely==2.2.0 six==1.17.0 tqdm==4.70.1
cd "$dir"
"$dir/venv/bin/python" -W ignore - 2> errors <<'PY' || { grep -v nanobind errors | tail -3 >&2; exit 1; }
import logging
from importlib.metadata import version
from pathlib import Path

import numpy as np
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.common.solution import (
    CommonRoadSolutionWriter, CostFunction, PlanningProblemSolution, Solution, VehicleModel, VehicleType,
)
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Location, Scenario, ScenarioID
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from drawtonomy_cr.verdict import build_verdict

logging.disable(logging.CRITICAL)
names = ('drawtonomy-commonroad', 'commonroad-drivability-checker')
print(', '.join(f'{name} {version(name)}' for name in names))


def start(x, v):
    return InitialState(time_step=0, position=np.array([x, 0.0]), orientation=0.0, velocity=v, acceleration=0.0,
                        yaw_rate=0.0, slip_angle=0.0)


def verdict(order):
    """Who drives 70 m at 10 m/s, through cars that stand at 20 and 60 m."""
    made = Scenario(0.1, ScenarioID.from_benchmark_id('ZAM_Two-1_1_T-1', '2020a'), location=Location())
    along = np.linspace(-20.0, 120.0, 29)
    left, middle, right = (np.column_stack([along, np.full(29, side)]) for side in (1.75, 0.0, -1.75))
    made.add_objects(Lanelet(left, middle, right, 1))
    for x in order:
        made.add_objects(StaticObstacle(x, ObstacleType.PARKED_VEHICLE, Rectangle(4.0, 1.8), start(float(x), 0.0)))
    Path('scenario.xml').unlink(missing_ok=True)
    goal = GoalRegion([CustomState(time_step=Interval(60, 70))])
    problem = PlanningProblem(100, start(0.0, 10.0), goal)
    CommonRoadFileWriter(made, PlanningProblemSet([problem]), 'somebody', 'nowhere', 'test', set()).write_to_file(
        'scenario.xml', OverwriteExistingFile.ALWAYS)
    states = [KSState(time_step=k, position=np.array([1.0 * k, 0.0]), velocity=10.0, orientation=0.0, steering_angle=0.0)
              for k in range(71)]
    drive = PlanningProblemSolution(100, VehicleModel.KS, VehicleType.BMW_320i, CostFunction.JB1, Trajectory(0, states))
    CommonRoadSolutionWriter(Solution(made.scenario_id, [drive])).write_to_file(filename='solution.xml', overwrite=True)
    checks = {check['name']: check for check in build_verdict(Path('scenario.xml'), Path('solution.xml'))['checks']}
    return checks['obstacle_collision']


found = {}
for order in ((60, 20), (20, 60)):
    said = verdict(order)
    assert said['status'] == 'FAIL'
    found[order] = (*said['timeSteps'], said['obstacleId'])
    first, last, who = found[order]
    print(f'the car at {order[0]} m first in the file: steps {first} to {last}, obstacle {who}')
ok = found[60, 20] == (16, 64, 60) and found[20, 60] == (16, 64, 20)
print('behaviour as stated' if ok else 'behaviour has changed')
raise SystemExit(not ok)
PY
