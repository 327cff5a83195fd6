"""The content of ``result.json``."""

from __future__ import annotations

import json
import platform
import re
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import column, number
from repair.backend.base import SolveResult
from repair.curves.base import SplicedCurve
from repair.curves.codec import curve_to_dict
from repair.scene.provenance import provenance
from repair.search.result import Probe

if TYPE_CHECKING:
    from repair.api import RepairResult
    from repair.check.peaks import Peaks

__all__ = ["peaks_to_dict", "probe_peaks", "to_dict", "to_json"]

_PACKAGES = (
    "commonroad-repair", "numpy", "scipy", "casadi", "qpsolvers", "osqp", "daqp", "clarabel", "shapely",
    "omegaconf", "commonroad-io", "commonroad-drivability-checker", "commonroad-vehicle-models",
)  # fmt: skip


# -- JSON ------------------------------------------------------------------------------------------


def to_dict(result: RepairResult) -> dict[str, Any]:
    """The content of ``result.json``: plain Python values, in a fixed order, no NaN and no infinity."""
    found, prepared = result.search, result.prepared
    conflict, scene, peaks = found.conflict, prepared.scene, result.peaks
    best = found.best
    return {
        "schema": 1,
        "scenario": scene.id,
        "provenance": provenance(scene),
        "backend": prepared.config.backend,
        "status": found.status.value,
        "status_sentence": found.status.sentence,
        "complete": found.complete,
        "ttc_s": number(conflict.time),
        "contact_ttc_s": number(conflict.contact_time),
        "f_ttr_s": number(found.f_ttr) if found.curve is not None else None,
        "conflict": {
            "kind": conflict.kind,
            "obstacle_id": conflict.obstacle_id,
            "t_s": number(conflict.time),
            "contact_obstacle_id": conflict.contact_id,
            "contact_t_s": number(conflict.contact_time),
            "from_behind": conflict.from_behind,
        },
        "maneuver": best.maneuver.value if best is not None and best.maneuver is not None else None,
        **peaks_to_dict(peaks),
        "probes": [_probe(result, p) for p in found.probes],
        "curve": curve_to_dict(found.curve),
        "reference": curve_to_dict(prepared.reference, prepared.t_reference),
        "t_end_s": number(prepared.t_end),
        "trajectory": _trajectory(result),
        "limits": _limits(result),
        "notes": list(prepared.notes),
        "solution_file": None,
        "figure_files": [],
        "scenario_file": None,
        "time_s": {name: number(seconds, 6) for name, seconds in result.phases.items()},
        "config": asdict(prepared.config),
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in _PACKAGES}},
    }


def to_json(content: dict[str, Any]) -> str:
    """Strict JSON text, one key a line, number lists on one line."""
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    flat = re.compile(r"\[\s+((?:-?[\d.eE+-]+|null)(?:,\s+(?:-?[\d.eE+-]+|null))*)\s+\]")
    return flat.sub(lambda m: "[" + re.sub(r"\s+", " ", m.group(1)) + "]", text) + "\n"


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def peaks_to_dict(peaks: Peaks | None) -> dict[str, float | None]:
    return {
        "peak_deceleration_mps2": number(peaks.min_acceleration) if peaks else None,
        "peak_acceleration_mps2": number(peaks.max_acceleration) if peaks else None,
        "peak_lateral_acceleration_mps2": number(peaks.max_lateral_acceleration) if peaks else None,
        "peak_total_acceleration_mps2": number(peaks.max_total_acceleration) if peaks else None,
        "min_speed_mps": number(peaks.min_speed) if peaks else None,
        "max_speed_mps": number(peaks.max_speed) if peaks else None,
    }


def probe_peaks(result: RepairResult, probe: Probe) -> Peaks | None:
    """Extremes of the repaired part of a probe; None where the solver left no curve."""
    if probe.solve.curve is None:
        return None
    prepared = result.prepared
    spliced = SplicedCurve(prepared.reference, probe.solve.curve, probe.t_rep)
    return prepared.checker.peaks(spliced, prepared.t_end, probe.t_rep)


def _probe(result: RepairResult, probe: Probe) -> dict[str, Any]:
    solve: SolveResult = probe.solve
    return {
        "t_rep_s": number(probe.t_rep),
        "feasible": probe.feasible,
        "reasons": list(probe.verdict.reasons),
        "details": [
            {"reason": v.reason.value, "t_s": number(v.time), "detail": v.detail}
            for v in probe.verdict.violations
        ],
        "maneuver": probe.maneuver.value if probe.maneuver is not None else None,
        "margin_m": number(probe.margin),
        "tried": list(probe.tried),
        "solver_status": solve.status.value,
        "solver_detail": solve.detail,
        "iterations": solve.iterations,
        "objective": number(solve.objective),
        **peaks_to_dict(probe_peaks(result, probe)),
        "residuals": {name: number(value, 12) for name, value in solve.residuals.items()},
        "build_time_s": number(solve.build_time),
        "solve_time_s": number(solve.solve_time),
        "check_time_s": number(probe.check_time),
    }


def _trajectory(result: RepairResult) -> dict[str, Any]:
    """What is driven, at the scenario's steps; centre of the vehicle, speed at the rear axle."""
    states = result.states
    along = result.curve.sample(states.t)
    wrapped = np.arctan2(np.sin(states.orientation), np.cos(states.orientation))
    return {
        "initial_time_step": result.prepared.scene.initial_time_step,
        "dt_s": number(result.prepared.scene.dt),
        "t_s": column(states.t),
        "x_m": column(states.x),
        "y_m": column(states.y),
        "orientation_rad": column(wrapped),
        "steering_rad": column(states.steering),
        "speed_mps": column(states.speed),
        "s_m": column(along.position[:, 0]),
        "l_m": column(along.position[:, 1]),
    }


def _limits(result: RepairResult) -> dict[str, float | None]:
    limits = result.prepared.limits
    units = {"v": "mps", "a": "mps2", "j": "mps3"}
    return {
        f"{name}_{units.get(name.split('_')[0], 'per_m')}": number(value)
        for name, value in asdict(limits).items()
    }
