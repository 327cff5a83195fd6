"""Where the reference point cannot be without contact, whatever the heading in an interval.

For a body E at heading psi and a convex obstacle O these places are O + (-R(psi) E); for an interval of
headings they are the intersection of all of these, which is convex. Approximated is it by a polygon from
inside: each of its corners is shown to be such a place.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array

__all__ = ["SPAN", "forbidden", "pieces"]

#: Intervals of headings are looked at in pieces no longer than this [rad].
SPAN = 0.2
_KEPT = 1e-5  # by how much a witness has to be inside [m]
_COARSE = 0.04  # corners that reach no farther than this are left out [m]
_FEWEST, _MOST = 3, 8  # corners
_GRID = np.array([(a, b) for a in (0.0, 0.25, 0.5, 0.75, 1.0) for b in (0.0, 0.5, 1.0)])
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
    middle, witnesses = polygon.mean(axis=0), _Witnesses.of(shape, corners, angles)
    if not witnesses.meet(middle[None])[0]:
        return None
    points, open_ = polygon.copy(), np.ones(len(polygon), dtype=np.bool_)
    for share in _INWARDS:
        points[open_] = middle + (1.0 - share) * (polygon[open_] - middle)
        open_[open_] = ~witnesses.meet(points[open_])
        if not open_.any():
            break
    points = points[~open_]
    return _hull(points) if len(points) >= _FEWEST else None


def pieces(low: float, high: float) -> int:
    """In how many pieces an interval of headings is looked at."""
    return max(1, math.ceil((high - low) / SPAN))


class _Witnesses(NamedTuple):
    """Points of a shape and of a body that may be in the other one at headings (A,), wherever the body is.

    Attributes
    ----------
    inner : (Q, 2) array
        Of the shape.
    turn : (A, 2) array
        Cosine and sine of the headings.
    low, high : (2,) array
        Between which they are in the body, seen from it, shrunk.
    normals : (K, 2) array
        Of the shape's sides.
    level : (K, A, B) array
        By how much those of the body, at the origin, are inside of the sides.
    """

    inner: Array
    turn: Array
    low: Array
    high: Array
    normals: Array
    level: Array

    @classmethod
    def of(cls, shape: Array, corners: Array, angles: Array) -> _Witnesses:
        """The points that are tried."""
        normals, offsets = _sides(shape)
        low, high = corners.min(axis=0), corners.max(axis=0)
        turn = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        shrunk = math.cos(0.5 * float(angles[1] - angles[0]))
        inner = np.concatenate((shape, 0.5 * (shape + np.roll(shape, -1, axis=0)), shape.mean(axis=0)[None]))
        body = low + _GRID * (high - low)
        x = body[None, :, 0] * turn[:, :1] - body[None, :, 1] * turn[:, 1:]
        y = body[None, :, 1] * turn[:, :1] + body[None, :, 0] * turn[:, 1:]
        away = normals[:, :1, None] * x + normals[:, 1:, None] * y
        level = offsets[:, None, None] - away
        return cls(inner, turn, shrunk * low + _KEPT, shrunk * high - _KEPT, normals, level)

    def meet(self, points: Array) -> npt.NDArray[np.bool_]:
        """Whether the body meets the shape from every one of the points (P, 2), at all headings.

        Between two headings 2 d apart it does if one point of the body is in the shape at both (the point
        moves on an arc, whose chord is in the shape, and the body contains that point shortened), or if one
        point of the shape is at both in the body shrunk by cos d. Tried are some points of either.
        """
        turn, away = self.turn, self.inner[None] - points[:, None]  # (P, A, Q)
        u = away[:, None, :, 0] * turn[None, :, :1] + away[:, None, :, 1] * turn[None, :, 1:]
        w = away[:, None, :, 1] * turn[None, :, :1] - away[:, None, :, 0] * turn[None, :, 1:]
        inside = (u >= self.low[0]) & (u <= self.high[0]) & (w >= self.low[1]) & (w <= self.high[1])
        met = (inside[:, 1:] & inside[:, :-1]).any(axis=2)
        if not met.all():
            over = points @ self.normals.T  # (P, K)
            inside = (self.level[None] - over[:, :, None, None]).min(axis=1) >= _KEPT
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
    half = 0.5 * float(angles[1] - angles[0])
    loss = 1.0 / math.cos(half) - 1.0
    low, high = corners.min(axis=0), corners.max(axis=0)
    # of the body's sides at each of the angles
    cos, sin = np.cos(angles), np.sin(angles)
    out: Array = (
        np.array(((cos, sin), (-cos, -sin), (-sin, cos), (sin, -cos))).transpose(2, 0, 1).reshape(-1, 2)
    )
    off = np.tile((high[0], -low[0], high[1], -low[1]), len(angles)) * (1.0 - loss)
    planes = np.column_stack((
        np.concatenate((normals, -out)),
        np.concatenate((offsets + least, np.max(out @ -shape.T, axis=1) + off)),
    ))  # fmt: skip
    order = np.arctan2(planes[:, 1], planes[:, 0]).argsort(kind="stable")
    polygon = _intersection(planes[order].tolist())
    return _coarse(polygon) if len(polygon) >= _FEWEST else np.empty((0, 2))


_Point = tuple[float, float]
_Plane = tuple[float, float, float]


def _intersection(planes: list[_Plane]) -> list[_Point]:
    """Corners of the places with n x <= h for planes (n, h) in the order of their directions; or none."""
    kept: deque[_Plane] = deque()
    points: deque[_Point] = deque()
    for nx, ny, h in planes:
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
