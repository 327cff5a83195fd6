"""The rows of a certificate about what is hit where nothing was found, and about ``unavoidable``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.certify.certificate import CertificateRow, at_most, said
from repair.certify.contact import first_meeting
from repair.certify.late.rows import read_proofs
from repair.certify.limits import physical_rows
from repair.certify.motion import Motion, States, states_of, through_states
from repair.certify.plane import beyond_the_road, road_of
from repair.certify.solution import columns_row, only_states, start_rows
from repair.certify.traffic import Body, Traffic
from repair.errors import RepairError
from repair.io.official import check_solution_file
from repair.timegrid import steps_until

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["impact_rows", "status_row"]

_TIME = 8e-3  # by which an impact may come at another time: states against the curve, and a millisecond [s]
_SPEED = 0.15  # by which its speed may differ: hard braking for that time [m/s]
_CLEAR = 0.2  # nearer to the middle of the rear half, or slower, is too close to call [m], [m/s]
_EDGE = 0.03  # by which leaving the road may differ, or by what is between the samples that see it [s]


def status_row(content: Mapping[str, Any], rows: Sequence[CertificateRow]) -> list[CertificateRow]:
    """Whether the status is ``unavoidable`` where a proof for the vehicle holds from the start, no other.

    Parameters
    ----------
    content : mapping
        What ``result.json`` holds.
    rows : sequence of CertificateRow
        Those about the proofs.
    """
    told = ((content.get("bound") or {}).get("kinds") or {}).get("vehicle") or {}
    held = told.get("t_bound_s") == 0.0 and any(
        row.ok and row.name == "too late from 0 s on (vehicle)" for row in rows
    )
    status = content.get("status")
    if status == "unavoidable" or (held and content.get("f_ttr_s") is None):
        remark = "proven for the vehicle" if held else "there is no proof for the vehicle"
        return [said("status unavoidable", held == (status == "unavoidable"), "exact", remark)]
    return []


def impact_rows(
    folder: Path, content: Mapping[str, Any], prepared: Prepared, anew: Any, traffic: Traffic
) -> list[CertificateRow]:
    """Kinematics, road, contact and impact speed of the motion that hits least hard, and of full braking.

    Parameters
    ----------
    folder : Path
    content : mapping
        What ``result.json`` holds.
    prepared : Prepared
        For vehicle and configuration.
    anew
        The scenario file, read once more.
    traffic : Traffic
        Likewise.
    """
    told = content.get("mitigation")
    if not told or told.get("ends") is None:
        return []
    problem = anew.problems[prepared.scene.planning_problem_id]
    road = None
    if prepared.config.checker.road:
        road = road_of(anew.scenario, float(prepared.config.checker.road_gap))
    rows: list[CertificateRow] = []
    full = told.get("full_braking")
    looked = float(told["looked_until_s"])
    least = min(prepared.t_end, steps_until(prepared.scene.horizon, prepared.scene.dt) * prepared.scene.dt)
    rows.append(
        said("record: impacts are looked for until then", looked >= least - 1e-6, "files", f"{looked:g} s")
    )
    rows.append(said("record: what the proof needs", told["proven"] == _needed(folder, content), "files"))
    for name, one in (("mitigation", told), ("full braking", full)):
        if one is not None:
            made = _rows(one, prepared, problem, traffic, road, looked)
            rows += [replace(row, name=f"{name}: {row.name}") for row in made]
    if full is not None:
        best, other = float(told["impact_speed_mps"]), float(full["impact_speed_mps"])
        rows.append(at_most("impact speed, full braking's the limit", best, other, "files", "m/s"))
        off = abs(float(told["gained_mps"]) - max(other - best, 0.0))
        rows.append(at_most("record: gained off by", off, 0.0, "files", "m/s", 1e-5))
    elif told["gained_mps"] is not None:
        rows.append(said("record: gained", False, "files", "full braking is missing"))
    return [*rows, *_file_rows(folder, told, prepared, problem)]


def _needed(folder: Path, content: Mapping[str, Any]) -> str | None:
    """What the proof that nothing avoids it is about; None where there is none for the vehicle at 0."""
    bound = content.get("bound") or {}
    if ((bound.get("kinds") or {}).get("vehicle") or {}).get("t_bound_s") != 0.0:
        return None
    places = read_proofs(folder / str(bound["proof_file"]))[0]["kinds"]["vehicle"]["places"]
    return "contact_or_off_road" if any(one["obstacle"] < 0 for one in places) else "contact"


def _rows(
    one: Mapping[str, Any], prepared: Prepared, problem: Any, traffic: Traffic, road: Any, looked: float
) -> Iterator[CertificateRow]:
    """Of one motion."""
    scene, dt = prepared.scene, prepared.scene.dt
    vehicle, half = scene.vehicle, (scene.vehicle.half_length, scene.vehicle.half_width)
    states = states_of(one["trajectory"])
    first = scene.initial_time_step
    if not np.array_equal(states.steps, first + np.arange(len(states.steps))) or len(states.steps) < 2:
        yield said("time steps", False, "files")
        return
    motion = through_states(states, first, dt, vehicle)
    yield from start_rows(states, problem, vehicle, prepared.config.reference.source)
    yield from physical_rows(states, dt, vehicle)
    ends, time = str(one["ends"]), _time(one)
    if (ends == "none") != (one["contact_t_s"] is None) or ends not in ("contact", "off_road", "none"):
        yield said("how it ends", False, "files", ends)
        return
    until = looked - dt if ends == "none" else time  # to the step
    yield said("lasts until its impact", float(motion.t[-1]) >= until - 1e-9, "files")
    met = first_meeting(motion, half, traffic.bodies, dt)
    since = math.inf if road is None else beyond_the_road(motion, *half, road)[0]
    if ends == "contact":
        late = any(o.late for o in scene.obstacles)
        off = abs(met.time - time)
        same = met.obstacle_id == one["obstacle_id"] and off <= _TIME
        yield CertificateRow(
            "contact", time, met.time, -off, bool(same or (late and time < met.time)), "continuous",
            f"s, obstacle {met.obstacle_id}",
        )  # fmt: skip
        yield from _speed_rows(one, motion, traffic.bodies, dt)
        yield from _behind_rows(one, motion, traffic.bodies, dt, vehicle.length)
    else:
        free = met.time >= min(time, float(motion.t[-1])) - _TIME
        yield said("nothing is touched before", free, "continuous", f"s, obstacle {met.obstacle_id}")
    if road is None:
        return
    if ends == "off_road":
        off, apart = abs(since - time), max(_EDGE, dt / prepared.checker.config.substeps)
        yield CertificateRow("the road is left", time, since, -off, off <= apart, "sampled", "s")
        yield from _own_rows(one, motion, time)
    else:
        until = min(time, float(motion.t[-1]))
        yield said("on the road until then", since >= until - 1e-9, "sampled", f"until {until:.2f} s")


def _time(one: Mapping[str, Any]) -> float:
    return math.inf if one["contact_t_s"] is None else float(one["contact_t_s"])


def _velocity(motion: Motion, time: float) -> complex:
    """Of the middle of the ego, over the samples around a time [m/s]."""
    k = min(max(int(np.searchsorted(motion.t, time)), 1), len(motion.t) - 1)
    change = motion.poses[k, :2] - motion.poses[k - 1, :2]
    return complex(*change) / float(motion.t[k] - motion.t[k - 1])


def _own_rows(one: Mapping[str, Any], motion: Motion, time: float) -> Iterator[CertificateRow]:
    own = abs(_velocity(motion, time))
    off = abs(own - float(one["own_speed_mps"]))
    yield at_most("own speed off by", off, 0.0, "recomputed", f"m/s, of {own:.2f} m/s", _SPEED)


def _speed_rows(
    one: Mapping[str, Any], motion: Motion, bodies: Sequence[Body], dt: float
) -> Iterator[CertificateRow]:
    """Impact speed and own speed at the time of contact."""
    time, told = _time(one), float(one["impact_speed_mps"])
    yield from _own_rows(one, motion, time)
    own = _velocity(motion, time)
    found = [
        abs(own - theirs)
        for body in bodies
        if body.id == one["obstacle_id"]
        for theirs in _theirs(body, time, dt)
    ]
    if not found:
        yield said("impact speed", False, "recomputed", "there is no such obstacle")
        return
    speed = min(found, key=lambda value: abs(value - told))
    off = abs(speed - told)
    yield at_most("impact speed off by", off, 0.0, "recomputed", f"m/s, of {speed:.2f} m/s", _SPEED)


def _behind_rows(
    one: Mapping[str, Any], motion: Motion, bodies: Sequence[Body], dt: float, length: float
) -> Iterator[CertificateRow]:
    """Whether it is struck from behind: behind the middle of its rear half, by who closes in.

    Of a body of several parts, and where it is too close to call, nothing is said.
    """
    time = _time(one)
    parts = [body for body in bodies if body.id == one["obstacle_id"]]
    k = math.floor((time + _TIME) / dt)
    here, there = (_centre(parts[0], step) if len(parts) == 1 else None for step in (k, k + 1))
    if here is None:
        return
    centre = here if there is None else here + (time / dt - k) * (there - here)
    x, y, yaw = (float(np.interp(time, motion.t, column)) for column in motion.poses.T)
    axis, own = complex(math.cos(yaw), -math.sin(yaw)), _velocity(motion, time)
    beyond = -0.25 * length - ((centre - complex(x, y)) * axis).real
    closing = [((theirs - own) * axis).real for theirs in _theirs(parts[0], time, dt)]
    if min(abs(beyond), *(abs(v) for v in closing)) < _CLEAR or min(closing) < 0.0 < max(closing):
        return
    behind = beyond > 0.0 and closing[0] > 0.0
    yield said("struck from behind", bool(one["from_behind"]) == behind, "recomputed", str(behind).lower())


def _theirs(body: Body, time: float, dt: float) -> list[complex]:
    """Velocities of a body over the step that a time is in; over both where it is between two."""
    found = []
    for k in sorted({math.floor((time - _TIME) / dt), math.floor((time + _TIME) / dt)}):
        here, there = (_centre(body, step) for step in (k, k + 1))
        found.append(0j if here is None or there is None else (there - here) / dt)
    return found


def _centre(body: Body, step: int) -> complex | None:
    """Where a body is at a step; None where it is not there."""
    if body.outline is None:
        held = body.held[step] if 0 <= step < len(body.held) else None
        return None if held is None else complex(held.centroid.x, held.centroid.y)
    if not 0 <= step < len(body.poses) or not np.isfinite(body.poses[step]).all():
        return None
    return complex(*body.poses[step, :2])


def _file_rows(
    folder: Path, told: Mapping[str, Any], prepared: Prepared, problem: Any
) -> list[CertificateRow]:
    """The file in the form of a solution: the same states, and CommonRoad's own answer on its transitions."""
    from commonroad.planning.planning_problem import PlanningProblemSet

    from repair.scene.reading import read_solution

    if told.get("solution_file") is None:
        return []
    file = folder / str(told["solution_file"])
    if not file.is_file():
        raise RepairError(f"the file {file} is not there any more")
    states: States = only_states(read_solution(file), file.name)[1]
    verdict = check_solution_file(file, prepared.scene.official(), PlanningProblemSet([problem]))
    rows = [
        columns_row(states, told["trajectory"]),
        said("vehicle model known", verdict.vehicle_model, "official"),
        said("states connected", verdict.connected, "official"),
        said("starts_at_correct_state", verdict.starts, "official"),
        said("solution_feasible", verdict.feasible, "official"),
    ]
    return [replace(row, name=f"mitigation: {row.name}") for row in rows]
