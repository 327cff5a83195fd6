"""Piecewise Bernstein polynomials over time.

A piece of degree n and duration h has control points Q_0 .. Q_n at the times k h / n of the piece
(its Greville abscissae). The piece lies in their hull, a linear function of time has its own values
as control points, and the k-th derivative has the control points n! / (n - k)! Delta^k Q / h^k
(Farouki, *The Bernstein polynomial basis: a centennial retrospective*, 2012).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb, factorial
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.base import FrenetTrajectory, joined
from repair.curves.hulls import speed_hulls
from repair.curves.sampling import DENSE, KEPT, evaluated, hold_ends

_LARGEST = 1_000_000  # times * points up to which a curve is sampled at once

__all__ = ["BernsteinCurve", "bernstein_basis", "derivative_map", "sampling_at"]


def bernstein_basis(u: npt.ArrayLike, degree: int) -> Array:
    """Values (K, degree + 1) of the basis polynomials at ``u`` (K,) in [0, 1]."""
    x = np.asarray(u, dtype=np.float64)[:, None]
    k = np.arange(degree + 1)
    binomial = np.array([comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    return np.asarray(binomial * x**k * (1.0 - x) ** (degree - k))


@dataclass(frozen=True)
class BernsteinCurve:
    """A chain of Bernstein pieces of equal duration; implements :class:`repair.curves.base.Curve`.

    Attributes
    ----------
    t_start : float
        Start of the first piece [s].
    duration : float
        Duration of each piece [s].
    points : (M, n + 1, 2) array
        Control points ``[s, l]`` [m] of the M pieces.
    """

    t_start: float
    duration: float
    points: Array

    @classmethod
    def hermite(
        cls, t_start: float, duration: float, position: npt.ArrayLike, velocity: npt.ArrayLike
    ) -> BernsteinCurve:
        """Cubic pieces with the given ends: constant acceleration where position and velocity agree on one.

        Parameters
        ----------
        position, velocity : (M + 1, 2) array_like
            ``[s, l]`` [m] and its rate [m/s] where the M pieces begin and end.
        """
        at, rate = np.asarray(position, dtype=np.float64), np.asarray(velocity, dtype=np.float64)
        arm = rate * (duration / 3.0)
        ends = [at[:-1], at[:-1] + arm[:-1], at[1:] - arm[1:], at[1:]]
        return cls(t_start, duration, frozen(np.stack(ends, axis=1)))

    @property
    def degree(self) -> int:
        """Degree n of the pieces."""
        return int(self.points.shape[1]) - 1

    @property
    def t_end(self) -> float:
        """End of the last piece [s]."""
        return self.t_start + len(self.points) * self.duration

    def derivative_points(self, order: int) -> Array:
        """Control points (M, n + 1 - order, 2) of a derivative; their hull bounds it."""
        scale = factorial(self.degree) / factorial(self.degree - order) / self.duration**order
        return np.asarray(scale * np.diff(self.points, n=order, axis=1))

    def speed_hulls(self, cuts: int = 1) -> tuple[Array, Array, Array]:
        """Bounds of s' over parts of the curve (see :class:`repair.curves.base.Hulled`)."""
        return speed_hulls(self.points[..., 0], self.t_start, self.duration, cuts)

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate position and three derivatives; beyond the span the end speed is held."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        pieces, width, _ = self.points.shape
        if len(times) * pieces * width > _LARGEST and len(times) > 1:  # long chains at many times: in parts
            half = len(times) // 2
            return joined(self.sample(times[:half]), self.sample(times[half:]))
        # Probes ask for the same times over and over; the matrices are worth keeping, unless they are huge.
        made = sampling_at if len(times) <= KEPT else sampling_at.__wrapped__
        matrix = made(times.tobytes(), float(self.t_start), pieces, width - 1, float(self.duration))
        position, velocity, acceleration, jerk = evaluated(matrix, self.points.reshape(pieces * width, 2))
        return FrenetTrajectory(times, position, velocity, acceleration, jerk)


def _local_sampling(
    offsets: bytes, pieces: int, degree: int, duration: float
) -> tuple[npt.NDArray[np.intp], Array]:
    """The piece (K,) at each of the ``offsets`` since the start, and position to jerk (4, K, n + 1) there."""
    tau = np.frombuffer(offsets) / duration
    piece = np.clip(np.floor(tau + 1e-9), 0, pieces - 1).astype(np.intp)
    u = np.clip(tau - piece, 0.0, 1.0)
    orders = [bernstein_basis(u, degree - k) @ derivative_map(1, degree, duration, k) for k in range(4)]
    return piece, np.asarray(orders)


def _sampling(offsets: bytes, pieces: int, degree: int, duration: float) -> Array:
    """Values (N, 4 K) of position to jerk at the ``offsets`` since the start."""
    piece, local = _local_sampling(offsets, pieces, degree, duration)
    rows = np.zeros((4, len(piece), pieces, degree + 1))
    rows[:, np.arange(len(piece)), piece] = local
    return frozen(np.ascontiguousarray(rows.reshape(4 * len(piece), -1).T))


@lru_cache(maxsize=64)
def sampling_at(
    times: bytes, t_start: float, pieces: int, degree: int, duration: float, *, dense: int = DENSE
) -> Any:
    """The matrix of a chain's samples for :func:`repair.curves.sampling.evaluated`; sparse where it is large.

    Parameters
    ----------
    times : bytes
        Of a (K,) array [s].
    t_start : float
        Start of the first piece [s].
    pieces, degree : int
    duration : float
        Of each piece [s].
    dense : int
        Times * points up to which the matrix is a dense one.
    """
    t_end = t_start + pieces * duration
    width = degree + 1
    if len(times) // 8 * pieces * width <= dense:
        return hold_ends(times, t_start, t_end, lambda offsets: _sampling(offsets, pieces, degree, duration))
    from scipy.sparse import csr_array

    found: list[npt.NDArray[np.intp]] = []

    def alive(offsets: bytes) -> Array:
        piece, local = _local_sampling(offsets, pieces, degree, duration)
        found.append(piece)
        return local.reshape(-1, width).T

    weights = hold_ends(times, t_start, t_end, alive).T
    columns = np.tile(width * found[0][:, None] + np.arange(width), (4, 1))
    rows = np.arange(0, weights.size + 1, width)
    return csr_array((weights.ravel(), columns.ravel(), rows), shape=(len(weights), pieces * width))


def derivative_map(pieces: int, degree: int, duration: float, order: int) -> Array:
    """Block-diagonal map from control points to those of the ``order``-th derivative."""
    scale = factorial(degree) / factorial(degree - order) / duration**order
    return np.asarray(np.kron(np.eye(pieces), scale * np.diff(np.eye(degree + 1), n=order, axis=0)))
