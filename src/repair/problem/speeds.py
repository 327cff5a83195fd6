"""How the speed may go on: profiles rolled out together from a state on, and what the bends leave of them."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, largest
from repair.problem.limits import Limits

__all__ = ["Bends", "Rollouts", "speed_profiles"]

# Shares of the acceleration limits, and of the start speed, that are rolled out.
_BRAKING = (0.125, 0.25, 0.5, 0.75, 1.0)
_THROTTLE = (0.5, 1.0)
_GAINS = (2.0, 5.0, 50.0)
_DELAYS = (0.0, 1.5, 3.0)
_HOLD = (0.0, 0.2, 0.4, 0.6, 0.8)
# Share of the friction circle and of the lateral limit that a guide may use: a tenth of both is left
# to what a backend makes of it.
_GUIDED = 0.9


class _Family(NamedTuple):
    """What all speed profiles have in common that start at the same time before the end.

    A profile holds the speed v0 for a delay, then changes it at the rate to share * v0 + gain.
    """

    rate: Array  # (P,), as are share and gain
    share: Array
    gain: Array
    weight: Array  # what a sample with this rate adds to the mean square of the acceleration
    half: Array  # (K, P), half of the rate: arrays of one shape are multiplied twice as fast
    since: Array  # (K, P), the time since the change began, 0 before it
    begun: Array  # (K, P), the same, but inf before it
    harsh: npt.NDArray[np.bool_]  # (P,), the change alone is more than a guide may ask of the tyres
    slowest: int
    fastest: int


class Rollouts(NamedTuple):
    """Speed profiles over the guide's times; speed and acceleration are made for those that are looked at.

    Attributes
    ----------
    family
        What all rollouts over these times have in common.
    v0 : float
        Speed at the start [m/s].
    s, ramp : (K, P) array
        Position [m], and time spent changing the speed until then [s].
    change, cost : (P,) array
        How long the change takes in all [s]; smaller costs are gentler.
    least, most : (K,) array
        How far back and forth any of them gets [m].
    """

    family: _Family
    v0: float
    s: Array
    ramp: Array
    change: Array
    cost: Array
    least: Array
    most: Array

    def motion(self, p: int | slice | npt.NDArray[np.intp]) -> tuple[Array, Array, Array]:
        """Position, speed and acceleration of the profiles ``p``, (K,) or (K, P')."""
        rate = self.family.rate[p]
        v = rate * self.ramp[:, p] + self.v0
        return self.s[:, p], v, rate * (self.family.begun[:, p] < self.change[p])


class _Pattern(NamedTuple):
    """What they have in common whatever the acceleration limits, which may be others in each cycle."""

    braking: Array  # (P,), the shares of the smallest and of the largest acceleration that make the rate
    throttle: Array
    share: Array
    gain: Array
    since: Array  # (K, P), as in _Family
    begun: Array
    shown: npt.NDArray[np.bool_]  # (P,), the change begins on a sample
    slowest: int
    fastest: int


@lru_cache(maxsize=64)
def _pattern(count: int, step: float) -> _Pattern:
    """All profiles over ``count`` samples, ``step`` apart."""
    tau = step * np.arange(count)
    family = [(0.0, 0.0, 0.0, 1.0, 0.0)]  # to the speed that it has: no change
    family += [(0.0, share, 0.0, hold, 0.0) for share in _BRAKING for hold in _HOLD]
    family += [
        (delay, 0.0, share, 1.0, gain)
        for share in _THROTTLE
        for gain in _GAINS
        for delay in _DELAYS
        if delay < tau[-1]
    ]
    hardest = (0.0, 0.0, _THROTTLE[-1], 1.0, _GAINS[-1])
    delay, braking, throttle, share, gain = (frozen(column) for column in np.array(family).T)
    since = tau[:, None] - delay
    shown = (since == 0.0).any(axis=0)
    shown[0] = False  # who holds the speed has a rate in name only
    shown.setflags(write=False)
    return _Pattern(
        braking,
        throttle,
        share,
        gain,
        since=frozen(np.maximum(since, 0.0)),
        begun=frozen(np.where(since >= 0.0, since, np.inf)),
        shown=shown,
        slowest=family.index((0.0, _BRAKING[-1], 0.0, _HOLD[0], 0.0)),
        fastest=family.index(hardest) if hardest in family else 0,
    )


@lru_cache(maxsize=64)
def _family(a_min: float, a_max: float, a_total: float, count: int, step: float) -> _Family:
    """All profiles over ``count`` samples, ``step`` apart, within some acceleration limits."""
    pattern = _pattern(count, step)
    rate = pattern.braking * a_min + pattern.throttle * a_max
    rate[0] = 1.0
    # Who begins on a sample shows the acceleration there, or else changes nothing.
    harsh = (np.abs(rate) > _GUIDED * a_total) & pattern.shown
    half = np.empty_like(pattern.since)
    half[:] = 0.5 * rate
    weight = rate**2 / count
    for made in (rate, weight, half, harsh):
        made.setflags(write=False)
    return _Family(
        rate, pattern.share, pattern.gain, weight, half, pattern.since, pattern.begun, harsh,
        pattern.slowest, pattern.fastest,
    )  # fmt: skip


def speed_profiles(start: Array, tau: Array, limits: Limits) -> Rollouts:
    """Hold the speed, change it at a constant rate to a target speed, hold that; never reverse.

    Parameters
    ----------
    start : (3, 2) array
        State at t_rep.
    tau : (K,) array
        Times since t_rep [s], equally spaced.
    limits : Limits
    """
    s0, v0 = float(start[0, 0]), max(float(start[1, 0]), 0.0)
    count, duration = len(tau), max(float(tau[-1]), 1e-9)
    step = round(duration / max(count - 1, 1), 9)
    family = _family(limits.a_min, limits.a_max, limits.a_total, count, step)
    rise = np.minimum(family.share * v0 + family.gain, max(limits.v_max, v0)) - v0
    change = rise / family.rate
    ramp = np.minimum(family.since, change)
    # v0 tau + rate ramp^2 / 2 + rise (since - ramp)
    s = family.half * ramp
    s -= rise
    s *= ramp
    s += rise * family.since
    s += (s0 + v0 * tau)[:, None]
    # mean square of the acceleration, and the way that is lost
    cost = family.weight * np.add.reduce(family.begun < change, axis=0)
    lost = s[-1] - s[-1, 0]
    lost *= lost
    lost *= 0.01 / max(duration, 1.0) ** 2
    cost += lost
    # Who brakes hardest and to a stop is behind all others at any time, who accelerates hardest ahead.
    return Rollouts(family, v0, s, ramp, change, cost, least=s[:, family.slowest], most=s[:, family.fastest])


class Bends:
    """What the path's bends leave to the speed profiles: the friction circle and the lateral limit.

    Parameters
    ----------
    speeds : Rollouts
    limits : Limits
    curvature : (s, kappa) arrays
        Curvature of the path [1/m] over s [m], linear in between.
    """

    def __init__(self, speeds: Rollouts, limits: Limits, curvature: tuple[Array, Array]) -> None:
        self.speeds = speeds
        self.total, self.lateral = _GUIDED * limits.a_total, _GUIDED * limits.a_lat
        self.curvature = curvature
        self._allowed: dict[int, bool] = {}

    def allow(self, p: int) -> bool:
        """Whether a profile keeps to both; several lateral motions ask for the same ones."""
        if p not in self._allowed:
            self._allowed[p] = self.surely_allow(p) or bool(self.excess(p) == 0.0)
        return self._allowed[p]

    def surely_allow(self, p: int) -> bool:
        """Whether it does so even if it took the sharpest bend on its way at its highest speed.

        Nearly all do, and this takes a few numbers only; of the others it says nothing.
        """
        speeds, (where, kappa) = self.speeds, self.curvature
        first, last = where.searchsorted((speeds.s[0, p], speeds.s[-1, p])).tolist()
        sharpest = largest(np.abs(kappa[max(first - 1, 0) : last + 1]))
        rate = float(speeds.family.rate[p])
        highest = speeds.v0 + max(rate * float(speeds.ramp[-1, p]), 0.0)
        # A little more than the true numbers, which are rounded in another order.
        bend = (1.0 + 1e-9) * sharpest * highest**2
        return bend <= self.lateral and (1.0 + 1e-9) * math.hypot(bend, rate) <= self.total

    @cached_property
    def of_all(self) -> Array:
        """:meth:`excess` of every profile: one margin after the other asks for it."""
        return frozen(self.excess(slice(None)))

    def excess(self, p: int | slice | npt.NDArray[np.intp]) -> Array:
        """By how much profiles ``p`` (P',) do not keep to them [m/s²]; 0 for those that do."""
        s, v, acceleration = self.speeds.motion(p)
        bend = np.abs(np.interp(s, *self.curvature)) * (v * v)
        total = np.sqrt(np.maximum.reduce(bend * bend + acceleration * acceleration, axis=0))
        excess = np.maximum(total - self.total, np.maximum.reduce(bend, axis=0) - self.lateral)
        return np.asarray(np.maximum(excess, 0.0))
