"""B-splines that begin in a given state, and that come near to other curves.

Source: de Boor, *A Practical Guide to Splines*, 1978, for least squares by splines.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.base import Curve
from repair.curves.bases import basis_matrix, derivative_matrix
from repair.curves.bspline import UniformBSpline, sampling_at
from repair.curves.sampling import evaluated

__all__ = ["fit_to_curve", "splice_points"]
_FITS = 30_000  # entries up to which the map from a spline to its fit is kept: 240 kB each


@lru_cache(maxsize=64)
def _start_inverse(degree: int, spacing: float) -> Array:
    rows = [basis_matrix([0.0], degree + 1, degree, spacing, k)[0, :degree] for k in range(degree)]
    return frozen(np.linalg.inv(np.array(rows)))


def splice_points(derivatives: npt.ArrayLike, degree: int, spacing: float) -> Array:
    """First ``degree`` control points (p, 2) that give the curve these derivatives at its start.

    Parameters
    ----------
    derivatives : (p, 2) array_like
        Position, velocity, acceleration, ... at ``t_start``. At a knot only p control points are
        alive, so the first p of them are the start state, no more and no less.
    """
    return _start_inverse(degree, spacing) @ np.asarray(derivatives, dtype=np.float64)


@lru_cache(maxsize=64)
def _fit_operator(n: int, degree: int, spacing: float, per_segment: int) -> tuple[Array, Array, Array]:
    """Times (K,) to look at, and the maps (n, K) and (n, p) from positions there and from the start state."""
    tau = np.linspace(0.0, (n - degree) * spacing, (n - degree) * per_segment + 1)
    basis = basis_matrix(tau, n, degree, spacing)
    # A whisper of smoothing keeps the last, hardly observed control points on the polynomial.
    ridge = 1e-6 * derivative_matrix(n, degree, 1.0)
    stacked = np.vstack([basis, ridge])
    free = np.linalg.pinv(stacked[:, degree:])
    head = _start_inverse(degree, spacing)
    begin = np.vstack([head, -free @ stacked[:, :degree] @ head])
    fitted = np.vstack([np.zeros((degree, len(tau))), free[:, : len(tau)]])
    return frozen(tau), frozen(fitted), frozen(begin)


@lru_cache(maxsize=64)
def _refit_operator(
    since: float, points: int, degree: int, spacing: float, n: int, new_degree: int, new_spacing: float
) -> Array:
    """Map (n, points) from a spline's control points to those of its fit from ``since`` its start on."""
    tau, fitted, begin = _fit_operator(n, new_degree, new_spacing, 4)
    matrix = sampling_at((since + tau).tobytes(), 0.0, points, degree, spacing)
    samples = evaluated(matrix, np.eye(points))
    state = np.zeros((max(new_degree, 4), points))
    state[:4] = samples[:, 0]
    return frozen(fitted @ samples[0] + begin @ state[:new_degree])


def fit_to_curve(curve: Curve, t_start: float, n: int, degree: int, spacing: float) -> UniformBSpline:
    """Least-squares spline through ``curve`` from ``t_start`` on, with its exact state there.

    Position, velocity and acceleration at ``t_start`` are reproduced exactly (and the jerk for
    degree 4 and up); the remaining control points fit the positions.
    """
    if isinstance(curve, UniformBSpline):
        # Linear in the curve's control points, and searches ask for the same times over and over.
        since, given = round(t_start - curve.t_start, 12), len(curve.points)
        made = _refit_operator if n * given <= _FITS else _refit_operator.__wrapped__
        fit = made(since, given, curve.degree, curve.spacing, n, degree, spacing)
        points = fit @ curve.points
    else:
        tau, fitted, begin = _fit_operator(n, degree, spacing, 4)
        samples = curve.sample(t_start + tau)
        state = np.zeros((max(degree, 4), 2))
        for row, column in enumerate(
            (samples.position, samples.velocity, samples.acceleration, samples.jerk)
        ):
            state[row] = column[0]
        points = fitted @ samples.position
        points += begin @ state[:degree]
    points.setflags(write=False)
    return UniformBSpline(t_start, spacing, degree, points)
