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
_AROUND = np.array([-2.0, 0.0, 2.0])[:, None, None]  # the lateral room counts here along the guide [m]
_MIRROR = np.array([-1.0, 1.0])[:, None, None]
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
    step, after : (M L,) int array
        Steps of the occupancy before and after each time, the same where the time is a step.
    share : (M L, 1) array or None
        How far each time is on the way from one to the other, NaN outside of the occupancy; None where
        all times are steps.
    """

    edges: Array
    t: Array
    flat: Array
    base: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]
    span: Array
    run: Array
    line: npt.NDArray[np.bool_]
    step: npt.NDArray[np.intp]
    after: npt.NDArray[np.intp]
    share: Array | None

    def at(self, corners: Array) -> Array:
        """Boxes' corners (N, M, L, 2) from those at the steps (N, T, 2), as ``Occupancy.at`` has them."""
        values = corners.take(self.step, axis=1)
        if self.share is not None:
            values += self.share * (corners.take(self.after, axis=1) - values)
        return values.reshape(len(values), *self.t.shape, 2)


@lru_cache(maxsize=32)
def _candidates(count: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    first, second = np.triu_indices(count, k=1)
    return np.concatenate([first, np.arange(count)]), second


@lru_cache(maxsize=128)
def _time_grid(t_start: float, t_end: float, pieces: int, occupied: bytes) -> TimeGrid:
    edges = np.asarray(t_start + (t_end - t_start) / pieces * np.arange(pieces + 1))
    steps = np.frombuffer(occupied)
    times = np.union1d(edges, steps[(steps > edges[0] + _SAME) & (steps < edges[-1] - _SAME)])
    times = times[np.concatenate([[True], np.diff(times) > _SAME])]
    first = np.searchsorted(times, edges[:-1] - _SAME)
    last = np.searchsorted(times, edges[1:] + _SAME, side="right") - 1
    t = times[np.minimum(first[:, None] + np.arange((last - first).max() + 1), last[:, None])]
    base, second = _candidates(t.shape[1])
    span = t[:, second] - t[:, base[: len(second)]]
    line = np.concatenate([span > 0.0, np.ones_like(t, dtype=np.bool_)], axis=1)
    span[span <= 0.0] = 1.0
    run = t.T[:, :, None] - t[:, base]
    return TimeGrid(
        edges, frozen(t), frozen(t.ravel()), base, second, span, run, line, *_steps(t.ravel(), steps)
    )


def _steps(times: Array, steps: Array) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array | None]:
    """Steps before and after each time, and how far it is on the way between them."""
    where = (times - steps[0]) / (steps[1] - steps[0] if len(steps) > 1 else 1.0)
    nearest, last = np.rint(where), len(steps) - 1
    where = np.where(np.abs(where - nearest) < 1e-6, nearest, where)
    before = np.clip(np.floor(where), 0, last).astype(np.intp)
    # On a step its own row counts alone: the next one may be NaN.
    after = np.where(where > before, np.minimum(before + 1, last), before)
    share = np.where((where < 0) | (where > last), np.nan, where - before)
    return before, after, share[:, None] if (share != 0.0).any() else None


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
    guide = _guide(problem, grid, reference)
    along, sideways = _walls(problem, grid, *guide)
    # A lower bound is the upper bound of what is mirrored.
    ends = _lines_below(grid, _MIRROR * along, _MIRROR * guide[0])
    if problem.lateral:
        _cut_to_road(problem, guide[0], sideways)
    corridor = Corridor(grid.edges, _MIRROR * ends, sideways)
    _require_open(problem, corridor)
    return corridor


def _guide(problem: RepairProblem, grid: TimeGrid, reference: Array) -> tuple[Array, Array]:
    """Of the guide, s and l (M, L); without lateral freedom its l is that of the reference."""
    s, l = reference[:, 0], reference[:, 1]  # noqa: E741
    if problem.passing is not None:
        path = problem.passing.guide
        s = np.interp(grid.flat, path.t, path.position[:, 0])
        if problem.lateral:
            l = np.interp(grid.flat, path.t, path.position[:, 1])  # noqa: E741
    return s.reshape(grid.t.shape), l.reshape(grid.t.shape)


