"""Whether a trajectory keeps the limits, to the letter.

Speed and reversing are bounded at all times by the hull of the Bernstein points of the curve's derivative.
The accelerations along and across the driven path, and the friction circle, are nonlinear; they are taken
from the curve's own derivatives and sampled, every millisecond wherever the samples of the check leave it
open whether a limit is kept between them. Lateral speed and jerk are no limits of the vehicle's: they bind
the backends, and are nobody's claim unless a backend keeps hulls.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from repair.arrays import Array, largest, smallest
from repair.check.verdict import Reason, Violation
from repair.curves.base import Curve, FrenetTrajectory
from repair.curves.plane import CartesianPath
from repair.problem.limits import Limits
from repair.scene.frame import FrenetFrame

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = [
    "ROUNDING",
    "Excess",
    "as_violation",
    "curve_excess",
    "plane_accelerations",
    "plane_excess",
    "speed_excess",
    "surely_kept",
    "vehicle_excess",
]

#: By how much rounding may move a number that is on its limit; the certificate reads curves to 1e-12.
ROUNDING = 1e-6
_FINE = 1e-3  # [s]
_STANDS = 0.1  # below this speed [m/s] a path has no direction along which to accelerate


class Excess(NamedTuple):
    """A limit that is broken: when [s], and by what, in words."""

    time: float
    words: str


def surely_kept(path: CartesianPath, late: int, limits: Limits, vehicle: Vehicle) -> bool:
    """Whether a driven path is so far inside of the limits from a sample on that nothing between is outside.

    The difference quotients stand in for the accelerations. Between samples, an acceleration is taken to be
    off the quotients around it by less than the largest step from one quotient to the next; the lateral
    one is bounded by the highest speed and the sharpest turn of all.
    """
    since = max(late - 1, 0)
    if len(path.t) - since < 3:
        return False
    speed = path.speed[since:]
    change = speed[1:] - speed[:-1]
    rate = 1.0 / float(path.t[1] - path.t[0])
    v_high, swing = largest(speed), change[1:] - change[:-1]
    swing_most = max(-smallest(swing), largest(swing))
    a_low, a_high = (smallest(change) - swing_most) * rate, (largest(change) + swing_most) * rate
    lateral = 1.25 * max(-path.slowest, v_high) * path.sharpest * rate
    return (
        path.slowest >= 0.0
        and v_high <= limits.v_max
        and a_low >= limits.a_min
        and a_high <= min(limits.a_max, float(vehicle.engine_acceleration(v_high)))
        and lateral <= limits.a_lat
        and math.hypot(max(-a_low, a_high), lateral) <= limits.a_total
    )


def curve_excess(curve: Curve, t_from: float, t_end: float, limits: Limits, tolerance: float) -> list[Excess]:
    """Reversing, and speeds beyond the limit, over [t_from, t_end].

    Parameters
    ----------
    tolerance : float
        Share of the limit by which it may be exceeded.
    """
    most = limits.v_max * (1.0 + tolerance)
    found: list[Excess] = []
    for cuts in (1, 16):  # the coarse hull mostly suffices
        times, low, high = _speeds(curve, t_from, t_end, cuts)
        found = []
        if not len(times):
            break
        if not smallest(low) >= -ROUNDING:
            found.append(Excess(float(times[np.argmin(low)]), f"reverses at {-float(low.min()):.2f} m/s"))
        if not largest(high) <= most + ROUNDING:
            words = f"speed {float(high.max()):.2f} m/s of {most:.2f}"
            found.append(Excess(float(times[np.argmax(high > most + ROUNDING)]), words))
        if not found:
            break
    return found


def speed_excess(samples: FrenetTrajectory, limits: Limits, tolerance: float) -> list[Excess]:
    """Speeds along the path beyond the limit at the samples."""
    speed, most = np.abs(samples.velocity[:, 0]), limits.v_max * (1.0 + tolerance)
    if not len(speed) or float(speed.max()) <= most + ROUNDING:
        return []
    words = f"speed {float(speed.max()):.2f} m/s of {limits.v_max:.2f}"
    return [Excess(float(samples.t[int(np.argmax(speed > most))]), words)]


@lru_cache(maxsize=64)
def _is_hulled(kind: type) -> bool:
    """Whether curves of a type are :class:`repair.curves.base.Hulled`; to ask a protocol takes long."""
    return hasattr(kind, "speed_hulls")


def _speeds(curve: Curve, t_from: float, t_end: float, cuts: int) -> tuple[Array, Array, Array]:
    """Times (M,) at which parts begin, and bounds (M,) of s' over them."""
    hulled: Any = curve
    if _is_hulled(type(curve)):
        times, low, high = hulled.speed_hulls(cuts)
        count = int(times.searchsorted(t_end - ROUNDING))
        return times[:count], low[:count], high[:count]
    times = np.linspace(t_from, t_end, max(2, round((t_end - t_from) / _FINE) + 1))
    speed = curve.sample(times).velocity[:, 0]
    return times, speed, speed


