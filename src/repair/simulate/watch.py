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
from repair.search.result import SearchStatus
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
    """

    f_ttr: float | None
    curve: Curve | None
    until: float
    kept: bool
    complete: bool


class Watch(Repairer):
    """The same road, backend and kept repairs as those of a :class:`repair.Repairer`, asked along curves.

    The curves are in the frame of its scene, which stays: nothing is fitted on the way from one cycle to the
    next, and one look serves several searches.
    """

    _edged: Checker | None = None

    def twin(self) -> Watch:
        """Another one for the same road, with what is laid out of it and nothing of what was found."""
        made = copy(self)
        made.reset()
        return made

    def look(self, curve: Curve, *, traffic: Traffic, ego: InitialState, now: float = 0.0) -> Looked:
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
        """
        prepared, settings, begin = looked.prepared, self.config.search, time.perf_counter()
        if limit is not None:
            settings = replace(settings, time_limit=min(limit, settings.time_limit or limit))
        if visits is not None:
            made = find(prepared, self._backend, settings=settings, visits=visits)
            return _found(prepared, made.f_ttr, made.curve, False, made.complete)
        last = self._kept
        kept = None if last is None else verified_again(last, prepared, looked.now)
        if kept is not None and enough is not None and kept[0] >= enough - INSTANT:
            return _found(prepared, *kept, True, True)
        if limit is not None:
            left = max(limit - (time.perf_counter() - begin), 1e-6)
            settings = replace(settings, time_limit=left)
        guess = last.due(looked.now) if last is not None and kept is None else None
        made = searched(
            prepared, self._backend, settings, None if kept is None else kept[0],
            guess if guess is not None and guess >= 0.0 else None,
        )  # fmt: skip
        if made.curve is not None and made.f_ttr is not None:
            self._kept = KeptRepair(made.curve, made.f_ttr, looked.now, prepared.scene.frame)
            return _found(prepared, made.f_ttr, made.curve, False, made.complete)
        if kept is not None:
            return _found(prepared, *kept, True, made.complete)
        if made.status is not SearchStatus.NO_CONFLICT:
            self._kept = None
        return _found(prepared, made.f_ttr, None, False, made.complete)


def _found(prepared: Prepared, f_ttr: float | None, part: Any, kept: bool, complete: bool) -> Found:
    curve = None if part is None or f_ttr is None else SplicedCurve(prepared.reference, part, f_ttr)
    return Found(f_ttr, curve, prepared.t_end, kept, complete)
