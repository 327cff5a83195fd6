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


@dataclass(frozen=True)
class _Rollouts:
    """Speed profiles (P, K): position, speed and acceleration over the guide's times."""

    s: Array
    v: Array
    a: Array
    cost: Array


def _speed_profiles(start: Array, tau: Array, limits: Limits) -> _Rollouts:
    """Hold the speed, change it at a constant rate to a target speed, hold that; never reverse."""
    s0, v0 = float(start[0, 0]), max(float(start[1, 0]), 0.0)
    top = max(limits.v_max, v0)
    family = [(0.0, 0.0, v0)]  # (delay, rate, target)
    family += [(0.0, share * limits.a_min, hold * v0) for share in _BRAKING for hold in _HOLD]
    family += [
        (delay, share * limits.a_max, min(v0 + gain, top))
        for share in _THROTTLE
        for gain in (2.0, 5.0, 50.0)
        for delay in _DELAYS
        if delay < tau[-1]
    ]
    delay, rate, target = (column[:, None] for column in np.array(family).T)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(rate == 0.0, 0.0, (target - v0) / np.where(rate == 0.0, 1.0, rate))
    ramp = np.clip(tau - delay, 0.0, change)
    s = s0 + v0 * tau + 0.5 * rate * ramp**2 + (target - v0) * np.maximum(tau - delay - change, 0.0)
    v = v0 + rate * ramp
    a = np.where((tau >= delay) & (tau < delay + change), rate, 0.0)
    loss = (s[:1, -1] - s[:, -1]) / max(tau[-1], 1.0)
    cost = np.mean(a**2, axis=1) + 0.01 * loss**2
    return _Rollouts(s, v, a, cost)


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


def _conflict(occupancy: Occupancy, lower: Array, upper: Array, s: Array, l: Array) -> tuple[int, int] | None:  # noqa: E741
    """First (time index, obstacle) whose box the path (s, l) enters."""
    inside = (lower[..., 0] < s) & (s < upper[..., 0]) & (lower[..., 1] < l) & (l < upper[..., 1])
    hit = inside.any(axis=0)
    if not hit.any():
        return None
    k = int(np.argmax(hit))
    return k, int(np.argmax(inside[:, k]))


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
    conflict = _conflict(occupancy, lower, upper, reference.position[:, 0], reference.position[:, 1])
    profiles = _lateral_profiles(
        start, tau, reference, lower, upper, conflict, limits, bounds, margin + 0.05, lateral
    )
    speeds = _speed_profiles(start, tau, limits)
    # Braking in a bend is bound by the friction circle; a guide leaves a tenth of it.
    bend = np.abs(speeds.v**2 * np.interp(speeds.s, *curvature))
    excess = np.maximum(np.hypot(bend, speeds.a) - 0.9 * limits.a_total, bend - 0.9 * limits.a_lat).max(
        axis=1
    )
    excess = np.maximum(excess, 0.0)
    best: dict[Maneuver, tuple[float, int, _LateralProfile]] = {}
    closest: dict[Maneuver | None, tuple[float, int, _LateralProfile, Maneuver]] = {}
    for profile in profiles:
        overlap = (lower[..., 1] - margin < profile.l) & (profile.l < upper[..., 1] + margin)
        met = np.flatnonzero(overlap.any(axis=1))
        behind = lower[met, :, 0] - margin - speeds.s[:, None, :]
        ahead = speeds.s[:, None, :] - upper[met, :, 0] - margin
        depth = np.where(overlap[met], np.minimum(-behind, -ahead), 0.0).max(axis=(1, 2), initial=0.0)
        free = (depth <= 0.0) & (excess <= 0.0)
        cost = speeds.cost + profile.cost
        for maneuver, members in _kinds(profile, conflict, overlap, met, ahead, speeds).items():
            usable = np.flatnonzero(free & members)
            if len(usable):
                p = int(usable[np.argmin(cost[usable])])
                if maneuver not in best or cost[p] < best[maneuver][0]:
                    best[maneuver] = (float(cost[p]), p, profile)
            elif members.any():
                badness = np.where(members, 10.0 * depth + excess, np.inf)
                p = int(np.argmin(badness))
                if profile.maneuver not in closest or badness[p] < closest[profile.maneuver][0]:
                    closest[profile.maneuver] = (float(badness[p]), p, profile, maneuver)
    wanted: list[Maneuver | None] = [] if best.keys() & {Maneuver.YIELD, Maneuver.GO_AHEAD} else [None]
    if not best:
        wanted += [Maneuver.LEFT, Maneuver.RIGHT]
    for kind in wanted:
        if kind in closest:
            badness_, p, profile, maneuver = closest[kind]
            best[maneuver] = (1e3 + badness_, p, profile)
    passings = [
        _passing(maneuver, cost, speeds, p, profile, reference.t, lower, upper)
        for maneuver, (cost, p, profile) in best.items()
    ]
    return tuple(sorted(passings, key=lambda x: x.cost))


def _kinds(
    profile: _LateralProfile,
    conflict: tuple[int, int] | None,
    overlap: npt.NDArray[np.bool_],
    met: npt.NDArray[np.intp],
    ahead: Array,
    speeds: _Rollouts,
) -> dict[Maneuver, npt.NDArray[np.bool_]]:
    """Which speed profiles (P,) count as which manoeuvre."""
    if profile.maneuver is not None or conflict is None:
        return {profile.maneuver or Maneuver.YIELD: np.ones(len(speeds.s), dtype=bool)}
    j = conflict[1]
    where = np.flatnonzero(met == j)
    if not len(where):
        return {Maneuver.YIELD: np.ones(len(speeds.s), dtype=bool)}
    passed = ((ahead[:, where[0]] > 0.0) & overlap[j]).any(axis=1)
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
    guide = FrenetTrajectory(
        frozen(times),
        frozen(np.column_stack([speeds.s[p], profile.l])),
        frozen(np.column_stack([speeds.v[p], profile.rate])),
        frozen(np.column_stack([speeds.a[p], profile.acceleration])),
        frozen(np.zeros((len(times), 2))),
    )
    return Passing(maneuver, guide, sides_of(guide.position, lower, upper), cost)


def sides_of(position: Array, lower: Array, upper: Array) -> npt.NDArray[np.int8]:
    """Side (N, K) that a collision-free path (K, 2) takes of each box.

    Where the path is clear on one axis only, that axis decides; where it is clear on both, the
    larger distance does.
    """
    room = np.stack(
        [
            lower[..., 0] - position[:, 0],
            position[:, 0] - upper[..., 0],
            position[:, 1] - upper[..., 1],
            lower[..., 1] - position[:, 1],
        ]
    )
    present = np.isfinite(room).all(axis=0)
    side: npt.NDArray[np.int8] = np.argmax(np.where(present, room, -np.inf), axis=0).astype(np.int8)
    assert (Side.BEHIND, Side.AHEAD, Side.LEFT, Side.RIGHT) == (0, 1, 2, 3)
    return side
