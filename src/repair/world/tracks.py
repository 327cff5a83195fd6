"""Obstacles as rows of shapes, and the ego's samples in blocks."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["CIRCLE", "POLYGON", "RECTANGLE", "Index", "as_complex", "block_samples", "shape_rows"]

Index = npt.NDArray[np.intp]
"""Places in an array."""

RECTANGLE, CIRCLE, POLYGON = range(3)


def shape_rows(obstacle: Obstacle) -> tuple[int, Array]:
    """What an obstacle is made of, and its size and place over time.

    Returns
    -------
    kind : int
        ``RECTANGLE``, ``CIRCLE`` or ``POLYGON``.
    rows : (T, 5) array
        ``x, y, heading, half length, half width``; circles, and the circumcircles of polygons, have
        their radius as both halves.
    """
    if obstacle.rectangles is not None:
        return RECTANGLE, np.asarray(obstacle.rectangles)
    rows = np.full((obstacle.n_steps + 1, 5), np.nan)
    if obstacle.circles is not None:
        rows[:, :2] = obstacle.circles[:, :2]
        rows[:, 3] = rows[:, 4] = obstacle.circles[:, 2]
        rows[:, 2] = 0.0
        return CIRCLE, rows
    for step, polygons in enumerate(obstacle.polygons[: len(rows)]):
        if polygons:
            points = np.concatenate(polygons)
            centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
            radius = np.hypot(*(points - centre).T).max()
            rows[step] = (*centre, 0.0, radius, radius)
    return POLYGON, rows


@lru_cache(maxsize=256)
def block_samples(start: int, stop: int, size: int, tracks: int) -> tuple[Index, Index, Index]:
    """Blocks of ``size`` samples that meet [start, stop).

    Returns
    -------
    middle : (n, 1) array
        The sample in the middle of each, counted from ``start`` on.
    samples : (n, size) array
        All of them, counted likewise; the first and the last of [start, stop) stand for those outside.
    rows : (n, size) array
        Where the samples' rows begin, of ``tracks`` shapes each.
    """
    samples = np.arange(start // size * size, -(-stop // size) * size).reshape(-1, size) - start
    samples = np.minimum(np.maximum(samples, 0), max(stop - start - 1, 0))
    made = samples[:, size // 2, None].copy(), samples, (samples + start) * tracks
    for indices in made:
        indices.setflags(write=False)
    return made


def as_complex(x: Array, y: Array) -> Points:
    """Points (or directions) of the plane as x + iy."""
    made = np.empty(x.shape, dtype=np.complex128)
    made.real = x
    made.imag = y
    return made
