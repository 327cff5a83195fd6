"""Controls by a few numbers, and the manoeuvres that every search begins with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.solvers.shooting.motion import Tail
from repair.timegrid import INSTANT, SHORT, STEP, intervals, steps_until

__all__ = ["ALONG", "FREE", "Plan", "Steps", "first_along", "first_freely"]

# When the pieces of constant acceleration end, and those of constant steering rate [s]: short ones first.
_PEDAL = (0.2, 0.4, 0.6, 0.9, 1.2, 1.6, 2.0, 2.6, 3.4)
_WHEEL = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.1, 2.4)
_PARTS = 10  # of a scenario's step at most
_WIDEST = 5.0  # offset of the path that is followed in the end [m]


@dataclass(frozen=True)
class Steps:
    """The steps that are driven, within which no control changes: whole parts of the scenario's, or several.

    Attributes
    ----------
    count : int
    dt : float
        Length of each [s].
    lead : int
        How many of the first ones belong to a step of the scenario that has begun before t_rep: the
        reference has decided about its acceleration.
    each : int
        How many there are to a step of the scenario.
    straight : int
        How many of the first ones are driven as the reference steers.
    """

    count: int
    dt: float
    lead: int = 0
    each: int = 1
    straight: int = 0

    @classmethod
    def between(cls, t_rep: float, t_end: float, dt: float) -> Steps:
        """From ``t_rep`` to ``t_end``, of a scenario with steps of ``dt`` [s].

        Where the scenario's steps and t_rep have no small step in common, the steps begin at t_rep. Of short
        steps of the scenario several are one.
        """
        rest = intervals(t_rep, dt) * dt - t_rep
        for each in range(1, _PARTS + 1):
            lead = rest * each / dt
            if abs(lead - round(lead)) <= STEP * each:
                first = round(lead)
                # The body stands as it does at the very start, and a path that bends at once would turn it.
                straight = each if t_rep < INSTANT else first
                if each == 1 and dt < SHORT * (1.0 - STEP):
                    joined = steps_until(SHORT, dt) * dt
                    return cls(max(intervals(t_end - t_rep, joined), 1), joined, straight=straight)
                count = max(intervals(t_end - t_rep, dt / each), 1)
                return cls(count, dt / each, first, each, straight)
        return cls(max(intervals(t_end - t_rep, dt), 1), dt)

    @property
    def middles(self) -> Array:
        """When the scenario's step of each of them is half over, since the first whole one began (T,) [s]."""
        step = (np.arange(self.count) - self.lead) // self.each
        return np.asarray((step + 0.5) * (self.dt * self.each))


@dataclass(frozen=True)
class Plan:
    """What the numbers of a row are.

    Attributes
    ----------
    steers : bool
        Whether there is anything but accelerations: shares of the fastest steering, when that ends [s] and
        the offset of the path that is followed then [m].
    """

    steers: bool

    @property
    def size(self) -> int:
        """How many numbers."""
        return len(_PEDAL) + 1 + (len(_WHEEL) + 2 if self.steers else 0)

    @property
    def spread(self) -> Array:
        """How far the first draws reach (D,)."""
        spread = np.full(self.size, 0.4)
        if self.steers:
            spread[-2:] = 0.4, 0.8
        return spread

    def kept(self, rows: Array) -> Array:
        """The rows (N, D) with every number in its range."""
        low, high = np.full(self.size, -1.0), np.ones(self.size)
        if self.steers:
            low[-2:], high[-2:] = (0.0, -_WIDEST), (_WHEEL[-1], _WIDEST)
        return np.asarray(np.minimum(np.maximum(rows, low), high))

    def accelerations(self, rows: Array, steps: Steps, begun: float, a_min: float, a_max: float) -> Array:
        """Of each step (N, T) [m/s²]; ``begun`` is that of the scenario's step that has begun already."""
        share = rows[:, : len(_PEDAL) + 1][:, _pieces(_PEDAL, steps)]
        wanted = np.where(share < 0.0, -share * a_min, share * a_max)
        wanted[:, : steps.lead] = begun
        return wanted

    def steering(self, rows: Array, steps: Steps) -> Array:
        """Share of the fastest steering in each step (N, T)."""
        begin = len(_PEDAL) + 1
        piece = np.minimum(_pieces(_WHEEL, steps), len(_WHEEL) - 1)
        share = np.asarray(rows[:, begin : begin + len(_WHEEL)][:, piece])
        share[:, : steps.straight] = 0.0
        return share

    def tail(self, rows: Array, steps: Steps) -> Tail:
        """When the path at an offset is followed."""
        whole = np.rint(rows[:, -2] / (steps.dt * steps.each)) * steps.each + steps.lead
        return Tail(np.maximum(whole, steps.straight), rows[:, -1])


ALONG, FREE = Plan(False), Plan(True)


@lru_cache(maxsize=64)
def _pieces(ends: tuple[float, ...], steps: Steps) -> npt.NDArray[np.intp]:
    """Which piece each step belongs to (T,)."""
    return np.searchsorted(np.array(ends), steps.middles)


def _pedal(first: float, until: float, then: float) -> Array:
    ends = np.array((*_PEDAL, np.inf))
    return np.where(ends <= until + 1e-9, first, then)


@lru_cache(maxsize=1)
def first_along() -> Array:
    """One acceleration, then another (N, D)."""
    rows = [
        _pedal(first, until, then)
        for first in (-1.0, -0.8, -0.6, -0.4, -0.2, 0.0, 0.3, 0.6, 1.0)
        for until in (0.4, 0.9, 1.6, 2.6, np.inf)
        for then in (-1.0, -0.5, 0.0, 0.5, 1.0)
        if until < np.inf or then == 0.0
    ]
    return frozen(rows)


@lru_cache(maxsize=1)
def first_freely() -> Array:
    """Braking and accelerating, each with swerves to both sides, sharp and smooth (N, D)."""
    pedals = [
        _pedal(first, until, then)
        for first, until, then in (
            (0.0, np.inf, 0.0), (-1.0, np.inf, -1.0), (-0.5, np.inf, -0.5), (1.0, np.inf, 1.0),
            (-1.0, 0.6, 0.0), (0.0, 0.6, -1.0), (0.0, 1.2, -1.0), (-0.75, 1.6, 0.0), (1.0, 1.2, 0.0),
        )
    ]  # fmt: skip
    wheels = [np.concatenate((np.zeros(len(_WHEEL) + 1), [0.0]))]
    ends = np.array(_WHEEL)
    for side in (1.0, -1.0):
        for offset in (0.7, 1.5, 2.5, 3.5):
            for pulse in (0.0, 0.2, 0.4, 0.6):
                # To one side, twice as long to the other, and straight again.
                share = np.where(ends <= pulse + 1e-9, side, np.where(ends <= 3.0 * pulse + 1e-9, -side, 0.0))
                wheels.append(np.concatenate((share, [min(3.0 * pulse, ends[-1]), side * offset])))
    return frozen([np.concatenate((pedal, wheel)) for pedal in pedals for wheel in wheels])
