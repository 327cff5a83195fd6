"""The constant matrices of a stage's cost, made once for each size and kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.bases import derivative_matrix

__all__ = ["SIZES", "CostStructure", "Sizes", "cost_structure"]

_ORDERS = (1, 2, 3)


class Sizes(NamedTuple):
    """Up to which sizes a cost takes the forms that are the faster ones for small problems.

    On small problems calls are what time is spent on: there one dense matrix makes everything that is
    bounded. Beyond, the axes are kept apart, and -x and the pairs are not multiplied out. The results
    are the same but for rounding.

    Attributes
    ----------
    dense : int
        Entries of that matrix up to which it is made.
    sparse : int
        Control points beyond which the maps of one axis are sparse: most of their entries are zeros.
    """

    dense: int = 6000
    sparse: int = 100


#: What is fastest on the machines that were measured.
SIZES = Sizes()


@dataclass(frozen=True)
class CostStructure:
    """What depends on numbers of points and axes, spacing, the free points and lambda_s alone.

    Free coordinates are numbered point by point, ``(i - first) * axes + axis``. The band is the lower
    form of LAPACK, column by column: entry (r, c) with r >= c at ``c * (width + 1) + r - c``.

    Attributes
    ----------
    stack : (3n - 6, n) matrix
        Control points of one axis to [V; A; J].
    free : (3n - 6, m) matrix
        The columns of the free ones.
    back : (m, 3n - 6) matrix
        Transposed. All three are sparse for many points.
    smooth : ((3n - 6) axes,) array
        Curvature of lambda_s J_s by every row.
    width : int
        Of the band.
    band : ((m axes) * (width + 1),) array
        Hessian of lambda_s J_s.
    factor, where : ((3n - 6) axes, 10) array
        By which a row's curvature is added to the band, and to which of its entries.
    dense : (2 (3n - 6) axes, m axes) array or None
        Free coordinates to x and -x of all axes; None where that is too large.
    """

    stack: Any
    free: Any
    back: Any
    smooth: Array
    width: int
    band: Array
    factor: Array
    where: npt.NDArray[np.intp]
    dense: Array | None


@lru_cache(maxsize=64)
def cost_structure(
    n: int,
    axes: int,
    first: int,
    last: int,
    spacing: float,
    weight: float,
    width: int,
    sizes: Sizes = SIZES,
) -> CostStructure:
    """The structure of a cost over the points ``first`` to ``last`` of ``n``, kept for the next one like it.

    Parameters
    ----------
    spacing : float
        Knot spacing [s].
    weight : float
        lambda_s.
    width : int
        Of the band: how far apart the coordinates are that one term of the cost couples.
    sizes : Sizes
    """
    stack = np.vstack([derivative_matrix(n, k, spacing) for k in _ORDERS])
    size = (last - first) * axes
    where, factor = np.zeros((len(stack), axes, 10), dtype=np.intp), np.zeros((len(stack), axes, 10))
    begin = 0
    for k in _ORDERS:
        i = np.arange(n - k)
        stencil, rows = stack[begin, : k + 1], slice(begin, begin + n - k)
        for slot, (low, high) in enumerate(combinations_with_replacement(range(k + 1), 2)):
            both = ((first <= i + low) & (i + high < last))[:, None]  # points are free
            column = (i[:, None] + low - first) * axes + np.arange(axes)
            where[rows, :, slot] = np.where(both, column * (width + 1) + (high - low) * axes, 0)
            factor[rows, :, slot] = np.where(both, stencil[low] * stencil[high], 0.0)
        begin += n - k
    smooth = np.repeat([0.0, 2.0 * weight, 2.0 * weight], [(n - k) * axes for k in _ORDERS])
    factors = frozen(factor.reshape(-1, 10))
    band = np.bincount(where.ravel(), (factors * smooth[:, None]).ravel(), size * (width + 1))
    entries, dense = where.reshape(-1, 10), None
    entries.setflags(write=False)
    if 2 * len(stack) * size * axes <= sizes.dense:
        x = np.kron(stack[:, first:last], np.eye(axes))
        dense = frozen(np.concatenate((x, -x)))
    maps = (frozen(stack), frozen(stack[:, first:last]), frozen(stack[:, first:last].T))
    if n > sizes.sparse:
        from scipy.sparse import csr_array

        maps = tuple(csr_array(m) for m in maps)
    return CostStructure(*maps, frozen(smooth), width, frozen(band), factors, entries, dense)
