"""The one way through the house: scene -> situation -> search -> result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.api.result import RepairResult
from repair.backend.base import RepairBackend
from repair.baselines.evasive.at_ttr import AtTtr
from repair.config.load import load_config
from repair.config.schema import Config, require_types
from repair.deadline import OutOfTime, until
from repair.errors import BackendError, ConfigError, RepairError, foreign, kind_of
from repair.metrics.base import Asked, MetricValue
from repair.metrics.registry import measure
from repair.outcome.driven import what_is_driven
from repair.outcome.known import what_is_known
from repair.preparation import Phases, Prepared, among, prepare
from repair.scene.commonroad import load_scene, with_traffic
from repair.scene.scene import Scene
from repair.search.modes import ModeResult, each_mode
from repair.search.result import Like, Probe, SearchResult, SearchStatus
from repair.search.several import capabilities_of, search_with
from repair.solvers.registry import make_backend
from repair.vehicle.commonroad_ks import load_official

if TYPE_CHECKING:
    from repair.search.settings import SearchConfig

__all__ = ["RepairResult", "find", "make", "repair", "search"]


def repair(
    scenario: Scene | str | Path,
    config: Config | None = None,
    *,
    on_probe: Callable[[Probe], None] | None = None,
    on_found: Callable[[SearchResult], None] | None = None,
    on_explaining: Callable[[str], None] | None = None,
    reference: Any = None,
    traffic: Iterable[Any] | None = None,
    threshold: float | None = None,
    **keys: Any,
) -> RepairResult:
    """Find the F-TTR and the repaired trajectory of a scenario.

    Parameters
    ----------
    scenario : Scene or path
        A loaded scene, or a CommonRoad XML file.
    config : Config, optional
        See :func:`repair.load_config`; defaults otherwise.
    on_probe, on_found, on_explaining : callable, optional
        Called after every probe (anytime use); when the search has ended, before anything is made of it: from
        then on an interrupt is the caller's; and with what an explanation looks at next, in words.
    reference : optional
        What is followed, from memory: an array (N, 3..5) with the columns ``t [s], x [m], y [m][, yaw [rad][,
        v [m/s]]]``, a mapping with these names, a CommonRoad trajectory, a curve in the scene's frame, or an
        earlier result (:func:`repair.reference.given.given_reference`); or the name of a source or a file.
    traffic : iterable, optional
        All other traffic there is, from memory, instead of the scenario's; see :func:`repair.with_traffic`.
    threshold : float, optional
        Of several predictions of one obstacle among ``traffic``, those less probable than this number are
        left out.
    **keys
        Configuration keys where no ``config`` is given: ``preset=``, ``backend=``, ``overrides=``.

    Returns
    -------
    RepairResult
        Its F-TTR is that of Algorithm 1 (Tong et al., ITSC 2024): the latest *tested* time that passed.

    Raises
    ------
    RepairError
        If the input cannot be used; its sentence says why. So is a scene that was loaded with other settings.
    """
    if config is not None and keys:
        raise RepairError("give either a config or configuration keys, not both")
    if on_probe is not None and not callable(on_probe):
        raise RepairError(f"on_probe is called with every probe; {kind_of(on_probe)} cannot be called")
    if config is None:
        config = load_config(**keys)
    elif not isinstance(config, Config):
        raise ConfigError(f"config has to come from repair.load_config, and is {kind_of(config)}")
    require_types(config)
    if threshold is not None and traffic is None:
        raise ConfigError("threshold is about the modes of traffic=, and none is given")
    backend = make(config)
    phases = Phases()
    with phases("load"):
        scene = scenario if isinstance(scenario, Scene) else load_scene(scenario, config)
    if traffic is not None:
        with phases("load"):
            scene = with_traffic(scene, traffic, threshold=0.0 if threshold is None else threshold)
    return search(
        prepare(scene, config, reference),
        backend,
        on_probe=on_probe,
        on_found=on_found,
        on_explaining=on_explaining,
        phases=phases.seconds,
    )


def make(config: Config) -> RepairBackend:
    """The backend that is asked for; whatever its factory raises is an error of the backend."""
    with foreign(f"making backend {config.backend!r}", BackendError):
        return make_backend(config.backend, config)


def search(
    prepared: Prepared,
    backend: RepairBackend,
    *,
    on_probe: Callable[[Probe], None] | None = None,
    on_found: Callable[[SearchResult], None] | None = None,
    on_explaining: Callable[[str], None] | None = None,
    phases: dict[str, float] | None = None,
) -> RepairResult:
    """Algorithm 1 on something prepared (or, with ``driver: at_ttr``, the same search at the TTR alone)."""
    timed = Phases(dict(phases or {}))
    timed.seconds.update(prepared.phases)
    asked = Asked(prepared, prepared.config.evasive)
    if prepared.config.search.time_limit is not None:
        with timed("imports"):
            load_official()
    with timed("search"):
        found = find(prepared, backend, asked=asked, on_probe=on_probe)
    if on_found is not None:
        on_found(found)
    timed.seconds["solve"] = sum(p.solve.solve_time for p in found.probes)
    timed.seconds["build"] = sum(p.solve.build_time for p in found.probes)
    timed.seconds["check"] = sum(p.check_time for p in found.probes)
    config = prepared.config
    wanted = [
        *config.metrics,
        *(["ttr"] if config.driver == "at_ttr" and "ttr" not in config.metrics and asked.evaded else []),
    ]
    metrics: dict[str, MetricValue] = {}
    if wanted:
        with timed("metrics"):
            metrics = measure(wanted, asked)
    driven = what_is_driven(prepared, found, timed)
    modes: tuple[ModeResult, ...] = ()
    if prepared.scene.modes:
        with timed("modes"):
            modes = each_mode(
                prepared.scene.modes, prepared.scene.obstacles, found,
                lambda traffic: find(among(prepared, traffic), backend),
            )  # fmt: skip
    known = what_is_known(prepared, found, timed, on_explaining)
    return RepairResult(
        prepared, known.found, driven.states, driven.peaks, timed.seconds, metrics,
        capabilities_of(backend, found), modes, known.bounds, driven.terminal, driven.onward,
        known.explanation, known.mitigation,
    )  # fmt: skip


def find(
    prepared: Prepared,
    backend: RepairBackend,
    *,
    asked: Asked | None = None,
    on_probe: Callable[[Probe], None] | None = None,
    settings: SearchConfig | None = None,
    visits: Sequence[float] | None = None,
    like: Like | None = None,
) -> SearchResult:
    """The search alone, as the configuration (or other ``settings`` of the search) describes it.

    Parameters
    ----------
    asked : Asked, optional
        Where the TTR is kept that ``driver: at_ttr`` needs.
    visits : sequence of float, optional
        The times-to-repair to try [s], instead of those of the search's rule.
    like : Like, optional
        What passed in a search that is much like this one; see :func:`repair.search.search.search_f_ttr`.

    Raises
    ------
    BackendError
        If the backend raises, or what it answers is no answer.
    """
    settings = settings or prepared.config.search
    limit = settings.time_limit
    if limit is not None:  # once in the life of a process, and no search's fault
        load_official()
    name = prepared.config.backend
    if prepared.config.driver != "at_ttr":
        return search_with(
            backend, name, prepared, settings,
            visits=visits, too_late=prepared.too_late, hopeless=prepared.hopeless, on_probe=on_probe,
            like=like,
        )  # fmt: skip
    begin = time.perf_counter()
    try:
        with until(None if limit is None else begin + limit):
            asked = asked or Asked(prepared, prepared.config.evasive)
            source = AtTtr(prepared.source, asked.evasive)
    except OutOfTime:
        spent = time.perf_counter() - begin
        return SearchResult(
            SearchStatus.BUDGET_EXHAUSTED, prepared.conflict, None, None, complete=False, wall_time=spent
        )
    if limit is not None:  # finding the TTR is part of it
        settings = replace(settings, time_limit=max(limit - (time.perf_counter() - begin), 0.0))
    return search_with(
        backend, name, prepared, settings, around=source, visits=source.visits, on_probe=on_probe
    )
