"""The paper's penalty functions (Sec. IV-C, IV-D), vectorised, each with its exact gradient.

Both one-sided penalties of the paper, the collision penalty j_c and the feasibility penalty f, are
one and the same function of an excess e >= 0: the cubic e**3 up to a joint D, continued beyond it
by the parabola 3 D e**2 - 3 D**2 e + D**3 that meets it with equal value, slope and curvature. For
j_c the excess is c = s_f - d and D = s_f; for f it is |c_r| - lambda c_m and D = c_j - lambda c_m,
which fixes the paper's a_1 .. c_2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repair.types import Array

# Reversing is penalised as 3 D e**2 from this speed [m/s] on: early enough to act as a quadratic.
REVERSE_JOINT = 0.01

__all__ = ["Feasibility", "cubic_quadratic", "feasibility_bounds"]


def cubic_quadratic(excess: Array, joint: Array | float) -> tuple[Array, Array]:
    """Penalty and slope of an excess (any shape); zero for ``excess <= 0``.

    Written around the joint without a branch: t = min(e, D) gives
    t**3 + 3 D**2 (e - t) + 3 D (e - t)**2.
    """
    positive = np.maximum(excess, 0.0)
    cubic = np.minimum(positive, joint)
    rest = positive - cubic
    square = cubic * cubic
    value = square * cubic + 3.0 * joint * rest * (joint + rest)
    slope = 3.0 * square + 6.0 * joint * rest
    return value, slope


@dataclass(frozen=True)
class Feasibility:
    """Stacked bounds of the derivative control points [V; A; J], each row (s, l).

    Attributes
    ----------
    upper, lower : (R, 2) array
        Elastic limits lambda c_m (signed) beyond which the penalty starts.
    upper_joint, lower_joint : (R, 2) array
        D = c_j - lambda c_m on either side.
    upper_weight, lower_weight : (R, 2) array
        w_v, w_a, w_j of the row.
    """

    upper: Array
    lower: Array
    upper_joint: Array
    lower_joint: Array
    upper_weight: Array
    lower_weight: Array

    def columns(self, chosen: int | slice) -> Feasibility:
        """The bounds of some axes: the first ``chosen`` of them, or a slice."""
        take = slice(chosen) if isinstance(chosen, int) else chosen
        return Feasibility(
            self.upper[:, take], self.lower[:, take], self.upper_joint[:, take], self.lower_joint[:, take],
            self.upper_weight[:, take], self.lower_weight[:, take],
        )  # fmt: skip

    def evaluate(self, derivatives: Array) -> tuple[float, Array | None]:
        """J_d and its gradient with respect to ``derivatives`` (R, 2); None for a gradient of zero."""
        above = derivatives - self.upper
        below = self.lower - derivatives
        if above.max() <= 0.0 and below.max() <= 0.0:
            return 0.0, None
        value_up, slope_up = cubic_quadratic(above, self.upper_joint)
        value_low, slope_low = cubic_quadratic(below, self.lower_joint)
        value = float(np.vdot(self.upper_weight, value_up) + np.vdot(self.lower_weight, value_low))
        return value, self.upper_weight * slope_up - self.lower_weight * slope_low


def feasibility_bounds(
    n: int,
    maxima: Array,
    minima: Array,
    weights: tuple[float, float, float],
    elastic: float,
    joint_factor: float,
    reverse_weight: float,
) -> Feasibility:
    """Bounds for the derivatives of ``n`` control points.

    Parameters
    ----------
    maxima, minima : (3, 2) array
        c_m of velocity, acceleration and jerk per axis, upper and (signed) lower.
    weights : tuple
        w_v, w_a, w_j.
    elastic : float
        The paper's lambda < 1.
    joint_factor : float
        c_j as a multiple of c_m.
    reverse_weight : float
        Weight of longitudinal speeds below zero. The paper bounds |v| only, which lets a repaired
        car reverse; here the lower bound of the longitudinal speed is zero, and not elastic.
    """
    rows = [n - 1, n - 2, n - 3]
    upper = np.repeat(elastic * maxima, rows, axis=0)
    lower = np.repeat(elastic * minima, rows, axis=0)
    upper_joint = np.repeat((joint_factor - elastic) * np.abs(maxima), rows, axis=0)
    lower_joint = np.repeat((joint_factor - elastic) * np.abs(minima), rows, axis=0)
    upper_weight = np.repeat(np.outer(weights, np.ones(2)), rows, axis=0)
    lower_weight = upper_weight.copy()
    lower[: n - 1, 0] = 0.0
    lower_joint[: n - 1, 0] = REVERSE_JOINT
    lower_weight[: n - 1, 0] = reverse_weight
    return Feasibility(upper, lower, upper_joint, lower_joint, upper_weight, lower_weight)
