"""Obstacles and road as bounds on control points: which interval every window leaves to the curve.

A window is a short stretch of time during which each obstacle is passed on one side. There the
curve's coordinate is a polynomial with Bernstein points c_0 .. c_p, and an edge of the box is a
piecewise linear function of time. If e(t) >= edge(t) is linear over the window, its Bernstein points
are e_j = e(start + j/p of the window), and

    c_j >= e_j + margin for all j   implies   curve(t) >= edge(t) + margin for all t of the window,

because the difference is a polynomial with Bernstein points c_j - e_j, and a polynomial is never
below the least of them. Where the window lies between two steps of the scenario e is the edge itself
and nothing but the hull is lost; where a step falls inside, e is raised until it covers the kink.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.problem.problem import RepairProblem, Side
from repair.scene.road.bounds import LateralBounds

__all__ = ["NOBODY", "ROAD", "Boxes", "Separation", "Windows", "boxes_in", "road_room", "separate"]

NOBODY, ROAD = -1, -2
# The coordinate times SIGN exceeds the edge times SIGN on each side, in the order of Side.
_SIGN = np.array([-1.0, 1.0, 1.0, -1.0])
_AXIS = np.array([0, 0, 1, 1])
_SIDES = np.arange(4)
assert (Side.BEHIND, Side.AHEAD, Side.LEFT, Side.RIGHT) == (0, 1, 2, 3)
# A metre along the lane is worth less than one across it when the side of passing is chosen.
_ROOM_LATERAL = 0.5
_ROOM_ALONG = (2.0, 0.5)  # [m] and [s] of the start speed
_TOUCH = 1e-6


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


@dataclass
class Separation:
    """Bounds (R, 2) of the position rows ``[s, l]``, and whom they come from.

    ``side`` (N, W) is the side taken of each obstacle in each window, ``claims`` (C, N, W, 4) what each
    obstacle asks for. ``why`` names a conflict known before any solver is asked; empty where there is none.
    """

    lower: Array
    upper: Array
    windows: Windows
    ids: npt.NDArray[np.int64]
    side: npt.NDArray[np.intp] | None = None
    claims: Array | None = None
    why: str = ""

    @cached_property
    def times(self) -> Array:
        """When each row acts [s]."""
        times = np.zeros(len(self.lower))
        times[self.windows.row] = self.windows.moment
        return times

    def owner(self, row: int, side: int) -> int:
        """Whom a row's bound on a side comes from: an obstacle's id, NOBODY or ROAD."""
        bound = (-self.upper[row, 0], self.lower[row, 0], self.lower[row, 1], -self.upper[row, 1])[side]
        if not np.isfinite(bound):
            return NOBODY
        if self.claims is not None:
            window, point = np.nonzero(self.windows.row == row)
            own = np.flatnonzero((self.claims[point, :, window, side] == bound).any(axis=0))
            if len(own):
                return int(self.ids[own[-1]])
        return ROAD

    def who(self, row: int, side: int) -> str:
        """Name of the owner of a bound."""
        number = self.owner(row, side)
        return "the edge of the road" if number == ROAD else f"obstacle {number}"


def _knots(problem: RepairProblem, windows: Windows, width: float) -> Array:
    """The times (K, W) at which an edge may bend: the windows' ends, and the steps in between."""
    start, end, dt = windows.start, windows.end, problem.dt
    ends = np.concatenate((start, end)).reshape(2, -1)
    if width <= 0.0:
        return ends
    inner = int(width / dt + 1e-9) + 1
    steps = (np.floor(start / dt + 1e-6) + np.arange(1, inner + 1)[:, None]) * dt
    within = steps < end - 1e-9
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
    edge = np.empty((len(lower), knots.size, 4))
    np.negative(lower[..., 0], out=edge[..., 0])
    edge[..., 1:3] = upper
    np.negative(lower[..., 1], out=edge[..., 3])
    edge = edge.reshape(len(lower), *knots.shape, 4).swapaxes(0, 1)  # (K, N, W, 4)
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
        at_end = (knots >= windows.end - 1e-9)[:, None]
        cover[1:, present[0] & ~present[1:].any(axis=0)] = -np.inf
        cover[:-1, (present == at_end).all(axis=0) & ~present[0]] = -np.inf
    return cover, first, some


def boxes_in(problem: RepairProblem, windows: Windows) -> Boxes | None:
    """The obstacles over the windows; None where there is nothing to keep away from."""
    if not len(problem.occupancy) or not len(windows.start):
        return None
    cover, first, some = _edges(problem, windows)
    start = problem.start[0][_AXIS] * _SIGN - first
    margin = problem.margin
    return Boxes(cover, some, start, -cover[..., 3].max(axis=0) - margin, cover[..., 2].max(axis=0) + margin)


