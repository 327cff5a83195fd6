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
import numpy.typing as npt

from repair.arrays import Array, largest, smallest
from repair.check.verdict import Later, Reason, Violation
from repair.curves.base import Curve, FrenetTrajectory
from repair.curves.bspline import UniformBSpline
from repair.curves.plane import CartesianPath
from repair.curves.sampling import finer
from repair.problem.limits import Limits
from repair.scene.frame import FrenetFrame

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = [
    "ROUNDING",
    "Excess",
    "as_violation",
    "broken_limits",
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


# What is held against a limit in the plane, and that limit, in words.
_MEASURED = (
    "brakes at {:.2f} m/s² of {:.2f}",
    "accelerates at {:.2f} m/s² of {:.2f}",
    "needs {:.2f} of what the engine gives at that speed, {:.2f}",
    "lateral acceleration {:.2f} m/s² of {:.2f}",
    "total acceleration {:.2f} m/s² of {:.2f}",
)


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
        path.slowest >= -ROUNDING  # who stands goes back by rounding errors
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
    if type(curve) is UniformBSpline:  # mostly its control points suffice
        slowest, fastest = curve.speed_bounds()
        if slowest >= -ROUNDING and fastest <= most + ROUNDING:
            return found
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
    along, across, _ = _driven(frame, samples)
    return along, across


def _driven(frame: FrenetFrame, samples: FrenetTrajectory) -> tuple[Array, Array, Array]:
    """:func:`plane_accelerations`, and the speed of the centre (K,) [m/s]."""
    (s, l), (v, w), (a, b) = samples.position.T, samples.velocity.T, samples.acceleration.T  # noqa: E741
    if not np.count_nonzero(l) and not np.count_nonzero(w):
        return a, frame.curvature(s) * v * v, np.abs(v)
    kappa, rate = frame.bend(s)
    scale = 1.0 - kappa * l
    forward = scale * v
    along = scale * a - 2.0 * kappa * v * w - rate * l * v * v
    across = b + forward * kappa * v
    speed = np.sqrt(forward * forward + w * w)  # hypot takes far longer
    moving = speed > _STANDS
    if np.count_nonzero(moving) == len(moving):
        cos, sin = forward / speed, w / speed
    else:
        pace = np.where(moving, speed, 1.0)
        cos, sin = np.where(moving, forward / pace, 1.0), np.where(moving, w / pace, 0.0)
    return cos * along + sin * across, cos * across - sin * along, speed


def plane_excess(
    curve: Curve,
    samples: FrenetTrajectory,
    frame: FrenetFrame,
    limits: Limits,
    vehicle: Vehicle,
    tolerance: float,
    *,
    fully: bool = True,
) -> list[Excess]:
    """What breaks a limit in the plane: along and across the driven path, friction circle, engine.

    Parameters
    ----------
    samples : FrenetTrajectory
        Of the curve, equally spaced, over what is judged.
    fully : bool
        Also look between samples that break a limit themselves, where it may be broken more, or sooner.
    """
    if not len(samples):
        return []
    values, most, adds = _against(samples, frame, limits, vehicle, tolerance)
    if len(samples) > 1 and (fully or not (values > most + 2.0 * ROUNDING).any()):
        open_ = np.logical_or.reduce(_may_exceed(values, most, _kinks(frame, samples) * adds), axis=0)
        if not np.count_nonzero(open_):
            return []
        samples = curve.sample(finer(samples.t, open_, _FINE))
        values, most, _ = _against(samples, frame, limits, vehicle, tolerance)
    highest, allowed = np.maximum.reduce(values, axis=1).tolist(), most[:, 0].tolist()
    return [
        Excess(float(samples.t[np.argmax(value > most + ROUNDING)]), text.format(highest, most))
        for value, highest, most, text in zip(values, highest, allowed, _MEASURED, strict=True)
        if not highest <= most + ROUNDING
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


def _may_exceed(values: Array, most: Array, kinks: Array) -> npt.NDArray[np.bool_]:
    """Between which samples (M, K - 1) values may exceed: they swing by no more than around that interval.

    Parameters
    ----------
    values : (M, K) array
    most : (M, 1) array
        What they may be.
    kinks : (M, K - 1) array
        By how much they may jump in between.
    """
    swing = np.abs(values[:, 1:] - values[:, :-1])
    around = swing + kinks
    np.maximum(around[:, 1:], swing[:, :-1], out=around[:, 1:])
    np.maximum(around[:, :-1], swing[:, 1:], out=around[:, :-1])
    around += np.maximum(values[:, 1:], values[:, :-1])
    return np.asarray(~(around <= most))


def _against(
    samples: FrenetTrajectory, frame: FrenetFrame, limits: Limits, vehicle: Vehicle, tolerance: float
) -> tuple[Array, Array, Array]:
    """What :data:`_MEASURED` names at samples (5, K), what it may be at most (5, 1), and what 1 m/s² adds."""
    along, across, speed = _driven(frame, samples)
    engine = vehicle.engine_acceleration(speed)
    more, c = 1.0 + tolerance, limits
    values = np.empty((5, len(along)))
    values[0], values[1] = -along, along
    values[2] = along / engine
    values[3] = np.abs(across)
    np.sqrt(along * along + across * across, out=values[4])
    powered = 1.0 if math.isfinite(c.a_max) else math.inf
    most = np.array((-c.a_min * more, c.a_max * more, powered, c.a_lat * more, c.a_total * more))
    adds = np.array((1.0, 1.0, 1.0 / smallest(engine), 1.0, 1.0))
    return values, most[:, None], adds[:, None]


def broken_limits(
    curve: Curve,
    span: tuple[float, float],
    samples: FrenetTrajectory,
    path: CartesianPath,
    frame: FrenetFrame,
    limits: Limits,
    vehicle: Vehicle,
    tolerance: float,
) -> list[Violation]:
    """Limits that a curve breaks, as one violation; by how much is worked out when somebody reads it.

    Parameters
    ----------
    span : (float, float)
        From when to when it is judged [s].
    samples : FrenetTrajectory
        Of the curve, as in :func:`plane_excess`.
    path : CartesianPath
        What is driven: these samples in the plane, and maybe others before them.
    """
    kept = surely_kept(path, len(path.t) - len(samples), limits, vehicle)

    def found(fully: bool) -> list[Excess]:
        broken = curve_excess(curve, *span, limits, tolerance)
        if not kept and (fully or not broken):
            broken += plane_excess(curve, samples, frame, limits, vehicle, tolerance, fully=fully)
        return broken

    return [Later(Reason.LIMITS, lambda: as_violation(found(True))[0])] if found(False) else []


def as_violation(broken: list[Excess]) -> list[Violation]:
    """Broken limits as one violation, from the first of them on."""
    if not broken:
        return []
    words = "; ".join(dict.fromkeys(excess.words for excess in broken))
    return [Violation(Reason.LIMITS, min(excess.time for excess in broken), words)]
