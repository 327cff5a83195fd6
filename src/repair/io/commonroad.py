"""What is driven, as CommonRoad objects: trajectory, obstacle, solution."""

from __future__ import annotations

import math
import tempfile
import warnings
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.errors import OutputError, foreign, in_words
from repair.search.result import SearchStatus
from repair.vehicle.parameters import VEHICLE_NAMES

if TYPE_CHECKING:
    from repair.scene.scene import Scene
    from repair.vehicle.states import DrivenStates

__all__ = [
    "in_the_form_of_a_solution", "no_solution_because", "scenario_bytes", "to_dynamic_obstacle",
    "to_solution", "to_trajectory",
]  # fmt: skip

_DIGITS = 40  # of a scenario from memory: all there are, so that the file says the same

_TURN = 2.0 * math.pi


def to_trajectory(scene: Scene, states: DrivenStates) -> Any:
    """What is driven, as a ``commonroad.scenario.trajectory.Trajectory`` of KS states.

    Orientations are counted from the planning problem's on: CommonRoad allows [-2 pi, 2 pi] there, and its
    solution checker compares the first one as a plain number.

    Parameters
    ----------
    scene : Scene
    states : DrivenStates
        At the scenario's steps; the first one is at the planning problem's initial time step.
    """
    from commonroad.scenario.trajectory import Trajectory

    first = scene.initial_time_step
    driven = scene.model.to_commonroad(states, first)
    turns = round((scene.initial_state.orientation - driven[0].orientation) / _TURN)
    for state in driven if turns else ():
        angle = state.orientation + turns * _TURN
        if state is driven[0]:
            state.orientation = min(max(angle, -_TURN), _TURN)
        else:
            state.orientation = angle - _TURN * (angle > _TURN) + _TURN * (angle < -_TURN)
    return Trajectory(initial_time_step=first, state_list=driven)


def to_dynamic_obstacle(scene: Scene, states: DrivenStates, obstacle_id: int | None = None) -> Any:
    """The ego as a ``commonroad.scenario.obstacle.DynamicObstacle``.

    Parameters
    ----------
    obstacle_id : int, optional
        By default one that is free in the scenario.

    Raises
    ------
    OutputError
        If the id is no whole number.
    """
    if not isinstance(obstacle_id, (Integral, type(None))) or isinstance(obstacle_id, bool):
        raise OutputError(f"an obstacle's id is a whole number, not {in_words(obstacle_id)}")
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType
    from commonroad.scenario.state import InitialState
    from commonroad.scenario.trajectory import Trajectory

    driven = to_trajectory(scene, states).state_list
    if obstacle_id is None:
        obstacle_id = scene.scenario.generate_object_id()
        while obstacle_id == scene.planning_problem_id:
            obstacle_id = scene.scenario.generate_object_id()
    shape = Rectangle(length=scene.vehicle.length, width=scene.vehicle.width)
    first = InitialState(
        time_step=driven[0].time_step,
        position=driven[0].position,
        orientation=driven[0].orientation,
        velocity=driven[0].velocity,
        acceleration=scene.initial_state.acceleration,
        yaw_rate=scene.initial_state.yaw_rate,
        slip_angle=0.0,
    )
    # CommonRoad's predictions begin one step after the initial state; its collision checker relies on it.
    rest = driven[1:]
    prediction = TrajectoryPrediction(Trajectory(rest[0].time_step, rest), shape) if rest else None
    return DynamicObstacle(int(obstacle_id), ObstacleType.CAR, shape, first, prediction)


def no_solution_because(scene: Scene, status: SearchStatus) -> str:
    """Why there is no solution to write; empty where there is one."""
    if status not in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        return status.sentence
    if scene.vehicle.type_id not in VEHICLE_NAMES:
        return f"vehicle {scene.settings.vehicle!r} is none of CommonRoad's, which a solution has to name"
    return ""


def to_solution(scene: Scene, states: DrivenStates, status: SearchStatus) -> Any:
    """What is driven, as a ``commonroad.common.solution.Solution`` (KS model, cost function JB1).

    Raises
    ------
    OutputError
        If there is no verified trajectory (a colliding one is never handed out as a solution), or the
        vehicle is none of CommonRoad's.
    """
    if why := no_solution_because(scene, status):
        raise OutputError(f"there is no solution to write: {why}")
    return in_the_form_of_a_solution(scene, states)


def in_the_form_of_a_solution(scene: Scene, states: DrivenStates) -> Any:
    """States in CommonRoad's form of a solution, whether they are one or not.

    The vehicle has to be one of CommonRoad's.
    """
    from commonroad.common.solution import (
        CostFunction,
        PlanningProblemSolution,
        Solution,
        VehicleModel,
        VehicleType,
    )

    problem = PlanningProblemSolution(
        planning_problem_id=scene.planning_problem_id,
        vehicle_model=VehicleModel.KS,
        vehicle_type=VehicleType(scene.vehicle.type_id),
        cost_function=CostFunction.JB1,
        trajectory=to_trajectory(scene, states),
    )
    # Without a date and a computation time the same input gives the same file.
    return Solution(scene.scenario.scenario_id, [problem], date=None)


def scenario_bytes(scene: Scene) -> bytes:
    """The scenario and planning problem of a scene as CommonRoad XML.

    Raises
    ------
    OutputError
        If commonroad-io cannot write it.
    """
    from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
    from commonroad.planning.planning_problem import PlanningProblemSet
    from commonroad.scenario.scenario import Location

    with (
        foreign("writing the scenario", OutputError),
        warnings.catch_warnings(),
        tempfile.TemporaryDirectory(prefix="repair-") as aside,
    ):
        warnings.simplefilter("ignore")
        file = Path(aside) / "scenario.xml"
        problems = PlanningProblemSet([scene.planning_problem])
        scenario = scene.scenario
        said = scenario.author, scenario.affiliation, scenario.source
        # What a scenario from memory does not say of itself, commonroad-io asks for by bare assertions.
        writer = CommonRoadFileWriter(
            scenario, problems, *("" if words is None else words for words in said),
            tags=scenario.tags or set(), location=scenario.location or Location(), decimal_precision=_DIGITS,
        )  # fmt: skip
        writer.write_to_file(str(file), OverwriteExistingFile.ALWAYS)
        return file.read_bytes()
