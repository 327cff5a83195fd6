"""One time-to-repair from every side: first problems, tightened ones, a helper's curve, other margins."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from repair.backend.base import RepairBackend
from repair.curves.base import Curve
from repair.deadline import OutOfTime
from repair.problem.problem import Maneuver, RepairProblem
from repair.search.again import other_ways, probe_again, probe_begun, too_close
from repair.search.margins import probe_smaller, with_margin
from repair.search.probe import (
    Budget,
    ProblemSource,
    Rejected,
    TrajectoryChecker,
    probe_one,
    probe_sides,
    words,
)
from repair.search.result import Like, Probe
from repair.timegrid import INSTANT

__all__ = ["visit"]

_HELP = 0.05  # [s] below which a helper is not asked: laying out its task alone may take as long


def visit(
    t_rep: float,
    first: Sequence[RepairProblem],
    source: ProblemSource,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    sides: str,
    warm_start: Curve | None,
    budget: Budget,
    at_first: str = "",
    like: Like | None = None,
) -> Probe:
    """One t_rep, with its first problems and then with other margins.

    ``at_first`` is what counts instead of ``sides`` for the first problems. Where ``like`` had to be
    tightened to pass, its side is asked before them, as tight; and not with less room where it is unlikely
    to pass and that came too close.
    """
    budget.cut = False

    def one(problem: RepairProblem, amounts: tuple[float, ...]) -> Probe:
        return probe_one(t_rep, problem.tightened(*amounts), backend, checker, warm_start, budget)

    side = None if like is None else _side_of(like.probe, first)
    tight = () if like is None or side is None else like.probe.tightened
    known = replace(one(side, tight), tightened=tight) if side is not None else None
    if known is not None and known.feasible:
        return replace(known, tried=(words(known, tight),))
    failed = None
    if like and side and known and t_rep > like.until - INSTANT and too_close(known.verdict):
        failed = (side, known)
    probe, rejected = probe_sides(
        t_rep, first, backend, checker, at_first or sides, warm_start, budget, failed
    )  # fmt: skip
    if probe.feasible:
        return probe
    strict, hard = any(problem.strict for problem in first), backend.capabilities.relaxes
    tightens = any(source.notches)
    if tightens:
        probe = probe_again(
            probe, rejected, source,
            lambda problem, by: known if known and problem is side and by == tight else one(problem, by),
            budget,
        )  # fmt: skip

    if not probe.feasible and hard and not strict:
        probe = probe_begun(
            probe, rejected, lambda begins: probe_one(t_rep, begins, backend, checker, None, budget), budget
        )
    helpers = {} if strict or probe.feasible else backend.capabilities.helpers
    if helpers and _hopeless(t_rep, budget):
        return replace(probe, tried=(*probe.tried, "no further: it is proven to be too late"))

    def ask(problems: Sequence[RepairProblem]) -> tuple[Probe, Rejected]:
        return probe_sides(t_rep, problems, backend, checker, sides, warm_start, budget)

    nobody = False
    try:
        if not probe.feasible and not budget.spent:  # cheaper than all margins, and mostly it is what helps
            probe, nobody = _helped(helpers, probe, first, source, backend, checker, sides, budget)
    except OutOfTime:
        budget.cut = True
    # Boxes in (s, l) are not the vehicles in them. In a bend they are too narrow, and past larger ones
    # another way may be the one to take. Beside a vehicle that turns they are too wide: a hard backend calls
    # a repair infeasible that the checker accepts.
    try:
        # Who keeps a margin may be asked for less of it, not for more.
        near = any(too_close(failed.verdict) and not (hard and failed.blocked) for _, failed in rejected)
        if not probe.feasible and tightens and near and _any_shut(first):
            for problems in other_ways(first, source.widened(t_rep)):
                if budget.spent:
                    budget.cut = True
                    break
                again, _ = ask(problems)
                probe = with_margin(probe, again, problems[0].margin)
                if probe.feasible:
                    break
        if not probe.feasible and hard and not nobody:
            probe = probe_smaller(probe, rejected, source.relaxed(t_rep), ask, budget)
    except OutOfTime:  # while the next problems were made
        budget.cut = True
    return probe


def _side_of(like: Probe, first: Sequence[RepairProblem]) -> RepairProblem | None:
    """The side that passed before as tightened; None where none did, or as it was."""
    if not any(like.tightened):
        return None
    return next((p for p in first if p.passing is None or p.passing.maneuver is like.maneuver), None)


def _any_shut(first: Sequence[RepairProblem]) -> bool:
    """Whether a way was asked for that is not open; larger boxes open none, but may bring another closer."""
    return any(problem.passing is not None and not problem.passing.open for problem in first)


def _hopeless(t_rep: float, budget: Budget) -> bool:
    """Whether it is proven that nothing is feasible at a t_rep; asked for backends that take their time."""
    left = budget.left
    if budget.hopeless is None or (left is not None and left < _HELP):
        return False
    try:
        return budget.hopeless(t_rep)
    except OutOfTime:  # whoever goes on sees it
        return False


def _helped(
    helpers: Mapping[str, Callable[[], RepairBackend]],
    probe: Probe,
    first: Sequence[RepairProblem],
    source: ProblemSource,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    sides: str,
    budget: Budget,
) -> tuple[Probe, bool]:
    """The backend asked once more, from a curve of a helper that the checker accepts; one after the other.

    A hard backend gives up where its guides or its boxes leave it nothing; what has been verified proves that
    there is a way. The helper's curve itself is no answer: it may keep less than this backend claims.

    Returns
    -------
    probe : Probe
    nobody : bool
        A helper that needs no way to be shown has looked among the true shapes, and found nothing, not even
        something that the checker refuses.
    """
    nobody = False
    for make in helpers.values():
        if probe.feasible or budget.spent:
            break
        if (left := budget.left) is not None and left < _HELP:
            budget.cut = True
            break
        try:
            helper = make()
        except OutOfTime as late:  # the search goes on without
            probe = replace(probe, tried=(*probe.tried, f"no other backend asked: {late}"))
        else:
            probe, found = _helped_by(helper, probe, first, source, backend, checker, sides, budget)
            nobody |= helper.capabilities.own_way and not found and not budget.cut
    return probe, nobody


def _helped_by(
    helper: RepairBackend,
    probe: Probe,
    first: Sequence[RepairProblem],
    source: ProblemSource,
    backend: RepairBackend,
    checker: TrajectoryChecker,
    sides: str,
    budget: Budget,
) -> tuple[Probe, bool]:
    """As :func:`_helped`, of one helper; and whether that has found anything, accepted or not."""
    t_rep, can = probe.t_rep, helper.capabilities
    problems = source.without_guide(t_rep) if can.own_way else first
    found = visit(t_rep, problems, source, helper, checker, sides, None, budget)
    if not found.feasible or found.solve.curve is None:
        return probe, found.solve.curve is not None
    along = source.along(found.solve.curve, found.maneuver or Maneuver.YIELD, jumps=can.jumps)
    curve = found.solve.curve
    budget.blocked = t_rep, None  # it may be aside of the path, whatever it is called
    again = probe_one(t_rep, along, backend, checker, curve, budget)
    if not again.feasible and any(source.notches):
        again = probe_again(
            again, [(along, again)], source,
            lambda problem, amounts: probe_one(
                t_rep, problem.tightened(*amounts), backend, checker, curve, budget
            ), budget,
        )  # fmt: skip
    said = f"from a curve of {helper.name} that passes every check"
    tried = (*probe.tried, f"{words(again)} ({said})")
    if again.feasible:
        usual = along.reference.sample([t_rep]).acceleration[0]
        return replace(again, tried=tried, jump=max(abs(along.start[2] - usual).tolist())), True
    why = again.solve.detail if again.solve.curve is None else words(again)
    told = replace(probe.solve, detail=f"{probe.solve.detail}; {said}: {why}")
    return replace(probe, tried=tried, solve=told), True
