"""Which transitions of the single-track model are clearly drivable: each held against every limit.

The drivability checker's own test runs an optimiser on every transition (6 to 14 ms each).
:func:`direct_check` answers in microseconds for transitions that are clearly drivable;
:func:`repair.vehicle.commonroad_ks.official_check` asks the drivability checker about the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = [
    "ACCEPTED",
    "ENGINE",
    "LIMITS",
    "ORIENTATION_TOLERANCE",
    "POSITION_TOLERANCE",
    "STEERING_RATE",
    "KinematicReport",
    "direct_check",
    "engine_share",
    "transition_errors",
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
STEERING_RATE = 0.9
ACCEPTED = (math.inf, 0.95, 0.98, 0.9, 0.9, 0.5, 0.4)
_ACCEPT = np.array(ACCEPTED)[:, None]
# Where the model cuts the acceleration off (engine power above v_switch, top speed) the cost is flat,
# and the optimiser, which overshoots, stays there if that is already better than its start at zero:
# from half of the limit on. Where staying there misses the place by less than is tolerated, it is a yes all
# the same: a step of 0.1 s at 3.6 m/s^2.
ENGINE = 0.45
_STANDS = 2.0 * 0.9 * POSITION_TOLERANCE


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


def direct_check(states: DrivenStates, dt: float, vehicle: Vehicle) -> KinematicReport:
    """Accept the transitions that are clearly drivable for the KS model, wherever they are.

    Only differences of places count: a metre in 5e6 m is resolved to 1e-9 m, a ten millionth of what is
    tolerated.

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
    # The engine's limit falls over a step on which the vehicle gains speed: the speed at its end decides.
    engine = vehicle.engine_acceleration(v[1:])
    lateral = vehicle.lateral_acceleration(v[:-1], delta[:-1])
    overshoot = 2.0 * v[1:] - v[:-1]  # the optimiser's: see ENGINE
    fastest, slowest = np.maximum(v[:-1], overshoot), np.minimum(v[:-1], overshoot)
    position, orientation = transition_errors(states, dt, vehicle)
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
    cut = (acceleration > 0.0) & (engine < vehicle.a_max)
    row = LIMITS.index("acceleration")
    accept[row, cut] = engine_share(engine[cut], dt)
    room = 1.0 - use / accept
    worst = np.argmin(room, axis=0)
    margin = room[worst, np.arange(room.shape[1])]
    ok = margin >= 0.0
    worst[~ok & (use[0] > STEERING_RATE)] = LIMITS.index("steering_rate")  # the error comes from the cut
    return KinematicReport(ok, margin, worst, use)


def engine_share(engine: Array, dt: float) -> Array:
    """Share of what the engine gives that is accepted where it limits the acceleration.

    Parameters
    ----------
    engine : array
        What it gives [m/s^2].
    dt : float
        Time step [s].
    """
    most = ACCEPTED[LIMITS.index("acceleration")]
    share: Array = np.clip(_STANDS / dt**2 / engine, ENGINE, most)
    return share


def transition_errors(states: DrivenStates, dt: float, vehicle: Vehicle) -> tuple[Array, Array]:
    """By how much the next states miss the simulated ones.

    Parameters
    ----------
    states : DrivenStates
        At the scenario's time steps, T of them.
    dt : float
        Time step [s].
    vehicle : Vehicle

    Returns
    -------
    position, orientation : (T - 1,) array
        Of the rear axle, along the axis on which it is larger [m]; and of the body [rad].
    """
    psi, delta = states.orientation, states.steering
    most = dt * STEERING_RATE * vehicle.steering_rate_max
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
