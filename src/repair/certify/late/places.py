"""Places from which the body meets a shape at every heading of an interval, shown by points of both.

Between two headings 2 d apart the body meets a convex shape throughout if

- a point of the body is in the shape at both: it moves on an arc about the reference point, whose chord is in
  the shape, and the body contains each point of the segment from the reference point to it; or
- a point of the shape is at both in the body that is shrunk by cos d about the reference point: seen from the
  body it moves on an arc that is farther out than its chord by 1 / cos d at most.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["convex", "met_throughout"]

Point = tuple[float, float]

_DEEP = 1e-7  # [m]: what is asked of a point, far more than rounding
_FAR = 1e5  # [m]: beyond, rounding would count


def convex(corners: Sequence[Point]) -> bool:
    """Whether a polygon is strictly convex, anticlockwise and near enough for doubles."""
    n = len(corners)
    if n < 3 or not all(abs(v) < _FAR for p in corners for v in p):
        return False
    total = 0.0
    for k in range(n):
        (ax, ay), (bx, by), (cx, cy) = corners[k - 1], corners[k], corners[(k + 1) % n]
        cross = (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
        if cross <= 0.0:
            return False
        total += math.atan2(cross, (bx - ax) * (cx - bx) + (by - ay) * (cy - by))
    return total < 2.0 * math.pi + 1e-6  # once around


def met_throughout(
    place: Point, shape: Sequence[Point], body: Sequence[Point], low: float, high: float, pieces: int
) -> bool:
    """Whether the body at a place meets the shape at every heading in [low, high].

    Parameters
    ----------
    place : tuple of float
        Of the reference point.
    shape, body : sequences of points
        Strictly convex, anticlockwise; the body is seen from the reference point, which it contains.
    low, high : float
    pieces : int
        In how many parts of the interval points are looked for.
    """
    step = (high - low) / pieces
    if not 0.0 <= step < 1.0:
        return False
    seen = [_seen(place, shape, low + k * step) for k in range(pieces + 1)]
    shrunk = math.cos(0.5 * step) - 1e-12
    small = [(shrunk * x, shrunk * y) for x, y in body]
    for k in range(pieces):
        # a point of the body in the shape at both headings
        if _common(_common(list(body), seen[k]), seen[k + 1]):
            continue
        # a point of the shape, seen from the body at the first heading
        turned = _turned(small, step)  # the body at the second heading, seen from the first
        if not _common(_common(list(seen[k]), small), turned):
            return False
    return True


def _seen(place: Point, shape: Sequence[Point], heading: float) -> list[Point]:
    """A shape as the body sees it."""
    c, s = math.cos(heading), math.sin(heading)
    return [
        (c * (x - place[0]) + s * (y - place[1]), c * (y - place[1]) - s * (x - place[0])) for x, y in shape
    ]


def _turned(points: Sequence[Point], angle: float) -> list[Point]:
    c, s = math.cos(angle), math.sin(angle)
    return [(c * x - s * y, s * x + c * y) for x, y in points]


def _common(polygon: list[Point], other: Sequence[Point]) -> list[Point]:
    """The part of a convex polygon that is properly inside of another one (Sutherland and Hodgman, 1974)."""
    for k in range(len(other)):
        if not polygon:
            return []
        (ax, ay), (bx, by) = other[k - 1], other[k]
        length = math.hypot(bx - ax, by - ay)
        nx, ny = (by - ay) / length, (ax - bx) / length
        over = [nx * (x - ax) + ny * (y - ay) + _DEEP for x, y in polygon]
        kept: list[Point] = []
        for i, (x, y) in enumerate(polygon):
            if (over[i - 1] > 0.0) != (over[i] > 0.0):
                share = over[i - 1] / (over[i - 1] - over[i])
                px, py = polygon[i - 1]
                kept.append((px + share * (x - px), py + share * (y - py)))
            if over[i] <= 0.0:
                kept.append((x, y))
        polygon = kept
    return polygon
