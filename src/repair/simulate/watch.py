"""A :class:`repair.Repairer` in two halves, along curves: it looks, and searches where somebody asks."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from repair.arrays import frozen
from repair.check.checker import Checker
from repair.check.settings import sampled
from repair.check.verdict import Conflict
from repair.curves.base import Curve, SplicedCurve
from repair.cycle.asked import step_of
from repair.cycle.kept import KeptRepair, verified_again
from repair.cycle.repairer import Repairer
from repair.preparation import Phases, Prepared, laid_out
from repair.scene.scene import InitialState
from repair.scene.traffic.obstacle import Traffic
from repair.search.result import SearchResult, SearchStatus
from repair.simulate.carried import Carried
from repair.simulate.curves import driven_along
from repair.simulate.share import ANEW, Share, Start
from repair.timegrid import INSTANT, steps_until
from repair.world.collision import CollisionWorld

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
    refused : set of float
        Times-to-repair at which nothing was found by now [s].
    """

    now: float
    prepared: Prepared
    refused: set[float] = field(default_factory=set, repr=False)

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

    def meets(self, curve: Curve, *, traffic: Traffic, ego: InitialState) -> bool:
        """Whether a curve touches somebody: that of :meth:`look`, and nothing else is looked at.

        Parameters
        ----------
        curve, traffic, ego
            As there.
        """
        scene, n = self.scene, traffic.n_steps
        substeps = sampled(self.config.checker, scene.dt).substeps
        steps = min(steps_until(min(n * scene.dt, curve.t_end), scene.dt), n)
        times = np.arange(steps * substeps + 1) * (scene.dt / substeps)
        states = driven_along(scene, curve, times, ego.orientation)
        world = CollisionWorld(traffic.obstacles, scene.vehicle, scene.dt, n, substeps)
        return world.contact(states.x, states.y, states.orientation) is not None

    def answer(
        self,
        looked: Looked,
        *,
        limit: float | None = None,
        visits: tuple[float, ...] | None = None,
        enough: float | None = None,
        solves: int | None = None,
        brief: bool = False,
    ) -> Found:
        """The search among what was looked at.

        Parameters
        ----------
        looked : Looked
        limit : float, optional
            For how long is searched [s].
        visits : tuple of float, optional
            Times-to-repair to try [s] instead of those of the search's rule, until a repair is found; no
            earlier one is then looked at, nor is this one kept.
        enough : float, optional
            Where an earlier repair still holds and can be waited for so long [s], nothing is searched.
        solves : int, optional
            After so many the rest of the search is left for the next cycle, if there is a repair that can be
            waited for: where none was found, it is looked for there, and then the search goes to its end.
            Where nothing to wait on comes of one that was carried on, it is made anew. After a cycle that
            has found nothing at all, the next ones make theirs in several cycles.
        brief : bool
            Where there is none to wait for after so many solves, only one that begins at once is looked for.
        """
        prepared = looked.prepared
        share = Share(prepared, self._backend, self.config.search, looked.now, limit, looked.refused)
        if visits is not None:
            made = share.visit(*visits)
            return _found(prepared, made.f_ttr, made.curve, False, share.complete, share.spent)
        last, carried, nothing = self._kept, self._carried, self._nothing
        self._carried = self._nothing = None
        kept = None if last is None else verified_again(last, prepared, looked.now)
        until = -np.inf if kept is None else kept[0]
        enough, latest = enough or 0.0, np.inf if enough is None else enough + INSTANT  # a cycle ago
        on = None
        if carried is not None and looked.now - carried.now <= latest and (last is None or kept is not None):
            on = carried.seen_from(looked.now, None if kept is None else until)
        if kept is not None and until >= enough - INSTANT and on is None and latest < np.inf:
            return _found(prepared, *kept, True, True)
        goes_round = solves is not None and share.contiguous and latest < np.inf
        again = nothing is not None and looked.now - nothing.now <= latest and looked.conflict.time < np.inf
        if goes_round and kept is None and nothing is not None and again:
            return self._once_more(share, nothing, enough, solves or 0)
        made = self._searched(share, on, kept, last, enough, solves, brief)
        self._carried = share.carried
        later = made.f_ttr is not None and made.f_ttr > until
        if made.curve is not None and made.f_ttr is not None and later:
            self._kept = KeptRepair(made.curve, made.f_ttr, looked.now, prepared.scene.frame)
            return _found(prepared, made.f_ttr, made.curve, False, share.complete, share.spent)
        if kept is not None:
            return _found(prepared, *kept, True, share.complete, share.spent)
        if made.status is not SearchStatus.NO_CONFLICT:
            self._kept = None
        if made.status is SearchStatus.NONE_FEASIBLE and goes_round and share.spent > (solves or 0):
            self._nothing = Carried(looked.now, np.inf, self.config.search.delta_t, False)
        return _found(prepared, made.f_ttr, None, False, share.complete, share.spent)

    @staticmethod
    def _searched(
        share: Share, on: Start | None, kept: tuple[float, Curve] | None, last: KeptRepair | None,
        enough: float, solves: int | None, brief: bool,
    ) -> SearchResult:  # fmt: skip
        """Where the last cycle ended, or from what is kept, or was, on; then for what has to be there."""
        until = -np.inf if kept is None else kept[0]
        start = on
        if start is None:
            due = -1.0 if last is None or kept is not None else last.due(share.now)
            start = None if kept is None else until, due if due >= 0.0 else None, None, None
        made = share.search(start, solves, enough, best=start[0])
        if share.ended and made.f_ttr is None and start[0] is None and until < enough - INSTANT:
            made = share.to_wait_on(made, enough, brief=brief)
        least = until if made.f_ttr is None else max(until, made.f_ttr)
        if on is not None and share.contiguous and share.complete and least < enough - INSTANT:
            made = share.anew(made, least, enough, solves)
        return made

    def _once_more(self, share: Share, nothing: Carried, enough: float, solves: int) -> Found:
        """After a cycle that has found nothing: the places that decide what is done now, and some others.

        A repair that can be waited for, and one that begins at once; then the search is made as far as
        ``solves`` go, by one place at least, and the next cycle goes on with it.
        """
        prepared, now, waits = share.prepared, share.now, share.first_to_wait(enough)
        places = (waits, 0.0) if waits < share.end - INSTANT else (0.0,)
        made = share.visit(*(t for t in places if t not in share.refused))
        if made.curve is not None:  # what is waited on; the round goes on: feasibility may have gaps
            carried: Carried | None = replace(nothing, now=now, above=nothing.above - (now - nothing.now))
        else:
            on = nothing.seen_from(now, None)
            over = on is None or (on[1] is not None and on[1] <= waits + INSTANT)
            made = share.search(ANEW if on is None or over else on, max(solves, share.spent + 1))
            carried = share.carried
        if made.curve is None or made.f_ttr is None:
            self._kept = None
            self._nothing = carried or Carried(now, np.inf, share.settings.delta_t, False)
            return _found(prepared, None, None, False, False, share.spent)
        self._carried = carried
        self._kept = KeptRepair(made.curve, made.f_ttr, now, prepared.scene.frame)
        return _found(prepared, made.f_ttr, made.curve, False, carried is None, share.spent)


def _found(
    prepared: Prepared, f_ttr: float | None, part: Any, kept: bool, complete: bool, solves: int = 0
) -> Found:
    curve = None if part is None or f_ttr is None else SplicedCurve(prepared.reference, part, f_ttr)
    return Found(f_ttr, curve, prepared.t_end, kept, complete, solves)
