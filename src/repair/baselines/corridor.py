"""A convex driving corridor around a guide: a trapezoid in (s, t) and an interval in l per piece.

After the trapezoidal prisms of Deolasee et al. (*Spatio-temporal motion planning for autonomous
vehicles with trapezoidal prism corridors and Bézier curves*, ACC 2023). Over a piece the free space
beside an obstacle is cut off by one straight line (s) or one constant (l): an under-approximation
whose conservatism the paper blames for the failure of QPTR.

Everything is sampled once at the times of :class:`TimeGrid`, piece by piece, and all pieces are
treated together: arrays end in (M, L), pieces by times.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.types import Array, RepairProblem, Side, frozen

__all__ = ["Corridor", "NoCorridor", "TimeGrid", "build_corridor", "time_grid"]

_TOLERANCE = 1e-6
_ALONG = 2.0  # the lateral room counts this far before and behind the guide [m]
_SAME = 1e-9  # times [s] and bounds [m] closer than this are one


class NoCorridor(Exception):
    """There is no convex corridor; the message says where it closes."""


@dataclass(frozen=True)
class TimeGrid:
    """The times at which a corridor of M pieces is sampled: the edges and the steps of the occupancy.

    Attributes
    ----------
    edges : (M + 1,) array
        Times at which the pieces meet [s].
    t : (M, L) array
        Times of every piece from edge to edge [s]; a shorter row repeats its last time.
    flat : (M L,) array
        The same in a row.
    base : (C,) int array
        Time through which each candidate line of :func:`_line_below` goes: that of the first point
        of each of the ``len(second)`` pairs, then all times once.
    second : (C - L,) int array
        Second point of each pair.
    span : (M, C - L) array
        Time between the points of each pair [s].
    run : (L, M, C) array
        Time since that of ``base`` [s].
    line : (M, C) bool array
        Two different times make the line.
    """

    edges: Array
    t: Array
    flat: Array
    base: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]
    span: Array
    run: Array
    line: npt.NDArray[np.bool_]


@lru_cache(maxsize=128)
def _time_grid(t_start: float, t_end: float, pieces: int, occupied: bytes) -> TimeGrid:
    edges = np.asarray(t_start + (t_end - t_start) / pieces * np.arange(pieces + 1))
    steps = np.frombuffer(occupied)
    times = np.union1d(edges, steps[(steps > edges[0] + _SAME) & (steps < edges[-1] - _SAME)])
    times = times[np.concatenate([[True], np.diff(times) > _SAME])]
    first = np.searchsorted(times, edges[:-1] - _SAME)
    last = np.searchsorted(times, edges[1:] + _SAME, side="right") - 1
    t = times[np.minimum(first[:, None] + np.arange((last - first).max() + 1), last[:, None])]
    i, j = np.triu_indices(t.shape[1], k=1)
    base = np.concatenate([i, np.arange(t.shape[1])])
    span = t[:, j] - t[:, i]
    line = np.concatenate([span > 0.0, np.ones_like(t, dtype=np.bool_)], axis=1)
    span[span <= 0.0] = 1.0
    run = t.T[:, :, None] - t[:, base]
    return TimeGrid(edges, frozen(t), frozen(t.ravel()), base, j, span, run, line)


def time_grid(problem: RepairProblem, pieces: int) -> TimeGrid:
    """The grid of a problem whose repair is cut into ``pieces`` of the same duration."""
    return _time_grid(problem.t_rep, problem.t_end, pieces, problem.occupancy.t.tobytes())


@lru_cache(maxsize=16)
def _fractions(degree: int) -> Array:
    return frozen(np.linspace(0.0, 1.0, degree + 1))


@dataclass(frozen=True)
class Corridor:
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

    def control_bounds(self, degree: int) -> Array:
        """Bounds (2, M, degree + 1, 2) of the control points: lower and upper, piece, point, axis."""
        bounds = np.empty((2, len(self.edges) - 1, degree + 1, 2))
        begin, end = self.s[..., :1], self.s[..., 1:]
        bounds[..., 0] = begin + _fractions(degree) * (end - begin)
        bounds[..., 1] = self.l[..., None]
        return bounds


def build_corridor(problem: RepairProblem, grid: TimeGrid, reference: Array | None = None) -> Corridor:
    """The corridor around ``problem.passing`` (around the reference where there is none).

    Parameters
    ----------
    problem : RepairProblem
    grid : TimeGrid
        Of the problem.
    reference : (M L, 2) array, optional
        Position of the reference at ``grid.flat``, if it is known already.

    Raises
    ------
    NoCorridor
        If it is empty somewhere, or does not contain the start.
    """
    if reference is None:
        reference = problem.reference.sample(grid.flat).position
    s, l = _guide(problem, grid, reference)  # noqa: E741
    above, below, sideways = _walls(problem, grid, s, l)
    # A lower bound is the upper bound of what is mirrored.
    guide = s.reshape(grid.t.shape)
    ends = _lines_below(grid, np.concatenate([above, -below]), np.concatenate([guide, -guide]))
    pieces = len(grid.t)
    along = np.empty((2, pieces, 2))
    np.negative(ends[pieces:], out=along[0])
    along[1] = ends[:pieces]
    if problem.lateral:
        _cut_to_road(problem, s, sideways)
    corridor = Corridor(grid.edges, along, sideways)
    _require_open(problem, corridor)
    return corridor


def _guide(problem: RepairProblem, grid: TimeGrid, reference: Array) -> tuple[Array, Array]:
    """Of the guide, s and l (M L,); without lateral freedom its l is that of the reference."""
    if problem.passing is None:
        return reference[:, 0], reference[:, 1]
    path = problem.passing.guide
    s = np.interp(grid.flat, path.t, path.position[:, 0])
    if not problem.lateral:
        return s, reference[:, 1]
    return s, np.interp(grid.flat, path.t, path.position[:, 1])


def _walls(
    problem: RepairProblem,
    grid: TimeGrid,
    s: Array,
    l: Array,  # noqa: E741
) -> tuple[Array, Array, Array]:
    """What the obstacles leave: largest and smallest s (M, L), smallest and largest l (2, M).

    Over a piece an obstacle is kept on that side which the guide keeps all the time; where the guide
    changes sides within the piece, each time has its own.
    """
    shape = grid.t.shape
    farthest = problem.start[0, 0] + problem.limits.v_max * (problem.t_end - problem.t_rep) + 1.0
    nearest = problem.start[0, 0] - 1.0
    sideways = np.empty((2, shape[0]))
    sideways[0], sideways[1] = -np.inf, np.inf
    count = len(problem.occupancy)
    if not count:
        return np.full(shape, farthest), np.full(shape, nearest), sideways
    lower, upper = problem.occupancy.at(grid.flat)
    lower, upper = lower - problem.margin, upper + problem.margin
    # In the order of Side. Where l is given, a box can only be passed along s.
    room = np.empty((4 if problem.lateral else 2, count, s.size))
    np.subtract(lower[..., 0], s, out=room[Side.BEHIND])
    np.subtract(s, upper[..., 0], out=room[Side.AHEAD])
    if problem.lateral:
        np.subtract(l, upper[..., 1], out=room[Side.LEFT])
        np.subtract(lower[..., 1], l, out=room[Side.RIGHT])
        present = np.isfinite(room).all(axis=0)
    else:
        # A box beside the path is no matter; nor is one that is not there (NaN).
        present = (l < upper[..., 1]) & (lower[..., 1] < l)
    if not present.any():
        return np.full(shape, farthest), np.full(shape, nearest), sideways
    np.copyto(room, np.inf, where=~present)
    side = _sides(room.reshape(len(room), count, *shape)).reshape(present.shape)

    def tightest(chosen: Side, corner: Array, pick: np.ufunc, otherwise: float) -> Array:
        return np.asarray(pick.reduce(np.where(present & (side == chosen), corner, otherwise)).reshape(shape))

    above = tightest(Side.BEHIND, lower[..., 0], np.minimum, farthest)
    below = tightest(Side.AHEAD, upper[..., 0], np.maximum, nearest)
    if problem.lateral:
        tightest(Side.LEFT, upper[..., 1], np.maximum, -np.inf).max(axis=1, out=sideways[0])
        tightest(Side.RIGHT, lower[..., 1], np.minimum, np.inf).min(axis=1, out=sideways[1])
    return above, below, sideways


def _sides(room: Array) -> Array:
    """Side (N, M, L) of each obstacle, from the room (sides, N, M, L) on each; inf where it is not there."""
    least = room.min(axis=3)
    kept = np.broadcast_to(least.argmax(axis=0)[..., None], room.shape[1:])
    steady = least.max(axis=0) >= -_TOLERANCE
    return kept if steady.all() else np.where(steady[..., None], kept, room.argmax(axis=0))


def _lines_below(grid: TimeGrid, values: Array, guide: Array) -> Array:
    """End values (2 M, 2) of the line below each of ``values`` (2 M, L) that leaves the guide the most room.

    Candidates are the lines through two of the points, and the lines through one of them with the
    guide's mean slope; the best is that of largest smallest distance to the guide. What is constant
    is its own line.
    """
    ends = values[:, :: values.shape[1] - 1].copy()
    bent = np.flatnonzero(values.max(axis=1) - values.min(axis=1) >= _SAME)
    if not len(bent):
        return ends
    piece = bent % len(grid.t)
    v, g, t = values[bent], guide[bent], grid.t[piece]
    pairs = len(grid.second)
    through = v[:, grid.base]
    slope = np.empty(through.shape)
    np.divide(v[:, grid.second] - through[:, :pairs], grid.span[piece], out=slope[:, :pairs])
    slope[:, pairs:] = ((g[:, -1] - g[:, 0]) / (t[:, -1] - t[:, 0]))[:, None]
    lines = through + slope * grid.run[:, piece]
    below = (lines <= v.T[:, :, None] + _TOLERANCE).all(axis=0) & grid.line[piece]
    gap = np.where(below, (lines - g.T[:, :, None]).min(axis=0), -np.inf)
    each = np.arange(len(bent))
    ends[bent] = lines[:: len(lines) - 1, each, gap.argmax(axis=1)].T
    return ends


def _cut_to_road(problem: RepairProblem, s: Array, sideways: Array) -> None:
    """Cut the l intervals to the lateral room around the guide; the start always counts as inside."""
    start = float(problem.start[0, 1])
    right, left = problem.bounds.at(s + np.array([[-_ALONG], [0.0], [_ALONG]]))
    by_piece = (3, sideways.shape[1], -1)
    narrow, wide = right.reshape(by_piece).max(axis=(0, 2)), left.reshape(by_piece).min(axis=(0, 2))
    narrow[0], wide[0] = min(narrow[0], start), max(wide[0], start)
    np.maximum(sideways[0], narrow, out=sideways[0])
    np.minimum(sideways[1], wide, out=sideways[1])


def _require_open(problem: RepairProblem, corridor: Corridor) -> None:
    """Raise where the corridor is empty, breaks at a joint, or excludes the start or even full braking."""
    edges, start = corridor.edges, problem.start[0]
    if problem.lateral and (corridor.l[0] > corridor.l[1] + _TOLERANCE).any():
        i = int(np.argmax(corridor.l[0] - corridor.l[1]))
        raise NoCorridor(f"no room sideways between t = {edges[i]:.2f} s and {edges[i + 1]:.2f} s")
    low, high = _at_edges(corridor.s[..., 0], corridor.s[..., 1])
    right, left = _at_edges(corridor.l, corridor.l) if problem.lateral else (low, high)
    if not low[0] - _TOLERANCE <= start[0] <= high[0] + _TOLERANCE:
        raise NoCorridor(f"the start lies {start[0] - high[0]:.2f} m beyond the first trapezoid")
    if problem.lateral and not right[0] - _TOLERANCE <= start[1] <= left[0] + _TOLERANCE:
        raise NoCorridor("the start lies beside the first piece of the corridor")
    least = _least_progress(problem, edges)
    if (np.maximum(low, least) <= high).all() and (not problem.lateral or (right <= left).all()):
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


def _at_edges(first: Array, last: Array) -> Array:
    """Lower and upper bounds (2, M + 1) at the edges from those (2, M) at both ends of the pieces.

    Two neighbours share their joint's control point, so both must have room for it.
    """
    bounds = np.empty((2, first.shape[1] + 1))
    bounds[:, 0], bounds[:, -1] = first[:, 0], last[:, -1]
    np.maximum(last[0, :-1], first[0, 1:], out=bounds[0, 1:-1])
    np.minimum(last[1, :-1], first[1, 1:], out=bounds[1, 1:-1])
    return bounds


def _least_progress(problem: RepairProblem, edges: Array) -> Array:
    """Where full braking within the limits leads (M + 1,) [m]; no curve can stay farther back."""
    s, speed, braking = (
        float(problem.start[0, 0]),
        max(float(problem.start[1, 0]), 0.0),
        -problem.limits.a_min,
    )
    tau = np.minimum(edges - edges[0], speed / braking)
    return np.asarray(s + speed * tau - 0.5 * braking * tau**2)
