"""The one way through the house: scene -> reference -> conflict -> search -> result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.check.peaks import Peaks
from repair.config import Config, load_config
from repair.curves.base import Curve, SplicedCurve
from repair.errors import RepairError
from repair.prepare import Phases, prepare
from repair.search.result import Probe, SearchResult, SearchStatus
from repair.search.search import search_f_ttr
from repair.situation import Prepared
from repair.solvers.registry import make_backend
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["RepairResult", "repair"]


@dataclass(frozen=True)
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
    ttr : float or None
        TTR by fixed evasive manoeuvres [s] with ``driver: at_ttr`` (-inf: none helps); else None.
    """

    prepared: Prepared
    search: SearchResult
    states: DrivenStates
    peaks: Peaks | None
    phases: dict[str, float]
    ttr: float | None = None

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
    def curve(self) -> Curve:
        """What is driven then, in the Frenet frame; the reference where there is no repair."""
        if self.search.curve is None:
            return self.prepared.reference
        return SplicedCurve(self.prepared.reference, self.search.curve, float(self.search.f_ttr or 0.0))

    @property
    def trajectory(self) -> Any:
        """What is driven then, as a ``commonroad.scenario.trajectory.Trajectory`` of KS states."""
        from repair.io.commonroad import to_trajectory

        return to_trajectory(self)

    def to_dynamic_obstacle(self, obstacle_id: int | None = None) -> Any:
        """The ego as a ``commonroad.scenario.obstacle.DynamicObstacle``, to add to a scenario."""
        from repair.io.commonroad import to_dynamic_obstacle

        return to_dynamic_obstacle(self, obstacle_id)

    def to_solution(self) -> Any:
        """The trajectory as a ``commonroad.common.solution.Solution``."""
        from repair.io.commonroad import to_solution

        return to_solution(self)

    def to_dict(self) -> dict[str, Any]:
        """The content of ``result.json``."""
        from repair.io.result_json import to_dict

        return to_dict(self)

    def save(self, folder: str | Path, *, figure: bool = True) -> list[Path]:
        """Write ``result.json``, the solution file and the figure into ``folder``."""
        from repair.save import save

        return save(self, Path(folder), figure=figure)


def repair(
    scenario: Scene | str | Path,
    config: Config | None = None,
    *,
    on_probe: Callable[[Probe], None] | None = None,
    **keys: Any,
) -> RepairResult:
    """Find the F-TTR and the repaired trajectory of a scenario.

    Parameters
    ----------
    scenario : Scene or path
        A loaded scene, or a CommonRoad XML file.
    config : Config, optional
        See :func:`repair.load_config`; defaults otherwise.
    on_probe : callable, optional
        Called after every probe (anytime use).
    **keys
        Configuration keys where no ``config`` is given: ``preset=``, ``backend=``, ``overrides=``.

    Raises
    ------
    RepairError
        If the input cannot be used; its sentence says why.
    """
    if config is not None and keys:
        raise RepairError("give either a config or configuration keys, not both")
    config = config or load_config(**keys)
    backend = make_backend(config.backend, config)
    phases = Phases()
    with phases("load"):
        scene = _scene(scenario, config)
    prepared = prepare(scene, config)
    return search(prepared, backend, on_probe=on_probe, phases=phases.seconds)


def search(
    prepared: Prepared, backend: Any, *, on_probe: Any = None, phases: dict[str, float] | None = None
) -> RepairResult:
    """Algorithm 1 on something prepared (or, with ``driver: at_ttr``, one repair at the TTR)."""
    timed = Phases(dict(phases or {}))
    timed.seconds.update(prepared.phases)
    ttr: float | None = None
    with timed("search"):
        if prepared.config.driver == "at_ttr":
            from repair.baselines.evasive.problems import repair_at_ttr

            answer = repair_at_ttr(prepared, backend, on_probe=on_probe)
            found, ttr = answer.search, answer.ttr
        else:
            found = search_f_ttr(
                prepared.source, prepared.conflict, backend, prepared.checker, prepared.config.search,
                on_probe=on_probe,
            )  # fmt: skip
    timed.seconds["solve"] = sum(p.solve.solve_time for p in found.probes)
    timed.seconds["build"] = sum(p.solve.build_time for p in found.probes)
    timed.seconds["check"] = sum(p.check_time for p in found.probes)
    curve, t_end, reached = prepared.reference, prepared.t_reference, None
    if found.curve is not None:
        t_rep = float(found.f_ttr or 0.0)
        curve, t_end = SplicedCurve(prepared.reference, found.curve, t_rep), prepared.t_end
        reached = prepared.checker.peaks(curve, t_end, t_rep)
    states = prepared.checker.drive(curve, t_end).every(prepared.config.checker.substeps)
    return RepairResult(prepared, found, states, reached, timed.seconds, ttr)


def _scene(scenario: Any, config: Config) -> Scene:
    from repair.scene.commonroad import load_scene
    from repair.scene.scene import Scene

    if isinstance(scenario, Scene):
        return scenario
    return load_scene(
        scenario,
        planning_problem=config.scene.planning_problem,
        vehicle=config.scene.vehicle,
        horizon=config.scene.horizon,
        after_prediction=config.scene.after_prediction,
    )
