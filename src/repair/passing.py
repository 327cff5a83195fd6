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

__all__ = [
    "Surroundings",
    "inside",
    "open_passings",
    "overlapping",
    "sides_of",
    "surroundings",
    "widened",
]

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


# Coefficients of x^3, x^4, x^5 by what is left of the way, the speed and the acceleration at x = 1.
_QUINTIC = np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]])


def _quintics(start: Array, target: Array, duration: Array, tau: Array) -> tuple[Array, Array, Array]:
    """Quintics (Q, K) from (l, l', l'') to (target, 0, 0) within the durations (Q,), then constant."""
    l0, v0, a0 = start.tolist()
    d = np.maximum(duration, 1e-3)
    speed, bend = v0 * d, a0 * d**2
    rest = np.array([target - l0 - speed - 0.5 * bend, -speed - bend, -bend])
    c3, c4, c5 = (_QUINTIC @ rest)[..., None]
    d = d[:, None]
    u = np.minimum(tau, d)
    x = u / d
    square = x * x
    position = l0 + (v0 + 0.5 * a0 * u) * u + ((c5 * x + c4) * x + c3) * (square * x)
    rate = v0 + a0 * u + ((5.0 * c5 * x + 4.0 * c4) * x + 3.0 * c3) * square / d
    acceleration = a0 + ((20.0 * c5 * x + 12.0 * c4) * x + 6.0 * c3) * x / d**2
    moving = tau <= d
    return position, rate * moving, acceleration * moving


class Surroundings(NamedTuple):
    """The boxes at the guide's times, and what they are to the reference.

    Attributes
    ----------
    lower, upper : (N, K, 2) array
        Corners of the boxes; NaN where an obstacle is absent.
    conflict : (k, j) or None
        First time index, and obstacle, at which the reference is inside of a box.
    ends : (2, N, K) array
        Rear and front ends of the boxes, the margin added [m].
    overlap : (N, K) bool array
        Which boxes, the margin added, the reference overlaps sideways.
    """

    lower: Array
    upper: Array
    conflict: tuple[int, int] | None
    ends: Array
    overlap: npt.NDArray[np.bool_]


def surroundings(reference: FrenetTrajectory, occupancy: Occupancy, margin: float) -> Surroundings:
    """Look them up at the reference's times, whatever these are."""
    lower, upper = occupancy.at(reference.t)
    conflict = _conflict(inside(lower, upper, reference.position))
    ends, edges = widened(lower, upper, margin)
    return Surroundings(lower, upper, conflict, ends, overlapping(edges, reference.position[:, 1]))


def inside(lower: Array, upper: Array, path: Array) -> npt.NDArray[np.bool_]:
    """Which boxes (N, K) the path (K, 2) is in."""
    within = (lower < path) & (path < upper)
    return within[..., 0] & within[..., 1]


def widened(lower: Array, upper: Array, margin: float) -> tuple[Array, Array]:
    """Ends (2, N, K) of the boxes along s, and along l, with the margin: the lower ones, then the upper ones."""
    corners = np.array([lower, upper])
    corners[0] -= margin
    corners[1] += margin
    return corners[..., 0], corners[..., 1]


def overlapping(edges: Array, l: Array) -> npt.NDArray[np.bool_]:  # noqa: E741
    """Which boxes (..., N, K), between ``edges`` (2, N, K), lateral motions l (..., K) overlap sideways."""
    sideways = l[..., None, :]
    return np.asarray((edges[0] < sideways) & (sideways < edges[1]))


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
    rightmost, leftmost = float(right[beside].max()) - 1e-6, float(left[beside].min()) + 1e-6
    available = float(tau[k])
    moves = []
    for maneuver, target in targets:
        if not rightmost <= target <= leftmost:
            continue
        shift = abs(target - float(start[0, 1]))
        # Peak acceleration of a quintic lane change is 10/sqrt(3) shift / T**2.
        shortest = max(math.sqrt(5.8 * shift / (0.9 * limits.a_lat)), 1.9 * shift / limits.v_lat, 0.3)
        durations = {shortest, max(shortest, min(available, 4.0)), max(shortest, min(1.5 * available, 5.0))}
        moves += [(maneuver, target, duration) for duration in sorted(durations)]
    if not moves:
        return profiles
    kinds, target, duration = zip(*moves, strict=True)
    l, rate, acceleration = _quintics(start[:, 1], np.array(target), np.array(duration), tau)  # noqa: E741
    cost = np.add.reduce(acceleration**2, axis=1) / len(tau) + 0.1
    return profiles + [
        _LateralProfile(*one) for one in zip(kinds, l, rate, acceleration, cost.tolist(), strict=True)
    ]


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
    bends = _Bends(speeds, limits, curvature)
    overlaps = [boxes.overlap]
    if len(profiles) > 1:
        edges = widened(boxes.lower, boxes.upper, margin)[1]
        overlaps += list(overlapping(edges, np.array([profile.l for profile in profiles[1:]])))
    within = (boxes.ends[0] < speeds.most) & (boxes.ends[1] > speeds.least)
    best: dict[Maneuver, tuple[float, int, _LateralProfile]] = {}
    shut: list[_Shut] = []
    for profile, overlap in zip(profiles, overlaps, strict=True):
        meetings = _meetings(speeds, boxes.ends, within & overlap)
        # What a guide must not do has no cost; nor has what counts as another manoeuvre.
        cost = np.where(_entered(meetings) | speeds.family.harsh, np.inf, speeds.cost)
        for maneuver, others in _kinds(profile, boxes, speeds):
            p = _gentlest(cost if others is None else np.where(others, np.inf, cost), bends)
            if p is not None:
                total = float(cost[p]) + profile.cost
                if maneuver not in best or total < best[maneuver][0]:
                    best[maneuver] = (total, p, profile)
            elif others is None or not others.all():
                shut.append(_Shut(profile, maneuver, others, meetings))
    if Maneuver.YIELD not in best and Maneuver.GO_AHEAD not in best:
        wanted: list[Maneuver | None] = [None] if best else [None, Maneuver.LEFT, Maneuver.RIGHT]
        best |= _closest(shut, wanted, bends)
    passings = [
        _passing(maneuver, cost, speeds, p, profile, reference.t, boxes)
        for maneuver, (cost, p, profile) in best.items()
    ]
    return tuple(sorted(passings, key=lambda x: x.cost))


