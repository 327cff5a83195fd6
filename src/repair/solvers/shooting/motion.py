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

__all__ = ["Car", "Driven", "Tail", "direction", "drive_along", "drive_freely", "halved"]

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
        Steps of the integration to a step of the controls; 0 for a cheaper rule.
    each : int
        Steps to one of the scenario's, over which the drivability checker looks.
    """

    vehicle: Vehicle
    limits: Limits
    curvature: Callable[[Array], Array]
    dt: float
    slack: float
    parts: int = 0
    each: int = 1

    def acceleration(self, wanted: Array, v: Array, across: Array) -> Array:
        """The acceleration (N,) nearest to the wanted one that tyres, engine and speeds allow.

        Parameters
        ----------
        wanted, v, across : (N,) array
            Wanted acceleration, speed, and the lateral acceleration that there is anyway.
        """
        limits, dt = self.limits, self.dt
        car, across = self.vehicle, _SPARE * across
        grip = np.sqrt(np.maximum(limits.a_total**2 - across * across, 0.0))
        most = np.minimum(grip, limits.a_max)
        # Above v_switch the engine's power is what there is.
        engine = 0.995 * car.a_max * car.v_switch / np.maximum(v + most * dt, car.v_switch)
        most = np.minimum(np.minimum(most, engine), np.maximum(limits.v_max - v, 0.0) / dt)
        least = np.maximum(np.maximum(-grip, limits.a_min), v / -dt)
        return np.asarray(np.minimum(np.maximum(wanted, least), most))

    def steered(self, beta: Array, tan: Array, v: Array, fast: Array) -> tuple[Array, Array]:
        """Slip angles (N,) that the steering reaches within a step, the smallest and the largest.

        Parameters
        ----------
        beta, tan, v : (N,) array
            Slip angle, its tangent, and speed.
        fast : (N,) bool array
            Who steers at all.
        """
        car, dt = self.vehicle, self.dt
        ratio, step = car.wheelbase / car.rear, dt * self.each
        way = np.maximum(v, 1.0) * step
        # How far a wheel that is ahead of what it can turns the body, and shifts it, until the step's end.
        over = np.minimum(_ORIENTATION * 2.0 / way, _POSITION * 6.0 / (way * way))
        rate = car.steering_rate_max * dt + self.slack * car.wheelbase / self.each * over
        delta, most = np.arctan(ratio * tan), 0.95 * car.steering_max
        low = np.arctan(np.tan(np.maximum(delta - rate, -most)) / ratio)
        high = np.arctan(np.tan(np.minimum(delta + rate, most)) / ratio)
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
    along, aside : (N, T + 1) array
        Rates of s and l [m/s].
    """

    s: Array
    l: Array  # noqa: E741
    v: Array
    chi: Array
    beta: Array
    a: Array
    rate: Array
    along: Array
    aside: Array

    def take(self, rows: npt.NDArray[np.intp]) -> Driven:
        """Some of the trajectories."""
        return Driven(*(column.T[:, rows].T for column in self))


def drive_freely(car: Car, start: Array, wanted: Array, turning: Array, tail: Tail) -> Driven:
    """Drive controls as far as the limits allow: first the acceleration, then what is left for the steering.

    Parameters
    ----------
    start : (5,) or (5, N) array
        s, l, v, chi and beta.
    wanted : (N, T) array
        Accelerations [m/s²].
    turning : (N, T) array
        Shares of the fastest steering, beyond what the bends of the axis take.
    tail : Tail
    """
    count, steps = wanted.shape
    dt, limits, b = car.dt, car.limits, car.vehicle.rear
    states, controls = np.empty((7, steps + 1, count)), np.empty((2, steps, count))
    states[:5, 0] = start.reshape(5, -1)
    widest = np.arcsin(min(limits.curvature * b, 0.99))
    wanted, turning = np.ascontiguousarray(wanted.T), np.ascontiguousarray(turning.T)
    first, grip = tail.step.min(initial=steps), limits.a_total**2
    (tan, sin), (cos_chi, sin_chi) = _slope(states[4, 0]), direction(states[3, 0])
    for k in range(steps):
        s, l, v, chi, beta = states[:5, k]  # noqa: E741
        kappa, turn = car.curvature(s), v * sin / b
        across = v * turn
        a = car.acceleration(wanted[k], v, across)
        v1 = v + a * dt
        along, aside = v * cos_chi / (1.0 - kappa * l), v * sin_chi
        low, high = car.steered(beta, tan, v, np.minimum(v, v1) > _CRAWLS)
        # What the bend of the axis takes until the end of the step, and the share of the fastest beyond it.
        ahead, share = car.curvature(s + v * dt), turning[k]
        free = np.maximum(share, 0.0) * (high - beta) + np.minimum(share, 0.0) * (beta - low)
        beta1 = free + (beta + b * (ahead - kappa))
        if k >= first:
            asked = np.arctan((tail.offset - l) / np.maximum(v * _CLOSE, 1.0))
            asked = np.minimum(np.maximum(asked, -_STEEPEST), _STEEPEST)
            held = b * (kappa * along + (asked - chi) / _TURN) / np.maximum(v, 1.0)
            held = np.arcsin(np.minimum(np.maximum(held, -0.9), 0.9))
            beta1 = np.where(k >= tail.step, held, beta1)
        beta1 = np.minimum(np.maximum(beta1, -widest), widest)
        beta1 = np.minimum(np.maximum(beta1, low), high)
        rest = np.minimum(np.sqrt(np.maximum(grip - a * a, 0.0)), limits.a_lat) / _SPARE
        beta1 = _gripping(beta1, beta, v, v1, across, rest, b, dt)
        rate, sin0 = (beta1 - beta) / dt, sin
        tan, sin = _slope(beta1)
        states[2, k + 1], states[4, k + 1], states[5, k], states[6, k] = v1, beta1, along, aside
        controls[0, k], controls[1, k] = a, rate
        if car.parts:
            states[[0, 1, 3], k + 1] = _moved(car, np.array((s, l, chi)), v, beta, a, rate)
            cos_chi, sin_chi = direction(states[3, k + 1])
            continue
        # A cheaper step, while searching: Simpson's rule for the turning, which the place does not act on,
        # and then for the way, the axis bending evenly over it.
        middle, even = 0.5 * (v + v1), 0.5 * (kappa + ahead)
        change = beta1 - beta
        between, last = middle * (sin0 + sin) * (0.5 / b + 0.0625 / b * change * change), v1 * sin / b
        half = chi + 0.5 * change + dt / 24.0 * (5.0 * turn + 8.0 * between - last)
        half -= 0.25 * dt * (kappa + even) * (along + 0.25 * dt * a)
        cos, sin_half = direction(half)
        sideways = middle * sin_half
        forward = middle * cos / (1.0 - even * (l + 0.25 * dt * (aside + sideways)))
        chi1 = chi + change + dt / 6.0 * (turn + 4.0 * between + last) - dt * even * forward
        cos_chi, sin_chi = direction(chi1)
        l1 = l + dt / 6.0 * (aside + 4.0 * sideways + v1 * sin_chi)
        s1 = s + dt / 6.0 * (along + 4.0 * forward + v1 * cos_chi / (1.0 - ahead * l1))
        states[0, k + 1], states[1, k + 1], states[3, k + 1] = s1, l1, chi1
    s, l, v = states[:3, steps]  # noqa: E741
    states[5, steps], states[6, steps] = v * cos_chi / (1.0 - car.curvature(s) * l), v * sin_chi
    s, l, v, chi, beta, along, aside = np.swapaxes(states, 1, 2)  # noqa: E741
    a, rate = np.swapaxes(controls, 1, 2)
    return Driven(s, l, v, chi, beta, a, rate, along, aside)


