"""Points near places of a frame that are known already: those need not be searched for."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.scene.frame import FrenetFrame

__all__ = ["alone", "to_frenet_around", "to_frenet_from"]

_SPACING = 2.0  # between the places that are looked at [m]
_PART = 0.7  # of what is found there counts: in between it may be less
_FAR = 1e6  # farther points are searched for [m]
_CLOSE = 1e-6  # a shorter step of Newton's method is the last one: what it leaves is its square [m]
_STEPS = 6  # and so many follow the first two
_LEAST = 0.3  # of 1 - curvature * l counts where it is guessed how far along a point is
_DOMAIN = 0.05  # the smallest 1 - curvature * l that counts, as in the frame
_BLOCK = 2048  # points that are looked at together: they stay in the processor's cache


def to_frenet_around(
    frame: FrenetFrame,
    points: Array,
    middles: Array,
    counts: npt.NDArray[np.intp],
    at: npt.NDArray[np.intp],
) -> Array:
    """The same as ``frame.to_frenet(points)`` up to rounding, of outlines of a few metres.

    One place is searched for each of them, and how the path goes on there says where their points are.

    Parameters
    ----------
    frame : FrenetFrame
        As in :func:`to_frenet_from`.
    points : (N, 2) array
        The outlines' points, one outline after the other [m].
    middles : (K, 2) array
        Somewhere inside of each [m].
    counts : (K,) int array
        How many points each has.
    at : (K,) int array
        Which of the frame's places is nearest to each; negative where that is not known.
    """
    known = (np.abs(middles) < _FAR).all(axis=1)
    index = np.where(known, at, 0)
    unknown = index < 0
    if unknown.any():
        index[unknown] = frame.nearest(middles[unknown])
    heading = frame.heading_table[index]
    rows = np.stack([
        np.where(known, frame.s[index], np.nan), *frame.points[index].T, np.cos(heading), np.sin(heading),
        frame.curvature_table[index],
    ])  # fmt: skip
    s, x, y, cos, sin, bend = rows.repeat(counts, axis=1)
    x, y = points[:, 0] - x, points[:, 1] - y
    ahead, aside = cos * x + sin * y, cos * y - sin * x
    return to_frenet_from(frame, points, s + ahead / np.maximum(1.0 - bend * aside, _LEAST))


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
        Arc lengths not far from theirs [m]; NaN where none is known.
    """
    px, py = np.ascontiguousarray(points.T)
    known = np.isfinite(start) & (np.abs(px) < _FAR) & (np.abs(py) < _FAR)
    found, sure = np.full(points.shape, np.nan), np.zeros(len(points), dtype=np.bool_)
    parts = [slice(first, first + _BLOCK) for first in range(0, len(points), _BLOCK)]
    for part in parts if known.all() else [np.flatnonzero(known)]:
        s, lateral, close = _settled(frame, px[part], py[part], start[part])
        found[part, 0], found[part, 1] = s, lateral
        sure[part] = close & (np.abs(lateral) < alone(frame, s, lateral))
    if not sure.all():
        found[~sure] = frame.to_frenet(points[~sure])
    return found


def _settled(
    frame: FrenetFrame, px: Array, py: Array, start: Array
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """As the frame itself settles points, each no longer than it needs; and which of them came to rest."""
    s, lateral, step = _closer(frame, px, py, _closer(frame, px, py, start)[0])
    close = np.abs(step) <= _CLOSE
    for _ in range(_STEPS):
        still = np.flatnonzero(~close)
        if not len(still):
            break
        s[still], lateral[still], step = _closer(frame, px[still], py[still], s[still])
        close[still] = np.abs(step) <= _CLOSE
    return s, lateral, close


def _closer(frame: FrenetFrame, px: Array, py: Array, s: Array) -> tuple[Array, Array, Array]:
    """A step of Newton's method: where it leads, the offset where it began, and how far it went."""
    _, u, (c3, c2, c1, c0) = frame.pieces_at(s)
    c3u = c3 * u  # Horner's scheme, which gives the derivatives as well
    quadratic = c3u + c2
    linear = quadratic * u + c1
    quadratic += c3u
    x1, y1 = quadratic * u + linear
    quadratic += c3u  # half of the second derivative
    linear *= u
    linear += c0
    gx, gy = px - linear[0], py - linear[1]
    square = x1 * x1 + y1 * y1
    slope = 2.0 * (gx * quadratic[0] + gy * quadratic[1]) - square
    step = (gx * x1 + gy * y1) / np.minimum(slope, -_DOMAIN)
    return s - step, (x1 * gy - y1 * gx) / np.sqrt(square), step


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
