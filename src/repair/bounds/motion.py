"""What every motion of the vehicle from a start on has in common: the assumptions of a proof.

A motion is any path of a reference point of the vehicle whose acceleration is never larger than A, that is
not driven backwards, and whose body turns no faster than the steering allows. Two of them are in use
(docs/bound.md): the rear axle, whose velocity has the direction of the body, and the body's middle, whose
velocity is off it by the slip angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from repair.arrays import Array, wrap

__all__ = ["NEAR", "Motions", "Near", "Turning"]

_FINE = 4  # pieces of a step over which the rate of turning is bounded
_ANGLE = 1e-7  # by how much intervals of headings are widened against rounding [rad]
_STANDS = 0.1  # below this speed [m/s] the checker knows no direction of the middle


class Near(NamedTuple):
    """How far a start may be off and a proof holds all the same: whoever integrates gets a little else.

    Attributes
    ----------
    place, speed, heading, rate : float
        [m], [m/s], [rad], [rad/s].
    """

    place: float = 5e-4
    speed: float = 2e-3
    heading: float = 5e-4
    rate: float = 2e-3


NEAR = Near()


@dataclass(frozen=True)
class Turning:
    """Bounds at instants (I,), that of the start included.

    Attributes
    ----------
    low, high : (I,) array
        Between which the heading of the body is [rad].
    turned : (I,) array
        By how much the body turns at most since the start [rad]; between two instants by the difference.
    slip : (I,) array
        By how much the velocity is off the heading at most [rad].
    course, veer : float, (I,) array
        Direction of the velocity at the start, and by how much it differs from that at most [rad].
    forward, braking : (I - 1,) array
        Bounds on the acceleration along the velocity and against it, in the piece after each instant [m/s²].
    """

    low: Array
    high: Array
    turned: Array
    slip: Array
    course: float
    veer: Array
    forward: Array
    braking: Array


@dataclass(frozen=True)
class Motions:
    """All motions from one start.

    Attributes
    ----------
    position, velocity : (2,) array
        Of the reference point [m], [m/s].
    heading, yaw_rate : float
        Of the body [rad], [rad/s].
    acceleration : float
        Bound A on the reference point's acceleration [m/s²].
    curvature : float
        Bound on the body's turning per way of the reference point [1/m].
    rear : float
        How far the rear axle is behind the reference point [m]; 0 where it is that point.
    ahead : float
        How far the middle of the body is ahead of the reference point [m].
    half_length, half_width : float
        Of the body, with the margin that has to be kept [m].
    forward, braking : float
        Bounds on the acceleration along the velocity and against it [m/s²].
    power : float
        Bound on the acceleration along the velocity times the speed [m²/s³].
    """

    position: Array
    velocity: Array
    heading: float
    yaw_rate: float
    acceleration: float
    curvature: float
    rear: float
    ahead: float
    half_length: float
    half_width: float
    forward: float
    braking: float
    power: float

    @cached_property
    def speed(self) -> float:
        """Of the reference point at the start [m/s]."""
        return float(np.hypot(*self.velocity))

    def slowest(self, t: Array) -> Array:
        """Smallest speed until times [s] after the start [m/s]."""
        return np.asarray(np.maximum(self.speed - NEAR.speed - self.acceleration * t, 0.0))

    def fastest(self, t: Array) -> Array:
        """Largest speed until times [s] after the start [m/s]."""
        return np.asarray(self.speed + NEAR.speed + self.acceleration * t)

    @cached_property
    def corners(self) -> Array:
        """Corners (4, 2) of the body, seen from the reference point, anticlockwise [m]."""
        front, back, side = self.ahead + self.half_length, self.ahead - self.half_length, self.half_width
        return np.array([[front, side], [back, side], [back, -side], [front, -side]])

    @cached_property
    def reach(self) -> float:
        """How far the body reaches from the reference point [m]."""
        return float(np.hypot(*self.corners.T).max())

    def turning(self, times: Array) -> Turning:
        """Bounds at instants (I,) [s] since the start; the first is 0.

        Notes
        -----
        The velocity stays within A t of that at the start, so its direction within asin(A t / v0). The rate
        of turning is at most that of :meth:`_rate`, over small pieces at either end.
        """
        shares = np.arange(_FINE) / _FINE
        fine = np.append((times[:-1, None] + np.diff(times)[:, None] * shares).ravel(), times[-1])
        begin, end = fine[:-1], fine[1:]

        def turns(spin: float) -> Array:
            angles = np.cumsum((end - begin) * self._rate(begin, end, spin))
            return np.concatenate(([0.0], angles[_FINE - 1 :: _FINE])) * (1.0 + 1e-9)

        spin = abs(self.yaw_rate) + NEAR.rate
        turned = turns(spin)
        left, right = turned, turned
        if self.rear:
            left, right = (turns(max(sign * self.yaw_rate, 0.0) + NEAR.rate) for sign in (1.0, -1.0))
        slip = np.maximum.accumulate(self._slip(np.append(0.0, begin), np.append(0.0, end)))[::_FINE]
        gone = self.acceleration * times + NEAR.speed
        veer = np.where(gone < self.speed, np.arcsin(np.minimum(gone / max(self.speed, 1e-9), 1.0)), np.inf)
        if not self.rear:
            veer = veer + NEAR.heading
        course = self.heading
        if self.rear:
            course += float(wrap(math.atan2(self.velocity[1], self.velocity[0]) - self.heading))
        low = np.maximum(-right, np.minimum(0.0, course - veer - self.heading))
        high = np.minimum(left, np.maximum(0.0, course + veer - self.heading))
        low, high = (
            self.heading + x + sign * (NEAR.heading + _ANGLE) for x, sign in ((low, -1.0), (high, 1.0))
        )
        slow = np.maximum(self.speed - gone[1:], 1e-9)
        forward = np.minimum(np.minimum(self.forward, self.power / slow), self.acceleration)
        if self.rear:
            forward = np.where(slow > _STANDS, forward, self.acceleration)
        braking = np.full(len(forward), min(self.braking, self.acceleration))
        return Turning(low, high, turned, slip, course, veer + _ANGLE, forward, braking)

    def _rate(self, start: Array, end: Array, begin: float) -> Array:
        """Bound on the rate of turning to one side [rad/s] between two times [s] after the start (F,).

        ``begin`` is the rate to that side at the start, or 0. Of the rear axle: the largest of min(A / v,
        curvature v) over the speeds v that are possible. Of the middle: see :meth:`_across`.
        """
        a, most = self.acceleration, self.curvature * self.fastest(end)
        if self.rear:
            return np.asarray(np.minimum(most, self._across(start, end, begin) / self.rear))
        slow = self.slowest(end)
        fast = slow >= math.sqrt(a / self.curvature)
        return np.where(fast, a / np.maximum(slow, 1e-9), np.minimum(most, math.sqrt(a * self.curvature)))

    def _across(self, start: Array, end: Array, begin: float) -> Array:
        """Bound on the speed w of the middle across the body to one side [m/s] between two times (F,).

        w = rear * rate, and dw/dt = a_n - (v_r / rear) w, where the acceleration across the body is at most
        A and the rear axle's speed v_r at least r. So w is at most what the linear equation with r gives,
        which is monotonic in time.
        """
        axle = self._axle(end)
        return np.maximum(self._swing(start, begin, axle), self._swing(end, begin, axle))

    def _swing(self, t: Array, begin: float, axle: Array) -> Array:
        decay = axle * t / self.rear
        share = np.where(decay > 1e-9, -np.expm1(-decay) / np.maximum(decay, 1e-9), 1.0)
        return np.asarray(self.rear * begin * np.exp(-decay) + self.acceleration * t * share)

    def _axle(self, t: Array) -> Array:
        """Smallest speed of the rear axle [m/s] until times after the start (F,), of the middle's motions."""
        slow, spin = self.slowest(t), abs(self.yaw_rate) + NEAR.rate
        axle = slow * math.cos(self._largest_slip)
        for _ in range(4):
            across = np.maximum(self._swing(t, spin, axle), self.rear * spin)
            axle = np.maximum(axle, np.sqrt(np.maximum(slow * slow - across * across, 0.0)))
        return axle

    @cached_property
    def _largest_slip(self) -> float:
        return math.asin(min(self.rear * self.curvature, 1.0))

    def _slip(self, start: Array, end: Array) -> Array:
        """Bound on the slip angle [rad] between two times [s] after the start (F,)."""
        if not self.rear:
            return np.zeros(len(end))
        slow, most = self.slowest(end), self._largest_slip
        across = self._across(start, end, abs(self.yaw_rate) + NEAR.rate)
        slip = np.arcsin(np.minimum(across / np.maximum(slow, 1e-9), 1.0))
        return np.where(slow > 0.0, np.minimum(slip, most) + _ANGLE, most)
