"""A :class:`repair.Repairer` in two halves, along curves: it looks, and searches where somebody asks."""

from __future__ import annotations

import time
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repair.api import find
from repair.arrays import frozen
from repair.check.checker import Checker
from repair.check.verdict import Conflict
from repair.curves.base import Curve, SplicedCurve
from repair.cycle.asked import step_of
from repair.cycle.kept import KeptRepair, verified_again
from repair.cycle.repairer import Repairer
from repair.cycle.searching import searched
from repair.preparation import Phases, Prepared, laid_out
from repair.scene.scene import InitialState
from repair.scene.traffic.obstacle import Traffic
from repair.search.result import Probe, SearchStatus
from repair.search.rules import CONTIGUOUS
from repair.search.settings import SearchConfig
from repair.simulate.carried import Carried, Stint, carried_from
from repair.timegrid import INSTANT

__all__ = ["Found", "Looked", "Watch"]


@dataclass(frozen=True)
class Looked:
    """A curve among the traffic of a cycle, before anything is searched.

    Attributes
    ----------
    now : float
        When the cycle begins [s].
    prepared : Prepared
        Its ``conflict`` is that of the curve.
    """

    now: float
    prepared: Prepared

    @property
    def conflict(self) -> Conflict:
        """Where the curve stops being drivable."""
        return self.prepared.conflict


@dataclass(frozen=True)
class Found:
    """What a search has found. Times count from now.

    Attributes
    ----------
    f_ttr : float or None
        Until when what is driven can be followed [s]; inf without a conflict, None where nothing is verified.
    curve : Curve or None
        What was looked at, repaired from ``f_ttr`` on; None where nothing is to repair, or was found.
    until : float
        How long that is verified [s].
    kept : bool
        The repair is one of an earlier cycle, checked again.
    complete : bool
        The search ran to its end.
    solves : int
        How many there were.
    """

    f_ttr: float | None
    curve: Curve | None
    until: float
    kept: bool
    complete: bool
    solves: int = 0


