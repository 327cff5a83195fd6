"""Contact of true shapes at any time: a test of its own, by halving of time and a bound on the motion.

At the middle of an interval two shapes are some distance apart; where that is more than both can move until
the ends of the interval, they do not meet in it. Where it is not, the interval is halved.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.certify.motion import Motion, wrapped
from repair.certify.traffic import Body

__all__ = ["Meeting", "first_meeting", "outlines"]

_SHORTEST = 1e-6  # intervals shorter than this [s] are not halved: who cannot be told apart there touches
_NEAR = 2.0  # distances below this are measured, others only told from contact [m]
_BULGE = 1e-5  # the ego's way between its samples, against the straight one [m]


@dataclass(frozen=True)
class Meeting:
    """First contact [s] (inf: never) and with whom; the smallest distance seen [m], and to whom."""

    time: float
    obstacle_id: int | None
    distance: float
    nearest: int | None


def outlines(poses: Array, half_length: float, half_width: float) -> Any:
    """Rectangles at poses (K, 3) as shapely polygons (K,)."""
    import shapely

    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    forward = half_length * np.array([1.0, -1.0, -1.0, 1.0])
    left = half_width * np.array([1.0, 1.0, -1.0, -1.0])
    x = poses[:, :1] + c * forward - s * left
    y = poses[:, 1:2] + s * forward + c * left
    return shapely.polygons(np.stack([x, y], axis=-1))


class _Ego:
    """The ego at any time, and how fast a point of it is at most in each step."""

    def __init__(self, motion: Motion, half: tuple[float, float], dt: float) -> None:
        self.motion, self.half, self.dt = motion, half, dt
        self.radius = float(np.hypot(*half))
        self.since, self.t_end = 0.0, float(motion.t[-1])
        change = np.abs(np.diff(motion.poses, axis=0))
        rate = np.hypot(change[:, 0], change[:, 1]) + self.radius * change[:, 2]
        rate = rate / np.maximum(np.diff(motion.t), 1e-12)
        step = np.floor(0.5 * (motion.t[1:] + motion.t[:-1]) / dt).astype(np.intp)
        self.rates = np.zeros(int(np.ceil(self.t_end / dt - 1e-6)) + 1)
        np.maximum.at(self.rates, np.clip(step, 0, len(self.rates) - 1), rate)

    def begun(self, at: float = 0.0) -> _Ego:
        """The same at one instant alone."""
        one = copy(self)
        one.since = one.t_end = at
        return one

    def at(self, t: Array) -> Array:
        return np.stack([np.interp(t, self.motion.t, column) for column in self.motion.poses.T], axis=1)


def first_meeting(
    motion: Motion,
    half: tuple[float, float],
    bodies: Iterable[Body],
    dt: float,
    *,
    since: float = 0.0,
    beside: bool = False,
) -> Meeting:
    """The first contact of the ego's rectangle with any body.

    Parameters
    ----------
    motion : Motion
        From the planning problem's start on.
    half : tuple of float
        Half length and half width of the ego, a margin included where one is asked about [m].
    bodies : iterable of Body
    dt : float
        Time step of the scenario [s].
    since : float
        Earlier contacts do not count [s].
    beside : bool
        A body that the ego meets at the start counts once the ego has been clear of it.
    """
    ego = _Ego(motion, half, dt)
    time, who, distance, nearest = np.inf, None, np.inf, None
    for body in bodies:
        meets = _held if body.outline is None else _moving
        ego.since = since
        if beside and meets(ego.begun(), body, np.inf)[0] < np.inf:
            left = (
                k * dt
                for k in range(1, len(ego.rates))
                if meets(ego.begun(k * dt), body, np.inf)[0] == np.inf
            )
            ego.since = max(since, next(left, np.inf))
        at, near = meets(ego, body, time)
        if at < time:
            time, who = at, body.id
        if near < distance:
            distance, nearest = near, body.id
    return Meeting(float(time), who, float(distance), nearest)


def _steps(ego: _Ego, count: int) -> tuple[Array, Array, npt.NDArray[np.intp]]:
    """The scenario's steps of the ego's way: begins, ends, numbers."""
    k = np.arange(min(len(ego.rates), count))
    begin, end = k * ego.dt, np.minimum((k + 1) * ego.dt, ego.t_end)
    kept = (begin <= ego.t_end + 1e-9) & (np.maximum(end, begin) >= ego.since)
    begin, end = np.maximum(begin, ego.since)[kept], end[kept]
    return begin, np.maximum(end, begin), k[kept]


def _moving(ego: _Ego, body: Body, before: float) -> tuple[float, float]:
    """First contact with a body that moves [s], if before another one; the smallest distance seen [m]."""
    import shapely

    begin, end, k = _steps(ego, len(body.poses))
    here, there = body.poses[k], body.poses[np.minimum(k + 1, len(body.poses) - 1)].copy()
    # There at a step, but not at the next: at that instant alone.
    gone = np.isfinite(here[:, 0]) & ~np.isfinite(there[:, 0])
    there[gone], end = here[gone], np.where(gone, begin, end)
    turn, shift = wrapped(there[:, 2] - here[:, 2]), there[:, :2] - here[:, :2]
    rate = (np.hypot(shift[:, 0], shift[:, 1]) + body.radius * np.abs(turn)) / ego.dt + ego.rates[k]
    row = np.flatnonzero(np.isfinite(here[:, 0]))
    low, high = begin[row], end[row]
    first, nearest = np.inf, np.inf
    while len(row):
        middle = 0.5 * (low + high)
        share = np.clip(middle / ego.dt - k[row], 0.0, 1.0)
        poses, place = ego.at(middle), here[row, :2] + share[:, None] * shift[row]
        reach = rate[row] * 0.5 * (high - low) + _BULGE
        apart = np.hypot(*(poses[:, :2] - place).T) - ego.radius - body.radius
        close = np.flatnonzero((apart <= np.maximum(reach, _NEAR)) & (low < min(first, before)))
        if not len(close):
            break
        low, high, row, reach, middle = low[close], high[close], row[close], reach[close], middle[close]
        shapes = _turned(body.outline, place[close], here[row, 2] + share[close] * turn[row])
        gap = shapely.distance(outlines(poses[close], *ego.half), shapes)
        nearest = min(nearest, float(gap.min()))
        met = _met(gap, reach, low, high)
        if met.any():
            first = min(first, float(middle[met].min()))
        again = (gap <= reach) & (high - low > _SHORTEST) & (low < first)
        row = np.concatenate((row[again], row[again]))
        low, high = _halves(low[again], high[again])
    return first, nearest


def _met(gap: Array, reach: Array, low: Array, high: Array) -> npt.NDArray[np.bool_]:
    """Intervals in whose middle there is contact, or in which it cannot be told from one."""
    return np.asarray((gap <= 0.0) | ((high - low <= _SHORTEST) & (gap <= reach)))


def _halves(low: Array, high: Array) -> tuple[Array, Array]:
    middle = 0.5 * (low + high)
    return np.concatenate((low, middle)), np.concatenate((middle, high))


def _turned(outline: Any, place: Array, angle: Array) -> Any:
    """An outline at poses, as shapely geometries."""
    import shapely

    points = shapely.get_coordinates(outline.exterior)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x = place[:, :1] + c * points[:, 0] - s * points[:, 1]
    y = place[:, 1:] + s * points[:, 0] + c * points[:, 1]
    return shapely.polygons(np.stack([x, y], axis=-1))


def _held(ego: _Ego, body: Body, before: float) -> tuple[float, float]:
    """The same for a region that holds over each step."""
    import shapely

    begin, end, k = _steps(ego, len(body.held))
    first, nearest = np.inf, np.inf
    for i, step in enumerate(k.tolist()):
        region, low, high = body.held[step], begin[i : i + 1], end[i : i + 1]
        while region is not None and len(low):
            middle, reach = 0.5 * (low + high), ego.rates[step] * 0.5 * (high - low) + _BULGE
            gap = shapely.distance(outlines(ego.at(middle), *ego.half), region)
            nearest = min(nearest, float(gap.min()))
            met = _met(gap, reach, low, high)
            if met.any():
                first = min(first, float(middle[met].min()))
            again = (gap <= reach) & (high - low > _SHORTEST) & (low < min(first, before))
            low, high = _halves(low[again], high[again])
        if first < np.inf:
            break
    return first, nearest
