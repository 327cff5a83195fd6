"""The edge of the road for one scene, taken over from another one where it is the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from repair.world.road import RoadBoundary
from repair.world.road_corridor import RoadCorridor

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame
    from repair.scene.scene import Scene
    from repair.vehicle.parameters import Vehicle

__all__ = ["RoadEdge", "road_edge"]


@dataclass(frozen=True)
class RoadEdge:
    """The edge, what is known of it along a frame, and of what it was made."""

    boundary: RoadBoundary
    corridor: RoadCorridor
    network: Any
    frame: FrenetFrame
    vehicle: Vehicle
    gap: float


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
