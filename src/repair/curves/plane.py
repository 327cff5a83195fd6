"""A trajectory in the plane: points, headings, speeds, and the way from sample to sample."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from repair.arrays import Array, Points, largest

__all__ = ["STANDSTILL", "CartesianPath", "held_headings"]

STANDSTILL = 1e-2
"""Below this speed [m/s] the direction of motion is noise: a trajectory's heading is held."""


class CartesianPath(NamedTuple):
    """A trajectory in the plane.

    Attributes
    ----------
    t : (K,) array
        Time [s].
    xy : (K, 2) array
        Position of the reference point [m].
    heading : (K,) array
        Direction of its velocity [rad], continuous; held where it stands, and not turned round
        while reversing.
    speed : (K,) array
        Signed speed [m/s], negative while reversing.
    step : (K - 1,) array
        Distance from each sample to the next [m].
    turn : (K - 1,) array
        Change of heading from each sample to the next [rad].
    slowest, longest, sharpest : float
        Smallest speed, largest step and largest size of a turn: what several checks ask for first. NaN
        where one of the values is.
    """

    t: Array
    xy: Array
    heading: Array
    speed: Array
    step: Array
    turn: Array
    slowest: float
    longest: float
    sharpest: float

    @classmethod
    def through(cls, t: Array, plane: Points, heading: Array, speed: Array, slowest: float) -> CartesianPath:
        """The path through points x + iy (K,), K > 0, of which heading, speed and smallest speed are known.

        Jumps of the heading by full turns are taken out.
        """
        step = np.abs(plane[1:] - plane[:-1])
        turn = heading[1:] - heading[:-1]
        longest = sharpest = 0.0
        if len(step):
            longest, sharpest = largest(step), largest(np.abs(turn))
            if not sharpest < np.pi:
                heading = np.unwrap(heading)
                turn = heading[1:] - heading[:-1]
                sharpest = largest(np.abs(turn))
        xy = plane.view(np.float64).reshape(-1, 2)
        return cls(t, xy, heading, speed, step, turn, slowest, longest, sharpest)

    @property
    def distance(self) -> Array:
        """Distance driven since the first sample (K,) [m]."""
        distance = np.zeros(len(self.t))
        np.add.accumulate(self.step, out=distance[1:])
        return distance


def held_headings(heading: Array, fallback: Array, pace: Array) -> Array:
    """Headings with those of standing samples taken from the last (else the first) moving one.

    Parameters
    ----------
    heading : (K,) array
        Where the vehicle goes [rad]; without meaning where it stands.
    fallback : (K,) array
        Where the path goes; the first one holds for who never moves.
    pace : (K,) array
        How fast the vehicle is, whatever its direction [m/s].
    """
    moving = pace >= STANDSTILL
    count = np.count_nonzero(moving)
    if not count:
        return np.full_like(fallback, fallback[0]) if len(fallback) else fallback
    if np.count_nonzero(moving[:count]) == count:  # it stops, and does not start again
        held = heading.copy()
        held[count:] = held[count - 1]
        return held
    last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
    return np.asarray(heading[np.where(last < 0, int(np.argmax(moving)), last)])
