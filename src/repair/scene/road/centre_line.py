"""The centre line along a chain of lanelets, lane changes included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from repair.arrays import Array
from repair.scene.road.joints import joined
from repair.scene.road.lanes import Lane, locate

__all__ = ["BEHIND", "centre_line", "cut_line", "direction_at"]

BEHIND = 45.0  # centre line behind the ego [m]
_FAR = 450.0  # centre line ahead of the ego at most, unless more is wanted [m]
_NEAR = 30.0  # the ego is looked for so far [m] around the place where it has to be


def direction_at(line: Array, end: int, sign: float) -> float:
    """Direction [rad] in which a polyline arrives at one of its points.

    Parameters
    ----------
    line : (M, 2) array
    end : int
        Index of the point; negative: the last one.
    sign : float
        1, or -1 where the line is listed against the direction of travel.
    """
    end = len(line) - 1 if end < 0 else end
    for start in range(end - 1, -1, -1):
        step = sign * (line[end] - line[start])
        if np.hypot(*step) > 1e-3:
            return float(np.arctan2(step[1], step[0]))
    return 0.0


def _forward(points: Array) -> Array:
    """A polyline without points that repeat the one before or go back by a little."""
    line: list[Array] = []
    for point in points:
        if line:
            step = point - line[-1]
            if np.hypot(*step) < 1e-3:
                continue
            if len(line) > 1 and np.hypot(*step) < 3.0 and np.dot(step, line[-1] - line[-2]) < 0.0:
                continue
        line.append(point)
    return np.array(line)


def _changed(here: Array, there: Array, distance: float) -> Array:
    """A line that runs from the start of ``here`` over to ``there`` within ``distance``, then along it."""
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(here, axis=0).T))])
    distance = min(distance, float(chord[-1]))
    arc = np.linspace(0.0, distance, max(int(distance), 4) + 1)
    own = np.stack([np.interp(arc, chord, here[:, 0]), np.interp(arc, chord, here[:, 1])], axis=1)
    where = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(there, axis=0).T))])
    found = np.array([locate(there, p)[0] for p in own])
    other = np.stack([np.interp(found, where, there[:, 0]), np.interp(found, where, there[:, 1])], axis=1)
    u = (arc / max(distance, 1e-9))[:, None]
    blend = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    return np.concatenate([own + blend * (other - own), there[where > found[-1] + 1.0]])


def centre_line(chain: Sequence[int], lanes: Mapping[int, Lane], change: float) -> Array:
    """Centre line (M, 2) along a chain of lanelets.

    Parameters
    ----------
    chain : sequence of int
        Ids; of two neighbours in it the second follows the first, or lies beside it.
    lanes : mapping
        The map's lanes by id.
    change : float
        Length of a change by one lane [m].
    """
    line: Array | None = None
    k = 0
    while k < len(chain):
        last = k
        while last + 1 < len(chain) and chain[last + 1] not in lanes[chain[last]].successors:
            last += 1
        here = lanes[chain[k]].center
        here = here if last == k else _changed(here, lanes[chain[last]].center, change * (last - k))
        line = here if line is None else joined(line, here, change)
        k = last + 1
    return np.empty((0, 2)) if line is None else _forward(line)


def cut_line(line: Array, position: Array, near: float, ahead: float) -> tuple[Array, float, bool]:
    """The part of a centre line around the ego, the ego's place along it, and whether its far end was cut.

    Parameters
    ----------
    line : (M, 2) array
    position : (2,) array
        Of the ego [m].
    near : float
        About where it is along the line [m]: a line may pass it more than once.
    ahead : float
        Road that is wanted before the ego [m].
    """
    chord = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    first = max(int(np.searchsorted(chord, near - _NEAR)) - 1, 0)
    last = int(np.searchsorted(chord, near + _NEAR)) + 1
    here = float(chord[first]) + locate(line[first:last], position)[0]
    far = max(_FAR, ahead + 50.0)
    low, high = max(here - 2.0 * BEHIND, 0.0), min(here + far, float(chord[-1]))
    inside = (chord > low) & (chord < high)
    arc = np.concatenate([[low], chord[inside], [high]])
    part = np.stack([np.interp(arc, chord, line[:, 0]), np.interp(arc, chord, line[:, 1])], axis=1)
    return part, here - low, bool(high < chord[-1])
