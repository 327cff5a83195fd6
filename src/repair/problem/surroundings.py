"""What the boxes are to a reference: where they meet, and on which side they are passed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.curves.base import FrenetTrajectory
from repair.world.boxes import Occupancy

__all__ = ["Surroundings", "inside", "overlapping", "sides_of", "surroundings", "widened"]


class Surroundings(NamedTuple):
    """The boxes at the guide's times, and what they are to the reference.

    Attributes
    ----------
    lower, upper : (N, K, 2) array
        Corners of the boxes; NaN where an obstacle is absent.
    conflict : (k, j) or None
        First time index, and obstacle, at which the reference is inside of a box.
    ends : (2, N, K) array
        Rear and front ends of the boxes, the margin added [m].
    overlap : (N, K) bool array
        Which boxes, the margin added, the reference overlaps sideways.
    """

    lower: Array
    upper: Array
    conflict: tuple[int, int] | None
    ends: Array
    overlap: npt.NDArray[np.bool_]


def surroundings(reference: FrenetTrajectory, occupancy: Occupancy, margin: float) -> Surroundings:
    """Look them up at the reference's times, whatever these are.

    Parameters
    ----------
    reference : FrenetTrajectory
    occupancy : Occupancy
    margin : float
        Added to the boxes on all sides [m]; not for ``conflict``.
    """
    lower, upper = occupancy.at(reference.t)
    conflict = _conflict(inside(lower, upper, reference.position))
    ends, edges = widened(lower, upper, margin)
    return Surroundings(lower, upper, conflict, ends, overlapping(edges, reference.position[:, 1]))


def inside(lower: Array, upper: Array, path: Array) -> npt.NDArray[np.bool_]:
    """Which boxes (N, K) the path (K, 2) is in."""
    within = (lower < path) & (path < upper)
    return within[..., 0] & within[..., 1]


def widened(lower: Array, upper: Array, margin: float) -> tuple[Array, Array]:
    """Lower and upper ends (2, N, K) of the boxes with the margin, along s and along l."""
    corners = np.array([lower, upper])
    corners[0] -= margin
    corners[1] += margin
    return corners[..., 0], corners[..., 1]


def overlapping(edges: Array, l: Array) -> npt.NDArray[np.bool_]:  # noqa: E741
    """Which boxes (..., N, K), between ``edges`` (2, N, K), lateral motions l (..., K) overlap sideways."""
    sideways = l[..., None, :]
    return np.asarray((edges[0] < sideways) & (sideways < edges[1]))


def _conflict(hit: npt.NDArray[np.bool_]) -> tuple[int, int] | None:
    """First (time index, obstacle) of the hits (N, K)."""
    times = hit.any(axis=0)
    if not times.any():
        return None
    k = int(times.argmax())
    return k, int(hit[:, k].argmax())


def sides_of(position: Array, lower: Array, upper: Array) -> npt.NDArray[np.int8]:
    """Side (N, K) that a collision-free path (K, 2) takes of each box.

    Where the path is clear on one axis only, that axis decides; where it is clear on both, the
    larger distance does. Where a box is not there it counts as ahead of the path.
    """
    before, after = lower - position, position - upper
    far = np.maximum(before, after)
    along, across = far[..., 0], far[..., 1]
    ahead, left = after[..., 0] > before[..., 0], after[..., 1] >= before[..., 1]
    # In the order of Side: behind, ahead, left, right. Nothing is true of a box that is not there.
    return np.where(across > along, 3 - left.view(np.int8), ahead.view(np.int8))
