"""Algorithm 1: the Feasible Time-To-React by search over t_rep, for any backend.

The search runs on integer multiples of Delta T (1.6 - 1.2 > 0.4 in floating point) and the F-TTR is
the last *verified* t_rep. Algorithm 1 as printed returns a midpoint that was never tested and cannot
produce the iterates that the paper reports; rule ``as_printed`` visits what it would visit.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from repair.config import SearchConfig
from repair.types import (
    Conflict,
    Curve,
    Probe,
    Reason,
    RepairBackend,
    RepairProblem,
    SearchResult,
    SearchStatus,
    SolveResult,
    SolveStatus,
    Verdict,
    Violation,
)

__all__ = ["Order", "ProblemSource", "TrajectoryChecker", "probe_order", "search_f_ttr"]

#: Yields the next t_rep [s], is sent whether it was feasible.
Order = Generator[float, bool, None]
#: Whether a way past the obstacles seems to be open at a t_rep [s].
IsOpen = Callable[[float], bool]


class ProblemSource(Protocol):
    """Makes the repair problems of a t_rep, one for each open side of passing."""

    def at(self, t_rep: float) -> Sequence[RepairProblem]:
        """Problems in the order in which they should be tried; empty where no way is open."""
        ...


class TrajectoryChecker(Protocol):
    """Judges a repaired curve; the same for every backend."""

    def check(self, problem: RepairProblem, curve: Curve) -> Verdict:
        """Verdict on the reference until t_rep followed by ``curve``."""
        ...


def _grid_size(end: float, delta_t: float) -> int:
    """Number of grid points k * delta_t in [0, end)."""
    return max(0, math.ceil(end / delta_t - 1e-9))


def _bisect(end: float, delta_t: float, is_open: IsOpen) -> Order:
    feasible, infeasible = -1, _grid_size(end, delta_t)
    if infeasible == 0:
        return
    if (yield 0.0):
        feasible = 0
    else:
        return
    while infeasible - feasible > 1:
        middle = (feasible + infeasible) // 2
        if (yield middle * delta_t):
            feasible = middle
        else:
            infeasible = middle


def _guided(end: float, delta_t: float, is_open: IsOpen) -> Order:
    size = _grid_size(end, delta_t)
    feasible, infeasible = -1, size
    k, stride = _last_open(size, delta_t, is_open), 1
    while infeasible - feasible > 1:
        k = min(max(k, feasible + 1), infeasible - 1)
        if (yield k * delta_t):
            feasible = k
        else:
            infeasible = k
        if feasible >= 0 and infeasible < size:
            k = (feasible + infeasible) // 2
        else:  # on in the same direction, twice as far each time, until there is an answer of each kind
            k += stride if feasible == k else -stride
            stride *= 2


def _last_open(size: int, delta_t: float, is_open: IsOpen) -> int:
    """Where on the grid the ways past the obstacles seem to shut, by bisection: the last open point, or 0."""
    found, shut = 0, size
    while shut - found > 1:
        middle = (found + shut) // 2
        if is_open(middle * delta_t):
            found = middle
        else:
            shut = middle
    return found


def _scan(end: float, delta_t: float, is_open: IsOpen) -> Order:
    for k in range(_grid_size(end, delta_t)):
        yield k * delta_t


def _as_printed(end: float, delta_t: float, is_open: IsOpen) -> Order:
    start, t_rep = 0.0, 0.0
    while abs(end - start) > delta_t + 1e-12:
        if (yield t_rep):
            start = t_rep
        else:
            end = t_rep
        t_rep = 0.5 * (start + end)


_RULES: dict[str, Callable[[float, float, IsOpen], Order]] = {
    "guided": _guided,
    "bisect": _bisect,
    "scan": _scan,
    "as_printed": _as_printed,
}


def probe_order(rule: str, end: float, delta_t: float, is_open: IsOpen = lambda t_rep: True) -> Order:
    """The times-to-repair that a rule visits below ``end`` [s].

    Parameters
    ----------
    rule : str
        ``guided``: from the last grid point at which a way past the obstacles is open on, to where
        feasible and infeasible meet; ``bisect``: t_rep = 0, then bisection on the grid; both assume
        that feasibility is contiguous. ``scan``: every grid point, which assumes nothing;
        ``as_printed``: Algorithm 1 to the letter.
    is_open : callable
        Whether a way past the obstacles is open at a t_rep [s]: a guess at feasibility that costs
        little. Only ``guided`` asks, and a wrong answer costs it probes, nothing else.
    """
    return _RULES[rule](end, delta_t, is_open)


class _OutOfTime(Exception):
    """Ours alone: a TimeoutError may come out of a backend, and would be its bug."""


@dataclass
class _Budget:
    limit: float | None
    begin: float
    clock: Callable[[], float]
    cut: bool = False  # the last probe would have gone on, had there been time

    @property
    def left(self) -> float | None:
        return None if self.limit is None else max(self.limit - (self.clock() - self.begin), 0.0)

    @property
    def spent(self) -> bool:
        return self.left == 0.0


def _probe(
    t_rep: float,
    problems: Sequence[RepairProblem],
    backend: RepairBackend,
    checker: TrajectoryChecker,
    sides: str,
    warm_start: Curve | None,
    budget: _Budget,
) -> Probe:
    """Solve and check every open side; keep the feasible one of least cost, else the first failure."""
    best: Probe | None = None
    tried: list[str] = []
    for problem in problems:
        if tried and budget.spent:
            budget.cut = True
            break
        solve = backend.solve(problem, warm_start=warm_start, time_limit=budget.left)
        budget.cut |= budget.limit is not None and solve.status is SolveStatus.TIME_LIMIT
        begin = budget.clock()
        verdict = checker.check(problem, solve.curve) if solve.curve is not None else _unsolved(solve, t_rep)
        margin = problem.margin
        closest = solve.stages.get("closest") if getattr(backend, "relaxes", False) else None
        if solve.curve is None and closest is not None and not problem.strict:
            # The backend calls this infeasible, and so it stays; but boxes are wider than vehicles, and
            # the checker may accept the curve that comes closest.
            again = checker.check(problem, closest)
            if again.ok:
                margin -= solve.residuals["obstacles"]
                detail = f"{solve.detail}; that curve passes every check, with a margin of {margin:.2f} m"
                solve, verdict = replace(solve, curve=closest, detail=detail), again
        maneuver = problem.passing.maneuver if problem.passing is not None else None
        name = maneuver.value if maneuver is not None else "follow"
        tried.append(f"{name}: {'feasible' if verdict.ok else ', '.join(verdict.reasons)}")
        probe = Probe(t_rep, solve, verdict, maneuver, budget.clock() - begin, margin=margin)
        if best is None or _better(probe, best):
            best = probe
        if sides == "first" and probe.feasible:
            break
    if best is None:
        nothing = SolveResult(SolveStatus.INFEASIBLE, detail="no manoeuvre past the obstacles is open")
        why = Violation(Reason.NO_PASSAGE, t_rep, "every manoeuvre that was tried collides within the limits")
        return Probe(t_rep, nothing, Verdict((why,)))
    return Probe(t_rep, best.solve, best.verdict, best.maneuver, best.check_time, tuple(tried), best.margin)


def _better(new: Probe, old: Probe) -> bool:
    if new.feasible != old.feasible:
        return new.feasible
    return new.feasible and new.solve.objective < old.solve.objective


def _unsolved(solve: SolveResult, t_rep: float) -> Verdict:
    reason = Reason.NO_CORRIDOR if solve.status is SolveStatus.NO_CORRIDOR else Reason.NOT_SOLVED
    return Verdict((Violation(reason, t_rep, solve.detail or solve.status.sentence),))


def _relaxed(
    source: ProblemSource, backend: RepairBackend, t_rep: float
) -> Iterator[Sequence[RepairProblem]]:
    """Problems with smaller margins, for a backend that keeps its margin whatever it costs.

    Boxes in (s, l) are wider than the vehicles in them; a hard backend would call a repair infeasible
    that the checker, which looks at the true rectangles, accepts.
    """
    relaxed = getattr(source, "relaxed", None)
    if relaxed is not None and getattr(backend, "relaxes", False):
        yield from relaxed(t_rep)


def iter_probes(
    source: ProblemSource,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    end: float,
    settings: SearchConfig,
    clock: Callable[[], float] = time.perf_counter,
) -> Iterator[Probe]:
    """Visit t_rep after t_rep as the rule says, until it ends or the time limit is reached.

    Parameters
    ----------
    end : float
        Upper end of the search [s], excluded: the reference is in conflict there.
    """
    budget = _Budget(settings.time_limit, clock(), clock)
    made: dict[float, Sequence[RepairProblem]] = {}  # for the rule's questions; a probe takes them over

    def is_open(t_rep: float) -> bool:
        if budget.spent:
            return False
        made[t_rep] = source.at(t_rep)
        return any(problem.passing is None or problem.passing.open for problem in made[t_rep])

    order = probe_order(settings.rule, end, settings.delta_t, is_open)
    warm_start: Curve | None = None
    answer: bool | None = None
    while True:
        try:
            t_rep = next(order) if answer is None else order.send(answer)
        except StopIteration:
            return
        if budget.spent:
            raise _OutOfTime
        budget.cut = False
        first = made.pop(t_rep) if t_rep in made else source.at(t_rep)
        probe = _probe(t_rep, first, backend, checker, settings.sides, warm_start, budget)
        for problems in _relaxed(source, backend, t_rep):
            if probe.feasible:
                break
            if budget.spent:
                budget.cut = True
                break
            again = _probe(t_rep, problems, backend, checker, settings.sides, warm_start, budget)
            tried = (*probe.tried, *(f"{text} (margin {problems[0].margin:g} m)" for text in again.tried))
            probe = replace(again if again.feasible else probe, tried=tried)
        if probe.feasible:
            warm_start = probe.solve.curve
        answer = probe.feasible
        yield probe
        if budget.cut and not answer:
            raise _OutOfTime  # nobody knows whether it would have been feasible


def search_f_ttr(
    source: ProblemSource,
    conflict: Conflict,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    settings: SearchConfig,
    *,
    on_probe: Callable[[Probe], None] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> SearchResult:
    """Algorithm 1 of the paper.

    Parameters
    ----------
    source : ProblemSource
    conflict : Conflict
        Where the reference fails; its time is the TTC.
    backend : RepairBackend
    checker : TrajectoryChecker
    settings : SearchConfig
    on_probe : callable, optional
        Called after every probe; an interrupt in between loses nothing that was found.
    clock : callable
        Monotonic time [s]; a parameter so that tests can bend it.

    Returns
    -------
    SearchResult
        ``f_ttr`` is the largest t_rep whose repair was verified.
    """
    begin = clock()
    if conflict.time == float("inf"):
        return SearchResult(SearchStatus.NO_CONFLICT, conflict, float("inf"), None)
    if conflict.contact_time <= 0.0:
        return SearchResult(SearchStatus.ALREADY_COLLIDING, conflict, None, None)
    # A conflict at t = 0 without contact leaves t_rep = 0 as the only candidate.
    end = max(conflict.time, settings.delta_t * 1e-3)
    if settings.upper is not None:
        end = min(end, max(settings.upper, settings.delta_t * 1e-3))
    probes: list[Probe] = []
    complete = True
    try:
        for probe in iter_probes(source, backend, checker, end, settings, clock):
            probes.append(probe)
            if on_probe is not None:
                on_probe(probe)
    except (_OutOfTime, KeyboardInterrupt):
        complete = False
    feasible = [p for p in probes if p.feasible]
    wall = clock() - begin
    if feasible:
        best = max(feasible, key=lambda p: p.t_rep)
        return SearchResult(
            SearchStatus.FOUND, conflict, best.t_rep, best.solve.curve, tuple(probes), complete, wall
        )
    status = SearchStatus.NONE_FEASIBLE if complete else SearchStatus.BUDGET_EXHAUSTED
    return SearchResult(status, conflict, None, None, tuple(probes), complete, wall)