def plane_accelerations(frame: FrenetFrame, samples: FrenetTrajectory) -> tuple[Array, Array]:
    """Acceleration of the centre along and across its own path (K,) [m/s²], from the curve's derivatives.

    With c = 1 - kappa l the velocity in the axis' tangent and normal is (c s', l'), and the acceleration
    (c s'' - 2 kappa s' l' - kappa' l s'^2, l'' + c kappa s'^2).
    """
    (s, l), (v, w), (a, b) = samples.position.T, samples.velocity.T, samples.acceleration.T  # noqa: E741
    kappa = frame.curvature(s)
    if not np.count_nonzero(l) and not np.count_nonzero(w):
        return a, kappa * v * v
    scale = 1.0 - kappa * l
    forward = scale * v
    along = scale * a - 2.0 * kappa * v * w - frame.curvature_rate(s) * l * v * v
    across = b + forward * kappa * v
    speed = np.hypot(forward, w)
    moving = speed > _STANDS
    cos = np.where(moving, forward / np.where(moving, speed, 1.0), 1.0)
    sin = np.where(moving, w / np.where(moving, speed, 1.0), 0.0)
    return cos * along + sin * across, cos * across - sin * along


def plane_excess(
    curve: Curve,
    samples: FrenetTrajectory,
    frame: FrenetFrame,
    limits: Limits,
    vehicle: Vehicle,
    tolerance: float,
) -> list[Excess]:
    """What breaks a limit in the plane: along and across the driven path, friction circle, engine.

    Parameters
    ----------
    samples : FrenetTrajectory
        Of the curve, equally spaced, over what is judged.
    """
    if not len(samples):
        return []
    rows = _against(samples, frame, limits, vehicle, tolerance)
    if len(samples) > 1:
        kinks = _kinks(frame, samples)
        open_ = [_may_exceed(value, most, kinks * per) for value, most, _, per in rows]
        fine = _fine(samples.t, np.logical_or.reduce(open_))
        if not len(fine):
            return []
        samples = curve.sample(fine)
        rows = _against(samples, frame, limits, vehicle, tolerance)
    return [
        Excess(float(samples.t[np.argmax(value > most + ROUNDING)]), text.format(float(value.max()), most))
        for value, most, text, _ in rows
        if not float(value.max()) <= most + ROUNDING
    ]


def vehicle_excess(t: Array, speed: Array, slip: Array, vehicle: Vehicle) -> list[Excess]:
    """What the states at the scenario's steps ask of the vehicle beyond its own parameters.

    The limits of a repair bind the middle of the vehicle along the curve; CommonRoad's model drives by the
    rear axle from step to step, and asks a little more of tyres and engine in a bend, and of the steering at
    walking pace. Its drivability checker allows that within its tolerances. Here it is held to the letter.

    Parameters
    ----------
    t, speed, slip : (K,) array
        At the scenario's steps: time [s], speed of the centre [m/s], slip angle at the centre [rad].
    """
    if len(t) < 2:
        return []
    turn = np.tan(slip)
    axle, curvature = speed * np.cos(slip), turn / vehicle.rear
    along = (axle[1:] - axle[:-1]) / (t[1] - t[0])
    grip = np.hypot(along, (axle[:-1] ** 2) * curvature[:-1])
    steering = np.abs(np.arctan(vehicle.wheelbase * curvature))
    engine = along - vehicle.engine_acceleration(np.minimum(axle[1:], axle[:-1]))
    rows = (
        (grip, vehicle.a_max, "grip {:.2f} m/s² of {:.2f} from step to step"),
        (engine, 0.0, "{:.2f} m/s² more from step to step than the engine gives"),
        (steering, vehicle.steering_max, "steering angle {:.2f} rad of {:.2f}"),
    )
    return [
        Excess(float(t[int(np.argmax(value > most + ROUNDING))]), text.format(float(value.max()), most))
        for value, most, text in rows
        if not float(value.max()) <= most + ROUNDING
    ]


