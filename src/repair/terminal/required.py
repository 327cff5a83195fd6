"""A repair that ends unsafely is none: the checker, and then the end."""

from __future__ import annotations

from repair.check.checker import Checker
from repair.check.verdict import Reason, Verdict, Violation
from repair.curves.base import Curve, SplicedCurve
from repair.problem.problem import RepairProblem
from repair.terminal.judge import EndJudge
from repair.terminal.verdict import Ending

__all__ = ["SafeEnds"]


class SafeEnds:
    """Judges a curve as the checker does, and how it ends (a :class:`repair.search.probe.TrajectoryChecker`).

    Parameters
    ----------
    checker : Checker
    ends : EndJudge
    """

    def __init__(self, checker: Checker, ends: EndJudge) -> None:
        self.checker, self.ends = checker, ends

    def refuses_traffic(self, problem: RepairProblem, curve: Curve) -> Violation | None:
        """As the checker's: of the repair itself."""
        return self.checker.refuses_traffic(problem, curve)

    def blocked(self, problem: RepairProblem) -> Violation | None:
        """As the checker's."""
        return self.checker.blocked(problem)

    def check(self, problem: RepairProblem, curve: Curve) -> Verdict:
        """Verdict on ``curve`` after the reference until ``problem.t_rep``, and on its end."""
        verdict = self.checker.check(problem, curve)
        if not verdict.ok:
            return verdict
        driven = SplicedCurve(problem.reference, curve, problem.t_rep)
        terminal = self.ends(driven, problem.t_end, thorough=False)
        if terminal.ending is not Ending.UNSAFE:
            return verdict
        first = min(terminal.violations, key=lambda violation: violation.time)
        words = f"of {terminal.tried} stops from the last state none passes; full braking fails by "
        words += f"{first.reason.value.replace('_', ' ')}" + (f": {first.detail}" if first.detail else "")
        return Verdict((Violation(Reason.UNSAFE_END, first.time, words, first.obstacle_id, first.place),))
