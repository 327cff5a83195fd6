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

import numpy as np
import numpy.typing as npt

from repair.types import Array, LateralBounds, RepairProblem, Side

__all__ = ["NOBODY", "ROAD", "Separation", "Windows", "road_room", "separate"]

NOBODY, ROAD = -1, -2
# The coordinate times SIGN exceeds the edge times SIGN on each side, in the order of Side.
_SIGN = np.array([-1.0, 1.0, 1.0, -1.0])
_AXIS = np.array([0, 0, 1, 1])
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
        Row of the model that holds point j of the window (end points are shared).
    fraction : (C,) array
        Where in the window point j acts, 0 to 1.
    """

    start: Array
    end: Array
    row: npt.NDArray[np.intp]
    fraction: Array


@dataclass
class Separation:
    """Bounds (R, 2) of the position rows ``[s, l]`` and whom they come from.

    ``side`` (N, W) is the side taken of each obstacle in each window, ``room`` the road's room that was
    used. ``why`` names a conflict known before any solver is asked; empty where there is none.
    """

    lower: Array
    upper: Array
    lower_by: npt.NDArray[np.int64]
    upper_by: npt.NDArray[np.int64]
    times: Array
    side: npt.NDArray[np.intp] | None = None
    room: tuple[Array, Array] | None = None
    why: str = ""

    def who(self, number: int) -> str:
        """Name of the owner of a bound."""
        return "the edge of the road" if number == ROAD else f"obstacle {number}"


def _edges(problem: RepairProblem, windows: Windows) -> tuple[Array, Array, Array]:
    """Signed edges that cover the boxes' over each window.

    Returns
    -------
    cover : (N, W, C, 4) array
        Bernstein points of the covering line for each side; -inf where it asks for nothing.
    first : (N, 4) array
        Signed edges at the first instant, NaN where the obstacle is not there.
    knots : (W, K) array
        The times looked at.
    """
    width = float(np.max(windows.end - windows.start)) if len(windows.start) else 0.0
    dt = problem.dt
    inner = int(np.floor(width / dt + 1e-9)) + 1 if width > 0.0 else 0
    base = np.floor(windows.start / dt + 1e-6)[:, None]
    steps = (base + np.arange(1, inner + 1)) * dt
    end = windows.end[:, None]
    knots = np.concatenate([windows.start[:, None], np.where(steps < end - 1e-9, steps, end), end], axis=1)
    lower, upper = problem.occupancy.at(knots.ravel())
    shape = (len(problem.occupancy), *knots.shape, 2)
    lower, upper = lower.reshape(shape), upper.reshape(shape)
    edge = np.stack([-lower[..., 0], upper[..., 0], upper[..., 1], -lower[..., 1]], axis=-1)
    present = np.isfinite(edge).all(axis=-1)  # (N, W, K)
    # Only there at one end: that instant alone; there for a part: as far as it ever gets, throughout.
    at_end = np.arange(knots.shape[1])[None, :] >= knots.shape[1] - 1
    at_end = at_end | (knots >= end - 1e-9)
    only_first = present[..., 0] & ~present[..., 1:].any(axis=-1) & (width > 0.0)
    only_last = (present == at_end).all(axis=-1) & ~present[..., 0] & (width > 0.0)
    some = present.any(axis=-1)
    most = np.max(np.where(present[..., None], edge, -np.inf), axis=2, keepdims=True)
    edge = np.where(present[..., None], edge, most)
    span = np.maximum(end - windows.start[:, None], 1e-12)
    where = ((knots - windows.start[:, None]) / span)[None, :, :, None]
    with np.errstate(invalid="ignore"):
        line = edge[:, :, :1] + (edge[:, :, -1:] - edge[:, :, :1]) * where
        lift = np.max(edge - line, axis=2, keepdims=True)
        cover = (
            edge[:, :, :1] + (edge[:, :, -1:] - edge[:, :, :1]) * windows.fraction[None, None, :, None]
        ) + np.maximum(lift, 0.0)
    cover[~some] = -np.inf
    if width > 0.0:
        cover[only_first, 1:] = -np.inf
        cover[only_last, :-1] = -np.inf
    first = np.where(present[:, :1, 0, None], edge[:, :1, 0], np.nan)[:, 0]
    return cover, first, knots


def separate(
    problem: RepairProblem,
    windows: Windows,
    rows: int,
    shape: Array,
    room: tuple[Array, Array] | None,
    side: npt.NDArray[np.intp] | None = None,
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
    """
    lower, upper = np.full((rows, 2), -np.inf), np.full((rows, 2), np.inf)
    lower_by, upper_by = (np.full((rows, 2), NOBODY, dtype=np.int64) for _ in range(2))
    times = np.zeros(rows)
    moment = windows.start[:, None] + windows.fraction * (windows.end - windows.start)[:, None]
    times[windows.row.ravel()] = moment.ravel()
    result = Separation(lower, upper, lower_by, upper_by, times, side, room)
    if len(problem.occupancy) and len(windows.start):
        _obstacles(problem, windows, shape, room, result)
    if room is not None:
        right, left = room
        _tighten(result, 1, -1.0, windows.row, np.repeat(-left[:, None], windows.row.shape[1], 1), ROAD)
        _tighten(result, 1, 1.0, windows.row, np.repeat(right[:, None], windows.row.shape[1], 1), ROAD)
    return result


