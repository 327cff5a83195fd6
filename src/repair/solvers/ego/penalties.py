"""The paper's penalty functions (Sec. IV-C, IV-D), vectorised, with their first two derivatives.

Both one-sided penalties of the paper, the collision penalty j_c and the feasibility penalty f, are
one and the same function of an excess e >= 0: the cubic e**3 up to a joint D, continued beyond it
by the parabola 3 D e**2 - 3 D**2 e + D**3 that meets it with equal value, slope and curvature. For
j_c the excess is c = s_f - d and D = s_f; for f it is |c_r| - lambda c_m and D = c_j - lambda c_m,
which fixes the paper's a_1 .. c_2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from repair.arrays import Array

__all__ = ["SoftBounds", "feasibility_bounds"]

# Reversing is penalised as 3 D e**2 from this speed [m/s] on: early enough to act as a quadratic.
REVERSE_JOINT = 0.01
# Arrays of no dimension are taken by NumPy two or three times faster than numbers of Python's.
_ZERO, _HALF = np.zeros(()), np.array(0.5)


class SoftBounds(NamedTuple):
    """Limits of K quantities, each of which is penalised beyond its own.

    Attributes
    ----------
    limit : (K,) array
        Where the penalty of a quantity starts.
    joint : (K,) array
        D.
    sixfold : (K,) array
        6 times the weight, by which the curvature grows with the excess up to the joint.
    bend : (K,) array
        6 times the weight times D, the curvature from the joint on.
    """

    limit: Array
    joint: Array
    sixfold: Array
    bend: Array

    @classmethod
    def of(cls, limit: Array, joint: Array, weight: Array) -> SoftBounds:
        """Bounds with their curvature worked out."""
        return cls(limit, joint, 6.0 * weight, 6.0 * weight * joint)

    def evaluate(self, x: Array, limit: Array | None = None) -> tuple[float, Array, Array]:
        """Sum of the weighted penalties of quantities (K,), and the slope and curvature of each.

        Written around the joint without a branch: t = min(e, D) of an excess e gives t**3 +
        3 D (e - t) e, the slope 3 t**2 + 6 D (e - t) and the curvature 6 t.
        ``limit`` stands in for the own one.
        """
        excess = x - (self.limit if limit is None else limit)
        np.maximum(excess, _ZERO, out=excess)
        cubic = np.minimum(excess, self.joint)
        curvature = self.sixfold * cubic
        slope = _HALF * curvature
        slope *= cubic
        value = float(slope.dot(cubic)) / 3.0
        beyond = excess - cubic
        beyond *= self.bend
        slope += beyond
        return value + 0.5 * float(beyond.dot(excess)), slope, curvature


def feasibility_bounds(
    n: int,
    maxima: Array,
    minima: Array,
    weights: tuple[float, float, float],
    elastic: float,
    joint_factor: float,
    reverse_weight: float,
) -> tuple[SoftBounds, SoftBounds]:
    """Bounds of the stacked derivatives x = [V; A; J] of ``n`` control points, and of -x.

    Parameters
    ----------
    maxima, minima : (3, axes) array
        c_m of velocity, acceleration and jerk per axis, upper and (signed) lower.
    weights : tuple
        w_v, w_a, w_j.
    elastic : float
        The paper's lambda < 1: the penalty starts at lambda c_m.
    joint_factor : float
        c_j as a multiple of c_m.
    reverse_weight : float
        Weight of longitudinal speeds below zero. The paper bounds ``|v|`` only, which lets a repaired
        car reverse; here the lower bound of the longitudinal speed is zero, and not elastic.

    Returns
    -------
    tuple of SoftBounds
        Of (3n - 6, axes) quantities each, not flattened.
    """
    extremes = np.array((maxima, -minima))
    limit, joint = elastic * extremes, (joint_factor - elastic) * np.abs(extremes)
    weight = np.empty_like(joint)
    weight[:] = np.reshape(weights, (3, 1))
    limit[1, 0, 0], joint[1, 0, 0], weight[1, 0, 0] = 0.0, REVERSE_JOINT, reverse_weight
    # All quantities of an order alike.
    each = np.array(SoftBounds.of(limit, joint, weight)).repeat((n - 1, n - 2, n - 3), axis=2)
    return SoftBounds(*each[:, 0]), SoftBounds(*each[:, 1])
