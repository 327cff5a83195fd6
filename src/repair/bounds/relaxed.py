"""The relaxed motion of a node: a double integrator with bounded acceleration and linear rows.

A row demands g . P(t_i) >= h of the reference point, or n . V(t_i) >= 0 of its velocity. Whether any motion
keeps all of them is a linear question once the discs of acceleration are polygons. It is asked as a QP (least
effort, a common slack of all rows with a high price), which always has an answer: either a motion that keeps
the rows, or multipliers of which :func:`excess` shows, without the solver and without polygons, that none
does.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.bounds.motion import NEAR, Motions
from repair.world.tracks import Index

__all__ = ["Relaxation", "Rows", "excess"]

_PRICE = 1e6  # of a metre of slack, squared, against the effort of full acceleration over a cell
_SIDES = 12  # of the polygons around the discs
_CELL = 0.05  # acceleration is constant over about this long [s]
_SPEED = 0.3  # [s]: what a metre per second counts, in metres
_SURE = 2e-6  # [m]


class Rows(NamedTuple):
    """Rows of a node.

    Attributes
    ----------
    instant : (R,) int array
    direction : (R, 2) array
        g or n, of unit length.
    level : (R,) array
        h [m], seen from the start; 0 of velocities.
    moving : (R,) bool array
        It is about the velocity.
    """

    instant: Index
    direction: Array
    level: Array
    moving: npt.NDArray[np.bool_]


class Drive(NamedTuple):
    """What else bounds the acceleration over the pieces between instants (I - 1,).

    Attributes
    ----------
    axis : (I - 1, 2) array
        Unit vectors e.
    forward, braking : (I - 1,) array
        -braking <= e . a <= forward, no larger than the disc's radius [m/s²].
    """

    axis: Array
    forward: Array
    braking: Array


class Relaxation:
    """Motions over instants, relaxed.

    Parameters
    ----------
    motions : Motions
    times : (I,) array
        Instants since the start [s], 0 the first, evenly spaced.
    """

    def __init__(self, motions: Motions, times: Array) -> None:
        self.motions, self.times = motions, times
        self.end = float(times[-1])
        count = max(1, math.ceil(self.end / _CELL - 1e-9))
        edges = np.linspace(0.0, self.end, count + 1)
        left = np.maximum(times[:, None] - edges[None], 0.0)
        self._way = 0.5 * (left[:, :-1] ** 2 - left[:, 1:] ** 2) * motions.acceleration
        self._speed = (left[:, :-1] - left[:, 1:]) * motions.acceleration
        self.free = motions.velocity * times[:, None]
        angles = np.arange(1, _SIDES // 2) * (2.0 * np.pi / _SIDES)
        angles = angles[np.abs(angles - 0.5 * np.pi) > 1e-9]
        self._count = count
        rows = np.zeros((len(angles) * count, 2 * count + 1))
        for k, angle in enumerate(angles):
            for c in range(count):
                rows[k * count + c, 2 * c : 2 * c + 2] = np.cos(angle), np.sin(angle)
        self._discs = rows
        self._eye, self._zero = np.eye(2 * count + 1), np.zeros(2 * count + 1)
        ones = np.ones(2 * count + len(rows))
        self._high = np.concatenate((ones[: 2 * count], [1e30], ones[2 * count :]))
        self._low = np.concatenate((-ones[: 2 * count], [0.0], -ones[2 * count :]))
        # of each cell a piece in it, which stands for the others where the solver is asked
        middle = 0.5 * (edges[:-1] + edges[1:])
        self._piece = np.clip(np.searchsorted(times, middle, side="right") - 1, 0, len(times) - 2)

    def solve(self, rows: Rows, drive: Drive) -> tuple[Array, Array, float, Array]:
        """Positions and velocities (I, 2) of a motion, the slack it needs [m], and multipliers (R,)."""
        import daqp

        n, r, top = 2 * self._count, len(rows.level), self.motions.acceleration
        cells = np.flatnonzero(
            (drive.forward[self._piece] < 0.99 * top) | (drive.braking[self._piece] < 0.99 * top)
        )
        fixed = len(self._discs) + len(cells)
        matrix = np.zeros((fixed + r, n + 1))
        matrix[: len(self._discs)] = self._discs
        piece, at = self._piece[cells], np.arange(len(self._discs), fixed)
        matrix[at, 2 * cells], matrix[at, 2 * cells + 1] = drive.axis[piece].T
        scale = np.where(rows.moving, _SPEED, 1.0)
        effect = np.where(rows.moving[:, None], self._speed[rows.instant], self._way[rows.instant])
        effect = effect * scale[:, None]
        own = matrix[fixed:]
        own[:, 0:n:2] = effect * rows.direction[:, :1]
        own[:, 1:n:2] = effect * rows.direction[:, 1:]
        own[:, n] = 1.0 / math.sqrt(_PRICE)
        known = np.where(rows.moving, rows.direction @ self.motions.velocity,
                         np.sum(rows.direction * self.free[rows.instant], axis=1))  # fmt: skip
        least = (rows.level - known) * scale
        high = np.concatenate((self._high, drive.forward[piece] / top, np.full(r, 1e30)))
        low = np.concatenate((self._low, -drive.braking[piece] / top, least))
        kinds = np.zeros(len(high), dtype=np.intc)
        z, _, flag, info = daqp.solve(self._eye, self._zero, matrix, high, low, kinds, primal_tol=1e-7)
        if flag < 1:
            return self.free, np.tile(self.motions.velocity, (len(self.times), 1)), math.inf, np.zeros(r)
        u = np.asarray(z[:n]).reshape(-1, 2)
        lam = np.maximum(-np.asarray(info["lam"])[-r:] if r else np.zeros(0), 0.0) * scale
        place = self.free + self._way @ u
        return place, self.motions.velocity + self._speed @ u, float(z[n]) / math.sqrt(_PRICE), lam


def excess(motions: Motions, times: Array, rows: Rows, drive: Drive, multipliers: Array) -> float:
    """By how much every motion breaks the weighted sum of the rows, if positive [m]; weights sum to 1.

    The largest value of sum_r lambda_r (g_r . P(t_r) - h_r) over all accelerations of size at most A is that
    without acceleration plus A times the integral of |w|, w(t) = sum_r lambda_r g_r (t_r - t)+, to which
    velocities contribute lambda_r n_r until t_r; where the acceleration is bounded along an axis as well, the
    support function of that set stands for A |w|. Over a piece w is linear, so that is convex and the
    trapezoidal rule bounds it from above.
    """
    total = float(multipliers.sum())
    if total <= 0.0:
        return -math.inf
    weight = (multipliers / total)[:, None] * rows.direction
    at, moving = times[rows.instant], rows.moving
    slope, value = np.zeros((len(times), 2)), np.zeros((len(times), 2))
    np.add.at(slope, rows.instant[~moving], weight[~moving])
    np.add.at(value, rows.instant[~moving], weight[~moving] * at[~moving, None])
    np.add.at(value, rows.instant[moving], weight[moving])
    # of the piece that ends at an instant: all rows at it or later
    slope, value = np.cumsum(slope[::-1], axis=0)[::-1][1:], np.cumsum(value[::-1], axis=0)[::-1][1:]
    begin, end = times[:-1], times[1:]
    nodes = [value - slope * t[:, None] for t in (begin, 0.5 * (begin + end), end)]
    sizes = [_support(w, drive, motions.acceleration) for w in nodes]
    swing = float(np.sum((end - begin) * (sizes[0] + 2.0 * sizes[1] + sizes[2]))) / 4.0
    free = np.where(moving, 1.0, at) * (weight @ motions.velocity)
    held = float(np.sum(free) - np.sum(np.where(moving, 0.0, multipliers / total * rows.level)))
    start = np.where(moving, NEAR.speed, NEAR.place + NEAR.speed * at)  # by how much it may be off
    return -(held + swing + float(multipliers @ start) / total) - _SURE


def _support(w: Array, drive: Drive, most: float) -> Array:
    """The largest of w . a over the accelerations that are allowed, for each piece (I - 1,)."""
    size = np.hypot(w[:, 0], w[:, 1])
    along = np.sum(w * drive.axis, axis=1)
    across = np.abs(w[:, 0] * drive.axis[:, 1] - w[:, 1] * drive.axis[:, 0])
    bound = np.where(along > 0.0, drive.forward, drive.braking)
    cut = most * np.abs(along) > bound * size
    corner = bound * np.abs(along) + np.sqrt(np.maximum(most * most - bound * bound, 0.0)) * across
    return np.where(cut, corner, most * size)
