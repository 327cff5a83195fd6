"""Piecewise Bernstein polynomials over time: evaluation, and the linear algebra of their QPs.

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

from repair.bspline import DENSE, KEPT, evaluated, hold_ends
from repair.types import Array, FrenetTrajectory, frozen

__all__ = ["BernsteinCurve", "QpStructure", "bernstein_basis", "qp_structure"]


def bernstein_basis(u: npt.ArrayLike, degree: int) -> Array:
    """Values (K, degree + 1) of the basis polynomials at ``u`` (K,) in [0, 1]."""
    x = np.asarray(u, dtype=np.float64)[:, None]
    k = np.arange(degree + 1)
    binomial = np.array([comb(degree, i) for i in range(degree + 1)], dtype=np.float64)
    return np.asarray(binomial * x**k * (1.0 - x) ** (degree - k))


@dataclass(frozen=True)
class BernsteinCurve:
    """A chain of Bernstein pieces of equal duration; implements :class:`repair.types.Curve`.

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

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate position and three derivatives; beyond the span the end speed is held."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        pieces, width, _ = self.points.shape
        # Probes ask for the same times over and over; the matrices are worth keeping, unless they are huge.
        made = _sampling_at if len(times) <= KEPT else _sampling_at.__wrapped__
        matrix = made(times.tobytes(), float(self.t_start), pieces, width - 1, float(self.duration))
        position, velocity, acceleration, jerk = evaluated(matrix, self.points.reshape(pieces * width, 2))
        return FrenetTrajectory(times, position, velocity, acceleration, jerk)


def _sampling(offsets: bytes, pieces: int, degree: int, duration: float) -> Array:
    """Values (N, 4 K) of position to jerk at the ``offsets`` since the start."""
    tau = np.frombuffer(offsets) / duration
    piece = np.clip(np.floor(tau + 1e-9), 0, pieces - 1).astype(np.intp)
    u = np.clip(tau - piece, 0.0, 1.0)
    rows = np.zeros((4, len(tau), pieces, degree + 1))
    for order in range(4):
        rows[order, np.arange(len(tau)), piece] = bernstein_basis(u, degree - order) @ _derivative(
            1, degree, duration, order
        )
    return frozen(np.ascontiguousarray(rows.reshape(4 * len(tau), -1).T))


@lru_cache(maxsize=64)
def _sampling_at(times: bytes, t_start: float, pieces: int, degree: int, duration: float) -> Any:
    """The matrix for :func:`repair.bspline.evaluated`; sparse where it is large."""
    t_end = t_start + pieces * duration
    matrix = hold_ends(times, t_start, t_end, lambda offsets: _sampling(offsets, pieces, degree, duration))
    if matrix.size <= 4 * DENSE:
        return matrix
    from scipy.sparse import csr_array

    return csr_array(matrix.T)


@dataclass(frozen=True)
class QpStructure:
    """All of a one-axis QP that depends on neither start, corridor nor limits.

    With x (N,) the control points of all pieces one after the other, the start state and the
    smoothness of the joints are met by construction: ``x = lift @ start + basis @ z`` with z free,
    and the Hessian of the objective over z is the identity.

    Attributes
    ----------
    pieces, degree, continuity : int
    duration : float
        Duration of a piece [s].
    times : (N,) array
        Time of every control point since the start [s].
    lift : (N, 3) array
        Control points for a start position, speed and acceleration, with z = 0.
    basis : (N, m) array
        Directions that keep start and joints.
    derivatives : tuple of (R_k, N) arrays
        Control points of position (k = 0) to jerk (k = 3).
    reach : tuple of (R_k, m) arrays
        ``derivatives[k] @ basis``.
    nodes : (K,) array
        Times of the quadrature since the start [s].
    at_nodes : (K, N) array
        Values of the curve at the nodes.
    jerk_at_nodes : (K, N) array
        Jerk of the curve at the nodes.
    weights : (K,) array
        Quadrature weights [s]; exact for the square of a piece.
    hessian : (N, N) array
        Of the objective over x.
    jumps : (J, N) array
        Jump of position and derivatives at the joints.
    follow : (N, 3 + K) array
        Control points with a start state and the least squares fit to values at the nodes.
    """

    pieces: int
    degree: int
    continuity: int
    duration: float
    times: Array
    lift: Array
    basis: Array
    derivatives: tuple[Array, ...]
    reach: tuple[Array, ...]
    nodes: Array
    at_nodes: Array
    jerk_at_nodes: Array
    weights: Array
    hessian: Array
    jumps: Array
    follow: Array


def _derivative(pieces: int, degree: int, duration: float, order: int) -> Array:
    """Block-diagonal map from control points to those of the ``order``-th derivative."""
    scale = factorial(degree) / factorial(degree - order) / duration**order
    return np.asarray(np.kron(np.eye(pieces), scale * np.diff(np.eye(degree + 1), n=order, axis=0)))