def _walls(
    problem: RepairProblem,
    grid: TimeGrid,
    s: Array,
    l: Array,  # noqa: E741
) -> tuple[Array, Array]:
    """What the obstacles leave: smallest and largest s (2, M, L), smallest and largest l (2, M).

    Over a piece an obstacle is kept on that side which the guide keeps all the time; where the guide
    changes sides within the piece, each time has its own.
    """
    start, farthest = problem.start[0, 0], problem.limits.v_max * (problem.t_end - problem.t_rep) + 1.0
    along, sideways = np.empty((2, *s.shape)), np.empty((2, len(s)))
    along[0], along[1], sideways[0], sideways[1] = start - 1.0, start + farthest, -np.inf, np.inf
    lower, upper = grid.at(problem.occupancy.lower), grid.at(problem.occupancy.upper)
    lower -= problem.margin
    upper += problem.margin
    # Where l is given, a box beside the path is no matter; nor is one that is not there (NaN) anywhere.
    across = (lower[..., 1] < l) & (l < upper[..., 1])
    present = np.isfinite(lower).all(axis=3) if problem.lateral else across
    if not present.any():
        return along, sideways
    # In the order of Side; where l is given, a box can only be passed along s.
    room = np.empty((4 if problem.lateral else 2, *present.shape))
    np.subtract(lower[..., 0], s, out=room[Side.BEHIND])
    np.subtract(s, upper[..., 0], out=room[Side.AHEAD])
    if problem.lateral:
        np.subtract(l, upper[..., 1], out=room[Side.LEFT])
        np.subtract(lower[..., 1], l, out=room[Side.RIGHT])
    np.copyto(room, np.inf, where=~present)
    side = _sides(room)
    behind, ahead = present & (side == Side.BEHIND), present & (side == Side.AHEAD)
    np.maximum.reduce(upper[..., 0], where=ahead, initial=start - 1.0, out=along[0])
    np.minimum.reduce(lower[..., 0], where=behind, initial=start + farthest, out=along[1])
    if problem.lateral:
        left, right = present & (side == Side.LEFT), present & (side == Side.RIGHT)
        np.maximum.reduce(upper[..., 1], axis=(0, 2), where=left, initial=-np.inf, out=sideways[0])
        np.minimum.reduce(lower[..., 1], axis=(0, 2), where=right, initial=np.inf, out=sideways[1])
    return along, sideways


def _sides(room: Array) -> npt.NDArray[np.intp]:
    """Side of each obstacle, (N, M, L) or (N, M, 1), from the room (sides, N, M, L) on each.

    The room is inf where the obstacle is not there.
    """
    least = np.minimum.reduce(room, axis=3)
    kept: npt.NDArray[np.intp] = least.argmax(axis=0)[..., None]
    steady = np.maximum.reduce(least) >= -_TOLERANCE
    return kept if steady.all() else np.where(steady[..., None], kept, room.argmax(axis=0))


def _lines_below(grid: TimeGrid, values: Array, guide: Array) -> Array:
    """End values (2, M, 2) of the line below each of ``values`` (2, M, L), leaving ``guide`` the most room.

    Candidates are the lines through two of the points, and the lines through one of them with the
    guide's mean slope; the best is that of largest smallest distance to the guide. What is constant
    is its own line.
    """
    count = values.shape[2]
    values, guide = values.reshape(-1, count), guide.reshape(-1, count)
    ends = values[:, :: count - 1].copy()
    bent = np.flatnonzero(np.maximum.reduce(values, axis=1) - np.minimum.reduce(values, axis=1) >= _SAME)
    if len(bent):
        piece, pairs, times = bent % len(grid.t), len(grid.second), grid.t
        v, g, t = values.take(bent, axis=0), guide.take(bent, axis=0), times.take(piece, axis=0)
        through = v.take(grid.base, axis=1)
        slope = np.empty(through.shape)
        rise = v.take(grid.second, axis=1) - through[:, :pairs]
        np.divide(rise, grid.span.take(piece, axis=0), out=slope[:, :pairs])
        slope[:, pairs:] = ((g[:, -1] - g[:, 0]) / (t[:, -1] - t[:, 0]))[:, None]
        lines = grid.run.take(piece, axis=1)
        lines *= slope
        lines += through
        below = np.logical_and.reduce(lines <= v.T[:, :, None] + _TOLERANCE)
        below &= grid.line.take(piece, axis=0)
        gap = np.minimum.reduce(lines - g.T[:, :, None])
        best = np.where(below, gap, -np.inf).argmax(axis=1)
        ends[bent] = lines[:: count - 1, np.arange(len(bent)), best].T
    return ends.reshape(2, -1, 2)


def _cut_to_road(problem: RepairProblem, s: Array, sideways: Array) -> None:
    """Cut the l intervals to the lateral room around the guide; the start always counts as inside."""
    start = float(problem.start[0, 1])
    right, left = problem.bounds.at(s + _AROUND)
    narrow, wide = right.max(axis=(0, 2)), left.min(axis=(0, 2))
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
    if (np.maximum(low, least) <= high).all() and (right <= left).all():
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
