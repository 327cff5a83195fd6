"""The one way through the house: scene -> situation -> search -> result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.backend.base import Capabilities, RepairBackend
from repair.baselines.evasive.at_ttr import AtTtr
from repair.bounds.latest import Bound
from repair.check.peaks import Peaks
from repair.config.load import load_config
from repair.config.schema import Config, require_types
from repair.curves.base import Curve
from repair.deadline import OutOfTime, until
from repair.errors import BackendError, ConfigError, OutputError, RepairError, foreign, kind_of, path_of
from repair.io.commonroad import to_dynamic_obstacle, to_solution, to_trajectory
from repair.io.destination import require_folder
from repair.metrics.base import Asked, MetricValue
from repair.metrics.registry import measure
from repair.mitigation.mitigate import Mitigation
from repair.onward.plan import Onward
from repair.outcome.build import outcome_of
from repair.outcome.data import Outcome
from repair.outcome.driven import driven_curve, what_is_driven
from repair.outcome.known import what_is_known
from repair.preparation import Phases, Prepared, among, prepare
from repair.report.notebook import page_of
from repair.report.style import FigureStyle
from repair.report.text import headline
from repair.save import Saved, saved
from repair.scene.commonroad import load_scene, with_traffic
from repair.scene.scene import Scene
from repair.search.modes import ModeResult, each_mode
from repair.search.result import Probe, SearchResult, SearchStatus
from repair.search.several import capabilities_of, search_with
from repair.solvers.registry import make_backend
from repair.terminal.verdict import Terminal
from repair.vehicle.commonroad_ks import load_official
from repair.vehicle.states import DrivenStates
from repair.why.explain import Explanation

if TYPE_CHECKING:
    from repair.search.settings import SearchConfig

__all__ = ["RepairResult", "find", "make", "repair", "search"]


@dataclass(frozen=True, repr=False)
class RepairResult:
    """A repair, with all that is needed to use it or to look at it.

    Attributes
    ----------
    prepared : Prepared
        Scene, reference, conflict, limits.
    search : SearchResult
    states : DrivenStates
        Vehicle states at the scenario's steps: the reference, repaired from ``f_ttr`` on.
    peaks : Peaks or None
        Extremes of the repaired part; None without a repair.
    phases : dict
        Wall time by phase [s].
    metrics : dict
        The metrics that were asked for (``metrics: [ttr, ...]``), by name; with ``driver: at_ttr`` also
        the TTR.
    modes : tuple of ModeResult
        What each mode alone would allow, of obstacles that were given several predictions.
    capabilities : Capabilities
        Of the backend, or of the one of several whose repair it is.
    bounds : dict
        From when on it is proven too late, by kind; empty where it was not asked for (``bound.wanted``).
    terminal : Terminal or None
        How the repair ends: the stop that follows it, and how safe that is; None without a repair, and with
        ``checker.terminal: off``.
    onward : Onward or None
        What is driven after the evasive part (``repair.goal``, ``repair.rejoin``); None where nobody asked.
    explanation : Explanation or None
        Why there is no repair, or no later one (``explain.wanted``).
    mitigation : Mitigation or None
        What hits least hard, where nothing was found and ``mitigation.wanted``.
    """

    prepared: Prepared
    search: SearchResult
    states: DrivenStates
    peaks: Peaks | None
    phases: dict[str, float]
    metrics: dict[str, MetricValue] = field(default_factory=dict)
    capabilities: Capabilities = field(default_factory=Capabilities)
    modes: tuple[ModeResult, ...] = ()
    bounds: dict[str, Bound] = field(default_factory=dict)
    terminal: Terminal | None = None
    onward: Onward | None = None
    explanation: Explanation | None = None
    mitigation: Mitigation | None = None

    def __repr__(self) -> str:
        return "\n".join(f"{name:9} {text}" for name, text in headline(self.to_dict()))

    def _repr_html_(self) -> str:
        """The same with the view from above, for notebooks."""
        return page_of(self.outcome)

    @property
    def status(self) -> SearchStatus:
        """How the search ended."""
        return self.search.status

    @property
    def ttc(self) -> float:
        """Time-To-Collision [s], inf without a conflict."""
        return self.search.conflict.time

    @property
    def f_ttr(self) -> float | None:
        """Feasible Time-To-React [s]; inf without a conflict, None where nothing was verified."""
        return self.search.f_ttr

    @property
    def ttr(self) -> float | None:
        """TTR by fixed evasive manoeuvres [s] (-inf: none helps); None where it was not asked for."""
        return self.metrics["ttr"].value if "ttr" in self.metrics else None

    @property
    def curve(self) -> Curve:
        """What is driven then, in the Frenet frame; the reference where there is no repair."""
        return driven_curve(self.prepared, self.search, self.onward)

    @property
    def trajectory(self) -> Any:
        """What is driven then, as a ``commonroad.scenario.trajectory.Trajectory`` of KS states."""
        return to_trajectory(self.prepared.scene, self.states)

    @cached_property
    def outcome(self) -> Outcome:
        """The pure data of it, which figures and tables are made from."""
        return outcome_of(
            self.prepared, self.search, self.states, self.peaks, self.phases, self.metrics, self.capabilities,
            self.modes, self.bounds, self.terminal, self.onward, self.explanation, self.mitigation,
        )  # fmt: skip

    def to_dynamic_obstacle(self, obstacle_id: int | None = None) -> Any:
        """The ego as a ``commonroad.scenario.obstacle.DynamicObstacle`` (``obstacle_id``, or a free id)."""
        return to_dynamic_obstacle(self.prepared.scene, self.states, obstacle_id)

    def to_solution(self) -> Any:
        """The trajectory as a ``commonroad.common.solution.Solution``."""
        return to_solution(self.prepared.scene, self.states, self.status)

    def to_dict(self) -> dict[str, Any]:
        """The content of ``result.json``."""
        return self.outcome.record

    def saved(self, folder: str | Path, *, figure: bool | FigureStyle = True) -> tuple[Outcome, list[Path]]:
        """As :meth:`save` (``folder``, ``figure``): the outcome with the files' names, and their paths."""
        target = path_of(folder, "the folder of a result", OutputError)
        require_folder(target)
        outcome, scene = self.outcome, self.prepared.scene
        made = Saved(outcome, scene, self.states, self.status, figure, self.bounds, self.mitigation)
        return saved(made, target)

    def save(self, folder: str | Path, *, figure: bool | FigureStyle = True) -> list[Path]:
        """Write ``result.json``, solution file, figures (``figure``: whether, and how) into ``folder``.

        Raises
        ------
        OutputError
            If that is no folder, or cannot be written to.
        """
        return self.saved(folder, figure=figure)[1]


def repair(
    scenario: Scene | str | Path,
    config: Config | None = None,
    *,
    on_probe: Callable[[Probe], None] | None = None,
    on_found: Callable[[SearchResult], None] | None = None,
    on_explaining: Callable[[str], None] | None = None,
    reference: Any = None,
    traffic: Iterable[Any] | None = None,
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
    backend = make(config)
    phases = Phases()
    with phases("load"):
        scene = scenario if isinstance(scenario, Scene) else load_scene(scenario, config)
    if traffic is not None:
        with phases("load"):
            scene = with_traffic(scene, traffic)
    if isinstance(reference, RepairResult):
        reference = reference.states
    elif isinstance(reference, Outcome):
        reference = reference.driven()
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
) -> SearchResult:
    """The search alone, as the configuration (or other ``settings`` of the search) describes it.

    Parameters
    ----------
    asked : Asked, optional
        Where the TTR is kept that ``driver: at_ttr`` needs.
    visits : sequence of float, optional
        The times-to-repair to try [s], instead of those of the search's rule.

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
