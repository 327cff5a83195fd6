"""The share of a search that one cycle makes."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from repair.api import find
from repair.backend.base import RepairBackend
from repair.cycle.searching import searched
from repair.preparation import Prepared
from repair.search.result import Probe, SearchResult
from repair.search.rules import CONTIGUOUS
from repair.search.settings import SearchConfig
from repair.search.several import Refusing
from repair.simulate.carried import Carried, Stint, carried_from
from repair.timegrid import INSTANT

__all__ = ["ANEW", "Share", "Start"]

#: Where a search begins: what is known [s], where it looks first, from where on nothing was found, and how
#: much farther it looks next; see :func:`repair.cycle.searching.searched`.
Start = tuple[float | None, float | None, float | None, float | None]
ANEW: Start = (None, None, None, None)


@dataclass(eq=False)
class Share:
    """What a cycle makes of a search, and what is left of it for the next one.

    Attributes
    ----------
    prepared : Prepared
        What was looked at.
    backend : RepairBackend
    settings : SearchConfig
    now : float
        When the cycle begins [s].
    limit : float or None
        All of it ends after so long [s].
    refused : set of float
        Times-to-repair at which nothing was found among what was looked at [s]: nobody is asked there again.
    carried : Carried or None
        What is left of the search that was made last.
    complete : bool
        That came to its end.
    ended : bool
        It was ended after so many solves.
    spent : int
        Solves so far.
    """

    prepared: Prepared
    backend: RepairBackend
    settings: SearchConfig
    now: float
    limit: float | None = None
    refused: set[float] = field(default_factory=set)
    carried: Carried | None = field(default=None, init=False)
    complete: bool = field(default=True, init=False)
    ended: bool = field(default=False, init=False)
    spent: int = field(default=0, init=False)
    _begin: float = field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        self.backend = Refusing(self.backend, self.refused)

    @property
    def contiguous(self) -> bool:
        """Whether the search's rule takes feasibility to be so, and may begin anywhere."""
        return self.settings.rule in CONTIGUOUS

    @property
    def end(self) -> float:
        """Where the grid ends [s], excluded."""
        upper, conflict = self.settings.upper, self.prepared.conflict.time
        return conflict if upper is None else min(conflict, upper)

    def first_to_wait(self, enough: float) -> float:
        """The first place of the grid that is so late [s]."""
        step = self.settings.delta_t
        return float(np.ceil(enough / step - INSTANT)) * step

    def timely(self) -> SearchConfig:
        """With what is left of the limit, and of the search's own: what a cycle makes is one search."""
        limits = [limit for limit in (self.limit, self.settings.time_limit) if limit is not None]
        if not limits:
            return self.settings
        left = max(min(limits) - (time.perf_counter() - self._begin), 1e-6)
        return replace(self.settings, time_limit=left)

    def visit(self, *places: float) -> SearchResult:
        """Times-to-repair one after the other [s], until a repair is found."""
        stint = Stint(0, 0.0, needed=True, spent=self.spent)
        made = find(self.prepared, self.backend, settings=self.timely(), visits=places, on_probe=stint)
        self.spent, self.complete = stint.spent, made.complete or stint.ended
        self._refuse(made, stint.ended)
        return made

    def _refuse(self, made: SearchResult, ended: bool) -> None:
        """Keep in mind where nothing was found; what ran out of time says nothing."""
        known = made.probes if made.complete or ended else made.probes[:-1]
        if self.backend.capabilities.members is not None and not made.complete:
            known = ()  # the next member might have found something
        found = {probe.t_rep for probe in made.probes if probe.feasible}  # by another one
        self.refused.update(probe.t_rep for probe in known if probe.t_rep not in found)

    def search(
        self,
        start: Start,
        solves: int | None,
        enough: float = 0.0,
        *,
        needed: bool = False,
        best: float | None = None,
    ) -> SearchResult:
        """Search until so many were spent.

        Parameters
        ----------
        start : tuple
        solves : int or None
            Of all that the cycle spends; None: to the end.
        enough, needed, best
            See :class:`repair.simulate.carried.Stint`.
        """
        known, guess, above, stride = start
        stint = Stint(solves, enough, needed, -np.inf if best is None else best, self.spent)
        made = searched(
            self.prepared, self.backend, self.timely(), known, guess, above=above, stride=stride,
            on_probe=stint if self.contiguous else None,
        )  # fmt: skip
        self.spent, self.ended, self.complete, self.carried = stint.spent, stint.ended, made.complete, None
        self._refuse(made, stint.ended)
        if not made.complete:
            self.carried = self._left_of(made.probes, (known, above))
            self.complete = stint.ended and self.carried is None
        return made

    def _left_of(
        self, probes: tuple[Probe, ...], before: tuple[float | None, float | None]
    ) -> Carried | None:
        if not self.ended and probes and not probes[-1].feasible:
            probes = probes[:-1]  # nobody knows what would have come of the one that ran out of time
        return carried_from(probes, self.now, self.end, self.settings.delta_t, before)

    def to_wait_on(self, made: SearchResult, enough: float, *, brief: bool = False) -> SearchResult:
        """After a search that was ended and has found nothing: a repair that can be waited for.

        It is looked for at the first place of the grid that is so late [s], and where there is none the
        search goes on until there is one, or to its end. ``brief``: only one that begins at once is
        looked for then.
        """
        at = self.first_to_wait(enough)
        rest = None if self.carried is None else self.carried.seen_from(self.now, None)
        if at < min(probe.t_rep for probe in made.probes) - INSTANT:
            made = self.visit(at)
        self.complete = self.carried is None
        if made.curve is not None or rest is None:
            return made
        if brief:
            self.carried, self.complete = None, True
            return made if 0.0 in self.refused else self.visit(0.0)
        return self.search(rest, 0, enough, needed=True)

    def anew(self, made: SearchResult, least: float, enough: float, solves: int | None) -> SearchResult:
        """After one that was carried on and leaves nothing to wait on: from its beginning.

        Where nothing was found in earlier cycles there may be something by now.
        """
        start: Start = (least if least >= 0.0 else None, None, None, None)
        again = self.search(start, solves, enough, needed=True, best=least)
        return made if again.curve is None else again
