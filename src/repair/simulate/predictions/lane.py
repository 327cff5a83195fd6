"""Along the lanelets, at the speed of now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from repair.arrays import wrap
from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.predictions.base import Known, motion_of, moved
from repair.simulate.predictions.constant_velocity import ConstantVelocity
from repair.simulate.predictions.network import Network

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
        lanes = known.lanes if isinstance(known.lanes, Network) else Network(known.lanes)
        found = None if speed <= 0.0 else lanes.beside(centre, heading, _BESIDE, _TURNED)
        if found is None:
            return ConstantVelocity().predict(known)
        (lane, arc, offset), t = found, known.times
        at, along = lanes.way(lane, arc + speed * t[-1]).at(arc + speed * t)
        normal = np.column_stack([-np.sin(along), np.cos(along)])
        centres = at + offset * normal
        centres[0] = centre
        share = np.minimum(t / _FADES, 1.0)
        turned = along - along[0] + share * float(wrap(along[0] - heading))
        return moved(known.past, centres, turned, known.dt)
