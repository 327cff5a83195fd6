"""The cost of both soft stages over the free control points, with gradient and banded Hessian.

J = lambda_s J_s + the penalties of the derivatives' control points and of the {p, v} pairs
+ lambda_f J_f (paper, Sec. IV-C and IV-D). It is convex and twice continuously differentiable, and
every term couples neighbouring control points only, so that the Hessian is a band.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import dsbmv
from scipy.linalg.lapack import dpbtrf, dpbtrs

from repair.arrays import Array, frozen
from repair.curves.bases import basis_matrix, derivative_matrix
from repair.solvers.ego.penalties import SoftBounds

__all__ = ["Point", "SplineCost", "fitting_band"]

_ORDERS = (1, 2, 3)
# Up to this many entries one dense matrix makes everything that is bounded: on small problems calls are what
# time is spent on. Beyond, the axes are kept apart and -x and the pairs are not multiplied out.
_DENSE = 6000
_SPARSE = 100  # With more control points than this, most entries of a dense map of one axis are zeros.
_NONE, _NOTHING = np.empty(0, dtype=np.intp), np.empty(0)


@dataclass(frozen=True)
class _Structure:
    """What depends on numbers of points and axes, spacing, the free points and lambda_s alone.

    Free coordinates are numbered point by point, ``(i - first) * axes + axis``. The band is the lower
    form of LAPACK, column by column: entry (r, c) with r >= c at ``c * (width + 1) + r - c``.
    """

    stack: Any  # (3n - 6, n): control points of one axis to [V; A; J]
    free: Any  # (3n - 6, m): the columns of the free ones
    back: Any  # (m, 3n - 6): transposed
    smooth: Array  # ((3n - 6) axes,): curvature of lambda_s J_s by every row
    width: int  # of the band
    band: Array  # ((m axes) * (width + 1),): Hessian of lambda_s J_s
    factor: Array  # ((3n - 6) axes, 10): by which a row's curvature is added to the band,
    where: npt.NDArray[np.intp]  # ((3n - 6) axes, 10): and to which of its entries
    dense: Array | None  # (2 (3n - 6) axes, m axes): free coordinates to x and -x of all axes


@lru_cache(maxsize=64)
def _structure(
    n: int, axes: int, first: int, last: int, spacing: float, weight: float, width: int
) -> _Structure:
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
    if 2 * len(stack) * size * axes <= _DENSE:
        x = np.kron(stack[:, first:last], np.eye(axes))
        dense = frozen(np.concatenate((x, -x)))
    maps = (frozen(stack), frozen(stack[:, first:last]), frozen(stack[:, first:last].T))
    if n > _SPARSE:
        from scipy.sparse import csr_array

        maps = tuple(csr_array(m) for m in maps)
    return _Structure(*maps, frozen(smooth), width, frozen(band), factors, entries, dense)


class Point(NamedTuple):
    """The cost at one place: value, gradient, and the penalties' curvatures."""

    value: float
    gradient: Array
    curvature: Array


class SplineCost:
    """A stage's cost over the displacements u of its free control points, flattened (m * axes,).

    Parameters
    ----------
    points : (n, axes) array
        Control points at u = 0; those before ``first`` and from ``last`` on are fixed.
    first, last : int
    spacing : float
        Knot spacing [s].
    smooth : float
        lambda_s.
    bounds : SoftBounds
        Of x, of -x and of ``sign`` times the paired coordinates, with x the (3n - 6) * axes stacked
        derivatives.
    paired : (P,) int array
        ``point * axes + axis`` of every {p, v} pair, all of free points.
    sign : (P,) array
    fit : (width + 1, m * axes) array, optional
        Band (lower form) of the fitting term's Hessian; its minimum lies at u = 0.
    constant : float
        Added to the value.
    """

    def __init__(
        self,
        points: Array,
        first: int,
        last: int,
        spacing: float,
        smooth: float,
        bounds: SoftBounds,
        paired: npt.NDArray[np.intp] = _NONE,
        sign: Array = _NOTHING,
        fit: Array | None = None,
        constant: float = 0.0,
    ) -> None:
        n, axes = points.shape
        width = 3 * axes if fit is None else max(3 * axes, len(fit) - 1)
        self.axes, self.size, self.free = axes, (last - first) * axes, slice(first, last)
        made = self._structure = _structure(n, axes, first, last, spacing, smooth, width)
        self._points, self._sign = points, sign
        self._bounds, self._fit, self._constant = bounds, fit, constant
        self._coordinate = paired - first * axes if first else paired  # of every pair, in u
        self._diagonal = self._coordinate * (width + 1)  # and in the band
        self._rows = rows = len(made.smooth)
        self._band = made.band
        if fit is not None:
            self._band = made.band.copy()
            self._band.reshape(self.size, width + 1)[:, : len(fit)] += fit.T
        x = (made.stack @ points).ravel()
        self._derivatives = x
        self._limit = limit = bounds.limit.copy()  # of what is added to the quantities at u = 0
        limit[:rows] -= x
        limit[rows : 2 * rows] += x
        self._matrix = made.dense
        if len(paired):
            limit[2 * rows :] -= points.ravel()[paired] * sign
            if made.dense is not None:
                self._matrix = matrix = np.zeros((len(limit), self.size))
                matrix[: 2 * rows] = made.dense
                matrix[np.arange(2 * rows, len(limit)), self._coordinate] = sign

    def points(self, u: Array) -> Array:
        """Control points (n, axes) at the displacements u."""
        points = self._points.copy()
        points[self.free] += u.reshape(-1, self.axes)
        return points

    def __call__(self, u: Array) -> Point:
        """Value, gradient and curvatures at u."""
        rows = self._rows
        quantities = self._bounded(u)
        penalty, slope, curvature = self._bounds.evaluate(quantities, self._limit)
        x = quantities[:rows] + self._derivatives
        bent = self._structure.smooth * x
        value = self._constant + 0.5 * float(bent.dot(x)) + penalty
        slope[:rows] += bent
        gradient = self._pulled_back(slope)
        if self._fit is not None:
            pull = dsbmv(len(self._fit) - 1, 1.0, self._fit, u, lower=1)
            value += 0.5 * float(pull.dot(u))
            gradient += pull
        return Point(value, gradient, curvature)

    def _bounded(self, u: Array) -> Array:
        """By what u changes everything that is bounded: x, -x, and the paired coordinates."""
        if self._matrix is not None:
            return np.asarray(self._matrix.dot(u))
        x = self._structure.free.dot(u.reshape(-1, self.axes)).ravel()
        return np.concatenate((x, -x, u.take(self._coordinate) * self._sign))

    def _pulled_back(self, slope: Array) -> Array:
        """The transposed map: from slopes of what is bounded to the gradient."""
        if self._matrix is not None:
            return np.asarray(slope.dot(self._matrix))
        rows = self._rows
        bent = slope[:rows] - slope[rows : 2 * rows]
        gradient = self._structure.back.dot(bent.reshape(-1, self.axes)).ravel()
        gradient += np.bincount(self._coordinate, self._sign * slope[2 * rows :], self.size)
        return np.asarray(gradient)

    def closed_form(self) -> Array | None:
        """The u that minimises the quadratic part; the whole cost, where no penalty is active there.

        None where the quadratic part has no unique minimum.
        """
        bent = self._structure.smooth * self._derivatives
        slope = self._structure.back.dot(bent.reshape(-1, self.axes)).ravel()
        factor, failed = dpbtrf(self.quadratic(), lower=1)
        return None if failed else -np.asarray(dpbtrs(factor, slope, lower=1)[0])

    def quadratic(self) -> Array:
        """Band of the Hessian where no penalty is active; see :meth:`hessian`."""
        return self._band.reshape(self.size, -1).T

    def hessian(self, point: Point) -> Array:
        """Band (width + 1, m * axes) of the Hessian at an evaluated point, in lower form."""
        made, rows, band = self._structure, self._rows, self._band
        curvature = point.curvature[:rows] + point.curvature[rows : 2 * rows]
        active = curvature.nonzero()[0]
        if len(active):
            added = made.factor.take(active, axis=0) * curvature.take(active)[:, None]
            band = band + np.bincount(made.where.take(active, axis=0).ravel(), added.ravel(), len(band))
        if len(self._diagonal):
            band = band + np.bincount(self._diagonal, point.curvature[2 * rows :], len(band))
        return band.reshape(self.size, -1).T


