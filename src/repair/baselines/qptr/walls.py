"""What boxes and road leave to the pieces of a corridor: walls of s at single times, an interval of l.

What is a matter of single pieces ends in (M, L), pieces by their times, and is done for all pieces
together.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.baselines.qptr.time_grid import TimeGrid
from repair.problem.problem import RepairProblem, Side

__all__ = ["TOLERANCE", "cut_to_road", "line_below", "walls_along", "walls_around"]

TOLERANCE = 1e-6  #: a bound [m] that is missed by less is kept
_STRAIGHT = 1e-7  # [m/s]; what changes its slope by less goes on straight
_AROUND = np.array([-2.0, 0.0, 2.0])[:, None, None]  # the lateral room counts here along the guide [m]
_COUNT = len(Side)
_SIDES = np.arange(_COUNT)


def walls_along(
    problem: RepairProblem, grid: TimeGrid, guide: tuple[Array, Array]
) -> tuple[Array | None, Array | None]:
    """Smallest and largest s (M, L) where the guide's l is given; None where no box bounds it.

    Parameters
    ----------
    problem : RepairProblem
    grid : TimeGrid
    guide : pair of (U,) arrays
        Its s and l.

    Notes
    -----
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


def walls_around(
    problem: RepairProblem, grid: TimeGrid, guide: tuple[Array, Array], sideways: Array
) -> tuple[Array | None, Array | None]:
    """Smallest and largest s (M, L), None where no box bounds it, where boxes can be passed sideways too.

    Parameters
    ----------
    problem : RepairProblem
    grid : TimeGrid
    guide : pair of (U,) arrays
        Its s and l.
    sideways : (2, M) array
        Is filled with the smallest and the largest l.

    Notes
    -----
    Over a piece an obstacle is kept on that side which the guide keeps all the time; where the guide
    changes sides within the piece, each time has its own.
    """
    (s, l), (lower, upper) = guide, _boxes(problem, grid)  # noqa: E741
    # Times first, boxes last: reductions over times, and over the few sides, are then the fast ones.
    room = np.empty((len(s), _COUNT, len(lower)))
    np.subtract(lower[..., 0].T, s[:, None], out=room[:, Side.BEHIND])
    np.subtract(s[:, None], upper[..., 0].T, out=room[:, Side.AHEAD])
    np.subtract(l[:, None], upper[..., 1].T, out=room[:, Side.LEFT])
    np.subtract(lower[..., 1].T, l[:, None], out=room[:, Side.RIGHT])
    np.fmin(room, np.inf, out=room)  # a box that is not there (NaN) leaves all of it
    room = room.take(grid.index.T, axis=0)
    chosen = _sides(room)[..., None, :] == _SIDES[:, None]
    room = np.minimum.reduce(np.where(chosen, room, np.inf), axis=3, initial=np.inf)
    behind, ahead, left, right = (room[..., k].T for k in range(_COUNT))  # in their order
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
    steady = np.maximum.reduce(least, axis=1) >= -TOLERANCE
    return kept if steady.all() else np.where(steady, kept, room.argmax(axis=2))


def line_below(grid: TimeGrid, values: Array, guide: Array) -> Array:
    """End values (M, 2) of the line below each of ``values`` (M, L), leaving ``guide`` the most room.

    Candidates are the lines through two of the points, and the lines through one of them with the
    guide's mean slope; the best is that of largest smallest distance to the guide.

    Parameters
    ----------
    grid : TimeGrid
    values, guide : (M, L) array
        At the times of the pieces.
    """
    if not len(grid.base):
        rows = zip(grid.times.take(grid.index), values, guide, strict=True)
        return np.array([_supporting(*row) for row in rows])
    moved = values + (guide[:, -1:] - guide[:, :1])  # where the guide's mean slope leads in a piece's time
    points = np.concatenate((values, moved), axis=1)
    through = points.take(grid.base, axis=1)
    rise = points.take(grid.second, axis=1)
    rise -= through
    lines = grid.ratio * rise
    lines += through
    below = np.logical_and.reduce(lines <= (values + TOLERANCE).T[:, :, None])
    gap = np.minimum.reduce(lines - guide.T[:, :, None])
    best = np.where(below, gap, -np.inf).argmax(axis=1)
    return np.asarray(lines[:: len(lines) - 1, np.arange(len(best)), best].T)


def _supporting(t: Array, values: Array, guide: Array) -> Array:
    """The same (2,) of one piece with many times (L,), by the hull of its points.

    A line below all points that goes through two of them is an edge of their hull, and of given slope the
    best is the highest: the one that touches it.
    """
    kept = np.append(True, np.diff(t) > 0.0)  # a shorter row repeats its last time
    t, values, guide = t[kept], values[kept], guide[kept]
    # Most points lie on a line with their neighbours, or above it, and are no corners.
    bent = np.diff(values[1:]) / np.diff(t[1:]) > np.diff(values[:-1]) / np.diff(t[:-1]) + _STRAIGHT
    some = np.concatenate(([True], bent, [True]))
    corner: list[tuple[float, float]] = []
    for x, y in zip(t[some].tolist(), values[some].tolist(), strict=True):
        while len(corner) > 1 and _above(corner[-2], corner[-1], (x, y)):
            corner.pop()
        corner.append((x, y))
    x, y = np.array(corner).T
    slopes = np.append(np.diff(y) / np.diff(x), (guide[-1] - guide[0]) / (t[-1] - t[0]))
    rise = slopes[:, None] * (t - t[0])
    lines = rise + (values - rise).min(axis=1, keepdims=True)
    best = (lines - guide).min(axis=1).argmax()
    return np.asarray(lines[best, [0, -1]])


def _above(before: tuple[float, float], middle: tuple[float, float], after: tuple[float, float]) -> bool:
    """Whether the point in the middle is no corner of the hull below."""
    (a, u), (b, v), (c, w) = before, middle, after
    return (v - u) * (c - a) >= (w - u) * (b - a)


def cut_to_road(problem: RepairProblem, s: Array, sideways: Array) -> None:
    """Cut the l intervals to the lateral room around the guide; the start always counts as inside.

    Parameters
    ----------
    problem : RepairProblem
    s : (M, L) array
        Of the guide.
    sideways : (2, M) array
        The intervals; changed.
    """
    start = float(problem.start[0, 1])
    right, left = problem.bounds.at(s + _AROUND)
    narrow, wide = np.maximum.reduce(right, axis=(0, 2)), np.minimum.reduce(left, axis=(0, 2))
    narrow[0], wide[0] = min(narrow[0], start), max(wide[0], start)
    np.maximum(sideways[0], narrow, out=sideways[0])
    np.minimum(sideways[1], wide, out=sideways[1])


def _boxes(problem: RepairProblem, grid: TimeGrid) -> tuple[Array, Array]:
    """Corners (N, U, 2) of the boxes with their margin; NaN where one is not there."""
    lower, upper = problem.occupancy.at(grid.times)
    lower -= problem.margin
    upper += problem.margin
    return lower, upper
