"""The search by one backend, or by several: each is asked only for what those before it have left open."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from repair.backend.base import Capabilities, RepairBackend
from repair.backend.guard import Guarded
from repair.search.probe import ProblemSource
from repair.search.result import Probe, SearchResult, SearchStatus
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig
from repair.situation import Situation
from repair.timegrid import INSTANT

__all__ = ["capabilities_of", "search_with"]


def search_with(
    backend: RepairBackend,
    name: str,
    situation: Situation,
    settings: SearchConfig,
    *,
    around: ProblemSource | None = None,
    visits: Sequence[float] | None = None,
    too_late: Callable[[], float] | None = None,
    on_probe: Callable[[Probe], None] | None = None,
) -> SearchResult:
    """Algorithm 1 with a backend, or with each member of one that is made of several.

    The first member is asked as if it were alone. Each further one starts from the latest repair that was
    verified so far, if it can, and is asked for later ones only; where there is none, as if it were alone.
    So a repair is found wherever one of them finds one.

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
    on_probe : callable, optional
        Called after every probe.

    Raises
    ------
    BackendError
        If a backend raises, or what it answers is no answer.
    """

    def ask(name: str, one: RepairBackend, settings: SearchConfig, best: Probe | None) -> SearchResult:
        own = situation.unguided if one.capabilities.own_way else situation.source
        return search_f_ttr(
            around or own, situation.conflict, Guarded(one, name), situation.judge, settings,
            visits=visits, on_probe=on_probe if several is None else by(name), after=best,
        )  # fmt: skip

    def by(name: str) -> Callable[[Probe], None]:
        def visited(probe: Probe) -> None:
            probes.append(replace(probe, by=name))
            if on_probe is not None:
                on_probe(probes[-1])

        return visited

    several, probes = backend.capabilities.members, list[Probe]()
    if several is None:
        return ask(name, backend, settings, None)
    begin, complete, best = time.perf_counter(), True, None
    end, late = situation.conflict.time, too_late
    for each, member in several().items():
        if best is not None:
            if late is not None and _open(visits, best, settings, end):
                end, late = min(end, late()), None
            if not _open(visits, best, settings, end):
                break
            visits = None if visits is None else [t for t in visits if t > best.t_rep + INSTANT]
        spent = time.perf_counter() - begin
        limit = None if settings.time_limit is None else max(settings.time_limit - spent, 0.0)
        upper = end if settings.upper is None else min(end, settings.upper)
        now = replace(settings, time_limit=limit, upper=upper if math.isfinite(upper) else None)
        found = ask(each, member, now, best)
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


def _open(visits: Sequence[float] | None, best: Probe, settings: SearchConfig, end: float) -> bool:
    """Whether there is a time-to-repair later than the best before ``end`` [s]."""
    end = end if settings.upper is None else min(end, settings.upper)
    if visits is not None:
        return any(best.t_rep + INSTANT < t < end - INSTANT for t in visits)
    return best.t_rep + settings.delta_t < end - INSTANT


def capabilities_of(backend: RepairBackend, found: SearchResult) -> Capabilities:
    """What the backend behind an answer is able to do, as plain data: the member whose repair it is."""
    can, best = backend.capabilities, found.best
    if can.members is not None and best is not None and best.by:
        can = can.members()[best.by].capabilities
    return replace(can, helpers=(), members=None)
