"""A repair every cycle: the road is laid out once, and only what has changed is laid out again.

>>> watch = repair.Repairer("DEU_Flensburg-6_1_T-1.xml", backend="ego")          # doctest: +SKIP
>>> cycle = watch.update(plan, now=0.3, deadline=0.02)                            # doctest: +SKIP
>>> cycle.f_ttr, cycle.complete                                                   # doctest: +SKIP
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from repair.api import find
from repair.arrays import Array
from repair.check.checker import Checker
from repair.check.verdict import Conflict
from repair.config.agreed import agreed_with
from repair.config.schema import Config
from repair.curves.base import Curve, SplicedCurve, is_curve
from repair.cycle.asked import Asked, Others, require_deadline, since, spare, step_of
from repair.cycle.cycle import Cycle
from repair.cycle.ego import ego_of
from repair.cycle.kept import KeptRepair, hints, verified_again
from repair.cycle.paced import LEAST, Pace, Paced
from repair.cycle.ready import configured, made_ready, not_asked
from repair.cycle.scenery import fits, in_frame, scene_now, scene_of
from repair.cycle.searching import Unproven, searched
from repair.deadline import OutOfTime, until
from repair.errors import ConfigError, ReferenceTrajectoryError, kind_of
from repair.preparation import Prepared, among, laid_out
from repair.reference.given import GivenReference, given_reference, what_drives
from repair.scene.commonroad import moved_on
from repair.scene.reframe import lanes_at, reframe
from repair.scene.road.lanes import Lane
from repair.scene.road.passes import passes
from repair.scene.scene import Scene
from repair.search.modes import ModeResult, each_mode
from repair.search.result import SearchResult, SearchStatus
from repair.search.settings import SearchConfig
from repair.timegrid import INSTANT

__all__ = ["Cycle", "Repairer"]

_AHEAD = 20.0  # so much of the frame has to be left beyond the plan [m]


class Repairer:
    """Built once for a road, asked every cycle.

    What it keeps is its own: several of them, in several threads, do not meet. It can be pickled.

    Parameters
    ----------
    road : Scene, path, or CommonRoad scenario
        Where it is driven, with a planning problem: its goal says which way the road goes on.
    config : Config, optional
        See :func:`repair.load_config`; ``reference`` in it is not looked at. What it wants beside the search
        (metrics, bound, explanation, mitigation, the way on) belongs to no cycle, and a note says so.
    planning_problem : optional
        With a CommonRoad scenario: the planning problem.
    **keys
        Configuration keys where no ``config`` is given: ``preset=``, ``backend=``, ``overrides=``.

    Raises
    ------
    RepairError
        If road or configuration cannot be used, or a scene was loaded with other settings.
    """

    def __init__(
        self, road: Any, config: Config | None = None, *, planning_problem: Any = None, **keys: Any
    ) -> None:
        config = configured(config, keys)
        self.scene = scene_of(road, planning_problem, config)
        config = agreed_with(config, self.scene)
        source = replace(config, reference=replace(config.reference, source="given"))
        source.given = config.given - {"reference.source"}
        self.config = source
        self._first = self.scene
        self._start_with(source)

    def _start_with(self, config: Config) -> None:
        """What is made on the way."""
        self._notes = not_asked(config)
        self._lanes: Mapping[int, Lane] | None = None
        self._backend = made_ready(config)
        self._paces: dict[str, Pace] = {}
        self._framed: Scene | None = None
        self._room = 0.0
        self._checker: Checker | None = None
        self._kept: KeptRepair | None = None

    def __getstate__(self) -> dict[str, Any]:
        """All but what is made again: the solver's structures, the checker, and how fast this machine is."""
        kept = ("config", "scene", "_first", "_framed", "_room", "_kept")
        return {name: self.__dict__[name] for name in kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._start_with(state["config"])
        self.__dict__.update(state)

    def reset(self) -> None:
        """Forget what was found: the next cycle is a first one."""
        self._kept = None

    def modes(self, cycle: Cycle) -> tuple[ModeResult, ...]:
        """What each mode alone would allow, of obstacles that were given several predictions.

        A search for each of them, without a deadline: no part of the cycle.

        Parameters
        ----------
        cycle : Cycle
            An answer of this Repairer.

        Returns
        -------
        tuple of ModeResult
            None is below the F-TTR of the cycle, which serves all of them; empty where nobody has several.

        Raises
        ------
        ConfigError
            If that is no cycle.
        """
        if not isinstance(cycle, Cycle):
            raise ConfigError(f"modes are those of a cycle that update has answered, not of {kind_of(cycle)}")
        if cycle.prepared is None:
            return ()
        prepared = cycle.prepared
        found = replace(cycle.search, status=cycle.status, f_ttr=cycle.f_ttr)
        return each_mode(
            prepared.scene.modes, prepared.scene.obstacles, found,
            lambda traffic: find(among(prepared, traffic), self._backend, settings=self.config.search),
        )  # fmt: skip

    def warm(self, reference: Any, *, traffic: Iterable[Any] | None = None, ego: Any = None) -> None:
        """Ask what the first cycles will ask, without a deadline, and forget the answers.

        From then on what is imported late, the frame and the solver's structures for such plans are there,
        and how long the parts of a cycle take is known. Without it the first cycles with a deadline may be
        late by what that takes.

        Parameters
        ----------
        reference, traffic, ego
            As in :meth:`update`.

        Raises
        ------
        RepairError
            If something cannot be used.
        """
        traffic = None if traffic is None else list(traffic)
        for _ in range(LEAST):
            self.reset()
            self.update(reference, traffic=traffic, ego=ego)
        self.reset()

    def update(
        self,
        reference: Any,
        *,
        traffic: Iterable[Any] | None = None,
        ego: Any = None,
        now: float = 0.0,
        deadline: float | None = None,
        threshold: float | None = None,
    ) -> Cycle:
        """Repair the plan of this cycle.

        Parameters
        ----------
        reference : (N, 3) to (N, 5) array, mapping, trajectory or result
            The plan (``t`` [s], ``x, y`` [m], ``yaw`` [rad], ``v`` [m/s]) from ``now`` on, its times
            beginning with 0; see :func:`repair.reference.given.given_reference`. Curves are not taken, as
            the frame may change.
        traffic : iterable, optional
            All others, from ``now`` on: CommonRoad obstacles (their time steps being those of the scenario),
            or :class:`repair.Prediction`. By default the scenario's own traffic.
        ego : InitialState, mapping or CommonRoad state, optional
            The ego's state now: ``x, y`` [m], ``yaw`` [rad], ``v`` [m/s], if known ``a`` [m/s²] and
            ``yaw_rate`` [rad/s]. By default where the plan begins.
        now : float
            [s] since the planning problem's start; a multiple of the scenario's step.
        deadline : float, optional
            The answer is there within so many seconds [s] from the call on: the best that was verified by
            then, in this cycle or an earlier one.
        threshold : float, optional
            Of several predictions with one id, its modes, those less probable than this number are left
            out; 0 by default. With ``traffic`` only.

        Returns
        -------
        Cycle

        Raises
        ------
        RepairError
            If something cannot be used; what was kept stays as it was.
        """
        begin = time.perf_counter()
        require_deadline(deadline)
        others = Others.of(traffic, threshold)
        reference = what_drives(reference)
        if reference is None:
            raise ReferenceTrajectoryError(
                "a plan is needed, and None is none; a cycle that had no time has none either"
            )
        if is_curve(reference):
            raise ReferenceTrajectoryError("a Repairer takes places on the plane, and not a curve in a frame")
        at = None if deadline is None else begin + deadline - spare(deadline)
        asked = Asked(now, step_of(now, self.scene.dt), begin, at, Paced(paces=self._paces))
        try:
            prepared = self._prepared(reference, others, ego, asked)
        except OutOfTime:
            conflict = Conflict(np.nan, contact_time=np.nan, exact_time=np.nan)
            nothing = SearchResult(SearchStatus.BUDGET_EXHAUSTED, conflict, None, None, complete=False)
            return Cycle(now, None, nothing, None, None, False, False, asked.told, since(begin))
        return self._answered(prepared, asked)

    # -- parts of a cycle --------------------------------------------------------------------------------

    def _prepared(self, reference: Any, others: Others, ego: Any, asked: Asked) -> Prepared:
        """The plan among the traffic, and until when it can be followed."""
        phases = asked.phases
        with until(asked.at):
            with phases("plan"):
                state = ego_of(ego, reference, self.scene)
            with phases("traffic"):
                scene = scene_now(
                    self.scene, self._first, asked.step, state, others.traffic, others.threshold
                )
                scene = replace(scene, notes=(*scene.notes, *self._notes))
            with phases("given"):
                given = given_reference(reference, scene)
        before = self._framed
        scene, given, checker = self._frame(scene, given, asked.rebuilt)
        # A frame is laid out once for many cycles, whatever the deadline, and so is the road's edge along it.
        with until(asked.at if self._framed is before else None):
            prepared = laid_out(scene, self.config, given, phases, like=checker, within_reach=True)
        self._checker = prepared.checker
        return prepared

    def _answered(self, prepared: Prepared, asked: Asked) -> Cycle:
        """What was kept, if it still holds, and what is found beside it."""
        phases, held = asked.phases, list[tuple[float, Curve] | None]()
        found = SearchResult(
            SearchStatus.BUDGET_EXHAUSTED, prepared.conflict, None, None, complete=False, wall_time=0.0
        )
        last = self._kept

        def verify() -> bool:
            if not held and last is not None:
                with phases("kept"):
                    held.append(verified_again(last, prepared, asked.now))
            return bool(held) and held[0] is not None

        with suppress(OutOfTime), until(asked.at):
            unproven = None if last is None else Unproven(max(last.due(asked.now), 0.0), verify)
            if unproven is not None and asked.at is not None:  # what there is already comes first
                unproven.asked()
            if np.isfinite(prepared.conflict.time):
                with phases("occupancy"):
                    prepared.boxes.occupancy  # noqa: B018 - to be known by that name in the times
                with phases("problem"):
                    self._source(prepared)
            guess, like = hints(last, asked.now, self.config.search.delta_t)
            found = searched(
                prepared, self._backend, self._limited(asked), unproven, guess, thorough=True, like=like
            )
        # Who was cut short judged for as long as there was time, or not at all.
        pace = self._paces.setdefault("judging", Pace())
        if judged := [probe.check_time for probe in found.probes if probe.solve.curve is not None]:
            pace.took(max(judged))
        elif not found.complete:
            pace.left_out()
        return self._answer(prepared, found, held[0] if held else None, held == [None], asked)

    def _source(self, prepared: Prepared) -> Any:
        return prepared.unguided if self._backend.capabilities.own_way else prepared.source

    def _limited(self, asked: Asked) -> SearchConfig:
        settings = self.config.search
        if asked.at is None:
            return settings
        # What is solved in time is judged after it, and that takes as long as it takes.
        left = asked.at - time.perf_counter() - self._paces.setdefault("judging", Pace()).expected
        if left <= 0.0:
            raise OutOfTime
        return replace(settings, time_limit=min(left, settings.time_limit or left))

    def _frame(
        self, scene: Scene, given: GivenReference, rebuilt: list[str]
    ) -> tuple[Scene, GivenReference, Checker | None]:
        """The scene in a frame along the plan: the kept one where the plan is on its path, else a new one."""
        positions, body = given.positions, scene.initial_state.orientation
        assert positions is not None
        if (kept := self._framed) is not None:
            places = kept.frame.to_frenet(positions)
            if fits(places, kept.frame, self._room, None if kept.frame is scene.frame else body):
                if len(passes(kept.frame)) == 1:  # else where it is there depends on the way
                    given = replace(given, places=(kept.frame, places))
                return in_frame(kept, scene, places[0], given.heading), given, self._checker
            rebuilt.append("frame: the plan leaves the path of the last one")
        if not self._within(positions):
            self.scene = moved_on(self._first, scene.initial_state)
            self._lanes = None
            rebuilt.append("road: the plan leaves the one that was laid out")
            scene = replace(
                scene, frame=self.scene.frame, route_lanelets=self.scene.route_lanelets,
                lane=self.scene.lane, same_direction=self.scene.same_direction, road=self.scene.road,
            )  # fmt: skip
        self._lanes = self._lanes or lanes_at(scene)
        made = reframe(scene, positions, given.heading, self._lanes)
        self._room = min(_AHEAD, made.frame.length - float(made.frame.to_frenet(positions[-1:])[0, 0]))
        self._framed, self._kept = made, None
        return made, given, self._checker

    def _within(self, positions: Array) -> bool:
        """Whether the plan ends near the road that is laid out, and not at its end."""
        place = self.scene.frame.to_frenet(positions[-1:])[0]
        return bool(np.isfinite(place).all() and place[0] < self.scene.frame.length - _AHEAD)

    def _answer(
        self, prepared: Prepared, found: SearchResult, kept: tuple[float, Curve] | None, refuted: bool,
        asked: Asked,
    ) -> Cycle:  # fmt: skip
        f_ttr, part = found.f_ttr, found.curve
        conflicting = found.status not in (SearchStatus.NO_CONFLICT, SearchStatus.ALREADY_COLLIDING)
        is_kept = kept is not None and conflicting and (f_ttr is None or kept[0] > f_ttr + INSTANT)
        if is_kept and kept is not None:
            f_ttr, part = kept
        curve: Curve = prepared.reference
        if part is not None and f_ttr is not None:
            curve = SplicedCurve(prepared.reference, part, f_ttr)
            new = KeptRepair(part, f_ttr, asked.now, prepared.scene.frame, found.best)
            self._kept = (self._kept if is_kept and self._kept else new).beside(found, asked.now, self._kept)
        elif refuted and found.status is not SearchStatus.NO_CONFLICT:
            self._kept = None
        return Cycle(
            asked.now, prepared, found, f_ttr, curve, is_kept, found.complete, asked.told,
            since(asked.begin),
        )  # fmt: skip
