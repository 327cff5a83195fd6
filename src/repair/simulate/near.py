"""Whether anybody comes near at all: what is asked before anything is laid out."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from repair.arrays import Array
from repair.scene.traffic.obstacle import Obstacle
from repair.vehicle.parameters import Vehicle

__all__ = ["ASIDE", "anybody_near", "within_reach"]

#: Who stays farther from the path is met on no way around anybody [m].
ASIDE = 12.0


def within_reach(obstacles: Iterable[Obstacle], path: Array) -> tuple[Obstacle, ...]:
    """Those who come near a path (P, 2) [m] at any time: nobody else is met on it, or on the way around."""
    (low_x, low_y), (high_x, high_y) = path.min(axis=0).tolist(), path.max(axis=0).tolist()
    way_x, way_y = np.ascontiguousarray(path.T)
    kept = []
    for one in obstacles:
        x, y = one.states[:, 0], one.states[:, 1]
        there = np.isfinite(x)
        if not there.all():
            x, y = x[there], y[there]
        if one.polygons or not len(x):
            kept.append(one)
            continue
        outline = one.vertices[int(np.isfinite(one.vertices[:, 0, 0]).argmax())]
        reach = ASIDE + float(np.hypot(outline[:, 0] - x[0], outline[:, 1] - y[0]).max())
        beside = (x >= low_x - reach) & (x <= high_x + reach) & (y >= low_y - reach) & (y <= high_y + reach)
        if not beside.any():  # the others are farther
            continue
        apart_x, apart_y = x[beside][:, None] - way_x, y[beside][:, None] - way_y
        apart_x *= apart_x
        apart_y *= apart_y
        apart_x += apart_y
        if apart_x.min() <= reach * reach:
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
    alike: dict[tuple[int, ...], list[Array]] = {}
    for one in obstacles:
        alike.setdefault(one.vertices.shape, []).append(one.vertices)
    return any(_met(np.array(outlines), ego, vehicle, margin) for outlines in alike.values())


def _met(outlines: Array, ego: Array, vehicle: Vehicle, margin: float) -> bool:
    """Whether one of some outlines (N, T, V, 2) is met."""
    own = np.append(np.hypot(*np.diff(ego[:, :2], axis=0).T), 0.0)
    own[1:] = np.maximum(own[1:], own[:-1])
    count = min(len(ego), outlines.shape[1])
    corners = np.ascontiguousarray(outlines[:, :count].transpose(2, 3, 0, 1))  # extremes over long rows
    moved = np.abs(corners[..., 1:] - corners[..., :-1]).max(axis=(0, 1), initial=0.0)
    far = np.zeros((outlines.shape[0], count + 1))
    far[:, 1:-1] = np.nan_to_num(moved) * 1.5
    room = margin + own[:count] + np.maximum(far[:, 1:], far[:, :-1])
    cos, sin = np.cos(ego[:count, 2]), np.sin(ego[:count, 2])
    x, y = corners[:, 0] - ego[:count, 0], corners[:, 1] - ego[:count, 1]
    along, aside = cos * x + sin * y, cos * y - sin * x
    a, b = vehicle.half_length + room, vehicle.half_width + room
    with np.errstate(invalid="ignore"):
        met = (
            (along.max(axis=0) >= -a) & (along.min(axis=0) <= a)
            & (aside.max(axis=0) >= -b) & (aside.min(axis=0) <= b)
        )  # fmt: skip
    return bool(met.any())
