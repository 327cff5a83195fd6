"""Lane sections of a map: a lanelet with all its lateral neighbours, and the outline around them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.arrays import Array

__all__ = ["endless", "outlines"]


def endless(network: Any) -> bool:
    """Whether neighbours lead back to where they began, as in a map with a wrong link: it has no sections."""
    lanelets = {lanelet.lanelet_id: lanelet for lanelet in network.lanelets}
    return any(_turns_back(lanelets, first, left) for first in lanelets for left in (False, True))


def _turns_back(lanelets: Mapping[int, Any], lanelet_id: int, to_the_left: bool) -> bool:
    """Whether the way to the outermost neighbour on a side comes by a lanelet twice, in one direction."""
    forward, seen = True, set()
    while lanelet_id in lanelets:
        if (lanelet_id, forward) in seen:
            return True
        seen.add((lanelet_id, forward))
        lanelet_id, forward = _beside(lanelets[lanelet_id], forward, to_the_left)
    return False


def _beside(lanelet: Any, forward: bool, to_the_left: bool) -> tuple[Any, bool]:
    """The next lanelet on a side of the chain, and whether it runs in the chain's direction."""
    if forward == to_the_left:
        return lanelet.adj_left, forward == bool(lanelet.adj_left_same_direction)
    return lanelet.adj_right, forward == bool(lanelet.adj_right_same_direction)


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
        lanelet_id, forward = _beside(lanelets[lanelet_id], forward, to_the_left)
        if lanelet_id not in lanelets or lanelet_id in seen:
            return chain
        chain.append((lanelet_id, forward))
        seen.add(lanelet_id)


def _bound(lanelet: Any, forward: bool, left: bool) -> Array:
    """Left or right bound (V, 2) of a lanelet, seen and ordered along the chain's direction."""
    vertices = lanelet.left_vertices if left == forward else lanelet.right_vertices
    return np.asarray(vertices[:: 1 if forward else -1, :2], dtype=np.float64)
