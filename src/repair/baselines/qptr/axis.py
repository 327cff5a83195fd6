"""The QP of one axis: what its free vector moves, and the bounds that the limits give."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.baselines.qptr.structure import QpStructure, qp_structure
from repair.problem.limits import Limits

__all__ = ["FAMILIES", "AxisQp", "axis_qp"]

_FIXED = 1e-9  # a row of smaller norm depends on the start alone
_START = 1e-4  # by how much the start's own control points may break a bound (m, m/s, ...)
FAMILIES = ("corridor", "velocity", "acceleration", "jerk", "start", "joints")
_WORDS = ("corridor", "speed limits", "acceleration limits", "jerk limits")


@dataclass(frozen=True)
class AxisQp:
    """All of one axis's QP that depends on neither start, reference nor corridor.

    What is left is its *task*: the start state and the reference at the quadrature nodes, (3 + K,).
    With z (m,) free, the control points are ``points @ task + basis @ z``, and z = 0 is the optimum
    without bounds. The *values* of control points are those of position to jerk, one after the other
    (R,), then the start state and the jumps at the joints.

    Attributes
    ----------
    structure : QpStructure
    points : (N, 3 + K) array
    families : (6,) int array
        Where each of ``FAMILIES`` begins in the values.
    bounds : (2, R') array
        Lower and upper bounds of the values, as far as the limits give them.
    bounded : (B,) int array
        The values that z moves, then those that follow from the start alone.
    free : int
        How many of them z moves.
    rows : (free, m) array
        How z moves them, divided by ``scale`` so as to be of unit norm.
    scale : (B,) array
    at_rest : (B, 3 + K) array
        Map from a task to the bounded values at z = 0, divided by ``scale``.
    judged : (R' + 2 K, N) array
        Map from control points to their values, and to the terms whose squares add up to the objective:
        jerk, deviation. The same for both axes.
    weights : (K,) array
        Of the deviation in these terms.
    """

    structure: QpStructure
    points: Array
    families: npt.NDArray[np.intp]
    bounds: Array
    bounded: npt.NDArray[np.intp]
    free: int
    rows: Array
    scale: Array
    at_rest: Array
    judged: Array
    weights: Array

    def objective(self, terms: Array, task: Array) -> float:
        """Jerk and deviation from the task's reference, of the ``terms`` (2 K,) without it."""
        terms[len(self.weights) :] -= self.weights * task[3:]
        return float(terms @ terms)

    def violations(self, values: Array, bounds: Array) -> Array:
        """Largest violation of each of ``FAMILIES``, negative where a bound is nowhere touched."""
        excess = np.maximum(values - bounds[1], bounds[0] - values)
        return np.asarray(np.maximum.reduceat(excess, self.families))

    def broken(self, left: Array, name: str) -> str:
        """Which bound the start alone breaks, from the room ``left`` (2, B) to the bounds; "" if none."""
        left = left[:, self.free :]
        if not np.count_nonzero(left[0] > _START) and not np.count_nonzero(left[1] < -_START):
            return ""
        excess = np.maximum(left[0], -left[1])
        family = np.searchsorted(self.families, self.bounded[self.free :], side="right") - 1
        worst = [excess[family == k].max(initial=0.0) for k in range(len(_WORDS))]
        return "; ".join(
            f"the start state leads {by:.2g} out of the {what} of {name} before anything can be done"
            for by, what in zip(worst, _WORDS, strict=True)
            if by > _START
        )


@lru_cache(maxsize=64)
def axis_qp(
    axis: int,
    limits: Limits,
    pieces: int,
    duration: float,
    degree: int,
    continuity: int,
    w_jerk: float,
    w_deviation: float,
) -> AxisQp:
    """The QP of an axis, kept for the next one like it.

    Sideways the repair comes to rest, so as to end parallel to the path; along it the end is free.

    Parameters
    ----------
    axis : int
        0 for s, 1 for l.
    limits : Limits
    pieces : int
    duration : float
        Of a piece [s].
    degree, continuity : int
        Of the pieces, and how many derivatives do not jump at the joints.
    w_jerk, w_deviation : float
        Weights of the objective.
    """
    s = qp_structure(pieces, degree, duration, continuity, w_jerk, w_deviation, axis == 1)
    pull = 2.0 * w_deviation * s.at_nodes.T * s.weights
    given = np.hstack([s.lift, np.zeros_like(pull)])  # control points of the task with z = 0 at their origin
    origin = s.basis.T @ (np.hstack([np.zeros_like(s.lift), pull]) - s.hessian @ given)
    points = given + s.basis @ origin

    start = np.vstack([s.derivatives[k][:1] for k in range(3)])
    jumps = s.jumps if len(s.jumps) else np.zeros((1, len(points)))
    blocks = (*s.derivatives, start, jumps)
    values, counts = np.vstack(blocks), [len(block) for block in blocks]
    families = np.cumsum([0, *counts[:-1]])

    norms = [np.linalg.norm(reach, axis=1) for reach in s.reach]
    moved = np.concatenate([norm > _FIXED * norm.max(initial=0.0) for norm in norms])
    bounded, free = np.concatenate([np.flatnonzero(moved), np.flatnonzero(~moved)]), int(moved.sum())
    scale = np.where(moved, np.concatenate(norms), 1.0)[bounded]
    bounds = np.zeros((2, len(values)))
    for k, bound in enumerate(_derivative_bounds(limits, axis), start=1):
        bounds[:, families[k] : families[k + 1]] = np.array(bound)[:, None]
        if k < 3:  # speed and acceleration at the start are the reference's doing, not the repair's
            bounds[:, families[k]] = -np.inf, np.inf
    weights = np.sqrt(w_deviation * s.weights)
    return AxisQp(
        structure=s,
        points=points,
        families=families,
        bounds=bounds,
        bounded=bounded,
        free=free,
        rows=np.vstack(s.reach)[bounded[:free]] / scale[:free, None],
        scale=scale,
        at_rest=values[bounded] @ points / scale[:, None],
        judged=np.vstack(
            [values, np.sqrt(w_jerk * s.weights)[:, None] * s.jerk_at_nodes, weights[:, None] * s.at_nodes]
        ),
        weights=weights,
    )


def _derivative_bounds(limits: Limits, axis: int) -> tuple[tuple[float, float], ...]:
    """Bounds of speed, acceleration and jerk."""
    if axis == 0:
        return (0.0, limits.v_max), (limits.a_min, limits.a_max), (-limits.j_lon, limits.j_lon)
    return (-limits.v_lat, limits.v_lat), (-limits.a_lat, limits.a_lat), (-limits.j_lat, limits.j_lat)
