"""What the ego drives, as curves in the frame of its plan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, wrap
from repair.curves.base import Curve, FrenetTrajectory, SplicedCurve
from repair.reference.profile import SpeedProfile
from repair.scene.scene import Scene
from repair.timegrid import INSTANT
from repair.vehicle.states import DrivenStates

__all__ = ["Ahead", "Resumed", "ahead_of", "driven_along", "resumed"]

_FADES = 0.5  # after the end of a curve its motion sideways fades in about so much time [s]
_BACK_FOR, _BACK_OVER = (
    3.0,
    10.0,
)  # the way back to the plan's path: so long at the speed of now, at least [s], [m]
_LOOKS = 1.0  # the speed aimed at is that of the plan so far ahead [m]: it may begin with a standstill
_EVERY = 0.1  # pieces of the way back [s]


@dataclass(frozen=True)
class Ahead:
    """A curve seen from a later zero of time, without an end.

    Beyond its own end the speed is held and the motion sideways fades out: a repair ends somewhere, and what
    is driven does not.

    Attributes
    ----------
    curve : Curve
    by : float
        So much later [s].
    t_end : float
        Until when it is looked at [s].
    """

    curve: Curve
    by: float
    t_end: float
    t_start: float = 0.0

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        at = times + self.by
        end = self.curve.t_end
        found = self.curve.sample(np.minimum(at, end))
        beyond = np.maximum(at - end, 0.0)
        if not beyond.any():
            return FrenetTrajectory(times, found.position, found.velocity, found.acceleration, found.jerk)
        over = beyond > 0.0
        share = np.exp(-beyond / _FADES)
        position, velocity = found.position.copy(), found.velocity.copy()
        acceleration, jerk = found.acceleration.copy(), found.jerk.copy()
        rate = found.velocity[:, 1]
        position[:, 0] += beyond * velocity[:, 0]
        position[:, 1] += rate * _FADES * (1.0 - share)
        velocity[:, 1] = rate * share
        acceleration[over, 0] = jerk[over, 0] = 0.0
        acceleration[over, 1] = (-rate * share / _FADES)[over]
        jerk[over, 1] = (rate * share / _FADES**2)[over]
        return FrenetTrajectory(times, position, velocity, acceleration, jerk)


def ahead_of(curve: Curve, by: float, t_end: float) -> Ahead:
    """A curve from ``by`` on; of a spliced one the part that is left."""
    if isinstance(curve, Ahead):
        return ahead_of(curve.curve, by + curve.by, t_end)
    if isinstance(curve, SplicedCurve) and curve.t_rep <= by + INSTANT:
        return ahead_of(curve.repaired, by, t_end)
    return Ahead(curve, by, t_end)


@dataclass(frozen=True)
class Resumed:
    """Back to the plan: its speed at each place by a bounded acceleration, its path by a quintic.

    Attributes
    ----------
    profile : SpeedProfile
        Along the path.
    aside : (6,) array
        Coefficients of the offset over the way driven, the constant first.
    over : float
        The way after which the offset is zero [m].
    """

    profile: SpeedProfile
    aside: Array
    over: float

    @property
    def t_start(self) -> float:
        """Zero [s]."""
        return 0.0

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return self.profile.t_end

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate; the offset is a function of the way driven, so that who stands does not slide."""
        plain = self.profile.sample(t)
        way = np.clip(plain.position[:, 0] - self.profile.s[0], 0.0, self.over)
        c = [np.polynomial.polynomial.polyval(way, _derived(self.aside, n)) for n in range(4)]
        v, a = plain.velocity[:, 0], plain.acceleration[:, 0]
        columns = [
            np.column_stack([plain.position[:, 0], c[0]]),
            np.column_stack([v, c[1] * v]),
            np.column_stack([a, c[2] * v**2 + c[1] * a]),
            np.column_stack([np.zeros_like(v), c[3] * v**3 + 3.0 * c[2] * v * a]),
        ]
        return FrenetTrajectory(plain.t, *columns)


def _derived(coefficients: Array, times: int) -> Array:
    return np.asarray(np.polynomial.polynomial.polyder(coefficients, times)) if times else coefficients


def resumed(driven: Curve, plan: Curve, duration: float, back: float) -> Resumed:
    """From where the ego is back to the plan.

    Parameters
    ----------
    driven : Curve
        What it drives; its time 0 is now.
    plan : Curve
        The whole plan.
    duration : float
        [s].
    back : float
        Acceleration and deceleration on the way back [m/s²].
    """
    here = driven.sample(np.zeros(1))
    (s, aside), (v, rate) = here.position[0].tolist(), here.velocity[0].tolist()
    planned = plan.sample(np.arange(round(plan.t_end / _EVERY) + 1) * _EVERY)
    places, speeds = np.maximum.accumulate(planned.position[:, 0]), planned.velocity[:, 0]
    count = max(round(duration / _EVERY), 1)
    at, now, accelerations = s, max(v, 0.0), []
    for _ in range(count):
        aim = max(float(np.interp(at + _LOOKS, places, speeds)), 0.0)
        a = float(np.clip((aim - now) / _EVERY, -back, back))
        accelerations.append(a)
        at += now * _EVERY + 0.5 * a * _EVERY**2
        now = max(now + a * _EVERY, 0.0)
    profile = SpeedProfile.from_accelerations(s, max(v, 0.0), [duration / count] * count, accelerations)
    over = max(_BACK_FOR * v, _BACK_OVER)
    slope = rate / v if v > 0.5 else 0.0
    bend = 0.0
    if v > 0.5:
        bend = (float(here.acceleration[0, 1]) - slope * float(here.acceleration[0, 0])) / v**2
    return Resumed(profile, _quintic(aside, slope, bend, over), over)


def _quintic(start: float, slope: float, bend: float, over: float) -> Array:
    """Coefficients (6,) of the quintic from place, slope and bend to 0, 0, 0 over a length."""
    c = np.array([start, slope, 0.5 * bend])
    x = over
    left = -np.array([
        c[0] + c[1] * x + c[2] * x**2, c[1] + 2.0 * c[2] * x, 2.0 * c[2]
    ])  # fmt: skip
    table = np.array([[x**3, x**4, x**5], [3 * x**2, 4 * x**3, 5 * x**4], [6 * x, 12 * x**2, 20 * x**3]])
    return frozen([*c, *np.linalg.solve(table, left)])


def driven_along(scene: Scene, curve: Curve, times: Array, orientation: float | None) -> DrivenStates:
    """The vehicle's states along a curve.

    The body begins as it stands [rad]; None: as in steady driving.
    """
    path = scene.frame.cartesian(curve.sample(times))
    slip = None if orientation is None else float(wrap(path.heading[0] - orientation))
    return scene.model.drive(path, slip)
