"""The sides of passing: which ways past the obstacles are open from a time-to-repair on.

EGO-Planner finds the side by an A* path around the obstacle; here the obstacles move, so the
search is over space and time: a family of manoeuvres (keep the path, move to the left or right of
the first obstacle in conflict; each with a range of speed changes) is rolled out and tested against
all boxes at once. The gentlest survivor of each kind is a :class:`repair.types.Passing`: a guide,
and the side it takes of every obstacle. A guide respects the acceleration limits, not the jerk
limits; it shows that a way is open, and a backend makes a trajectory of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.types import (
    Array,
    FrenetTrajectory,
    LateralBounds,
    Limits,
    Maneuver,
    Occupancy,
    Passing,
    Side,
    frozen,
)

__all__ = ["open_passings"]

# Shares of the acceleration limits, and of the start speed, that are rolled out.
_BRAKING = (0.125, 0.25, 0.5, 0.75, 1.0)
_THROTTLE = (0.5, 1.0)
_DELAYS = (0.0, 1.5, 3.0)
_HOLD = (0.0, 0.2, 0.4, 0.6, 0.8)


class _Rollouts(NamedTuple):
    """Speed profiles over the guide's times.

    Position, speed and acceleration (P, K), costs (P,), and how far back and forth any of them gets (K,).
    """

    s: Array
    v: Array
    a: Array
    cost: Array
    least: Array
    most: Array


class _Family(NamedTuple):
    """Rate, share of the start speed and gain of every profile, (P, 1) each, and the time since it began.

    A profile holds the speed v0 for a delay, then changes it at the rate to share * v0 + gain.
    """

    rate: Array
    share: Array
    gain: Array
    begun: npt.NDArray[np.bool_]  # (P, K)
    since: Array  # (P, K), 0 before it


@lru_cache(maxsize=64)
def _family(a_min: float, a_max: float, count: int, step: float) -> _Family:
    """All profiles over ``count`` samples, ``step`` apart."""
    tau = step * np.arange(count)
    family = [(0.0, 1.0, 1.0, 0.0)]  # to the speed that it has: no change
    family += [(0.0, share * a_min, hold, 0.0) for share in _BRAKING for hold in _HOLD]
    family += [
        (delay, share * a_max, 1.0, gain)
        for share in _THROTTLE
        for gain in (2.0, 5.0, 50.0)
        for delay in _DELAYS
        if delay < tau[-1]
    ]
    delay, rate, share, gain = (frozen(column[:, None]) for column in np.array(family).T)
    return _Family(rate, share, gain, tau >= delay, frozen(np.maximum(tau - delay, 0.0)))


def _speed_profiles(start: Array, tau: Array, limits: Limits) -> _Rollouts:
    """Hold the speed, change it at a constant rate to a target speed, hold that; never reverse."""
    s0, v0 = float(start[0, 0]), max(float(start[1, 0]), 0.0)
    duration = max(float(tau[-1]), 1e-9)
    step = round(duration / max(len(tau) - 1, 1), 9)
    rate, share, gain, begun, since = _family(limits.a_min, limits.a_max, len(tau), step)
    rise = np.minimum(share * v0 + gain, max(limits.v_max, v0)) - v0
    change = rise / rate
    ramp = np.minimum(since, change)
    # v0 tau + rate ramp^2 / 2 + rise (since - ramp)
    s = (0.5 * rate) * ramp
    s -= rise
    s *= ramp
    s += rise * since
    s += s0 + v0 * tau
    ramp *= rate
    ramp += v0
    changing = begun & (since < change)
    # mean square of the acceleration, and the way that is lost
    loss = (s[0, -1] - s[:, -1]) / max(duration, 1.0)
    cost = rate[:, 0] ** 2 * (np.add.reduce(changing, axis=1) / len(tau)) + 0.01 * loss**2
    return _Rollouts(s, ramp, rate * changing, cost, s.min(axis=0), s.max(axis=0))


@dataclass(frozen=True)
class _LateralProfile:
    """One lateral motion l(t) (K,) with its derivatives and cost."""

    maneuver: Maneuver | None  # None: keeps the path; yield or go ahead is decided by the speed
    l: Array  # noqa: E741
    rate: Array
    acceleration: Array
    cost: float


def _quintic(start: Array, target: float, duration: float, tau: Array) -> tuple[Array, Array, Array]:
    """Quintic from (l, l', l'') to (target, 0, 0) within ``duration``, then constant."""
    l0, v0, a0 = start
    d = max(duration, 1e-3)
    rest = target - l0 - v0 * d - 0.5 * a0 * d**2
    slope, bend = -v0 - a0 * d, -a0
    c3 = (20 * rest - 8 * slope * d + bend * d**2) / (2 * d**3)
    c4 = (-30 * rest + 14 * slope * d - 2 * bend * d**2) / (2 * d**4)
    c5 = (12 * rest - 6 * slope * d + bend * d**2) / (2 * d**5)
    u = np.minimum(tau, d)
    position = l0 + v0 * u + 0.5 * a0 * u**2 + c3 * u**3 + c4 * u**4 + c5 * u**5
    rate = v0 + a0 * u + 3 * c3 * u**2 + 4 * c4 * u**3 + 5 * c5 * u**4
    acceleration = a0 + 6 * c3 * u + 12 * c4 * u**2 + 20 * c5 * u**3
    moving = tau <= d
    return position, np.where(moving, rate, 0.0), np.where(moving, acceleration, 0.0)


def _conflict(lower: Array, upper: Array, path: Array) -> tuple[int, int] | None:
    """First (time index, obstacle) whose box the path (K, 2) enters."""
    inside = (lower < path) & (path < upper)
    hit = inside[..., 0] & inside[..., 1]
    times = hit.any(axis=0)
    if not times.any():
        return None
    k = int(times.argmax())
    return k, int(hit[:, k].argmax())


def _lateral_profiles(
    start: Array,
    tau: Array,
    reference: FrenetTrajectory,
    lower: Array,
    upper: Array,
    conflict: tuple[int, int] | None,
    limits: Limits,
    bounds: LateralBounds,
    margin: float,
    lateral: bool,
) -> list[_LateralProfile]:
    zero = np.zeros_like(tau)
    keep = _LateralProfile(None, reference.position[:, 1], reference.velocity[:, 1], zero, 0.0)
    profiles = [keep]
    if not lateral or conflict is None:
        return profiles
    k, j = conflict
    s = reference.position[:, 0]
    room = 5.0 + 0.5 * max(float(start[1, 0]), 0.0)
    beside = (lower[j, :, 0] - room < s) & (s < upper[j, :, 0] + room)
    if not beside.any():
        return profiles
    right, left = bounds.at(s)
    targets = (
        (Maneuver.LEFT, float(np.nanmax(upper[j, beside, 1])) + margin),
        (Maneuver.RIGHT, float(np.nanmin(lower[j, beside, 1])) - margin),
    )
    for maneuver, target in targets:
        if not right[beside].max() - 1e-6 <= target <= left[beside].min() + 1e-6:
            continue
        shift = abs(target - float(start[0, 1]))
        # Peak acceleration of a quintic lane change is 10/sqrt(3) shift / T**2.
        shortest = max(np.sqrt(5.8 * shift / (0.9 * limits.a_lat)), 1.9 * shift / limits.v_lat, 0.3)
        available = float(tau[k])
        for duration in sorted(
            {shortest, max(shortest, min(available, 4.0)), max(shortest, min(1.5 * available, 5.0))}
        ):
            position, rate, acceleration = _quintic(start[:, 1], target, duration, tau)
            cost = float(np.mean(acceleration**2)) + 0.1
            profiles.append(_LateralProfile(maneuver, position, rate, acceleration, cost))
    return profiles


def open_passings(
    reference: FrenetTrajectory,
    start: Array,
    occupancy: Occupancy,
    bounds: LateralBounds,
    limits: Limits,
    margin: float,
    lateral: bool,
    curvature: tuple[Array, Array],
) -> tuple[Passing, ...]:
    """The open ways past the obstacles, the gentlest of each manoeuvre, cheapest first.

    Parameters
    ----------
    reference : FrenetTrajectory
        The reference from t_rep to the end of the repair, equally spaced (K samples).
    start : (3, 2) array
        State at t_rep.
    occupancy : Occupancy
        Obstacles within reach.
    bounds : LateralBounds
    limits : Limits
    margin : float
        Distance to the inflated boxes that a guide keeps [m].
    lateral : bool
        Whether moving sideways is allowed.
    curvature : (s, kappa) arrays
        Curvature of the path, for the lateral acceleration.

    Returns
    -------
    tuple of Passing
        Where no manoeuvre that keeps the path is open, the one of them that comes closest is
        added, and where none is open at all, so are the closest on the left and on the right: the
        boxes are wider than the vehicles, so it is for the checker to say that they fail.
    """
    tau = reference.t - reference.t[0]
    lower, upper = occupancy.at(reference.t)
    conflict = _conflict(lower, upper, reference.position)
    profiles = _lateral_profiles(
        start, tau, reference, lower, upper, conflict, limits, bounds, margin + 0.05, lateral
    )
    speeds = _speed_profiles(start, tau, limits)
    wide_lower, wide_upper = lower - margin, upper + margin
    best: dict[Maneuver, tuple[float, int, _LateralProfile]] = {}
    shut: list[tuple[_LateralProfile, Maneuver, npt.NDArray[np.bool_]]] = []
    for profile in profiles:
        overlap = (wide_lower[..., 1] < profile.l) & (profile.l < wide_upper[..., 1])
        free = ~_entered(speeds, overlap, wide_lower[..., 0], wide_upper[..., 0])
        for maneuver, members in _kinds(profile, conflict, overlap, wide_upper, speeds).items():
            p = _gentlest(speeds, free & members, limits, curvature)
            if p is not None:
                cost = float(speeds.cost[p] + profile.cost)
                if maneuver not in best or cost < best[maneuver][0]:
                    best[maneuver] = (cost, p, profile)
            elif members.any():
                shut.append((profile, maneuver, members))
    wanted: list[Maneuver | None] = [] if best.keys() & {Maneuver.YIELD, Maneuver.GO_AHEAD} else [None]
    if not best:
        wanted += [Maneuver.LEFT, Maneuver.RIGHT]
    if wanted:
        excess = _excess(speeds, slice(None), limits, curvature)
        best |= _closest(speeds, shut, wanted, excess, wide_lower, wide_upper)
    passings = [
        _passing(maneuver, cost, speeds, p, profile, reference.t, lower, upper)
        for maneuver, (cost, p, profile) in best.items()
    ]
    return tuple(sorted(passings, key=lambda x: x.cost))


def _excess(speeds: _Rollouts, p: Any, limits: Limits, curvature: tuple[Array, Array]) -> Array:
    """By how much the profiles ``p`` break the friction circle, or the lateral limit, in the path's bends.

    A guide leaves a tenth of both to what a backend makes of it.
    """
    bend = np.abs(np.interp(speeds.s[p], *curvature)) * (speeds.v[p] * speeds.v[p])
    acceleration = speeds.a[p]
    total = np.sqrt(bend * bend + acceleration * acceleration)
    excess = np.maximum(total - 0.9 * limits.a_total, bend - 0.9 * limits.a_lat)
    return np.maximum(np.maximum.reduce(excess, axis=-1), 0.0)


def _gentlest(
    speeds: _Rollouts, free: npt.NDArray[np.bool_], limits: Limits, curvature: tuple[Array, Array]
) -> int | None:
    """The cheapest of the ``free`` speed profiles (P,) that the bends allow."""
    candidates = free.nonzero()[0]
    if not len(candidates):
        return None
    # The cheapest is nearly always allowed; looking at all of them takes a hundred times as many numbers.
    first = int(candidates[speeds.cost[candidates].argmin()])
    if _excess(speeds, first, limits, curvature) <= 0.0:
        return first
    candidates = candidates[_excess(speeds, candidates, limits, curvature) <= 0.0]
    return int(candidates[speeds.cost[candidates].argmin()]) if len(candidates) else None


def _entered(
    speeds: _Rollouts, overlap: npt.NDArray[np.bool_], lower: Array, upper: Array
) -> npt.NDArray[np.bool_]:
    """Which speed profiles (P,) enter a box (N, K) at a time at which they overlap it sideways."""
    obstacle, k = (overlap & (lower < speeds.most) & (upper > speeds.least)).nonzero()
    s = speeds.s.take(k, axis=1)
    inside = (s > lower[obstacle, k]) & (s < upper[obstacle, k])
    return np.asarray(inside.any(axis=1))


def _closest(
    speeds: _Rollouts,
    shut: list[tuple[_LateralProfile, Maneuver, npt.NDArray[np.bool_]]],
    wanted: list[Maneuver | None],
    excess: Array,
    lower: Array,
    upper: Array,
) -> dict[Maneuver, tuple[float, int, _LateralProfile]]:
    """Of the manoeuvres that are not open the one of each wanted kind that comes closest to it."""
    closest: dict[Maneuver | None, tuple[float, int, _LateralProfile, Maneuver]] = {}
    for profile, maneuver, members in shut:
        if profile.maneuver not in wanted:
            continue
        overlap = (lower[..., 1] < profile.l) & (profile.l < upper[..., 1])
        met = overlap.any(axis=1)
        inside = np.minimum(speeds.s[:, None] - lower[met, :, 0], upper[met, :, 0] - speeds.s[:, None])
        depth = np.where(overlap[met], inside, 0.0).max(axis=(1, 2), initial=0.0)
        badness = np.where(members, 10.0 * depth + excess, np.inf)
        p = int(np.argmin(badness))
        if profile.maneuver not in closest or badness[p] < closest[profile.maneuver][0]:
            closest[profile.maneuver] = (float(badness[p]), p, profile, maneuver)
    found = (closest[kind] for kind in wanted if kind in closest)
    return {maneuver: (1e3 + badness, p, profile) for badness, p, profile, maneuver in found}


def _kinds(
    profile: _LateralProfile,
    conflict: tuple[int, int] | None,
    overlap: npt.NDArray[np.bool_],
    upper: Array,
    speeds: _Rollouts,
) -> dict[Maneuver, npt.NDArray[np.bool_]]:
    """Which speed profiles (P,) count as which manoeuvre."""
    if profile.maneuver is not None or conflict is None or not overlap[conflict[1]].any():
        return {profile.maneuver or Maneuver.YIELD: np.ones(len(speeds.s), dtype=bool)}
    j = conflict[1]
    passed = ((speeds.s > upper[j, :, 0]) & overlap[j]).any(axis=1)
    return {Maneuver.YIELD: ~passed, Maneuver.GO_AHEAD: passed}


def _passing(
    maneuver: Maneuver,
    cost: float,
    speeds: _Rollouts,
    p: int,
    profile: _LateralProfile,
    times: Array,
    lower: Array,
    upper: Array,
) -> Passing:
    columns = np.zeros((4, len(times), 2))
    columns[0, :, 0], columns[0, :, 1] = speeds.s[p], profile.l
    columns[1, :, 0], columns[1, :, 1] = speeds.v[p], profile.rate
    columns[2, :, 0], columns[2, :, 1] = speeds.a[p], profile.acceleration
    columns.setflags(write=False)
    guide = FrenetTrajectory(times, *columns)
    return Passing(maneuver, guide, sides_of(guide.position, lower, upper), cost)


def sides_of(position: Array, lower: Array, upper: Array) -> npt.NDArray[np.int8]:
    """Side (N, K) that a collision-free path (K, 2) takes of each box.

    Where the path is clear on one axis only, that axis decides; where it is clear on both, the
    larger distance does. Where a box is not there it counts as ahead of the path.
    """
    before, after = lower - position, position - upper
    along, across = np.maximum(before, after).transpose(2, 0, 1)
    ahead, left = after[..., 0] > before[..., 0], after[..., 1] >= before[..., 1]
    # in the order of Side: behind, ahead, left, right
    side = np.where(across > along, 3 - left.view(np.int8), ahead.view(np.int8))
    side[~np.isfinite(along + across)] = int(Side.BEHIND)
    return side