class _Bends:
    """What the path's bends leave to the speed profiles: the friction circle and the lateral limit."""

    def __init__(self, speeds: _Rollouts, limits: Limits, curvature: tuple[Array, Array]) -> None:
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
        sharpest = float(np.maximum.reduce(np.abs(kappa[max(first - 1, 0) : last + 1])))
        rate = float(speeds.family.rate[p])
        highest = speeds.v0 + max(rate * float(speeds.ramp[-1, p]), 0.0)
        # A little more than the true numbers, which are rounded in another order.
        bend = (1.0 + 1e-9) * sharpest * highest**2
        return bend <= self.lateral and (1.0 + 1e-9) * math.hypot(bend, rate) <= self.total

    def excess(self, p: int | slice | npt.NDArray[np.intp]) -> Array:
        """By how much profiles (P',) do not keep to them."""
        s, v, acceleration = self.speeds.motion(p)
        bend = np.abs(np.interp(s, *self.curvature)) * (v * v)
        total = np.sqrt(np.maximum.reduce(bend * bend + acceleration * acceleration, axis=0))
        excess = np.maximum(total - self.total, np.maximum.reduce(bend, axis=0) - self.lateral)
        return np.asarray(np.maximum(excess, 0.0))


def _gentlest(cost: Array, bends: _Bends) -> int | None:
    """The cheapest of the speed profiles (P,) of finite ``cost`` that the bends allow."""
    first = int(cost.argmin())
    if cost[first] == np.inf:
        return None
    # The cheapest is nearly always allowed; looking at all of them takes a hundred times as many numbers.
    if bends.allow(first):
        return first
    candidates = (cost < np.inf).nonzero()[0]
    candidates = candidates[bends.excess(candidates) == 0.0]
    return int(candidates[cost[candidates].argmin()]) if len(candidates) else None


# Positions of all profiles (M, P), and the rear and front ends of the boxes (M, 1), wherever some
# profile may be in a box.
_Meetings = tuple[Array, Array, Array]


def _meetings(speeds: _Rollouts, ends: Array, met: npt.NDArray[np.bool_]) -> _Meetings:
    """Speed profiles and ``ends`` (2, N, K) of the boxes where they are ``met`` (N, K)."""
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
    shut: list[_Shut], wanted: list[Maneuver | None], bends: _Bends
) -> dict[Maneuver, tuple[float, int, _LateralProfile]]:
    """Of the manoeuvres that are not open the one of each wanted kind that comes closest to it."""
    excess = bends.excess(slice(None))
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
    profile: _LateralProfile, boxes: Surroundings, speeds: _Rollouts
) -> tuple[tuple[Maneuver, npt.NDArray[np.bool_] | None], ...]:
    """The manoeuvres that a lateral motion may be part of, each with the speed profiles (P,) that are others."""
    if profile.maneuver is not None:
        return ((profile.maneuver, None),)
    if boxes.conflict is None:
        return ((Maneuver.YIELD, None),)
    # Where not even the fastest gets past the obstacle in conflict, all of them yield.
    j = boxes.conflict[1]
    front = boxes.ends[1, j]
    k = ((speeds.most > front) & boxes.overlap[j]).nonzero()[0]
    if not len(k):
        return ((Maneuver.YIELD, None),)
    passed = np.logical_or.reduce(speeds.s.take(k, axis=0) > front[k][:, None], axis=0)
    return (Maneuver.YIELD, passed), (Maneuver.GO_AHEAD, ~passed)


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
