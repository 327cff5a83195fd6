"""Kinematic single-track states along a driven path, and whether the vehicle can drive them.

The model is CommonRoad's KS model (Althoff and Würsching, *CommonRoad: Vehicle Models*, 2020),
referenced to the rear axle; CommonRoad states are referenced to the centre of the vehicle, ``rear``
(b) ahead of that axle. With theta the direction of the centre's velocity and psi the orientation of
the body, the slip angle at the centre is beta = theta - psi, and

    tan(beta) = b / L * tan(delta)                     (no slip at the wheels)
    d(psi)/d(sigma) = sin(beta) / b                    (sigma: arc length driven forward)

The drivability checker's own test runs an optimiser on every transition (6 to 14 ms each).
:func:`direct_check` answers in microseconds for transitions that are clearly drivable;
:func:`repair.ks.official_check` asks the drivability checker about the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import neg
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.extremes import smallest
from repair.types import Array

if TYPE_CHECKING:
    from repair.scene.frame import CartesianPath
    from repair.scene.vehicle import Vehicle

__all__ = [
    "LIMITS",
    "DrivenStates",
    "KinematicReport",
    "body_angles",
    "clearly_drivable",
    "direct_check",
    "drive",
    "driven_states",
]

# The official tolerances: position error per axis [m], orientation error [rad].
POSITION_TOLERANCE = 0.02
ORIENTATION_TOLERANCE = 0.03

LIMITS = ("steering_rate", "steering_angle", "speed", "acceleration", "friction", "position", "orientation")

# Share of each official limit that direct_check accepts. The official test is an SLSQP run from a
# zero input on a non-smooth cost and can fail close to its own limits although a valid input exists;
# the shares were found by fuzzing (tests/property/test_direct_check.py). A steering rate beyond its
# share is no reason by itself: the official test does not compare steering angles, so the rate is cut
# off there and the position and orientation that it leads to decide.
_STEERING_RATE = 0.9
_ACCEPT_LIST = (math.inf, 0.95, 0.98, 0.9, 0.9, 0.5, 0.4)
_ACCEPT = np.array(_ACCEPT_LIST)[:, None]
# Where the model cuts the acceleration off (engine power above v_switch, top speed) the cost is flat,
# and the optimiser, which overshoots, stays there if that is already better than its start at zero:
# from half of the limit on.
_ENGINE = 0.45
# clearly_drivable stays this much below a limit, so that rounding cannot make it laxer.
_SURE = 1.0 - 1e-9
# Samples at least this far apart [m] are those of a moving vehicle.
_MOVES = 1e-9
# Factors as arrays, because NumPy takes long to convert a plain number.
_TWICE, _DECAY = np.array(2.0), np.array(-2.0)
# The official integrator's error is relative to the coordinates; far from the origin [m] it hides the
# cost's slope from the optimiser.
_FAR = 5000.0


@dataclass(frozen=True)
class DrivenStates:
    """States of the kinematic single-track model, all (K,).

    Attributes
    ----------
    t : array
        Time [s].
    x, y : array
        Centre of the vehicle [m].
    steering : array
        Steering angle delta of the front wheels [rad].
    speed : array
        Speed at the rear axle [m/s].
    orientation : array
        Orientation psi of the body [rad], unwrapped.
    """

    t: Array
    x: Array
    y: Array
    steering: Array
    speed: Array
    orientation: Array

    def __len__(self) -> int:
        return len(self.t)

    def every(self, n: int) -> DrivenStates:
        """Every ``n``-th state, the first included."""
        return DrivenStates(
            self.t[::n], self.x[::n], self.y[::n], self.steering[::n], self.speed[::n], self.orientation[::n]
        )


@dataclass(frozen=True)
class KinematicReport:
    """Answer of :func:`direct_check` for T - 1 transitions.

    Attributes
    ----------
    ok : (T - 1,) bool array
        The transition is drivable, and the drivability checker will agree. False means *not known*.
    margin : (T - 1,) array
        1 - value / accepted value of the tightest limit; negative where ``ok`` is False.
    worst : (T - 1,) int array
        Index into :data:`LIMITS` of that tightest limit.
    use : (7, T - 1) array
        Value / official limit, per limit in the order of :data:`LIMITS`; above 1 is beyond the limit.
    """

    ok: npt.NDArray[np.bool_]
    margin: Array
    worst: npt.NDArray[np.intp]
    use: Array

    def limit(self, transition: int) -> str:
        """Name of the tightest limit of a transition."""
        return LIMITS[int(self.worst[transition])]


def drive(
    t: Array,
    xy: Array,
    heading: Array,
    speed: Array,
    distance: Array,
    vehicle: Vehicle,
    *,
    slip0: float | None = None,
) -> DrivenStates:
    """States of the vehicle whose centre drives a sampled path.

    Parameters
    ----------
    t : (K,) array
        Times [s].
    xy : (K, 2) array
        Centre of the vehicle [m].
    heading : (K,) array
        Direction theta of the centre's velocity [rad], unwrapped.
    speed : (K,) array
        Speed of the centre [m/s], negative while reversing (the heading then still points forward).
    distance : (K,) array
        Arc length driven by the centre [m], growing in either direction.
    vehicle : Vehicle
    slip0 : float, optional
        Slip angle beta = theta - psi at the first sample [rad]; by default that of steady driving at
        the path's initial curvature, asin(kappa b).

    Returns
    -------
    DrivenStates
        Where ``distance`` does not grow, orientation and steering are held: a vehicle at rest does
        not turn, whatever the path's heading does there.
    """
    step, turn = distance[1:] - distance[:-1], heading[1:] - heading[:-1]
    slowest = float(np.minimum.reduce(speed, initial=np.inf))
    slip, orientation = _angles(heading, speed, step, turn, slowest, vehicle.rear, slip0)
    return driven_states(t, xy, speed, slip, orientation, vehicle)


def body_angles(path: CartesianPath, vehicle: Vehicle, slip0: float | None = None) -> tuple[Array, Array]:
    """Slip angle and orientation (K,) [rad] along a path; ``slip0`` and rules as in :func:`drive`."""
    return _angles(path.heading, path.speed, path.step, path.turn, path.slowest, vehicle.rear, slip0)


def _angles(
    heading: Array, speed: Array, step: Array, turn: Array, slowest: float, rear: float, slip0: float | None
) -> tuple[Array, Array]:
    if len(step) and smallest(step) > _MOVES:
        if not slowest > 0.0:
            step = np.copysign(step, speed[1:] + speed[:-1])
        slip = _slip_angle(turn, step, step, rear, slip0)
        return slip, heading - slip
    moving = step > _MOVES
    step = np.where(moving, np.copysign(step, speed[1:] + speed[:-1]), 0.0)
    turn = np.where(moving, turn, 0.0)
    # Where nothing moves, nothing turns: a length of 1 there only avoids the division by zero.
    slip = _slip_angle(turn, step, np.where(moving, step, 1.0), rear, slip0)
    return slip, heading[0] + np.concatenate(([0.0], np.cumsum(turn))) - slip


def driven_states(
    t: Array, xy: Array, speed: Array, slip: Array, orientation: Array, vehicle: Vehicle
) -> DrivenStates:
    """States at samples of which :func:`body_angles` gave the angles: all of them, or every n-th."""
    steering = np.arctan(vehicle.wheelbase / vehicle.rear * np.tan(slip))
    return DrivenStates(t, xy[:, 0], xy[:, 1], steering, speed * np.cos(slip), orientation)


def _slip_angle(turn: Array, step: Array, length: Array, rear: float, slip0: float | None) -> Array:
    """Integrate d(beta)/d(sigma) = d(theta)/d(sigma) - sin(beta)/b over the samples.

    ``length`` is ``step`` but for intervals on which nothing moves, and not 0 there. Each interval is
    split: half of the turn, then a straight piece, then the other half. On a straight piece the rear
    axle draws a tractrix, tan(beta/2) shrinking by exp(-step/b) exactly; the turn is scaled so that the
    small-angle solution at constant curvature is exact as well. In tan(beta/2) a rotation is a Möbius
    map, so that the recurrence needs no trigonometric function.
    """
    if slip0 is None:
        slip0 = _steady(turn, step, length, rear)
    if not len(step):
        return np.array([slip0])
    ratio = step * (0.5 / rear)
    quarter = (0.5 * rear) * turn * np.tanh(ratio) / length
    half = quarter.copy()  # of the rotation between two straight pieces
    half[1:] += quarter[:-1]
    value = math.tan(0.5 * slip0)
    tangents, decay = np.tan(half).tolist(), np.exp(_DECAY * ratio).tolist()
    slip = np.empty(len(step) + 1)
    slip[0] = slip0
    slip[1:] = [
        value := factor * (value + tangent) / (1.0 - value * tangent)
        for tangent, factor in zip(tangents, decay, strict=True)
    ]
    slip[1:] = _TWICE * (np.arctan(slip[1:]) + quarter)
    return slip


def _steady(turn: Array, step: Array, length: Array, rear: float) -> float:
    """Slip angle [rad] of steady driving where the path begins to move."""
    if not len(step):
        return 0.0
    first = 0 if step[0] else int(np.argmax(step != 0.0))
    bend = rear * float(turn[first]) / float(length[first])
    return math.asin(min(max(bend, -0.95), 0.95))


def direct_check(states: DrivenStates, dt: float, vehicle: Vehicle) -> KinematicReport:
    """Accept the transitions that are clearly drivable for the KS model.

    The inputs are the difference quotients of steering angle and speed (the steering rate cut off at
    its limit); the model is integrated from each state, the inputs constant, and the result held
    against the next one. A transition is accepted where every quantity stays within a share of the
    official limit. Accepted means that the drivability checker would say yes; the vehicle's own limits
    of acceleration and steering are its tolerances, not comfort limits.

    Parameters
    ----------
    states : DrivenStates
        At the scenario's time steps, T of them.
    dt : float
        Time step [s].
    vehicle : Vehicle

    Returns
    -------
    KinematicReport
        ``ok`` True implies that
        ``commonroad_dc.feasibility.feasibility_checker.state_transition_feasibility`` says yes.
    """
    delta, v = states.steering, states.speed
    acceleration = np.diff(v) / dt
    # vehiclemodels: above v_switch the engine's power limits the acceleration; the limit falls over
    # the step, so the speed at its end decides.
    engine = vehicle.a_max * np.minimum(1.0, vehicle.v_switch / np.maximum(v[1:], vehicle.v_switch))
    lateral = v[:-1] ** 2 * np.tan(delta[:-1]) / vehicle.wheelbase
    overshoot = 2.0 * v[1:] - v[:-1]  # the optimiser's: see _ENGINE
    fastest, slowest = np.maximum(v[:-1], overshoot), np.minimum(v[:-1], overshoot)
    position, orientation = _errors(states, dt, vehicle)
    use = np.stack(
        (
            np.abs(np.diff(delta)) / (dt * vehicle.steering_rate_max),
            np.maximum(np.abs(delta[:-1]), np.abs(delta[1:])) / vehicle.steering_max,
            np.maximum(fastest / vehicle.v_max, slowest / vehicle.v_min),
            np.abs(acceleration) / np.where(acceleration > 0.0, engine, vehicle.a_max),
            np.hypot(acceleration, lateral) / vehicle.a_max,
            position / POSITION_TOLERANCE,
            orientation / ORIENTATION_TOLERANCE,
        )
    )
    accept = np.repeat(_ACCEPT, use.shape[1], axis=1)
    accept[LIMITS.index("acceleration"), (acceleration > 0.0) & (engine < vehicle.a_max)] = _ENGINE
    room = 1.0 - use / accept
    room[LIMITS.index("position"), np.maximum(np.abs(states.x), np.abs(states.y))[1:] > _FAR] = -1.0
    worst = np.argmin(room, axis=0)
    margin = room[worst, np.arange(room.shape[1])]
    ok = margin >= 0.0
    worst[~ok & (use[0] > _STEERING_RATE)] = LIMITS.index("steering_rate")  # the error comes from the cut
    return KinematicReport(ok, margin, worst, use)


def clearly_drivable(
    xy: Array, speed: Array, slip: Array, orientation: Array, dt: float, vehicle: Vehicle
) -> bool:
    """Whether :func:`direct_check` accepts every transition: True implies it, False says nothing.

    Bounds over the whole trajectory stand in for those of the single transitions, and the trapezoidal
    rule, with a bound of its error, for Simpson's: this leaves few calls, and nearly all trajectories
    that are good are good by these as well.

    Parameters
    ----------
    xy : (T, 2) array
        The vehicle's centre [m] at the scenario's time steps.
    speed, slip, orientation : (T,) array
        Speed of the centre [m/s], slip angle and orientation [rad]; see :func:`driven_states`.
    """
    _, steering, top, acceleration, friction, position, angle = _ACCEPT_LIST
    rows = np.zeros((5, len(slip)))
    v, tangent, turning = rows[:3]
    np.tan(slip, out=tangent)  # that of the steering angle times rear / wheelbase
    np.multiply(speed, np.cos(slip), out=v)
    np.multiply(v, tangent, out=turning)  # rate of the orientation times rear
    np.subtract(rows[:2, 1:], rows[:2, :-1], out=rows[3:, 1:])
    low, high = np.minimum.reduce(rows, axis=1).tolist(), np.maximum.reduce(rows, axis=1).tolist()
    largest = fastest, steepest, turn, dv, dtangent = list(map(max, high, map(neg, low)))
    engine = acceleration * vehicle.a_max
    if fastest > vehicle.v_switch:
        engine = _ENGINE * vehicle.a_max * vehicle.v_switch / fastest
    to_steering = vehicle.wheelbase / vehicle.rear  # from the slip angle's tangent; atan has slope <= 1
    if not (
        steepest * to_steering <= math.tan(_SURE * steering * vehicle.steering_max)
        and dtangent * to_steering <= _SURE * dt * _STEERING_RATE * vehicle.steering_rate_max  # no cut
        and high[0] + high[3] <= _SURE * top * vehicle.v_max
        and low[0] + low[3] >= _SURE * top * vehicle.v_min
        and high[3] <= _SURE * engine * dt
        and -low[3] <= _SURE * acceleration * vehicle.a_max * dt
        and math.hypot(dv / dt, fastest * turn / vehicle.rear) <= _SURE * friction * vehicle.a_max
    ):
        return False
    shift, turned = _error_bounds(xy, rows[:3], orientation, largest, dt, vehicle)
    # From one step to the next, the rear axle moves as far as simulated, or as far astray as bounded.
    way = len(xy) * (fastest * dt + shift) + 2.0 * vehicle.rear
    return (
        turned <= _SURE * angle * ORIENTATION_TOLERANCE
        and shift <= _SURE * position * POSITION_TOLERANCE
        and max(map(abs, xy[0].tolist())) + way <= _FAR
    )


def _error_bounds(
    xy: Array, rows: Array, psi: Array, largest: Sequence[float], dt: float, vehicle: Vehicle
) -> tuple[float, float]:
    """Bounds of what :func:`_errors` gives: of the position and of the orientation.

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


