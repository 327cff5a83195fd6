"""A convex driving corridor around a guide: a trapezoid in (s, t) and an interval in l per piece.

After the trapezoidal prisms of Deolasee et al. (*Spatio-temporal motion planning for autonomous
vehicles with trapezoidal prism corridors and Bézier curves*, ACC 2023). Over a piece the free space
beside an obstacle is cut off by one straight line (s) or one constant (l): an under-approximation
whose conservatism the paper blames for the failure of QPTR.

Obstacles and guide are looked up once at the U times of :class:`TimeGrid`; what is a matter of single
pieces ends in (M, L), pieces by their times, and is done for all pieces together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.problem.problem import RepairProblem, Side

__all__ = ["Corridor", "NoCorridor", "TimeGrid", "build_corridor", "time_grid"]

_TOLERANCE = 1e-6
_AROUND = np.array([-2.0, 0.0, 2.0])[:, None, None]  # the lateral room counts here along the guide [m]
_SAME = 1e-9  # times [s] closer than this are one


class NoCorridor(Exception):
    """There is no convex corridor; the message says where it closes."""


@dataclass(frozen=True)
class TimeGrid:
    """The times at which a corridor of M pieces is sampled: the edges and the steps of the occupancy.

    Attributes
    ----------
    edges : (M + 1,) array
        Times at which the pieces meet [s].
    times : (U,) array
        All times [s].
    index : (M, L) int array
        Which of them belong to each piece, from edge to edge; a shorter row repeats its last one.
    base, second : (C,) int array
        The two points of each candidate line of :func:`_line_below`, among those of a piece and the
        same again a piece later.
    ratio : (L, M, C) array
        How far each time is on the way from one to the other; NaN where both are one.
    """

    edges: Array
    times: Array
    index: npt.NDArray[np.intp]
    base: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]
    ratio: Array


@lru_cache(maxsize=32)
def _candidates(count: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    first, second = np.triu_indices(count, k=1)
    every = np.arange(count)
    return np.concatenate([first, every]), np.concatenate([second, count + every])


@lru_cache(maxsize=128)
def _time_grid(t_start: float, t_end: float, pieces: int, occupied: bytes) -> TimeGrid:
    edges = np.asarray(t_start + (t_end - t_start) / pieces * np.arange(pieces + 1))
    steps = np.frombuffer(occupied)
    times = np.union1d(edges, steps[(steps > edges[0] + _SAME) & (steps < edges[-1] - _SAME)])
    times = times[np.concatenate([[True], np.diff(times) > _SAME])]
    first = np.searchsorted(times, edges[:-1] - _SAME)
    last = np.searchsorted(times, edges[1:] + _SAME, side="right") - 1
    index = np.minimum(first[:, None] + np.arange((last - first).max() + 1), last[:, None])
    base, second = _candidates(index.shape[1])
    t = times[index]
    start = t.take(base, axis=1)
    span = np.hstack([t, t + t[:, -1:] - t[:, :1]]).take(second, axis=1) - start
    span[span <= 0.0] = np.nan
    # Times first in memory too: products and reductions are several times as fast as in that of t.T.
    ratio = (np.ascontiguousarray(t.T)[:, :, None] - start) / span
    return TimeGrid(edges, frozen(times), index, base, second, frozen(ratio))


def time_grid(problem: RepairProblem, pieces: int) -> TimeGrid:
    """The grid of a problem whose repair is cut into ``pieces`` of the same duration."""
    return _time_grid(problem.t_rep, problem.t_end, pieces, problem.occupancy.t.tobytes())


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
    """The corridor around ``problem.passing`` (around the reference where there is none).

    Parameters
    ----------
    problem : RepairProblem
    grid : TimeGrid
        Of the problem.
    reference : (U, 2) array, optional
        Position of the reference at ``grid.times``, if it is known already.

    Raises
    ------
    NoCorridor
        If it is empty somewhere, or does not contain the start.
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
        lower, upper = _walls_around(problem, grid, guide, sideways)
    else:
        lower, upper = _walls_along(problem, grid, guide)
    s = guide[0].take(grid.index)
    if lower is not None:  # a lower bound is the upper bound of what is mirrored
        np.negative(_line_below(grid, -np.maximum(lower, start - 1.0), -s), out=ends[0])
    if upper is not None:
        ends[1] = _line_below(grid, np.minimum(upper, farthest), s)
    if problem.lateral:
        _cut_to_road(problem, s, sideways)
    corridor = Corridor(grid.edges, ends, sideways)
    _require_open(problem, corridor)
    return corridor


