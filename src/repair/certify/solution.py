"""The solution file: what it is for, where it starts, whether the curve drives it; the official answers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.certify.certificate import STATE_TOLERANCE, TOLERANCE, CertificateRow, at_most, equal, said
from repair.certify.motion import Motion, States, states_of, wrapped
from repair.errors import RepairError
from repair.io.official import OfficialVerdict, check_solution_file

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = [
    "agreement_rows",
    "columns_row",
    "form_rows",
    "official_rows",
    "only_states",
    "start_rows",
]

#: Of the first state from the planning problem's: [m], [rad], [m/s].
START = (1e-3, 1e-2, 1e-2)
#: The same of a reference that was given, as CommonRoad's solution checker has it: 0.1 m along either axis.
GIVEN_START = (0.15, 0.1, 2.0)
_GIVEN = ("file", "given")  # sources of such references
STANDS = 1e-2  #: slower than this it stands [m/s]


def only_states(solution: Any, file: str) -> tuple[Any, States]:
    """The one problem's part of a solution, and its states.

    Raises
    ------
    RepairError
        If it has not exactly one, or its states are not those of the KS model.
    """
    parts = solution.planning_problem_solutions
    if len(parts) != 1:
        raise RepairError(f"{file} solves {len(parts)} planning problems; a result has one")
    try:
        return parts[0], states_of(parts[0].trajectory.state_list)
    except (AttributeError, TypeError, ValueError) as error:
        raise RepairError(f"{file} has no states of the KS model: {error}") from error


def form_rows(
    solution: Any,
    part: Any,
    states: States,
    steps: tuple[int, int],
    scenario_id: str,
    problem_id: int,
    vehicle: Vehicle,
) -> list[CertificateRow]:
    """Which scenario, planning problem, vehicle and model the solution is for, and over which time steps.

    Parameters
    ----------
    solution, part
        The file's content, and the part of its one planning problem.
    states : States
        Of that part.
    steps : tuple of int
        First and last one that there have to be.
    scenario_id, problem_id, vehicle
        What the result is for.
    """
    first, last = steps
    same = str(getattr(solution, "scenario_id", "")) == scenario_id
    expected = np.arange(first, last + 1, dtype=np.float64)
    rows = [
        equal("solution: planning problem", part.planning_problem_id, problem_id, "files"),
        equal("solution: vehicle type", part.vehicle_type.value, vehicle.type_id, "files"),
        said("solution: vehicle model KS", part.vehicle_model.name == "KS", "files"),
        said("solution: scenario", same, "files"),
        equal("solution: states", len(states.steps), len(expected), "files"),
        said("solution: time steps", np.array_equal(states.steps, expected), "files"),
    ]
    if all(row.ok for row in rows):  # one row for what is as it has to be
        remark = "states; scenario, planning problem, vehicle, model"
        count = float(len(expected))
        rows = [CertificateRow("solution: form", count, count, 0.0, True, "files", remark)]
    return rows


def start_rows(states: States, problem: Any, vehicle: Vehicle, source: str = "") -> list[CertificateRow]:
    """By how much the first state is off the planning problem's; of given references as CommonRoad allows.

    Its speed is that of the rear axle, or that of the middle: CommonRoad does not say of which the planning
    problem's is.
    """
    initial = problem.initial_state
    position = np.asarray(initial.position, dtype=np.float64)[:2]
    off = float(np.hypot(*(states.xy[0] - position)))
    turned = abs(float(wrapped(states.orientation[0] - _middle(initial.orientation))))
    slip = np.arctan(vehicle.rear / vehicle.wheelbase * np.tan(states.steering[0]))
    speeds = np.array([states.speed[0], states.speed[0] / np.cos(slip)])
    faster = float(np.abs(speeds - _middle(initial.velocity)).min())
    allowed = GIVEN_START if source in _GIVEN else START
    return [
        at_most("start: position off by", off, allowed[0], "files", "m"),
        at_most("start: orientation off by", turned, allowed[1], "files", "rad"),
        at_most("start: speed off by", faster, allowed[2], "files", "m/s"),
    ]


def _middle(value: Any) -> float:
    return float((value.start + value.end) / 2.0 if hasattr(value, "start") else value)


def agreement_rows(
    states: States, motion: Motion, vehicle: Vehicle, dt: float, first: int
) -> list[CertificateRow]:
    """By how much the file's states differ from the vehicle driven along the curve."""
    times = (states.steps - first) * dt
    times = np.clip(times, motion.t[0], motion.t[-1])
    x, y, psi, v, theta = (
        np.interp(times, motion.t, column) for column in (*motion.poses.T, motion.speed, motion.heading)
    )
    slip = theta - psi
    steering = np.arctan(vehicle.wheelbase / vehicle.rear * np.tan(slip))
    # Where the vehicle stands, its path says nothing about its wheels.
    steered = np.where(np.abs(v) >= STANDS, steering - states.steering, 0.0)
    place = float(np.max(np.abs(np.stack([x, y], axis=1) - states.xy)))
    tolerance = STATE_TOLERANCE
    return [
        at_most("solution file against the curve", place, tolerance, "sampled", "m"),
        at_most(
            "solution: orientation", _most(wrapped(psi - states.orientation)), tolerance, "sampled", "rad"
        ),
        at_most("solution: speed", _most(v * np.cos(slip) - states.speed), tolerance, "sampled", "m/s"),
        at_most("solution: steering", _most(steered), 2 * tolerance, "sampled", "rad"),
    ]


