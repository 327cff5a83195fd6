"""Obstacles as rows of shapes, and the ego's samples in blocks."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["CIRCLE", "POLYGON", "RECTANGLE", "as_complex", "block_samples", "shape_rows"]

Index = npt.NDArray[np.intp]


RECTANGLE, CIRCLE, POLYGON = range(3)


def shape_rows(obstacle: Obstacle) -> tuple[int, Array]:
    """What an obstacle is made of, and (T, 5) ``x, y, heading, half length, half width``.

    Circles, and the circumcircles of polygons, have their radius as half length.
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
    """Of each block of ``size`` samples that meets [start, stop): its middle (n, 1), its samples (n, size).

    Counted from ``start`` on; the first and the last of [start, stop) stand for those outside. Also where
    the samples' rows of ``tracks`` shapes each begin.
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