def _errors(states: DrivenStates, dt: float, vehicle: Vehicle) -> tuple[Array, Array]:
    """Error of the simulated next state: of the rear axle's position (larger axis) and the orientation."""
    psi, delta = states.orientation, states.steering
    most = dt * _STEERING_RATE * vehicle.steering_rate_max
    change = np.minimum(np.maximum(delta[1:] - delta[:-1], -most), most)
    turned, moved = _integrate(delta[:-1], change, states.speed, psi[:-1], dt, vehicle.wheelbase)
    axle = np.array((states.x, states.y)) - vehicle.rear * np.array((np.cos(psi), np.sin(psi)))
    shift = np.abs(axle[:, 1:] - axle[:, :-1] - moved)
    return np.maximum(shift[0], shift[1]), np.abs(psi[1:] - psi[:-1] - turned)


# Runge-Kutta of order 4 over a step on which steering angle and speed are linear in time: weights of
# the start, the middle and the end in the turn until each of the three, and in the way.
_TURN = np.array([[0.0, 0.0, 0.0], [5.0, 8.0, -1.0], [4.0, 16.0, 4.0]]) / 24.0
_WAY = np.array([[1.0], [2.0], [1.0]]) / 6.0  # of the sum of both speeds in the middle
_MEAN = np.array([[1.0], [0.5], [1.0]])


def _integrate(
    delta: Array, change: Array, v: Array, psi: Array, dt: float, wheelbase: float
) -> tuple[Array, Array]:
    """Change of orientation (T - 1,) and rear-axle position (2, T - 1) at constant inputs.

    Steering angle (``delta`` and its ``change``) and speed are linear in time, so that Runge-Kutta
    becomes Simpson's rule, first for the orientation (and its value in the middle), then for the
    position. ``v`` is (T,), the other arrays are (T - 1,).
    """
    v_start, v_end = v[:-1], v[1:]
    speeds = np.array((v_start, v_start + v_end, v_end))
    tangent = np.tan(np.array((delta, delta + 0.5 * change, delta + change)))
    turned = _TURN @ (tangent * speeds * (_MEAN * (dt / wheelbase)))
    angle = turned + psi
    way = speeds * (_WAY * dt)
    moved = np.add.reduce(np.array((np.cos(angle) * way, np.sin(angle) * way)), axis=1)
    return turned[2], moved
