"""The record of a result: plain values in a fixed order, as ``result.json`` holds them."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from repair.arrays import number
from repair.backend.base import Capabilities, SolveResult
from repair.bounds.latest import Bound
from repair.check.beyond import Beyond, met_beyond
from repair.check.peaks import Peaks
from repair.curves.base import SplicedCurve
from repair.curves.codec import curve_to_dict
from repair.metrics.base import MetricValue
from repair.mitigation.mitigate import Mitigation
from repair.onward.plan import Onward
from repair.outcome.bound_record import bound_to_dict
from repair.outcome.driven import driven_curve
from repair.outcome.ending import columns_of, detail_of, place_of, terminal_to_dict
from repair.outcome.onward_record import onward_to_dict
from repair.outcome.records.mitigation import mitigation_to_dict
from repair.outcome.sentence import checked_until, checks_off, margin_only, one_point, status_sentence
from repair.outcome.why_record import explanation_to_dict
from repair.preparation import Prepared
from repair.problem.limits import Limits
from repair.scene.provenance import provenance
from repair.search.modes import ModeResult
from repair.search.result import Probe, SearchResult, SearchStatus
from repair.terminal.verdict import Terminal
from repair.vehicle.states import DrivenStates
from repair.why.explain import Explanation

__all__ = ["peaks_to_dict", "probe_peaks", "record_of"]

_PACKAGES = (
    "commonroad-repair", "numpy", "scipy", "casadi", "qpsolvers", "osqp", "daqp", "clarabel", "shapely",
    "omegaconf", "commonroad-io", "commonroad-drivability-checker", "commonroad-vehicle-models",
)  # fmt: skip


def record_of(
    prepared: Prepared,
    found: SearchResult,
    states: DrivenStates,
    peaks: Peaks | None,
    phases: Mapping[str, float],
    metrics: Mapping[str, MetricValue],
    capabilities: Capabilities,
    modes: Sequence[ModeResult] = (),
    bounds: Mapping[str, Bound] | None = None,
    terminal: Terminal | None = None,
    onward: Onward | None = None,
    explanation: Explanation | None = None,
    mitigation: Mitigation | None = None,
) -> dict[str, Any]:
    """Plain Python values, in a fixed order, no NaN and no infinity.

    Parameters
    ----------
    prepared : Prepared
    found : SearchResult
    states : DrivenStates
        What is driven, at the scenario's steps.
    peaks : Peaks or None
        Extremes of the repaired part.
    phases : mapping
        Wall time by phase [s].
    metrics : mapping
        Those that were asked for.
    capabilities : Capabilities
        Of the backend.
    modes : sequence of ModeResult
        What each of several predictions of an obstacle alone would allow.
    bounds : mapping, optional
        From when on it is proven too late, by kind.
    terminal : Terminal or None
        How the repair ends.
    onward : Onward or None
        What is driven after the evasive part.
    explanation : Explanation or None
        Why there is no repair, or no later one.
    mitigation : Mitigation or None
        The motion that hits least hard, where nothing was found.
    """
    conflict, scene = found.conflict, prepared.scene
    best = found.best
    followed = found.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT)
    beyond = met_beyond(scene, states, prepared.config.checker.clearance) if followed else None
    return {
        "schema": 1,
        "scenario": scene.id,
        "provenance": provenance(scene),
        "backend": prepared.config.backend,
        "status": found.status.value,
        "status_sentence": status_sentence(prepared, found),
        "checked_until_s": number(checked_until(prepared, found)),
        "decided_by": "prediction_end" if beyond is not None else None,
        "prediction_end": _beyond(beyond),
        "checks_off": list(checks_off(prepared.config.checker)),
        "complete": found.complete,
        "ttc_s": number(conflict.time),
        "exact_ttc_s": number(conflict.exact_time),
        "contact_ttc_s": number(conflict.contact_time),
        "f_ttr_s": number(found.f_ttr) if found.curve is not None else None,
        "conflict": {
            "kind": conflict.kind,
            "obstacle_id": conflict.obstacle_id,
            "t_s": number(conflict.time),
            "contact_obstacle_id": conflict.contact_id,
            "contact_t_s": number(conflict.contact_time),
            "from_behind": conflict.from_behind,
            "margin_only": margin_only(conflict),
            "detail": str(getattr(conflict, "detail", "")),
            "place_m": place_of(conflict.place),
        },
        "repaired_by": _by(prepared, best) if best is not None else None,
        "by_fallback": best.fallback if best is not None else None,
        "bound": bound_to_dict(prepared, found, bounds or {}),
        "explanation": explanation_to_dict(explanation),
        "metrics": {name: _metric(value) for name, value in metrics.items()},
        "modes": [_mode(mode) for mode in modes],
        "maneuver": best.maneuver.value if best is not None and best.maneuver is not None else None,
        **peaks_to_dict(peaks),
        "probes": [_probe(prepared, p) for p in found.probes],
        "terminal": terminal_to_dict(terminal),
        "onward": onward_to_dict(onward),
        "mitigation": mitigation_to_dict(mitigation, bounds, scene.initial_time_step, scene.dt),
        "curve": curve_to_dict(found.curve),
        "reference": curve_to_dict(prepared.reference, prepared.t_reference),
        "given_reference": None if prepared.given is None else prepared.given.plain,
        "t_end_s": number(prepared.t_end),
        "trajectory": _trajectory(prepared, found, states, onward),
        "limits": _limits(prepared.limits),
        "capabilities": _plain(capabilities),
        "notes": [
            *prepared.notes,
            *filter(None, [one_point(prepared, found), _over_a_gap(prepared, found, states)]),
        ],
        "solution_file": None,
        "figure_files": [],
        "report_file": None,
        "scenario_file": None,
        "drawing_file": None,
        "time_s": {name: number(seconds, 6) for name, seconds in phases.items()},
        "config": prepared.config.to_dict(),
        "config_given": sorted(prepared.config.given),
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in _PACKAGES}},
    }


def _plain(capabilities: Capabilities) -> dict[str, Any]:
    made = ("helpers", "members", "fallbacks")
    return {
        item.name: getattr(capabilities, item.name) for item in fields(capabilities) if item.name not in made
    }


def _beyond(beyond: Beyond | None) -> dict[str, Any] | None:
    if beyond is None:
        return None
    return {
        "obstacle_id": beyond.obstacle_id,
        "ends_s": number(beyond.end),
        "constant_velocity_met_s": number(beyond.time),
    }


@cache  # looking it up in the file system takes longer than the rest of a record
def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def peaks_to_dict(peaks: Peaks | None) -> dict[str, float | None]:
    """Extremes with their units in the keys."""
    return {
        "peak_deceleration_mps2": number(peaks.min_acceleration) if peaks else None,
        "peak_acceleration_mps2": number(peaks.max_acceleration) if peaks else None,
        "peak_lateral_acceleration_mps2": number(peaks.max_lateral_acceleration) if peaks else None,
        "peak_total_acceleration_mps2": number(peaks.max_total_acceleration) if peaks else None,
        "min_speed_mps": number(peaks.min_speed) if peaks else None,
        "max_speed_mps": number(peaks.max_speed) if peaks else None,
    }


def probe_peaks(prepared: Prepared, probe: Probe) -> Peaks | None:
    """Extremes of the repaired part of a probe; None where the solver left no curve."""
    if probe.solve.curve is None:
        return None
    spliced = SplicedCurve(prepared.reference, probe.solve.curve, probe.t_rep)
    return prepared.checker.peaks(spliced, prepared.t_end, probe.t_rep)


def _by(prepared: Prepared, probe: Probe) -> str:
    """Which backend was asked: that of the configuration, or one of those that it is made of."""
    return probe.by or prepared.config.backend


def _probe(prepared: Prepared, probe: Probe) -> dict[str, Any]:
    solve: SolveResult = probe.solve
    return {
        "t_rep_s": number(probe.t_rep),
        "backend": _by(prepared, probe),
        "feasible": probe.feasible,
        "reasons": list(probe.verdict.reasons),
        "details": [detail_of(v) for v in probe.verdict.violations],
        "maneuver": probe.maneuver.value if probe.maneuver is not None else None,
        "margin_m": number(probe.margin),
        "jump_mps2": number(probe.jump),
        "tried": list(probe.tried),
        "solver_status": solve.status.value,
        "solver_detail": solve.detail,
        "iterations": int(solve.iterations),
        "objective": number(solve.objective),
        **peaks_to_dict(probe_peaks(prepared, probe)),
        "residuals": {name: number(value, 12) for name, value in solve.residuals.items()},
        "build_time_s": number(solve.build_time),
        "solve_time_s": number(solve.solve_time),
        "check_time_s": number(probe.check_time),
    }


def _mode(mode: ModeResult) -> dict[str, Any]:
    return {
        "obstacle_id": mode.obstacle_id,
        "mode": mode.name,
        "probability": number(mode.probability),
        "stands_as": mode.stands_as,
        "status": mode.status,
        "ttc_s": number(mode.ttc),
        "f_ttr_s": number(mode.f_ttr),
    }


def _over_a_gap(prepared: Prepared, found: SearchResult, states: DrivenStates) -> str:
    """Where what is driven crosses a gap of the map that CommonRoad's own boundary check has not as road."""
    road = prepared.checker.road
    if road is None or found.status not in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        return ""
    crossed = road.over_a_gap(states.x, states.y, states.orientation)
    return "" if crossed is None else crossed[1]


def _metric(metric: MetricValue) -> dict[str, Any]:
    return {f"value_{metric.unit}": number(metric.value), "status": metric.status}


def _trajectory(
    prepared: Prepared, found: SearchResult, states: DrivenStates, onward: Onward | None
) -> dict[str, Any]:
    """What is driven, at the scenario's steps; centre of the vehicle, speed at the rear axle."""
    return {
        "initial_time_step": prepared.scene.initial_time_step,
        "dt_s": number(prepared.scene.dt),
        **columns_of(states, driven_curve(prepared, found, onward)),
    }


def _limits(limits: Limits) -> dict[str, float | None]:
    units = {"v": "mps", "a": "mps2", "j": "mps3"}
    return {
        f"{name}_{units.get(name.split('_')[0], 'per_m')}": number(value)
        for name, value in asdict(limits).items()
    }