@lru_cache(maxsize=8)
def _bends(frame: FrenetFrame) -> Array:
    """Sum of all jumps of the curvature's rate up to and including each of the axis' knots (K,) [1/m²]."""
    inside = frame.s[1:-1]
    off = 1e-6 * float(frame.s[1] - frame.s[0])
    jumps = np.abs(frame.curvature_rate(inside + off) - frame.curvature_rate(inside - off))
    return np.concatenate(([0.0, 0.0], np.cumsum(jumps)))


def _kinks(frame: FrenetFrame, samples: FrenetTrajectory) -> Array:
    """By how much the acceleration jumps between samples (K - 1,), at most [m/s²].

    The axis is a cubic spline: beside it, what its curvature's rate adds to the acceleration jumps at knots.
    """
    (s, l), v = samples.position.T, samples.velocity[:, 0]  # noqa: E741
    reach = np.abs(l) * v * v
    if not np.count_nonzero(reach):
        return np.zeros(max(len(s) - 1, 0))
    passed = _bends(frame)[frame.s.searchsorted(s).clip(0, len(frame.s) - 1)]
    return np.asarray(np.abs(passed[1:] - passed[:-1]) * np.maximum(reach[1:], reach[:-1]))


def _may_exceed(value: Array, most: float, kinks: Array) -> Array:
    """Between which samples (K - 1,) a value may exceed: it swings by no more than around that interval.

    Parameters
    ----------
    kinks : (K - 1,) array
        By how much it may jump in between.
    """
    swing = np.abs(value[1:] - value[:-1])
    around = swing + kinks
    np.maximum(around[1:], swing[:-1], out=around[1:])
    np.maximum(around[:-1], swing[1:], out=around[:-1])
    return np.asarray(~(np.maximum(value[1:], value[:-1]) + around <= most))


def _fine(times: Array, chosen: Array) -> Array:
    """Times every millisecond in the chosen ones of the intervals between ``times``, ends included."""
    step = float(times[1] - times[0])
    inner = np.linspace(0.0, step, max(1, round(step / _FINE)) + 1)
    return np.unique((times[:-1][chosen][:, None] + inner).ravel())


def _against(
    samples: FrenetTrajectory, frame: FrenetFrame, limits: Limits, vehicle: Vehicle, tolerance: float
) -> tuple[tuple[Array, float, str, float], ...]:
    """What is measured at samples (K,), what it may be at most, the words for it, and what 1 m/s² adds."""
    along, across = plane_accelerations(frame, samples)
    (s, l), (v, w) = samples.position.T, samples.velocity.T  # noqa: E741
    engine = vehicle.engine_acceleration(np.hypot((1.0 - frame.curvature(s) * l) * v, w))
    more, c = 1.0 + tolerance, limits
    return (
        (-along, -c.a_min * more, "brakes at {:.2f} m/s² of {:.2f}", 1.0),
        (along, c.a_max * more, "accelerates at {:.2f} m/s² of {:.2f}", 1.0),
        (
            along / engine,
            1.0 if math.isfinite(c.a_max) else math.inf,
            "needs {:.2f} of what the engine gives at that speed, {:.2f}",
            1.0 / float(engine.min()),
        ),
        (np.abs(across), c.a_lat * more, "lateral acceleration {:.2f} m/s² of {:.2f}", 1.0),
        (np.hypot(along, across), c.a_total * more, "total acceleration {:.2f} m/s² of {:.2f}", 1.0),
    )


def as_violation(broken: list[Excess]) -> list[Violation]:
    """Broken limits as one violation, from the first of them on."""
    if not broken:
        return []
    words = "; ".join(dict.fromkeys(excess.words for excess in broken))
    return [Violation(Reason.LIMITS, min(excess.time for excess in broken), words)]
