"""The sides of passing: which ways past the obstacles are open from a time-to-repair on.

EGO-Planner finds the side by an A* path around the obstacle; here the obstacles move, so the
search is over space and time: a family of manoeuvres (keep the path, move to the left or right of
the first obstacle in conflict; each with a range of speed changes) is rolled out and tested against
all boxes at once. The gentlest survivor of each kind is a :class:`repair.problem.problem.Passing`: a
guide, and the side it takes of every obstacle. A guide respects the acceleration limits, not the jerk
limits; it shows that a way is open, and a backend makes a trajectory of it.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.curves.base import FrenetTrajectory
from repair.problem.lateral import LateralProfile, lateral_profiles
from repair.problem.limits import Limits
from repair.problem.problem import Maneuver, Passing
from repair.problem.speeds import Bends, Rollouts, speed_profiles
from repair.problem.surroundings import Surroundings, overlapping, sides_of, surroundings, widened
from repair.scene.road.bounds import LateralBounds
from repair.world.boxes import Occupancy

__all__ = ["open_passings", "possible_maneuvers"]

# The cost of a way that is not open starts here, far above those of open ones.
_SHUT = 1e3
# Of more speed profiles than these what they exceed is worked out, and kept, for all of them.
_FEW = 15


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
    bends: Bends | None = None,
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
        What :func:`repair.problem.surroundings.surroundings` says of the reference, the obstacles and
        the margin, if it is known.
    bends : Bends, optional
        The speed profiles from the state on and what the path's bends leave of them, likewise.

    Returns
    -------
    tuple of Passing
        Where no manoeuvre that keeps the path is open, the one of them that comes closest is
        added, and where none is open at all, so are the closest on the left and on the right: the
        boxes are wider than the vehicles, so it is for the checker to say that they fail.
    """
    tau = reference.t - reference.t[0]
    boxes = boxes or surroundings(reference, occupancy, margin)
    profiles = lateral_profiles(start, tau, reference, boxes, limits, bounds, margin + 0.05, lateral)
    bends = bends or Bends(speed_profiles(start, tau, limits), limits, curvature)
    speeds = bends.speeds
    overlaps = [boxes.overlap]
    if len(profiles) > 1:
        edges = widened(boxes.lower, boxes.upper, margin)[1]
        overlaps += list(overlapping(edges, np.array([profile.l for profile in profiles[1:]])))
    within = (boxes.ends[0] < speeds.most) & (boxes.ends[1] > speeds.least)
    best: dict[Maneuver, tuple[float, int, LateralProfile]] = {}
    shut: list[_Shut] = []
    for profile, overlap in zip(profiles, overlaps, strict=True):
        meetings = _meetings(speeds, boxes.ends, within & overlap)
        # What a guide must not do costs infinitely much, and so does what counts as another manoeuvre.
        cost = np.where(_entered(meetings) | speeds.family.harsh, np.inf, speeds.cost)
        for maneuver, others in possible_maneuvers(profile, boxes, speeds):
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

    profile: LateralProfile
    maneuver: Maneuver
    others: npt.NDArray[np.bool_] | None
    meetings: _Meetings


def _closest(
    shut: list[_Shut], wanted: list[Maneuver | None], bends: Bends
) -> dict[Maneuver, tuple[float, int, LateralProfile]]:
    """Of the manoeuvres that are not open the one of each wanted kind that comes closest to it."""
    closest: dict[Maneuver | None, tuple[float, int, LateralProfile, Maneuver]] = {}
    for profile, maneuver, others, meetings in shut:
        if profile.maneuver not in wanted:
            continue
        depth = 10.0 * _depth(meetings)
        if others is not None:
            depth[others] = np.inf
        p, badness = _least_bad(depth, bends)
        if badness < (closest[profile.maneuver][0] if profile.maneuver in closest else np.inf):
            closest[profile.maneuver] = (badness, p, profile, maneuver)
    found = (closest[kind] for kind in wanted if kind in closest)
    return {maneuver: (_SHUT + badness, p, profile) for badness, p, profile, maneuver in found}


def _least_bad(depth: Array, bends: Bends) -> tuple[int, float]:
    """The speed profile of which depth (P,) and excess make least in all, and how much.

    No excess is below 0: looked at are those that are no worse by their depth than the least deep one in all.
    """
    first = int(depth.argmin())
    most = depth.item(first) + bends.excess(slice(first, first + 1)).item()
    near = (depth <= most).nonzero()[0]
    if len(near) == 1:
        return first, most
    excess = bends.excess(near) if len(near) <= _FEW else bends.of_all.take(near)
    badness = depth.take(near) + excess
    k = int(badness.argmin())
    return int(near[k]), float(badness[k])


def possible_maneuvers(
    profile: LateralProfile, boxes: Surroundings, speeds: Rollouts
) -> tuple[tuple[Maneuver, npt.NDArray[np.bool_] | None], ...]:
    """The manoeuvres that a lateral motion may be part of, by the speed that it is driven at.

    Who keeps the path goes ahead of the obstacle in conflict if it is past its front while beside it, and
    yields if not. Who moves aside does neither.

    Returns
    -------
    tuple of (Maneuver, (P,) bool array or None)
        For each manoeuvre the speed profiles that are part of another one; None where none is.
    """
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
    profile: LateralProfile,
    times: Array,
    boxes: Surroundings,
) -> Passing:
    """The speed profile ``p`` and a lateral motion as a guide; the sides it takes when they are asked for."""
    columns = np.zeros((4, len(times), 2))
    columns[0, :, 0], columns[1, :, 0], columns[2, :, 0] = speeds.motion(p)
    columns[0, :, 1], columns[1, :, 1] = profile.l, profile.rate
    if profile.maneuver is not None:
        columns[2, :, 1] = profile.acceleration
    columns.setflags(write=False)
    guide = FrenetTrajectory(times, *columns)
    sides = partial(sides_of, guide.position, boxes.lower, boxes.upper)
    return Passing(maneuver, guide, sides, cost, cost < _SHUT, max(cost - _SHUT, 0.0))
