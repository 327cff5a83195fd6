"""The reference trajectory: planned, blind, recorded, or read from a solution file.

The planner is a graph search over (s, v, t) with comfort limits: speeds on a grid, one layer of
nodes for each time step, edges of constant acceleration. The paper uses the search-based planner
of its ref. [tong] without giving its parameters; this one is ours, and its lateral comfort limit on
the path's curvature is what sets the TTC of Scenario 1 (docs/reproduction.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from repair.bspline import UniformBSpline, basis_matrix, derivative_matrix, n_points_for, splice_points
from repair.config import ReferenceConfig
from repair.errors import ConfigError, ReferenceTrajectoryError, ScenarioError
from repair.types import Array, Curve, FrenetTrajectory, Occupancy, frozen

if TYPE_CHECKING:
    from repair.scene.commonroad import Scene

_GRID_MAX = 2e8  # edges that the graph search may look at: a few seconds
_JERK = 0.3  # weight of the jerk (m/s³) against the distance (m) to the searched profile
_SPEED_MAX = 150.0  # faster than this a recording jumps [m/s]
_START_OFF = 1.0  # a reference may start this far from the ego [m]
_DISCOMFORT = 50.0  # per m/s² or m/s too much and second: far above what any progress can outweigh

__all__ = ["SpeedProfile", "known_until", "make_reference", "plan_speed", "recorded_positions"]

_CRUISE = 13.9  # m/s, 50 km/h: where a blind accelerating ego stops accelerating without a sign


@dataclass(frozen=True)
class SpeedProfile:
    """Motion along l = 0 with piecewise constant acceleration; implements :class:`repair.types.Curve`.

    Attributes
    ----------
    knots : (M,) array
        Times at which the acceleration changes [s]; the last one ends the span.
    s, v : (M,) array
        Position [m] and speed [m/s] at the knots.
    a : (M,) array
        Acceleration from each knot on [m/s²].
    """

    knots: Array
    s: Array
    v: Array
    a: Array

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        return float(self.knots[0])

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return float(self.knots[-1])

    @classmethod
    def from_accelerations(
        cls, s0: float, v0: float, durations: Sequence[float], a: Sequence[float]
    ) -> SpeedProfile:
        """Chain pieces of constant acceleration from t = 0; after the last one the speed is held."""
        knots, s, v = [0.0], [s0], [v0]
        for duration, rate in zip(durations, a, strict=True):
            knots.append(knots[-1] + duration)
            s.append(s[-1] + v[-1] * duration + 0.5 * rate * duration**2)
            v.append(v[-1] + rate * duration)
        return cls(frozen(knots), frozen(s), frozen(v), frozen([*a, 0.0]))

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate; jerk is zero inside of the pieces, which is all a piecewise constant can say."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        k = np.clip(np.searchsorted(self.knots, times + 1e-9, side="right") - 1, 0, len(self.knots) - 1)
        tau = times - self.knots[k]
        zero = np.zeros_like(tau)
        s = self.s[k] + self.v[k] * tau + 0.5 * self.a[k] * tau**2
        v = self.v[k] + self.a[k] * tau
        return FrenetTrajectory(
            times,
            np.column_stack([s, zero]),
            np.column_stack([v, zero]),
            np.column_stack([self.a[k], zero]),
            np.zeros((len(tau), 2)),
        )


def make_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> Curve:
    """The reference trajectory over [0, scene.horizon] in the scene's frame.

    Parameters
    ----------
    occupancy : Occupancy
        Inflated obstacles; only ``awareness: constant_velocity`` looks at it, and only at t = 0.

    Raises
    ------
    ReferenceTrajectoryError
        If the source has no usable trajectory; the sentence says what is missing.
    """
    if config.source == "planner":
        return plan_speed(scene, config, occupancy)
    s0, v0 = float(scene.start[0, 0]), float(scene.start[1, 0])
    if config.source == "constant":
        return SpeedProfile.from_accelerations(s0, v0, [scene.horizon], [0.0])
    if config.source == "accelerate":
        target = max(v0, _limit_at(scene, s0))
        ramp = min(target - v0, scene.horizon)
        return SpeedProfile.from_accelerations(s0, v0, [ramp, max(scene.horizon - ramp, 0.0)], [1.0, 0.0])
    positions, what = recorded_positions(scene, config)
    return _fit_positions(scene, positions, what)


def recorded_positions(scene: Scene, config: ReferenceConfig) -> tuple[Array, str]:
    """Centre positions (T, 2) of a recorded reference at the scenario's steps, and what they are of.

    Raises
    ------
    ReferenceTrajectoryError
        If there is no such obstacle or file.
    """
    recorded = config.source == "recorded"
    positions, what = _recorded(scene, config.obstacle_id) if recorded else _from_solution(scene, config.file)
    moved = np.hypot(*np.diff(positions[: known_until(positions)], axis=0).T)
    if (moved > _SPEED_MAX * scene.dt).any():
        raise ReferenceTrajectoryError(f"{scene.id}: {what} jumps by {moved.max():.3g} m within a time step")
    return positions, what


def _limit_at(scene: Scene, s: float) -> float:
    """Speed limit [m/s] at ``s``; the speed of built-up areas where no sign gives one."""
    limit = float(scene.speed_limit.at(s)) if scene.speed_limit is not None else np.inf
    return limit if np.isfinite(limit) else _CRUISE


# -- planner -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Lattice:
    """Speeds k * dv, k = 0 .. V-1; positions in units of dv * dt / 2, so that edges end on nodes.

    An edge from speed k to k' moves k + k' units: (v + v') / 2 * dt.
    """

    dv: float
    dt: float
    first: int
    n_speeds: int
    n_positions: int
    changes: tuple[int, ...]

    @property
    def unit(self) -> float:
        return 0.5 * self.dv * self.dt


def _lattice(v0: float, v_max: float, config: ReferenceConfig, n_layers: int) -> _Lattice:
    target = config.speed_step
    steps = max(round(v0 / target), 1)
    dv = v0 / steps if v0 > 0.1 else target
    first = steps if v0 > 0.1 else 0
    fall = int(np.floor(-config.a_min * config.time_step / dv + 1e-9))
    rise = int(np.floor(config.a_max * config.time_step / dv + 1e-9))
    n_speeds = max(first + 1, min(int(np.floor(v_max / dv)) + 1, first + rise * n_layers + 1))
    changes = tuple(range(-max(fall, 1), max(rise, 1) + 1))
    return _Lattice(dv, config.time_step, first, n_speeds, 2 * (n_speeds - 1) * n_layers + 1, changes)


def plan_speed(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> UniformBSpline:
    """Search the (s, v, t) graph for the most comfortable way along the path; smooth it to C2.

    Raises
    ------
    ReferenceTrajectoryError
        If every way is blocked (only with ``awareness: constant_velocity``).
    """
    s0, v0 = float(scene.start[0, 0]), max(float(scene.start[1, 0]), 0.0)
    n_layers = max(1, int(np.ceil(scene.horizon / config.time_step)))
    desired = config.desired_speed
    if desired is None:
        desired = max(v0, _limit_at(scene, s0))
    lattice = _lattice(v0, max(desired, v0), config, n_layers)
    edges = lattice.n_speeds * lattice.n_positions * len(lattice.changes) * max(n_layers, 10)
    if edges > _GRID_MAX:
        raise ConfigError(
            f"{scene.id}: the reference planner would look at {edges:.1g} edges, at most {_GRID_MAX:.0g}; "
            f"choose a larger reference.speed_step ({config.speed_step:g} m/s) "
            f"or reference.time_step ({config.time_step:g} s)"
        )
    positions = s0 + lattice.unit * np.arange(lattice.n_positions)
    node_cost = _node_cost(scene, config, lattice, positions, desired)
    blocked = _blocked(config, occupancy, positions, n_layers)
    speeds = _search(lattice, node_cost, blocked, n_layers, config)
    if speeds is None:
        raise ReferenceTrajectoryError(
            f"{scene.id}: the reference planner finds no way that is free of the obstacles it is aware of "
            f"(awareness: {config.awareness}); try awareness: none"
        )
    a = np.diff(speeds) / config.time_step
    profile = SpeedProfile.from_accelerations(s0, float(speeds[0]), [config.time_step] * n_layers, a.tolist())
    return _smooth(profile, scene, n_layers * config.time_step)


def _node_cost(
    scene: Scene, config: ReferenceConfig, lattice: _Lattice, positions: Array, desired: float
) -> Array:
    """Cost (V, S) of being at a speed in a place: lost progress, lateral discomfort, speeding.

    Progress is measured against one desired speed everywhere: a wish that falls with the curvature
    would make it attractive to linger in a bend.
    """
    speeds = lattice.dv * np.arange(lattice.n_speeds)[:, None]
    curvature = np.abs(scene.frame.curvature(positions))
    cost = config.progress * np.maximum(desired - speeds, 0.0)
    cost = cost + _DISCOMFORT * np.maximum(speeds**2 * curvature - config.a_lat, 0.0)
    if scene.speed_limit is not None:
        cost = cost + _DISCOMFORT * np.maximum(speeds - scene.speed_limit.at(positions), 0.0)
    return np.asarray(config.time_step * cost)


def _blocked(config: ReferenceConfig, occupancy: Occupancy, positions: Array, n_layers: int) -> Array | None:
    """Positions (2 n_layers, S) that obstacles at constant velocity occupy, at half time steps."""
    if config.awareness == "none" or not len(occupancy):
        return None
    times = 0.5 * config.time_step * np.arange(1, 2 * n_layers + 1)
    step = float(occupancy.t[1]) if len(occupancy.t) > 1 else 1.0
    low, high = occupancy.lower[:, 0], occupancy.upper[:, 0]
    following = min(1, len(occupancy.t) - 1)
    rate_low = np.nan_to_num((occupancy.lower[:, following] - low) / step)
    rate_high = np.nan_to_num((occupancy.upper[:, following] - high) / step)
    lower = low[:, None] + rate_low[:, None] * times[:, None]
    upper = high[:, None] + rate_high[:, None] * times[:, None]
    on_path = (lower[..., 1] < 0.0) & (upper[..., 1] > 0.0)
    hit = (lower[..., :1] < positions) & (positions < upper[..., :1]) & on_path[..., None]
    return np.asarray(hit.any(axis=0))


def _search(
    lattice: _Lattice, node_cost: Array, blocked: Array | None, n_layers: int, config: ReferenceConfig
) -> Array | None:
    """Cheapest sequence of speeds (n_layers + 1,), by relaxing one layer of nodes after the other."""
    n_v, n_s = lattice.n_speeds, lattice.n_positions
    level = np.arange(n_v)[:, None]
    place = np.arange(n_s)[None, :]
    changes = np.array(lattice.changes)
    source_level = level - changes[:, None, None]
    source_place = place - (2 * level - changes[:, None, None])
    possible = (source_level >= 0) & (source_level < n_v) & (source_place >= 0)
    source = np.where(possible, source_level * n_s + source_place, 0)
    middle = np.clip(np.rint(place - level + 0.25 * changes[:, None, None]), 0, n_s - 1).astype(np.intp)
    effort = config.time_step * (changes * lattice.dv / lattice.dt) ** 2
    edge = np.where(possible, effort[:, None, None], np.inf)
    cost = np.full((n_v, n_s), np.inf)
    cost[lattice.first, 0] = 0.0
    # Half of a node's cost is charged in the middle of the edge, so that a short bend cannot be
    # jumped over between two layers.
    middle_level = np.clip(np.rint(level - 0.5 * changes[:, None, None]), 0, n_v - 1).astype(np.intp)
    edge = edge + 0.5 * node_cost[middle_level, middle]
    choices = []
    for layer in range(n_layers):
        arriving = cost.ravel()[source] + edge
        if blocked is not None:
            arriving = np.where(blocked[2 * layer][middle], np.inf, arriving)
        choice = np.argmin(arriving, axis=0)
        cost = np.take_along_axis(arriving, choice[None], axis=0)[0] + 0.5 * node_cost
        if blocked is not None:
            cost[:, blocked[2 * layer + 1]] = np.inf
        choices.append(choice)
    if not np.isfinite(cost).any():
        return None
    k, s = np.unravel_index(int(np.argmin(cost)), cost.shape)
    speeds = [k]
    for choice in reversed(choices):
        change = changes[choice[k, s]]
        k, s = k - change, s - (2 * k - change)
        speeds.append(k)
    return lattice.dv * np.array(speeds[::-1], dtype=np.float64)


def _smooth(profile: SpeedProfile, scene: Scene, duration: float) -> UniformBSpline:
    """C2 spline near the profile, starting in the ego's own state; jerk is weighed against distance.

    The profile's acceleration jumps at every layer. A spline that followed it closely would swing
    around the jumps.
    """
    degree, spacing = 3, 0.5
    n = n_points_for(duration, spacing, degree)
    tau = np.arange((n - degree) * 5 + 1) * (spacing / 5)
    head = splice_points(scene.start, degree, spacing)
    head[:, 1] = 0.0
    left = np.vstack([basis_matrix(tau, n, degree, spacing), _JERK * derivative_matrix(n, 3, spacing)])
    right = (
        np.concatenate([profile.sample(tau).position[:, 0], np.zeros(n - 3)]) - left[:, :degree] @ head[:, 0]
    )
    tail = np.linalg.lstsq(left[:, degree:], right, rcond=None)[0]
    points = np.zeros((n, 2))
    points[:, 0] = np.concatenate([head[:, 0], tail])
    return UniformBSpline(0.0, spacing, degree, frozen(points))


# -- recorded --------------------------------------------------------------------------------------


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
