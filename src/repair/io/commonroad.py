"""What is driven, as CommonRoad objects: trajectory, obstacle, solution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from repair.errors import OutputError
from repair.search.result import SearchStatus

if TYPE_CHECKING:
    from repair.api import RepairResult

__all__ = ["is_solved", "to_dynamic_obstacle", "to_solution", "to_trajectory"]


# -- CommonRoad ------------------------------------------------------------------------------------


def to_trajectory(result: RepairResult) -> Any:
    """What is driven, as a ``commonroad.scenario.trajectory.Trajectory`` of KS states.

    The first state is at the planning problem's initial time step.
    """
    from commonroad.scenario.trajectory import Trajectory

    from repair.vehicle.commonroad_ks import to_ks_states

    first = result.prepared.scene.initial_time_step
    return Trajectory(initial_time_step=first, state_list=to_ks_states(result.states, first))


def to_dynamic_obstacle(result: RepairResult, obstacle_id: int | None = None) -> Any:
    """The ego as a ``commonroad.scenario.obstacle.DynamicObstacle``.

    Parameters
    ----------
    result : RepairResult
    obstacle_id : int, optional
        By default one that is free in the scenario.
    """
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.state import InitialState
    from commonroad.scenario.trajectory import Trajectory

    scene = result.prepared.scene
    states = to_trajectory(result).state_list
    if obstacle_id is None:
        obstacle_id = scene.scenario.generate_object_id()
        while obstacle_id == scene.planning_problem_id:
            obstacle_id = scene.scenario.generate_object_id()
    shape = Rectangle(length=scene.vehicle.length, width=scene.vehicle.width)
    first = InitialState(
        time_step=states[0].time_step,
        position=states[0].position,
        orientation=states[0].orientation,
        velocity=states[0].velocity,
        acceleration=scene.initial_state.acceleration,
        yaw_rate=scene.initial_state.yaw_rate,
        slip_angle=0.0,
    )
    # CommonRoad's predictions begin one step after the initial state; its collision checker relies on it.
    rest = states[1:]
    prediction = TrajectoryPrediction(Trajectory(rest[0].time_step, rest), shape) if rest else None
    return DynamicObstacle(obstacle_id, ObstacleType.CAR, shape, first, prediction)


def to_solution(result: RepairResult) -> Any:
    """What is driven, as a ``commonroad.common.solution.Solution`` (KS model, cost function JB1).

    Raises
    ------
    OutputError
        If there is no verified trajectory: a colliding one is never handed out as a solution.
    """
    from commonroad.common.solution import (
        CostFunction,
        PlanningProblemSolution,
        Solution,
        VehicleModel,
        VehicleType,
    )

    if not is_solved(result):
        raise OutputError(f"there is no solution to write: {result.status.sentence}")
    scene = result.prepared.scene
    problem = PlanningProblemSolution(
        planning_problem_id=scene.planning_problem_id,
        vehicle_model=VehicleModel.KS,
        vehicle_type=VehicleType(scene.vehicle.type_id),
        cost_function=CostFunction.JB1,
        trajectory=to_trajectory(result),
    )
    # Without a date and a computation time the same input gives the same file.
    return Solution(scene.scenario.scenario_id, [problem], date=None)


def is_solved(result: RepairResult) -> bool:
    return result.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT)
