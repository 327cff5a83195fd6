"""First contact in continuous time: advancement by a bound on the relative motion.

Between two samples everything moves and turns linearly in time. Over a piece of that interval two shapes
are free of contact where, in its middle, an axis separates them by more than anything can move along that
axis until the ends of the piece. Pieces of which that is not known are halved; what is left when they are
shorter than half a millisecond counts as contact (conservative advancement: Mirtich, *Impulse-based dynamic
simulation of rigid body systems*, 1996; Tang et al., *C2A*, ICRA 2009). So no contact is missed, and one is
reported at most that much too early; who comes closer than that and moves on is the only one who is reported
in vain.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points
from repair.world.touching import TOUCH

__all__ = ["FINEST", "Motions", "first_touch"]

#: Pieces are halved until they are shorter than this [s].
FINEST = 5e-4


class Motions(NamedTuple):
    """Pairs of the ego and a shape, from the start to the end of an interval (n,).

    Attributes
    ----------
    start, end : array
        Times [s].
    ego, ego_end : complex array
        The ego's centre.
    turn, turn_end : array
        Its orientation [rad], the shorter way round.
    shape, shape_end : complex array
        The shape's centre.
    heading, heading_end : array
        Its heading [rad], the shorter way round.
    size, size_end : complex array
        Half length + i half width; the radius, twice, of a circle.
    round : bool array
        It is a circle.
    spare : array
        By how much the ego may be off the straight way between its samples [m].
    """

    start: Array
    end: Array
    ego: Points
    ego_end: Points
    turn: Array
    turn_end: Array
    shape: Points
    shape_end: Points
    heading: Array
    heading_end: Array
    size: Points
    size_end: Points
    round: npt.NDArray[np.bool_]
    spare: Array

    def take(self, rows: npt.NDArray[np.intp]) -> Motions:
        """Some of the pairs."""
        columns: Any = (column[rows] for column in self)
        return Motions(*columns)


def first_touch(pairs: Motions, half: complex) -> tuple[float, int] | None:
    """Time [s] and row of the first contact, None where there is none.

    Parameters
    ----------
    pairs : Motions
    half : complex
        Half length + i half width of the ego [m].
    """
    count = len(pairs.start)
    if not count:
        return None
    row = np.arange(count)
    low, high = np.zeros(count), np.ones(count)
    duration = pairs.end - pairs.start
    radius = abs(half)
    best, found = np.inf, -1
    while True:
        some = pairs.take(row)
        gap, most = _gaps(some, 0.5 * (low + high), 0.5 * (high - low), half, radius)
        span = duration[row]
        begin, middle = some.start + low * span, some.start + 0.5 * (low + high) * span
        touching = gap <= TOUCH
        if touching.any():
            first = int(np.argmin(np.where(touching, middle, np.inf)))
            if middle[first] < best:
                best, found = float(middle[first]), int(row[first])
        open_ = (gap - most <= TOUCH) & (begin < best)
        fine = (high - low) * span <= FINEST
        done = open_ & fine
        if done.any():
            first = int(np.argmin(np.where(done, begin, np.inf)))
            if begin[first] < best:
                best, found = float(begin[first]), int(row[first])
        on = np.flatnonzero(open_ & ~fine & (begin < best))
        if not len(on):
            return None if found < 0 else (best, found)
        middle_share = 0.5 * (low + high)[on]
        row = np.concatenate((row[on], row[on]))
        low, high = np.concatenate((low[on], middle_share)), np.concatenate((middle_share, high[on]))


def _gaps(
    pairs: Motions, share: Array, half_share: Array, half: complex, radius: float
) -> tuple[Array, Array]:
    """Gap along the best axis in the middle of a piece, and how much of it may go until its ends (n,).

    The best axis is the one that leaves most; the gap is negative where all axes overlap.
    """
    ego_way, way = pairs.ego_end - pairs.ego, pairs.shape_end - pairs.shape
    ego_turn, turn = pairs.turn_end - pairs.turn, pairs.heading_end - pairs.heading
    grown = pairs.size_end - pairs.size
    apart = pairs.shape + share * way - pairs.ego - share * ego_way
    moved = half_share * (way - ego_way)
    size = pairs.size + share * grown
    reach = np.where(pairs.round, 0.0, np.abs(size))
    loose = half_share * (radius * np.abs(ego_turn) + reach * np.abs(turn)) + pairs.spare
    loose += half_share * np.maximum(np.abs(grown.real), np.abs(grown.imag))
    axis = np.exp(-1j * (pairs.turn + share * ego_turn))
    seen, way_seen = apart * axis, moved * axis
    own = np.exp(1j * (pairs.heading + share * turn)) * axis
    corner, other = own * size, own * size.conj()
    gaps, mosts = np.empty((2, 4, len(share)))
    gaps[0] = np.abs(seen.real) - half.real - np.maximum(np.abs(corner.real), np.abs(other.real))
    gaps[1] = np.abs(seen.imag) - half.imag - np.maximum(np.abs(corner.imag), np.abs(other.imag))
    mosts[0], mosts[1] = np.abs(way_seen.real), np.abs(way_seen.imag)
    back = own.conj()
    seen2, way2 = seen * back, way_seen * back
    corner, other = half * back, np.conj(half) * back
    gaps[2] = np.abs(seen2.real) - size.real - np.maximum(np.abs(corner.real), np.abs(other.real))
    gaps[3] = np.abs(seen2.imag) - size.imag - np.maximum(np.abs(corner.imag), np.abs(other.imag))
    mosts[2], mosts[3] = np.abs(way2.real), np.abs(way2.imag)
    if pairs.round.any():  # of a circle the direction from the ego's nearest point
        outside = np.maximum(np.abs(seen.real) - half.real, 0.0) * np.sign(seen.real) + 1j * (
            np.maximum(np.abs(seen.imag) - half.imag, 0.0) * np.sign(seen.imag)
        )
        distance = np.abs(outside)
        normal = np.where(distance > 0.0, outside / np.where(distance > 0.0, distance, 1.0), 0.0)
        gap = distance - size.real
        most = np.where(distance > 0.0, np.abs((way_seen * normal.conj()).real), np.inf)
        gaps[:, pairs.round], mosts[:, pairs.round] = gap[pairs.round], most[pairs.round]
    best = np.argmax(gaps - mosts, axis=0)
    n = np.arange(len(share))
    return gaps.max(axis=0), gaps.max(axis=0) - (gaps - mosts)[best, n] + loose