def _obstacles(
    problem: RepairProblem,
    windows: Windows,
    shape: Array,
    room: tuple[Array, Array] | None,
    result: Separation,
) -> None:
    """Bound the rows by the chosen side of every obstacle, or say in ``why`` that there is no way."""
    cover, first, _ = _edges(problem, windows)
    margin, ids = problem.margin, problem.occupancy.ids
    start = problem.start[0][_AXIS] * _SIGN - first  # (N, 4)
    floor = min(margin, 0.0)  # a negative margin lets the curve into the box by as much
    deep = np.where(np.isfinite(start), start, np.inf).max(axis=1) < floor - _TOUCH
    if deep.any():
        result.why = f"the ego starts inside obstacle {ids[int(np.argmax(deep))]}"
        return
    slack = np.min(shape[None][..., _AXIS] * _SIGN - cover, axis=2)  # (N, W, 4); inf where nothing is asked
    if problem.lateral:
        assert room is not None
        # Out of the road's reach: the road's own bounds keep the curve off.
        right, left = room
        beside = (-cover[..., 3].max(axis=2) - margin >= left) | (cover[..., 2].max(axis=2) + margin <= right)
    else:
        beside = (slack[..., 2:] >= margin - 1e-9).any(axis=2)
    if result.side is None:
        result.side = _choose(problem, slack - margin, start)
    side = result.side
    needed = np.isfinite(cover).any(axis=(2, 3)) & ~beside
    n, w = np.nonzero(needed)
    chosen = side[n, w]
    # Who starts nearer than the margin keeps the distance it has.
    from_start = np.zeros(start.shape, dtype=bool)
    from_start[np.arange(len(start)), side[:, 0]] = needed[:, 0]
    from_start &= np.isfinite(start) & (start >= floor - _TOUCH)
    keep = np.where(from_start, np.clip(start, floor, margin), margin)
    bound = cover[n, w, :, chosen] + keep[n, chosen][:, None]
    for k in range(4):
        mine = chosen == k
        _tighten(result, int(_AXIS[k]), float(_SIGN[k]), windows.row[w[mine]], bound[mine], ids[n[mine]])


def _choose(problem: RepairProblem, slack: Array, start: Array) -> npt.NDArray[np.intp]:
    """Side (N, W) of each obstacle: where the shape has the most room, a metre across counting for more.

    Parameters
    ----------
    slack : (N, W, 4) array
        What the shape has to spare on each side [m]; negative where it is on another side.
    start : (N, 4) array
        The same at the first instant; the given state rules sides out.
    """
    along = _ROOM_ALONG[0] + _ROOM_ALONG[1] * max(float(problem.start[1, 0]), 0.0)
    scale = np.array([along, along, _ROOM_LATERAL, _ROOM_LATERAL])
    score = np.where(slack > 0.0, slack / scale, slack)
    score[:, 0][np.isfinite(start) & (start < min(problem.margin, 0.0) - _TOUCH)] = -np.inf
    if not problem.lateral:
        score[..., 2:] = -np.inf
    return np.asarray(np.argmax(score, axis=2))


def _tighten(
    result: Separation,
    axis: int,
    sign: float,
    row: npt.NDArray[np.intp],
    bound: Array,
    who: int | npt.NDArray[np.int64],
) -> None:
    """Take over ``sign * x >= bound`` (M, C) where it is tighter than what is there."""
    if not bound.size:
        return
    flat, value = row.ravel(), bound.ravel()
    owner = np.broadcast_to(np.asarray(who).reshape(-1, 1), bound.shape).ravel()
    order = np.argsort(value, kind="stable")  # the last one written is the tightest
    flat, value, owner = flat[order], value[order], owner[order]
    best = np.full(len(result.lower), -np.inf)
    name = np.full(len(result.lower), NOBODY, dtype=np.int64)
    best[flat], name[flat] = value, owner
    if sign > 0:
        better = best > result.lower[:, axis]
        result.lower[better, axis], result.lower_by[better, axis] = best[better], name[better]
    else:
        better = -best < result.upper[:, axis]
        result.upper[better, axis], result.upper_by[better, axis] = -best[better], name[better]


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
    s = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, 9)
    right, left = bounds.at(s)
    inside = (bounds.s >= low[:, None]) & (bounds.s <= high[:, None])
    right = np.maximum(right.max(axis=1), np.where(inside, bounds.right, -np.inf).max(axis=1))
    left = np.minimum(left.min(axis=1), np.where(inside, bounds.left, np.inf).min(axis=1))
    return np.minimum(right + edge, own_right), np.maximum(left - edge, own_left)
