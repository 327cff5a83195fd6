"""Where the reference point cannot be without contact, whatever the heading in an interval.

For a body E at heading psi and a convex obstacle O these places are O + (-R(psi) E); for an interval of
headings they are the intersection of all of these, which is convex. Approximated is it by a polygon from
inside: each of its corners is shown to be such a place.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
import numpy.typing as npt

from repair.arrays import Array

__all__ = ["SPAN", "forbidden", "meets_throughout", "pieces"]

#: Intervals of headings are looked at in pieces no longer than this [rad].
SPAN = 0.2
_KEPT = 1e-5  # by how much a witness has to be inside [m]
_COARSE = 0.04  # corners that reach no farther than this are left out [m]
_FEWEST, _MOST = 3, 8  # corners
_INWARDS = (0.004, 0.02, 0.06, 0.15, 0.35)  # shares of the way to the middle by which corners are moved


def forbidden(shape: Array, corners: Array, low: float, high: float) -> Array | None:
    """A convex polygon of forbidden places.

    Parameters
    ----------
    shape : (K, 2) array
        The obstacle, convex and anticlockwise; repeated corners do not matter [m].
    corners : (4, 2) array
        The body, seen from the reference point that it contains, anticlockwise [m].
    low, high : float
        Headings [rad].

    Returns
    -------
    (V, 2) array or None
        Anticlockwise; None where nothing was found.
    """
    angles = np.linspace(low, high, pieces(low, high) + 1)
    polygon = _around(shape, corners, angles)
    if len(polygon) < _FEWEST:
        return None
    middle = polygon.mean(axis=0)
    if not meets_throughout(middle[None], shape, corners, angles)[0]:
        return None
    points, open_ = polygon.copy(), np.ones(len(polygon), dtype=np.bool_)
    for share in _INWARDS:
        points[open_] = middle + (1.0 - share) * (polygon[open_] - middle)
        open_[open_] = ~meets_throughout(points[open_], shape, corners, angles)
        if not open_.any():
            break
    points = points[~open_]
    return _hull(points) if len(points) >= _FEWEST else None


def pieces(low: float, high: float) -> int:
    """In how many pieces an interval of headings is looked at."""
    return max(1, math.ceil((high - low) / SPAN))


def meets_throughout(points: Array, shape: Array, corners: Array, angles: Array) -> npt.NDArray[np.bool_]:
    """Whether the body meets the shape from every one of the points (P,), at all headings.

    Between two headings 2 d apart it does if one point of the body is in the shape at both (the point moves
    on an arc, whose chord is in the shape, and the body contains that point shortened), or if one point of
    the shape is at both in the body shrunk by cos d. Tried are some points of either.
    """
    normals, offsets = _sides(shape)
    low, high = corners.min(axis=0), corners.max(axis=0)
    turn = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    shrunk = math.cos(0.5 * float(angles[1] - angles[0]))
    met = np.zeros((len(points), len(angles) - 1), dtype=np.bool_)
    # points of the shape, seen from the body: (P, A, Q)
    inner = np.concatenate((shape, 0.5 * (shape + np.roll(shape, -1, axis=0)), shape.mean(axis=0)[None]))
    away = inner[None] - points[:, None]
    u = away[:, None, :, 0] * turn[None, :, :1] + away[:, None, :, 1] * turn[None, :, 1:]
    w = away[:, None, :, 1] * turn[None, :, :1] - away[:, None, :, 0] * turn[None, :, 1:]
    inside = (u >= shrunk * low[0] + _KEPT) & (u <= shrunk * high[0] - _KEPT)
    inside &= (w >= shrunk * low[1] + _KEPT) & (w <= shrunk * high[1] - _KEPT)
    met |= (inside[:, 1:] & inside[:, :-1]).any(axis=2)
    if met.all():
        return np.asarray(met.all(axis=1))
    grid = np.array([(a, b) for a in (0.0, 0.25, 0.5, 0.75, 1.0) for b in (0.0, 0.5, 1.0)])
    body = low + grid * (high - low)
    x = body[None, :, 0] * turn[:, :1] - body[None, :, 1] * turn[:, 1:]
    y = body[None, :, 1] * turn[:, :1] + body[None, :, 0] * turn[:, 1:]
    # by how much points of the body are inside of each side of the shape: (P, A, B)
    level = np.full((len(points), *x.shape), np.inf)
    for n, c in zip(normals, offsets, strict=True):
        np.minimum(level, c - (points @ n)[:, None, None] - (x * n[0] + y * n[1])[None], out=level)
    inside = level >= _KEPT
    met |= (inside[:, 1:] & inside[:, :-1]).any(axis=2)
    return np.asarray(met.all(axis=1))


def _sides(shape: Array) -> tuple[Array, Array]:
    """Outward unit normals and offsets of a convex polygon's sides; of repeated corners none."""
    way = np.roll(shape, -1, axis=0) - shape
    length = np.hypot(way[:, 0], way[:, 1])
    kept = length > 1e-9
    normals = np.stack([way[kept, 1], -way[kept, 0]], axis=1) / length[kept, None]
    return normals, np.sum(normals * shape[kept], axis=1)


