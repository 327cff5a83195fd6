"""The search of a cycle: it begins where the last one ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import numpy as np

from repair.api import find
from repair.backend.base import RepairBackend
from repair.preparation import Prepared
from repair.search.result import Like, Probe, SearchResult, SearchStatus
from repair.search.rules import CONTIGUOUS, around
from repair.search.settings import SearchConfig
from repair.timegrid import INSTANT, intervals

__all__ = ["Unproven", "searched"]


@dataclass
class Unproven:
    """A time-to-repair at which there was a verified repair, until that is asked for again.

    Attributes
    ----------
    due : float
        [s].
    verify : callable
        Whether it still is one.
    holds : bool or None
        What that said; None where nobody has asked.
    """

    due: float
    verify: Callable[[], bool]
    holds: bool | None = None

    def asked(self) -> float | None:
        """The time-to-repair, if it holds."""
        self.holds = self.verify()
        return self.due if self.holds else None


def searched(
    prepared: Prepared,
    backend: RepairBackend,
    settings: SearchConfig,
    kept: float | Unproven | None = None,
    guess: float | None = None,
    *,
    thorough: bool = False,
    above: float | None = None,
    stride: float | None = None,
    on_probe: Callable[[Probe], None] | None = None,
    like: Like | None = None,
) -> SearchResult:
    """The F-TTR of a cycle.

    Parameters
    ----------
    prepared : Prepared
    backend : RepairBackend
    settings : SearchConfig
    kept : float or Unproven, optional
        A time-to-repair at which there is a verified repair [s]: later ones are searched for. One that is
        unproven needs no proof where the search finds something later, at ``guess``.
    guess : float, optional
        Where it was a cycle ago [s]; with a rule that takes feasibility to be contiguous the search begins
        there, by default at the one that follows ``kept``.
    thorough : bool
        Before nothing is said to be feasible, every point of the grid is tried, from the last one down: such
        rules look no further where what they begin with is not.
    above : float, optional
        From where on nothing was found [s]: with such a rule nothing is visited there.
    stride : float, optional
        How much farther such a rule looks after ``guess`` [s], by default by one step of the grid.
    on_probe : callable, optional
        Called after every probe; one that raises :class:`repair.deadline.OutOfTime` ends the search.
    like : Like, optional
        What passed a cycle ago: its side is asked first, as tight as it had to be.
    """
    begin = time.perf_counter()
    found = _searched(prepared, backend, settings, kept, guess, above, stride, on_probe, like)
    nothing = not _holds(kept) and found.complete and found.status is SearchStatus.NONE_FEASIBLE
    if thorough and nothing and settings.rule in CONTIGUOUS:
        return _the_rest(prepared, backend, settings, begin, found)
    return found


def _searched(
    prepared: Prepared,
    backend: RepairBackend,
    settings: SearchConfig,
    kept: float | Unproven | None,
    guess: float | None,
    above: float | None,
    stride: float | None,
    on_probe: Callable[[Probe], None] | None,
    like: Like | None,
) -> SearchResult:
    """From the last cycle's answer on, by a rule that takes feasibility to be contiguous; else by its own."""
    end = _end(prepared, settings)
    if settings.rule not in CONTIGUOUS:
        guess = None
    if isinstance(kept, Unproven) and (guess is None or end <= 0.0):
        kept = kept.asked()
        guess = guess if kept is None else None
    if (kept is None and guess is None) or not np.isfinite(end) or end <= 0.0:
        return find(prepared, backend, settings=settings, on_probe=on_probe)
    begin = time.perf_counter()
    step = settings.delta_t
    size = intervals(end, step)
    if above is not None:
        least = 0 if kept is None else _point(kept.due if isinstance(kept, Unproven) else kept, step) + 1
        size = min(size, max(int(np.ceil(above / step - INSTANT)), least))
    order = _visits(kept, guess, step, size, 1 if stride is None else max(round(stride / step), 1))
    probes: tuple[Probe, ...] = ()
    complete, k = True, next(order, None)
    while k is not None and complete:
        left = _left(settings, begin)
        found = find(prepared, backend, settings=left, visits=(k * step,), on_probe=on_probe, like=like)
        probes += found.probes
        complete = found.complete
        try:
            k = order.send(found.f_ttr is not None)
        except StopIteration:
            k = None
    best = max((p for p in probes if p.feasible), key=lambda p: p.t_rep, default=None)
    if best is None and complete and not _holds(kept) and backend.capabilities.fallbacks is not None:
        return find(prepared, backend, settings=_left(settings, begin))  # which asks the fallbacks
    spent = time.perf_counter() - begin
    if best is None:
        return SearchResult(
            SearchStatus.NONE_FEASIBLE if complete else SearchStatus.BUDGET_EXHAUSTED,
            prepared.conflict, None, None, probes, complete, spent,
        )  # fmt: skip
    return SearchResult(
        SearchStatus.FOUND, prepared.conflict, best.t_rep, best.solve.curve, probes, complete, spent
    )


def _visits(
    kept: float | Unproven | None, guess: float | None, step: float, size: int, stride: int
) -> Generator[int, bool, None]:
    """The points of the grid; with something unproven the guess first, if that is later."""
    if isinstance(kept, Unproven):
        first = _point(kept.due if guess is None else guess, step)
        if kept.due + INSTANT < first * step and first < size:
            if (yield first):
                kept, guess = first * step, None
            else:
                size, kept = first, kept.asked()
                guess = (first - 1) * step if kept is None else None
        else:
            kept = kept.asked()
            guess = guess if kept is None else None
    known = -1 if kept is None else _point(kept, step)
    yield from around(known + 1 if guess is None else _point(guess, step), known, size, stride)


def _point(t_rep: float, step: float) -> int:
    return int(np.floor(t_rep / step + INSTANT))


def _holds(kept: float | Unproven | None) -> bool:
    return kept.holds is True if isinstance(kept, Unproven) else kept is not None


def _the_rest(
    prepared: Prepared, backend: RepairBackend, settings: SearchConfig, begin: float, found: SearchResult
) -> SearchResult:
    """What a search that has found nothing has not visited."""
    end = _end(prepared, settings)
    step, probes = settings.delta_t, found.probes
    visited = {round(probe.t_rep / step) for probe in probes if not probe.fallback}
    status, best = found.status, None
    for k in (k for k in reversed(range(intervals(end, step))) if k not in visited):
        one = find(prepared, backend, settings=_left(settings, begin), visits=(k * step,))
        probes += one.probes
        best = one.best
        if best is not None or not one.complete:
            status = SearchStatus.FOUND if best is not None else SearchStatus.BUDGET_EXHAUSTED
            break
    return SearchResult(
        status, found.conflict, None if best is None else best.t_rep,
        None if best is None else best.solve.curve, probes, status is not SearchStatus.BUDGET_EXHAUSTED,
        time.perf_counter() - begin,
    )  # fmt: skip


def _end(prepared: Prepared, settings: SearchConfig) -> float:
    """Until when there is anything to search [s]."""
    end = prepared.conflict.time
    return end if settings.upper is None else min(end, settings.upper)


def _left(settings: SearchConfig, begin: float) -> SearchConfig:
    """The settings with what is left of their time."""
    if settings.time_limit is None:
        return settings
    return replace(settings, time_limit=max(settings.time_limit - (time.perf_counter() - begin), 0.0))
