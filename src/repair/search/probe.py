"""One time-to-repair: every open side solved and checked."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import Protocol

from repair.backend.base import RepairBackend, SolveResult, SolveStatus
from repair.check.verdict import Reason, Verdict, Violation
from repair.curves.base import Curve
from repair.deadline import OutOfTime, until
from repair.problem.problem import Maneuver, RepairProblem
from repair.problem.taken import taken
from repair.search.result import Like, Probe

__all__ = [
    "Budget",
    "Hopeless",
    "ProblemSource",
    "Rejected",
    "TrajectoryChecker",
    "better",
    "probe_one",
    "probe_sides",
    "words",
]

_NEAR = 3.0  # whose guide misses an open way by less (``Passing.misses``) is hardly ever blocked

#: The sides that failed, and how.
Rejected = list[tuple[RepairProblem, Probe]]


class ProblemSource(Protocol):
    """Makes the repair problems of a t_rep, one for each open side of passing."""

    def at(self, t_rep: float) -> Sequence[RepairProblem]:
        """Problems in the order in which they should be tried; empty where no way is open."""
        ...

    def relaxed(self, t_rep: float) -> Iterable[Sequence[RepairProblem]]:
        """The problems again with smaller and smaller margins, for backends that keep theirs."""
        ...

    def widened(self, t_rep: float) -> Iterable[Sequence[RepairProblem]]:
        """The problems again with larger and larger margins, for curves that came too close."""
        ...

    @property
    def notches(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """By what a rejected problem is tightened, step by step: room [m], road [m], limits (shares)."""
        ...

    def along(self, manoeuvre: Curve, kind: Maneuver, *, jumps: bool = False) -> RepairProblem:
        """The problem at the start of a curve, with that curve as the guide; asked for with a helper only.

        With ``jumps`` it begins with the acceleration of that curve.
        """
        ...

    def without_guide(self, t_rep: float) -> Sequence[RepairProblem]:
        """The problem for a helper that finds its own way."""
        ...


class TrajectoryChecker(Protocol):
    """Judges a repaired curve; the same for every backend."""

    def check(self, problem: RepairProblem, curve: Curve) -> Verdict:
        """Verdict on the reference until t_rep followed by ``curve``."""
        ...

    def refuses_traffic(self, problem: RepairProblem, curve: Curve) -> Violation | None:
        """What :meth:`check` says of the traffic, if anything."""
        ...

    def blocked(self, problem: RepairProblem) -> Violation | None:
        """What :meth:`check` says of each curve that keeps to the path of the reference, if that is known."""
        ...


class Hopeless(Protocol):
    """Says where it is proven that nothing is feasible; an answer of no says nothing."""

    def __call__(self, t_rep: float) -> bool:
        """Whether it is proven for a t_rep [s], and then for all later ones."""
        ...

    def since(self, times: Sequence[float]) -> float:
        """From which of some ascending times [s] on it is proven; infinite where it is for none."""
        ...


@dataclass
class Budget:
    """What is left of a time limit, and what is not worth spending it on."""

    limit: float | None
    begin: float
    clock: Callable[[], float]
    # whether it is proven that nothing is feasible at a t_rep
    hopeless: Hopeless | None = None
    cut: bool = False  # the last probe would have gone on, had there been time
    # the sides of feasible t_rep that nobody was asked for yet, as another one had passed
    unasked: dict[float, Sequence[RepairProblem]] = field(default_factory=dict)
    # whether the reference meets an obstacle
    collides: bool = False
    # what passed in an earlier search that is much like this one: its side is asked first, as tight
    like: Like | None = None
    # of the last t_rep that was asked about: what each curve that keeps to the path is refused for
    blocked: tuple[float, Violation | None] | None = None

    @property
    def left(self) -> float | None:
        """Time left [s]; None without a limit."""
        return None if self.limit is None else max(self.limit - (self.clock() - self.begin), 0.0)

    @property
    def spent(self) -> bool:
        """Nothing is left."""
        return self.left == 0.0

    def watched(self) -> AbstractContextManager[None]:
        """The deadline of whatever is done inside of a ``with`` block."""
        left = self.left
        return until(None if left is None else time.perf_counter() + left)


def probe_sides(
    t_rep: float,
    problems: Sequence[RepairProblem],
    backend: RepairBackend,
    checker: TrajectoryChecker,
    sides: str,
    warm_start: Curve | None,
    budget: Budget,
    failed: tuple[RepairProblem, Probe] | None = None,
) -> tuple[Probe, Rejected]:
    """Solve and check every open side; keep the feasible one of least cost, else the first failure.

    A side that is known to have ``failed`` is not asked.

    Returns
    -------
    probe : Probe
    rejected : list of (RepairProblem, Probe)
        The sides that failed.
    """
    best: Probe | None = None
    tried: list[str] = []
    rejected: Rejected = []
    for problem in problems:
        if tried and budget.spent:
            budget.cut = True
            break
        if failed is not None and problem is failed[0]:
            probe = failed[1]
        else:
            probe = probe_one(t_rep, problem, backend, checker, warm_start, budget)
        tried.append(words(probe, probe.tightened))
        if not probe.feasible:
            rejected.append((problem, probe))
        if best is None or better(probe, best):
            best = probe
        if sides == "first" and probe.feasible:
            break
    if best is None:
        nothing = SolveResult(SolveStatus.INFEASIBLE, detail="no manoeuvre past the obstacles is open")
        why = Violation(Reason.NO_PASSAGE, t_rep, "every manoeuvre that was tried collides within the limits")
        return Probe(t_rep, nothing, Verdict((why,))), rejected
    whole = Probe(t_rep, best.solve, best.verdict, best.maneuver, best.check_time, tuple(tried), best.margin)
    return whole, rejected


def probe_one(
    t_rep: float,
    problem: RepairProblem,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    warm_start: Curve | None,
    budget: Budget,
) -> Probe:
    """Solve one side and check it, unless it is known to be blocked whatever comes of it."""
    maneuver = problem.passing.maneuver if problem.passing is not None else None
    if (why := _blocked(problem, backend, checker, budget)) is not None:
        nobody, no = SolveResult(SolveStatus.INFEASIBLE, detail=f"not asked: {why.detail}"), Verdict((why,))
        return Probe(t_rep, nobody, no, maneuver, margin=problem.margin, refused=no, blocked=True)
    try:
        solve = backend.solve(problem, warm_start=warm_start, time_limit=budget.left)
    except OutOfTime as late:  # of something in it that looks at the deadline
        solve = SolveResult(SolveStatus.TIME_LIMIT, detail=str(late))
    budget.cut |= budget.limit is not None and solve.status is SolveStatus.TIME_LIMIT
    begin = budget.clock()
    try:
        solve, verdict, margin, refused = _judged(problem, solve, checker, t_rep)
    except OutOfTime:  # a curve that nobody has judged is none
        budget.cut, margin, refused = True, problem.margin, None
        detail = "a curve was found, and no time was left to judge it"
        solve = replace(solve, status=SolveStatus.TIME_LIMIT, curve=None, closest=None, detail=detail)
        verdict = _unsolved(solve, t_rep)
    if maneuver is None and backend.capabilities.own_way and solve.curve is not None:
        maneuver = taken(problem, solve.curve)
    return Probe(t_rep, solve, verdict, maneuver, budget.clock() - begin, margin=margin, refused=refused)


def _blocked(
    problem: RepairProblem, backend: RepairBackend, checker: TrajectoryChecker, budget: Budget
) -> Violation | None:
    """What the checker says of every curve on a path that is kept; asked where no guide is open.

    Where that is so once at a t_rep, it is for all margins. Strict problems are asked as the paper asks them,
    and soft backends in a search of its own, whose curves show what comes of it.
    """
    passing, can = problem.passing, backend.capabilities
    if passing is None or problem.lateral or problem.strict or not can.keeps_path:
        return None
    if not can.relaxes and budget.like is None:
        return None
    known = budget.blocked
    if known is None or known[0] != problem.t_rep:
        if passing.open or passing.misses < _NEAR:
            return None
        known = budget.blocked = problem.t_rep, checker.blocked(problem)
    return known[1]


def words(probe: Probe, tightened: Sequence[float] = ()) -> str:
    """The side that was tried, by what it was tightened (room, road, limits), and what came of it."""
    name = probe.maneuver.value if probe.maneuver is not None else "follow"
    said = f"{name}: {'feasible' if probe.verdict.ok else ', '.join(probe.verdict.reasons)}"
    return f"{said} ({_amounts(*tightened)})" if any(tightened) else said


def _amounts(room: float, edge: float, unused: float) -> str:
    parts = (
        f"margin +{room:g} m" if room else "",
        f"road {edge:g} m narrower" if edge else "",
        f"{100.0 * unused:g} % of the limits unused" if unused else "",
    )
    return ", ".join(part for part in parts if part)


def _judged(
    problem: RepairProblem, solve: SolveResult, checker: TrajectoryChecker, t_rep: float
) -> tuple[SolveResult, Verdict, float, Verdict | None]:
    """What a backend found, what the checker says of it, the margin it keeps [m], and what it refuses.

    The last is its verdict on the curve that comes closest, where that was looked at.
    """
    verdict = checker.check(problem, solve.curve) if solve.curve is not None else _unsolved(solve, t_rep)
    margin, refused = problem.margin, None
    closest = None if verdict.ok else solve.closest
    while closest is not None:
        # What the backend says of the problem stays; but boxes are wider than vehicles, and the checker
        # may accept the curve that comes closest.
        if closest.miss <= 0.0 or not problem.strict:
            again = _verdict_on_closest(problem, closest.curve, checker)
            if again.ok:
                margin -= closest.miss
                detail = f"{solve.detail}; {closest.what} passes every check, with a margin of {margin:.2f} m"
                residuals = closest.residuals or solve.residuals
                solve = replace(solve, curve=closest.curve, detail=detail, residuals=residuals)
                return solve, again, margin, None
            refused = refused or again
        closest = closest.instead
    return solve, verdict, margin, refused


def _verdict_on_closest(problem: RepairProblem, curve: Curve, checker: TrajectoryChecker) -> Verdict:
    """Of who yields or goes ahead the traffic is asked first: it is mostly what refuses them."""
    along = problem.passing is not None and problem.passing.maneuver in (Maneuver.YIELD, Maneuver.GO_AHEAD)
    why = checker.refuses_traffic(problem, curve) if along else None
    return checker.check(problem, curve) if why is None else Verdict((why,))


def better(new: Probe, old: Probe) -> bool:
    """Feasible where the old one is not, or both, and of less cost."""
    if new.feasible != old.feasible:
        return new.feasible
    return new.feasible and new.solve.objective < old.solve.objective


def _unsolved(solve: SolveResult, t_rep: float) -> Verdict:
    reason = Reason.NO_CORRIDOR if solve.status is SolveStatus.NO_CORRIDOR else Reason.NOT_SOLVED
    return Verdict((Violation(reason, t_rep, solve.detail or solve.status.sentence),))
