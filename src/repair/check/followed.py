"""A path that is followed, as the checker keeps it: dense samples and what is known along them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, wrap
from repair.check.verdict import Reason, Violation
from repair.curves.base import Curve, FrenetTrajectory
from repair.curves.plane import STANDSTILL
from repair.timegrid import steps_until

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.problem.limits import Limits
    from repair.vehicle.model import VehicleModel
    from repair.world.collision import CollisionWorld
    from repair.world.tracks import Index

__all__ = ["Followed", "angles_along", "is_finite", "met_anyhow", "motion_of"]

_PLACE_OFF, _SPEED_OFF = 0.05, 0.2  # farther from the state that it has [m], [m/s] nobody begins
_TURNED = 0.01  # nor turned by more [rad]
# By how much the ego may be off where it is taken to be, along its path and across [m].
_OFF = 0.05 + 0.2j
_APART = 0.25  # between the places that are looked at [m]
_WIDEST = 25.0  # more than this nobody blocks [m]
_STEPS = 2  # so many steps are looked at: later ones leave it more places
_RATE = 1e-9  # [m/s²], instead of none


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
    path : CartesianPath
        In the plane.
    slip, turned : (K,) array
        Slip angle at the centre, and orientation of the body [rad].
    """

    reference: Curve
    t_end: float
    motion: Array
    path: CartesianPath
    slip: Array
    turned: Array

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

    def begun_otherwise(self, curve: FrenetTrajectory, start: Array, body: float) -> str:
        """How samples of a curve, and the body's orientation [rad], are off the state that there is at once.

        In words; empty where they are not. ``start`` is that state (3, 2).
        """
        turned = abs(float(wrap(body - (self.path.heading[0] - self.slip[0]))))
        words = f"begins turned by {turned:.3f} rad" if turned > _TURNED else ""
        return _begins_apart(curve, start) or words


def met_anyhow(
    kept: Followed,
    world: CollisionWorld,
    limits: Limits,
    margin: float,
    t_rep: float,
    t_end: float,
) -> Violation | None:
    """Whom the ego meets at some step of a repair wherever on the path of the reference it is by then.

    It cannot be less far by then than with full braking, nor farther than with full throttle. Between these
    it is looked at place by place, as a rectangle that is smaller by what may be between two of them, and by
    what the curves of backends may be off the path.

    Parameters
    ----------
    kept : Followed
        The reference.
    world : CollisionWorld
    limits : Limits
        From t_rep on.
    margin : float
        To be kept around the ego's rectangle [m].
    t_rep, t_end : float
        Begin and end of the repair [s].

    Returns
    -------
    Violation or None
        None says nothing.
    """
    path, n, dt, braking = kept.path, world.substeps, world.dt, -limits.a_min
    if not path.slowest >= -STANDSTILL:
        return None
    way, plane = path.distance, path.xy.view(np.complex128)[:, 0]
    begin, speed = (float(np.interp(t_rep, path.t, column)) for column in (way, path.speed))
    step = np.arange(steps_until(t_rep, dt) + 1, steps_until(t_end, dt) + 1)
    t = dt * step - t_rep
    enlarged = margin * (1 + 1j) - _OFF - 0.5 * _APART
    brakes = np.minimum(t, speed / max(braking, _RATE))
    least = begin + (speed - 0.5 * braking * brakes) * brakes - _OFF.real
    most = begin + (speed + 0.5 * limits.a_max * t) * t + _OFF.real

    def met(sample: Index, at: Array) -> npt.NDArray[np.bool_]:
        here = np.interp(at, way, plane)
        return world.meets(sample, here, np.interp(at, way, kept.turned), enlarged)

    known = (most <= way[-1]) & (most - least <= _WIDEST)
    step, t, least, most = (column[known] for column in (step, t, least, most))
    met_first = np.flatnonzero(met(n * step, least).any(axis=1))[:_STEPS]
    for k in met_first.tolist():
        at = np.linspace(least[k], most[k], math.ceil((most[k] - least[k]) / _APART) + 1)
        found = met(np.full(len(at), n * step[k]), at)
        if found.any(axis=1).all():
            one = world.owner(int(found[0].argmax()))
            words = f"obstacle {one.id}, wherever on its path the ego is by then"
            return Violation(Reason.COLLISION, float(t_rep + t[k]), words, one.id)
    return None


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


def _begins_apart(curve: FrenetTrajectory, start: Array) -> str:
    """How samples of a curve miss the state (3, 2) that it has to begin in, in words; empty where not."""
    place, speed = (
        float(np.abs(column[0] - state).max())
        for column, state in zip((curve.position, curve.velocity), start, strict=False)
    )
    if place > _PLACE_OFF:
        return f"begins {place:.2f} m from where the vehicle is"
    return f"begins with a speed that is off by {speed:.2f} m/s" if speed > _SPEED_OFF else ""
