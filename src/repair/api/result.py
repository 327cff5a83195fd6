"""A repair, with all that is needed to use it or to look at it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from repair.backend.base import Capabilities
from repair.bounds.latest import Bound
from repair.check.peaks import Peaks
from repair.curves.base import Curve
from repair.errors import OutputError, kind_of, path_of
from repair.io.commonroad import to_dynamic_obstacle, to_solution, to_trajectory
from repair.io.destination import require_folder
from repair.io.trace.considered import considered
from repair.metrics.base import MetricValue
from repair.mitigation.mitigate import Mitigation
from repair.onward.plan import Onward
from repair.outcome.build import outcome_of
from repair.outcome.data import Outcome
from repair.outcome.driven import driven_curve
from repair.preparation import Prepared
from repair.report.notebook import page_of
from repair.report.style import FigureStyle
from repair.report.text import headline
from repair.save import Saved, saved
from repair.search.modes import ModeResult
from repair.search.result import SearchResult, SearchStatus
from repair.terminal.verdict import Terminal
from repair.vehicle.states import DrivenStates
from repair.why.explain import Explanation

__all__ = ["RepairResult"]


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

    def saved(
        self, folder: str | Path, *, figure: bool | FigureStyle = True, trace: bool = False
    ) -> tuple[Outcome, list[Path]]:
        """As :meth:`save`: the outcome with the files' names, and their paths.

        Parameters
        ----------
        folder, figure, trace
            As there.

        Returns
        -------
        Outcome
            Its record names the files.
        list of Path
            ``result.json`` first.

        Raises
        ------
        OutputError
            As there.
        """
        target = path_of(folder, "the folder of a result", OutputError)
        if not isinstance(figure, bool | FigureStyle):
            raise OutputError(f"figure is True, False or a FigureStyle, not {kind_of(figure)}")
        require_folder(target)
        outcome, scene = self.outcome, self.prepared.scene
        looked_at = None
        if trace:
            looked_at = considered(self.prepared, self.search, self.terminal, self.mitigation)
        made = Saved(
            outcome, scene, self.states, self.status, figure, self.bounds, self.mitigation, looked_at
        )
        return saved(made, target)

    def save(
        self, folder: str | Path, *, figure: bool | FigureStyle = True, trace: bool = False
    ) -> list[Path]:
        """Write ``result.json``, solution file and figures.

        Parameters
        ----------
        folder : path
            Made where it is not there.
        figure : bool or FigureStyle
            Whether figures and the page are written, and how.
        trace : bool
            Whether drawtonomy's planning trace and verdict are written too.

        Returns
        -------
        list of Path
            What was written, ``result.json`` first.

        Raises
        ------
        OutputError
            If that is no folder, or cannot be written to.
        """
        return self.saved(folder, figure=figure, trace=trace)[1]
