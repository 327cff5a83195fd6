"""The fixed evasive manoeuvres: full braking, kick-down, steering, as curves.

Source: Hillenbrand, Spieker and Kroschel, *A multilevel collision mitigation approach*, T-ITS 2006.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.baselines.evasive.settings import EvasiveConfig
from repair.curves.base import Curve, FrenetTrajectory

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = ["EvasiveCurve", "EvasiveManeuver", "Path", "maneuvers_at", "path_of"]

_ENGINE_STEP = 0.25  # above v_switch the engine's power limit is followed in steps of this length [s]


class EvasiveManeuver(str, Enum):
    """The fixed manoeuvres."""

    BRAKE = "brake"
    KICK_DOWN = "kick_down"
    STEER_LEFT = "steer_left"
    STEER_RIGHT = "steer_right"


@dataclass(frozen=True)
class Path:
    """Where a reference leads, as l over s.

    Attributes
    ----------
    s, l : (M,) array
        s increasing [m].
    """

    s: Array
    l: Array  # noqa: E741 - the name of the coordinate

    @cached_property
    def slope(self) -> Array:
        """Of l by s (M,)."""
        return frozen(np.gradient(self.l, self.s) if len(self.s) > 1 else np.zeros(1))


@dataclass(frozen=True)
class EvasiveCurve:
    """A fixed manoeuvre relative to the reference's path; implements :class:`repair.curves.base.Curve`.

    Along the path the acceleration is piecewise constant, sideways the jerk; the lateral motion is
    added to the path's own offset at the same s. Beyond its span the end speed is held.

    Attributes
    ----------
    t_start, t_end : float
        Span [s].
    along : (P, 4) array
        Time since ``t_start`` [s], s, speed and acceleration at the start of each phase.
    across : (Q, 5) array
        Time since ``t_start``, offset from the path, its rate, acceleration and jerk.
    path : Path
        That of the reference.
    """

    t_start: float
    t_end: float
    along: Array
    across: Array
    path: Path

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate position and three derivatives."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        since = np.maximum(times - self.t_start, 0.0)
        t0, s0, v0, a0 = self.along[np.searchsorted(self.along[1:, 0], since + 1e-12, side="right")].T
        tau = since - t0
        s, v = s0 + v0 * tau + 0.5 * a0 * tau**2, v0 + a0 * tau
        t0, l0, r0, b0, j0 = self.across[np.searchsorted(self.across[1:, 0], since + 1e-12, side="right")].T
        tau = since - t0
        offset = l0 + r0 * tau + 0.5 * b0 * tau**2 + j0 * tau**3 / 6.0
        rate, bend = r0 + b0 * tau + 0.5 * j0 * tau**2, b0 + j0 * tau
        tilt = np.interp(s, self.path.s, self.path.slope)
        return FrenetTrajectory(
            times,
            np.column_stack([s, np.interp(s, self.path.s, self.path.l) + offset]),
            np.column_stack([v, tilt * v + rate]),
            np.column_stack([a0, tilt * a0 + bend]),
            np.column_stack([np.zeros_like(s), j0]),
        )


def maneuvers_at(
    reference: Curve,
    t_start: float,
    t_end: float,
    maneuver: EvasiveManeuver,
    settings: EvasiveConfig,
    vehicle: Vehicle,
    path: Path | None = None,
) -> Sequence[EvasiveCurve]:
    """The variants of a manoeuvre: one along the path, or one for each offset.

    Parameters
    ----------
    reference : Curve
        Until ``t_start`` it is followed, and its path is kept or left.
    t_start, t_end : float
        Span of the manoeuvre [s].
    maneuver : EvasiveManeuver
    settings : EvasiveConfig
    vehicle : Vehicle
    path : Path, optional
        What :func:`path_of` says of the reference, where somebody knows.

    Returns
    -------
    sequence of EvasiveCurve
        Empty where the vehicle cannot steer: a kinematic one that stands.
    """
    path = path_of(reference, t_end) if path is None else path
    state = reference.sample([t_start])
    s, v = float(state.position[0, 0]), max(float(state.velocity[0, 0]), 0.0)
    duration = t_end - t_start
    along: list[tuple[float, ...]]
    if maneuver is EvasiveManeuver.BRAKE:
        along = [(0.0, s, v, -settings.a_brake)]
        stop = v / settings.a_brake
        along.append((stop, s + 0.5 * v * stop, 0.0, 0.0))
    elif maneuver is EvasiveManeuver.KICK_DOWN:
        along = _kick_down(s, v, duration, settings.a_kick, vehicle)
    else:
        along = [(0.0, s, v, 0.0)]
    profiles: list[list[tuple[float, ...]]] = [[(0.0, 0.0, 0.0, 0.0, 0.0)]]
    if maneuver in (EvasiveManeuver.STEER_LEFT, EvasiveManeuver.STEER_RIGHT):
        sign = 1.0 if maneuver is EvasiveManeuver.STEER_LEFT else -1.0
        count = max(1, int(np.floor(settings.offset_max / settings.offset_step + 1e-9)))
        acceleration, jerk = _steering(v, settings, vehicle)
        if acceleration <= 0.0:
            return ()
        offsets = settings.offset_step * np.arange(1, count + 1)
        profiles = [_swerve(sign * float(offset), acceleration, jerk) for offset in offsets]
    return [EvasiveCurve(t_start, t_end, frozen(along), frozen(across), path) for across in profiles]


def path_of(reference: Curve, t_end: float) -> Path:
    """The reference's path until a time [s], continued at its last offset."""
    points = reference.sample(np.linspace(0.0, t_end, max(int(20 * t_end), 2))).position
    s, index = np.unique(np.maximum.accumulate(points[:, 0]), return_index=True)
    return Path(frozen(s), frozen(points[index, 1]))


