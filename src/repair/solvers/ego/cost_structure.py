"""The constant matrices of a stage's cost, made once for each size and kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, combinations_with_replacement
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
    bands : int
        The same of the matrix that makes the Hessian's band of all curvatures.
    sparse : int
        Control points beyond which the maps of one axis are sparse: most of their entries are zeros.
    """

    dense: int = 6000
    bands: int = 16000
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
    bands : ((3n - 6) axes, (m axes) * (width + 1)) array or None
        Both in one, a row's curvature to the band; None where that is too large.
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
    bands: Array | None
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
    layout = _layout(n, axes, first, last, width, sizes)
    stencils = [derivative_matrix(k + 1, k, spacing)[0] for k in _ORDERS]
    values = np.concatenate(([0.0], *stencils))
    stack = frozen(values.take(layout.stack))
    products = [
        [one[low] * one[high] for low, high in _pairs(k)] for k, one in zip(_ORDERS, stencils, strict=True)
    ]
    factors = frozen(np.array([0.0, *chain.from_iterable(products)]).take(layout.factor))
    smooth = np.repeat([0.0, 2.0 * weight, 2.0 * weight], [(n - k) * axes for k in _ORDERS])
    size = (last - first) * axes * (width + 1)
    band = np.bincount(layout.where.ravel(), (factors * smooth[:, None]).ravel(), size)
    bands = dense = None
    if len(smooth) * size <= sizes.bands:
        bands = np.zeros((len(smooth), size))
        np.add.at(bands, (np.arange(len(smooth))[:, None], layout.where), factors)
        bands.setflags(write=False)
    if layout.dense is not None:
        x = values.take(layout.dense)
        dense = frozen(np.concatenate((x, -x)))
    maps = (stack, frozen(stack[:, first:last]), frozen(stack[:, first:last].T))
    if n > sizes.sparse:
        from scipy.sparse import csr_array

        maps = tuple(csr_array(m) for m in maps)
    return CostStructure(*maps, frozen(smooth), width, frozen(band), factors, layout.where, bands, dense)


class _Layout(NamedTuple):
    """Which value stands where, whatever the spacing: 0 is none.

    Attributes
    ----------
    stack : (3n - 6, n) int array
        Of the stencils of V, A and J, one after the other.
    factor, where : ((3n - 6) axes, 10) int array
        Of their products by pairs, likewise, and the entry of the band to which they are added.
    dense : ((3n - 6) axes, m axes) int array or None
        Of the stencils, for all axes.
    """

    stack: npt.NDArray[np.intp]
    factor: npt.NDArray[np.intp]
    where: npt.NDArray[np.intp]
    dense: npt.NDArray[np.intp] | None


def _pairs(order: int) -> Iterator[tuple[int, int]]:
    return combinations_with_replacement(range(order + 1), 2)


@lru_cache(maxsize=64)
def _layout(n: int, axes: int, first: int, last: int, width: int, sizes: Sizes) -> _Layout:
    count, size = 3 * n - 6, (last - first) * axes
    stack = np.zeros((count, n), dtype=np.intp)
    where, factor = np.zeros((2, count, axes, 10), dtype=np.intp)
    begin, value, product = 0, 1, 1
    for k in _ORDERS:
        i, rows = np.arange(n - k), slice(begin, begin + n - k)
        for j in range(k + 1):
            stack[begin + i, i + j] = value + j
        for slot, (low, high) in enumerate(_pairs(k)):
            both = ((first <= i + low) & (i + high < last))[:, None]  # points are free
            column = (i[:, None] + low - first) * axes + np.arange(axes)
            where[rows, :, slot] = np.where(both, column * (width + 1) + (high - low) * axes, 0)
            factor[rows, :, slot] = np.where(both, product + slot, 0)
        begin, value, product = begin + n - k, value + k + 1, product + (k + 1) * (k + 2) // 2
    dense = None
    if 2 * count * size * axes <= sizes.dense:
        dense = np.kron(stack[:, first:last], np.eye(axes, dtype=np.intp))
    made = _Layout(stack, factor.reshape(-1, 10), where.reshape(-1, 10), dense)
    for indices in made:
        if indices is not None:
            indices.setflags(write=False)
    return made
