"""Algorithm 1: the Feasible Time-To-React by search over t_rep, for any backend.

The search runs on integer multiples of Delta T (1.6 - 1.2 > 0.4 in floating point) and the F-TTR is
the last *verified* t_rep. Algorithm 1 as printed returns a midpoint that was never tested and cannot
produce the iterates that the paper reports; rule ``as_printed`` visits what it would visit.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from repair.backend.base import RepairBackend
from repair.check.verdict import Conflict, Reason
from repair.curves.base import Curve
from repair.deadline import OutOfTime
from repair.problem.problem import RepairProblem
from repair.search.probe import (
    Budget,
    Hopeless,
    ProblemSource,
    TrajectoryChecker,
    better,
    probe_sides,
)
from repair.search.result import Like, Probe, SearchResult, SearchStatus
from repair.search.rules import CONTIGUOUS, IsOpen, Order, from_the_end, probe_order
from repair.search.settings import SearchConfig
from repair.search.visit import visit
from repair.timegrid import INSTANT, ROUNDING, on_grid

__all__ = ["iter_probes", "search_f_ttr"]


_LOG = logging.getLogger(__name__)


def iter_probes(
    source: ProblemSource,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    end: float,
    settings: SearchConfig,
    budget: Budget,
    visits: Sequence[float] | None = None,
    after: Probe | None = None,
) -> Iterator[Probe]:
    """Visit t_rep after t_rep as the rule says, until it ends or the time limit is reached.

    Which repair of a t_rep is the best matters at the last one alone. While a rule looks for that, no side is
    asked after one that passes; ``budget.unasked`` keeps them.

    Parameters
    ----------
    end : float
        Upper end of the search [s], excluded: the reference is in conflict there.
    budget : Budget
    visits : sequence of float, optional
        The t_rep to visit [s] instead, whatever comes out.
    after : Probe, optional
        A feasible one: later t_rep are visited only, and its curve is where to start from.
    """
    made: dict[float, Sequence[RepairProblem]] = {}  # for the rule's questions; a probe takes them over

    def is_open(t_rep: float) -> bool:
        if budget.spent:
            return False
        try:
            with budget.watched():
                made[t_rep] = source.at(t_rep)
        except OutOfTime:
            return False
        return any(problem.passing is None or problem.passing.open for problem in made[t_rep])

    given = None if visits is None else _given(visits)
    order = given or _order(settings, end, is_open, after, latest_first=backend.capabilities.own_way)
    warm_start: Curve | None = None
    if after is not None and backend.capabilities.uses_warm_start:
        warm_start = after.solve.curve
    sides = "first" if given is None else settings.sides
    answer: bool | None = None
    while True:
        try:
            t_rep = next(order) if answer is None else order.send(answer)
        except StopIteration:
            return
        if budget.spent:
            raise OutOfTime
        with budget.watched():
            first = made.pop(t_rep) if t_rep in made else source.at(t_rep)
            probe = visit(
                t_rep, first, source, backend, checker, settings.sides, warm_start, budget, at_first=sides,
                like=budget.like,
            )  # fmt: skip
        if probe.feasible and sides != settings.sides:
            budget.unasked[t_rep] = first[len(probe.tried) :]
        if probe.feasible and backend.capabilities.uses_warm_start:
            warm_start = probe.solve.curve
        answer = probe.feasible or _says_nothing_of_later_ones(probe)
        yield probe
        if budget.cut and not probe.feasible:
            raise OutOfTime  # nobody knows whether it would have been feasible


def _says_nothing_of_later_ones(probe: Probe) -> bool:
    """Whether the first time-to-repair fails by its end alone (``checker.terminal: require``).

    Who begins at once ends sooner, elsewhere and faster or slower than who begins later: a rule that takes
    feasibility to be contiguous would end here, or turn around.
    """
    return probe.t_rep < INSTANT and {v.reason for v in probe.verdict.violations} == {Reason.UNSAFE_END}


def _order(
    settings: SearchConfig, end: float, is_open: IsOpen, after: Probe | None, *, latest_first: bool
) -> Order:
    """The visits of the rule below ``end`` [s]; those after a probe as if the grid began one step later.

    Who finds its own way mostly finds one almost until it is proven too late. Where the rule takes
    feasibility to be contiguous, it then begins at the end.
    """
    rule, step = settings.rule, settings.delta_t
    if after is None:
        return probe_order(rule, end, step, is_open)
    begin = after.t_rep + step

    def at(since: float) -> float:
        near = on_grid(begin + since, step)
        return near if abs(near - begin - since) <= ROUNDING else begin + since

    if latest_first and rule in CONTIGUOUS:
        return _later(from_the_end(end - begin, step), at)
    return _later(probe_order(rule, end - begin, step, lambda since: is_open(at(since))), at)


def _later(order: Order, at: Callable[[float], float]) -> Order:
    """An order with its times moved."""
    answer: bool | None = None
    while True:
        try:
            since = next(order) if answer is None else order.send(answer)
        except StopIteration:
            return
        answer = yield at(since)


def _given(visits: Sequence[float]) -> Order:
    for t_rep in visits:
        _ = yield t_rep  # an answer is sent, and not asked for; ``yield from`` would take none


def search_f_ttr(
    source: ProblemSource,
    conflict: Conflict,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    settings: SearchConfig,
    *,
    visits: Sequence[float] | None = None,
    on_probe: Callable[[Probe], None] | None = None,
    after: Probe | None = None,
    hopeless: Hopeless | None = None,
    like: Like | None = None,
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
    visits : sequence of float, optional
        The times-to-repair to try [s], instead of those of ``settings.rule``: the paper's baseline tries
        one, the TTR.
    on_probe : callable, optional
        Called after every probe; an interrupt in between loses nothing that was found. Sides that the last
        feasible one is compared with at the end are asked after that.
    after : Probe, optional
        A feasible one: only later t_rep are visited, and its curve is where to start from.
    hopeless : Hopeless, optional
        Says of a t_rep whether it is proven that nothing is feasible there (``search.proofs``).
    like : Like, optional
        What passed in a search that is much like this one: where it had to be tightened, its side is asked
        first, as tight.
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
    budget = Budget(
        settings.time_limit, begin, clock, hopeless if settings.proofs else None,
        collides=conflict.contact_time < float("inf"), like=like,
    )  # fmt: skip
    try:
        for probe in iter_probes(source, backend, checker, end, settings, budget, visits, after):
            probes.append(probe)
            _LOG.debug(
                "t_rep %g s: %s (%s)", probe.t_rep,
                "feasible" if probe.feasible else "rejected, " + ", ".join(probe.verdict.reasons),
                probe.solve.status.sentence,
            )  # fmt: skip
            if on_probe is not None:
                on_probe(probe)
        if budget.unasked:
            _compare(probes, backend, checker, budget)
    except (OutOfTime, KeyboardInterrupt):
        complete = False
    feasible = [p for p in probes if p.feasible]
    wall = clock() - begin
    _LOG.info("%d times-to-repair tried in %.3f s, %d feasible", len(probes), wall, len(feasible))
    if feasible:
        best = max(feasible, key=lambda p: p.t_rep)
        return SearchResult(
            SearchStatus.FOUND, conflict, best.t_rep, best.solve.curve, tuple(probes), complete, wall
        )
    status = SearchStatus.NONE_FEASIBLE if complete else SearchStatus.BUDGET_EXHAUSTED
    return SearchResult(status, conflict, None, None, tuple(probes), complete, wall)


def _compare(probes: list[Probe], backend: RepairBackend, checker: TrajectoryChecker, budget: Budget) -> None:
    """Ask the last feasible t_rep for the sides that are left, and keep the best of them all.

    They begin without its curve: from a verified one of this very t_rep a hard backend makes one on the same
    side (:func:`repair.search.visit._helped_by`).
    """
    k, last = max(((k, p) for k, p in enumerate(probes) if p.feasible), key=lambda one: one[1].t_rep)
    left = budget.unasked[last.t_rep]
    if not left or budget.spent:
        return
    with budget.watched():
        others, _ = probe_sides(last.t_rep, left, backend, checker, "best", None, budget)
    best = others if better(others, last) else last
    probes[k] = replace(best, tried=(*last.tried, *others.tried))
