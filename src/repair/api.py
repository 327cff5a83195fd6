"""The one way through the house: scene -> reference -> conflict -> search -> result."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.checker import Checker, SplicedCurve
from repair.config import Config, load_config
from repair.errors import ConfigError, RepairError
from repair.kinematics import DrivenStates
from repair.metrics import Peaks
from repair.occupancy import build_occupancy, first_entry, shrink_to_start
from repair.problems import ProblemFactory, resolve_limits
from repair.reference import known_until, make_reference, recorded_positions
from repair.scene.reframe import as_ego, reframe
from repair.search import search_f_ttr
from repair.solvers.registry import make_backend
from repair.types import Conflict, Curve, Limits, Occupancy, Probe, SearchResult, SearchStatus, Verdict

if TYPE_CHECKING:
    from repair.scene.commonroad import Scene

__all__ = ["Prepared", "RepairResult", "detect_conflict", "prepare", "repair"]

# Wider than a rounding error, narrower than anything that matters: what is kept by default beyond
# half of the vehicle, because a box in (s, l) is not the vehicle's rectangle.
_BODY_MARGIN = 0.1


@dataclass
class _Phases:
    """Wall time by phase [s]."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str):  # type: ignore[no-untyped-def]
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin


@dataclass(frozen=True)
class Prepared:
    """Everything that is the same for every backend: made once, searched many times.

    Attributes
    ----------
    t_reference : float
        Until when the reference is followed and judged [s].
    t_end : float
        End of the repairs [s].
    """

    scene: Scene
    config: Config
    limits: Limits
    occupancy: Occupancy
    reference: Curve
    checker: Checker
    conflict: Conflict
    t_reference: float
    t_end: float
    notes: tuple[str, ...]
    phases: dict[str, float]

    @cached_property
    def source(self) -> ProblemFactory:
        """The repair problems of any t_rep."""
        return ProblemFactory(
            self.scene, self.config, self.limits, self.occupancy, self.reference, self.t_end
        )


def detect_conflict(
    reference: Curve, occupancy: Occupancy, checker: Checker, t_end: float
) -> tuple[Conflict, Verdict]:
    """TTC: the first violation of any kind on the reference, at the scenario's steps.

    Returns
    -------
    Conflict
        The paper's TTC (inflated occupancy entered), or an earlier contact, end of the road, or
        kinematic impossibility; with the contact TTC by true rectangles beside it.
    Verdict
        The checker's whole verdict on the reference.
    """
    dt = checker.scene.dt
    steps = min(int(np.floor(t_end / dt + 1e-6)), checker.scene.n_steps)
    sampled = reference.sample(np.arange(steps + 1) * dt)
    entry = first_entry(occupancy, sampled)
    verdict = checker.check_reference(reference, t_end)
    contact = checker.contact(reference, t_end)
    candidates: list[tuple[float, int, str, int | None]] = []
    if entry is not None:
        candidates.append((float(sampled.t[entry[0]]), 0, "margin", int(occupancy.ids[entry[1]])))
    for violation in verdict.violations:
        at = float(np.floor(violation.time / dt + 1e-6) * dt)
        who = contact.obstacle_id if contact is not None and violation.reason.value == "collision" else None
        candidates.append((at, 1, violation.reason.value, who))
    touched = (contact.time, contact.obstacle_id, contact.from_behind) if contact is not None else None
    if not candidates:
        return Conflict(float("inf")), verdict
    first = min(candidates, key=lambda c: c[:2])
    return (
        Conflict(
            time=first[0],
            kind=first[2],
            obstacle_id=first[3],
            contact_time=touched[0] if touched else float("inf"),
            contact_id=touched[1] if touched else None,
            from_behind=bool(touched and touched[2]),
        ),
        verdict,
    )