def _slope(angle: Array) -> tuple[Array, Array]:
    """Tangent and sine of angles (N,) below a right one: NumPy's own sine takes several times as long."""
    tan = np.tan(angle)
    return tan, tan / np.sqrt(1.0 + tan * tan)


def direction(angle: Array) -> tuple[Array, Array]:
    """Cosine and sine of angles (N,), by the tangent of half of them."""
    half = np.tan(0.5 * angle)
    share = 2.0 / (1.0 + half * half)
    return share - 1.0, share * half


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
    s, l, chi = _integrated(car, np.array((s, l, chi)), v, beta, a, rate, half)  # noqa: E741
    v = v + half * a
    middle = s, l, v, chi, beta + half * rate, v * np.cos(chi) / (1.0 - car.curvature(s) * l), v * np.sin(chi)
    states: list[Array] = []
    for ends, between in zip((*driven[:5], *driven[7:]), middle, strict=True):
        both = np.empty((len(ends), 2 * ends.shape[1] - 1))
        both[:, ::2], both[:, 1::2] = ends, between
        states.append(both)
    s, l, v, chi, beta, along, aside = states  # noqa: E741
    return Driven(s, l, v, chi, beta, a.repeat(2, axis=1), rate.repeat(2, axis=1), along, aside)


def drive_along(car: Car, start: Array, wanted: Array) -> Driven:
    """As :func:`drive_freely`, on the axis itself: with the acceleration that its bends leave.

    Parameters
    ----------
    start : (5,) or (5, N) array
        Of which s, v and beta count.
    wanted : (N, T) array
        Accelerations [m/s²].
    """
    count, steps = wanted.shape
    dt, limits, b = car.dt, car.limits, car.vehicle.rear
    s, v, beta = np.empty((3, steps + 1, count))
    taken = np.empty((steps, count))
    s[0], v[0], beta[0] = start[0], start[2], start[4]
    wanted = np.ascontiguousarray(wanted.T)
    most = np.minimum(wanted, limits.a_max) * dt
    bends = np.empty((steps, count))
    for k in range(steps):
        here, there = car.curvature(s[k]), car.curvature(s[k] + v[k] * dt)
        bends[k] = here + there
        fastest = np.maximum(v[k], v[k] + most[k])
        across = np.maximum(np.abs(here), np.abs(there)) * (fastest * fastest)
        a = taken[k] = car.acceleration(wanted[k], v[k], np.minimum(across, limits.a_total))
        v[k + 1] = v[k] + a * dt
        s[k + 1] = s[k] + 0.5 * (v[k] + v[k + 1]) * dt
    # The body follows the bends as the rear axle does, b behind.
    steady = np.arcsin(np.minimum(np.maximum(0.5 * b * bends, -0.9), 0.9))
    left = np.exp((s[:-1] - s[1:]) / b)
    for k in range(steps):
        beta[k + 1] = steady[k] + (beta[k] - steady[k]) * left[k]
    still = np.zeros((steps + 1, count)).T
    return Driven(s.T, still, v.T, still, beta.T, taken.T, np.diff(beta, axis=0).T / dt, v.T, still)
