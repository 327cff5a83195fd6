"""What is driven after the evasive part: to the goal, or back to the reference."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.base import Curve, FrenetTrajectory, SplicedCurve
from repair.deadline import in_time
from repair.onward.goal import GoalState, Miss, goal_states, misses
from repair.onward.leg import Leg, motions
from repair.terminal.stop import settling_from
from repair.timegrid import INSTANT, on_grid, steps_until
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.terminal.judge import EndJudge

__all__ = ["Onward", "back_to_reference", "to_the_goal"]

_TRIES = 24  # so many legs are judged at most that leave at the same time
_SHORTEST = 0.5  # duration of a leg [s]
_APART = 0.25  # at which a path is held against the goal region [m]
_INSIDE = 0.3  # a leg ends this far inside of the goal region, as far as that goes [m]
_STANDS = 1e-2  # who is slower than this stands [m/s]
_BACK = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)  # durations of a way back to the reference [s]
_COMFORT = 2.5  # acceleration of a way back [m/s²]; on average it takes half of that to the end speed
_EARLIER = 0.5  # steps in which a leg leaves what is driven before its end [s]


@dataclass(frozen=True)
class Onward:
    """What is driven after the evasive part.

    Attributes
    ----------
    kind : str
        ``goal`` or ``rejoin``.
    leg : Leg or None
        None where nothing had to be added, or nothing was found.
    states : DrivenStates
        All that is driven then, at the scenario's steps.
    reached : bool
        Whether the goal is reached, or the reference.
    how : str
        Of a way back: ``position`` (where the reference is at that time), ``speed`` (on its path at its
        speed) or ``path`` (on its path, and as near to its speed as is comfortable); ``short`` where the
        reference is not known for long enough.
    missed : tuple of Miss
        What is missed of the goal state that comes closest.
    tried : int
        How many legs were judged.
    """

    kind: str
    leg: Leg | None
    states: DrivenStates
    reached: bool
    how: str = ""
    missed: tuple[Miss, ...] = ()
    tried: int = 0


def to_the_goal(ends: EndJudge, driven: Curve, t_from: float, t_end: float) -> Onward:
    """Go on until the planning problem's goal is reached.

    Parameters
    ----------
    ends : EndJudge
        Who judges what comes after the repair.
    driven : Curve
        What is driven until ``t_end`` [s].
    t_from : float
        Before this time [s] it is not left.
    t_end : float
    """
    goals = goal_states(ends.checker.scene)
    states = ends.drive(driven, t_end)
    missed = _missed(ends, goals, states)
    if not missed:
        return Onward("goal", None, states, bool(goals))
    tried = 0
    stands = float(driven.sample([t_end]).velocity[0, 0]) < _STANDS
    latest = max((goal.last for goal in goals), default=0) * ends.checker.scene.dt if stands else t_end
    for leaves in _leaving(t_from, t_end, latest, ends.checker.scene.dt):
        for leg in islice(_ways_to(ends, goals, driven.sample([leaves])), _TRIES):
            in_time()
            tried += 1
            if ends.passes(driven, leg, leaves):
                whole = ends.drive(SplicedCurve(driven, leg, leaves), leg.t_end)
                left = _missed(ends, goals, whole)
                if not left:
                    return Onward("goal", leg, whole, True, "", (), tried)
    return Onward("goal", None, states, False, "", missed, tried)


def _leaving(t_from: float, t_end: float, latest: float, dt: float) -> Iterator[float]:
    """When what is driven may be left [s]: at its end, later if it stands there, and earlier and earlier."""
    step, end = max(on_grid(_EARLIER, dt), dt), on_grid(t_end, dt)
    for k in range(max(int((latest - end) / step), 0) + 1):
        yield end + k * step
    for k in range(1, int((end - t_from) / step + 1e-6) + 1):
        yield end - k * step


def _missed(ends: EndJudge, goals: Sequence[GoalState], states: DrivenStates) -> tuple[Miss, ...]:
    """What is missed of the goal state that comes closest; empty where one is met."""
    dt = ends.checker.scene.dt
    found = [
        misses(goal, np.column_stack([states.x, states.y]), states.speed, states.orientation, dt)
        for goal in goals
    ]
    return min(found, key=lambda one: (len(one), sum(miss.by for miss in one)), default=())


def _ways_to(ends: EndJudge, goals: Sequence[GoalState], state: FrenetTrajectory) -> Iterator[Leg]:
    """Legs to the goal, the gentlest first."""
    found: list[tuple[float, Leg]] = []
    dt = ends.checker.scene.dt
    begin = steps_until(float(state.t[0]), dt)
    for goal in goals:
        low, high = max(goal.first, begin + 1), goal.last
        if low > high:
            continue
        for step in sorted({low, (2 * low + high) // 3, (low + 2 * high) // 3, high}):
            duration = step * dt - float(state.t[0])
            if duration >= _SHORTEST:
                found += _legs(ends, goal, state, duration)
    found.sort(key=lambda one: one[0])
    yield from (leg for _, leg in found)


def _legs(
    ends: EndJudge, goal: GoalState, state: FrenetTrajectory, duration: float
) -> list[tuple[float, Leg]]:
    """Legs of one duration to one goal state, and what they cost."""
    scene, limits = ends.checker.scene, ends.source.limits
    (s0, l0), v0 = state.position[0], max(float(state.velocity[0, 0]), 0.0)
    reach = (v0 + 0.5 * max(limits.a_max, 1.0) * duration) * duration
    s = s0 + np.arange(0.0, min(reach, 500.0) + _APART, _APART)
    right, left = ends.source.bounds.at(s0 + 0.5 * v0 * duration)
    aside = [0.0, float(l0), *_beside(ends, goal, s)]
    targets = sorted({round(x, 2) for x in aside if right - 1e-6 <= x <= left + 1e-6}, key=abs)
    found = []
    for target in targets:
        places = scene.frame.to_cartesian(s, np.full_like(s, target))
        heading = np.asarray(scene.frame.heading(s))
        there = goal.holds_at(places) & (goal.turned_off(heading) <= 0.0)
        if not there.any():
            continue
        for place in _spread(s[there], s0 + v0 * duration):
            for speed in _speeds(goal, float(place - s0), v0, duration, limits.v_max):
                for start in dict.fromkeys((float(state.acceleration[0, 0]), 0.0)):
                    leg = _leg(state, float(place), speed, duration, target, start)
                    cost = _cost(leg, ends)
                    if cost is not None:
                        found.append((cost + abs(target - float(l0)), leg))
                        break
    return found


def _beside(ends: EndJudge, goal: GoalState, s: Array) -> list[float]:
    """Offsets from the axis at which the goal region may be met."""
    if goal.region is None:
        return []
    frame = ends.checker.scene.frame
    parts = getattr(goal.region, "geoms", [goal.region])
    points = np.array([(part.centroid.x, part.centroid.y) for part in parts])
    return [float(x) for x in frame.to_frenet(points)[:, 1] if np.isfinite(x)]


def _spread(s: Array, wanted: float) -> Array:
    """A few of the places (K,) in the region: the nearest to what is wanted, and others."""
    low, high = float(s[0]), float(s[-1])
    margin = min(_INSIDE, 0.5 * (high - low))
    choice = np.clip([wanted, *np.linspace(low + margin, high - margin, 5)], low + margin, high - margin)
    return np.unique(s[np.abs(s[None, :] - choice[:, None]).argmin(axis=1)])


def _speeds(goal: GoalState, way: float, v0: float, duration: float, v_max: float) -> list[float]:
    """Speeds to end at: that of a constant acceleration, the mean one, rest; within the goal's interval."""
    low, high = goal.speed or (0.0, v_max)
    low, high = max(low, 0.0), min(high, v_max)
    wanted = (2.0 * way / duration - v0, way / duration, 0.5 * way / duration, 0.0)
    margin = min(0.05, 0.5 * max(high - low, 0.0))
    return sorted({float(np.clip(v, low + margin * (low > 0.0), high - margin)) for v in wanted})