def prepare(scene: Scene, config: Config) -> Prepared:
    """Occupancy, reference, checker and conflict of a scene.

    Raises
    ------
    RepairError
        If no reference can be had.
    """
    phases = _Phases()
    if config.reference.source in ("recorded", "file"):
        positions, _ = recorded_positions(scene, config.reference)
        scene = reframe(scene, positions[: known_until(positions)])
        if config.reference.source == "recorded" and config.reference.obstacle_id is not None:
            scene = as_ego(scene, config.reference.obstacle_id)
    vehicle = scene.vehicle
    s_offset, l_offset = config.scene.s_offset, config.scene.l_offset
    s_offset = 0.5 * vehicle.length + _BODY_MARGIN if s_offset is None else s_offset
    l_offset = 0.5 * vehicle.width + _BODY_MARGIN if l_offset is None else l_offset
    with phases("occupancy"):
        occupancy, notes = build_occupancy(scene.obstacles, scene.frame, scene.dt, s_offset, l_offset)
    limits = resolve_limits(config.limits, vehicle, float(scene.start[1, 0]), scene.dt)
    with phases("checker"):
        checker = Checker(scene, limits, config.checker)
        touching = checker.touching_at_start()
    occupancy, more = shrink_to_start(occupancy, scene.start[0], touching)
    with phases("reference"):
        reference = make_reference(scene, config.reference, occupancy)
    t_reference = min(scene.horizon, reference.t_end)
    with phases("conflict"):
        conflict, _ = detect_conflict(reference, occupancy, checker, t_reference)
    wanted = config.repair.horizon
    if wanted is None:
        wanted = conflict.time + config.repair.after_conflict
    elif np.isfinite(conflict.time) and wanted <= conflict.time:
        raise ConfigError(
            f"repair.horizon is {wanted:g} s, but the conflict is at {conflict.time:g} s: "
            "a repair has to reach beyond it"
        )
    t_end = min(wanted, t_reference)
    t_end = max(np.floor(t_end / scene.dt + 1e-6) * scene.dt, min(scene.dt, t_reference))
    return Prepared(
        scene, config, limits, occupancy, reference, checker, conflict, t_reference, float(t_end),
        (*scene.notes, *notes, *more), phases.seconds,
    )  # fmt: skip


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
        from repair.export import to_trajectory

        return to_trajectory(self)

    def to_dynamic_obstacle(self, obstacle_id: int | None = None) -> Any:
        """The ego as a ``commonroad.scenario.obstacle.DynamicObstacle``, to add to a scenario."""
        from repair.export import to_dynamic_obstacle

        return to_dynamic_obstacle(self, obstacle_id)

    def to_solution(self) -> Any:
        """The trajectory as a ``commonroad.common.solution.Solution``."""
        from repair.export import to_solution

        return to_solution(self)

    def to_dict(self) -> dict[str, Any]:
        """The content of ``result.json``."""
        from repair.export import to_dict

        return to_dict(self)

    def save(self, folder: str | Path, *, figure: bool = True) -> list[Path]:
        """Write ``result.json``, the solution file and the figure into ``folder``."""
        from repair.export import save

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
    phases = _Phases()
    with phases("load"):
        scene = _scene(scenario, config)
    prepared = prepare(scene, config)
    return search(prepared, backend, on_probe=on_probe, phases=phases.seconds)


def search(
    prepared: Prepared, backend: Any, *, on_probe: Any = None, phases: dict[str, float] | None = None
) -> RepairResult:
    """Algorithm 1 on something prepared (or, with ``driver: at_ttr``, one repair at the TTR)."""
    timed = _Phases(dict(phases or {}))
    timed.seconds.update(prepared.phases)
    ttr: float | None = None
    with timed("search"):
        if prepared.config.driver == "at_ttr":
            from repair.baselines.at_ttr import repair_at_ttr

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
    from repair.scene.commonroad import Scene, load_scene

    if isinstance(scenario, Scene):
        return scenario
    return load_scene(
        scenario,
        planning_problem=config.scene.planning_problem,
        vehicle=config.scene.vehicle,
        horizon=config.scene.horizon,
        after_prediction=config.scene.after_prediction,
    )
