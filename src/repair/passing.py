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
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.speeds import Bends, Rollouts, speed_profiles
from repair.types import (
    Array,
    FrenetTrajectory,
    LateralBounds,
    Limits,
    Maneuver,
    Occupancy,
    Passing,
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

# The cost of a way that is not open starts here, far above those of open ones.
_SHUT = 1e3


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
    """Lower and upper ends (2, N, K) of the boxes with the margin, along s and along l."""
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
    right, left = bounds.at(s[beside])
    targets = (
        (Maneuver.LEFT, float(np.fmax.reduce(upper[j, beside, 1])) + margin),
        (Maneuver.RIGHT, float(np.fmin.reduce(lower[j, beside, 1])) - margin),
    )
    rightmost, leftmost = float(right.max()) - 1e-6, float(left.min()) + 1e-6
    available = float(tau[k])
    moves = []
    for maneuver, target in targets:
        if not rightmost <= target <= leftmost:
            continue
        shift = abs(target - float(start[0, 1]))
        # Peak acceleration of a quintic lane change is 10/sqrt(3) shift / T**2.
        shortest = max(math.sqrt(5.8 * shift / (0.9 * limits.a_lat)), 1.9 * shift / limits.v_lat, 0.3)
        longer = max(shortest, min(available, 4.0)), max(shortest, min(1.5 * available, 5.0))
        moves += [(maneuver, target, duration) for duration in sorted({shortest, *longer})]
    if not moves:
        return profiles
    kinds, ends, durations = zip(*moves, strict=True)
    l, rate, acceleration = _quintics(start[:, 1], np.array(ends), np.array(durations), tau)  # noqa: E741
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
    speeds = speed_profiles(start, tau, limits)
    bends = Bends(speeds, limits, curvature)
    overlaps = [boxes.overlap]
    if len(profiles) > 1:
        edges = widened(boxes.lower, boxes.upper, margin)[1]
        overlaps += list(overlapping(edges, np.array([profile.l for profile in profiles[1:]])))
    within = (boxes.ends[0] < speeds.most) & (boxes.ends[1] > speeds.least)
    best: dict[Maneuver, tuple[float, int, _LateralProfile]] = {}
    shut: list[_Shut] = []
    for profile, overlap in zip(profiles, overlaps, strict=True):
        meetings = _meetings(speeds, boxes.ends, within & overlap)
        # What a guide must not do costs infinitely much, and so does what counts as another manoeuvre.
        cost = np.where(_entered(meetings) | speeds.family.harsh, np.inf, speeds.cost)
        for maneuver, others in _kinds(profile, boxes, speeds):
            p = _gentlest(cost if others is None else np.where(others, np.inf, cost), bends)
            if p is not None:
                total = float(cost[p]) + profile.cost
                if maneuver not in best or total < best[maneuver][0]:
                    best[maneuver] = (total, p, profile)
            else:
                shut.append(_Shut(profile, maneuver, others, meetings))
    if Maneuver.YIELD not in best and Maneuver.GO_AHEAD not in best:
        wanted: list[Maneuver | None] = [None] if best else [None, Maneuver.LEFT, Maneuver.RIGHT]
        best |= _closest(shut, wanted, bends)
    passings = [
        _passing(maneuver, cost, speeds, p, profile, reference.t, boxes)
        for maneuver, (cost, p, profile) in best.items()
    ]
    return tuple(sorted(passings, key=lambda x: x.cost))


def _gentlest(cost: Array, bends: Bends) -> int | None:
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


def _meetings(speeds: Rollouts, ends: Array, met: npt.NDArray[np.bool_]) -> _Meetings:
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
    shut: list[_Shut], wanted: list[Maneuver | None], bends: Bends
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
        if badness[p] < (closest[profile.maneuver][0] if profile.maneuver in closest else np.inf):
            closest[profile.maneuver] = (float(badness[p]), p, profile, maneuver)
    found = (closest[kind] for kind in wanted if kind in closest)
    return {maneuver: (_SHUT + badness, p, profile) for badness, p, profile, maneuver in found}


def _kinds(
    profile: _LateralProfile, boxes: Surroundings, speeds: Rollouts
) -> tuple[tuple[Maneuver, npt.NDArray[np.bool_] | None], ...]:
    """The manoeuvres that a lateral motion may be part of; for each the speed profiles (P,) of others."""
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
    speeds: Rollouts,
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
    return Passing(maneuver, guide, sides, cost, cost < _SHUT)


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
