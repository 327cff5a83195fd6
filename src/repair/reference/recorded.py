"""References that were driven before: a recorded obstacle, or a solution file.

Both are taken as they are or not at all: a gap in time, a number that is none, states that contradict each
other beyond what CommonRoad's own checks allow (:mod:`repair.reference.consistency`), or another start than
the ego's are errors that name the first place. What ends early is a reference until there and no further.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array, wrap
from repair.curves.base import Curve
from repair.curves.plane import STANDSTILL
from repair.errors import ConfigError, ReferenceTrajectoryError, ScenarioError, kind_of
from repair.reference.base import Track
from repair.reference.consistency import START_HEADING_OFF, Recording, require_consistent, require_start
from repair.reference.fit import between_steps, fit_recording
from repair.reference.settings import ReferenceConfig
from repair.vehicle.accepted import first_refused
from repair.vehicle.parameters import Vehicle, load_vehicle

if TYPE_CHECKING:
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

_NAMED = 8  # so many obstacles are named in a sentence

__all__ = [
    "known_until",
    "obstacle_positions",
    "recorded_reference",
    "solution_recording",
    "solution_reference",
    "solution_track",
    "states_of",
]


def obstacle_positions(scene: Scene, config: ReferenceConfig) -> Array:
    """Centre positions (T, 2) of a recorded obstacle at the scenario's steps.

    Raises
    ------
    ReferenceTrajectoryError
        If there is no such obstacle, or its states contradict each other.
    """
    return _padded(scene, _recorded(scene, config.obstacle_id))


def solution_recording(scene: Scene, config: ReferenceConfig) -> Recording:
    """What a solution file holds, at the scenario's steps.

    Raises
    ------
    ReferenceTrajectoryError
        If there is no such file, it is of another scenario, or its states have a gap, contradict each other
        or do not start with the ego.
    """
    return _from_solution(scene, config.file).until(scene.n_steps + 1)


def solution_track(scene: Scene, config: ReferenceConfig) -> Track:
    """Where a solution file leads, and with which orientation it begins; raises as above."""
    made = solution_recording(scene, config)
    heading = float(made.headings[0])
    if not np.isfinite(heading):
        heading = _first_heading(made, scene)
    return Track(between_steps(made, scene.dt), heading)


def _first_heading(made: Recording, scene: Scene) -> float:
    """Orientation of a body at the start whose centre is a point mass [rad]: as in steady driving.

    It stays as near to the planning problem's as CommonRoad asks for.
    """
    usual, velocities = scene.initial_state.orientation, made.velocities
    if velocities is None or len(velocities) < 2 or not np.hypot(*velocities[0]) > STANDSTILL:
        return usual
    (x, y), (a, b) = velocities[0], (velocities[1] - velocities[0]) / scene.dt
    bend = scene.vehicle.rear * (x * b - y * a) / np.hypot(x, y) ** 3
    heading = float(np.arctan2(y, x) - np.arcsin(np.clip(bend, -0.95, 0.95)))
    most = 0.9 * START_HEADING_OFF
    return usual + float(np.clip(wrap(heading - usual), -most, most))


def recorded_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> Curve:
    """A spline through the positions of a recorded obstacle, until its last one."""
    made = _recorded(scene, config.obstacle_id)
    return fit_recording(scene, made.until(scene.n_steps + 1), noisy=True)


def solution_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> Curve:
    """A curve through the states in a solution file, until the last one."""
    return fit_recording(scene, solution_recording(scene, config))


def known_until(positions: Array) -> int:
    """Number of leading positions (T, 2) without a gap."""
    known = np.asarray(np.isfinite(positions).all(axis=1))
    return len(known) if known.all() else int(np.argmin(known))


def _padded(scene: Scene, recording: Recording) -> Array:
    """Positions (T, 2) at the scene's steps, NaN from where they are not known on."""
    positions = np.full((scene.n_steps + 1, 2), np.nan)
    known = recording.positions[: scene.n_steps + 1]
    positions[: len(known)] = known
    return positions


# -- recorded obstacles ------------------------------------------------------------------------------


