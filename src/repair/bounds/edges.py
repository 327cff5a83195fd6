"""What is no road, as convex pieces: the body must not meet them, as if they were obstacles that stand."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np

from repair.arrays import Array

__all__ = ["no_road"]

_APART = 0.05  # pieces keep this far from the road [m]
_BESIDE = 2.0  # how far beyond what is looked at the road is known [m]
_SMALL = 0.1  # pieces of less than this are left out [m²]
_COARSE = 0.05  # by how much outlines are simplified [m]
_INWARDS = 1e-3  # by how much pieces are smaller than what was found to be no road [m]


def no_road(region: Any, lanelets: Iterable[Any], centre: Array, around: float, margin: float) -> list[Array]:
    """Convex pieces (K, 2) of what is no road, anticlockwise [m].

    Parameters
    ----------
    region : shapely geometry
        The road.
    lanelets : iterable of commonroad.scenario.lanelet.Lanelet
        Road too for a proof, however they are drawn.
    centre : (2,) array
        Looked at is a square about it [m].
    around : float
        Half of its side [m].
    margin : float
        How far the pieces keep from the road, and more: the safety margin around the body, which does not
        count at the edge of the road, is taken off them [m].
    """
    import shapely

    square = shapely.box(*(centre - around), *(centre + around))
    wide = shapely.buffer(square, _BESIDE)
    rings = (np.concatenate((a.left_vertices, a.right_vertices[::-1]))[:, :2] for a in lanelets)
    near_by = (ring for ring in rings if len(ring) > 2 and _reaches(ring, centre, around + _BESIDE))
    drawn = [shapely.make_valid(shapely.Polygon(ring)) for ring in near_by]
    near = shapely.union_all(shapely.intersection(np.array([region, *drawn]), wide))
    kept = shapely.buffer(near, margin + _APART)
    outside = shapely.difference(square, shapely.simplify(shapely.buffer(kept, _COARSE), _COARSE))
    shapely.prepare(kept)
    made = []
    for part in shapely.get_parts(outside):
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(part))
        made += _joined([t for t in triangles if shapely.area(t) > 1e-6], kept)
    pieces: list[Array] = []
    for piece in made:
        inner = shapely.buffer(piece, -_INWARDS, join_style="mitre")
        if inner.geom_type == "Polygon" and shapely.area(inner) > _SMALL:
            ring = shapely.get_coordinates(shapely.normalize(inner).exterior)[:-1][::-1]
            pieces.append(np.asarray(ring, dtype=np.float64))
    return pieces


def _reaches(ring: Array, centre: Array, around: float) -> bool:
    """Whether the box around a ring (K, 2) meets a square."""
    low, high = ring.min(axis=0), ring.max(axis=0)
    return bool((low <= centre + around).all() and (high >= centre - around).all())


def _joined(pieces: list[Any], kept: Any) -> list[Any]:
    """Neighbours joined to their hull wherever that keeps from the road, the largest first."""
    import shapely

    beside = _neighbours(pieces)
    alive = dict(enumerate(pieces))
    queue = deque(sorted(alive, key=lambda k: -float(shapely.area(alive[k]))))
    while queue:
        k = queue.popleft()
        if k not in alive:
            continue
        for other in sorted(beside[k], key=lambda j: -float(shapely.area(alive[j]))):
            hull = shapely.convex_hull(shapely.union(alive[k], alive[other]))
            if shapely.intersects(kept, hull):
                continue
            alive[k] = hull
            del alive[other]
            for j in beside.pop(other):
                beside[j].discard(other)
                if j != k:
                    beside[j].add(k)
                    beside[k].add(j)
            queue.appendleft(k)
            break
    return list(alive.values())


def _neighbours(triangles: list[Any]) -> dict[int, set[int]]:
    """Which triangles have a side in common."""
    import shapely

    by_side: dict[frozenset[tuple[float, float]], list[int]] = {}
    for k, triangle in enumerate(triangles):
        corners = [tuple(c) for c in np.round(shapely.get_coordinates(triangle), 6).tolist()[:-1]]
        for i in range(3):
            by_side.setdefault(frozenset((corners[i - 1], corners[i])), []).append(k)
    beside: dict[int, set[int]] = {k: set() for k in range(len(triangles))}
    for pair in by_side.values():
        if len(pair) == 2:
            beside[pair[0]].add(pair[1])
            beside[pair[1]].add(pair[0])
    return beside
