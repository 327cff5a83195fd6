"""Uniform B-splines over time: evaluation, derivative control points, splicing, fitting.

The curve of degree p with control points Q_0 .. Q_{n-1} and knot spacing dt is
Phi(t) = sum_i Q_i B_{i,p}(t) (paper, Sec. III-B; de Boor, *A Practical Guide to Splines*, ch. IX).
Its span is [t_start, t_start + (n - p) dt]: there p + 1 basis functions are alive, and the convex
hull property holds. Control point i acts around its Greville time
t_start + (i - (p - 1) / 2) dt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, comb, factorial
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.types import Array, Curve, FrenetTrajectory, frozen

__all__ = [
    "DENSE",
    "KEPT",
    "UniformBSpline",
    "basis_matrix",
    "bernstein_matrix",
    "derivative_matrix",
    "evaluated",
    "fit_to_curve",
    "hold_ends",
    "n_points_for",
    "segment_matrix",
    "splice_points",
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
def bernstein_matrix(degree: int) -> Array:
    """Linear map (p+1, p+1) from a segment's B-spline control points to its Bernstein ones.

    Both sets span the same polynomial; the Bernstein hull is the tighter one.
    """
    p = degree
    to_bernstein = np.array(
        [[comb(i, k) / comb(p, k) if k <= i else 0.0 for k in range(p + 1)] for i in range(p + 1)]
    )
    return frozen(to_bernstein @ segment_matrix(p))


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


def basis_matrix(tau: npt.ArrayLike, n: int, degree: int, spacing: float, order: int = 0) -> Array:
    """Values (K, n) of the ``order``-th derivative of every basis function.

    Parameters
    ----------
    tau : (K,) array_like
        Times since ``t_start`` [s]; values outside of the span use the outermost polynomial.
    """
    segment, local = _local_basis(tau, n, degree, spacing, order)
    matrix = np.zeros((len(segment), n))
    np.put_along_axis(matrix, segment[:, None] + np.arange(degree + 1), local, axis=1)
    return matrix


def _local_basis(
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


KEPT = 2000  #: times up to which the matrix that samples a curve at them is kept: less than 1 MB each
_FITS = 30_000  # entries up to which the map from a spline to its fit is kept: 240 kB each
DENSE = 3000  #: times * points up to which a dense sampling matrix is faster than a sparse one


@lru_cache(maxsize=64)
def _sampling(offsets: bytes, n: int, degree: int, spacing: float) -> Array:
    tau = np.frombuffer(offsets)
    matrix = np.concatenate([basis_matrix(tau, n, degree, spacing, k) for k in range(4)])
    return frozen(np.ascontiguousarray(matrix.T))


def hold_ends(times: bytes, t_start: float, t_end: float, values: Callable[[bytes], Array]) -> Array:
    """Matrix (n, 4 K) from control points to position and three derivatives at ``times``.

    Beyond the span the end speed is held, which is linear in the control points as well.

    Parameters
    ----------
    times : bytes
        Of a (K,) array [s].
    t_start, t_end : float
        The curve's span [s].
    values : callable
        The matrix for times (bytes) within the span, counted from its start.
    """
    since = np.frombuffer(times) - t_start
    tau = np.clip(since, 0.0, t_end - t_start)
    # The same offsets come back for other start times, up to rounding.
    matrix = values(np.round(tau, 12).tobytes())
    beyond = since - tau
    out = np.flatnonzero(np.abs(beyond) > 1e-9)
    if not len(out):
        return matrix
    held = matrix.reshape(len(matrix), 4, len(tau)).copy()
    held[:, 0, out] += beyond[out] * held[:, 1, out]
    held[:, 2:, out] = 0.0
    return frozen(held.reshape(matrix.shape))


@lru_cache(maxsize=64)
def _sampling_at(times: bytes, t_start: float, n: int, degree: int, spacing: float) -> Any:
    """The matrix for :func:`evaluated`; sparse where it is large: any time sees p + 1 control points only."""
    t_end = t_start + (n - degree) * spacing
    if len(times) // 8 * n <= DENSE:
        return hold_ends(times, t_start, t_end, lambda offsets: _sampling(offsets, n, degree, spacing))
    from scipy.sparse import csr_array

    segments: list[npt.NDArray[np.intp]] = []

    def alive(offsets: bytes) -> Array:
        parts = [_local_basis(np.frombuffer(offsets), n, degree, spacing, k) for k in range(4)]
        segments.append(parts[0][0])
        return np.concatenate([local for _, local in parts]).T

    weights = hold_ends(times, t_start, t_end, alive).T
    columns = np.tile(segments[0][:, None] + np.arange(degree + 1), (4, 1))
    rows = np.arange(0, weights.size + 1, degree + 1)
    return csr_array((weights.ravel(), columns.ravel(), rows), shape=(len(weights), n))


def evaluated(matrix: Any, points: Array) -> Array:
    """Position and three derivatives (4, K, d) of control points (n, d).

    Parameters
    ----------
    matrix : (n, 4 K) array or (4 K, n) sparse array
    """
    if isinstance(matrix, np.ndarray):  # by columns: two long products, and s and l lie in one piece each
        return np.asarray((points.T @ matrix).reshape(points.shape[1], 4, -1).transpose(1, 2, 0))
    return np.asarray((matrix @ points).reshape(4, -1, points.shape[1]))


@lru_cache(maxsize=64)
def _greville(n: int, degree: int, spacing: float) -> Array:
    return frozen((np.arange(n) - (degree - 1) / 2) * spacing)


@dataclass(frozen=True)
class UniformBSpline:
    """A uniform B-spline trajectory in the Frenet frame; implements :class:`repair.types.Curve`.

    Attributes
    ----------
    t_start : float
        Start of the span [s].
    spacing : float
        Knot spacing [s].
    degree : int
    points : (n, 2) array
        Control points ``[s, l]`` [m], n > degree.
    """

    t_start: float
    spacing: float
    degree: int
    points: Array

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return self.t_start + (len(self.points) - self.degree) * self.spacing

    @property
    def greville(self) -> Array:
        """Time (n,) at which each control point acts [s]."""
        return self.t_start + _greville(len(self.points), self.degree, self.spacing)

    def derivative_points(self, order: int) -> Array:
        """Control points (n - order, 2) of the derivative curve; their hull bounds it."""
        return np.diff(self.points, n=order, axis=0) / self.spacing**order

    def segments(self) -> Array:
        """Control points of each segment, (n - p, p + 1, 2)."""
        windows = np.lib.stride_tricks.sliding_window_view(self.points, self.degree + 1, axis=0)
        return np.asarray(np.swapaxes(windows, 1, 2))

    def bernstein_segments(self) -> Array:
        """Bernstein control points of each segment, (n - p, p + 1, 2)."""
        return np.asarray(np.einsum("ij,kjd->kid", bernstein_matrix(self.degree), self.segments()))

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate position and three derivatives; beyond the span the end speed is held."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        # Probes ask for the same times over and over; the matrices are worth keeping, unless they are huge.
        made = _sampling_at if len(times) <= KEPT else _sampling_at.__wrapped__
        matrix = made(
            times.tobytes(), float(self.t_start), len(self.points), self.degree, float(self.spacing)
        )
        position, velocity, acceleration, jerk = evaluated(matrix, self.points)
        return FrenetTrajectory(times, position, velocity, acceleration, jerk)


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
    matrix = _sampling_at((since + tau).tobytes(), 0.0, points, degree, spacing)
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
