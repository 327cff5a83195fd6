#!/usr/bin/env bash
# drivability checker: the obstacle cost (D, in SA1, WX1 and TR1) does not see
# obstacles whose heading is exactly 0.
#
# Expected: the distance to the vehicle ahead does not depend on the compass
# direction of the road.
# What happens: at heading 0 the obstacle's collision object is an axis-aligned
# rectangle, which (like a polygon) has no center() method, and objects without one are
# skipped. With nobody seen the distance is infinite and the cost 0. With a heading
# of one millionth of a rad the same car costs 76 (weight included).
# Why it matters: synthetic and highway scenarios run along the x axis with
# heading 0.0. Their SA1, WX1 and TR1 costs do not contain obstacle distance at
# all, so repairs that differ only in clearance cost the same.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   lead 40 m ahead with heading 0: SA1 = 0.000
#   lead 40 m ahead with heading 1e-06: SA1 = 76.315
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2 commonroad-clcs==2025.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-drivability-checker']:
    print(name, version(name))
import numpy as np
from commonroad.common.solution import CostFunction, VehicleType
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem
from commonroad.prediction.prediction import TrajectoryPrediction
from commonroad.scenario.lanelet import Lanelet
from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.costs.evaluation import CostFunctionEvaluator, PartialCostFunction

def lanelet(number, start, end, low=0.0, n=50, **more):
    x = np.linspace(start, end, n)
    left, right = np.c_[x, np.full(n, low + 3.5)], np.c_[x, np.full(n, low)]
    return Lanelet(left, (left + right) / 2, right, number, **more)

def initial(x, speed, heading=0.0):
    return InitialState(time_step=0, position=np.array([x, 1.75]), orientation=heading, velocity=speed,
                        yaw_rate=0.0, slip_angle=0.0, acceleration=0.0)

def scenario(*obstacles):
    result = Scenario(0.1)
    result.add_objects([lanelet(1, -20.0, 300.0, adjacent_left=2, adjacent_left_same_direction=True),
                        lanelet(2, -20.0, 300.0, 3.5, adjacent_right=1, adjacent_right_same_direction=True)])
    result.add_objects(list(obstacles))
    return result

def problem(speeds=None):
    goal = CustomState(time_step=Interval(0, 100), position=Rectangle(400.0, 50.0, np.array([0.0, 0.0])))
    if speeds is not None:
        goal.velocity = Interval(*speeds)
    return PlanningProblem(7, initial(0.0, 10.0), GoalRegion([goal]))

def drive(speeds, sideways=0.0):
    x, states = 0.0, []
    for k, v in enumerate(speeds):
        states.append(KSState(time_step=k, position=np.array([x, 1.75 + 0.1 * k * sideways]),
                              orientation=float(np.arctan2(sideways, v)), velocity=v, steering_angle=0.0))
        x += 0.1 * v
    return Trajectory(0, states)

def costs(function, *arguments):
    evaluator = CostFunctionEvaluator(function, VehicleType.BMW_320i)
    return evaluator.evaluate_pp_solution(*arguments)

found = {}
for heading in (0.0, 1e-6):
    states = [KSState(time_step=k, position=np.array([40.0 + k, 1.75]), orientation=heading, velocity=10.0, steering_angle=0.0)
              for k in range(1, 30)]
    lead = DynamicObstacle(50, ObstacleType.CAR, Rectangle(4.0, 2.0), initial(40.0, 10.0, heading),
                           TrajectoryPrediction(Trajectory(1, states), Rectangle(4.0, 2.0)))
    result = costs(CostFunction.SA1, scenario(lead), problem((1.0, 9.0)), drive([10.0] * 21))
    found[heading] = float(result.total_costs)
    print(f"lead 40 m ahead with heading {heading:g}: SA1 = {found[heading]:.3f}")
assert found[0.0] == 0.0 and found[1e-6] > 50.0
print("behaviour as stated")
PY