def _kick_down(
    s: float, v: float, duration: float, a_kick: float, vehicle: Vehicle
) -> list[tuple[float, ...]]:
    """Full throttle: ``a_kick`` as far as the engine goes (power limit above v_switch, top speed)."""
    phases: list[tuple[float, ...]] = []
    t = 0.0
    while t < duration - 1e-9:
        a = min(a_kick, float(vehicle.engine_acceleration(v)))
        a = max(0.0, min(a, (vehicle.v_max - v) / _ENGINE_STEP))
        phases.append((t, s, v, a))
        t, s, v = t + _ENGINE_STEP, s + v * _ENGINE_STEP + 0.5 * a * _ENGINE_STEP**2, v + a * _ENGINE_STEP
    phases.append((t, s, v, 0.0))
    return phases


def _steering(v: float, settings: EvasiveConfig, vehicle: Vehicle) -> tuple[float, float]:
    """Lateral acceleration and jerk [m/s², m/s³] at speed ``v``; the jerk of a point mass is unlimited."""
    if settings.model == "point_mass":
        return settings.a_steer, float("inf")
    strongest = float(vehicle.lateral_acceleration(v, vehicle.steering_max))
    return min(settings.a_steer, strongest), vehicle.lateral_jerk(v)


def _swerve(offset: float, acceleration: float, jerk: float) -> list[tuple[float, ...]]:
    """To ``offset`` and straight again: two opposite pulses of lateral acceleration with limited jerk.

    A pulse with ramps r and plateau h moves ``a (h + r) (h + 2 r)`` in all; where the ramps alone move
    farther than that, the peak is lowered. A point mass has r = 0.
    """
    distance, sign = abs(offset), float(np.sign(offset))
    ramp = acceleration / jerk
    if 2.0 * acceleration * ramp**2 >= distance:
        acceleration = float(np.cbrt(0.5 * distance * jerk**2))
        ramp, plateau = acceleration / jerk, 0.0
    else:
        plateau = 0.5 * (-3.0 * ramp + float(np.sqrt(ramp**2 + 4.0 * distance / acceleration)))
    slope = jerk if ramp > 0.0 else 0.0
    # duration, acceleration at the start, jerk: there and back
    pulse = [(ramp, 0.0, slope), (plateau, acceleration, 0.0), (ramp, acceleration, -slope)]
    phases: list[tuple[float, ...]] = []
    t = position = rate = 0.0
    for direction in (sign, -sign):
        for duration, start, change in pulse:
            bend, change = direction * start, direction * change
            phases.append((t, position, rate, bend, change))
            position += rate * duration + 0.5 * bend * duration**2 + change * duration**3 / 6.0
            rate += bend * duration + 0.5 * change * duration**2
            t += duration
    phases.append((t, offset, 0.0, 0.0, 0.0))
    return [
        phase for phase, after in zip(phases, [*phases[1:], (np.inf,)], strict=True) if after[0] > phase[0]
    ]
