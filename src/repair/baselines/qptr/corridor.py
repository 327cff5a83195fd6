"""A convex driving corridor around a guide: a trapezoid in (s, t) and an interval in l per piece.

After the trapezoidal prisms of Deolasee et al. (*Spatio-temporal motion planning for autonomous
vehicles with trapezoidal prism corridors and Bézier curves*, ACC 2023). Over a piece the free space
beside an obstacle is cut off by one straight line (s) or one constant (l): an under-approximation
whose conservatism the paper blames for the failure of QPTR.

Obstacles and guide are looked up once at the U times of a :class:`repair.baselines.qptr.time_grid.TimeGrid`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.baselines.qptr.time_grid import TimeGrid
from repair.baselines.qptr.walls import TOLERANCE, cut_to_road, line_below, walls_along, walls_around
from repair.problem.problem import RepairProblem

__all__ = ["Corridor", "NoCorridor", "build_corridor", "corridor_around", "require_open"]


class NoCorridor(Exception):
    """There is no convex corridor; the message says where it closes."""


@lru_cache(maxsize=16)
def _blend(degree: int) -> Array:
    """Map (2, degree + 1) from a line's ends to its values at the times of the control points."""
    share = np.linspace(0.0, 1.0, degree + 1)
    return frozen([1.0 - share, share])


class Corridor(NamedTuple):
    """Room of M pieces.

    Attributes
    ----------
    edges : (M + 1,) array
        Times at which the pieces meet [s].
    s : (2, M, 2) array
        Lower and upper bound of s at the start and the end of each piece [m], linear in between.
    l : (2, M) array
        Lower and upper bound of l [m].
    """

    edges: Array
    s: Array
    l: Array  # noqa: E741

    def control_bounds(self, degree: int, axis: int) -> Array:
        """Lower and upper bounds (2, M (degree + 1)) of one axis's control points, piece after piece."""
        if axis == 0:
            return np.asarray(self.s @ _blend(degree)).reshape(2, -1)
        return np.repeat(self.l, degree + 1, axis=1)


def build_corridor(problem: RepairProblem, grid: TimeGrid, reference: Array | None = None) -> Corridor:
    """The corridor of a problem, open from the start to the end.

    Parameters
    ----------
    problem, grid, reference
        See :func:`corridor_around`.

    Raises
    ------
    NoCorridor
        If it is empty somewhere, or does not contain the start.
    """
    corridor = corridor_around(problem, grid, reference)
    require_open(problem, corridor)
    return corridor


def corridor_around(problem: RepairProblem, grid: TimeGrid, reference: Array | None = None) -> Corridor:
    """What the walls leave around ``problem.passing`` (around the reference where there is none).

    That may be nothing at all; :func:`require_open` says so.

    Parameters
    ----------
    problem : RepairProblem
    grid : TimeGrid
        Of the problem.
    reference : (U, 2) array, optional
        Position of the reference at ``grid.times``, if it is known already.
    """
    if reference is None:
        reference = problem.reference.sample(grid.times).position
    guide = _guide(problem, grid, reference)
    start = float(problem.start[0, 0])
    farthest = start + problem.limits.v_max * (problem.t_end - problem.t_rep) + 1.0
    pieces = len(grid.index)
    ends, sideways = np.empty((2, pieces, 2)), np.empty((2, pieces))
    ends[0], ends[1], sideways[0], sideways[1] = start - 1.0, farthest, -np.inf, np.inf
    if problem.lateral:
        lower, upper = walls_around(problem, grid, guide, sideways)
    else:
        lower, upper = walls_along(problem, grid, guide)
    s = guide[0].take(grid.index)
    if lower is not None:  # a lower bound is the upper bound of what is mirrored
        np.negative(line_below(grid, -np.maximum(lower, start - 1.0), -s), out=ends[0])
    if upper is not None:
        ends[1] = line_below(grid, np.minimum(upper, farthest), s)
    if problem.lateral:
        cut_to_road(problem, s, sideways)
    return Corridor(grid.edges, ends, sideways)


def _guide(problem: RepairProblem, grid: TimeGrid, reference: Array) -> tuple[Array, Array]:
    """Of the guide, s and l (U,); without lateral freedom its l is that of the reference."""
    s, l = reference[:, 0], reference[:, 1]  # noqa: E741
    if problem.passing is not None:
        path = problem.passing.guide
        s = np.interp(grid.times, path.t, path.position[:, 0])
        if problem.lateral:
            l = np.interp(grid.times, path.t, path.position[:, 1])  # noqa: E741
    return s, l


def require_open(problem: RepairProblem, corridor: Corridor) -> None:
    """Refuse a corridor that is empty somewhere, breaks at a joint, or excludes the start or full braking.

    Raises
    ------
    NoCorridor
        Saying where it closes.
    """
    edges, start = corridor.edges, problem.start[0]
    if problem.lateral and (corridor.l[0] > corridor.l[1] + TOLERANCE).any():
        i = int(np.argmax(corridor.l[0] - corridor.l[1]))
        raise NoCorridor(f"no room sideways between t = {edges[i]:.2f} s and {edges[i + 1]:.2f} s")
    low, high = _at_edges(corridor.s)
    right, left = _at_edges(np.repeat(corridor.l[..., None], 2, axis=2)) if problem.lateral else (low, high)
    if not low[0] - TOLERANCE <= start[0] <= high[0] + TOLERANCE:
        raise NoCorridor(f"the start lies {start[0] - high[0]:.2f} m beyond the first trapezoid")
    if problem.lateral and not right[0] - TOLERANCE <= start[1] <= left[0] + TOLERANCE:
        raise NoCorridor("the start lies beside the first piece of the corridor")
    least = _least_progress(problem, edges)
    closed = np.maximum(low, least) > high
    if problem.lateral:
        closed |= right > left
    if not np.count_nonzero(closed):
        return
    for lower, upper, where in ((low, high, "along the path"), (right, left, "sideways")):
        if (lower > upper + TOLERANCE).any():
            i = int(np.argmax(lower - upper))
            raise NoCorridor(f"no room {where} at t = {edges[i]:.2f} s")
    excess = least - high
    if (excess > 1e-3).any():
        i = int(np.argmax(excess > 1e-3))
        raise NoCorridor(
            f"at t = {edges[i]:.2f} s even full braking leaves the corridor, by {excess[i]:.2f} m"
        )


@lru_cache(maxsize=64)
def _edges(pieces: int) -> npt.NDArray[np.intp]:
    """Where in a row of the pieces' starts and ends each edge begins."""
    return np.concatenate([[0], np.arange(1, 2 * pieces, 2)])


def _at_edges(bounds: Array) -> tuple[Array, Array]:
    """Lower and upper bound (M + 1,) at the edges from those (2, M, 2) at both ends of the pieces.

    Two neighbours share their joint's control point, so both must have room for it.
    """
    (lower, upper), edges = bounds.reshape(2, -1), _edges(bounds.shape[1])
    return np.maximum.reduceat(lower, edges), np.minimum.reduceat(upper, edges)


def _least_progress(problem: RepairProblem, edges: Array) -> Array:
    """Where full braking within the limits leads (M + 1,) [m]; no curve can stay farther back."""
    s, braking = float(problem.start[0, 0]), -problem.limits.a_min
    speed = max(float(problem.start[1, 0]), 0.0)
    tau = np.minimum(edges - edges[0], speed / braking)
    return np.asarray(s + tau * (speed - (0.5 * braking) * tau))
