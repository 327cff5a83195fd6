"""Convex polygons in continuous time: what is left of the gap to them."""

from __future__ import annotations

import numpy as np

from repair.arrays import Array, Points
from repair.world.advance import Left

__all__ = ["polygons_left"]


def polygons_left(parts: tuple[Array, ...]) -> tuple[Left, float]:
    """What is left of the gap to the nearest of convex polygons, and how far they reach [m].

    The gap to each is taken along the axis that leaves most: one of the ego's two, or across an edge
    (separating axes). All polygons are looked at in one go, and how far each extends across its own edges is
    known beforehand.

    Parameters
    ----------
    parts : tuple of (V, 2) arrays
        Convex polygons, seen from the pose of the shape.
    """
    if not parts:
        return (lambda *_: float("inf")), 0.0
    outlines, normals = _laid_out([part[:, 0] + 1j * part[:, 1] for part in parts])
    across = (outlines[:, :, None] * normals.conj()[:, None, :]).real
    low, high = across.min(axis=1), across.max(axis=1)
    reach = float(np.abs(outlines).max())

    def left(seen: complex, moved: complex, own: complex, size: complex, half: complex) -> float:
        turned, placed = normals * own, outlines * own + seen
        shift = (seen * turned.conj()).real
        wide = np.abs(turned.real) * half.real + np.abs(turned.imag) * half.imag
        gaps = np.maximum(low + shift, -high - shift) - wide - np.abs((moved * turned.conj()).real)
        x = np.maximum(placed.real.min(axis=1), -placed.real.max(axis=1)) - half.real - abs(moved.real)
        y = np.maximum(placed.imag.min(axis=1), -placed.imag.max(axis=1)) - half.imag - abs(moved.imag)
        return float(np.maximum(gaps.max(axis=1), np.maximum(x, y)).min())

    return left, reach


def _laid_out(outlines: list[Points]) -> tuple[Points, Points]:
    """Corners (P, V) and normals of edges (P, V), as many for each polygon: some stand there twice."""
    most = max(map(len, outlines))
    corners = np.array([np.append(one, np.repeat(one[-1:], most - len(one))) for one in outlines])
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.abs(edges)
    normals = -1j * edges / np.where(length > 0.0, length, 1.0)
    longest = np.take_along_axis(normals, length.argmax(axis=1)[:, None], axis=1)
    return corners, np.where(length > 0.0, normals, longest)
