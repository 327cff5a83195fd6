"""What was planned, as a planning trace of drawtonomy.

The format is ``drawtonomy-planning-trace-v1``, of the package drawtonomy-commonroad 0.3.0 (its schema
``planning-trace-v1.schema.json``); the writer is our own. It holds what the ego drives, the plans by which
it does, when each was made, and the trajectories that were looked at beside them. Here there are two plans:
the reference from the start on, and the repair from the last step on at which the reference is followed;
where that is the start, or nothing is repaired, there is one. What the format has no word for (TTC, F-TTR,
bound, how a repair ends) stands under ``repair``, under the names of ``result.json``: unknown keys are
allowed everywhere, and skipped.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from repair.io.trace.considered import Considered
from repair.io.trace.fingerprint import fingerprint
from repair.scene.scene import Scene
from repair.timegrid import INSTANT, on_grid
from repair.vehicle.states import DrivenStates

__all__ = ["SCHEMA", "trace_bytes"]

SCHEMA = "drawtonomy-planning-trace-v1"

_DIGITS = 6  # as commonroad-io writes positions
#: The words that the format recommends for why a trajectory is none.
_WORDS = {
    **dict.fromkeys(("collision", "contact", "margin", "off_road"), "infeasible_collision"),
    **dict.fromkeys(("kinematics", "limits"), "infeasible_kinematic"),
}
_RULE = "infeasible_rule"  # whatever else was asked of it
#: What is told of a result, under the names that it has in result.json.
_TOLD = (
    "status", "status_sentence", "ttc_s", "exact_ttc_s", "contact_ttc_s", "f_ttr_s", "maneuver", "backend",
    "repaired_by", "by_fallback", "conflict", "bound", "terminal", "checks_off",
)  # fmt: skip
_LEFT_OUT = {"terminal": ("trajectory",)}  # it is one of the candidates
_OF_A_PROBE = ("t_rep_s", "backend", "maneuver", "details", "reasons")


def trace_bytes(
    record: Mapping[str, Any],
    scene: Scene,
    states: DrivenStates,
    looked_at: Sequence[Considered],
    scenario: bytes | None,
    solution: bytes | None,
) -> bytes:
    """The content of the file.

    Parameters
    ----------
    record : mapping
        What ``result.json`` holds.
    scene : Scene
    states : DrivenStates
        What is driven, at the scenario's steps: what the solution file holds.
    looked_at : sequence of Considered
        The reference first.
    scenario, solution : bytes or None
        The files that this is of, by which drawtonomy knows them again; None where there is none.

    Returns
    -------
    bytes
        JSON. Positions are those of the body's middle [m], headings in radians, speeds those of the rear axle
        [m/s], times from the scenario's start on [s].
    """
    written = _States(scene.initial_time_step, scene.dt)
    names = {"scenarioFingerprint": scenario, "solutionFingerprint": solution}
    marks = {key: None if content is None else fingerprint(content) for key, content in names.items()}
    vehicle = scene.vehicle
    body = {"length": vehicle.length, "width": vehicle.width, "refToCenter": vehicle.rear}
    track = {
        "role": "ego",
        "vehicle": body | ({"type": vehicle.name} if vehicle.name else {}),
        "driven": written(states),
        "plans": _plans(record, scene, states, looked_at, written),
    }
    content = {
        "schema": SCHEMA,
        "scenario": scene.id,
        "producer": {"name": "commonroad-repair", "version": record["versions"]["commonroad-repair"] or ""},
        **{key: mark for key, mark in marks.items() if mark is not None},
        "frame": "center",
        "repair": _told(record),
        "tracks": [track],
    }
    return (json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":")) + "\n").encode()


class _States:
    """States as the format has them: from the scenario's start on, and no more digits than the solution's."""

    def __init__(self, first: int, dt: float) -> None:
        self.first, self.dt = first, dt

    def at(self, t: float) -> float:
        """The scenario's time [s] of a time of ours, which begins with the planning problem."""
        return round((round(t / self.dt) + self.first) * self.dt, 9)

    def __call__(self, states: DrivenStates) -> list[dict[str, float]]:
        columns = (states.x, states.y, states.orientation, states.speed)
        rows = zip(states.t.tolist(), *(column.tolist() for column in columns), strict=True)
        return [
            {"t": self.at(t)}
            | {name: round(value, _DIGITS) + 0.0 for name, value in zip("xyhv", values, strict=True)}
            for t, *values in rows
        ]


def _plans(
    record: Mapping[str, Any],
    scene: Scene,
    states: DrivenStates,
    looked_at: Sequence[Considered],
    written: _States,
) -> list[dict[str, Any]]:
    """The reference, and the repair from where it leaves it."""
    reference, *others = looked_at
    followed = on_grid(record["f_ttr_s"] or 0.0, scene.dt)
    chosen = next((k for k in others if _is_driven(record, k)), None)
    beside = sorted((k for k in others if k is not chosen), key=lambda k: not k.feasible)
    before = [_candidate(record, k, written) for k in beside if k.kind != "stop"]
    stops = [_candidate(record, k, written) for k in beside if k.kind == "stop"]
    if chosen is None:
        return [_plan(written(states), before)]
    if followed <= 0.0:
        return [_plan(written(states), [*before, *stops, _candidate(record, reference, written)])]
    repair = written(states.since(followed - INSTANT))
    return [_plan(written(reference.states), before), _plan(repair, stops)]


def _is_driven(record: Mapping[str, Any], looked_at: Considered) -> bool:
    """Whether it is the repair that is driven: the one behind the F-TTR."""
    if looked_at.probe is None or not looked_at.feasible:
        return False
    return bool(record["probes"][looked_at.probe]["t_rep_s"] == record["f_ttr_s"])


def _plan(states: list[dict[str, float]], candidates: list[dict[str, Any]]) -> dict[str, Any]:
    made: dict[str, Any] = {"t": states[0]["t"], "states": states}
    return made | ({"candidates": candidates} if candidates else {})


def _candidate(record: Mapping[str, Any], looked_at: Considered, written: _States) -> dict[str, Any]:
    made: dict[str, Any] = {"states": written(looked_at.states), "feasible": looked_at.feasible}
    if not looked_at.feasible:
        made["reason"] = _WORDS.get(looked_at.reasons[0], _RULE) if looked_at.reasons else _RULE
    more: dict[str, Any] = {"kind": looked_at.kind}
    if looked_at.probe is not None:
        probe = record["probes"][looked_at.probe]
        more |= {key: probe[key] for key in _OF_A_PROBE}
    elif looked_at.reasons:
        more["reasons"] = list(looked_at.reasons)
    return made | {"repair": more}


def _told(record: Mapping[str, Any]) -> dict[str, Any]:
    """What is known of the result, and every time-to-repair that was tried, also where it left no curve."""
    told = {key: record.get(key) for key in _TOLD}
    for key, gone in _LEFT_OUT.items():
        if isinstance(known := told[key], Mapping):
            told[key] = {name: value for name, value in known.items() if name not in gone}
    probes = [{key: probe[key] for key in (*_OF_A_PROBE, "feasible")} for probe in record["probes"]]
    return told | {"probes": probes}
