"""A way past the obstacles that the checker rejected, asked for again with more to spare where it failed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from repair.check.verdict import Reason, Verdict
from repair.problem.problem import Maneuver, RepairProblem
from repair.problem.taken import begun
from repair.search.probe import Budget, ProblemSource, Rejected, words
from repair.search.result import Probe

__all__ = ["Notches", "other_ways", "probe_again", "probe_begun", "too_close"]

_LITTLE = 0.5  # a smaller jump of the acceleration gains too little [m/s²]
_GAINED = 1.5  # who misses more along the path hardly ever passes by a jump [m]

#: What is tightened, and the reasons it answers.
_ANSWERS = (
    (Reason.COLLISION, Reason.MARGIN),
    (Reason.OFF_ROAD,),
    (Reason.LIMITS, Reason.KINEMATICS),
)


class Notches(NamedTuple):
    """How many notches room, road and limits are tightened by."""

    room: int = 0
    edge: int = 0
    ease: int = 0

    @classmethod
    def of(cls, amounts: Sequence[float], lists: Sequence[Sequence[float]]) -> Notches:
        """As many as some amounts hold."""
        return cls(*(sum(k <= a for k in notches) for a, notches in zip(amounts, lists, strict=True)))

    def after(self, verdict: Verdict) -> Notches:
        """One notch more of whatever the verdict misses."""
        missed = {violation.reason for violation in verdict.violations}
        return Notches(*(k + any(r in missed for r in why) for k, why in zip(self, _ANSWERS, strict=True)))

    def torn(self, before: Notches) -> bool:
        """Room and limits are both missed since some notches before: more of the one costs the other."""
        return self.room > before.room and self.ease > before.ease

    def amounts(self, lists: Sequence[Sequence[float]]) -> tuple[float, ...] | None:
        """Metres of room and of road, and the share of the limits; None where a list has no such notch."""
        if any(k > len(notches) for k, notches in zip(self, lists, strict=True)):
            return None
        return tuple(notches[k - 1] if k else 0.0 for k, notches in zip(self, lists, strict=True))


def probe_again(
    probe: Probe,
    rejected: Rejected,
    source: ProblemSource,
    ask: Callable[[RepairProblem, tuple[float, ...]], Probe],
    budget: Budget,
) -> Probe:
    """Tighten side after side by what the checker missed, again and again, until one passes.

    Backends see boxes and single points of the curve, soft ones may exceed each of them a little; the checker
    sees the vehicle, at all times. What is missed is mostly little, and elsewhere the optimum has room. It
    has none where a curve comes too close and exceeds the limits: such a side is given up. The first side
    that passes is the answer, whatever ``search.sides`` says: costs of problems that were tightened
    differently say little about which is better.

    Parameters
    ----------
    probe : Probe
        Of the sides as they were; the answer where none of them can be had.
    rejected : sequence of (RepairProblem, Probe)
        The sides, and how each failed.
    source : ProblemSource
        Says by how much.
    ask : callable
        Solves and checks a problem that is tightened by so much.
    budget : Budget
    """
    tried = list(probe.tried)
    for problem, first in rejected:
        if first.blocked:  # whatever it is tightened by
            continue
        verdict, taken = first.verdict, Notches.of(first.tightened, source.notches)
        while not verdict.ok:
            further = taken.after(verdict)
            amounts = further.amounts(source.notches)
            if further == taken or amounts is None or further.torn(taken):
                break
            if budget.spent:
                budget.cut = True
                return replace(probe, tried=tuple(tried))
            again = ask(problem, amounts)
            tried.append(words(again, amounts))
            verdict, taken = again.verdict, further
            if again.feasible:
                return replace(again, tried=tuple(tried), tightened=amounts)
    return replace(probe, tried=tuple(tried))


def probe_begun(
    probe: Probe, rejected: Rejected, ask: Callable[[RepairProblem], Probe], budget: Budget
) -> Probe:
    """The sides that failed, begun with the acceleration that their guides begin with.

    A vehicle's brakes are there at once, as far as its model knows (the steering is not); the ramp of jerk
    from the reference's acceleration costs a metre and more of full braking. Asked are sides that miss so
    little, and of those past an obstacle the ones whose guide is open.

    Parameters
    ----------
    probe : Probe
        Of the sides as they were; the answer where none of them can be had.
    rejected : sequence of (RepairProblem, Probe)
        The sides, and how each failed.
    ask : callable
        Solves and checks a problem.
    budget : Budget
    """
    tried = list(probe.tried)
    for problem, first in rejected:
        begins = None if first.blocked else _begun(problem, first)
        if begins is None:
            continue
        if budget.spent:
            budget.cut = True
            break
        again = ask(begins)
        jump = _jump(begins, problem)
        tried.append(f"{words(again)} (its acceleration jumps by {jump:.1f} m/s² at t_rep)")
        if again.feasible:
            return replace(again, tried=tuple(tried), jump=jump)
    return replace(probe, tried=tuple(tried))


def _begun(problem: RepairProblem, failed: Probe) -> RepairProblem | None:
    """The problem with another acceleration at its start; None where that is of little use."""
    passing, closest = problem.passing, failed.solve.closest
    if passing is None:
        return None
    aside = passing.maneuver in (Maneuver.LEFT, Maneuver.RIGHT)
    if not passing.open if aside else closest is not None and closest.miss > _GAINED:
        return None
    wanted = np.array((passing.guide.acceleration[0, 0], problem.start[2, 1]))
    kappa = float(problem.curvature_at(problem.start[:1, 0])[0])
    start = begun(problem.start, wanted, kappa, problem.limits, problem.lateral)
    begins = replace(problem, start=start)
    return begins if _jump(begins, problem) > _LITTLE else None


def _jump(begins: RepairProblem, problem: RepairProblem) -> float:
    return float(np.abs(begins.start[2] - problem.start[2]).max())


def too_close(verdict: Verdict) -> bool:
    """Whether it came too close to an obstacle."""
    return Notches().after(verdict).room > 0


def other_ways(
    asked: Sequence[RepairProblem], wider: Iterable[Sequence[RepairProblem]]
) -> Iterator[Sequence[RepairProblem]]:
    """Of the problems with larger margins those whose manoeuvre has not been asked for."""
    known = {problem.passing and problem.passing.maneuver for problem in asked}
    for problems in wider:
        fresh = [p for p in problems if (p.passing and p.passing.maneuver) not in known]
        known |= {problem.passing and problem.passing.maneuver for problem in fresh}
        if fresh:
            yield fresh
