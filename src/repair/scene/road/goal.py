"""Where a planning problem wants to go: areas and groups of lanelets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError
from repair.scene.road.lanes import Lane
from repair.scene.traffic.shapes import FAR

__all__ = ["goal_areas", "goal_groups", "point_of"]


def goal_areas(goal: Any) -> list[Any]:
    """The goal's positions as shapely polygons.

    Raises
    ------
    ScenarioError
        If one has a vertex that is not finite or out of the world.
    """
    found = []
    for state in goal.state_list:
        if not state.has_value("position"):
            continue
        for shape in getattr(state.position, "shapes", [state.position]):
            if not hasattr(type(shape), "shapely_object"):  # a point
                continue
            if not (np.abs(getattr(shape, "vertices", shape.center)) <= FAR).all():
                raise ScenarioError(
                    f"the goal region has a vertex that is not finite or farther than {FAR:g} m out"
                )
            found.append(shape.shapely_object)
    return found


def goal_groups(goal: Any, lanes: Mapping[int, Lane]) -> list[set[int]]:
    """Goal lanelets, best knowledge first: ids given, lanelets at the shapes' centres, those touched."""
    import shapely

    named: set[int] = set()
    for ids in (goal.lanelets_of_goal_position or {}).values():
        named.update(i for i in ids if i in lanes)
    groups = [named] if named else []
    areas = goal_areas(goal)
    if areas and not named:
        centres = [a.centroid for a in areas]
        drivable = [lane for lane in lanes.values() if lane.drivable]
        for targets in (centres, areas):
            groups.append({v.id for v in drivable if any(shapely.intersects(v.polygon, t) for t in targets)})
    return [g for g in groups if g]


def point_of(position: Array) -> Any:
    """A position (2,) as a shapely point."""
    import shapely

    return shapely.Point(position)
