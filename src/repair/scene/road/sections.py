"""Lane sections of a map: a lanelet with all its lateral neighbours, and the outline around them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.arrays import Array

__all__ = ["outlines"]


def outlines(network: Any, *, sections_alone: bool = False) -> list[Any]:
    """What is road as drawn: the sections, and each lanelet of those whose outline crosses itself.

    Where neighbours differ in length or bend away from each other the ring around them may cross itself, and
    what it encloses is then no longer all of them.
    """
    import shapely

    lanelets, found = {lanelet.lanelet_id: lanelet for lanelet in network.lanelets}, []
    for members, outline in _sections(network):
        section = shapely.Polygon(outline) if len(outline) > 2 else shapely.Polygon()
        found.append(section if section.is_valid else section.buffer(0))
        if not section.is_valid and not sections_alone:
            lanes = [lanelets[member] for member in members]
            rings = [np.concatenate([x.left_vertices, x.right_vertices[::-1]])[:, :2] for x in lanes]
            # One whose left bound lies on its right is no lanelet: the drivability checker has no road there.
            proper = [
                ring for ring in rings if len(ring) > 2 and not shapely.is_ccw(shapely.LinearRing(ring))
            ]
            found += [shapely.make_valid(shapely.Polygon(ring)) for ring in proper]
    return found


def _sections(network: Any) -> list[tuple[list[int], Array]]:
    """Every lane section, a lanelet with its lateral neighbours: who is in it, and its outline (V, 2)."""
    lanelets = {lanelet.lanelet_id: lanelet for lanelet in network.lanelets}
    left_over = dict.fromkeys(lanelets)
    found = []
    while left_over:
        first, _ = left_over.popitem()
        start = _neighbours(lanelets, first, True, to_the_left=False)[-1]
        chain = _neighbours(lanelets, *start, to_the_left=True)
        for member, _ in chain:
            left_over.pop(member, None)
        lines = [_bound(lanelets[chain[0][0]], chain[0][1], left=False)]
        lines += [_bound(lanelets[member], forward, left=True) for member, forward in chain]
        ends = np.array([line[-1] for line in lines[1:-1]]).reshape(-1, 2)
        starts = np.array([line[0] for line in lines[-2:0:-1]]).reshape(-1, 2)
        outline = np.concatenate((lines[0], ends, lines[-1][::-1], starts))
        found.append(([member for member, _ in chain], outline))
    return found


def _neighbours(
    lanelets: Mapping[int, Any], lanelet_id: int, forward: bool, to_the_left: bool
) -> list[tuple[int, bool]]:
    """The lanelet and those beside it on one side, each with whether it runs in the chain's direction."""
    chain = [(lanelet_id, forward)]
    seen = {lanelet_id}
    while True:
        lanelet = lanelets[lanelet_id]
        if forward == to_the_left:
            lanelet_id, same = lanelet.adj_left, lanelet.adj_left_same_direction
        else:
            lanelet_id, same = lanelet.adj_right, lanelet.adj_right_same_direction
        if lanelet_id not in lanelets or lanelet_id in seen:
            return chain
        forward = forward == bool(same)
        chain.append((lanelet_id, forward))
        seen.add(lanelet_id)


def _bound(lanelet: Any, forward: bool, left: bool) -> Array:
    """Left or right bound (V, 2) of a lanelet, seen and ordered along the chain's direction."""
    vertices = lanelet.left_vertices if left == forward else lanelet.right_vertices
    return np.asarray(vertices[:: 1 if forward else -1, :2], dtype=np.float64)
