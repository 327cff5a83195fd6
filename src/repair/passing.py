"""The sides of passing: which ways past the obstacles are open from a time-to-repair on.

EGO-Planner finds the side by an A* path around the obstacle; here the obstacles move, so the
search is over space and time: a family of manoeuvres (keep the path, move to the left or right of
the first obstacle in conflict; each with a range of speed changes) is rolled out and tested against
all boxes at once. The gentlest survivor of each kind is a :class:`repair.types.Passing`: a guide,
and the side it takes of every obstacle. A guide respects the acceleration limits, not the jerk
limits; it shows that a way is open, and a backend makes a trajectory of it.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial
from typing import NamedTuple

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
    frozen,
)

__all__ = ["Surroundings", "blocking", "inside", "open_passings", "sides_of", "surroundings"]

# Shares of the acceleration limits, and of the start speed, that are rolled out.
_BRAKING = (0.125, 0.25, 0.5, 0.75, 1.0)
_THROTTLE = (0.5, 1.0)
_GAINS = (2.0, 5.0, 50.0)
_DELAYS = (0.0, 1.5, 3.0)
_HOLD = (0.0, 0.2, 0.4, 0.6, 0.8)
# The cost of a way that is not open starts here, far above those of open ones.
_SHUT = 1e3
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


class _Rollouts(NamedTuple):
    """Speed profiles over the guide's times; speed and acceleration are made for those that are looked at.

    Position s and time spent changing the speed (K, P), how long the change takes and cost (P,), and
    how far back and forth any of them gets (K,).
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


@lru_cache(maxsize=64)
def _family(a_min: float, a_max: float, a_total: float, count: int, step: float) -> _Family:
    """All profiles over ``count`` samples, ``step`` apart."""
    tau = step * np.arange(count)
    family = [(0.0, 1.0, 1.0, 0.0)]  # to the speed that it has: no change
    family += [(0.0, share * a_min, hold, 0.0) for share in _BRAKING for hold in _HOLD]
    family += [
        (delay, share * a_max, 1.0, gain)
        for share in _THROTTLE
        for gain in _GAINS
        for delay in _DELAYS
        if delay < tau[-1]
    ]
    hardest = (0.0, _THROTTLE[-1] * a_max, 1.0, _GAINS[-1])
    delay, rate, share, gain = (frozen(column) for column in np.array(family).T)
    since = tau[:, None] - delay
    # Who begins on a sample shows the acceleration there, or else changes nothing.
    harsh = (np.abs(rate) > _GUIDED * a_total) & (since == 0.0).any(axis=0)
    harsh.setflags(write=False)
    return _Family(
        rate,
        share,
        gain,
        weight=frozen(rate**2 / count),
        half=frozen(np.broadcast_to(0.5 * rate, since.shape)),
        since=frozen(np.maximum(since, 0.0)),
        begun=frozen(np.where(since >= 0.0, since, np.inf)),
        harsh=harsh,
        slowest=family.index((0.0, _BRAKING[-1] * a_min, _HOLD[0], 0.0)),
        fastest=family.index(hardest) if hardest in family else 0,
    )


def _speed_profiles(start: Array, tau: Array, limits: Limits) -> _Rollouts:
    """Hold the speed, change it at a constant rate to a target speed, hold that; never reverse."""
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
    return _Rollouts(family, v0, s, ramp, change, cost, least=s[:, family.slowest], most=s[:, family.fastest])


class _LateralProfile(NamedTuple):
    """One lateral motion l(t) (K,) with its derivatives and cost."""

    maneuver: Maneuver | None  # None: keeps the path; yield or go ahead is decided by the speed
    l: Array  # noqa: E741
    rate: Array
    acceleration: Array | float
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


class Surroundings(NamedTuple):
    """The boxes at the guide's times, and what they are to the reference.

    Attributes
    ----------
    lower, upper : (N, K, 2) array
        Corners of the boxes; NaN where an obstacle is absent.
    conflict : (k, j) or None
        First time index, and obstacle, at which the reference is inside of a box.
    ends : (2, N, K) array
        Rear and front ends that :func:`blocking` says of the reference's lateral motion.
    """

    lower: Array
    upper: Array
    conflict: tuple[int, int] | None
    ends: Array


