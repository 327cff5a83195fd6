"""A path that is followed, as the checker keeps it: dense samples and what is known along them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.curves.base import Curve, FrenetTrajectory
from repair.curves.plane import STANDSTILL

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.vehicle.model import VehicleModel

__all__ = ["Followed", "angles_along", "begins_apart", "is_finite", "motion_of"]

_PLACE_OFF, _SPEED_OFF = 0.05, 0.2  # farther from the state that it has [m], [m/s] nobody begins


@dataclass(frozen=True)
class Followed:
    """The reference at all dense samples until ``t_end``; every check follows it for a step or two.

    Attributes
    ----------
    reference : Curve
    t_end : float
        [s].
    motion : (4, K) array
        s, l [m] and their rates [m/s].
    slip : (K,) array
        Slip angle at the centre [rad].
    heading : float
        Of the path at the start [rad].
    """

    reference: Curve
    t_end: float
    motion: Array
    slip: Array
    heading: float

    def moving(self, step: int, substeps: int) -> int:
        """The dense sample of the last step until ``step`` at which the vehicle moves, or the first one.

        A path that begins at rest does not say how the body stands.
        """
        last = step * substeps
        if abs(self.motion.item(2, last)) > 2.0 * STANDSTILL:
            return last
        rates = self.motion[2, : last + 1 : substeps]
        moving = np.flatnonzero(np.abs(rates) > 2.0 * STANDSTILL)
        return int(moving[-1]) * substeps if len(moving) else 0


def motion_of(trajectory: FrenetTrajectory, count: int) -> Array:
    """The last of ``count`` samples of s, l and their rates (4, count); those before are left open."""
    motion = np.empty((4, count))
    start = count - len(trajectory)
    motion[:2, start:], motion[2:, start:] = trajectory.position.T, trajectory.velocity.T
    return motion


def is_finite(path: CartesianPath) -> bool:
    """Whether all of a path is."""
    # A point or a heading that is not finite would make the longest step or the sharpest turn so.
    if len(path.t) > 1 and math.isfinite(path.longest + path.sharpest + path.speed.dot(path.speed)):
        return True
    return all(bool(np.isfinite(column).all()) for column in (path.xy, path.heading, path.speed))


def angles_along(model: VehicleModel, path: CartesianPath, slip0: float | None) -> tuple[Array, Array] | None:
    """Slip angle and orientation (K,) [rad] along a path; None where that, or one of these, is not finite."""
    if not is_finite(path):
        return None
    slip, orientation = model.angles(path, slip0)
    # Going back fast, the slip angle grows.
    return (slip, orientation) if math.isfinite(orientation.dot(orientation)) else None


def begins_apart(curve: FrenetTrajectory, start: Array) -> str:
    """How samples of a curve miss the state (3, 2) that it has to begin in, in words; empty where not."""
    place, speed = (
        float(np.abs(column[0] - state).max())
        for column, state in zip((curve.position, curve.velocity), start, strict=False)
    )
    if place > _PLACE_OFF:
        return f"begins {place:.2f} m from where the vehicle is"
    return f"begins with a speed that is off by {speed:.2f} m/s" if speed > _SPEED_OFF else ""
