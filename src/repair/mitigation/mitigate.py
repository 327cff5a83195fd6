"""The motion that hits least hard, among full braking, stops with swerves, and what shooting finds."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.curves.base import Curve
from repair.deadline import OutOfTime, in_time, until
from repair.errors import RepairError
from repair.mitigation.impact import Impact, ImpactJudge
from repair.mitigation.settings import MitigationConfig
from repair.situation import require_situation
from repair.solvers.shooting.impact import Impacts
from repair.solvers.shooting.plans import ALONG, FREE
from repair.solvers.shooting.settings import ShootingConfig
from repair.solvers.shooting.shots import Shot
from repair.solvers.shooting.task import Task
from repair.terminal.family import stops_from
from repair.timegrid import intervals, on_grid
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.problem.problem import RepairProblem
    from repair.situation import Situation

__all__ = ["Mitigation", "Motion", "mitigate"]

_EQUAL = 0.01  # impact speeds nearer to each other than this are equal, and the overlap decides [m/s]
_ASIDE = 0.25  # who moves sideways by less than this keeps the path [m]
_RESERVES = (0.0, 0.02)  # shares of the limits that shooting leaves unused, one after the other
_EDGE = 0.05  # what shooting keeps from the end of the lateral room [m]


@dataclass(frozen=True)
class Motion:
    """A motion from the start on that can be driven until its impact.

    Attributes
    ----------
    maneuver : str
        ``brake``, ``swerve_left``, ``swerve_right``, ``accelerate`` or ``keep_speed``.
    by : str
        ``full_braking``, ``stops`` (of the family that is tried at the end of repairs) or ``shooting``.
    curve : Curve
        In the frame of the scene.
    impact : Impact
    states : DrivenStates
        At the scenario's steps until the one at or after the impact.
    """

    maneuver: str
    by: str
    curve: Curve
    impact: Impact
    states: DrivenStates


@dataclass(frozen=True)
class Mitigation:
    """What is left to do where nothing avoids the conflict.

    Attributes
    ----------
    best : Motion or None
        The motion of least impact speed; None where none that was tried can be driven.
    braking : Motion or None
        Plain full braking along the path; None where that cannot be driven.
    t_end : float
        Until when impacts were looked for [s].
    tried : int
        Motions whose impact was looked at, one for each set that was drawn at random.
    complete : bool
        Whether everything was tried (False: the time limit was reached).
    """

    best: Motion | None
    braking: Motion | None
    t_end: float
    tried: int
    complete: bool


def mitigate(situation: Situation, settings: MitigationConfig | None = None) -> Mitigation:
    """Look for the motion of least impact speed, reacting at once.

    Full braking along the path is one of the motions, so that what is returned is never worse. A motion
    that leaves the road counts only where full braking leaves it too, and none that would hit anything later
    harder than full braking does. Among impact speeds that are equal (to 0.01 m/s) the least overlap decides,
    and then full braking comes first.

    Parameters
    ----------
    situation : Situation
        What :func:`repair.prepare` returns.
    settings : MitigationConfig, optional
        Those of the configuration by default.

    Returns
    -------
    Mitigation
        The best motion, full braking beside it, and whether the look came to its end.

    Raises
    ------
    RepairError
        If there is no conflict, the ego is in contact at the very start, or it is no situation.
    """
    require_situation(situation)
    config: Any = getattr(situation, "config", None)
    if settings is None:
        settings = config.mitigation if config is not None else MitigationConfig()
    conflict = situation.conflict
    if math.isinf(conflict.time):
        raise RepairError("there is nothing to mitigate: the reference can be followed to its end")
    if conflict.contact_time <= 0.0:
        raise RepairError("there is nothing to mitigate: the ego is in contact at the very start")
    shooting = config.section("shooting") if config is not None else ShootingConfig()
    look = _Look(situation, shooting)
    complete = True
    try:
        with until(time.perf_counter() + settings.time_limit):
            look.all()
    except OutOfTime:
        complete = False
    return Mitigation(look.best(), look.braking, look.judge.t_end, look.tried, complete)


@dataclass(frozen=True)
class _Candidate:
    """A motion whose impact is known, and of which is not known yet whether it can be driven."""

    by: str
    curve: Curve
    impact: Impact


class _Look:
    """The motions of one situation."""

    def __init__(self, situation: Situation, shooting: ShootingConfig) -> None:
        self.situation, self.shooting = situation, shooting
        scene, limits = situation.scene, situation.limits
        self.state = situation.reference.sample([0.0])
        speed = max(float(self.state.velocity[0, 0]), 0.0)
        rest = intervals(1.1 * speed / -limits.a_min, scene.dt) * scene.dt
        horizon = on_grid(scene.horizon, scene.dt)
        self.judge = ImpactJudge(situation, max(min(max(situation.t_end, rest), horizon), scene.dt))
        self.tried, self._kept = 0, dict[int, Motion | None]()
        self.candidates: list[_Candidate] = []
        self.braking: Motion | None = None
        self.braking = self._full_braking()

    def all(self) -> None:
        """Try everything; what has been tried stays when the time is up."""
        if self.braking is not None and self.braking.impact.kind == "none":
            return
        for trial in self._stops():
            in_time()
            self._add("stops", trial.stop)
        for reserve in _RESERVES:
            for plan in (ALONG, FREE) if self._problem(0.0).lateral else (ALONG,):
                in_time()
                task = self._task(reserve)
                curve = task.curve(plan, task.search(plan))
                self.tried += task.iterations
                self._add("shooting", curve)
            if self._motion(self.candidates[-1]) is not None:
                break

    def best(self) -> Motion | None:
        """The drivable motion of least impact speed, and of these of least overlap."""
        found: list[Motion] = []
        for candidate in sorted(filter(self._allowed, self.candidates), key=lambda c: _order(c.impact)):
            if found and not _near(candidate.impact, found[0].impact):
                break
            motion = self._motion(candidate)
            if motion is not None:
                found.append(motion)
        if self.braking is not None and (not found or self._equal(found[0])):
            found.insert(0, self.braking)
        return min(found, key=lambda m: round(m.impact.overlap, 1), default=None)

    def _allowed(self, candidate: _Candidate) -> bool:
        """Whether a motion hits nothing harder than full braking does, and keeps the road where that does."""
        if self.braking is None:
            return True
        mine, theirs = candidate.impact, self.braking.impact
        kept = mine.kind != "off_road" or theirs.kind == "off_road"
        return kept and mine.speed <= theirs.speed and mine.worst <= theirs.worst

    def _equal(self, motion: Motion) -> bool:
        """Whether full braking is as good as a motion."""
        return self.braking is not None and _near(self.braking.impact, motion.impact)

    def _full_braking(self) -> Motion | None:
        """As hard as limits and bends allow; of two ways to lay it out the one that is softer in the end."""
        task = self._task(0.0)
        row = np.full((1, ALONG.size), -1.0)
        self._add("full_braking", task.curve(ALONG, Shot(row, 0.0, 0.0)))
        for trial in self._stops():
            if trial.maneuver in ("brake", "stand"):
                self._add("full_braking", trial.stop)
            break
        found = [motion for c in self.candidates if (motion := self._motion(c)) is not None]
        return min(found, key=lambda m: (_order(m.impact), m.impact.overlap), default=None)

    def _stops(self) -> Iterator[Any]:
        situation = self.situation
        return stops_from(
            self.state, situation.scene.frame, situation.limits, situation.source.bounds, situation.scene.dt,
            lateral=situation.settings.lateral != "none",
        )  # fmt: skip

    def _problem(self, reserve: float) -> RepairProblem:
        """Of the whole time that is looked at; true shapes, and no margin around them."""
        situation = self.situation
        source = replace(situation.unguided.factory, t_end=self.judge.t_end)
        problem = source.without_guide(0.0)[0]
        shapes = None if problem.shapes is None else replace(problem.shapes, room=0.0)
        return replace(problem, shapes=shapes, limits=situation.limits.reserving(reserve))

    def _task(self, reserve: float) -> Task:
        full = None if self.braking is None else self.braking.impact
        leaves, most = (False, math.inf) if full is None else (full.kind == "off_road", full.worst)
        space = partial(Impacts, edge=_EDGE, leaves=leaves, most=most)
        return Task(self._problem(reserve), self.shooting, space)

    def _add(self, by: str, curve: Curve) -> None:
        self.tried += 1
        self.candidates.append(_Candidate(by, curve, self.judge.impact(curve)))

    def _motion(self, candidate: _Candidate) -> Motion | None:
        """The candidate as a motion; None where it cannot be driven until its impact."""
        key = id(candidate)
        if key not in self._kept:
            curve, impact = candidate.curve, candidate.impact
            made = None
            if not self.judge.faults(curve, impact):
                states = self.judge.driven(curve, impact)
                made = Motion(self._maneuver(curve, impact), candidate.by, curve, impact, states)
            self._kept[key] = made
        return self._kept[key]

    def _maneuver(self, curve: Curve, impact: Impact) -> str:
        """What it does until its impact."""
        end = min(impact.time, self.judge.t_end)
        first, last = curve.sample([0.0, end]), self.situation.reference.sample([0.0, end])
        aside = float(first.position[1, 1] - last.position[0, 1])
        if abs(aside) > _ASIDE:
            return "swerve_left" if aside > 0.0 else "swerve_right"
        faster = float(first.velocity[1, 0] - first.velocity[0, 0])
        return "keep_speed" if abs(faster) < 0.05 else "brake" if faster < 0.0 else "accelerate"


def _near(impact: Impact, least: Impact) -> bool:
    """Whether an impact is no harder than the least, but for what does not count."""
    return impact.kind == least.kind and impact.speed <= least.speed + _EQUAL


def _order(impact: Impact) -> tuple[int, float]:
    """By what impacts are ordered: who hits nothing first, who leaves the road last."""
    return ("none", "contact", "off_road").index(impact.kind), impact.speed
