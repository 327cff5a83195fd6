"""The fast twin of :mod:`repair.vehicle.transitions`: bounds over a whole trajectory.

Nearly all trajectories that are good are good by these bounds too; the exact form is asked about the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import neg
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.vehicle.transitions import (
    ACCEPTED,
    ORIENTATION_TOLERANCE,
    POSITION_TOLERANCE,
    STEERING_RATE,
    engine_share,
)

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = ["clearly_drivable"]
# clearly_drivable stays this much below a limit, so that rounding cannot make it laxer.
_SURE = 1.0 - 1e-9


def clearly_drivable(
    xy: Array, speed: Array, slip: Array, orientation: Array, dt: float, vehicle: Vehicle
) -> bool:
    """Whether :func:`repair.vehicle.transitions.direct_check` accepts every transition.

    True implies it, False says nothing. Bounds over the whole trajectory stand in for those of the single
    transitions, and the trapezoidal rule, with a bound of its error, for Simpson's: this leaves few calls.

    Parameters
    ----------
    xy : (T, 2) array
        The vehicle's centre [m] at the scenario's time steps.
    speed, slip, orientation : (T,) array
        Speed of the centre [m/s], slip angle and orientation [rad]; see
        :func:`repair.vehicle.single_track.driven_states`.
    dt : float
        Time step [s].
    vehicle : Vehicle
    """
    _, steering, top, acceleration, friction, position, angle = ACCEPTED
    rows = np.zeros((5, len(slip)))
    v, tangent, turning = rows[:3]
    np.tan(slip, out=tangent)  # that of the steering angle times rear / wheelbase
    np.multiply(speed, np.cos(slip), out=v)
    np.multiply(v, tangent, out=turning)  # rate of the orientation times rear
    np.subtract(rows[:2, 1:], rows[:2, :-1], out=rows[3:, 1:])
    low, high = np.minimum.reduce(rows, axis=1).tolist(), np.maximum.reduce(rows, axis=1).tolist()
    largest = fastest, steepest, turn, dv, dtangent = list(map(max, high, map(neg, low)))
    engine = acceleration * vehicle.a_max
    # As Vehicle.engine_acceleration has it, on plain numbers.
    if fastest > vehicle.v_switch:
        least = vehicle.a_max * vehicle.v_switch / fastest
        engine = least * float(engine_share(np.array(least), dt))
    to_steering = vehicle.wheelbase / vehicle.rear  # from the slip angle's tangent; atan has slope <= 1
    if not (
        steepest * to_steering <= math.tan(_SURE * steering * vehicle.steering_max)
        and dtangent * to_steering <= _SURE * dt * STEERING_RATE * vehicle.steering_rate_max  # no cut
        and high[0] + high[3] <= _SURE * top * vehicle.v_max
        and low[0] + low[3] >= _SURE * top * vehicle.v_min
        and high[3] <= _SURE * engine * dt
        and -low[3] <= _SURE * acceleration * vehicle.a_max * dt
        and math.hypot(dv / dt, fastest * turn / vehicle.rear) <= _SURE * friction * vehicle.a_max
    ):
        return False
    shift, turned = _error_bounds(xy, rows[:3], orientation, largest, dt, vehicle)
    return turned <= _SURE * angle * ORIENTATION_TOLERANCE and shift <= _SURE * position * POSITION_TOLERANCE


def _error_bounds(
    xy: Array, rows: Array, psi: Array, largest: Sequence[float], dt: float, vehicle: Vehicle
) -> tuple[float, float]:
    """Bounds of what ``transition_errors`` gives: of the position and of the orientation.

    The trapezoidal rule stands in for Simpson's. What the two differ by, at most, is added: each term
    is half a step's second difference of a factor, a product of two changes, or follows from these.
    ``rows`` (3, T) holds the speed, the tangent of the slip angle and the product of both, ``largest``
    what is largest in size of these and of the changes of the first two.
    """
    fastest, steepest, turn, dv, dtangent = largest
    rear, to_steering = vehicle.rear, vehicle.wheelbase / vehicle.rear
    # The pose (orientation times rear, rear axle), and half of how far its rates move it within a step.
    pose, moved = np.empty((2, 3, len(psi)))
    pose[0] = psi
    np.cos(psi, out=moved[1])
    np.sin(psi, out=moved[2])
    pose[1:] = moved[1:]
    pose *= rear
    np.subtract(xy.T, pose[1:], out=pose[1:])
    moved[0] = rows[1]
    moved *= (0.5 * dt) * rows[0]
    missed = np.abs((pose - moved)[:, 1:] - (pose + moved)[:, :-1])
    off, x_off, y_off = np.maximum.reduce(missed, axis=1).tolist()
    astray = max(x_off, y_off) if math.isfinite(x_off + y_off) else math.inf
    steep, dsteep = steepest * to_steering, dtangent * to_steering
    # between two steering angles, the tangent in the middle and the mean of the tangents
    bow = 0.25 * dsteep * dsteep * steep * (1.0 + steep * steep) / to_steering
    turned = (off + dt * (dv * dtangent / 6.0 + fastest * bow / 1.5)) / rear
    # the changes of the turning rate and of the orientation follow from those of the others
    dturning, dpsi = fastest * dtangent + steepest * dv, (dt * turn + off) / rear
    # directions at the end and in the middle of a step: those simulated and those used here
    spread = 0.5 * turned + dt * dturning / (12.0 * rear) + dpsi * dpsi / 12.0
    return astray + dt * (dv * dpsi / 6.0 + fastest * spread), turned