def _guide(problem: RepairProblem, grid: TimeGrid, reference: Array) -> tuple[Array, Array]:
    """Of the guide, s and l (U,); without lateral freedom its l is that of the reference."""
    s, l = reference[:, 0], reference[:, 1]  # noqa: E741
    if problem.passing is not None:
        path = problem.passing.guide
        s = np.interp(grid.times, path.t, path.position[:, 0])
        if problem.lateral:
            l = np.interp(grid.times, path.t, path.position[:, 1])  # noqa: E741
    return s, l


def _boxes(problem: RepairProblem, grid: TimeGrid) -> tuple[Array, Array]:
    """Corners (N, U, 2) of the boxes with their margin; NaN where one is not there."""
    lower, upper = problem.occupancy.at(grid.times)
    lower -= problem.margin
    upper += problem.margin
    return lower, upper


def _walls_along(
    problem: RepairProblem, grid: TimeGrid, guide: tuple[Array, Array]
) -> tuple[Array | None, Array | None]:
    """Smallest and largest s (M, L) where the guide's l is given; None where no box bounds it.

    A box beside the path is no matter, and the others can only be passed along s. The rooms behind
    and ahead of one add up to minus its length, so a guide that keeps one of these sides over a piece
    has more room there at each time: the sides of a piece are those of its times.
    """
    (s, l), (lower, upper) = guide, _boxes(problem, grid)  # noqa: E741
    across = lower[..., 1] < l
    across &= l < upper[..., 1]
    lower, upper = lower[..., 0], upper[..., 0]
    ahead = s - upper > lower - s
    behind = across > ahead
    ahead &= across
    smallest = largest = None
    if np.count_nonzero(ahead):
        smallest = np.maximum.reduce(upper, where=ahead, initial=-np.inf).take(grid.index)
    if np.count_nonzero(behind):
        largest = np.minimum.reduce(lower, where=behind, initial=np.inf).take(grid.index)
    return smallest, largest


def _walls_around(
    problem: RepairProblem, grid: TimeGrid, guide: tuple[Array, Array], sideways: Array
) -> tuple[Array | None, Array | None]:
    """Smallest and largest s (M, L) as above, where boxes can be passed sideways too: ``sideways`` (2, M).

    Over a piece an obstacle is kept on that side which the guide keeps all the time; where the guide
    changes sides within the piece, each time has its own.
    """
    (s, l), (lower, upper) = guide, _boxes(problem, grid)  # noqa: E741
    # Times first, boxes last: reductions over times, and over the few sides, are then the fast ones.
    room = np.empty((len(s), 4, len(lower)))
    np.subtract(lower[..., 0].T, s[:, None], out=room[:, Side.BEHIND])
    np.subtract(s[:, None], upper[..., 0].T, out=room[:, Side.AHEAD])
    np.subtract(l[:, None], upper[..., 1].T, out=room[:, Side.LEFT])
    np.subtract(lower[..., 1].T, l[:, None], out=room[:, Side.RIGHT])
    np.fmin(room, np.inf, out=room)  # a box that is not there (NaN) leaves all of it
    room = room.take(grid.index.T, axis=0)
    chosen = _sides(room)[..., None, :] == np.arange(4)[:, None]
    room = np.minimum.reduce(np.where(chosen, room, np.inf), axis=3, initial=np.inf)
    behind, ahead, left, right = (room[..., k].T for k in range(4))  # in the order of Side
    s, l = s.take(grid.index), l.take(grid.index)  # noqa: E741
    np.maximum.reduce(l - left, axis=1, out=sideways[0])
    np.minimum.reduce(l + right, axis=1, out=sideways[1])
    bounds = np.isfinite(room).any(axis=(0, 1))
    return s - ahead if bounds[Side.AHEAD] else None, s + behind if bounds[Side.BEHIND] else None


