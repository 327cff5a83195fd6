"""The lanelets of a map as lanes, and where points lie on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from repair.arrays import Array, frozen
from repair.errors import ScenarioError
from repair.scene.traffic.shapes import FAR

__all__ = ["Lane", "lanes_of", "locate"]

_NOT_FOR_CARS = frozenset({"sidewalk", "bicycleLane", "crosswalk", "busStop", "border"})


@dataclass(frozen=True)
class Lane:
    """A lanelet with what routing needs.

    Attributes
    ----------
    id : int
    center, left, right : (M, 2) array
        Centre line and bounds [m].
    length : float
        Of the centre line [m].
    successors, predecessors : tuple of int
    neighbours : tuple of int
        Those of the same direction only.
    drivable : bool
        False for sidewalks and their like.
    polygon : shapely geometry
        The area.
    """

    id: int
    center: Array
    left: Array
    right: Array
    length: float
    successors: tuple[int, ...]
    predecessors: tuple[int, ...]
    neighbours: tuple[int, ...]
    drivable: bool
    polygon: Any


def lanes_of(network: Any) -> tuple[dict[int, Lane], list[str]]:
    """Read the lanelets of a CommonRoad network.

    Returns
    -------
    lanes : dict
        By id.
    notes : list of str
        Which lanelets were left out, and why; and which have their left bound on their right.

    Raises
    ------
    ScenarioError
        If there is no usable lanelet or one has a vertex that is not finite.
    """
    import shapely

    lanes: dict[int, Lane] = {}
    notes: list[str] = []
    for lanelet in network.lanelets:
        name = int(lanelet.lanelet_id)
        left, center, right = (
            np.asarray(v, dtype=np.float64)[:, :2]
            for v in (lanelet.left_vertices, lanelet.center_vertices, lanelet.right_vertices)
        )
        if not all(np.isfinite(v).all() for v in (left, center, right)):
            raise ScenarioError(f"lanelet {name} has a vertex that is not finite")
        if not all((np.abs(v) <= FAR).all() for v in (left, center, right)):
            raise ScenarioError(f"lanelet {name} has a vertex farther than {FAR:g} m out")
        length = float(np.sum(np.hypot(*np.diff(center, axis=0).T)))
        if length < 0.05:
            notes.append(f"lanelet {name} has no length and is ignored")
            continue
        neighbours = []
        if lanelet.adj_left is not None and lanelet.adj_left_same_direction:
            neighbours.append(int(lanelet.adj_left))
        if lanelet.adj_right is not None and lanelet.adj_right_same_direction:
            neighbours.append(int(lanelet.adj_right))
        kinds = {kind.value for kind in (lanelet.lanelet_type or ())}
        outline = shapely.Polygon(np.concatenate([left, right[::-1]]))
        if outline.is_valid and outline.exterior.is_ccw:
            notes.append(
                f"lanelet {name} is drawn with left and right bound exchanged; "
                "the checker may see no road there"
            )
        lanes[name] = Lane(
            id=name,
            center=frozen(center),
            left=frozen(left),
            right=frozen(right),
            length=length,
            successors=tuple(int(i) for i in lanelet.successor or ()),
            predecessors=tuple(int(i) for i in lanelet.predecessor or ()),
            neighbours=tuple(neighbours),
            drivable=not kinds & _NOT_FOR_CARS,
            polygon=outline if outline.is_valid else shapely.make_valid(outline),
        )
    if not lanes:
        raise ScenarioError("the scenario has no lanelet that could be driven on")
    return lanes, notes


def locate(line: Array, point: Array) -> tuple[float, float, float]:
    """Where the point of a polyline (M, 2) that is nearest to ``point`` (2,) lies.

    Returns
    -------
    arc, offset, heading : float
        Arc length along the line [m], offset of ``point`` (left positive) [m], heading there [rad].
    """
    start, step = line[:-1], np.diff(line, axis=0)
    square = np.maximum(np.sum(step**2, axis=1), 1e-12)
    along = np.clip(np.sum((point - start) * step, axis=1) / square, 0.0, 1.0)
    gap = point - start - along[:, None] * step
    index = int(np.argmin(np.sum(gap**2, axis=1)))
    length = np.sqrt(square)
    cross = step[index, 0] * gap[index, 1] - step[index, 1] * gap[index, 0]
    arc = float(np.sum(length[:index]) + along[index] * length[index])
    heading = float(np.arctan2(step[index, 1], step[index, 0]))
    return arc, float(np.copysign(np.hypot(*gap[index]), cross)), heading