def columns_row(states: States, trajectory: Mapping[str, Any]) -> CertificateRow:
    """By how much the columns of ``trajectory`` in ``result.json`` differ from the file's states."""
    name = "record: trajectory against the file"
    try:
        told = states_of(trajectory)
    except (KeyError, AttributeError, TypeError, ValueError) as error:
        return said(name, False, "files", f"it is incomplete: {error}")
    if len(told.steps) != len(states.steps) or not (told.steps == states.steps).all():
        return said(name, False, "files", f"{len(told.steps)} states, and {len(states.steps)} in the file")
    off = (
        told.xy - states.xy,
        wrapped(told.orientation - states.orientation),
        told.speed - states.speed,
        told.steering - states.steering,
    )
    return at_most(name, max(_most(values) for values in off), TOLERANCE, "files", "", 0.0)


def _most(values: Array) -> float:
    return float(np.max(np.abs(values)))


def official_rows(
    file: Path, scenario: Any, problem: Any, *, on_road: bool, gap: float, goal: bool = False
) -> list[CertificateRow]:
    """The answers of the drivability checker, a row for each; a repair need not reach the goal.

    Parameters
    ----------
    scenario, problem
        CommonRoad objects, with the traffic that counts.
    on_road : bool
        What was found here.
    gap : float
        Gaps of the map that were closed for that [m].
    goal : bool
        Whether the result claims to reach the goal.
    """
    from commonroad.planning.planning_problem import PlanningProblemSet

    problems = PlanningProblemSet([problem])
    verdict: OfficialVerdict = check_solution_file(file, scenario, problems)
    rows = [
        said("solved_all_problems", verdict.solved, "official"),
        said("vehicle model known", verdict.vehicle_model, "official"),
        said("states connected", verdict.connected, "official"),
        said("starts_at_correct_state", verdict.starts, "official"),
        said("solution_feasible", verdict.feasible, "official"),
        said("obstacle_collision", verdict.collision_free, "official"),
    ]
    name = f"boundary_collision ({verdict.road_method})"
    if on_road and not verdict.on_road and gap > 0.0:
        remark = f"differs: gaps of the map up to {gap:g} m are road here"
        rows.append(said(name, False, "official", remark, claim=False))
    else:
        rows.append(said(name, verdict.on_road, "official"))
    rows.append(said("ego_collision", verdict.egos_apart, "official"))
    rows.append(said("goal_reached", verdict.goal, "official", claim=goal))
    return rows