def _sides(room: Array) -> npt.NDArray[np.intp]:
    """Side of each obstacle, (M, N) or (L, M, N), from the room (L, M, 4, N) on each.

    The room is inf where the obstacle is not there.
    """
    least = np.minimum.reduce(room)
    kept: npt.NDArray[np.intp] = least.argmax(axis=1)
    steady = np.maximum.reduce(least, axis=1) >= -_TOLERANCE
    return kept if steady.all() else np.where(steady, kept, room.argmax(axis=2))


def _line_below(grid: TimeGrid, values: Array, guide: Array) -> Array:
    """End values (M, 2) of the line below each of ``values`` (M, L), leaving ``guide`` the most room.

    Candidates are the lines through two of the points, and the lines through one of them with the
    guide's mean slope; the best is that of largest smallest distance to the guide.
    """
    moved = values + (guide[:, -1:] - guide[:, :1])  # where the guide's mean slope leads in a piece's time
    points = np.concatenate((values, moved), axis=1)
    through = points.take(grid.base, axis=1)
    rise = points.take(grid.second, axis=1)
    rise -= through
    lines = grid.ratio * rise
    lines += through
    below = np.logical_and.reduce(lines <= (values + _TOLERANCE).T[:, :, None])
    gap = np.minimum.reduce(lines - guide.T[:, :, None])
    best = np.where(below, gap, -np.inf).argmax(axis=1)
    return np.asarray(lines[:: len(lines) - 1, np.arange(len(best)), best].T)


def _cut_to_road(problem: RepairProblem, s: Array, sideways: Array) -> None:
    """Cut the l intervals to the lateral room around the guide; the start always counts as inside."""
    start = float(problem.start[0, 1])
    right, left = problem.bounds.at(s + _AROUND)
    narrow, wide = np.maximum.reduce(right, axis=(0, 2)), np.minimum.reduce(left, axis=(0, 2))
    narrow[0], wide[0] = min(narrow[0], start), max(wide[0], start)
    np.maximum(sideways[0], narrow, out=sideways[0])
    np.minimum(sideways[1], wide, out=sideways[1])


def _require_open(problem: RepairProblem, corridor: Corridor) -> None:
    """Raise where the corridor is empty, breaks at a joint, or excludes the start or even full braking."""
    edges, start = corridor.edges, problem.start[0]
    if problem.lateral and (corridor.l[0] > corridor.l[1] + _TOLERANCE).any():
        i = int(np.argmax(corridor.l[0] - corridor.l[1]))
        raise NoCorridor(f"no room sideways between t = {edges[i]:.2f} s and {edges[i + 1]:.2f} s")
    low, high = _at_edges(corridor.s)
    right, left = _at_edges(np.repeat(corridor.l[..., None], 2, axis=2)) if problem.lateral else (low, high)
    if not low[0] - _TOLERANCE <= start[0] <= high[0] + _TOLERANCE:
        raise NoCorridor(f"the start lies {start[0] - high[0]:.2f} m beyond the first trapezoid")
    if problem.lateral and not right[0] - _TOLERANCE <= start[1] <= left[0] + _TOLERANCE:
        raise NoCorridor("the start lies beside the first piece of the corridor")
    least = _least_progress(problem, edges)
    closed = np.maximum(low, least) > high
    if problem.lateral:
        closed |= right > left
    if not np.count_nonzero(closed):
        return
    for lower, upper, where in ((low, high, "along the path"), (right, left, "sideways")):
        if (lower > upper + _TOLERANCE).any():
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
