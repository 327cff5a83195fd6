"""Many trajectories of the single-track model at once, in the coordinates of the frame.

The state is where the centre is (s, l), its speed v, the direction chi of its velocity as seen from the
frame, and the slip angle beta = theta - psi. With b from the centre back to the rear axle,

    s' = v cos(chi) / (1 - kappa l),  l' = v sin(chi),  v' = a,
    chi' = v sin(beta) / b + beta' - kappa s',

which is CommonRoad's KS model (Althoff and Würsching, *CommonRoad: Vehicle Models*, 2020) referred to the
centre: tan(beta) = b / L tan(delta). The controls are the acceleration a, and beta', which stands for the
steering rate; both are constant over a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array

if TYPE_CHECKING:
    from repair.problem.limits import Limits
    from repair.vehicle.parameters import Vehicle

__all__ = ["Car", "Driven", "Tail", "drive_along", "drive_freely", "halved"]

_CRAWLS = 0.3  # below this speed [m/s] nobody steers: a path that stands has no direction
_ORIENTATION, _POSITION = 0.03, 0.02  # what the drivability checker allows [rad], [m]
_SPARE = 1.01  # what is taken across is counted as so much more: the axis bends within a step too
_CLOSE = 1.2  # [s] in which an offset is closed by the tail's law
_TURN = 0.35  # [s] in which a direction is taken up
_STEEPEST = 0.4  # direction that the tail's law asks for at most [rad]


@dataclass(frozen=True)
class Car:
    """What the vehicle may do, and the axis that it is seen from.

    Attributes
    ----------
    vehicle : Vehicle
    limits : Limits
    curvature : callable
        Of the axis [1/m] at s.
    dt : float
        Length of a step [s].
    slack : float
        Share of the drivability checker's tolerance of the orientation that faster steering may use.
    parts : int
        Steps of the integration to a step of the controls.
    each : int
        Steps to one of the scenario's, over which the drivability checker looks.
    """

    vehicle: Vehicle
    limits: Limits
    curvature: Callable[[Array], Array]
    dt: float
    slack: float
    parts: int = 1
    each: int = 1

    def acceleration(self, wanted: Array, v: Array, across: Array) -> Array:
        """The acceleration (N,) nearest to the wanted one that tyres, engine and speeds allow.

        Parameters
        ----------
        wanted, v, across : (N,) array
            Wanted acceleration, speed, and the lateral acceleration that there is anyway.
        """
        limits, dt = self.limits, self.dt
        grip = np.sqrt(np.maximum(limits.a_total**2 - (_SPARE * across) ** 2, 0.0))
        most = np.minimum(grip, limits.a_max)
        engine = 0.995 * self.vehicle.engine_acceleration(v + np.maximum(most, 0.0) * dt)
        a = np.minimum(np.maximum(wanted, np.maximum(-grip, limits.a_min)), np.minimum(most, engine))
        return np.asarray(np.minimum(np.maximum(a, -v / dt), np.maximum(limits.v_max - v, 0.0) / dt))

    def steered(self, beta: Array, v: Array, fast: Array) -> tuple[Array, Array]:
        """Slip angles (N,) that the steering reaches within a step, the smallest and the largest."""
        car, dt = self.vehicle, self.dt
        ratio = car.wheelbase / car.rear
        delta = np.arctan(ratio * np.tan(beta))
        v, step = np.maximum(v, 1.0), dt * self.each
        # How far a wheel that is ahead of what it can turns the body, and shifts it, until the step's end.
        over = np.minimum(_ORIENTATION * 2.0 / (v * step), _POSITION * 6.0 / (v * step) ** 2)
        rate = car.steering_rate_max * dt + self.slack * car.wheelbase * over / self.each
        most = 0.95 * car.steering_max
        low, high = np.maximum(delta - rate, -most), np.minimum(delta + rate, most)
        low, high = np.arctan(np.tan(low) / ratio), np.arctan(np.tan(high) / ratio)
        return np.where(fast, low, beta), np.where(fast, high, beta)


class Tail(NamedTuple):
    """From when on a path at an offset is followed: step (N,), and the offset [m] (N,)."""

    step: Array
    offset: Array


class Driven(NamedTuple):
    """States at the ends of the steps, and what holds within them.

    Attributes
    ----------
    s, l, v, chi, beta : (N, T + 1) array
        [m], [m], [m/s], [rad], [rad].
    a, rate : (N, T) array
        Acceleration [m/s²], and rate of the slip angle [rad/s].
    """

    s: Array
    l: Array  # noqa: E741
    v: Array
    chi: Array
    beta: Array
    a: Array
    rate: Array

    def take(self, rows: npt.NDArray[np.intp]) -> Driven:
        """Some of the trajectories."""
        return Driven(*(column[rows] for column in self))


def drive_freely(car: Car, start: Array, wanted: Array, turning: Array, tail: Tail) -> Driven:
    """Drive controls as far as the limits allow: first the acceleration, then what is left for the steering.

    Parameters
    ----------
    start : (5,) array
        s, l, v, chi and beta.
    wanted : (N, T) array
        Accelerations [m/s²].
    turning : (N, T) array
        Shares of the fastest steering, beyond what the bends of the axis take.
    tail : Tail
    """
    count, steps = wanted.shape
    dt, limits, b = car.dt, car.limits, car.vehicle.rear
    states, controls = np.empty((5, steps + 1, count)), np.empty((2, steps, count))
    states[:, 0] = start[:, None]
    widest = np.arcsin(min(limits.curvature * b, 0.99))
    for k in range(steps):
        s, l, v, chi, beta = states[:, k]  # noqa: E741
        kappa = car.curvature(s)
        across = v * v * np.sin(beta) / b
        a = car.acceleration(wanted[:, k], v, across)
        v1 = v + a * dt
        along = kappa * v * np.cos(chi) / (1.0 - kappa * l)
        asked = np.arctan(-(l - tail.offset) / np.maximum(v * _CLOSE, 1.0))
        asked = np.minimum(np.maximum(asked, -_STEEPEST), _STEEPEST)
        held = b * (along + (asked - chi) / _TURN) / np.maximum(v, 1.0)
        held = np.arcsin(np.minimum(np.maximum(held, -0.9), 0.9))
        low, high = car.steered(beta, v, (v > _CRAWLS) & (v1 > _CRAWLS))
        # What the bend of the axis takes until the end of the step, and the share of the fastest beyond it.
        ahead = car.curvature(s + v * dt)
        bent = beta + b * (ahead - kappa)
        free = np.where(turning[:, k] > 0.0, high - beta, beta - low) * turning[:, k] + bent
        rest = np.minimum(np.sqrt(np.maximum(limits.a_total**2 - a * a, 0.0)), limits.a_lat) / _SPARE
        beta1 = np.where(k >= tail.step, held, free)
        beta1 = np.minimum(np.maximum(beta1, -widest), widest)
        beta1 = np.minimum(np.maximum(beta1, low), high)
        beta1 = _gripping(beta1, beta, v, v1, across, rest, b, dt)
        rate = (beta1 - beta) / dt
        states[2, k + 1], states[4, k + 1] = v1, beta1
        controls[0, k], controls[1, k] = a, rate
        states[[0, 1, 3], k + 1] = _moved(car, np.array((s, l, chi)), v, beta, a, rate)
    return Driven(*np.swapaxes(states, 1, 2), *np.swapaxes(controls, 1, 2))


def _gripping(
    beta1: Array, beta: Array, v: Array, v1: Array, across: Array, rest: Array, b: float, dt: float
) -> Array:
    """The slip angle at the end of a step nearest to a wanted one with which the tyres hold throughout it.

    The lateral acceleration of the centre is v (v sin(beta) / b + beta'); ``rest`` is what it may be.
    """
    v, v1 = np.maximum(v, 0.1), np.maximum(v1, 0.1)
    first = beta + dt / v * (rest - across), beta - dt / v * (rest + across)
    slope = v1 * v1 / b + v1 / dt
    last = (rest + v1 * beta / dt) / slope, (-rest + v1 * beta / dt) / slope
    beta1 = np.minimum(np.maximum(beta1, first[1]), first[0])
    return np.minimum(np.maximum(beta1, last[1]), last[0])


def _moved(car: Car, here: Array, v: Array, beta: Array, a: Array, rate: Array) -> Array:
    """s, l and chi (3, N) at the end of a step: Runge-Kutta of order 4, the controls constant."""
    part = car.dt / car.parts
    for k in range(car.parts):
        here = _integrated(car, here, v + k * part * a, beta + k * part * rate, a, rate, part)
    return here


def _integrated(car: Car, here: Array, v: Array, beta: Array, a: Array, rate: Array, part: float) -> Array:
    """One step of :func:`_moved` of the length ``part`` [s]."""
    b = car.vehicle.rear

    def slopes(state: Array, since: float) -> Array:
        s, l, chi = state  # noqa: E741
        speed = v + a * since
        kappa = car.curvature(s)
        along = speed * np.cos(chi) / (1.0 - kappa * l)
        turned = speed * np.sin(beta + rate * since) / b + rate - kappa * along
        return np.array((along, speed * np.sin(chi), turned))

    k1 = slopes(here, 0.0)
    k2 = slopes(here + 0.5 * part * k1, 0.5 * part)
    k3 = slopes(here + 0.5 * part * k2, 0.5 * part)
    k4 = slopes(here + part * k3, part)
    return np.asarray(here + part / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))


def halved(car: Car, driven: Driven) -> Driven:
    """The same with the states in the middle of the steps as well; of a car that integrates in two parts."""
    half = 0.5 * car.dt
    s, l, v, chi, beta = (column[:, :-1] for column in driven[:5])  # noqa: E741
    a, rate = driven.a, driven.rate
    middle = _integrated(car, np.array((s, l, chi)), v, beta, a, rate, half)
    middles = middle[0], middle[1], v + half * a, middle[2], beta + half * rate
    states: list[Array] = []
    for ends, between in zip(driven[:5], middles, strict=True):
        both = np.empty((len(ends), 2 * ends.shape[1] - 1))
        both[:, ::2], both[:, 1::2] = ends, between
        states.append(both)
    s, l, v, chi, beta = states  # noqa: E741
    return Driven(s, l, v, chi, beta, a.repeat(2, axis=1), rate.repeat(2, axis=1))


def drive_along(car: Car, start: Array, wanted: Array) -> Driven:
    """As :func:`drive_freely`, on the axis itself: with the acceleration that its bends leave.

    Parameters
    ----------
    start : (5,) array
        Of which s, v and beta count.
    wanted : (N, T) array
        Accelerations [m/s²].
    """
    count, steps = wanted.shape
    dt, limits, b = car.dt, car.limits, car.vehicle.rear
    s, v, beta = np.empty((3, steps + 1, count))
    taken = np.empty((steps, count))
    s[0], v[0], beta[0] = start[0], start[2], start[4]
    for k in range(steps):
        here, there = car.curvature(s[k]), car.curvature(s[k] + v[k] * dt)
        bend = np.maximum(np.abs(here), np.abs(there))
        across = bend * np.maximum(v[k], v[k] + np.minimum(wanted[:, k], limits.a_max) * dt) ** 2
        a = taken[k] = car.acceleration(wanted[:, k], v[k], np.minimum(across, limits.a_total))
        v[k + 1] = v[k] + a * dt
        way = 0.5 * (v[k] + v[k + 1]) * dt
        s[k + 1] = s[k] + way
        # The body follows the bends as the rear axle does, b behind.
        steady = np.arcsin(np.minimum(np.maximum(0.5 * b * (here + there), -0.9), 0.9))
        beta[k + 1] = steady + (beta[k] - steady) * np.exp(-way / b)
    still = np.zeros((count, steps + 1))
    return Driven(s.T, still, v.T, still, beta.T, taken.T, np.diff(beta.T, axis=1) / dt)
