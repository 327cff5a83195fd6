"""Points near places of a frame that are known already: those need not be searched for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from repair.arrays import Array, frozen
from repair.scene.frame import FrenetFrame

__all__ = ["alone", "to_frenet_from"]

_SPACING = 2.0  # between the places that are looked at [m]
_PART = 0.7  # of what is found there counts: in between it may be less
_FAR = 1e6  # farther points are searched for [m]
_EXACT = 1e-7  # how far from a projection Newton's method may end [m]


def to_frenet_from(frame: FrenetFrame, points: Array, start: Array) -> Array:
    """The same as ``frame.to_frenet(points)`` up to rounding.

    Where the path is the nearest one by far, Newton's method has nowhere else to end.

    Parameters
    ----------
    frame : FrenetFrame
        One that passes no place twice, and is kept: what is found out about it is worth its time then.
    points : (N, 2) array
        Points in the plane [m].
    start : (N,) array
        Arc lengths not far from theirs, as of the middle of an outline [m]; NaN where none is known.
    """
    found = np.full(points.shape, np.nan)
    known = np.isfinite(start) & (np.abs(points) < _FAR).all(axis=1)
    sure = np.zeros(len(points), dtype=np.bool_)
    if known.any():
        s, lateral, along, _ = frame.settled(points[known], start[known])
        found[known] = np.stack([s, lateral], axis=1)
        sure[known] = (along <= _EXACT) & (np.abs(lateral) < alone(frame, s, lateral))
    if not sure.all():
        found[~sure] = frame.to_frenet(points[~sure])
    return found


def alone(frame: FrenetFrame, s: Array, lateral: Array) -> Array:
    """How far from places (K,), on the side of ``lateral``, the path is surely nearest there [m].

    0 beyond the ends of the frame.
    """
    inside = (s > 0.0) & (s < frame.length)
    cell = np.where(inside, s / _SPACING, 0.0).astype(np.intp)
    return np.where(inside, _reach(frame)[(lateral > 0.0).astype(np.intp), cell], 0.0)


@lru_cache(maxsize=8)
def _reach(frame: FrenetFrame) -> Array:
    """:func:`alone` for the cells of a frame, right (0) and left (1) of it (2, M).

    A circle that touches the path at p, with its middle on the side of n, holds no other place q of the path
    if its radius is at most |q - p|² / (2 n . (q - p)), and none right beside p if it is at most that of the
    bend there. Bends are looked at wherever the frame is tabulated: the sharpest may lie between two p.
    """
    at = np.arange(0.0, frame.length + 2.0 * _SPACING, _SPACING)
    place = np.ascontiguousarray(frame.position(at)).view(np.complex128)[:, 0]
    seen = (place - place[:, None]) * np.exp(-1j * frame.heading(at))[:, None]
    square = seen.real**2 + seen.imag**2
    found = np.empty((2, len(at)))
    for side, sideways in enumerate((-seen.imag, seen.imag)):
        radius = np.full(square.shape, np.inf)
        np.divide(0.5 * square, sideways, out=radius, where=sideways > 1e-9)
        found[side] = radius.min(axis=1)
    # One cell more on either side: the other foot of a wiggle may be there.
    cell, sharpest = (frame.s / _SPACING).astype(np.intp), np.full((2, len(at) + 1), 1e-9)
    for side, bend in enumerate((-frame.curvature_table, frame.curvature_table)):
        np.maximum.at(sharpest[side], cell + 1, bend)
    sharpest = np.maximum(np.maximum(sharpest[:, :-2], sharpest[:, 1:-1]), sharpest[:, 2:])
    around = np.minimum(np.minimum(found[:, 1:], found[:, :-1]), 1.0 / sharpest)
    return frozen(np.clip(_PART * around - _SPACING, 0.0, 0.9 * frame.max_lateral))
