"""A way past the obstacles that the checker rejected, asked for again with more to spare where it failed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from repair.check.verdict import Reason, Verdict
from repair.problem.problem import RepairProblem
from repair.search.probe import Budget, ProblemSource, Rejected, words
from repair.search.result import Probe

__all__ = ["Notches", "other_ways", "probe_again", "too_close"]

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