def _leg(
    state: FrenetTrajectory, place: float, speed: float, duration: float, target: float, acceleration: float
) -> Leg:
    """From a state to a place and a speed; the path is done with two thirds of the way.

    The acceleration may jump at the start, as the kinematic model's inputs may.
    """
    t, s0 = float(state.t[0]), float(state.position[0, 0])
    along = frozen([s0, max(float(state.velocity[0, 0]), 0.0), acceleration, place])
    path = settling_from(state, target, max(0.67 * (place - s0), 1.0))
    return Leg(t, t + duration, along, speed, path)


def _cost(leg: Leg, ends: EndJudge) -> float | None:
    """Mean square of acceleration; None where the leg reverses or asks too much along the path."""
    limits = ends.source.limits
    tau = np.linspace(0.0, leg.t_end - leg.t_start, 41)
    _, v, a = motions(
        leg.along[:3], leg.along[3:], np.array([leg.speed]), np.array([leg.t_end - leg.t_start]), tau
    )
    if v.min() < -1e-6 or a.min() < limits.a_min or a.max() > limits.a_max or v.max() > limits.v_max:
        return None
    return float(np.mean(a**2))


def back_to_reference(
    ends: EndJudge, driven: Curve, reference: Curve, t_end: float, t_known: float
) -> Onward:
    """Back to the reference: to where it is at that time if there is room, else to its speed or path.

    Parameters
    ----------
    ends : EndJudge
    driven : Curve
        What is driven until ``t_end`` [s].
    reference : Curve
        Known until ``t_known`` [s].
    """
    dt = ends.checker.scene.dt
    state = driven.sample([t_end])
    tried = 0
    spans = [on_grid(span, dt) for span in _BACK if t_end + on_grid(span, dt) <= t_known + INSTANT]
    for how in ("position", "speed", "path"):
        for span in spans if how != "path" else reversed(spans):
            there = reference.sample([t_end + span])
            speed = max(float(there.velocity[0, 0]), 0.0)
            place = float(there.position[0, 0])
            v0 = float(state.velocity[0, 0])
            if how == "path":
                change = 0.5 * _COMFORT * span
                speed = float(np.clip(speed, max(v0 - change, 0.0), v0 + change))
            if how != "position":
                place = float(state.position[0, 0]) + 0.5 * (v0 + speed) * span
            leg = _leg(state, place, speed, span, float(there.position[0, 1]), 0.0)
            if not _is_comfortable(leg, ends):
                continue
            in_time()
            tried += 1
            if ends.passes(driven, leg, t_end):
                whole = ends.drive(SplicedCurve(driven, leg, t_end), leg.t_end)
                return Onward("rejoin", leg, whole, True, how, (), tried)
    return Onward("rejoin", None, ends.drive(driven, t_end), False, "" if spans else "short", (), tried)


def _is_comfortable(leg: Leg, ends: EndJudge) -> bool:
    """Forward only, and gently along the path."""
    if float(leg.along[3]) < float(leg.along[0]) or _cost(leg, ends) is None:
        return False
    samples = leg.sample(np.linspace(leg.t_start, leg.t_end, 41)[4:])  # the start is what it is
    return bool((np.abs(samples.acceleration) <= _COMFORT).all())
