"""Where a CommonRoad shape is: placed exactly, uncertainly, or given in the plane.

A shape turns about its own centre, which is then moved by the state: commonroad-io's own reading. Where that
centre is not the body's position it is there a second time, turned with the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.errors import ScenarioError

__all__ = [
    "FAR",
    "Placed",
    "enclosing",
    "interval",
    "occupied",
    "off_centre",
    "outlines",
    "place",
    "polygons_of",
    "subdivided",
    "union",
]

FAR = 1e8
"""Coordinates beyond this [m] are no place on Earth, and leave no digits for what happens there."""

_EDGE = 2.0  # outline points are at most this far apart [m]
_OFF_CENTRE = 1e-3  # a centre farther from the position than this [m] is not there by rounding
_CORNERS = 16  # of the polygon circumscribed about a circle


class Placed(NamedTuple):
    """One occupancy, and the state behind it.

    Attributes
    ----------
    rectangle : tuple or None
        ``x, y, heading, half length, half width``.
    circle : tuple or None
        ``x, y, radius``.
    polygons : tuple of (m, 2) arrays, or None
        Convex. Exactly one of the three is set.
    state : tuple
        ``x, y, heading, speed``; NaN for what is not known.
    """

    rectangle: tuple[float, ...] | None
    circle: tuple[float, ...] | None
    polygons: tuple[Array, ...] | None
    state: tuple[float, float, float, float]

    def moved(self, shift: Array) -> Placed:
        """The same, moved by ``shift`` (2,) [m]."""
        dx, dy = float(shift[0]), float(shift[1])
        return Placed(
            self.rectangle and (self.rectangle[0] + dx, self.rectangle[1] + dy, *self.rectangle[2:]),
            self.circle and (self.circle[0] + dx, self.circle[1] + dy, self.circle[2]),
            self.polygons and tuple(p + shift for p in self.polygons),
            (self.state[0] + dx, self.state[1] + dy, *self.state[2:]),
        )


def interval(value: Any) -> tuple[float, float]:
    """Bounds of an exact or interval value."""
    if hasattr(value, "start") and hasattr(value, "end"):
        return float(value.start), float(value.end)
    return float(value), float(value)


def _box(center: npt.ArrayLike, heading: float, half: Sequence[float]) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=np.float64) * np.asarray(half)
    return np.asarray(np.asarray(center) + corners @ np.array([[c, s], [-s, c]]), dtype=np.float64)


def _ring(center: npt.ArrayLike, radius: float) -> Array:
    angle = np.arange(_CORNERS) * 2.0 * np.pi / _CORNERS
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(np.asarray(center) + around * (radius / np.cos(np.pi / _CORNERS)), dtype=np.float64)


def _convex_parts(vertices: Array) -> tuple[Array, ...]:
    """Convex polygons (not closed, counter-clockwise) that make up a simple polygon."""
    import shapely

    outline = shapely.Polygon(vertices)
    hull = outline.convex_hull
    if not outline.is_valid:
        outline = hull
    if hull.area - outline.area <= 1e-6 * max(hull.area, 1e-9):
        parts = [hull]
    else:
        parts = list(shapely.get_parts(shapely.constrained_delaunay_triangles(outline)))
    rings = [
        np.asarray(shapely.get_coordinates(shapely.normalize(p)))[:-1][::-1] for p in parts if p.area > 0.0
    ]
    if not rings:  # a line or a point: give it a finger's width
        rings = [np.asarray(shapely.get_coordinates(hull.buffer(0.01, quad_segs=2)))[:-1][::-1]]
    return tuple(rings)


def _parts(shape: Any) -> list[Any]:
    """The primitive shapes of a shape.

    Raises
    ------
    ScenarioError
        If it is a group of none; the obstacle is not named.
    """
    if hasattr(shape, "shapes"):
        leaves = [leaf for member in shape.shapes for leaf in _parts(member)]
        if not leaves:
            raise ScenarioError("its shape is a group of none")
        return leaves
    return [shape]


def _center_of(part: Any) -> Array:
    """The point a primitive shape is turned about: its own centre, as commonroad-io does it."""
    return np.asarray(part.center, dtype=np.float64)


def outlines(shape: Any, position: Array, heading: float) -> list[Array]:
    """Convex shells of a body shape placed exactly: turned about its own centre, then moved."""
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, s], [-s, c]])
    found: list[Array] = []
    for part in _parts(shape):
        center = _center_of(part)
        if hasattr(part, "radius"):
            found.append(_ring(center + position, float(part.radius)))
        elif hasattr(part, "length"):
            half = (part.length / 2.0, part.width / 2.0)
            found.append(_box(center + position, heading + part.orientation, half))
        else:
            found.extend(
                (p - center) @ turn + center + position for p in _convex_parts(np.asarray(part.vertices))
            )
    return found


def place(shape: Any, position: Array, heading: float, speed: float) -> Placed:
    """A body shape at an exact pose.

    A part whose centre is not the body's position is there twice: turned about its own centre, as
    commonroad-io has it, and turned with the body, as it is meant. To keep clear of both is right either way.

    Parameters
    ----------
    shape : commonroad.geometry.shape.Shape
    position : (2,) array
        [m]
    heading, speed : float
        [rad], [m/s]
    """
    parts = _parts(shape)
    state = (float(position[0]), float(position[1]), heading, speed)
    part = parts[0]
    if off_centre(shape):
        c, s = np.cos(heading), np.sin(heading)
        rigid = [p @ np.array([[c, s], [-s, c]]) + position for p in outlines(shape, np.zeros(2), 0.0)]
        return union(
            Placed(None, None, tuple(outlines(shape, position, heading)), state),
            Placed(None, None, tuple(rigid), state),
        )
    if len(parts) == 1 and (hasattr(part, "radius") or hasattr(part, "length")):
        center = _center_of(part) + position
        if hasattr(part, "radius"):
            return Placed(None, (float(center[0]), float(center[1]), float(part.radius)), None, state)
        half = (float(part.length) / 2.0, float(part.width) / 2.0)
        where = (float(center[0]), float(center[1]), heading + float(part.orientation))
        return Placed((*where, *half), None, None, state)
    return Placed(None, None, tuple(outlines(shape, position, heading)), state)


def enclosing(shape: Any, area: Any, low: float, high: float, speed: float) -> Placed:
    """Rectangle around every placement with the position in ``area`` and the heading in [low, high].

    Around all that :func:`place` makes of them.
    """
    heading = (low + high) / 2.0
    spread = min((high - low) / 2.0, np.pi)
    if hasattr(area, "center") or hasattr(area, "shapes"):
        where = np.concatenate(outlines(area, np.zeros(2), 0.0))
    else:
        where = np.asarray(area, dtype=np.float64)[None, :2]
    c, s = np.cos(heading), np.sin(heading)
    local = where @ np.array([[c, -s], [s, c]])
    lowest, highest = np.array([_reach(part, heading, spread) for part in _parts(shape)]).transpose(1, 0, 2)
    upper = np.max(local, axis=0) + np.max(highest, axis=0)
    lower = np.min(local, axis=0) + np.min(lowest, axis=0)
    center = (upper + lower) / 2.0 @ np.array([[c, s], [-s, c]])
    half = (upper - lower) / 2.0
    middle = np.mean(where, axis=0)
    return Placed(
        (float(center[0]), float(center[1]), heading, float(half[0]), float(half[1])),
        None,
        None,
        (float(middle[0]), float(middle[1]), heading, speed),
    )


def _reach(part: Any, heading: float, spread: float) -> tuple[Array, Array]:
    """Lowest and highest coordinates (2,) of a part turned by ``heading`` +- ``spread``, in axes along it.

    Turned about its own centre, and about the body's position.
    """
    center = _center_of(part)
    c, s = np.cos(heading), np.sin(heading)
    middle = center @ np.array([[c, -s], [s, c]])
    own = _swept(np.concatenate(outlines(part, -center, 0.0)), spread)
    lowest, highest = middle - own[2:], middle + own[:2]
    if float(np.hypot(*center)) > _OFF_CENTRE:
        whole = _swept(np.concatenate(outlines(part, np.zeros(2), 0.0)), spread)
        lowest, highest = np.minimum(lowest, -whole[2:]), np.maximum(highest, whole[:2])
    return lowest, highest


def _swept(body: Array, spread: float) -> Array:
    """How far corners (K, 2), turned by up to ``spread`` either way, reach along x, y, -x and -y (4,)."""
    radius, angle = np.hypot(body[:, 0], body[:, 1]), np.arctan2(body[:, 1], body[:, 0])
    # a corner sweeps an arc; its extreme along an axis is inside the arc or at one end
    reach = []
    for axis in (0.0, np.pi / 2, np.pi, -np.pi / 2):
        off = np.abs((angle - axis + np.pi) % (2 * np.pi) - np.pi)
        reach.append(float(np.max(radius * np.cos(np.maximum(off - spread, 0.0)))))
    return np.array(reach)


def off_centre(shape: Any) -> bool:
    """Whether a body is not centred on its position, so that where it turns about makes a difference."""
    return any(float(np.hypot(*_center_of(part))) > _OFF_CENTRE for part in _parts(shape))


def occupied(shape: Any) -> Placed:
    """An occupancy that is given in the plane."""
    placed = place(shape, np.zeros(2), 0.0, np.nan)
    if placed.rectangle:
        return placed._replace(state=(placed.rectangle[0], placed.rectangle[1], np.nan, np.nan))
    if placed.circle:
        return placed._replace(state=(placed.circle[0], placed.circle[1], np.nan, np.nan))
    middle = np.mean(np.concatenate(placed.polygons or ()), axis=0)
    return placed._replace(state=(float(middle[0]), float(middle[1]), np.nan, np.nan))


def polygons_of(item: Placed) -> tuple[Array, ...]:
    """Convex outlines of an occupancy; circles circumscribed."""
    if item.rectangle:
        return (_box(item.rectangle[:2], item.rectangle[2], item.rectangle[3:]),)
    if item.circle:
        return (_ring(item.circle[:2], item.circle[2]),)
    return item.polygons or ()


def union(first: Placed, second: Placed) -> Placed:
    """Both occupancies; what is in both counts once."""
    if not (first.polygons or second.polygons) and first == second:
        return first
    own = polygons_of(first)
    added = tuple(p for p in polygons_of(second) if not any(np.array_equal(p, q) for q in own))
    return Placed(None, None, own + added, second.state)


def subdivided(corners: Array) -> Array:
    """Outline of a polygon with points at most 2 m apart."""
    step = np.roll(corners, -1, axis=0) - corners
    count = np.maximum(np.ceil(np.hypot(step[:, 0], step[:, 1]) / _EDGE), 1).astype(int)
    pieces = [c + np.arange(n)[:, None] / n * d for c, n, d in zip(corners, count, step, strict=True)]
    return np.concatenate(pieces)