@lru_cache(maxsize=128)
def _knots(n: int, degree: int, spacing: float) -> tuple[Array, npt.NDArray[np.intp], Array]:
    """How a knot sees the ``degree`` control points that are alive there.

    Returns the derivatives of their basis functions (p,), for every free point the knots that see it
    (m, p), and the products (p, p of d) of the basis functions of two points d apart.
    """
    p = degree
    values, rates = (basis_matrix([0.0], p + 1, p, spacing, order)[0, :p] for order in (0, 1))
    products = np.zeros((p, p))
    for d in range(p):
        products[: p - d, d] = values[: p - d] * values[d:]
    knots = np.arange(p, n - p)[:, None] - np.arange(p)
    return frozen(rates), knots, frozen(products)


@lru_cache(maxsize=64)
def _straight_band(n: int, degree: int, spacing: float, weight: float) -> Array:
    _, knots, products = _knots(n, degree, spacing)
    return frozen((np.full(n - degree + 1, 2.0 * weight / 25.0)[knots] @ products).T)


def fitting_band(points: Array, degree: int, spacing: float, weight: float, axes: int) -> Array:
    """Band of the Hessian of lambda_f J_f in the free control points, around the deformed curve.

    J_f sums over the knots the displacement from the deformed curve, split along its direction of
    travel (axial, divided by 5) and across it: d_a**2 / 25 + d_r**2 (EGO-Planner, eq. 12-13).

    Parameters
    ----------
    points : (n, 2) array
        Of the deformed curve; the first and the last ``degree`` of them are fixed.

    Returns
    -------
    (degree * axes, m * axes) array
        Lower form, coordinates numbered point by point; entries beyond the matrix are of no meaning.
    """
    p, count = degree, len(points) - degree + 1
    rates, knots, products = _knots(len(points), p, spacing)
    if axes == 1 and not np.count_nonzero(points[:, 1]):
        return _straight_band(len(points), p, spacing, weight)  # no part of the travel is sideways
    velocity = rates[0] * points[:count]
    for q in range(1, p):
        velocity += rates[q] * points[q : q + count]
    v_s, v_l = velocity.T
    square = v_s * v_s + v_l * v_l
    # A standing curve has no direction of its own; the lane's is taken.
    standing = square <= 1e-6
    if standing.any():
        square[standing] = np.inf
    turned = (2.0 * weight * (1.0 - 1.0 / 25.0)) * v_l / square
    across = turned * v_l
    ss = (2.0 * weight / 25.0 + across)[knots] @ products  # (m, p): point, distance of the other one
    if axes == 1:
        return np.asarray(ss.T)
    ll = (2.0 * weight - across)[knots] @ products
    sl = (-turned * v_s)[knots] @ products
    band = np.zeros((len(ss), 2, 2 * p))
    band[:, 0, 0::2], band[:, 0, 1::2] = ss, sl
    band[:, 1, 0::2], band[:, 1, 1:-1:2] = ll, sl[:, 1:]
    return band.reshape(2 * len(ss), -1).T
