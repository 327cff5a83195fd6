"""What a QP answer violates and how far it is from optimal, recomputed from the problem."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from repair.arrays import Array

__all__ = ["RawAnswer", "combined", "duality_gap", "violation_of"]


class RawAnswer(NamedTuple):
    """What a solver says: point, multipliers (positive at an upper bound), and its own status word."""

    z: Array | None
    multipliers: Array | None
    word: str


def violation_of(rows: Array, lower: Array, upper: Array, z: Array) -> float:
    """Largest violation of a bound; NaN stays NaN."""
    value = rows @ z
    return float(np.maximum.reduce(np.concatenate((value - upper, lower - value)), initial=0.0))


def combined(rows: Array, lower: Array, upper: Array, y: Array) -> tuple[Array, float]:
    """``rows.T @ y`` and the largest value that the bounds allow for ``y @ (rows @ z)``."""
    used = y.nonzero()[0]
    y = y.take(used)
    allowed = np.where(y > 0.0, upper.take(used), lower.take(used))
    return y @ rows.take(used, axis=0), float(y @ allowed)


def duality_gap(rows: Array, lower: Array, upper: Array, raw: RawAnswer) -> float:
    """Duality gap of a point and its multipliers, relative to ``1 + |z|^2 / 2``."""
    if raw.z is None or raw.multipliers is None:
        return np.inf
    gradient, allowed = combined(rows, lower, upper, raw.multipliers)
    primal = 0.5 * float(raw.z @ raw.z)
    return abs(primal + 0.5 * float(gradient @ gradient) + allowed) / (1.0 + primal)
