"""The cost of both soft stages over the free control points, with gradient and banded Hessian.

J = lambda_s J_s + the penalties of the derivatives' control points and of the {p, v} pairs
+ lambda_f J_f (paper, Sec. IV-C and IV-D). It is convex and twice continuously differentiable, and
every term couples neighbouring control points only, so that the Hessian is a band.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg.blas import dsbmv
from scipy.linalg.lapack import dpbtrf, dpbtrs

from repair.arrays import Array
from repair.solvers.ego.cost_structure import SIZES, Sizes, cost_structure
from repair.solvers.ego.penalties import SoftBounds

__all__ = ["Point", "SplineCost", "resting_cost"]

_NONE, _NOTHING = np.empty(0, dtype=np.intp), np.empty(0)


class Point(NamedTuple):
    """The cost at one place: value, gradient, and the penalties' curvatures."""

    value: float
    gradient: Array
    curvature: Array


def resting_cost(
    points: Array, spacing: float, smooth: float, bounds: SoftBounds, sizes: Sizes = SIZES
) -> float:
    """The value of a :class:`SplineCost` without pairs at u = 0, where all of its points are free.

    Parameters
    ----------
    points : (n, axes) array
    spacing, smooth, bounds, sizes
        As there.
    """
    n, axes = points.shape
    made = cost_structure(n, axes, 0, n, spacing, smooth, 3 * axes, sizes)
    x = (made.stack @ points).ravel()
    bent = made.smooth * x
    return 0.5 * float(bent.dot(x)) + bounds.evaluate(np.concatenate((x, -x)))[0]


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
    sizes : Sizes
        Which forms are used for which size.

    Attributes
    ----------
    axes, size : int
        Number of axes, and of free coordinates.
    free : slice
        Of the control points.
    structure : CostStructure
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
        sizes: Sizes = SIZES,
    ) -> None:
        n, axes = points.shape
        width = 3 * axes if fit is None else max(3 * axes, len(fit) - 1)
        self.axes, self.size, self.free = axes, (last - first) * axes, slice(first, last)
        made = self.structure = cost_structure(n, axes, first, last, spacing, smooth, width, sizes)
        self._paired, self._sign, self._fit, self._constant = paired, sign, fit, constant
        self._coordinate = paired - first * axes if first else paired  # of every pair, in u
        self._diagonal = self._coordinate * (width + 1)  # and in the band
        self._rows = rows = len(made.smooth)
        self._band = made.band
        if fit is not None:
            self._band = made.band.copy()
            self._band.reshape(self.size, width + 1)[:, : len(fit)] += fit.T
        self._start_at(points, bounds)
        self._matrix = made.dense
        if len(paired) and made.dense is not None:
            count = 2 * rows + len(paired)
            self._matrix = matrix = np.zeros((count, self.size))
            matrix[: 2 * rows] = made.dense
            matrix[np.arange(2 * rows, count), self._coordinate] = sign

    def again(self, points: Array, bounds: SoftBounds) -> SplineCost:
        """The same with other control points at u = 0, and weights and limits of the derivatives."""
        other = SplineCost.__new__(SplineCost)
        other.__dict__.update(self.__dict__)  # as copy() does, which takes ten times as long
        other._start_at(points, bounds)
        return other

    def _start_at(self, points: Array, bounds: SoftBounds) -> None:
        rows = self._rows
        self._points, self._bounds = points, bounds
        self._derivatives = x = (self.structure.stack @ points).ravel()
        self._limit = limit = bounds.limit.copy()  # of what is added to the quantities at u = 0
        limit[:rows] -= x
        limit[rows : 2 * rows] += x
        if len(self._paired):
            limit[2 * rows :] -= points.ravel()[self._paired] * self._sign

    def points(self, u: Array) -> Array:
        """Control points (n, axes) at the displacements u."""
        points = self._points.copy()
        points[self.free] += u.reshape(-1, self.axes)
        return points

    def __call__(self, u: Array) -> Point:
        """Value, gradient and curvatures at u."""
        rows, matrix = self._rows, self._matrix
        quantities = self._bounded(u) if matrix is None else matrix.dot(u)
        penalty, slope, curvature = self._bounds.evaluate(quantities, self._limit)
        x = quantities[:rows] + self._derivatives
        bent = self.structure.smooth * x
        value = self._constant + 0.5 * float(bent.dot(x)) + penalty
        slope[:rows] += bent
        gradient = self._pulled_back(slope) if matrix is None else slope.dot(matrix)
        if self._fit is not None:
            pull = dsbmv(len(self._fit) - 1, 1.0, self._fit, u, lower=1)
            value += 0.5 * float(pull.dot(u))
            gradient += pull
        return Point(value, gradient, curvature)

    def _bounded(self, u: Array) -> Array:
        """By what u changes everything that is bounded: x, -x, and the paired coordinates."""
        x = self.structure.free.dot(u.reshape(-1, self.axes)).ravel()
        return np.concatenate((x, -x, u.take(self._coordinate) * self._sign))

    def _pulled_back(self, slope: Array) -> Array:
        """The transposed map: from slopes of what is bounded to the gradient."""
        rows = self._rows
        bent = slope[:rows] - slope[rows : 2 * rows]
        gradient = self.structure.back.dot(bent.reshape(-1, self.axes)).ravel()
        gradient += np.bincount(self._coordinate, self._sign * slope[2 * rows :], self.size)
        return np.asarray(gradient)

    def closed_form(self) -> Array | None:
        """The u that minimises the quadratic part; the whole cost, where no penalty is active there.

        None where the quadratic part has no unique minimum.
        """
        bent = self.structure.smooth * self._derivatives
        slope = self.structure.back.dot(bent.reshape(-1, self.axes)).ravel()
        factor, failed = dpbtrf(self.quadratic(), lower=1)
        return None if failed else -np.asarray(dpbtrs(factor, slope, lower=1)[0])

    def quadratic(self) -> Array:
        """Band of the Hessian where no penalty is active; see :meth:`hessian`."""
        return self._band.reshape(self.size, -1).T

    def hessian(self, point: Point) -> Array:
        """Band (width + 1, m * axes) of the Hessian at an evaluated point, in lower form."""
        made, rows, band = self.structure, self._rows, self._band
        curvature = point.curvature[:rows] + point.curvature[rows : 2 * rows]
        if made.bands is not None:
            band = curvature.dot(made.bands) + band
        elif len(active := curvature.nonzero()[0]):
            added = made.factor.take(active, axis=0) * curvature.take(active)[:, None]
            band = band + np.bincount(made.where.take(active, axis=0).ravel(), added.ravel(), len(band))
        if len(self._diagonal):
            band = band + np.bincount(self._diagonal, point.curvature[2 * rows :], len(band))
        return band.reshape(self.size, -1).T
