"""The repair problems at the TTR: around the manoeuvre that gave it, then the other open sides.

The order of the paper's baseline (``driver: at_ttr``) is first a TTR, then one repair at that TTR. The TTR
comes from fixed manoeuvres, the trajectory from a planner that knows nothing of them; that nothing
guarantees a repair at the TTR is the paper's argument for searching both together.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import frozen
from repair.backend.base import RepairBackend, SolveStatus
from repair.baselines.evasive.maneuvers import EvasiveCurve, EvasiveManeuver
from repair.baselines.evasive.times import EvasiveResult, evasive_ttr
from repair.check.verdict import Reason, Verdict, Violation
from repair.curves.base import FrenetTrajectory
from repair.problem.problem import Maneuver, Passing, RepairProblem
from repair.problem.surroundings import sides_of
from repair.search.result import Probe, SearchResult, SearchStatus

if TYPE_CHECKING:
    from repair.situation import Prepared

__all__ = ["AtTtrResult", "problems_at_ttr", "repair_at_ttr"]

_KIND = {
    EvasiveManeuver.BRAKE: Maneuver.YIELD,
    EvasiveManeuver.KICK_DOWN: Maneuver.GO_AHEAD,
    EvasiveManeuver.STEER_LEFT: Maneuver.LEFT,
    EvasiveManeuver.STEER_RIGHT: Maneuver.RIGHT,
}


@dataclass(frozen=True)
class AtTtrResult:
    """TTR and the one repair at it.

    Attributes
    ----------
    evasive : EvasiveResult
    search : SearchResult
        With the probe (at the TTR) and ``f_ttr`` equal to the TTR if its repair is feasible.
    """

    evasive: EvasiveResult
    search: SearchResult

    @property
    def ttr(self) -> float:
        """Time-To-React [s] by the evasive manoeuvres; -inf: none helps, inf: no conflict."""
        return self.evasive.ttr


def repair_at_ttr(
    prepared: Prepared,
    backend: RepairBackend,
    evasive: EvasiveResult | None = None,
    *,
    on_probe: Callable[[Probe], None] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> AtTtrResult:
    """TTR first, then one repair at the TTR.

    Parameters
    ----------
    prepared : repair.api.Prepared
    backend : RepairBackend
    evasive : EvasiveResult, optional
        Computed here if it is not given.
    on_probe : callable, optional
        Called with the probe.
    clock : callable
        Monotonic time [s].
    """
    begin = clock()
    evasive = evasive if evasive is not None else evasive_ttr(prepared)
    conflict = prepared.conflict
    if evasive.ttr == float("inf"):
        return AtTtrResult(evasive, SearchResult(SearchStatus.NO_CONFLICT, conflict, float("inf"), None))
    if conflict.contact_time <= 0.0:
        return AtTtrResult(evasive, SearchResult(SearchStatus.ALREADY_COLLIDING, conflict, None, None))
    best: Probe | None = None
    tried: list[str] = []
    for problem in problems_at_ttr(prepared, evasive):
        probe = _probe(prepared, backend, problem, clock)
        tried.append(f"{probe.maneuver.value if probe.maneuver else 'follow'}: {_answer(probe)}")
        if best is None or (probe.feasible and not best.feasible):
            best = probe
        if probe.feasible:
            break
    if best is None:  # no manoeuvre at all: nothing to repair from
        return AtTtrResult(evasive, SearchResult(SearchStatus.NONE_FEASIBLE, conflict, None, None))
    best = replace(best, tried=tuple(tried))
    if on_probe is not None:
        on_probe(best)
    wall = clock() - begin
    if best.feasible:
        found = SearchResult(SearchStatus.FOUND, conflict, best.t_rep, best.solve.curve, (best,), True, wall)
        return AtTtrResult(evasive, found)
    return AtTtrResult(
        evasive, SearchResult(SearchStatus.NONE_FEASIBLE, conflict, None, None, (best,), True, wall)
    )


def _answer(probe: Probe) -> str:
    return "feasible" if probe.feasible else ", ".join(probe.verdict.reasons)


def _probe(
    prepared: Prepared, backend: RepairBackend, problem: RepairProblem, clock: Callable[[], float]
) -> Probe:
    solve = backend.solve(problem)
    begin = clock()
    if solve.curve is not None:
        verdict = prepared.checker.check(problem, solve.curve)
    else:
        reason = Reason.NO_CORRIDOR if solve.status is SolveStatus.NO_CORRIDOR else Reason.NOT_SOLVED
        verdict = Verdict((Violation(reason, problem.t_rep, solve.detail or solve.status.sentence),))
    maneuver = problem.passing.maneuver if problem.passing is not None else None
    return Probe(problem.t_rep, solve, verdict, maneuver, clock() - begin)


def problems_at_ttr(prepared: Prepared, evasive: EvasiveResult) -> tuple[RepairProblem, ...]:
    """The problems to try at the TTR: around the manoeuvre that gave it, then the other open sides.

    The manoeuvre shows that a way is open even where the limits of the repair allow no guide.
    """
    curve = evasive.curve
    if curve is None or evasive.maneuver is None:
        return ()
    kind = _KIND[evasive.maneuver]
    open_sides = prepared.source.at(curve.t_start)
    around = _around(prepared, curve, kind)
    return (around, *(p for p in open_sides if p.passing is None or p.passing.maneuver is not kind))


def _around(prepared: Prepared, curve: EvasiveCurve, kind: Maneuver) -> RepairProblem:
    """The problem at the start of a manoeuvre, with the manoeuvre as the guide."""
    factory, settings = prepared.source, prepared.config.repair
    step, t_rep = prepared.scene.dt, curve.t_start
    times = t_rep + step * np.arange(int(np.ceil((prepared.t_end - t_rep) / step - 1e-6)) + 1)
    reference, guide = prepared.reference.sample(times), curve.sample(times)
    start = frozen([reference.position[0], reference.velocity[0], reference.acceleration[0]])
    lateral = settings.lateral != "none" and kind in (Maneuver.LEFT, Maneuver.RIGHT)
    occupancy = factory._within_reach(start, t_rep, reference.position, lateral)
    lower, upper = occupancy.at(times)
    s, curvature = factory._axis
    path = FrenetTrajectory(
        *(frozen(x) for x in (guide.t, guide.position, guide.velocity, guide.acceleration, guide.jerk))
    )
    return RepairProblem(
        reference=prepared.reference,
        t_rep=t_rep,
        t_end=prepared.t_end,
        start=start,
        occupancy=occupancy,
        bounds=factory.bounds,
        limits=prepared.limits,
        clearance=settings.clearance,
        margin=settings.margin,
        passing=Passing(kind, path, sides_of(guide.position, lower, upper), 0.0),
        curvature_s=s,
        curvature=curvature,
        dt=step,
        lateral=lateral,
    )
