#!/usr/bin/env bash
# drivability checker: the same one-step brake costs twice as much at an odd step
# as at an even one.
#
# Expected: the acceleration, jerk and steering-rate costs (A, J, SR: integrals of
# a square) do not depend on when in the trajectory a manoeuvre happens.
# What happens: the finite differences are integrated with Simpson's rule, which
# weights samples 1/3, 4/3, 2/3, 4/3, ... An input that acts for one step, as in
# motion primitives or at the onset of braking, is weighted by its index: 3.33,
# 1.67, 3.33, 1.67, and 0.83 for the first step, a quarter of the dearest one;
# the ends are cheap.
# Why it matters: SM1, SM2, SM3, SA1, TR1 and WX1 contain these terms. Shifting a
# trajectory by one step changes its rank, and an optimiser that minimises the
# official cost saves half by acting at every other step.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   scipy 1.17.1
#   acceleration cost of braking by 0.5 m/s at step 0, 1, 2, ...:
#   [0.833, 3.333, 1.667, 3.333, 1.667, 3.333, 1.667, 3.333, 1.667, 3.333, 1.667, 3.333, 1.667, 3.333, 1.667, 3.333, 1.667, 3.125, 2.5, 1.042]
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2 commonroad-clcs==2025.2.0
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-drivability-checker', 'scipy']:
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

values = []
for step in range(20):
    speeds = [10.0] * (step + 1) + [9.5] * (20 - step)
    result = costs(CostFunction.SM1, scenario(), problem((1.0, 9.0)), drive(speeds))
    values.append(round(float(result.partial_costs[PartialCostFunction.A]), 3))
print("acceleration cost of braking by 0.5 m/s at step 0, 1, 2, ...:")
print(values)
inner = values[1:17]
assert values[0] == 0.833 and set(inner[0::2]) == {3.333} and set(inner[1::2]) == {1.667}
print("behaviour as stated")
PY
