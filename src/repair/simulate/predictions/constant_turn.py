"""Along a circle, at the speed of now."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from repair.arrays import wrap
from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.predictions.base import Known, motion_of, moved

__all__ = ["ConstantTurn"]

_OVER = 0.3  # the rate of turning is that of the last so many seconds: a recording's headings are rounded
_STRAIGHT = 1e-4  # [rad/s]


@dataclass(frozen=True)
class ConstantTurn:
    """Constant turn rate and velocity (CTRV).

    Schubert, Richter and Wanielik, *Comparison and evaluation of advanced motion models for vehicle
    tracking*, FUSION 2008, eq. 4. Who was seen once only is taken to go straight on.
    """

    at_the_speed_of_now: ClassVar[bool] = True

    def predict(self, known: Known) -> Obstacle | None:
        """From the last 0.3 s."""
        centre, heading, speed = motion_of(known.past, known.dt)
        rate, t = self._rate(known), known.times
        turned = rate * t
        if abs(rate) < _STRAIGHT:
            along, aside = speed * t, np.zeros_like(t)
        else:
            along, aside = speed / rate * np.sin(turned), speed / rate * (1.0 - np.cos(turned))
        cos, sin = np.cos(heading), np.sin(heading)
        way = np.column_stack([cos * along - sin * aside, sin * along + cos * aside])
        return moved(known.past, centre + way, turned, known.dt)

    @staticmethod
    def _rate(known: Known) -> float:
        """Rate of turning [rad/s]."""
        headings = known.past.states[:, 2]
        back = min(max(round(_OVER / known.dt), 1), len(headings) - 1)
        while back > 0 and not np.isfinite(headings[-1 - back]):
            back -= 1
        if back < 1 or not np.isfinite(headings[-1]):
            return 0.0
        return float(wrap(headings[-1] - headings[-1 - back])) / (back * known.dt)
