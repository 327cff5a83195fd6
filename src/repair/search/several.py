"""The search by one backend, or by several: each is asked only for what those before it have left open.

Where a search ends without a repair, its fallbacks are asked.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

from repair.backend.base import Capabilities, RepairBackend, SolveResult, SolveStatus
from repair.backend.guard import Guarded
from repair.curves.base import Curve
from repair.deadline import OutOfTime, until
from repair.problem.problem import RepairProblem
from repair.search.probe import Hopeless, ProblemSource
from repair.search.result import Like, Probe, SearchResult, SearchStatus
from repair.search.rules import CONTIGUOUS
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig
from repair.situation import Situation
from repair.timegrid import INSTANT, intervals

__all__ = ["Refusing", "capabilities_of", "search_with"]

_FEW = 2  # times-to-repair that are looked at without asking for a proof first


def search_with(
    backend: RepairBackend,
    name: str,
    situation: Situation,
    settings: SearchConfig,
    *,
    around: ProblemSource | None = None,
    visits: Sequence[float] | None = None,
    too_late: Callable[[], float] | None = None,
    hopeless: Hopeless | None = None,
    on_probe: Callable[[Probe], None] | None = None,
    like: Like | None = None,
) -> SearchResult:
    """Algorithm 1 with a backend, or with each member of one that is made of several.

    The first member is asked as if it were alone. Each further one starts from the latest repair that was
    verified so far, if it can, and is asked for later ones only; where there is none, as if it were alone.
    So a repair is found wherever one of them finds one. A search of all times-to-repair that ends without a
    repair is made again by each of the fallbacks, until one finds one.

    Parameters
    ----------
    backend : RepairBackend
    name : str
        By which it was asked for.
    situation : Situation
    settings : SearchConfig
    around : ProblemSource, optional
        What makes the problems, instead of the situation.
    visits : sequence of float, optional
        The times-to-repair to try [s].
    too_late : callable, optional
        From when on nobody finds anything [s]; asked once, when there is a repair and a member left.
    hopeless : Hopeless, optional
        Says of a t_rep whether it is proven that nothing is feasible there (``search.proofs``).
    on_probe : callable, optional
        Called after every probe.
    like : Like, optional
        What passed in a search that is much like this one; see :func:`repair.search.search.search_f_ttr`.

    Raises
    ------
    BackendError
        If a backend raises, or what it answers is no answer.
    """
    found = _search_with(
        backend, name, situation, settings, around, visits, too_late, hopeless, on_probe, like
    )
    fallbacks = backend.capabilities.fallbacks
    if fallbacks is None or visits is not None or found.status is not SearchStatus.NONE_FEASIBLE:
        return found
    asked = {name, *(backend.capabilities.members or dict)()}
    refused = {each: {p.t_rep for p in found.probes if (p.by or name) == each} for each in asked}
    for each, other in fallbacks().items():
        if each in asked or found.status is not SearchStatus.NONE_FEASIBLE:
            continue
        left = None if settings.time_limit is None else max(settings.time_limit - found.wall_time, 0.0)
        again = search_f_ttr(
            around or (situation.unguided if other.capabilities.own_way else situation.source),
            situation.conflict, _Unaided(other, each, refused), situation.judge,
            replace(settings, time_limit=left), hopeless=hopeless,
            on_probe=None if on_probe is None else partial(_told, on_probe, each),
        )  # fmt: skip
        refused[each] = {probe.t_rep for probe in again.probes}
        found = replace(
            again,
            probes=(*found.probes, *(replace(probe, by=each, fallback=True) for probe in again.probes)),
            wall_time=found.wall_time + again.wall_time,
        )
    return found


class _Unaided(Guarded):
    """A backend whose helpers are not asked again where they have found nothing by themselves.

    Parameters
    ----------
    backend : RepairBackend
    name : str
        By which it was asked for.
    refused : mapping of str to collection of float
        At which t_rep [s] a backend found nothing, by its name.
    onward : bool
        Whoever found nothing at a t_rep is taken to find nothing at later ones, as a rule does that takes
        feasibility to be contiguous; it does so after a t_rep at which something was found.
    """

    def __init__(
        self,
        backend: RepairBackend,
        name: str,
        refused: Mapping[str, Collection[float]],
        *,
        onward: bool = False,
    ) -> None:
        super().__init__(backend, name)
        helpers = dict(backend.capabilities.helpers)
        for each in helpers.keys() & refused.keys():
            helpers[each] = partial(_refusing, helpers[each], refused[each], onward)
        self.capabilities = replace(backend.capabilities, helpers=helpers)


class Refusing:
    """A backend that is not asked again at some t_rep.

    Parameters
    ----------
    backend : RepairBackend
    refused : collection of float
        Those at which nothing was found [s].
    onward : bool
        Nor at any later one.
    """

    def __init__(self, backend: RepairBackend, refused: Collection[float], onward: bool = False) -> None:
        self.name, self.capabilities = backend.name, backend.capabilities
        self._backend, self._refused = backend, refused
        self._from = min(refused, default=math.inf) if onward else math.inf

    def solve(
        self, problem: RepairProblem, *, warm_start: Curve | None = None, time_limit: float | None = None
    ) -> SolveResult:
        """Nothing where it has been asked, else what the backend answers."""
        t_rep = problem.t_rep
        if t_rep >= self._from - INSTANT or any(abs(t_rep - each) <= INSTANT for each in self._refused):
            return SolveResult(SolveStatus.INFEASIBLE, detail=f"{self.name} was asked before")
        return self._backend.solve(problem, warm_start=warm_start, time_limit=time_limit)


def _refusing(make: Callable[[], RepairBackend], refused: Collection[float], onward: bool) -> RepairBackend:
    return Refusing(make(), refused, onward)


def _told(on_probe: Callable[[Probe], None], by: str, probe: Probe) -> None:
    on_probe(replace(probe, by=by, fallback=True))


def _search_with(
    backend: RepairBackend,
    name: str,
    situation: Situation,
    settings: SearchConfig,
    around: ProblemSource | None,
    visits: Sequence[float] | None,
    too_late: Callable[[], float] | None,
    hopeless: Hopeless | None,
    on_probe: Callable[[Probe], None] | None,
    like: Like | None,
) -> SearchResult:
    """As :func:`search_with`, without fallbacks."""

    def ask(name: str, one: RepairBackend, settings: SearchConfig, best: Probe | None) -> SearchResult:
        own = situation.unguided if one.capabilities.own_way else situation.source
        after = onward and best is not None
        return search_f_ttr(
            around or own, situation.conflict, _Unaided(one, name, refused, onward=after), situation.judge,
            settings, visits=visits, on_probe=on_probe if several is None else by(name), after=best,
            hopeless=hopeless if not after or _slow(one.capabilities, refused) else None,
            like=like if like is not None and like.probe.by in ("", name) else None,
        )  # fmt: skip

    def by(name: str) -> Callable[[Probe], None]:
        def visited(probe: Probe) -> None:
            probes.append(replace(probe, by=name))
            if on_probe is not None:
                on_probe(probes[-1])

        return visited

    several, probes, refused = backend.capabilities.members, list[Probe](), dict[str, set[float]]()
    onward = visits is None and settings.rule in CONTIGUOUS
    if several is None:
        return ask(name, backend, settings, None)
    begin, complete, best = time.perf_counter(), True, None
    end, late = situation.conflict.time, too_late
    for each, member in several().items():
        if best is not None:
            if late is not None and _open(visits, best, settings, end):
                end, late = min(end, late()), None
            try:  # an interrupt loses nothing that was found
                slow = not onward or _slow(
                    member.capabilities, refused, len(_later(visits, best, settings, end))
                )
                if slow and hopeless is not None and settings.proofs and _open(visits, best, settings, end):
                    left = _left(settings, begin)
                    end = min(end, _since(hopeless, _later(visits, best, settings, end), left))
            except KeyboardInterrupt:
                complete = False
                break
            if not _open(visits, best, settings, end):
                break
            visits = None if visits is None else _later(visits, best, settings, end)
        limit = _left(settings, begin)
        upper = end if settings.upper is None else min(end, settings.upper)
        now = replace(settings, time_limit=limit, upper=upper if math.isfinite(upper) else None)
        before = len(probes)
        found = ask(each, member, now, best)
        probes[before:] = [replace(probe, by=each) for probe in found.probes]  # compared at its end
        refused[each] = {probe.t_rep for probe in found.probes if not probe.feasible}
        if found.status in (SearchStatus.NO_CONFLICT, SearchStatus.ALREADY_COLLIDING):
            return found
        best = max((p for p in probes if p.feasible), key=lambda p: p.t_rep, default=None)
        complete = found.complete
        if not complete:
            break
    spent = time.perf_counter() - begin
    if best is None:
        status = SearchStatus.NONE_FEASIBLE if complete else SearchStatus.BUDGET_EXHAUSTED
        return SearchResult(status, situation.conflict, None, None, tuple(probes), complete, spent)
    return SearchResult(
        SearchStatus.FOUND, situation.conflict, best.t_rep, best.solve.curve, tuple(probes), complete, spent
    )


def _slow(can: Capabilities, refused: Collection[str], times: float = math.inf) -> bool:
    """Whether a search of so many times-to-repair may cost more than a proof that ends it.

    Who finds its own way looks at one or two as fast as a proof, and may find something; others do so where
    their helpers have all refused.
    """
    if can.own_way:
        return times > _FEW
    return not can.helpers.keys() <= set(refused)


def _left(settings: SearchConfig, begin: float) -> float | None:
    """What is left of the time limit of a search [s]; None where it has none."""
    if settings.time_limit is None:
        return None
    return max(settings.time_limit - (time.perf_counter() - begin), 0.0)


def _since(hopeless: Hopeless, times: Sequence[float], left: float | None) -> float:
    """From when on it is proven to be too late [s]; infinite where the time is up before that is known."""
    try:
        with until(None if left is None else time.perf_counter() + left):
            return hopeless.since(times)
    except OutOfTime:
        return math.inf


def _later(
    visits: Sequence[float] | None, best: Probe, settings: SearchConfig, end: float
) -> Sequence[float]:
    """The times-to-repair after the best that could be visited before ``end`` [s]."""
    end = end if settings.upper is None else min(end, settings.upper)
    if visits is not None:
        return sorted(t for t in visits if best.t_rep + INSTANT < t < end - INSTANT)
    size = intervals(end - best.t_rep, settings.delta_t)
    return [best.t_rep + k * settings.delta_t for k in range(1, size)]


def _open(visits: Sequence[float] | None, best: Probe, settings: SearchConfig, end: float) -> bool:
    """Whether there is a time-to-repair later than the best before ``end`` [s]."""
    return bool(_later(visits, best, settings, end))


def capabilities_of(backend: RepairBackend, found: SearchResult) -> Capabilities:
    """What the backend behind an answer is able to do, as plain data: the member whose repair it is."""
    can, by = backend.capabilities, found.best.by if found.best is not None else ""
    for others in (can.members, can.fallbacks):
        made = others() if others is not None and by else {}
        if by in made:
            can = made[by].capabilities
            break
    return replace(can, helpers={}, members=None, fallbacks=None)
