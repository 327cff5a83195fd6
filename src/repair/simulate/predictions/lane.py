"""Along the lanelets, at the speed of now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from repair.arrays import Array, wrap
from repair.scene.road.lanes import Lane, locate
from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.predictions.base import Known, motion_of, moved
from repair.simulate.predictions.constant_velocity import ConstantVelocity

__all__ = ["AlongLane"]

_BESIDE, _TURNED = (
    3.0,
    0.9,
)  # farther from a centre line, or turned from it by more, it is not this lane [m], [rad]
_FADES = 1.0  # in so much time the heading becomes that of the lane [s]


@dataclass(frozen=True)
class AlongLane:
    """Along the lanelet on which it is, and the straightest of each one's successors, at constant speed.

    The distance to the centre line is kept. Who is on no lanelet that goes its way goes straight on.
    """

    def predict(self, known: Known) -> Obstacle | None:
        """From the last row and the map."""
        centre, heading, speed = motion_of(known.past, known.dt)
        lane = self._lane(known.lanes, centre, heading)
        if lane is None or speed <= 0.0:
            return ConstantVelocity().predict(known)
        arc, offset, _ = locate(lane.center, centre)
        line = self._line(known.lanes, lane, arc + speed * known.times[-1])
        at, along = _along(line, arc + speed * known.times)
        normal = np.column_stack([-np.sin(along), np.cos(along)])
        centres = at + offset * normal
        centres[0] = centre
        share = np.clip(known.times / _FADES, 0.0, 1.0)
        aimed = np.unwrap(along) - along[0]
        turned = aimed + share * float(wrap(along[0] - heading))
        return moved(known.past, centres, turned, known.dt)

    @staticmethod
    def _lane(lanes: Mapping[int, Lane], centre: Array, heading: float) -> Lane | None:
        """The lanelet whose centre line is nearest among those that go the obstacle's way."""
        best, nearest = None, _BESIDE
        for lane in lanes.values():
            low, high = lane.center.min(axis=0) - _BESIDE, lane.center.max(axis=0) + _BESIDE
            if not ((low <= centre) & (centre <= high)).all():
                continue
            _, offset, along = locate(lane.center, centre)
            if abs(offset) < nearest and abs(float(wrap(along - heading))) < _TURNED:
                best, nearest = lane, abs(offset)
        return best

    @staticmethod
    def _line(lanes: Mapping[int, Lane], lane: Lane, until: float) -> Array:
        """Centre line from a lanelet's beginning on, at least so long where the map goes on [m]."""
        line, length, seen = lane.center, lane.length, {lane.id}
        while length < until:
            after = [lanes[i] for i in lane.successors if i in lanes and i not in seen]
            if not after:
                break
            end = np.arctan2(*(line[-1] - line[-2])[::-1])
            lane = min(after, key=lambda one: abs(float(wrap(_overall(one.center) - end))))
            seen.add(lane.id)
            line, length = np.concatenate([line, lane.center]), length + lane.length
        kept = np.append(True, np.hypot(*np.diff(line, axis=0).T) > 1e-6)
        return np.asarray(line[kept])


def _overall(line: Array) -> float:
    """Heading at a line's end [rad]: where it leads to."""
    return float(np.arctan2(*(line[-1] - line[-2])[::-1]))


def _along(line: Array, arcs: Array) -> tuple[Array, Array]:
    """Points (T, 2) and headings (T,) of a polyline at arc lengths; beyond its end it goes straight on."""
    step = np.diff(line, axis=0)
    length = np.hypot(*step.T)
    reached = np.append(0.0, np.cumsum(length))
    index = np.clip(np.searchsorted(reached, arcs, side="right") - 1, 0, len(length) - 1)
    unit = step / length[:, None]
    points = line[index] + (arcs - reached[index])[:, None] * unit[index]
    middles = 0.5 * (reached[1:] + reached[:-1])
    headings = np.unwrap(np.arctan2(unit[:, 1], unit[:, 0]))
    return points, np.interp(arcs, middles, headings)
