"""Is the end of a repair safe? A stop from its last state, judged by the one checker."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repair.check.checker import Checker
from repair.check.verdict import Reason, Verdict, Violation
from repair.curves.base import Curve, SplicedCurve
from repair.curves.plane import STANDSTILL
from repair.deadline import in_time
from repair.problem.problem import RepairProblem
from repair.terminal.family import Trial, stops_from
from repair.terminal.traffic import LastSteps, extended, traffic_until
from repair.terminal.verdict import Continuation, Ending, Terminal
from repair.timegrid import INSTANT, steps_until

if TYPE_CHECKING:
    from repair.problem.factory import ProblemFactory
    from repair.scene.traffic.obstacle import Obstacle
    from repair.vehicle.states import DrivenStates

__all__ = ["EXTENSIONS", "EndJudge"]

#: What may become of those whose prediction has ended.
EXTENSIONS = ("constant_velocity", "hold")


class _Judges(NamedTuple):
    """The checker until a later step, among the traffic as it is predicted, and as each extension has it."""

    n_steps: int
    known: Checker
    extended: dict[str, Checker]


class EndJudge:
    """Judges the ends of the repairs of one situation.

    Parameters
    ----------
    checker : Checker
        The one judge; asked here about the time after the repair, too.
    source : ProblemFactory
        The repair problems: lateral room, limits.
    """

    def __init__(self, checker: Checker, source: ProblemFactory) -> None:
        self.checker, self.source = checker, source
        self._made: _Judges | None = None
        self._ends = LastSteps(checker.scene)

    def __call__(self, driven: Curve, t_end: float, *, thorough: bool = True) -> Terminal:
        """How what is driven until ``t_end`` ends.

        Parameters
        ----------
        driven : Curve
            From the start on.
        t_end : float
            Its last scenario step [s].
        thorough : bool
            Look for a stop that is safe under both extensions; if not, any that meets nothing predicted will
            do.
        """
        scene, limits = self.checker.scene, self.source.limits
        state = driven.sample([t_end])
        moving = _last_moving(driven, t_end, scene.dt)
        trials = stops_from(
            state, scene.frame, limits, self.source.bounds, scene.dt,
            lateral=self.source.settings.lateral != "none",
        )  # fmt: skip
        first: tuple[Trial, Verdict] | None = None
        second: Terminal | None = None
        tried = 0
        for trial in trials:
            in_time()
            tried += 1
            trial = trial.waiting(self.checker.config.terminal_wait, scene.dt)
            judges = self._until(trial.stop.t_end)
            problem = self._problem(driven, moving, trial.stop.t_end)
            whole = trial.stop if moving == t_end else SplicedCurve(driven, trial.stop, t_end)
            # Only the first stop's verdict is told; of the others most meet somebody, which is seen soonest.
            if first is not None and judges.known.refuses_traffic(problem, whole) is not None:
                continue
            verdict = judges.known.check(problem, whole)
            if not verdict.ok:
                first = first or (trial, verdict)
                continue
            beyond = {how: _refused(judge, problem, whole) for how, judge in judges.extended.items()}
            safe = not any(beyond.values())
            ending = Ending.SAFE if safe else Ending.SAFE_UNLESS_EXTENDED
            found = Terminal(ending, self._driven(driven, trial, t_end), beyond, (), tried)
            if safe or not thorough:
                return found
            second = second or found
        if second is not None:
            return replace(second, tried=tried)
        if first is None:
            why = Violation(Reason.LIMITS, t_end, "in the bend ahead nothing is left to brake with")
            return Terminal(Ending.UNSAFE, None, {}, (why,), tried)
        trial, verdict = first
        return Terminal(Ending.UNSAFE, self._driven(driven, trial, t_end), {}, verdict.violations, tried)

    def passes(self, driven: Curve, leg: Curve, leaves: float) -> bool:
        """Whether the checker accepts a leg that leaves what is driven at a time [s], until the leg's end."""
        since = _last_moving(driven, leaves, self.checker.scene.dt)
        whole = leg if since == leaves else SplicedCurve(driven, leg, leaves)
        return self._until(leg.t_end).known.check(self._problem(driven, since, leg.t_end), whole).ok

    def drive(self, driven: Curve, t_end: float) -> DrivenStates:
        """The vehicle along a curve until a time [s], also beyond the scene's horizon; at its steps."""
        judge = self._until(t_end).known
        return judge.drive(driven, t_end).every(judge.config.substeps)

    def _problem(self, driven: Curve, since: float, stops: float) -> RepairProblem:
        """To follow what is driven until a time [s], and to be judged from there on."""
        return replace(self.source, reference=driven, t_end=stops).plain(since)

    def _until(self, t_end: float) -> _Judges:
        """Judges who look at least as far as a time [s]; made again where that is farther than before."""
        checker = self.checker
        scene = checker.scene
        needed = steps_until(t_end, scene.dt)
        if self._made is None or self._made.n_steps < needed:
            ahead = math.ceil(1.25 * (needed - steps_until(self.source.t_end, scene.dt)))
            n_steps = max(scene.n_steps, needed, steps_until(self.source.t_end, scene.dt) + ahead)
            config = replace(checker.config, margin=False, gaps="always")

            known = traffic_until(scene, n_steps, self._ends)

            def judge(obstacles: tuple[Obstacle, ...]) -> Checker:
                later = replace(scene, n_steps=n_steps, horizon=n_steps * scene.dt, obstacles=obstacles)
                return Checker(later, checker.limits, config, checker.reference_limits, like=checker)

            others = {how: judge(extended(scene, known, n_steps, how, self._ends)) for how in EXTENSIONS}
            self._made = _Judges(n_steps, judge(known), others)
        return self._made

    def _driven(self, driven: Curve, trial: Trial, t_end: float) -> Continuation:
        """The vehicle at the scenario's steps from the last state of the repair on."""
        states = self.drive(SplicedCurve(driven, trial.stop, t_end), trial.stop.t_end)
        return Continuation(trial.maneuver, trial.stop, states.since(t_end - INSTANT))


def _refused(judge: Checker, problem: RepairProblem, curve: Curve) -> Violation | None:
    """Why a curve is refused that passes every check but for other traffic."""
    if judge.config.extra:  # a check of one's own may look at the traffic as well
        return next(iter(judge.check(problem, curve).violations), None)
    return judge.refuses_traffic(problem, curve)


def _last_moving(driven: Curve, t_end: float, dt: float) -> float:
    """The last step [s] until ``t_end`` before which the vehicle moves: who stands shows no direction."""
    times = np.arange(steps_until(t_end, dt) + 1) * dt
    moves = np.flatnonzero(driven.sample(times).velocity[:, 0] > 2.0 * STANDSTILL)
    return min(float(times[min(moves[-1] + 1, len(times) - 1)]), t_end) if len(moves) else 0.0
