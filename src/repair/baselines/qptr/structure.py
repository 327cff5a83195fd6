"""The linear algebra of one axis' QP over Bernstein pieces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.bernstein import bernstein_basis, derivative_map

__all__ = ["QpStructure", "qp_structure"]


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
    derivatives = tuple(derivative_map(pieces, degree, 1.0, k) for k in range(4))
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

    Parameters
    ----------
    pieces, degree : int
    duration : float
        Of a piece [s].
    continuity : int
        How many derivatives do not jump at the joints.
    w_jerk, w_deviation : float
    settles : bool
        Speed and acceleration at the end are zero.
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
