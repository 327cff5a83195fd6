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
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.problem.problem import SIDE_AXIS, SIDE_SIGN, RepairProblem, Side
from repair.scene.road.bounds import LateralBounds
from repair.solvers.casadi.windows import Boxes, Windows, boxes_in
from repair.world.dead_ends import ROAD_END

__all__ = ["NOBODY", "ROAD", "SIDE_OF_BOUND", "Separation", "road_room", "separate", "sides_near"]

NOBODY, ROAD = -1, ROAD_END
#: On which sides of an obstacle the lower and the upper bound of s are, and those of l.
SIDE_OF_BOUND = ((Side.AHEAD, Side.BEHIND), (Side.LEFT, Side.RIGHT))
_SIDES = np.arange(len(Side))
# What has one entry for each side holds edges and coordinates times the side's sign: a coordinate keeps
# clear where it is the larger one. These are its indices, plain integers: the lower bounds of s and l, the
# upper ones, the sides along and across the path, and each of the latter.
_LOWER, _UPPER = slice(int(Side.AHEAD), int(Side.LEFT) + 1), slice(int(Side.BEHIND), None, int(Side.RIGHT))
_ALONG = slice(None, int(Side.LEFT))
_LEFT, _RIGHT = int(Side.LEFT), int(Side.RIGHT)
# A metre along the lane is worth less than one across it when the side of passing is chosen.
_ROOM_LATERAL = 0.5
_ROOM_ALONG = (2.0, 0.5)  # [m] and [s] of the start speed
_TOUCH = 1e-6


@dataclass
class Separation:
    """Bounds of the position rows ``[s, l]``, and whom they come from.

    Attributes
    ----------
    lower, upper : (R, 2) array
        The bounds [m].
    windows : Windows
    ids : (N,) int array
        Of the obstacles.
    side : (N, W) int array or None
        Side taken of each obstacle in each window.
    claims : (C, N, W, 4) array or None
        What each obstacle asks for.
    why : str
        A conflict known before any solver is asked; empty where there is none.
    lent : float
        By how much less than the margin is asked for, at most [m]: who starts nearer keeps that distance.
    """

    lower: Array
    upper: Array
    windows: Windows
    ids: npt.NDArray[Any]
    side: npt.NDArray[np.intp] | None = None
    claims: Array | None = None
    why: str = ""
    lent: float = 0.0

    @cached_property
    def times(self) -> Array:
        """When each row acts [s]."""
        times = np.zeros(len(self.lower))
        times[self.windows.row] = self.windows.moment
        return times

    def owner(self, row: int, side: int) -> int:
        """Whom a row's bound on a side comes from: an obstacle's id, NOBODY or ROAD."""
        axis, sign = SIDE_AXIS[side], SIDE_SIGN[side]
        bound = sign * (self.lower if sign > 0.0 else self.upper)[row, axis]
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
        :func:`repair.solvers.casadi.windows.boxes_in` of the same problem and windows, where it is known.
    """
    boxes = boxes or boxes_in(problem, windows)
    ids, table = problem.occupancy.ids, np.full((rows, len(_SIDES)), -np.inf)
    claims, why, lent = None, "", 0.0
    if boxes is not None:
        side, claims, why, lent = _claims(problem, boxes, shape, room, side)
    if claims is not None:
        tight = claims.max(axis=1)  # (C, W, 4)
    else:
        tight = np.full((windows.row.shape[1], windows.row.shape[0], len(_SIDES)), -np.inf)
    if room is not None:
        np.maximum(tight[..., _LEFT], room[0], out=tight[..., _LEFT])
        np.maximum(tight[..., _RIGHT], -room[1], out=tight[..., _RIGHT])
    # A row that two windows share has to satisfy both.
    table[windows.row[:, :-1]] = tight[:-1].swapaxes(0, 1)
    last = windows.row[:, -1]
    table[last] = np.maximum(table[last], tight[-1])
    return Separation(table[:, _LOWER], -table[:, _UPPER], windows, ids, side, claims, why, lent)


def _claims(
    problem: RepairProblem,
    boxes: Boxes,
    shape: Array,
    room: tuple[Array, Array] | None,
    side: npt.NDArray[np.intp] | None,
) -> tuple[npt.NDArray[np.intp] | None, Array | None, str, float]:
    """Sides, the signed bounds (C, N, W, 4) on the chosen one, why there is no way, and what is lent [m]."""
    margin, cover, start = problem.margin, boxes.cover, boxes.start
    floor = min(margin, 0.0)  # a negative margin lets the curve into the box by as much
    deep = (start < floor - _TOUCH).all(axis=1)
    if deep.any():
        return side, None, f"the ego starts inside obstacle {problem.occupancy.ids[int(deep.argmax())]}", 0.0
    if side is None or room is None:
        slack = _slack(boxes, shape)
    if room is not None:
        # Out of the road's reach: the road's own bounds keep the curve off.
        beside = (boxes.rightmost >= room[1]) | (boxes.leftmost <= room[0])
    else:
        beside = np.maximum(slack[..., _LEFT], slack[..., _RIGHT]) >= margin - 1e-9
    if side is None:
        side = _choose(problem, slack - margin, start)
    needed = boxes.asked & ~beside
    keep: Array | float = margin
    lent = 0.0
    # Who starts nearer than the margin keeps the distance it has.
    own = start[np.arange(len(start)), side[:, 0]]
    near = needed[:, 0] & (own >= floor - _TOUCH) & (own < margin)
    if near.any():
        keep = np.full(start.shape, margin)
        keep[near, side[near, 0]] = np.maximum(own[near], floor)
        lent = margin - float(keep.min())
        keep = keep[:, None]
    mine = (side[..., None] == _SIDES) & needed[..., None]
    return side, np.where(mine, cover + keep, -np.inf), "", lent


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
        scale = np.array((along, _ROOM_LATERAL))[SIDE_AXIS]
        score = np.where(slack > 0.0, slack / scale, slack)
    else:
        score, closed = slack[..., _ALONG].copy(), closed[:, _ALONG]
    score[:, 0][closed] = -np.inf
    return np.asarray(score.argmax(axis=2))


def sides_near(problem: RepairProblem, boxes: Boxes, shape: Array) -> npt.NDArray[np.intp]:
    """The sides (N, W) that :func:`separate` takes near a shape (W, C, 2)."""
    return _choose(problem, _slack(boxes, shape) - problem.margin, boxes.start)


def _slack(boxes: Boxes, shape: Array) -> Array:
    """What a shape (W, C, 2) has to spare on each side (N, W, 4) [m]; inf where nothing is asked."""
    place = shape.swapaxes(0, 1)[..., SIDE_AXIS] * SIDE_SIGN
    return np.asarray((place[:, None] - boxes.cover).min(axis=0))


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
    bounds : LateralBounds
    low, high : (W,) array
        Ends of s [m].
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
