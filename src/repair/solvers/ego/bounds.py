"""The soft bounds of both stages: limits of the derivatives, bends, pairs."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from repair.arrays import Array, frozen, largest, smallest
from repair.problem.limits import Limits
from repair.problem.problem import RepairProblem
from repair.solvers.ego.pairs import Pairs
from repair.solvers.ego.penalties import SoftBounds, feasibility_bounds

__all__ = ["bend_speed", "feasibility", "slowest_bend", "with_pairs"]
_STRAIGHT = np.array(1e-9)  # curvature [1/m]


@lru_cache(maxsize=128)
def feasibility(
    n: int, limits: Limits, config: tuple[float, ...], scale: float, axes: tuple[int, ...]
) -> SoftBounds:
    """Bounds of the stacked derivatives on some axes, and of their negatives; lambda_d is in the weights."""
    chosen = slice(axes[0], axes[-1] + 1)
    return SoftBounds(
        *(frozen(both[..., chosen].reshape(-1)) for both in _both_axes(n, limits, config, scale))
    )


@lru_cache(maxsize=16)
def _both_axes(n: int, limits: Limits, config: tuple[float, ...], scale: float) -> tuple[Array, ...]:
    """The columns of :func:`feasibility`, (2, 3n - 6, 2): upper and lower, by axis."""
    w_v, w_a, w_j, elastic, joint, reverse = config
    maxima = np.array(
        [[limits.v_max, limits.v_lat], [limits.a_max, limits.a_lat], [limits.j_lon, limits.j_lat]]
    )
    minima = np.array([[0.0, -limits.v_lat], [limits.a_min, -limits.a_lat], [-limits.j_lon, -limits.j_lat]])
    weights = (scale * w_v, scale * w_a, scale * w_j)
    sides = feasibility_bounds(n, maxima, minima, weights, elastic, joint, reverse)
    return tuple(np.array(both) for both in zip(*sides, strict=True))


def with_pairs(bounds: SoftBounds, pairs: Pairs, collision: float) -> SoftBounds:
    """The bounds, and for each pair that of -Q . v: from d = s_f on the penalty j_c starts."""
    weight = np.empty(len(pairs.row))
    weight.fill(6.0 * collision)
    return SoftBounds(
        np.concatenate((bounds.limit, -pairs.sign * pairs.anchor - pairs.threshold)),
        np.concatenate((bounds.joint, pairs.threshold)),
        np.concatenate((bounds.sixfold, weight)),
        np.concatenate((bounds.bend, weight * pairs.threshold)),
    )


def slowest_bend(problem: RepairProblem) -> float:
    """What :func:`bend_speed` is at least, wherever the control points are."""
    sharpest = max(largest(problem.curvature), -smallest(problem.curvature), _STRAIGHT.item())
    return math.sqrt(0.8 * problem.limits.a_lat / sharpest)


def bend_speed(problem: RepairProblem, points: Array) -> Array:
    """Speed (n - 1,) at which the bends along the control points use 0.8 of the lateral limit."""
    bend = np.abs(problem.curvature_at(points[:, 0]))
    return np.asarray(
        np.sqrt(0.8 * problem.limits.a_lat / np.maximum(np.maximum(bend[1:], bend[:-1]), _STRAIGHT))
    )
