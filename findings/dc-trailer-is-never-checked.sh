#!/usr/bin/env bash
# drivability checker: the trailer of a KST (tractor and trailer) solution is neither
# tested for collisions nor for feasibility, and the file cannot be read back.
#
# Expected: the KST model of the benchmark is a tractor with a 13.6 m trailer; a
# parked car in the trailer's place is a collision, and a hitch angle that does
# not follow from the motion is infeasible.
# What happens: the vehicle's shape is the tractor's 5.1 m rectangle only, so the
# obstacle 6 to 12 m behind the tractor's centre goes unnoticed.
# trajectory_feasibility compares position and heading of the tractor: a trailer
# that jumps between -80 and +80 degrees in every step is feasible. And the
# solution that CommonRoadSolutionWriter wrote raises KeyError in
# CommonRoadSolutionReader.
# Why it matters: for trucks, where off-tracking is the danger, "valid" says
# nothing about the trailer.
#
# Output seen:
#   commonroad-io 2024.3
#   commonroad-drivability-checker 2025.4.0
#   checked shape 5.1 x 2.55 m, trailer 13.6 m
#   collision with a parked car at x behind the tractor's centre: {-2.0: True, -6.0: False, -9.0: False, -12.0: False}
#   trailer jumping between -80 and +80 degrees feasible: True
#   solution file: KeyError <StateType.KST: 'kstState'>
#   behaviour as stated
set -euo pipefail
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install --quiet --disable-pip-version-check commonroad-io==2024.3 numpy==2.4.6 scipy==1.17.1 shapely==2.2.0 commonroad-drivability-checker==2025.4.0 commonroad-vehicle-models==3.0.2
cd "$dir"
"$dir/venv/bin/python" -W ignore - <<'PY'
from importlib.metadata import version
for name in ['commonroad-io', 'commonroad-drivability-checker']:
    print(name, version(name))
import numpy as np
from commonroad.common.solution import (CommonRoadSolutionReader, CommonRoadSolutionWriter, CostFunction,
                                        PlanningProblemSolution, Solution, VehicleModel, VehicleType)
from commonroad.common.util import Interval
from commonroad.geometry.shape import Rectangle
from commonroad.planning.goal import GoalRegion
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from commonroad.scenario.obstacle import ObstacleType, StaticObstacle
from commonroad.scenario.scenario import Scenario
from commonroad.scenario.state import CustomState, InitialState, KSTState
from commonroad.scenario.trajectory import Trajectory
from commonroad_dc.feasibility.feasibility_checker import trajectory_feasibility
from commonroad_dc.feasibility.solution_checker import CollisionException, obstacle_collision
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

truck = VehicleDynamics.KST(VehicleType.TRUCK)
print(f"checked shape {truck.shape.length} x {truck.shape.width} m, trailer {truck.parameters.trailer.l} m")

def solution(angles, scenario):
    states = [KSTState(time_step=k, position=np.array([1.0 * k, 0.0]), orientation=0.0, velocity=10.0,
                       steering_angle=0.0, hitch_angle=angle) for k, angle in enumerate(angles)]
    part = PlanningProblemSolution(7, VehicleModel.KST, VehicleType.TRUCK, CostFunction.JB1, Trajectory(0, states))
    return Solution(scenario.scenario_id, [part])

def collides(x):
    scenario = Scenario(0.1)
    scenario.add_objects(StaticObstacle(50, ObstacleType.PARKED_VEHICLE, Rectangle(2.0, 1.0),
        InitialState(time_step=0, position=np.array([x, 0.0]), orientation=0.0, velocity=0.0)))
    start = InitialState(time_step=0, position=np.array([0.0, 0.0]), orientation=0.0, velocity=10.0,
                         yaw_rate=0.0, slip_angle=0.0)
    goal = GoalRegion([CustomState(time_step=Interval(0, 100))])
    problems = PlanningProblemSet([PlanningProblem(7, start, goal)])
    try:
        return obstacle_collision(scenario, problems, solution([0.0] * 3, scenario))
    except CollisionException:
        return True

hit = {x: collides(x) for x in (-2.0, -6.0, -9.0, -12.0)}
print("collision with a parked car at x behind the tractor's centre:", hit)
wild = solution([1.4 * (-1) ** k for k in range(11)], Scenario(0.1))
feasible = trajectory_feasibility(wild.planning_problem_solutions[0].trajectory, truck, 0.1)[0]
print("trailer jumping between -80 and +80 degrees feasible:", feasible)
try:
    CommonRoadSolutionReader.fromstring(CommonRoadSolutionWriter(wild).dump())
    read = "read back"
except KeyError as error:
    read = f"KeyError {error}"
print("solution file:", read)
assert hit == {-2.0: True, -6.0: False, -9.0: False, -12.0: False}
assert feasible and read.startswith("KeyError")
print("behaviour as stated")
PY
