"""Bounds of a piecewise polynomial's speed, by the hulls of Bernstein points.

Source: Farin, *Curves and Surfaces for CAGD*, 5th edition 2002: convex-hull property, and
subdivision of Bernstein polynomials.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from repair.arrays import Array, frozen

__all__ = ["speed_hulls"]


@lru_cache(maxsize=16)
def _cut(degree: int, cuts: int) -> Array:
    """Map (cuts, p + 1, p + 1) from the Bernstein points of a piece to those of its equal parts.

    Point j of a part is the piece's blossom at p - j times its start and j times its end.
    """
    p = degree
    made = np.zeros((cuts, p + 1, p + 1))
    for k in range(cuts):
        start, end = k / cuts, (k + 1) / cuts
        for j in range(p + 1):
            for a in range(p - j + 1):
                for b in range(j + 1):
                    made[k, j, a + b] += (
                        comb(p - j, a) * start**a * (1 - start) ** (p - j - a)
                        * comb(j, b) * end**b * (1 - end) ** (j - b)
                    )  # fmt: skip
    return frozen(made)


def speed_hulls(points: Array, t_start: float, duration: float, cuts: int) -> tuple[Array, Array, Array]:
    """Bounds of s' (see :meth:`repair.curves.base.Hulled.speed_hulls`).

    Parameters
    ----------
    points : (M, p + 1) array
        Bernstein points of s, by piece.
    t_start, duration : float
        Start of the first piece and duration of each [s].
    """
    pieces, width = points.shape
    speed = (width - 1) / duration * (points[:, 1:] - points[:, :-1])
    if cuts > 1:
        speed = np.einsum("cij,mj->mci", _cut(width - 2, cuts), speed).reshape(pieces * cuts, -1)
    times = t_start + duration / cuts * np.arange(pieces * cuts)
    return times, np.minimum.reduce(speed, axis=1), np.maximum.reduce(speed, axis=1)
