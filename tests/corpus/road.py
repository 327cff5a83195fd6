"""The road by shapely alone: the lanelets' outlines, gaps up to a stated width closed."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from tests.judge import Ego, ego_boxes

__all__ = ["Road", "lane_drive"]

_TOUCH = 1e-6  # [m]


class Road:
    """What a scenario's lanelets cover.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    gap : float
        Gaps and holes up to this width [m] are road.
    """

    def __init__(self, scenario: Any, gap: float) -> None:
        outlines = []
        for lane in scenario.lanelet_network.lanelets:
            points = np.concatenate([lane.left_vertices[:, :2], lane.right_vertices[::-1, :2]])
            outlines.append(shapely.make_valid(shapely.Polygon(points)))
        half = 0.5 * gap + _TOUCH
        wide = shapely.union_all([shapely.buffer(o, half) for o in outlines])
        self.region = shapely.union_all([*outlines, shapely.buffer(wide, -half)])
        self._within = shapely.buffer(self.region, -_TOUCH)
        shapely.prepare(self._within)

    def inside(self, ego: Ego) -> np.ndarray:
        """Whether the ego lies properly within the road, for each of its poses (K,)."""
        return np.asarray(shapely.contains_properly(self._within, ego_boxes(ego)))

    def beyond(self, ego: Ego) -> np.ndarray:
        """How far the ego reaches out of the road, for each of its poses (K,) [m]."""
        outside = shapely.difference(ego_boxes(ego), self.region)
        far = np.zeros(len(outside))
        for k in np.flatnonzero(~shapely.is_empty(outside)):
            corners = shapely.points(shapely.get_coordinates(outside[k]))
            far[k] = float(shapely.distance(corners, self.region).max())
        return far


def lane_drive(
    scenario: Any,
    lanelets: tuple[int, ...],
    start: Any,
    speed: float,
    until: float,
    size: tuple[float, float],
) -> Ego | None:
    """The ego along the middle of its lanelets at constant speed; None where they do not go on long enough.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    lanelets : tuple of int
        One after the other.
    start : (2,) array
        Where the ego is [m].
    speed, until : float
        [m/s], [s]
    size : tuple of float
        Length and width of the ego [m].
    """
    network = scenario.lanelet_network
    lanes = [network.find_lanelet_by_id(i) for i in lanelets]
    if any(b.lanelet_id not in a.successor for a, b in pairwise(lanes)):
        return None  # a change of lanes has no middle
    points = np.concatenate([lane.center_vertices[:, :2] for lane in lanes])
    step = np.hypot(*np.diff(points, axis=0).T)
    points = points[np.concatenate([[True], step > 1e-3])]
    line = shapely.LineString(points)
    begin = line.project(shapely.Point(start))
    t = np.arange(0.0, until, 0.02)
    along = begin + speed * t
    if along[-1] + size[0] > line.length:
        return None
    places = shapely.get_coordinates(shapely.line_interpolate_point(line, along))
    reach = 0.5 * size[0]
    ahead = shapely.get_coordinates(shapely.line_interpolate_point(line, along + reach))
    behind = shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(along - reach, 0.0)))
    heading = np.arctan2(*(ahead - behind).T[::-1])
    return Ego(t, np.column_stack([places, heading]), *size)
