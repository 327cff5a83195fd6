"""A reference that is driven more slowly from the start on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from repair.arrays import frozen
from repair.curves.base import Curve, FrenetTrajectory
from repair.scene.scene import Scene

__all__ = ["Slower", "slower_start"]


@dataclass(frozen=True)
class Slower:
    """The same path at a share of the speed: what was there at the time ``share * t`` is there at t.

    Attributes
    ----------
    curve : Curve
    share : float
        Above 0, 1 at most.
    """

    curve: Curve
    share: float

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        return self.curve.t_start

    @property
    def t_end(self) -> float:
        """End of the span [s]: that of the curve, whose last part is not reached until then."""
        return self.curve.t_end

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """See :meth:`repair.curves.base.Curve.sample`."""
        times = np.asarray(t, dtype=np.float64)
        was, c = self.curve.sample(self.share * times), self.share
        return FrenetTrajectory(
            times, was.position, c * was.velocity, c**2 * was.acceleration, c**3 * was.jerk
        )


def slower_start(scene: Scene, share: float) -> Scene:
    """The scene with the ego at a share of its speed in the beginning."""
    start, initial = scene.start, scene.initial_state
    return replace(
        scene,
        start=frozen([start[0], share * start[1], share**2 * start[2]]),
        initial_state=replace(
            initial,
            velocity=share * initial.velocity,
            acceleration=share**2 * initial.acceleration,
            yaw_rate=share * initial.yaw_rate,
        ),
    )
