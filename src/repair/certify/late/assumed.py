"""What every motion after a reaction keeps, by the scenario and the limits: formulas of this room's own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["OFF", "Assumed", "Headings", "assumed", "headings", "pushes"]

#: By how much the start of a proof may be off what is found here: [m], [m/s], [rad], [rad/s].
OFF = {"place": 5e-4, "speed": 2e-3, "heading": 5e-4, "rate": 2e-3}
_CUTS = 8  # between two instants
_UP = 1e-9  # outwards, far more than rounding [rad]
_SAMPLED = 1.01  # the checker looks every millisecond
_NO_COURSE = 0.1  # [m/s]


@dataclass(frozen=True)
class Assumed:
    """Bounds on the motion of a reference point, and the start.

    Attributes
    ----------
    point : str
        ``rear`` (axle) or ``middle`` (of the body).
    disc : float
        Of its acceleration [m/s²].
    bend : float
        Turning of the body per way of the point, at most [1/m].
    rear : float
        The rear axle is this far behind the middle [m].
    front, back, side : float
        How far the body reaches from the point [m].
    push, brake, power : float
        Along the velocity and against it [m/s²]; the former times the speed [m²/s³].
    vx, vy, heading, rate : float
        At the start [m/s], [rad], [rad/s].
    """

    point: str
    disc: float
    bend: float
    rear: float
    front: float
    back: float
    side: float
    push: float
    brake: float
    power: float
    vx: float
    vy: float
    heading: float
    rate: float

    @property
    def speed(self) -> float:
        """At the start [m/s]."""
        return math.hypot(self.vx, self.vy)

    def slow(self, t: float) -> float:
        """The least speed until a time [m/s]."""
        return max(self.speed - OFF["speed"] - self.disc * t, 0.0)


def assumed(kind: str, prepared: Prepared, start: Mapping[str, Any]) -> Assumed:
    """By the scenario's vehicle, the limits and the checker's settings."""
    car, limits, checker = prepared.scene.vehicle, prepared.limits, prepared.config.checker
    vx, vy = map(float, start["velocity_mps"])
    heading, rate = float(start["heading_rad"]), float(start["yaw_rate_radps"])
    half_length, half_width = 0.5 * car.length, 0.5 * car.width
    power = car.a_max * car.v_switch
    if kind == "vehicle":
        return Assumed(
            "rear", car.a_max, math.tan(car.steering_max) / car.wheelbase, car.rear,
            car.rear + half_length, half_length - car.rear, half_width,
            car.a_max, car.a_max, power, vx, vy, heading, rate,
        )  # fmt: skip
    if kind != "search":
        raise ValueError(f"a bound for {kind!r}, which is nobody")
    more, wide = _SAMPLED * (1.0 + checker.tolerance), checker.clearance
    slip = math.atan(car.rear / car.wheelbase * math.tan(car.steering_max))
    return Assumed(
        "middle", more * limits.a_total, math.sin(slip) / car.rear, car.rear,
        half_length + wide, half_length + wide, half_width + wide,
        more * limits.a_max, -more * limits.a_min, more * power, vx, vy, heading, rate,
    )  # fmt: skip


@dataclass(frozen=True)
class Headings:
    """At the instants: where the heading is, how much it has turned at most, slip; course and its spread."""

    low: list[float]
    high: list[float]
    turned: list[float]
    slip: list[float]
    course: float
    spread: list[float]


def headings(m: Assumed, instants: Sequence[float]) -> Headings:
    """Bounds on heading and course at the instants, the first of which is the start."""
    turned, left, right, slips = [0.0], [0.0], [0.0], [_slip(m, 0.0, 0.0)]
    spin = abs(m.rate) + OFF["rate"]
    to_left, to_right = (max(s * m.rate, 0.0) + OFF["rate"] for s in (1.0, -1.0))
    for begin, end in pairwise(instants):
        edges = [begin + (end - begin) * k / _CUTS for k in range(_CUTS + 1)]
        parts = list(pairwise(edges))
        for sums, first in ((turned, spin), (left, to_left), (right, to_right)):
            first = first if m.point == "middle" else spin
            sums.append(sums[-1] + sum((b - a) * _rate(m, a, b, first) for a, b in parts))
        slips.append(max(slips[-1], *(_slip(m, a, b) for a, b in parts)))
    course = m.heading
    if m.point == "middle" and m.speed > 0.0:
        course += math.remainder(math.atan2(m.vy, m.vx) - m.heading, 2.0 * math.pi)
    low, high, spread = [], [], []
    for k, t in enumerate(instants):
        reach = m.disc * t + OFF["speed"]
        veer = math.asin(reach / m.speed) if reach < m.speed else math.inf
        veer += 0.0 if m.point == "middle" else OFF["heading"]
        spread.append(veer + _UP)
        around = OFF["heading"] + _UP
        low.append(max(m.heading - right[k], min(m.heading, course - veer)) - around)
        high.append(min(m.heading + left[k], max(m.heading, course + veer)) + around)
    return Headings(low, high, turned, slips, course, spread)


def _rate(m: Assumed, begin: float, end: float, first: float) -> float:
    """Bound on the rate of turning in an interval of time; ``first`` is what it was at the start."""
    fast = m.speed + OFF["speed"] + m.disc * end
    if m.point == "middle":
        return min(m.bend * fast, _across(m, begin, end, first, _axle(m, end)) / m.rear)
    slow, best = m.slow(end), math.sqrt(m.disc / m.bend)
    if slow >= best:  # min(disc / v, bend v) falls from the best speed on
        return m.disc / slow
    return m.bend * min(fast, best)


def _across(m: Assumed, begin: float, end: float, first: float, axle: float) -> float:
    """Bound on the speed w of the middle across the body: dw/dt <= disc - (axle / rear) w."""
    found = 0.0
    for t in (begin, end):
        x = axle * t / m.rear
        gained = m.disc * t if x < 1e-9 else m.disc * m.rear / axle * (1.0 - math.exp(-x))
        found = max(found, m.rear * first * math.exp(-x) + gained)
    return found * (1.0 + 1e-12)


def _axle(m: Assumed, t: float) -> float:
    """Bound from below on the rear axle's speed: v_r² = v² - w²."""
    slow, first = m.slow(t), abs(m.rate) + OFF["rate"]
    axle = slow * math.sqrt(max(1.0 - (m.rear * m.bend) ** 2, 0.0))
    for _ in range(8):
        w = _across(m, 0.0, t, first, axle)
        axle = max(axle, math.sqrt(max(slow * slow - w * w, 0.0)))
    return axle * (1.0 - 1e-12)


def _slip(m: Assumed, begin: float, end: float) -> float:
    if m.point == "rear":
        return 0.0
    most, slow = math.asin(min(m.rear * m.bend, 1.0)), m.slow(end)
    if slow <= 0.0:
        return most + _UP
    w = _across(m, begin, end, abs(m.rate) + OFF["rate"], _axle(m, end))
    return min(most, math.asin(min(w / slow, 1.0))) + _UP


def pushes(m: Assumed, end: float) -> tuple[float, float]:
    """Bounds on the acceleration along the velocity and against it until a time [m/s²]."""
    slow = m.speed - OFF["speed"] - m.disc * end
    push = min(m.push, m.power / max(slow, 1e-9), m.disc)
    if m.point == "middle" and slow <= _NO_COURSE:  # the checker knows no direction there
        push = m.disc
    return push, min(m.brake, m.disc)
