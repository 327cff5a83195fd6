"""Uniform B-splines over time: evaluation, control points of derivatives, Bernstein points.

The curve of degree p with control points Q_0 .. Q_{n-1} and knot spacing dt is
Phi(t) = sum_i Q_i B_{i,p}(t) (paper, Sec. III-B; de Boor, *A Practical Guide to Splines*, ch. IX).
Its span is [t_start, t_start + (n - p) dt]: there p + 1 basis functions are alive, and the convex
hull property holds. Control point i acts around its Greville time
t_start + (i - (p - 1) / 2) dt.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, largest, smallest
from repair.curves.base import FrenetTrajectory
from repair.curves.bases import basis_matrix, bernstein_matrix, local_basis
from repair.curves.hulls import speed_hulls
from repair.curves.sampling import DENSE, KEPT, evaluated, hold_ends

__all__ = ["UniformBSpline", "greville_offsets", "sampling_at"]


@lru_cache(maxsize=64)
def _sampling(offsets: bytes, n: int, degree: int, spacing: float) -> Array:
    tau = np.frombuffer(offsets)
    matrix = np.concatenate([basis_matrix(tau, n, degree, spacing, k) for k in range(4)])
    return frozen(np.ascontiguousarray(matrix.T))


class _Alive(NamedTuple):
    """Weights (p + 1, 4 K) of samples, the control points (4 K (p + 1),) they are of, and both in one."""

    weights: Array
    columns: npt.NDArray[np.intp]
    matrix: Any


@lru_cache(maxsize=64)
def _alive(offsets: bytes, n: int, degree: int, spacing: float) -> _Alive:
    """As :func:`_sampling`, for many samples."""
    parts = [local_basis(np.frombuffer(offsets), n, degree, spacing, k) for k in range(4)]
    weights = frozen(np.concatenate([local for _, local in parts])).T
    columns = np.tile(parts[0][0][:, None] + np.arange(degree + 1), (4, 1)).ravel()
    return _Alive(weights, columns, _sparse(weights, columns, n))


def _sparse(weights: Array, columns: npt.NDArray[np.intp], n: int) -> Any:
    from scipy.sparse import csr_array

    width, count = weights.shape
    rows = np.arange(0, weights.size + 1, width)
    return csr_array((weights.T.ravel(), columns, rows), shape=(count, n))


def sampling_at(
    times: bytes, t_start: float, n: int, degree: int, spacing: float, *, dense: int = DENSE
) -> Any:
    """The matrix of a spline's samples for :func:`repair.curves.sampling.evaluated`.

    Searches, and a planner's cycles, ask for the same times over and over: it is kept, unless it is huge.

    It is sparse where it is large: any time sees p + 1 control points only.

    Parameters
    ----------
    times : bytes
        Of a (K,) array [s].
    t_start : float
        Start of the span [s].
    n, degree : int
    spacing : float
        Knot spacing [s].
    dense : int
        Times * points up to which the matrix is a dense one.
    """
    count = len(times) // 8
    if count * n <= dense:
        return _dense_at(times, t_start, n, degree, spacing)
    made = _sparse_at if count <= KEPT else _sparse_at.__wrapped__
    return made(times, t_start, n, degree, spacing)


# A planner's cycle asks for some twenty, mostly others than the one before; each takes 100 kB at most.
@lru_cache(maxsize=160)
def _dense_at(times: bytes, t_start: float, n: int, degree: int, spacing: float) -> Array:
    t_end = t_start + (n - degree) * spacing
    return hold_ends(times, t_start, t_end, lambda offsets: _sampling(offsets, n, degree, spacing))


@lru_cache(maxsize=64)
def _sparse_at(times: bytes, t_start: float, n: int, degree: int, spacing: float) -> Any:
    t_end = t_start + (n - degree) * spacing
    found: list[_Alive] = []

    def alive(offsets: bytes) -> Array:
        found.append(_alive(offsets, n, degree, spacing))
        return found[0].weights

    weights, known = hold_ends(times, t_start, t_end, alive), found[0]
    return known.matrix if weights is known.weights else _sparse(weights, known.columns, n)


@lru_cache(maxsize=64)
def _segment_places(n: int, degree: int) -> npt.NDArray[np.intp]:
    """Which control points (n - p, p + 1) each segment has."""
    places = np.arange(n - degree)[:, None] + np.arange(degree + 1)
    places.setflags(write=False)
    return places


@lru_cache(maxsize=64)
def greville_offsets(n: int, degree: int, spacing: float) -> Array:
    """Time (n,) since the start of the span at which each control point acts [s]."""
    return frozen((np.arange(n) - (degree - 1) / 2) * spacing)


@dataclass(frozen=True)
class UniformBSpline:
    """A uniform B-spline trajectory in the Frenet frame; implements :class:`repair.curves.base.Curve`.

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
        return self.t_start + greville_offsets(len(self.points), self.degree, self.spacing)

    def derivative_points(self, order: int) -> Array:
        """Control points (n - order, 2) of the derivative of that ``order`` [m/s^order]; a hull of it."""
        return np.diff(self.points, n=order, axis=0) / self.spacing**order

    def segments(self) -> Array:
        """Control points of each segment, (n - p, p + 1, 2) [m]."""
        windows = np.lib.stride_tricks.sliding_window_view(self.points, self.degree + 1, axis=0)
        return np.asarray(np.swapaxes(windows, 1, 2))

    def bernstein_segments(self) -> Array:
        """Bernstein control points of each segment, (n - p, p + 1, 2) [m]."""
        return np.asarray(np.einsum("ij,kjd->kid", bernstein_matrix(self.degree), self.segments()))

    def speed_hulls(self, cuts: int = 1) -> tuple[Array, Array, Array]:
        """Bounds of s' over ``cuts`` parts of each segment (see :class:`repair.curves.base.Hulled`)."""
        windows = self.points[:, 0].take(_segment_places(len(self.points), self.degree))
        points = windows @ bernstein_matrix(self.degree).T
        return speed_hulls(points, self.t_start, self.spacing, cuts)

    def speed_bounds(self) -> tuple[float, float]:
        """Bounds of s' over all of the curve, by the control points of the derivative alone [m/s]."""
        ways = self.points[1:, 0] - self.points[:-1, 0]
        return smallest(ways) / self.spacing, largest(ways) / self.spacing

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Position and three derivatives at the times ``t`` [s]; beyond the span the end speed is held."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        matrix = sampling_at(
            times.tobytes(), float(self.t_start), len(self.points), self.degree, float(self.spacing)
        )
        position, velocity, acceleration, jerk = evaluated(matrix, self.points)
        return FrenetTrajectory(times, position, velocity, acceleration, jerk)
