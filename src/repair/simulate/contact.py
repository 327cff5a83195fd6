"""Contact with what truly happened, by true shapes and Shapely.

Nothing of this is shared with what policies ask: not the rectangles, not the test, not the sampling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.scene.traffic.obstacle import Obstacle

__all__ = ["Struck", "first_struck", "least_distance"]

_BULGE = 1.0  # who turns between two steps reaches beyond the box around both by less than this [m]


@dataclass(frozen=True)
class Struck:
    """A contact.

    Attributes
    ----------
    time : float
        [s] since the drive began.
    obstacle_id : int
    from_behind : bool
        The obstacle's centre is behind the middle of the ego's rear half, and it is the one that closes in.
    speed : float
        Of one against the other [m/s].
    ego_speed : float
        [m/s].
    """

    time: float
    obstacle_id: int
    from_behind: bool
    speed: float
    ego_speed: float


def first_struck(
    obstacles: Sequence[Obstacle], poses: Array, size: tuple[float, float], dt: float, start: float = 0.0
) -> Struck | None:
    """First contact, looked at as often as the ego's poses are given.

    Parameters
    ----------
    obstacles : sequence of Obstacle
        What happened; the rows begin where the poses do.
    poses : (K, 4) array
        Centre [m], orientation [rad] and speed [m/s] of the ego, evenly spaced; a whole number to each step.
    size : (float, float)
        Length and width of the ego [m].
    dt : float
        Of the rows [s].
    start : float
        When the rows begin [s].
    """
    found = [(k, one) for one in obstacles if (k := _first(one, poses, size, 0.0)) is not None]
    if not found:
        return None
    k, one = min(found, key=lambda each: each[0])
    per = _per_step(one, poses)
    x, y, yaw, speed = poses[k].tolist()
    axis = np.array([np.cos(yaw), np.sin(yaw)])
    centre, velocity = _moving(one, k, per, dt)
    against = velocity - speed * axis
    behind = float((centre - (x, y)) @ axis) < -0.25 * size[0] and float(against @ axis) > 0.0
    return Struck(start + k * dt / per, one.id, behind, float(np.hypot(*against)), speed)


def least_distance(
    obstacles: Sequence[Obstacle], poses: Array, size: tuple[float, float], most: float
) -> float:
    """Least distance between the ego and anybody [m]; at most ``most``, beyond which it is not looked for."""
    import shapely

    least = most
    for one in obstacles:
        for k in _near(one, poses, size, least):
            shape = _shape(one, k, _per_step(one, poses))
            if shape is not None:
                least = min(least, float(shapely.distance(shape, _rectangle(poses[k], size))))
    return least


def _per_step(one: Obstacle, poses: Array) -> int:
    return max((len(poses) - 1) // max(len(one.vertices) - 1, 1), 1)


def _first(one: Obstacle, poses: Array, size: tuple[float, float], margin: float) -> int | None:
    import shapely

    per = _per_step(one, poses)
    for k in _near(one, poses, size, margin):
        shape = _shape(one, k, per)
        if shape is not None and shapely.intersects(shape, _rectangle(poses[k], size)):
            return int(k)
    return None


def _near(one: Obstacle, poses: Array, size: tuple[float, float], margin: float) -> Any:
    """Samples at which circles around both come as near as a margin."""
    per = _per_step(one, poses)
    rows = one.vertices
    room = 0.5 * float(np.hypot(*size)) + margin + _BULGE
    low, high = np.fmin.reduce(rows, axis=(0, 1)), np.fmax.reduce(rows, axis=(0, 1))
    if (poses[:, :2].min(axis=0) - room > high).any() or (poses[:, :2].max(axis=0) + room < low).any():
        return np.zeros(0, dtype=np.intp)  # most are far off all the time
    middle = np.nanmean(rows, axis=1) if np.isfinite(rows).all() else _means(rows)
    radius = float(np.nanmax(np.hypot(*(rows - middle[:, None]).transpose(2, 0, 1))))
    samples = np.arange(len(poses))
    low = np.minimum(samples // per, len(rows) - 1)
    high = np.minimum(low + 1, len(rows) - 1)
    own = 0.5 * float(np.hypot(*size))
    gap = np.full(len(poses), np.inf)
    for row in (low, high):
        there = np.hypot(*(poses[:, :2] - middle[row]).T)
        gap = np.fmin(gap, there)
    moved = np.nan_to_num(np.hypot(*(middle[high] - middle[low]).T))
    return np.flatnonzero(gap <= own + radius + moved + margin)


def _means(rows: Array) -> Array:
    there = np.isfinite(rows).all(axis=(1, 2))
    made = np.full((len(rows), 2), np.nan)
    made[there] = rows[there].mean(axis=1)
    return made


def _rectangle(pose: Array, size: tuple[float, float]) -> Any:
    """A body of some length and width [m], by centre and orientation."""
    import shapely

    (x, y, yaw), (length, width) = pose[:3].tolist(), size
    along = 0.5 * length * np.array([np.cos(yaw), np.sin(yaw)])
    aside = 0.5 * width * np.array([-np.sin(yaw), np.cos(yaw)])
    corners = [along + aside, aside - along, -along - aside, along - aside]
    return shapely.Polygon(np.array([x, y]) + corners)


def _shape(one: Obstacle, k: int, per: int) -> Any:
    """The obstacle at a sample; rectangles and circles move evenly between the steps, sets hold."""
    import shapely

    low, share = divmod(k, per)
    high, weight = (low + 1, share / per) if share else (low, 0.0)
    if high >= len(one.vertices):
        return None
    if one.rectangles is not None:
        a, b = one.rectangles[low], one.rectangles[high]
        if not (np.isfinite(a).all() and np.isfinite(b).all()):
            return None
        turn = (b[2] - a[2] + np.pi) % (2.0 * np.pi) - np.pi
        x, y, _, half, wide = a + weight * (b - a)
        pose = np.array([x, y, a[2] + weight * turn])
        return _rectangle(pose, (2.0 * float(half), 2.0 * float(wide)))
    if one.circles is not None:
        x, y, radius = one.circles[low] + weight * (one.circles[high] - one.circles[low])
        return shapely.Point(x, y).buffer(radius) if np.isfinite(x) else None
    parts = [shapely.Polygon(p) for p in one.polygons[low]] if one.polygons else []
    return shapely.union_all(parts) if parts else None


def _moving(one: Obstacle, k: int, per: int, dt: float) -> tuple[Array, Array]:
    """Centre [m] and velocity [m/s] of an obstacle at a sample, by the step that leads there."""
    places, last = one.states[:, :2], len(one.states) - 1
    high = min(max(-(-k // per), 1), last)
    for low, there in ((max(high - 1, 0), high), (high, min(high + 1, last))):  # it may appear just then
        change = places[there] - places[low]
        if np.isfinite(change).all():
            share = min(max(k / per - low, 0.0), 1.0)
            return places[low] + share * change, change / dt
    return places[min(k // per, last)], np.zeros(2)
