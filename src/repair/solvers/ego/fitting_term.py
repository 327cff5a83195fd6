"""The fitting term J_f of the refinement (paper, Sec. IV-D), as the band of its Hessian."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.bases import basis_matrix

__all__ = ["fitting_band"]


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