def separate(
    problem: RepairProblem,
    windows: Windows,
    rows: int,
    shape: Array,
    room: tuple[Array, Array] | None,
    side: npt.NDArray[np.intp] | None = None,
    boxes: Boxes | None = None,
) -> Separation:
    """Choose sides and bound the position rows.

    Parameters
    ----------
    problem : RepairProblem
    windows : Windows
    rows : int
        Number of rows of the model.
    shape : (W, C, 2) array
        Points of the curve to stay close to (the guide, or the last iterate): its sides are taken.
    room : pair of (W,) arrays or None
        Right and left end of the road for each window; None where l is given.
    side : (N, W) int array, optional
        Sides decided before; chosen from ``shape`` otherwise.
    boxes : Boxes, optional
        :func:`boxes_in` of the same problem and windows, where it is known.
    """
    boxes = boxes or boxes_in(problem, windows)
    ids, table = problem.occupancy.ids, np.full((rows, 4), -np.inf)
    claims, why = None, ""
    if boxes is not None:
        side, claims, why = _claims(problem, boxes, shape, room, side)
    if claims is not None:
        tight = claims.max(axis=1)  # (C, W, 4)
    else:
        tight = np.full((windows.row.shape[1], windows.row.shape[0], 4), -np.inf)
    if room is not None:
        np.maximum(tight[..., 2], room[0], out=tight[..., 2])
        np.maximum(tight[..., 3], -room[1], out=tight[..., 3])
    # A row that two windows share has to satisfy both.
    table[windows.row[:, :-1]] = tight[:-1].swapaxes(0, 1)
    last = windows.row[:, -1]
    table[last] = np.maximum(table[last], tight[-1])
    return Separation(table[:, 1:3], -table[:, ::3], windows, ids, side, claims, why)


def _claims(
    problem: RepairProblem,
    boxes: Boxes,
    shape: Array,
    room: tuple[Array, Array] | None,
    side: npt.NDArray[np.intp] | None,
) -> tuple[npt.NDArray[np.intp] | None, Array | None, str]:
    """Sides, the signed bounds (C, N, W, 4) on the chosen one, or why there is no way."""
    margin, cover, start = problem.margin, boxes.cover, boxes.start
    floor = min(margin, 0.0)  # a negative margin lets the curve into the box by as much
    deep = (start < floor - _TOUCH).all(axis=1)
    if deep.any():
        return side, None, f"the ego starts inside obstacle {problem.occupancy.ids[int(deep.argmax())]}"
    if side is None or room is None:
        # (N, W, 4); inf where nothing is asked
        slack = ((shape.swapaxes(0, 1)[..., _AXIS] * _SIGN)[:, None] - cover).min(axis=0)
    if room is not None:
        # Out of the road's reach: the road's own bounds keep the curve off.
        beside = (boxes.rightmost >= room[1]) | (boxes.leftmost <= room[0])
    else:
        beside = (slack[..., 2:].max(axis=2)) >= margin - 1e-9
    if side is None:
        side = _choose(problem, slack - margin, start)
    needed = boxes.asked & ~beside
    keep: Array | float = margin
    # Who starts nearer than the margin keeps the distance it has.
    own = start[np.arange(len(start)), side[:, 0]]
    near = needed[:, 0] & (own >= floor - _TOUCH) & (own < margin)
    if near.any():
        keep = np.full(start.shape, margin)
        keep[near, side[near, 0]] = np.maximum(own[near], floor)
        keep = keep[:, None]
    mine = (side[..., None] == _SIDES) & needed[..., None]
    return side, np.where(mine, cover + keep, -np.inf), ""


def _choose(problem: RepairProblem, slack: Array, start: Array) -> npt.NDArray[np.intp]:
    """Side (N, W) of each obstacle: where the shape has the most room, a metre across counting for more.

    Parameters
    ----------
    slack : (N, W, 4) array
        What the shape has to spare on each side [m]; negative where it is on another side.
    start : (N, 4) array
        The same at the first instant; the given state rules sides out.
    """
    closed = start < min(problem.margin, 0.0) - _TOUCH
    if problem.lateral:
        along = _ROOM_ALONG[0] + _ROOM_ALONG[1] * max(float(problem.start[1, 0]), 0.0)
        scale = np.array([along, along, _ROOM_LATERAL, _ROOM_LATERAL])
        score = np.where(slack > 0.0, slack / scale, slack)
    else:
        score, closed = slack[..., :2].copy(), closed[:, :2]
    score[:, 0][closed] = -np.inf
    return np.asarray(score.argmax(axis=2))


def road_room(
    bounds: LateralBounds,
    low: Array,
    high: Array,
    own_right: Array | float,
    own_left: Array | float,
    edge: float,
) -> tuple[Array, Array]:
    """Room (right, left), each (W,), that holds for all s in [low, high] (W,).

    Parameters
    ----------
    own_right, own_left : float or (W,) array
        These values of l are always allowed: where the reference itself is.
    edge : float
        Distance kept from either edge [m], as far as ``own`` leaves it.
    """
    # The bounds are linear in between: their extremes are at the ends, and where they bend.
    right, left = (side.reshape(2, -1) for side in bounds.at(np.concatenate((low, high))))
    right, left = np.maximum(right[0], right[1]), np.minimum(left[0], left[1])
    begin, end = bounds.s.searchsorted(low), bounds.s.searchsorted(high, side="right")
    bends = end > begin
    if bends.any():
        cuts = np.empty(2 * len(low), dtype=np.intp)
        # The very last point need not be among the bends: from there on it is the end's value.
        cuts[::2], cuts[1::2] = np.minimum((begin, end), len(bounds.s) - 1)
        inner = np.maximum.reduceat(bounds.right, cuts)[::2]
        right = np.where(bends, np.maximum(right, inner), right)
        inner = np.minimum.reduceat(bounds.left, cuts)[::2]
        left = np.where(bends, np.minimum(left, inner), left)
    return np.minimum(right + edge, own_right), np.maximum(left - edge, own_left)
