"""Bases of uniform B-splines as matrices: values, derivatives, Bernstein points.

Source: de Boor, *A Practical Guide to Splines*, 1978; the matrix form is that of Qin, *General matrix
representations for B-splines*, 2000.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, comb, factorial

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.timegrid import ROUNDING

__all__ = [
    "basis_matrix",
    "bernstein_matrix",
    "derivative_matrix",
    "fitted_knots",
    "local_basis",
    "n_points_for",
    "segment_matrix",
    "to_bernstein",
]


@lru_cache(maxsize=16)
def segment_matrix(degree: int) -> Array:
    """Monomial coefficients (p+1, p+1) of the uniform basis on one segment.

    ``[1, u, .., u^p] @ M`` are the values at u in [0, 1] of the p + 1 living basis functions
    (Qin, *General matrix representations for B-splines*, 2000).
    """
    p = degree
    matrix = np.zeros((p + 1, p + 1))
    for i in range(p + 1):
        for j in range(p + 1):
            total = sum((-1) ** (k - j) * comb(p + 1, k - j) * (p - k) ** (p - i) for k in range(j, p + 1))
            matrix[i, j] = comb(p, p - i) * total / factorial(p)
    return frozen(matrix)


@lru_cache(maxsize=16)
def to_bernstein(degree: int) -> Array:
    """Linear map (p+1, p+1) from the monomial coefficients of a polynomial on [0, 1] to its Bernstein points.

    Point i is ``sum_k comb(i, k) / comb(p, k) a_k`` (Farouki, *The Bernstein polynomial basis: a
    centennial retrospective*, 2012).
    """
    p = degree
    return frozen([[comb(i, k) / comb(p, k) if k <= i else 0.0 for k in range(p + 1)] for i in range(p + 1)])


@lru_cache(maxsize=16)
def bernstein_matrix(degree: int) -> Array:
    """Linear map (p+1, p+1) from a segment's B-spline control points to its Bernstein ones.

    Both sets span the same polynomial; the Bernstein hull is the tighter one.
    """
    return frozen(to_bernstein(degree) @ segment_matrix(degree))


@lru_cache(maxsize=64)
def derivative_matrix(n: int, order: int, spacing: float) -> Array:
    """Matrix (n - order, n) that maps control points to those of the derivative (paper, eq. v_a_j)."""
    matrix = np.eye(n)
    for _ in range(order):
        matrix = np.diff(matrix, axis=0) / spacing
    return frozen(matrix)


def n_points_for(duration: float, spacing: float, degree: int) -> int:
    """Number of control points whose span covers ``duration`` (at least one segment)."""
    return max(1, ceil(duration / spacing - 1e-9)) + degree


def fitted_knots(duration: float, spacing: float, degree: int) -> tuple[int, float]:
    """Number of control points, and the knot spacing [s] of at most ``spacing``, whose span is ``duration``.

    What is not a whole number of spacings is cut into shorter ones, all alike, so that no control point acts
    farther beyond the end than those of any spline do.
    """
    segments = n_points_for(duration, spacing, 0)
    if not duration > 0.0 or abs(segments * spacing - duration) <= ROUNDING * segments:
        return segments + degree, spacing
    # Rounded, so that repairs of the same duration share what has been built for it.
    return segments + degree, round(duration / segments, 12)


def basis_matrix(tau: npt.ArrayLike, n: int, degree: int, spacing: float, order: int = 0) -> Array:
    """Values (K, n) of the ``order``-th derivative of every basis function.

    Parameters
    ----------
    tau : (K,) array_like
        Times since ``t_start`` [s]; values outside of the span use the outermost polynomial.
    """
    segment, local = local_basis(tau, n, degree, spacing, order)
    matrix = np.zeros((len(segment), n))
    np.put_along_axis(matrix, segment[:, None] + np.arange(degree + 1), local, axis=1)
    return matrix


def local_basis(
    tau: npt.ArrayLike, n: int, degree: int, spacing: float, order: int
) -> tuple[npt.NDArray[np.intp], Array]:
    """The segment (K,) of each time, and the values (K, p + 1) of the basis functions alive there."""
    where = np.asarray(tau, dtype=np.float64) / spacing
    segment = np.clip(np.floor(where + 1e-9), 0, n - degree - 1).astype(np.intp)
    u = where - segment
    powers = np.zeros((len(u), degree + 1))
    for k in range(order, degree + 1):
        powers[:, k] = factorial(k) / factorial(k - order) * u ** (k - order)
    return segment, powers @ segment_matrix(degree) / spacing**order
