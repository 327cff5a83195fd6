"""First contact with convex polygons in continuous time; the same advancement, one pair at a time."""

from __future__ import annotations

import cmath

import numpy as np

from repair.arrays import Array, Points
from repair.world.advance import FINEST, Motions
from repair.world.touching import TOUCH

__all__ = ["first_polygon_touch", "polygon_gap"]


def first_polygon_touch(pairs: Motions, i: int, parts: tuple[Array, ...], half: complex) -> float | None:
    """Time [s] of the first contact of one pair, None where there is none.

    Parameters
    ----------
    pairs : Motions
    i : int
        The pair.
    parts : tuple of (V, 2) arrays
        Convex polygons, seen from the pose of the shape.
    half : complex
        Half length + i half width of the ego [m].
    """
    outlines = [part[:, 0] + 1j * part[:, 1] for part in parts]
    reach = max((float(np.abs(outline).max()) for outline in outlines), default=0.0)
    start, span = float(pairs.start[i]), float(pairs.end[i] - pairs.start[i])
    ego, ego_way = complex(pairs.ego[i]), complex(pairs.ego_end[i] - pairs.ego[i])
    shape, way = complex(pairs.shape[i]), complex(pairs.shape_end[i] - pairs.shape[i])
    turn, ego_turn = float(pairs.turn[i]), float(pairs.turn_end[i] - pairs.turn[i])
    heading, shape_turn = float(pairs.heading[i]), float(pairs.heading_end[i] - pairs.heading[i])
    pieces = [(0.0, 1.0)]
    while pieces:
        low, high = pieces.pop()
        share, part = 0.5 * (low + high), 0.5 * (high - low)
        axis = cmath.exp(1j * (turn + share * ego_turn))
        placed = cmath.exp(1j * (heading + share * shape_turn))
        apart = shape + share * way - ego - share * ego_way
        loose = part * (abs(half) * abs(ego_turn) + reach * abs(shape_turn)) + float(pairs.spare[i])
        moved = part * (way - ego_way)
        if all(
            gap - most > TOUCH + loose
            for gap, most in (
                polygon_gap(outline * placed + apart, axis, half, moved) for outline in outlines
            )
        ):
            continue
        if (high - low) * span <= FINEST:
            return start + low * span
        pieces += [(share, high), (low, share)]  # the earlier one is looked at first
    return None


def polygon_gap(corners: Points, axis: complex, half: complex, moved: complex) -> tuple[float, float]:
    """Gap between the ego and a convex polygon along the axis that leaves most, and how much of it may go.

    Parameters
    ----------
    corners : (V,) complex array
        Seen from the ego's middle [m].
    axis : complex
        The ego's direction, of unit length.
    half : complex
        Half length + i half width of the ego [m].
    moved : complex
        How far the polygon moves against the ego [m].
    """
    points = corners * axis.conjugate()
    edges = np.roll(points, -1) - points
    edges = edges[np.abs(edges) > 0.0]
    normals = np.concatenate((np.array([1.0, 1j]), -1j * edges / np.abs(edges)))
    projected = (points[:, None] * normals.conj()).real
    reach = np.abs(normals.real) * half.real + np.abs(normals.imag) * half.imag
    gaps = np.maximum(projected.min(axis=0) - reach, -reach - projected.max(axis=0))
    most = np.abs((moved * axis.conjugate() * normals.conj()).real)
    best = int(np.argmax(gaps - most))
    return float(gaps[best]), float(most[best])
