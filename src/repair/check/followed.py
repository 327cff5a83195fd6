"""A path that is followed, as the checker keeps it: dense samples and what is known along them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, wrap
from repair.curves.base import Curve, FrenetTrajectory
from repair.curves.plane import STANDSTILL

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.scene.scene import Scene

__all__ = ["Followed", "is_finite", "motion_of", "slip_at_start"]

# The body begins as the planning problem has it where that of steady driving is off by more than the one and
# less than the other [rad]; beyond, the path says something else about the start than the problem.
_UNSTEADY, _STATED = 0.003, 0.03


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
        rates = self.motion[2, : step * substeps + 1 : substeps]
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


def slip_at_start(scene: Scene, path: CartesianPath) -> float | None:
    """Slip angle at t = 0 where the body's orientation is known; None for that of steady driving.

    It is where a reference states it, and where the vehicle stands: of a path that stands the direction is
    held, so that it says nothing about the body's.
    """
    stated, begins = scene.first_heading, len(path.speed) > 0
    if stated is not None and begins:
        return float(wrap(path.heading[0] - stated))
    body = scene.initial_state.orientation
    if begins and abs(float(path.speed[0])) < STANDSTILL:
        return float(wrap(path.heading[0] - body))
    if len(path.speed) > 1:  # where a path begins in a bend that changes, no steady driving fits it
        _, orientation = scene.model.angles(path, None)
        if _UNSTEADY < abs(float(wrap(orientation[0] - body))) < _STATED:
            return float(wrap(path.heading[0] - body))
    return None
