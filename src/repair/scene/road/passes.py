"""Where a frame passes the same place more than once: rings of more than a lap, figure-eights.

A point of the plane then has one pair of coordinates for each passing. The frame is cut into stretches
that do not come back to themselves; on each of them the projection is unique again. Neighbouring stretches
overlap, so that whatever stands across a cut is whole on one of them, and what moves over it is on both for
a while.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from repair.arrays import Array
from repair.scene.frame import FrenetFrame

__all__ = ["along", "every_pass", "passes"]

_AGAIN = 4.0  # nearer than this [m] to an earlier part of itself, the path is there once more
_APART = 15.0  # arc length in between, at least [m]
_SPACING = 1.0  # of the points that are looked at [m]
_SHARED = 10.0  # half of what neighbouring stretches have in common, at most [m]


@lru_cache(maxsize=8)  # a planner's frame stays the same for many cycles
def passes(frame: FrenetFrame) -> list[tuple[float, float]]:
    """The stretches of a frame that do not come back to themselves.

    Returns
    -------
    list of (low, high)
        Arc lengths [m]; the first begins at -inf and the last ends at inf. One for most frames.
    """
    from scipy.spatial import cKDTree

    stride = max(round(_SPACING * (len(frame.s) - 1) / frame.length), 1)
    s, points = frame.s[::stride], frame.points[::stride]
    pairs = cKDTree(points).query_pairs(_AGAIN, output_type="ndarray")
    lower, upper = np.sort(s[pairs], axis=1).T
    again = upper - lower > _APART
    lower, upper = lower[again], upper[again]
    if not len(lower):
        return [(-np.inf, np.inf)]
    shared = min(_SHARED, float(np.min(upper - lower)) / 6.0)
    found: list[tuple[float, float]] = []
    low = -np.inf
    while True:
        ahead = upper[lower >= low]
        if not len(ahead):
            return [*found, (low, np.inf)]
        high = float(ahead.min())
        found.append((low, high))
        low = high - 2.0 * shared


def every_pass(frame: FrenetFrame, points: Array) -> list[Array]:
    """Frenet coordinates of points (..., 2), once for each pass; NaN where a pass does not come by.

    Of a frame that passes no place twice these are the coordinates that it has anyway.
    """
    stretches = passes(frame)
    if len(stretches) == 1:
        return [frame.to_frenet(points)]
    return [_on(frame, points, low, high) for low, high in stretches]


def _on(frame: FrenetFrame, points: Array, low: float, high: float) -> Array:
    """Coordinates on one stretch alone."""
    from scipy.spatial import cKDTree

    table = np.flatnonzero((frame.s >= low) & (frame.s <= high))
    flat = points.reshape(-1, 2)
    made = np.full(flat.shape, np.nan)
    known = np.isfinite(flat).all(axis=1)
    if known.any():
        nearest = table[cKDTree(frame.points[table]).query(flat[known])[1]]
        found = frame.to_frenet(flat[known], near=frame.s[nearest])
        # past the stretch's own ends it is another pass's, but for where the frame itself ends
        found[~((found[:, 0] >= low - 1.0) & (found[:, 0] <= high + 1.0))] = np.nan
        made[known] = found
    return made.reshape(points.shape)


def along(frame: FrenetFrame, points: Array, start: float) -> Array:
    """Frenet coordinates of points (K, 2) driven one after the other, from about ``start`` [m] on."""
    if len(passes(frame)) == 1:
        return frame.to_frenet(points)
    made = np.empty(points.shape)
    near = start
    for k, point in enumerate(points):
        made[k] = frame.to_frenet(point, near=near)
        near = made[k, 0] if np.isfinite(made[k, 0]) else near
        if k + 1 < len(points):  # as far on as the last step went
            near += float(np.hypot(*(points[k + 1] - point)))
    return made