def surroundings(reference: FrenetTrajectory, occupancy: Occupancy, margin: float) -> Surroundings:
    """Look them up at the reference's times, whatever these are."""
    lower, upper = occupancy.at(reference.t)
    conflict = _conflict(inside(lower, upper, reference.position))
    return Surroundings(
        lower, upper, conflict, blocking(lower - margin, upper + margin, reference.position[:, 1])
    )


def inside(lower: Array, upper: Array, path: Array) -> npt.NDArray[np.bool_]:
    """Which boxes (N, K) the path (K, 2) is in."""
    within = (lower < path) & (path < upper)
    return within[..., 0] & within[..., 1]


def blocking(lower: Array, upper: Array, l: Array) -> Array:  # noqa: E741
    """Rear and front ends (2, N, K) of the boxes, as a lateral motion l (K,) meets them.

    Those that it does not overlap sideways begin infinitely far away: nobody enters them.
    """
    overlap = (lower[..., 1] < l) & (l < upper[..., 1])
    return np.array([np.where(overlap, lower[..., 0], np.inf), upper[..., 0]])


def _conflict(hit: npt.NDArray[np.bool_]) -> tuple[int, int] | None:
    """First (time index, obstacle) of the hits (N, K)."""
    times = hit.any(axis=0)
    if not times.any():
        return None
    k = int(times.argmax())
    return k, int(hit[:, k].argmax())