class Watch(Repairer):
    """The same road, backend and kept repairs as those of a :class:`repair.Repairer`, asked along curves.

    The curves are in the frame of its scene, which stays: nothing is fitted on the way from one cycle to the
    next, and one look serves several searches.
    """

    _edged: Checker | None = None
    _carried: Carried | None = None
    _nothing: Carried | None = None  # the round of searches that have found nothing, cycle after cycle

    def along(self, checker: Checker) -> Watch:
        """Itself, with the road's edge as it is laid out already for a checker on the same road."""
        self._edged = checker
        return self

    def twin(self) -> Watch:
        """Another one for the same road, with what is laid out of it and nothing of what was found."""
        made = copy(self)
        made.reset()
        made._edged, made._carried, made._nothing = self._edged, None, None
        return made

    def look(
        self,
        curve: Curve,
        *,
        traffic: Traffic,
        ego: InitialState,
        now: float = 0.0,
    ) -> Looked:
        """The conflict of a curve, without a search.

        Parameters
        ----------
        curve : Curve
            Its time 0 is now.
        traffic : Traffic
            From now on.
        ego : InitialState
            At the beginning of the curve.
        now : float
            [s] since the planning problem's start; a multiple of the scenario's step.

        Raises
        ------
        ConfigError
            If ``now`` is no such time.
        """
        base, at = self.scene, curve.sample(np.zeros(1))
        scene = replace(
            base, initial_state=ego, start=frozen([at.position[0], at.velocity[0], at.acceleration[0]]),
            obstacles=traffic.obstacles, n_steps=traffic.n_steps, horizon=traffic.n_steps * base.dt,
            initial_time_step=base.initial_time_step + step_of(now, base.dt), recorded_ego=None, notes=(),
            first_heading=ego.orientation,
        )  # fmt: skip
        prepared = laid_out(
            scene, self.config, None, Phases(), reference=curve, like=self._edged, within_reach=True
        )
        self._edged = prepared.checker
        return Looked(now, prepared)

    def answer(
        self,
        looked: Looked,
        *,
        limit: float | None = None,
        visits: tuple[float, ...] | None = None,
        enough: float | None = None,
        solves: int | None = None,
        shut: tuple[float, ...] = (),
    ) -> Found:
        """The search among what was looked at.

        Parameters
        ----------
        looked : Looked
        limit : float, optional
            For how long is searched [s].
        visits : tuple of float, optional
            Times-to-repair to try [s] instead of those of the search's rule; no earlier repair is then looked
            at, nor is this one kept.
        enough : float, optional
            Where an earlier repair still holds and can be waited for so long [s], nothing is searched.
        solves : int, optional
            After so many the rest of the search is left for the next cycle, if there is a repair that can be
            waited for: where none was found, it is looked for there, and then the search goes to its end.
            Where nothing to wait on comes of one that was carried on, it is made anew. After a cycle that
            has found nothing at all, the next ones make theirs in several cycles.
        shut : tuple of float, optional
            Times-to-repair at which nothing was found in this cycle [s].
        """
        prepared, settings, begin = looked.prepared, self.config.search, time.perf_counter()
        if limit is not None:
            settings = replace(settings, time_limit=min(limit, settings.time_limit or limit))

        def timely() -> SearchConfig:
            """With what is left of a limit."""
            if limit is None:
                return settings
            return replace(settings, time_limit=max(limit - (time.perf_counter() - begin), 1e-6))

        if visits is not None:
            made = find(prepared, self._backend, settings=settings, visits=visits)
            tried = sum(max(len(probe.tried), 1) for probe in made.probes)
            return _found(prepared, made.f_ttr, made.curve, False, made.complete, tried)
        last, carried, nothing = self._kept, self._carried, self._nothing
        self._carried = self._nothing = None
        kept = None if last is None else verified_again(last, prepared, looked.now)
        enough, latest = enough or 0.0, np.inf if enough is None else enough + INSTANT  # a cycle ago
        safe, on = kept is not None and kept[0] >= enough - INSTANT, None
        if carried is not None and looked.now - carried.now <= latest and (last is None or kept is not None):
            on = carried.seen_from(looked.now, None if kept is None else kept[0])
        if kept is not None and safe and on is None and latest < np.inf:
            return _found(prepared, *kept, True, True)
        contiguous = settings.rule in CONTIGUOUS
        goes_round = solves is not None and contiguous and latest < np.inf
        if looked.conflict.time == np.inf:
            nothing = None
        if goes_round and kept is None and nothing is not None and looked.now - nothing.now <= latest:
            return self._once_more(looked, timely(), nothing, enough, solves or 0, shut)
        if on is not None:
            known, guess, above, stride = on
        else:
            known, guess, above, stride = None if kept is None else kept[0], None, None, None
            if last is not None and kept is None and last.due(looked.now) >= 0.0:
                guess = last.due(looked.now)
        stint = Stint(solves, enough, best=-np.inf if known is None else known)
        made = searched(
            prepared, self._backend, timely(), known, guess, above=above, stride=stride,
            on_probe=stint if contiguous else None,
        )  # fmt: skip
        best, complete = known if made.f_ttr is None else made.f_ttr, made.complete
        if not complete:
            self._carried = self._left_of(looked, made.probes, stint.ended, (known, above))
            complete = stint.ended and self._carried is None
        if stint.ended and best is None and not safe:
            stint = Stint(0, enough, needed=True, spent=stint.spent)
            nearer, step = min(probe.t_rep for probe in made.probes), settings.delta_t
            at = float(np.ceil(enough / step - INSTANT)) * step
            if at < nearer - INSTANT:
                made = find(prepared, self._backend, settings=timely(), visits=(at,), on_probe=stint)
            rest = None if self._carried is None else self._carried.seen_from(looked.now, None)
            if made.curve is None and rest is not None:  # there is none to wait on: to its end, as it began
                made = searched(
                    prepared, self._backend, timely(), None, rest[1], above=rest[2], stride=rest[3],
                    on_probe=stint,
                )  # fmt: skip
                self._carried, complete = None, made.complete
                if stint.ended:
                    self._carried = self._left_of(looked, made.probes, True, (None, rest[2]))
                    complete = self._carried is None
        least = -np.inf if kept is None else kept[0]
        least = least if made.f_ttr is None else max(least, made.f_ttr)
        if on is not None and contiguous and complete and least < enough - INSTANT:
            # Nothing to wait on comes of it, and where nothing was in earlier cycles there may be by now.
            stint = Stint(solves, enough, needed=True, best=least, spent=stint.spent)
            known = least if least >= 0.0 else None
            anew = searched(prepared, self._backend, timely(), known, None, on_probe=stint)
            complete = anew.complete
            if stint.ended:
                self._carried = self._left_of(looked, anew.probes, True, (known, None))
                complete = self._carried is None
            made = made if anew.curve is None else anew
        later = made.f_ttr is not None and (kept is None or made.f_ttr > kept[0])
        if made.curve is not None and made.f_ttr is not None and later:
            self._kept = KeptRepair(made.curve, made.f_ttr, looked.now, prepared.scene.frame)
            return _found(prepared, made.f_ttr, made.curve, False, complete, stint.spent)
        if kept is not None:
            return _found(prepared, *kept, True, complete, stint.spent)
        if made.status is not SearchStatus.NO_CONFLICT:
            self._kept = None
        if made.status is SearchStatus.NONE_FEASIBLE and goes_round and stint.spent > (solves or 0):
            self._nothing = Carried(looked.now, np.inf, settings.delta_t, False)
        return _found(prepared, made.f_ttr, None, False, complete, stint.spent)

    def _once_more(
        self,
        looked: Looked,
        settings: SearchConfig,
        nothing: Carried,
        enough: float,
        solves: int,
        shut: tuple[float, ...],
    ) -> Found:
        """After a cycle that has found nothing: the places that decide what is done now, and some others.

        A repair that can be waited for, and one that begins at once; then the search is made as far as
        ``solves`` go, by one place at least, and the next cycle goes on with it.
        """
        prepared, step, begin = looked.prepared, settings.delta_t, time.perf_counter()
        places = (float(np.ceil(enough / step - INSTANT)) * step, 0.0)
        end = self._end(looked)
        first = tuple(t for t in places if t not in shut and (t < end - INSTANT or t <= 0.0))
        stint = Stint(0, 0.0, needed=True)
        made = find(prepared, self._backend, settings=settings, visits=first, on_probe=stint)
        if made.curve is not None:  # what is waited on; the round goes on: feasibility may have gaps
            since = nothing.above - (looked.now - nothing.now)
            carried: Carried | None = replace(nothing, now=looked.now, above=since)
        else:
            on = nothing.seen_from(looked.now, None)
            if on is None or (on[1] is not None and on[1] <= places[0] + INSTANT):  # the round is over
                on = None, None, None, None
            _, guess, above, stride = on
            if settings.time_limit is not None:
                left = max(settings.time_limit - (time.perf_counter() - begin), 1e-6)
                settings = replace(settings, time_limit=left)
            before = stint.spent
            stint = Stint(max(solves - before, 1) + before, 0.0, spent=before)
            made = searched(
                prepared, self._backend, settings, None, guess, above=above, stride=stride, on_probe=stint
            )  # fmt: skip
            carried = None
            if not made.complete:
                carried = self._left_of(looked, made.probes, stint.ended, (None, above))
        if made.curve is None or made.f_ttr is None:
            self._kept = None
            self._nothing = carried or Carried(looked.now, np.inf, step, False)
            return _found(prepared, None, None, False, False, stint.spent)
        self._carried = carried
        self._kept = KeptRepair(made.curve, made.f_ttr, looked.now, prepared.scene.frame)
        return _found(prepared, made.f_ttr, made.curve, False, carried is None, stint.spent)

    def _left_of(
        self,
        looked: Looked,
        probes: tuple[Probe, ...],
        ended: bool,
        before: tuple[float | None, float | None],
    ) -> Carried | None:
        """What is left for the next cycle of a search that was cut short."""
        settings = self.config.search
        if not ended and probes and not probes[-1].feasible:
            probes = probes[:-1]  # nobody knows what would have come of the one that ran out of time
        return carried_from(probes, looked.now, self._end(looked), settings.delta_t, before)

    def _end(self, looked: Looked) -> float:
        """Where the grid ends [s], excluded."""
        upper = self.config.search.upper
        return looked.conflict.time if upper is None else min(looked.conflict.time, upper)


def _found(
    prepared: Prepared, f_ttr: float | None, part: Any, kept: bool, complete: bool, solves: int = 0
) -> Found:
    curve = None if part is None or f_ttr is None else SplicedCurve(prepared.reference, part, f_ttr)
    return Found(f_ttr, curve, prepared.t_end, kept, complete, solves)