def _joints(pieces: int, degree: int, continuity: int) -> Array:
    """Jumps at the joints, ((pieces - 1) (continuity + 1), N); differences stand for derivatives."""
    width = degree + 1
    rows = np.zeros(((pieces - 1) * (continuity + 1), pieces * width))
    for order in range(continuity + 1):
        difference = np.diff(np.eye(width), n=order, axis=0)
        for joint in range(pieces - 1):
            row = rows[joint * (continuity + 1) + order]
            row[joint * width : (joint + 1) * width] = difference[-1]
            row[(joint + 1) * width : (joint + 2) * width] -= difference[0]
    return rows


@dataclass(frozen=True)
class _Unit:
    """What of a :class:`QpStructure` the duration of a piece only scales: all of it for pieces of 1 s.

    ``null`` (N, m) spans the directions that keep start, joints and end; ``jerk_form`` and
    ``deviation_form`` are the quadratic forms of the objective's terms over x.
    """

    lift: Array
    null: Array
    derivatives: tuple[Array, ...]
    nodes: Array
    at_nodes: Array
    jerk_at_nodes: Array
    weights: Array
    jerk_form: Array
    deviation_form: Array
    jumps: Array
    follow: Array


@lru_cache(maxsize=64)
def _unit(pieces: int, degree: int, continuity: int, settles: bool) -> _Unit:
    width = degree + 1
    derivatives = tuple(_derivative(pieces, degree, 1.0, k) for k in range(4))
    start = np.vstack([derivatives[k][:1] for k in range(3)])
    joints = _joints(pieces, degree, continuity)
    end = np.vstack([derivatives[k][-1:] for k in (1, 2)]) if settles else np.empty((0, pieces * width))
    fixed = np.vstack([start, joints, end])
    lift = np.linalg.pinv(fixed)[:, :3]
    null = np.linalg.svd(fixed)[2][np.linalg.matrix_rank(fixed) :].T

    nodes, node_weights = np.polynomial.legendre.leggauss(width)
    u = 0.5 * (nodes + 1.0)
    weights = np.tile(0.5 * node_weights, pieces)
    at_nodes = np.kron(np.eye(pieces), bernstein_basis(u, degree))
    jerk = np.kron(np.eye(pieces), bernstein_basis(u, degree - 3)) @ derivatives[3]
    fit = null @ np.linalg.pinv(at_nodes @ null)
    orders = [factorial(degree) / factorial(degree - k) for k in range(continuity + 1)]
    return _Unit(
        lift,
        null,
        derivatives,
        (np.arange(pieces)[:, None] + u).ravel(),
        at_nodes,
        jerk,
        weights,
        jerk.T @ (weights[:, None] * jerk),
        at_nodes.T @ (weights[:, None] * at_nodes),
        np.tile(orders, pieces - 1)[:, None] * joints,
        np.hstack([lift - fit @ (at_nodes @ lift), fit]),
    )


@lru_cache(maxsize=64)
def qp_structure(
    pieces: int,
    degree: int,
    duration: float,
    continuity: int,
    w_jerk: float,
    w_deviation: float,
    settles: bool = False,
) -> QpStructure:
    """Structure for one axis, objective ``w_jerk * int(jerk**2) + w_deviation * int((x - ref)**2)``.

    With ``settles`` the speed and the acceleration at the end are zero.
    """
    h, unit = duration, _unit(pieces, degree, continuity, settles)
    state = np.array([1.0, h, h**2])  # a speed of 1 is one of h per unit of time
    hessian = 2.0 * (w_jerk / h**5 * unit.jerk_form + w_deviation * h * unit.deviation_form)
    factor = np.linalg.cholesky(unit.null.T @ hessian @ unit.null)
    basis = np.linalg.solve(factor, unit.null.T).T
    derivatives = tuple(d / h**k for k, d in enumerate(unit.derivatives))
    follow = unit.follow.copy()
    follow[:, :3] *= state
    times = np.arange(pieces)[:, None] + np.arange(degree + 1) / degree
    return QpStructure(
        pieces,
        degree,
        continuity,
        duration,
        frozen(h * times.ravel()),
        frozen(unit.lift * state),
        frozen(basis),
        tuple(frozen(d) for d in derivatives),
        tuple(frozen(d @ basis) for d in derivatives),
        frozen(h * unit.nodes),
        frozen(unit.at_nodes),
        frozen(unit.jerk_at_nodes / h**3),
        frozen(h * unit.weights),
        frozen(hessian),
        frozen(unit.jumps / h ** np.tile(np.arange(continuity + 1), pieces - 1)[:, None]),
        frozen(follow),
    )
