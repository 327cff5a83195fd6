"""Controls by a few numbers, and the manoeuvres that every search begins with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.solvers.shooting.motion import Tail

__all__ = ["ALONG", "FREE", "Plan", "first_along", "first_freely"]

# When the pieces of constant acceleration end, and those of constant steering rate [s]: short ones first.
_PEDAL = (0.2, 0.4, 0.6, 0.9, 1.2, 1.6, 2.0, 2.6, 3.4)
_WHEEL = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.1, 2.4)
_WIDEST = 5.0  # offset of the path that is followed in the end [m]


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

    def accelerations(self, rows: Array, steps: int, dt: float, a_min: float, a_max: float) -> Array:
        """Of each step (N, T) [m/s²]."""
        share = rows[:, : len(_PEDAL) + 1][:, _pieces(_PEDAL, steps, dt)]
        return np.where(share < 0.0, -share * a_min, share * a_max)

    def steering(self, rows: Array, steps: int, dt: float) -> Array:
        """Share of the fastest steering in each step (N, T)."""
        begin = len(_PEDAL) + 1
        piece = np.minimum(_pieces(_WHEEL, steps, dt), len(_WHEEL) - 1)
        return np.asarray(rows[:, begin : begin + len(_WHEEL)][:, piece])

    def tail(self, rows: Array, dt: float) -> Tail:
        """When the path at an offset is followed."""
        return Tail(np.rint(rows[:, -2] / dt), rows[:, -1])


ALONG, FREE = Plan(False), Plan(True)


@lru_cache(maxsize=64)
def _pieces(ends: tuple[float, ...], steps: int, dt: float) -> npt.NDArray[np.intp]:
    """Which piece each step belongs to (T,)."""
    return np.searchsorted(np.array(ends), (np.arange(steps) + 0.5) * dt)


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