def _recorded(scene: Scene, obstacle_id: int | None) -> Recording:
    if obstacle_id is None:
        obstacle = scene.recorded_ego
        if obstacle is None:
            raise ReferenceTrajectoryError(
                f"{scene.id}: no obstacle is recorded as the ego itself; name one with reference.obstacle_id"
                f"{_candidates(scene)}"
            )
    else:
        found = [o for o in (*scene.obstacles, scene.recorded_ego) if o is not None and o.id == obstacle_id]
        if not found:
            raise ReferenceTrajectoryError(
                f"{scene.id}: there is no obstacle {obstacle_id} to take the reference from"
                f"{_candidates(scene)}"
            )
        obstacle = found[0]
    what = f"{scene.id}: obstacle {obstacle.id}"
    states = obstacle.states
    there = np.asarray(np.isfinite(states[:, :2]).all(axis=1))
    last = known_until(states[:, :2])
    if last == 0:
        raise ReferenceTrajectoryError(
            f"{what} is not there at time step {scene.initial_time_step}, where the planning problem starts"
        )
    if there[last:].any():
        again = last + int(np.argmax(there[last:]))
        raise ReferenceTrajectoryError(
            f"{what} is not there from time step {scene.initial_time_step + last} to "
            f"{scene.initial_time_step + again - 1}; a reference has no gap"
        )
    nothing = np.full(last, np.nan)  # of recordings only the positions count: their speeds are estimates
    made = Recording(what, scene.initial_time_step, states[:last, :2], nothing, states[:last, 3], nothing)
    require_consistent(made, scene.dt)
    return made


def _candidates(scene: Scene) -> str:
    """Who moves from the planning problem's start on, those nearest to the ego first: in a bracket."""
    ego = np.array([scene.initial_state.x, scene.initial_state.y])
    moving = [
        o for o in scene.obstacles
        if o.role == "dynamic" and known_until(o.states[:, :2]) >= 4
        and np.ptp(o.states[: known_until(o.states[:, :2]), :2], axis=0).max() > 1.0
    ]  # fmt: skip
    moving.sort(key=lambda o: float(np.hypot(*(o.states[0, :2] - ego))))
    if not moving:
        return " (none moves from the start on)"
    more = f" and {len(moving) - _NAMED} more" if len(moving) > _NAMED else ""
    return f" (those that move, from near to far: {', '.join(str(o.id) for o in moving[:_NAMED])}{more})"


# -- solution files ----------------------------------------------------------------------------------


def _from_solution(scene: Scene, file: str | None) -> Recording:
    """What a CommonRoad solution file of the same scenario holds for the planning problem."""
    if not file:
        raise ReferenceTrajectoryError("reference.source is file, but reference.file names no solution file")
    from repair.scene.reading import read_solution

    path = Path(file)
    try:
        solution = read_solution(path)
    except ScenarioError as error:
        raise ReferenceTrajectoryError(f"solution file {error}") from error
    if str(solution.scenario_id) not in (scene.id, str(scene.scenario.scenario_id)):
        raise ReferenceTrajectoryError(f"{path} is a solution for {solution.scenario_id}, not for {scene.id}")
    matching = [
        s for s in solution.planning_problem_solutions if s.planning_problem_id == scene.planning_problem_id
    ]
    if not matching:
        raise ReferenceTrajectoryError(
            f"{path} holds no solution for planning problem {scene.planning_problem_id}"
        )
    vehicle = _vehicle_of(matching[0], scene.vehicle)
    made = states_of(matching[0].trajectory.state_list, str(path), scene.initial_time_step, vehicle)
    start = scene.initial_state
    require_start(made, start.x, start.y, start.orientation, start.velocity)
    require_consistent(made, scene.dt, vehicle)
    refused = partial(_refused, matching[0], scene.dt)
    return replace(made, refused=refused, model=str(matching[0].vehicle_model.name))


def _refused(solution: Any, dt: float) -> float:
    """When CommonRoad's checker refuses the states of a solution in their own model [s]; inf if never."""
    states, model = list(solution.trajectory.state_list), str(solution.vehicle_model.name)
    transition = first_refused(states, model, int(solution.vehicle_type.value), dt)
    return np.inf if transition is None else transition * dt


def _vehicle_of(solution: Any, usual: Vehicle) -> Vehicle:
    """The vehicle that a solution was made for."""
    try:
        return load_vehicle(int(solution.vehicle_type.value))
    except (AttributeError, TypeError, ValueError, ConfigError):
        return usual


