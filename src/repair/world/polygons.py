"""Convex polygons in continuous time: what is left of the gap to them."""

from __future__ import annotations

import numpy as np

from repair.arrays import Array, Points
from repair.world.advance import Left

__all__ = ["polygon_gap", "polygons_left"]


def polygons_left(parts: tuple[Array, ...]) -> tuple[Left, float]:
    """What is left of the gap to the nearest of convex polygons, and how far they reach [m].

    Parameters
    ----------
    parts : tuple of (V, 2) arrays
        Convex polygons, seen from the pose of the shape.
    """
    outlines = [part[:, 0] + 1j * part[:, 1] for part in parts]
    reach = max((float(np.abs(outline).max()) for outline in outlines), default=0.0)

    def left(seen: complex, moved: complex, own: complex, size: complex, half: complex) -> float:
        gaps = (polygon_gap(outline * own + seen, half, moved) for outline in outlines)
        return min((gap - most for gap, most in gaps), default=float("inf"))

    return left, reach


def polygon_gap(points: Points, half: complex, moved: complex) -> tuple[float, float]:
    """Gap between the ego and a convex polygon along the axis that leaves most, and how much of it may go.

    Parameters
    ----------
    points : (V,) complex array
        Corners, seen from the ego's middle and along its axis [m].
    half : complex
        Half length + i half width of the ego [m].
    moved : complex
        How far the polygon moves against the ego, likewise [m].
    """
    edges = np.roll(points, -1) - points
    edges = edges[np.abs(edges) > 0.0]
    normals = np.concatenate((np.array([1.0, 1j]), -1j * edges / np.abs(edges)))
    projected = (points[:, None] * normals.conj()).real
    reach = np.abs(normals.real) * half.real + np.abs(normals.imag) * half.imag
    gaps = np.maximum(projected.min(axis=0) - reach, -reach - projected.max(axis=0))
    most = np.abs((moved * normals.conj()).real)
    best = int(np.argmax(gaps - most))
    return float(gaps[best]), float(most[best])
