"""Lanes that are drawn against the direction in which they are driven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from repair.arrays import Array, wrap
from repair.scene.road.goal import point_of
from repair.scene.road.lanes import Lane, lanes_of, locate

__all__ = ["as_driven", "backwards", "driven_lanes", "linked"]

_CLEAR = 1.0  # one end has to be so much nearer to what follows than the other [m]
_AGAINST = np.deg2rad(45.0)  # a heading this near to the opposite of a lane's is against it
_BESIDE = 5.0  # a lane that fits the heading is preferred so far away [m]


def driven_lanes(network: Any, position: Array, heading: float) -> tuple[dict[int, Lane], list[str]]:
    """The lanes of a CommonRoad network, in the directions in which they are driven; and what was turned.

    Parameters
    ----------
    network : commonroad.scenario.lanelet.LaneletNetwork
    position : (2,) array
        Of the ego [m].
    heading : float
        Of the ego [rad].

    Raises
    ------
    ScenarioError
        As :func:`repair.scene.road.lanes.lanes_of`.
    """
    lanes, notes = lanes_of(network)
    lanes, turned = linked(lanes)
    lanes, against = as_driven(lanes, position, heading)
    return lanes, [*notes, *turned, *against]


def backwards(lane: Lane, *, links: bool = False) -> Lane:
    """A lane as who drives the other way sees it; its successors and predecessors are exchanged or not."""
    turned = replace(lane, center=lane.center[::-1], left=lane.right[::-1], right=lane.left[::-1])
    return replace(turned, successors=lane.predecessors, predecessors=lane.successors) if links else turned


def linked(lanes: Mapping[int, Lane]) -> tuple[dict[int, Lane], list[str]]:
    """Lanes whose points are listed against their own links, turned around.

    Such a lane begins where its successors are and ends where its predecessors are.

    Returns
    -------
    lanes : dict
    notes : list of str
        Which were turned.
    """
    turned = [name for name, lane in lanes.items() if _disagrees(lane, lanes)]
    notes = [
        f"lanelet {name} is drawn against its successors and predecessors; it is turned around"
        for name in turned
    ]
    return {name: backwards(lane) if name in turned else lane for name, lane in lanes.items()}, notes


def _disagrees(lane: Lane, lanes: Mapping[int, Lane]) -> bool:
    (ax, ay), (bx, by) = lane.center[0].tolist(), lane.center[-1].tolist()
    votes = 0.0
    for names, sign in ((lane.successors, 1.0), (lane.predecessors, -1.0)):
        for name in names:
            if name not in lanes or name == lane.id:
                continue
            ends = lanes[name].center[[0, -1]].tolist()
            start = min((x - ax) ** 2 + (y - ay) ** 2 for x, y in ends)
            end = min((x - bx) ** 2 + (y - by) ** 2 for x, y in ends)
            if max(start, end) > _CLEAR**2 + min(start, end):
                votes += sign * (1.0 if end < start else -1.0)
    return votes < 0.0


def as_driven(
    lanes: Mapping[int, Lane], position: Array, heading: float
) -> tuple[dict[int, Lane], list[str]]:
    """The lanes as the ego drives them: all turned around where it drives against every one that it is on.

    Parameters
    ----------
    lanes : mapping
    position : (2,) array
        Of the ego [m].
    heading : float
        Of the ego [rad].

    Returns
    -------
    lanes : dict
    notes : list of str
    """
    import shapely

    ids = list(lanes)
    distance = shapely.distance(np.array([lanes[i].polygon for i in ids]), point_of(position))
    on = [ids[k] for k in np.flatnonzero(distance <= 0.05)]
    off = {
        ids[k]: abs(float(wrap(heading - locate(lanes[ids[k]].center, position)[2])))
        for k in np.flatnonzero(distance <= _BESIDE)
    }
    if not on or min(off[i] for i in on) <= np.pi - _AGAINST or min(off.values()) <= 2.0 * _AGAINST:
        return dict(lanes), []
    note = (
        f"the ego drives against lanelet {on[0]}, and none beside it runs its way: all lanelets are taken to "
        "run against the direction in which they are drawn"
    )
    return {name: backwards(lane, links=True) for name, lane in lanes.items()}, [note]
