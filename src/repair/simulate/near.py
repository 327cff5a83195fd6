"""Whether anybody comes near at all: what is asked before anything is laid out."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from repair.arrays import Array
from repair.scene.traffic.obstacle import Obstacle
from repair.vehicle.parameters import Vehicle

__all__ = ["anybody_near", "within_reach"]

_ASIDE = 12.0  # who stays farther from the path is met on no way around anybody [m]


def within_reach(obstacles: Iterable[Obstacle], path: Array) -> tuple[Obstacle, ...]:
    """Those who come near a path (P, 2) [m] at any time: nobody else is met on it, or on the way around."""
    low, high, way = path.min(axis=0), path.max(axis=0), path[:, 0] + 1j * path[:, 1]
    kept = []
    for one in obstacles:
        there = one.states[np.isfinite(one.states[:, 0]), :2]
        if one.polygons or not len(there):
            kept.append(one)
            continue
        outline = one.vertices[np.isfinite(one.vertices[:, 0, 0])][0]
        reach = _ASIDE + float(np.hypot(*(outline - there[0]).T).max())
        beside = there[((there >= low - reach) & (there <= high + reach)).all(axis=1)]  # others are farther
        if len(beside) and np.abs((beside[:, 0] + 1j * beside[:, 1])[:, None] - way).min() <= reach:
            kept.append(one)
    return tuple(kept)


def anybody_near(obstacles: Iterable[Obstacle], ego: Array, vehicle: Vehicle, margin: float) -> bool:
    """Whether an obstacle comes as near as a margin to the ego's rectangle, or may between two steps.

    Parameters
    ----------
    obstacles : iterable of Obstacle
        From now on.
    ego : (T, 3) array
        Centre and orientation at the steps [m], [rad].
    vehicle : Vehicle
    margin : float
        [m].
    """
    own = np.append(np.hypot(*np.diff(ego[:, :2], axis=0).T), 0.0)
    own[1:] = np.maximum(own[1:], own[:-1])
    cos, sin = np.cos(ego[:, 2, None]), np.sin(ego[:, 2, None])
    for one in obstacles:
        count = min(len(ego), len(one.vertices))
        corners = one.vertices[:count]
        step = np.zeros(count)
        if count > 1:
            far = np.nan_to_num(np.abs(np.diff(corners, axis=0)).max(axis=(1, 2), initial=0.0)) * 1.5
            step[:-1], step[1:] = far, np.maximum(far, np.append(far[1:], 0.0))
        room = margin + own[:count] + step
        x, y = (corners[..., k] - ego[:count, k, None] for k in (0, 1))
        along, aside = cos[:count] * x + sin[:count] * y, cos[:count] * y - sin[:count] * x
        a, b = vehicle.half_length + room, vehicle.half_width + room
        with np.errstate(invalid="ignore"):
            met = (
                (along.max(axis=1) >= -a) & (along.min(axis=1) <= a)
                & (aside.max(axis=1) >= -b) & (aside.min(axis=1) <= b)
            )  # fmt: skip
        if met.any():
            return True
    return False
