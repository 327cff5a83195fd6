#!/usr/bin/env bash
# drivability checker: the lateral jerk cost (Jlat, in MW1) is the squared lateral
# SPEED.
#
# Expected: moving sideways at a constant speed has no lateral acceleration and no
# lateral jerk, so it costs 0; a swerve with jerk costs.
# What happens: lateral acceleration and lateral jerk are both computed as the
# derivative of the lateral position (not of the speed and of the acceleration).
# The cost is 0.25 per second at 0.5 m/s and grows with the square of the speed:
# a calm diagonal drive is punished, and a violent swerve that ends where it began
# is dearer only as far as it moves fast.
# Why it matters: MW1 weighs Jlat with 5 as its main term; a repair that stretches
# a lane change to cut jerk is not rewarded as intended.
#
# Output seen:
#   commonroad-drivability-checker 2025.4.0
#   straight line with 0.00 m/s sideways for 3 s: Jlat = 0.0000, speed^2 * 3 s = 0.0000
#   straight line with 0.25 m/s sideways for 3 s: Jlat = 0.1875, speed^2 * 3 s = 0.1875
#   straight line with 0.50 m/s sideways for 3 s: Jlat = 0.7500, speed^2 * 3 s = 0.7500
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
for sideways in (0.0, 0.25, 0.5):
    result = costs(CostFunction.MW1, scenario(), problem((1.0, 9.0)), drive([10.0] * 31, sideways))
    found[sideways] = float(result.partial_costs[PartialCostFunction.Jlat])
    print(f"straight line with {sideways:.2f} m/s sideways for 3 s: Jlat = {found[sideways]:.4f}, speed^2 * 3 s = {3 * sideways**2:.4f}")
assert all(abs(value - 3 * speed**2) < 1e-6 for speed, value in found.items()) and found[0.5] > 0.7
print("behaviour as stated")
PY