def _around(shape: Array, corners: Array, angles: Array) -> Array:
    """The intersection over the angles, nearly: a polygon whose corners are still to be proven."""
    normals, offsets = _sides(shape)
    fine = np.linspace(angles[0], angles[-1], 4 * (len(angles) - 1) + 1)
    c, s = np.cos(fine), np.sin(fine)
    x = corners[:, :1] * c - corners[:, 1:] * s  # (4, F)
    y = corners[:, :1] * s + corners[:, 1:] * c
    least = np.max(-(normals[:, :1, None] * x + normals[:, 1:, None] * y), axis=1).min(axis=1)
    planes = [(n[0], n[1], h) for n, h in zip(normals, offsets + least, strict=True)]
    half = 0.5 * float(angles[1] - angles[0])
    loss = 1.0 / math.cos(half) - 1.0
    low, high = corners.min(axis=0), corners.max(axis=0)
    for angle in angles:
        cos, sin = math.cos(angle), math.sin(angle)
        for nx, ny, off in (
            (cos, sin, high[0]), (-cos, -sin, -low[0]), (-sin, cos, high[1]), (sin, -cos, -low[1]),
        ):  # fmt: skip
            planes.append((-nx, -ny, float(np.max(-shape @ (nx, ny))) + off * (1.0 - loss)))
    polygon = _intersection(planes)
    return _coarse(polygon) if len(polygon) >= _FEWEST else np.empty((0, 2))


_Point = tuple[float, float]
_Plane = tuple[float, float, float]


def _intersection(planes: list[_Plane]) -> list[_Point]:
    """Corners of the places with n x <= h for all planes (n, h), whose directions go all around; or none."""
    kept: deque[_Plane] = deque()
    points: deque[_Point] = deque()
    for nx, ny, h in sorted(planes, key=lambda p: math.atan2(p[1], p[0])):
        while points and nx * points[-1][0] + ny * points[-1][1] > h:
            points.pop()
            kept.pop()
        while points and nx * points[0][0] + ny * points[0][1] > h:
            points.popleft()
            kept.popleft()
        if kept:
            ax, ay, g = kept[-1]
            cross = ax * ny - ay * nx
            if cross < 1e-9:
                if cross < -1e-9 or ax * nx + ay * ny < 0.0:
                    return []
                continue  # of two that are parallel any one will do, if the corners are proven later
            points.append(((g * ny - h * ay) / cross, (ax * h - nx * g) / cross))
        kept.append((nx, ny, h))
    while len(points) > 1 and kept[0][0] * points[-1][0] + kept[0][1] * points[-1][1] > kept[0][2]:
        points.pop()
        kept.pop()
    if len(kept) < _FEWEST:
        return []
    (ax, ay, g), (nx, ny, h) = kept[-1], kept[0]
    cross = ax * ny - ay * nx
    if cross < 1e-9:
        return []
    points.append(((g * ny - h * ay) / cross, (ax * h - nx * g) / cross))
    return list(points)


def _coarse(points: list[_Point]) -> Array:
    """The polygon without the corners that reach least, one after the other."""

    def height(k: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = points[k - 1], points[k], points[(k + 1) % len(points)]
        length = math.hypot(cx - ax, cy - ay)
        return abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / max(length, 1e-12)

    heights = [height(k) for k in range(len(points))]
    while len(points) > _MOST or (len(points) > 4 and min(heights) <= _COARSE):
        k = heights.index(min(heights))
        del points[k], heights[k]
        heights[k - 1] = height(k - 1 if k else len(points) - 1)
        heights[k % len(points)] = height(k % len(points))
    return np.array(points)


def _hull(points: Array) -> Array:
    """Convex hull, anticlockwise, with no three corners in line."""
    order = sorted(map(tuple, points.tolist()))
    chains: list[list[tuple[float, float]]] = []
    for row in (order, order[::-1]):
        chain: list[tuple[float, float]] = []
        for p in row:
            while (
                len(chain) > 1
                and (
                    (chain[-1][0] - chain[-2][0]) * (p[1] - chain[-2][1])
                    - (chain[-1][1] - chain[-2][1]) * (p[0] - chain[-2][0])
                )
                <= 1e-12
            ):
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])
