"""One drive: the ego follows its plan, and a policy is asked every cycle whether to leave it."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from repair.arrays import Array
from repair.baselines.evasive.maneuvers import EvasiveManeuver, maneuvers_at
from repair.curves.base import Curve
from repair.scene.scene import InitialState
from repair.simulate.contact import Struck, first_struck, least_distance
from repair.simulate.curves import ahead_of, driven_along, resumed
from repair.simulate.data import CycleRecord, Driven
from repair.simulate.eyes import Eyes, Grounds, Sight
from repair.simulate.policies.base import KEEP, Action, Policy
from repair.vehicle.states import DrivenStates

__all__ = ["drive"]

_PER_STEP = 5  # so often the ego is looked at within a step
_LOOKED = 1.0  # distances up to here are told [m]


@dataclass(eq=False)
class _Drive:
    """Where it is, and what it drives.

    Attributes
    ----------
    curve : Curve
        What is driven; its time 0 is that of ``step``.
    mode : str
        ``plan``, ``repair`` or ``brake``.
    clear : float
        How long the plan has been clear [s].
    verified : float
        Until when what is driven was verified when it was committed to [s] since the drive began.
    poses : list of (K, 4) array
        Centre [m], orientation [rad] and speed [m/s], ``_PER_STEP`` to a step; the first begins the drive.
    """

    grounds: Grounds
    policy: Policy
    plan: Curve
    curve: Curve
    ego: InitialState
    step: int = 0
    mode: str = "plan"
    clear: float = 0.0
    verified: float = 0.0
    poses: list[Array] = field(default_factory=list)

    def cycle(self, eyes: Eyes) -> CycleRecord:
        """Ask the policy, and take what it says."""
        eyes.spent, eyes.complete, eyes.solves = 0.0, True, 0
        sight = eyes.sight(self.curve, self.ego, self.step, self.mode)
        ttc, f_ttr = float("inf"), None
        if self.mode == "plan":
            action = self._follow(sight)
            ttc, f_ttr = self._alarm(sight), action.f_ttr
        else:
            back = self._return(eyes)
            if back is not None:
                action = back
            elif self.mode == "brake":
                action = self.policy.release(self._back(eyes))
            else:
                met = sight.alarming("contact") or sight.conflict.kind == "off_road"
                action = self.policy.decide(sight) if met else KEEP
                ttc, f_ttr = self._alarm(sight, "contact"), action.f_ttr
        self._take(action)
        if f_ttr is None and ttc == float("inf"):
            f_ttr = ttc
        return CycleRecord(
            self.step * self.grounds.scene.dt, self.mode, ttc, f_ttr, eyes.spent, eyes.complete
        )

    def _alarm(self, sight: Sight, trigger: str | None = None) -> float:
        met = sight.alarming(trigger or self.grounds.config.simulate.trigger)
        return min(sight.conflict.time, sight.conflict.contact_time) if met else float("inf")

    def _follow(self, sight: Sight) -> Action:
        if sight.alarming(self.grounds.config.simulate.trigger):
            return self.policy.decide(sight)
        return KEEP

    def _back(self, eyes: Eyes) -> Sight:
        """Back to the plan from here."""
        left = self._left()
        way = resumed(self.curve, self.plan, left, self.grounds.config.simulate.back)
        return eyes.sight(way, self.ego, self.step)

    def _return(self, eyes: Eyes) -> Action | None:
        """The way back to the plan, where that has been clear for long enough."""
        config, sight = self.grounds.config.simulate, self._back(eyes)
        if sight.alarming(config.trigger) or sight.conflict.kind == "off_road":
            self.clear = 0.0
            return None
        self.clear += self.grounds.period
        return Action("plan", sight.curve) if self.clear > config.clear_for - 1e-9 else None

    def _take(self, action: Action) -> None:
        if action.kind == "keep":
            return
        self.verified = self.step * self.grounds.scene.dt + action.until
        if action.kind == "brake":
            if self.mode == "brake":
                return
            left = self._left()
            self.curve = maneuvers_at(
                self.curve, 0.0, left, EvasiveManeuver.BRAKE, self.grounds.config.evasive,
                self.grounds.scene.vehicle,
            )[0]  # fmt: skip
        elif action.curve is not None:
            self.curve = action.curve
        self.mode, self.clear = action.kind, 0.0

    def _left(self) -> float:
        return (self.grounds.beliefs.world.n_steps - self.step) * self.grounds.scene.dt

    def go(self, steps: int) -> None:
        """Drive on for so many steps."""
        dt = self.grounds.scene.dt
        times = np.arange(steps * _PER_STEP + 1) * (dt / _PER_STEP)
        states = driven_along(self.grounds.scene, self.curve, times, self.ego.orientation)
        here = _poses(states)
        self.poses.append(here if not self.poses else here[1:])
        by = steps * dt
        at = self.curve.sample(np.array([by]))
        x, y, orientation, speed = here[-1].tolist()
        self.ego = InitialState(x, y, orientation, max(speed, 0.0), float(at.acceleration[0, 0]), 0.0)
        self.step += steps
        self.curve = ahead_of(self.curve, by, max(self._left(), dt))


def drive(grounds: Grounds, plan: Curve, policy: Policy) -> Driven:
    """Drive a plan to the record's end, or to a contact.

    Parameters
    ----------
    grounds : Grounds
    plan : Curve
        In the frame of its scene, from t = 0 on.
    policy : Policy

    Returns
    -------
    Driven
    """
    scene, world = grounds.scene, grounds.beliefs.world
    start = driven_along(scene, plan, np.arange(3) * scene.dt, None)
    ego = InitialState(
        float(start.x[0]), float(start.y[0]), float(start.orientation[0]), float(start.speed[0]),
        float(plan.sample(np.zeros(1)).acceleration[0, 0]), 0.0,
    )  # fmt: skip
    run = _Drive(grounds, policy, plan, ahead_of(plan, 0.0, world.n_steps * scene.dt), ego)
    eyes, cycles = Eyes(grounds), []
    every = round(grounds.period / scene.dt)
    size = 2.0 * scene.vehicle.half_length, 2.0 * scene.vehicle.half_width
    struck: Struck | None = None
    while struck is None and run.step < world.n_steps:
        if world.n_steps - run.step >= 3:
            with _uncollected():
                cycles.append(run.cycle(eyes))
        first, steps = run.step, min(every, world.n_steps - run.step)
        run.go(steps)
        latest = run.poses[-1] if len(run.poses) == 1 else np.vstack([run.poses[-2][-1:], run.poses[-1]])
        struck = first_struck(world.since(first, first + steps), latest, size, scene.dt, first * scene.dt)
    poses = np.concatenate(run.poses)
    count = len(poses) if struck is None else round(struck.time / scene.dt * _PER_STEP) + 1
    poses = poses[:count]
    distance = 0.0
    if struck is None:
        distance = least_distance(world.since(0, world.n_steps), poses, size, _LOOKED)
    planned = _poses(driven_along(scene, plan, np.arange(count) * (scene.dt / _PER_STEP), None))
    broken = struck is not None and run.mode == "repair" and struck.time < run.verified - scene.dt
    return Driven(scene.dt, _columns(poses, planned, scene.dt), tuple(cycles), struck, distance, broken)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Leave Python's garbage for the time between two cycles: to look for it may take longer than a cycle."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def _poses(states: DrivenStates) -> Array:
    return np.column_stack([states.x, states.y, states.orientation, states.speed])


def _columns(poses: Array, planned: Array, dt: float) -> dict[str, list[float]]:
    """At the scenario's steps."""
    ego, plan = poses[::_PER_STEP], planned[::_PER_STEP]
    named = {"t": np.arange(len(ego)) * dt}
    for prefix, table in (("", ego), ("plan_", plan)):
        named |= {f"{prefix}{n}": table[:, k] for k, n in enumerate(("x", "y", "orientation", "speed"))}
    return {name: np.asarray(column).tolist() for name, column in named.items()}
