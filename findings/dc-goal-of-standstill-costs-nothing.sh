#!/usr/bin/env bash
# drivability checker: the velocity-offset cost (V, in SM1, SM3 and WX1) is 0 for
# every trajectory if the goal's speed interval starts at 0.
#
# Expected: with the goal "come to a stop" (0 to 5 m/s), passing at 10 m/s costs
# about as much as with the goal "0.01 to 5 m/s".
# What happens: the goal speed, the lower end of the interval, is tested for truth;
# 0.0 counts as "no goal speed given". The cost drops from 199.6 to 0.
# Why it matters: for emergency-stop and minimal-risk goals the benchmark cost
# stops caring about speed; comparing repairs by it ranks a car that never
# brakes as perfect.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   goal speed 0 to 5 m/s     driving on at 10 m/s: V = 0.00
#   goal speed 0.01 to 5 m/s  driving on at 10 m/s: V = 199.60
#   goal speed none           driving on at 10 m/s: V = 0.00
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
for name, interval in (("0 to 5 m/s", (0.0, 5.0)), ("0.01 to 5 m/s", (0.01, 5.0)), ("none", None)):
    result = costs(CostFunction.SM1, scenario(), problem(interval), drive([10.0] * 21))
    found[name] = float(result.partial_costs[PartialCostFunction.V])
    print(f"goal speed {name:14s} driving on at 10 m/s: V = {found[name]:.2f}")
assert found["0 to 5 m/s"] == 0.0 == found["none"] and found["0.01 to 5 m/s"] > 190.0
print("behaviour as stated")
PY
