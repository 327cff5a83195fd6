"""The windows of a repair, and the obstacles as they are seen through them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, largest, smallest
from repair.problem.lateral import Path
from repair.problem.problem import SIDE_AXIS, SIDE_SIGN, RepairProblem, Side
from repair.timegrid import INSTANT, STEP

__all__ = ["Boxes", "Windows", "boxes_in", "meeting"]

_BESIDE = 0.5  # [m] besides the margin; lines that cover an edge may bulge by less

# Plain integers, as indices of what has one entry for each side.
_BEHIND, _AHEAD, _LEFT, _RIGHT = (int(s) for s in (Side.BEHIND, Side.AHEAD, Side.LEFT, Side.RIGHT))


@dataclass(frozen=True)
class Windows:
    """When each row of points is in force.

    Attributes
    ----------
    start, end : (W,) array
        Time span of the windows [s]; of length zero where points are sampled.
    row : (W, C) int array
        Row of the model that holds point j of the window; windows share no more than their end points.
    fraction : (C,) array
        Where in the window point j acts, 0 to 1.
    """

    start: Array
    end: Array
    row: npt.NDArray[np.intp]
    fraction: Array

    @cached_property
    def moment(self) -> Array:
        """Time (W, C) at which each point acts [s]."""
        return np.asarray(
            self.start[:, None] + self.fraction * (self.end - self.start)[:, None], dtype=np.float64
        )


@dataclass(frozen=True)
class Boxes:
    """The obstacles as the windows see them, whatever the curve.

    Attributes
    ----------
    cover : (C, N, W, 4) array
        Bernstein points of the covering line of each side's signed edge; -inf where it asks for nothing.
    asked : (N, W) bool array
        Whether the obstacle asks for anything.
    start : (N, 4) array
        What the start has to spare on each side [m]; NaN where the obstacle is not there yet.
    rightmost, leftmost : (N, W) array
        Ends of l that the box reaches, with the margin.
    """

    cover: Array
    asked: npt.NDArray[np.bool_]
    start: Array
    rightmost: Array
    leftmost: Array


def meeting(problem: RepairProblem, aside: Array, path: Path | None, degree: int) -> RepairProblem:
    """The problem of who keeps to the reference's path, with the obstacles alone that this path may meet.

    Those that are on one side of it at all times ask for nothing, whatever the curve.

    Parameters
    ----------
    aside : (n,) array
        l of the control points to begin with [m].
    path : Path or None
        The reference's; None where no curve leaves these l.
    degree : int
    """
    right, left = smallest(aside), largest(aside)
    if path is not None:
        # What kept_path takes off is a share of how much its slope changes, twice the range at most.
        lowest, highest = smallest(path.l), largest(path.l)
        over = (degree + 1) / 12.0 * (highest - lowest)
        right, left = min(right, lowest - over), max(left, highest + over)
    boxes, reach = problem.occupancy, problem.margin + _BESIDE
    steps = slice(max(int(boxes.t.searchsorted(problem.t_rep)) - 1, 0), None)
    # Who is on one side at a step and on the other at the next has crossed it in between.
    lower, upper = boxes.lower[:, steps, 1] < left + reach, boxes.upper[:, steps, 1] > right - reach
    rows = (np.logical_or.reduce(lower, axis=1) & np.logical_or.reduce(upper, axis=1)).nonzero()[0]
    return problem if len(rows) == len(boxes) else replace(problem, occupancy=boxes.select(rows))


def _knots(problem: RepairProblem, windows: Windows, width: float) -> Array:
    """The times (K, W) at which an edge may bend: the windows' ends, and the steps in between."""
    start, end, dt = windows.start, windows.end, problem.dt
    ends = np.concatenate((start, end)).reshape(2, -1)
    if width <= 0.0:
        return ends
    inner = int(width / dt + 1e-9) + 1
    steps = (np.floor(start / dt + STEP) + np.arange(1, inner + 1)[:, None]) * dt
    within = steps < end - INSTANT
    if not within.any():
        return ends
    return np.concatenate((ends[:1], np.where(within, steps, end), ends[1:]))


def _edges(problem: RepairProblem, windows: Windows) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Signed edges that cover the boxes' over each window.

    Returns
    -------
    cover : (C, N, W, 4) array
        Bernstein points of the covering line for each side; -inf where it asks for nothing.
    first : (N, 4) array
        Signed edges at the first instant, NaN where the obstacle is not there.
    some : (N, W) bool array
        The obstacle is there during the window.
    """
    width = float((windows.end - windows.start).max())
    knots = _knots(problem, windows, width)
    lower, upper = problem.occupancy.at(knots.ravel())
    edge = np.empty((len(lower), knots.size, len(Side)))
    np.negative(lower[..., 0], out=edge[..., _BEHIND])
    edge[..., _AHEAD : _LEFT + 1] = upper
    np.negative(lower[..., 1], out=edge[..., _RIGHT])
    edge = edge.reshape(len(lower), *knots.shape, edge.shape[-1]).swapaxes(0, 1)  # (K, N, W, 4)
    present = np.asarray(np.isfinite(edge).all(axis=-1))
    all_there = bool(present.all())
    first = edge[0, :, 0]
    if not all_there:
        first = np.where(present[0, :, 0, None], first, np.nan)
        # There for a part: as far as it ever gets, throughout.
        edge = np.where(present[..., None], edge, -np.inf)
        edge = np.where(present[..., None], edge, edge.max(axis=0))
    fraction = windows.fraction[:, None, None, None]
    with np.errstate(invalid="ignore"):
        rise = edge[-1] - edge[0]
        cover = edge[0] + rise * fraction
        if len(knots) > 2:
            span = np.maximum(windows.end - windows.start, 1e-12)
            where = ((knots - windows.start) / span)[:, None, :, None]
            cover += np.maximum((edge - (edge[0] + rise * where)).max(axis=0), 0.0)
    if all_there:
        return cover, first, np.ones(cover.shape[1:3], dtype=np.bool_)
    some = np.asarray(present.any(axis=0))
    cover[:, ~some] = -np.inf
    if width > 0.0:
        # Only there at one end: that instant alone.
        at_end = (knots >= windows.end - INSTANT)[:, None]
        cover[1:, present[0] & ~present[1:].any(axis=0)] = -np.inf
        cover[:-1, (present == at_end).all(axis=0) & ~present[0]] = -np.inf
    return cover, first, some


def boxes_in(problem: RepairProblem, windows: Windows) -> Boxes | None:
    """The obstacles over the windows; None where there is nothing to keep away from."""
    if not len(problem.occupancy) or not len(windows.start):
        return None
    cover, first, some = _edges(problem, windows)
    start = problem.start[0][SIDE_AXIS] * SIDE_SIGN - first
    margin = problem.margin
    rightmost, leftmost = -cover[..., _RIGHT].max(axis=0) - margin, cover[..., _LEFT].max(axis=0) + margin
    return Boxes(cover, some, start, rightmost, leftmost)
