"""The paper's {p, v} pairs: which control points an obstacle stands in the way of."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, smallest
from repair.problem.problem import SIDE_AXIS, SIDE_SIGN, RepairProblem, Side

__all__ = ["Pairs", "anchor_pairs", "closest_distance", "pushes"]

# NumPy compares with plain integers several times faster than with an enumeration's members.
# The sides up to this one are about s, the others about l.
_AHEAD = int(Side.AHEAD)
# An array of no dimension is taken by NumPy two or three times faster than a number of Python's.
_ZERO = np.zeros(())


class Pairs(NamedTuple):
    """The paper's {p, v} pairs, one row each: d = (Q_i - p) . v with v along an axis.

    Attributes
    ----------
    row : (P,) int array
        Control point.
    axis : (P,) int array
        0 for s and 1 for l.
    sign : (P,) array
        Of v on that axis.
    anchor : (P,) array
        Coordinate of p on that axis [m].
    threshold : (P,) array
        s_f of the pair [m].
    """

    row: np.ndarray
    axis: np.ndarray
    sign: np.ndarray
    anchor: np.ndarray
    threshold: np.ndarray

    def along(self, axis: int) -> Pairs:
        """The pairs whose v points along an axis."""
        kept = self.axis == axis
        return self if np.count_nonzero(kept) == len(kept) else Pairs(*(column[kept] for column in self))

    def distance(self, points: Array) -> Array:
        """Obstacle distance d_ij of every pair (paper, Definition 3)."""
        return np.asarray(self.sign * (points[self.row, self.axis] - self.anchor))


def anchor_pairs(problem: RepairProblem, times: Array, shape: Array, first: int) -> Pairs:
    """Pairs for the control points ``first``.. of a curve whose points lie at ``shape``.

    Parameters
    ----------
    times : (n,) array
        Greville times [s]: each control point meets the obstacles at its own time.
    shape : (n, 2) array
        Where the control points lie or are led to; decides which boxes stand in their way.
    first : int
        Points before this one are fixed and get no pair.

    Notes
    -----
    A box that the ego passes behind or ahead of concerns the points inside its lateral interval,
    one passed on the left or right those inside its longitudinal interval.
    """
    parts: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array, Array, Array]] = []
    passing = problem.passing
    if passing is not None and len(problem.occupancy):
        lower, upper = problem.occupancy.at(times[first:])
        side = passing.side_at(times[first:]).ravel()
        free = shape[first:]
        inside = ((lower < free) & (free < upper)).reshape(-1, 2)
        found = np.where(side <= _AHEAD, inside[:, 1], inside[:, 0]).nonzero()[0]
        chosen = side.take(found)
        axis, sign = SIDE_AXIS.take(chosen), SIDE_SIGN.take(chosen)
        corner = 2 * found + axis
        anchor = np.where(sign > _ZERO, upper.ravel().take(corner), lower.ravel().take(corner))
        parts.append((found % len(free) + first, axis, sign, anchor, np.full(len(found), problem.clearance)))
    if problem.lateral:
        right, left = problem.bounds.at(shape[first:, 0])
        row = np.arange(first, len(times))
        ones = np.ones(len(row))
        edge = np.full(len(row), min(problem.clearance, 0.2))
        for sign_value, anchor in ((1.0, right), (-1.0, left)):
            parts.append((row, np.ones_like(row), sign_value * ones, anchor, edge))
    if len(parts) == 1:
        return Pairs(*parts[0])
    if not parts:
        empty = np.empty(0)
        return Pairs(empty.astype(np.intp), empty.astype(np.intp), empty, empty, empty)
    return Pairs(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def closest_distance(pairs: Pairs, points: Array) -> float:
    """Smallest obstacle distance of all pairs, inf without any."""
    return smallest(pairs.distance(points)) if pairs.row.size else math.inf


def pushes(pairs: Pairs, points: Array) -> int:
    """How often lambda_c has to be doubled at least until no pair collides any more.

    At a minimum j_c pushes a point out of a box as hard as the rest of the cost pushes it in, which at the
    edge pushes no less (it is convex). There, with an excess of s_f, the slope of j_c is 3 s_f²; at a
    distance d < 0, with s_f - d, it is 1 - 2 d / s_f times that. With several pairs, which may help one
    another, this is a guess.

    Returns
    -------
    int
        0 where none collides.
    """
    distance = pairs.distance(points)
    if not len(distance) or smallest(distance) >= 0.0:
        return 0
    threshold = pairs.threshold
    if np.count_nonzero(threshold) < len(threshold):
        collides = distance < _ZERO
        distance, threshold = distance[collides], threshold[collides]
        if not threshold.all():
            return 1
    return max(math.ceil(math.log2(1.0 - 2.0 * smallest(distance / threshold))), 1)
