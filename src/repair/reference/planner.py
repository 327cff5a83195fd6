"""The reference planner: a graph search over (s, v, t) with comfort limits.

Speeds on a grid, one layer of nodes for each time step, edges of constant acceleration. The paper uses
the search-based planner of its ref. [tong] without giving its parameters; this one is ours, and its
lateral comfort limit on the path's curvature is what sets the TTC of Scenario 1
(docs/reproduction.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.bases import basis_matrix, derivative_matrix, n_points_for
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import splice_points
from repair.errors import ConfigError, ReferenceTrajectoryError
from repair.reference.blind import limit_at
from repair.reference.profile import SpeedProfile
from repair.reference.settings import ReferenceConfig
from repair.timegrid import intervals
from repair.vehicle.transitions import POSITION_TOLERANCE
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["plan_speed"]

_GRID_MAX = 2e8  # edges that the graph search may look at: a few seconds
_JERK = 0.3  # weight of the jerk (m/s³) against the distance (m) to the searched profile
_FINE = 0.01  # between looks at whether a curve reverses [s]
_ROLLS = 1e-6  # slower than this backwards is rounding [m/s]
_DISCOMFORT = 50.0  # per m/s² or m/s too much and second: far above what any progress can outweigh


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


def plan_speed(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> UniformBSpline | SpeedProfile:
    """Search the (s, v, t) graph for the most comfortable way along the path; smooth it to C2.

    Where the scenario's steps are so long that a vehicle with one input for each of them could not follow
    the smooth curve, it is driven with constant acceleration from step to step.

    Raises
    ------
    ReferenceTrajectoryError
        If every way is blocked (only with ``awareness: constant_velocity``).
    """
    s0, v0 = float(scene.start[0, 0]), max(float(scene.start[1, 0]), 0.0)
    n_layers = max(1, int(np.ceil(scene.horizon / config.time_step)))
    desired = config.desired_speed
    if desired is None:
        desired = max(v0, limit_at(scene, s0))
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
    return _by_steps(_smooth(profile, scene, n_layers * config.time_step), scene)


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


def _by_steps(curve: UniformBSpline, scene: Scene) -> UniformBSpline | SpeedProfile:
    """The curve, or constant accelerations between its speeds at the steps where those cannot follow it.

    A jerk j moves the end of a step by j dt³ / 12 from where its mean acceleration leads. A curve that
    reverses, as who stands and is said to brake would, is replaced by steps that stop instead.
    """
    jerk = float(np.abs(curve.derivative_points(3)[:, 0]).max())
    slowest = min(float(scene.start[1, 0]), 0.0)  # who rolls back at the start may go on with that
    speeds = curve.sample(np.arange(0.0, curve.t_end, _FINE)).velocity[:, 0]
    reverses = float(speeds.min()) < slowest - _ROLLS
    if jerk * scene.dt**3 / 12.0 <= 0.5 * POSITION_TOLERANCE and not reverses:
        return curve
    count = max(intervals(curve.t_end, scene.dt), 1)
    speeds = np.maximum(curve.sample(np.arange(count + 1) * scene.dt).velocity[:, 0], 0.0)
    rates = np.diff(speeds) / scene.dt
    s0 = float(scene.start[0, 0])
    return SpeedProfile.from_accelerations(s0, float(speeds[0]), [scene.dt] * count, rates.tolist())
