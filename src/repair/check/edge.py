"""The edge of the road for one scene, taken over from another one where it is the same."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array, Points
from repair.check.verdict import Later, Reason, Violation
from repair.world.road import RoadBoundary
from repair.world.road_corridor import RoadCorridor

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame
    from repair.scene.scene import Scene
    from repair.vehicle.parameters import Vehicle

__all__ = ["RoadEdge", "off_road", "road_edge"]


@dataclass(frozen=True)
class RoadEdge:
    """The edge, what is known of it along a frame, and of what it was made."""

    boundary: RoadBoundary
    corridor: RoadCorridor
    network: Any
    frame: FrenetFrame
    vehicle: Vehicle
    gap: float

    def left_at(self, s: Array, centre: Points, orientation: Array) -> int | None:
        """Index of the first pose that is not on the road; asked about are those the corridor leaves.

        Parameters
        ----------
        s, centre, orientation
            (K,) arrays, as in :meth:`repair.world.road_corridor.RoadCorridor.holds`.
        """
        held = self.corridor.holds(s, centre, orientation)
        if np.count_nonzero(held) == len(held):
            return None
        unsure = np.flatnonzero(~held)
        left = centre[unsure]
        index = self.boundary.first_off_road(left.real, left.imag, orientation[unsure])
        return None if index is None else int(unsure[index])


def road_edge(scene: Scene, gap: float, like: RoadEdge | None = None) -> RoadEdge:
    """The edge of a scene's road.

    Parameters
    ----------
    scene : Scene
    gap : float
        Gaps up to this width are road [m].
    like : RoadEdge, optional
        Another scene's: its region is taken over where map, vehicle and gap are the same, and all of it where
        the frame is, too.
    """
    network, vehicle = scene.scenario.lanelet_network, scene.vehicle
    same = like is not None and like.network is network and like.vehicle == vehicle and like.gap == gap
    if same and like is not None and like.frame is scene.frame:
        return like
    boundary = like.boundary if same and like is not None else RoadBoundary(scene.scenario, vehicle, gap)
    return RoadEdge(
        boundary, RoadCorridor(boundary, scene.frame, vehicle), network, scene.frame, vehicle, gap
    )


def off_road(scene: Scene, road: RoadBoundary, time: float, centre: complex, orientation: float) -> Violation:
    """A pose that is off the road; where it leaves it, and by how much, is worked out when it is read.

    Parameters
    ----------
    scene : Scene
    road : RoadBoundary
        Its road.
    time : float
        [s].
    centre : complex
        x + iy [m].
    orientation : float
        [rad].
    """
    return Later(Reason.OFF_ROAD, partial(_departure, scene, road, time, centre, orientation))


def _departure(
    scene: Scene, road: RoadBoundary, time: float, centre: complex, orientation: float
) -> Violation:
    words, place = road.departure(centre.real, centre.imag, orientation)
    return Violation(Reason.OFF_ROAD, time, words + scene.ending_at(place), place=place)
