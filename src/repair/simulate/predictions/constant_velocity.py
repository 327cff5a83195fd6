"""Straight on, at the speed of now."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.predictions.base import Known, motion_of, moved

__all__ = ["ConstantVelocity"]


@dataclass(frozen=True)
class ConstantVelocity:
    """Constant velocity (CV): along the heading of now, at the speed of now.

    Schubert, Richter and Wanielik, *Comparison and evaluation of advanced motion models for vehicle
    tracking*, FUSION 2008.
    """

    at_the_speed_of_now: ClassVar[bool] = True

    def predict(self, known: Known) -> Obstacle | None:
        """From the last row alone."""
        centre, heading, speed = motion_of(known.past, known.dt)
        way = speed * known.times[:, None] * np.array([np.cos(heading), np.sin(heading)])
        return moved(known.past, centre + way, np.zeros(known.n_steps + 1), known.dt)
