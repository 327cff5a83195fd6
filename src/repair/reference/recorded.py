"""References that were driven before: a recorded obstacle, or a solution file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.bases import basis_matrix, n_points_for
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import splice_points
from repair.errors import ReferenceTrajectoryError, ScenarioError
from repair.reference.settings import ReferenceConfig

if TYPE_CHECKING:
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

__all__ = [
    "known_until",
    "obstacle_positions",
    "recorded_reference",
    "solution_positions",
    "solution_reference",
]

_SPEED_MAX = 150.0  # faster than this a recording jumps [m/s]
_START_OFF = 1.0  # a reference may start this far from the ego [m]


def obstacle_positions(scene: Scene, config: ReferenceConfig) -> Array:
    """Centre positions (T, 2) of a recorded obstacle at the scenario's steps.

    Raises
    ------
    ReferenceTrajectoryError
        If there is no such obstacle, or it jumps.
    """
    return _without_jumps(scene, *_recorded(scene, config.obstacle_id))[0]


def solution_positions(scene: Scene, config: ReferenceConfig) -> Array:
    """Centre positions (T, 2) in a solution file at the scenario's steps.

    Raises
    ------
    ReferenceTrajectoryError
        If there is no such file, it is of another scenario, or it jumps.
    """
    return _without_jumps(scene, *_from_solution(scene, config.file))[0]


def recorded_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> UniformBSpline:
    """A spline through the positions of a recorded obstacle."""
    return _fit_positions(scene, *_without_jumps(scene, *_recorded(scene, config.obstacle_id)))


def solution_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> UniformBSpline:
    """A spline through the positions in a solution file."""
    return _fit_positions(scene, *_without_jumps(scene, *_from_solution(scene, config.file)))


def _without_jumps(scene: Scene, positions: Array, what: str) -> tuple[Array, str]:
    moved = np.hypot(*np.diff(positions[: known_until(positions)], axis=0).T)
    if (moved > _SPEED_MAX * scene.dt).any():
        raise ReferenceTrajectoryError(f"{scene.id}: {what} jumps by {moved.max():.3g} m within a time step")
    return positions, what


def _recorded(scene: Scene, obstacle_id: int | None) -> tuple[Array, str]:
    if obstacle_id is None:
        obstacle = scene.recorded_ego
        if obstacle is None:
            raise ReferenceTrajectoryError(
                f"{scene.id}: no obstacle is recorded as the ego itself; name one with reference.obstacle_id"
            )
    else:
        found = [o for o in (*scene.obstacles, scene.recorded_ego) if o is not None and o.id == obstacle_id]
        if not found:
            raise ReferenceTrajectoryError(
                f"{scene.id}: there is no obstacle {obstacle_id} to take the reference from"
            )
        obstacle = found[0]
    return obstacle.states[:, :2], f"obstacle {obstacle.id}"


def _from_solution(scene: Scene, file: str | None) -> tuple[Array, str]:
    """Reference from a CommonRoad solution file of the same scenario."""
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
    return _positions(scene, matching[0], path), str(path)


def _positions(scene: Scene, solution: Any, path: Path) -> Array:
    states = solution.trajectory.state_list
    positions = np.full((scene.n_steps + 1, 2), np.nan)
    for state in states:
        step = state.time_step - scene.initial_time_step
        if 0 <= step <= scene.n_steps and getattr(state, "position", None) is not None:
            positions[step] = state.position
    if not np.isfinite(positions[0]).all():
        raise ReferenceTrajectoryError(f"{path} has no state at the planning problem's initial time step")
    off = float(np.hypot(*(positions[0] - [scene.initial_state.x, scene.initial_state.y])))
    if not off <= _START_OFF:
        raise ReferenceTrajectoryError(f"{path} starts {off:.0f} m from the ego's initial position")
    return positions


def known_until(positions: Array) -> int:
    """Number of leading positions (T, 2) without a gap."""
    known = np.asarray(np.isfinite(positions).all(axis=1))
    return len(known) if known.all() else int(np.argmin(known))


def _fit_positions(scene: Scene, positions: Array, what: str) -> UniformBSpline:
    """Spline through recorded centre positions (T, 2), as far as they go without a gap."""
    last = known_until(positions)
    if last < 4:
        raise ReferenceTrajectoryError(
            f"{scene.id}: {what} is known for {last} steps only; a reference takes at least 4"
        )
    coordinates = scene.frame.to_frenet(positions[:last])
    if not np.isfinite(coordinates).all():
        raise ReferenceTrajectoryError(
            f"{scene.id}: {what} leaves the neighbourhood of the route and cannot be a reference"
        )
    degree = 3
    spacing = max(0.4, 2.0 * scene.dt)
    duration = (last - 1) * scene.dt
    n = n_points_for(duration, spacing, degree)
    tau = np.arange(last) * scene.dt
    basis = basis_matrix(tau, n, degree, spacing)
    state = np.array([coordinates[0], scene.start[1], scene.start[2]])
    if np.linalg.norm(coordinates[0] - scene.start[0]) > 0.5:
        state[1] = (coordinates[1] - coordinates[0]) / scene.dt
        state[2] = 0.0
    head = splice_points(state, degree, spacing)
    ridge = 1e-3 * np.diff(np.eye(n), n=3, axis=0)
    left = np.vstack([basis, ridge])
    right = np.vstack([coordinates, np.zeros((len(ridge), 2))]) - left[:, :degree] @ head
    tail = np.linalg.lstsq(left[:, degree:], right, rcond=None)[0]
    return UniformBSpline(0.0, spacing, degree, frozen(np.vstack([head, tail])))