def states_of(states: list[Any], what: str, first: int, vehicle: Vehicle) -> Recording:
    """The states of a solution from step ``first`` on, one for each step.

    Speeds and headings that no state says are NaN.

    Raises
    ------
    ReferenceTrajectoryError
        If they begin elsewhere in time, have a gap, come twice, hold a number that is none or is uncertain,
        or say less than the first of them does.
    """
    steps = [int(state.time_step) for state in states]
    if steps[0] != first:
        raise ReferenceTrajectoryError(
            f"{what} begins at time step {steps[0]}, and not at the planning problem's "
            f"initial time step {first}"
        )
    if getattr(states[0], "position", None) is None:
        raise ReferenceTrajectoryError(f"{what} holds inputs; a reference takes states")
    for k, following in pairwise(steps):
        if following != k + 1:
            wrong = f"goes from time step {k} to {following}"
            wrong = f"has time step {k} twice" if following == k else wrong
            raise ReferenceTrajectoryError(f"{what} {wrong}; a reference has one state for each step")
    _require_numbers(states, what)
    rows = np.array([_motion_of(state) for state in states], dtype=np.float64)
    positions = np.array([state.position for state in states], dtype=np.float64)
    said = getattr(states[0], "orientation", None) is not None
    behind = vehicle.rear if said and not _slips(states[0]) else 0.0
    velocities = _velocities(states, rows, vehicle, behind)
    return Recording(what, first, positions, rows[:, 0], rows[:, 1], rows[:, 2], behind, velocities)


def _require_numbers(states: list[Any], what: str) -> None:
    """Refuse the first state that holds what is no number, or that lacks what the first one has."""
    said = {name for name, value in vars(states[0]).items() if value is not None}
    for state in states:
        place = f"{what}: at time step {state.time_step}"
        for name, value in vars(state).items():
            if value is None:
                if name in said:
                    raise ReferenceTrajectoryError(f"{place} {name} is missing")
                continue
            try:
                numbers = np.asarray(value, dtype=np.float64)
            except (TypeError, ValueError) as error:
                raise ReferenceTrajectoryError(
                    f"{place} {name} is {kind_of(value)}; the states of a reference are exact numbers"
                ) from error
            if not np.isfinite(numbers).all():
                raise ReferenceTrajectoryError(f"{place} {name} is not finite")
        if missing := sorted(said - vars(state).keys()):
            raise ReferenceTrajectoryError(f"{place} {missing[0]} is missing")
        if np.shape(state.position) != (2,):
            shape = np.shape(state.position)
            raise ReferenceTrajectoryError(f"{place} the position is of shape {shape}; it is x, y")


def _velocities(states: list[Any], rows: Array, vehicle: Vehicle, behind: float) -> Array:
    """Velocities (K, 2) of the centre [m/s]; ``rows`` as in :func:`_motion_of`."""
    direction, speed = np.nan_to_num(rows[:, 0]), rows[:, 1]
    cos, sin = np.cos(direction), np.sin(direction)
    steering = np.array([float(getattr(state, "steering_angle", None) or 0.0) for state in states])
    across = behind * speed * np.tan(steering) / vehicle.wheelbase  # the body turns about the rear axle
    return np.stack([speed * cos - across * sin, speed * sin + across * cos], axis=1)


def _slips(state: Any) -> bool:
    """Whether a state's motion is stated at its centre: that of a point mass, or with a slip angle."""
    return any(name in vars(state) for name in ("slip_angle", "velocity_y"))


def _motion_of(state: Any) -> tuple[float, float, float]:
    """Direction of motion, speed, and heading of the body; of a point mass the direction is all there is."""
    velocity, sideways = getattr(state, "velocity", None), vars(state).get("velocity_y")
    forward, across = np.nan if velocity is None else float(velocity), float(sideways or 0.0)
    heading = vars(state).get("orientation")
    if heading is None and sideways is None:
        return np.nan, forward, np.nan
    if heading is None:
        speed = float(np.hypot(forward, across))
        direction = float(np.arctan2(across, forward)) if speed > 0.0 else np.nan
        return direction, speed, np.nan
    slip = vars(state).get("slip_angle")
    beta = float(slip) if slip is not None else (float(np.arctan2(across, forward)) if across else 0.0)
    speed = float(np.hypot(forward, across)) if across else forward
    return float(heading) + beta, speed, float(heading)
