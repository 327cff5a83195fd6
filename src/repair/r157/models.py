"""Driver models named by UN Regulation No. 157, and those published beside them.

All work on arrays (N,), one entry a point. Each is there in two readings: ``stated``, as the regulation has
it, and otherwise as the published implementation has it (``docs/r157.md`` names each difference).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Protocol

import numpy as np

from repair.arrays import Array
from repair.r157.cases import GRAVITY, LENGTH, Flags
from repair.r157.motion import HEADWAY
from repair.timegrid import INSTANT

__all__ = [
    "FULL",
    "MODELS",
    "Careful",
    "DriverModel",
    "Fuzzy",
    "Regulation",
    "Rss",
    "Seen",
    "ttc",
]

FULL = 0.774 * GRAVITY  # what all but the regulation's formula brake with [m/s²]
JERK = 12.65  # how fast that is reached [m/s³]: 0.6 s


@dataclass(frozen=True)
class Seen:
    """What a driver sees at a sample; arrays (N,).

    Attributes
    ----------
    time : float
        Since the start [s].
    cut_in : bool
        Whether somebody comes from the lane beside.
    speed, ahead : array
        Own, and of who is reacted to [m/s].
    gap : array
        From the own front to that one's rear [m]; negative beside it.
    clearance : array
        Between the facing sides [m]; negative where they overlap, in other cases always.
    lateral : array
        Its lateral speed [m/s].
    exposed_for : array
        For how long there has been somebody to react to [s], negative where there is nobody yet: he (in the
        cut-out: the lead) is seen to leave his lane, or the lead is struck; from the start on in the
        deceleration case.
    braking : array
        Own deceleration now [m/s²].
    """

    time: float
    cut_in: bool
    speed: Array
    ahead: Array
    gap: Array
    clearance: Array
    lateral: Array
    exposed_for: Array
    braking: Array

    @property
    def exposed(self) -> Flags:
        """Whether there is somebody to react to."""
        return self.exposed_for >= 0.0


class DriverModel(Protocol):
    """A driver that brakes.

    Attributes
    ----------
    stated : bool
        Whether it is read as the regulation has it.
    name : str
    delay : float
        From the danger to the brake [s].
    cases : tuple of str
        Begins of the names of the cases that it says something about.
    latched : bool
        Whether a danger once seen stays one until the speed ahead is reached.
    keeps : bool
        Whether, in the published numerics, the brake comes back where it was left.
    """

    @property
    def stated(self) -> bool: ...  # noqa: D102

    name: ClassVar[str]
    delay: ClassVar[float]
    cases: ClassVar[tuple[str, ...]]
    latched: ClassVar[bool]
    keeps: ClassVar[bool]

    def following(self, speed: Array) -> Array:
        """Gap to a lead [m] at which the published cases begin."""
        ...

    def dangerous(self, seen: Seen) -> Flags:
        """Whether something has to be done."""
        ...

    def brake(self, seen: Seen, step: float) -> Array:
        """Deceleration over the next ``step`` [s], once the delay is over [m/s²]."""
        ...


def ttc(seen: Seen) -> Array:
    """Time-to-collision lengthwise [s]; infinite where nobody gets nearer."""
    closing = seen.speed - seen.ahead
    apart = closing > 0.0
    return np.asarray(np.divide(seen.gap, closing, out=np.full_like(closing, np.inf), where=apart))


def _ramped(seen: Seen, step: float, most: Array | float) -> Array:
    return np.asarray(np.minimum(most, seen.braking + JERK * step))


@dataclass(frozen=True)
class Careful:
    """The careful and competent human driver.

    Source: UN Regulation No. 157, Annex 4, Appendix 3 (01 series: Annex 3). Somebody who is more than 0.375 m
    off the middle of his lane is seen to leave it; 0.4 s to evaluate the risk, 0.75 s to the brake, 0.6 s to
    0.774 g, and 0.85 g once somebody who cuts in is wholly in the lane. A risk is a TTC of at most 2 s.

    In the published implementation a cut-in is looked at from the first overlap on, and dismissed for
    good if the TTC is then above 2 s; during the delay 0.4 m/s² is braked; 0.85 g is not used.
    """

    stated: bool = True
    name: ClassVar[str] = "CC"
    cases: ClassVar[tuple[str, ...]] = ("cut_in", "cut_out", "deceleration")
    delay: ClassVar[float] = 0.75
    keeps: ClassVar[bool] = False
    latched: ClassVar[bool] = True
    evaluation: ClassVar[float] = 0.4  # [s]
    limit: ClassVar[float] = 2.0  # of the TTC [s]
    coasting: ClassVar[float] = 0.4  # during the delay, in the published implementation [m/s²]
    wrapped: ClassVar[float] = 0.85 * GRAVITY  # [m/s²]

    def following(self, speed: Array) -> Array:
        """2 s."""
        return HEADWAY * speed

    def dangerous(self, seen: Seen) -> Flags:
        """Overlap, or having seen for long enough that somebody comes, with a TTC below the limit."""
        if self.stated:
            known = seen.exposed_for >= self.evaluation - INSTANT
            return known & (ttc(seen) <= self.limit) if seen.cut_in else known
        return seen.clearance <= 0.0 if seen.cut_in else seen.exposed

    def brake(self, seen: Seen, step: float) -> Array:
        """Ramp up to 0.774 g; to 0.85 g where somebody who cut in is wholly in the lane."""
        if not self.stated or not seen.cut_in:
            return _ramped(seen, step, FULL)
        return _ramped(seen, step, np.where(seen.lateral > 0.0, FULL, self.wrapped))


@dataclass(frozen=True)
class Rss:
    """Responsibility-sensitive safety, reacting where both its distances are violated.

    Source: Shalev-Shwartz, Shammah and Shashua, *On a formal model of safe and scalable self-driving
    cars*, 2017, definitions 1 and 6; response time 0.75 s, acceleration until then 3 m/s², braking 6 m/s² for
    both, to the side a margin of 0.3 m and 1 m/s², as in the published comparison.
    """

    stated: bool = True
    name: ClassVar[str] = "RSS"
    cases: ClassVar[tuple[str, ...]] = ("cut_in", "cut_out", "deceleration")
    delay: ClassVar[float] = 0.75
    keeps: ClassVar[bool] = True
    latched: ClassVar[bool] = False
    gains: ClassVar[float] = 3.0  # [m/s²]
    slows: ClassVar[float] = 6.0  # [m/s²]
    margin: ClassVar[float] = 0.3  # [m]
    sideways: ClassVar[float] = 1.0  # [m/s²]

    def lengthwise(self, speed: Array, ahead: Array) -> Array:
        """Safe distance behind somebody [m]."""
        rho, late = self.delay, speed + self.delay * self.gains
        way = speed * rho + 0.5 * self.gains * rho**2
        return np.asarray(way + (late**2 - ahead**2) / (2.0 * self.slows))

    def aside(self, lateral: Array) -> Array:
        """Safe distance beside somebody who comes nearer [m]."""
        rho, late = self.delay, np.abs(lateral) + self.delay * self.sideways
        way = (np.abs(lateral) + late) * rho / 2.0
        return np.asarray(self.margin + way + late**2 / (2.0 * self.sideways))

    def following(self, speed: Array) -> Array:
        """Safe once a lead has braked for the response time, and what it has come nearer by then."""
        rho = self.delay
        slower = np.maximum(speed - self.slows * rho, 0.0)
        return np.asarray(self.lengthwise(speed, slower) + 0.5 * self.slows * rho**2)

    def dangerous(self, seen: Seen) -> Flags:
        """Both distances violated."""
        near = seen.gap < self.lengthwise(seen.speed, seen.ahead)
        return near & (seen.clearance < self.aside(seen.lateral) if seen.cut_in else seen.exposed)

    def brake(self, seen: Seen, step: float) -> Array:
        """Ramp up to 0.774 g."""
        return _ramped(seen, step, FULL)


@dataclass(frozen=True)
class Fuzzy:
    """The Fuzzy Safety Model.

    Source: UN Regulation No. 157, 01 series, Annex 3; Mattas et al., *Fuzzy Surrogate Safety Metrics for
    real-time assessment of rear-end collision risk*, Accident Analysis and Prevention, 2020. Reaction
    0.75 s, comfortable and largest own braking 4 and 6 m/s², of the lead 7 m/s², 2 m of distance at rest.
    Proactive (PFS) and critical (CFS) fuzzy safety are 1 below an unsafe distance, 0 above a safe one, linear
    between; what is braked is ``CFS (6 - 4) + 4`` where CFS > 0, and ``PFS 4`` elsewhere.
    """

    stated: bool = True
    name: ClassVar[str] = "FSM"
    cases: ClassVar[tuple[str, ...]] = ("cut_in", "cut_out", "deceleration")
    delay: ClassVar[float] = 0.75
    keeps: ClassVar[bool] = False
    latched: ClassVar[bool] = False
    comfort: ClassVar[float] = 4.0  # [m/s²]
    hard: ClassVar[float] = 6.0  # [m/s²]
    lead: ClassVar[float] = 7.0  # [m/s²]
    rest: ClassVar[float] = 2.0  # [m]
    gate: ClassVar[float] = 0.1  # [s]

    def following(self, speed: Array) -> Array:
        """Where PFS begins behind somebody as fast, and as much again as is kept at rest."""
        stop = speed**2 / (2.0 * self.comfort) - speed**2 / (2.0 * self.lead)
        return np.asarray(speed * self.delay + stop + 2.0 * self.rest)

    def comes(self, seen: Seen) -> Flags:
        """The lateral gate: it is in the lane before the ego has passed it."""
        closing = seen.speed - seen.ahead
        room = np.maximum(seen.clearance, 0.0)
        beside = np.divide(room, seen.lateral, out=np.full_like(room, np.inf), where=seen.lateral > 0.0)
        passed = (seen.gap + 2.0 * LENGTH) / np.maximum(closing, 1e-12) + self.gate
        return (seen.clearance <= 0.0) | ((closing > 0.0) & (beside < passed))

    def safe(self, seen: Seen) -> Array:
        """Safe distance of PFS [m]."""
        own, far = seen.speed, seen.ahead**2 / (2.0 * self.lead)
        return np.asarray(own * self.delay + own**2 / (2.0 * self.comfort) - far + self.rest)

    def proactive(self, seen: Seen) -> Array:
        """PFS."""
        own, far = seen.speed, seen.ahead**2 / (2.0 * self.lead)
        unsafe = own * self.delay + own**2 / (2.0 * self.hard) - far
        return _between(seen.gap - self.rest, unsafe, self.safe(seen))

    def critical(self, seen: Seen) -> Array:
        """CFS."""
        own, ahead, now = seen.speed, seen.ahead, -seen.braking
        held = np.maximum(now, -self.comfort)
        then = own + held * self.delay
        slowing = np.abs(2.0 * (held if self.stated else now))
        way = np.divide((own - ahead) ** 2, slowing, out=np.zeros_like(own), where=slowing > 0.0)
        further = ((own + then) / 2.0 - ahead) * self.delay
        late = then <= ahead
        safe = np.where(late, way, further + (then - ahead) ** 2 / (2.0 * self.comfort))
        unsafe = np.where(late, way, further + (then - ahead) ** 2 / (2.0 * self.hard))
        return np.where(own <= ahead, 0.0, _between(seen.gap, unsafe, safe))

    def dangerous(self, seen: Seen) -> Flags:
        """PFS or CFS above 0."""
        edge = 0.0 if self.stated else INSTANT  # the published cases begin on it
        near = (seen.gap - self.rest < self.safe(seen) + edge) | (self.critical(seen) > 0.0)
        return near & (self.comes(seen) if seen.cut_in else seen.exposed)

    def brake(self, seen: Seen, step: float) -> Array:
        """As fuzzy safety has it; what rises is limited in jerk, what falls is not."""
        critical = self.critical(seen)
        hard = critical * (self.hard - self.comfort) + self.comfort
        return _ramped(seen, step, np.where(critical > 0.0, hard, self.proactive(seen) * self.comfort))


def _between(x: Array, unsafe: Array, safe: Array) -> Array:
    """1 below ``unsafe``, 0 above ``safe``, linear between."""
    wide = safe - unsafe
    part = np.divide(safe - x, wide, out=np.zeros_like(x), where=wide != 0.0)
    return np.where(x < unsafe, 1.0, np.where(x > safe, 0.0, part))


@dataclass(frozen=True)
class Regulation:
    """What the regulation requires of the system itself in a cut-in: its TTC formula.

    Source: UN Regulation No. 157, 5.2.5.2: a collision is to be avoided if the TTC at the lane intrusion is
    above v_rel / (2 6 m/s²) + 0.35 s, for somebody whose lateral motion was to be seen for 0.72 s; the
    intrusion is 0.3 m beyond the marking, which leaves 0.5 m beside a vehicle in the middle of its lane. Who
    does so brakes with 6 m/s² from 0.35 s after the intrusion on.

    In the published implementation it begins 0.35 s after the TTC has fallen to v_rel / 12 + 0.45 s.
    """

    stated: bool = True
    name: ClassVar[str] = "Reg157"
    cases: ClassVar[tuple[str, ...]] = ("cut_in",)
    delay: ClassVar[float] = 0.35
    keeps: ClassVar[bool] = False
    latched: ClassVar[bool] = True
    slows: ClassVar[float] = 6.0  # [m/s²]
    visible: ClassVar[float] = 0.72  # [s]
    intrusion: ClassVar[float] = 0.5  # clearance [m]

    def following(self, speed: Array) -> Array:
        """None: the formula says nothing about leads."""
        return np.full_like(speed, np.nan)

    def dangerous(self, seen: Seen) -> Flags:
        """Somebody slower who has intruded."""
        closing = seen.speed - seen.ahead
        inside = (seen.clearance <= self.intrusion) & (closing > 0.0)
        if self.stated:
            return inside & (seen.time >= self.visible)
        return inside & (np.abs(ttc(seen)) <= closing / (2.0 * self.slows) + 0.45)

    def brake(self, seen: Seen, step: float) -> Array:
        """6 m/s², at once."""
        return np.full_like(seen.speed, self.slows)


MODELS: Mapping[str, type[Careful] | type[Rss] | type[Fuzzy] | type[Regulation]] = MappingProxyType(
    {model.name: model for model in (Careful, Rss, Fuzzy, Regulation)}
)
"""Name to class."""