def _lateral_profiles(
    start: Array,
    tau: Array,
    reference: FrenetTrajectory,
    boxes: Surroundings,
    limits: Limits,
    bounds: LateralBounds,
    margin: float,
    lateral: bool,
) -> list[_LateralProfile]:
    keep = _LateralProfile(None, reference.position[:, 1], reference.velocity[:, 1], 0.0, 0.0)
    profiles = [keep]
    if not lateral or boxes.conflict is None:
        return profiles
    lower, upper, (k, j) = boxes.lower, boxes.upper, boxes.conflict
    s = reference.position[:, 0]
    room = 5.0 + 0.5 * max(float(start[1, 0]), 0.0)
    beside = (lower[j, :, 0] - room < s) & (s < upper[j, :, 0] + room)
    if not beside.any():
        return profiles
    right, left = bounds.at(s)
    targets = (
        (Maneuver.LEFT, float(np.fmax.reduce(upper[j, beside, 1])) + margin),
        (Maneuver.RIGHT, float(np.fmin.reduce(lower[j, beside, 1])) - margin),
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
    boxes: Surroundings | None = None,
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
    boxes : Surroundings, optional
        What :func:`surroundings` says of the reference, the obstacles and the margin, if it is known.

    Returns
    -------
    tuple of Passing
        Where no manoeuvre that keeps the path is open, the one of them that comes closest is
        added, and where none is open at all, so are the closest on the left and on the right: the
        boxes are wider than the vehicles, so it is for the checker to say that they fail.
    """
    tau = reference.t - reference.t[0]
    boxes = boxes or surroundings(reference, occupancy, margin)
    profiles = _lateral_profiles(start, tau, reference, boxes, limits, bounds, margin + 0.05, lateral)
    speeds = _speed_profiles(start, tau, limits)
    if len(profiles) > 1:
        wide_lower, wide_upper = boxes.lower - margin, boxes.upper + margin
    best: dict[Maneuver, tuple[float, int, _LateralProfile]] = {}
    shut: list[_Shut] = []
    for profile in profiles:
        ends = boxes.ends if profile.maneuver is None else blocking(wide_lower, wide_upper, profile.l)
        meetings = _meetings(speeds, ends)
        # What a guide must not do has no cost; nor has what counts as another manoeuvre.
        cost = np.where(_entered(meetings) | speeds.family.harsh, np.inf, speeds.cost)
        for maneuver, others in _kinds(profile, boxes.conflict, ends, speeds):
            p = _gentlest(speeds, cost if others is None else np.where(others, np.inf, cost), limits, curvature)
            if p is not None:
                total = float(cost[p]) + profile.cost
                if maneuver not in best or total < best[maneuver][0]:
                    best[maneuver] = (total, p, profile)
            elif others is None or not others.all():
                shut.append(_Shut(profile, maneuver, others, meetings))
    if Maneuver.YIELD not in best and Maneuver.GO_AHEAD not in best:
        wanted: list[Maneuver | None] = [None] if best else [None, Maneuver.LEFT, Maneuver.RIGHT]
        best |= _closest(speeds, shut, wanted, limits, curvature)
    passings = [
        _passing(maneuver, cost, speeds, p, profile, reference.t, boxes)
        for maneuver, (cost, p, profile) in best.items()
    ]
    return tuple(sorted(passings, key=lambda x: x.cost))


def _demand(motion: tuple[Array, Array, Array], curvature: tuple[Array, Array]) -> tuple[Array, Array]:
    """Largest total and lateral acceleration of motions (K, P') along the path, bends included."""
    s, v, acceleration = motion
    bend = np.abs(np.interp(s, *curvature)) * (v * v)
    total = np.sqrt(np.maximum.reduce(bend * bend + acceleration * acceleration, axis=0))
    return total, np.maximum.reduce(bend, axis=0)


def _allowed(
    motion: tuple[Array, Array, Array], limits: Limits, curvature: tuple[Array, Array]
) -> npt.NDArray[np.bool_]:
    """Which motions keep to the friction circle and the lateral limit in the path's bends."""
    total, lateral = _demand(motion, curvature)
    return (total <= _GUIDED * limits.a_total) & (lateral <= _GUIDED * limits.a_lat)


def _surely_allowed(speeds: _Rollouts, p: int, limits: Limits, curvature: tuple[Array, Array]) -> bool:
    """Whether a profile keeps to both even if it took the sharpest bend on its way at its highest speed.

    Nearly all do, and this takes a few numbers only; of the others it says nothing.
    """
    where, kappa = curvature
    first, last = where.searchsorted((speeds.s[0, p], speeds.s[-1, p])).tolist()
    sharpest = float(np.maximum.reduce(np.abs(kappa[max(first - 1, 0) : last + 1])))
    rate = float(speeds.family.rate[p])
    highest = speeds.v0 + max(rate * float(speeds.ramp[-1, p]), 0.0)
    # A little more than the true numbers, which are rounded in another order.
    bend = (1.0 + 1e-9) * sharpest * highest**2
    total = (1.0 + 1e-9) * math.hypot(bend, rate)
    return total <= _GUIDED * limits.a_total and bend <= _GUIDED * limits.a_lat


def _excess(motion: tuple[Array, Array, Array], limits: Limits, curvature: tuple[Array, Array]) -> Array:
    """By how much they do not."""
    total, lateral = _demand(motion, curvature)
    excess = np.maximum(total - _GUIDED * limits.a_total, lateral - _GUIDED * limits.a_lat)
    return np.asarray(np.maximum(excess, 0.0))


def _gentlest(
    speeds: _Rollouts, cost: Array, limits: Limits, curvature: tuple[Array, Array]
) -> int | None:
    """The cheapest of the speed profiles (P,) of finite ``cost`` that the bends allow."""
    first = int(cost.argmin())
    if cost[first] == np.inf:
        return None
    # The cheapest is nearly always allowed; looking at all of them takes a hundred times as many numbers.
    if _surely_allowed(speeds, first, limits, curvature) or _allowed(speeds.motion(first), limits, curvature):
        return first
    candidates = (cost < np.inf).nonzero()[0]
    candidates = candidates[_allowed(speeds.motion(candidates), limits, curvature)]
    return int(candidates[cost[candidates].argmin()]) if len(candidates) else None


# Positions of all profiles (M, P), and the rear and front ends of the boxes (M, 1), wherever some
# profile may be in a box.
_Meetings = tuple[Array, Array, Array]


def _meetings(speeds: _Rollouts, ends: Array) -> _Meetings:
    """Where the speed profiles come upon the boxes, of which the ``ends`` (2, N, K) are known."""
    met = ends[0] < speeds.most
    met &= ends[1] > speeds.least
    rear, front = ends[:, met, None]
    return speeds.s.take(met.nonzero()[1], axis=0), rear, front


def _entered(meetings: _Meetings) -> npt.NDArray[np.bool_]:
    """Which speed profiles (P,) enter a box."""
    s, rear, front = meetings
    within = s > rear
    within &= s < front
    return np.asarray(np.logical_or.reduce(within, axis=0))


def _depth(meetings: _Meetings) -> Array:
    """How deep each speed profile (P,) gets into a box."""
    s, rear, front = meetings
    return np.asarray(np.maximum.reduce(np.minimum(s - rear, front - s), axis=0, initial=0.0))


class _Shut(NamedTuple):
    """A manoeuvre that is not open: its lateral motion, the speed profiles that are others, the boxes met."""

    profile: _LateralProfile
    maneuver: Maneuver
    others: npt.NDArray[np.bool_] | None
    meetings: _Meetings


def _closest(
    speeds: _Rollouts,
    shut: list[_Shut],
    wanted: list[Maneuver | None],
    limits: Limits,
    curvature: tuple[Array, Array],
) -> dict[Maneuver, tuple[float, int, _LateralProfile]]:
    """Of the manoeuvres that are not open the one of each wanted kind that comes closest to it."""
    excess = _excess(speeds.motion(slice(None)), limits, curvature)
    closest: dict[Maneuver | None, tuple[float, int, _LateralProfile, Maneuver]] = {}
    for profile, maneuver, others, meetings in shut:
        if profile.maneuver not in wanted:
            continue
        badness = 10.0 * _depth(meetings) + excess
        if others is not None:
            badness[others] = np.inf
        p = int(badness.argmin())
        if profile.maneuver not in closest or badness[p] < closest[profile.maneuver][0]:
            closest[profile.maneuver] = (float(badness[p]), p, profile, maneuver)
    found = (closest[kind] for kind in wanted if kind in closest)
    return {maneuver: (_SHUT + badness, p, profile) for badness, p, profile, maneuver in found}


def _kinds(
    profile: _LateralProfile,
    conflict: tuple[int, int] | None,
    ends: Array,
    speeds: _Rollouts,
) -> tuple[tuple[Maneuver, npt.NDArray[np.bool_] | None], ...]:
    """The manoeuvres that a lateral motion may be part of, each with the speed profiles (P,) that are others."""
    if profile.maneuver is not None:
        return ((profile.maneuver, None),)
    if conflict is None:
        return ((Maneuver.YIELD, None),)
    # Where not even the fastest gets past the obstacle in conflict, all of them yield.
    rear, front = ends[:, conflict[1]]
    passed = (speeds.most > front) & (rear < np.inf)
    if not np.logical_or.reduce(passed):
        return ((Maneuver.YIELD, None),)
    k = passed.nonzero()[0]
    others = np.logical_or.reduce(speeds.s.take(k, axis=0) > front[k][:, None], axis=0)
    return (Maneuver.YIELD, others), (Maneuver.GO_AHEAD, ~others)


def _passing(
    maneuver: Maneuver,
    cost: float,
    speeds: _Rollouts,
    p: int,
    profile: _LateralProfile,
    times: Array,
    boxes: Surroundings,
) -> Passing:
    columns = np.zeros((4, len(times), 2))
    columns[0, :, 0], columns[1, :, 0], columns[2, :, 0] = speeds.motion(p)
    columns[0, :, 1], columns[1, :, 1] = profile.l, profile.rate
    if profile.maneuver is not None:
        columns[2, :, 1] = profile.acceleration
    columns.setflags(write=False)
    guide = FrenetTrajectory(times, *columns)
    sides = partial(sides_of, guide.position, boxes.lower, boxes.upper)
    return Passing.found(maneuver, guide, sides, cost, cost < _SHUT)


def sides_of(position: Array, lower: Array, upper: Array) -> npt.NDArray[np.int8]:
    """Side (N, K) that a collision-free path (K, 2) takes of each box.

    Where the path is clear on one axis only, that axis decides; where it is clear on both, the
    larger distance does. Where a box is not there it counts as ahead of the path.
    """
    before, after = lower - position, position - upper
    far = np.maximum(before, after)
    along, across = far[..., 0], far[..., 1]
    ahead, left = after[..., 0] > before[..., 0], after[..., 1] >= before[..., 1]
    # In the order of Side: behind, ahead, left, right. Nothing is true of a box that is not there.
    return np.where(across > along, 3 - left.view(np.int8), ahead.view(np.int8))
