"""A certificate: the margins of a written result, recomputed from its files and the scenario alone.

Nothing that the solver or the search claimed is believed. The scenario is loaded again (its checksum must
agree) and its traffic read once more by code of this room; the repaired curve is read from ``result.json`` by
its control points, the solution file by its states, and both are driven and held against each other. *Exact*
rows bound the curve at every time through the convex hull of its Bernstein points, *continuous* rows find
contact at any time by a bound on the motion, *sampled* rows look every millisecond, *files*, *recomputed* and
*searched again* rows hold what is written against what follows from the scenario, *official* rows are the
answers of the CommonRoad drivability checker on the solution file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.certify.certificate import Certificate, CertificateRow
from repair.certify.clearance import boxes_kept, clearance_rows, jump_said
from repair.certify.hull import derivative_rows, seam_rows
from repair.certify.late.impact import impact_rows, status_row
from repair.certify.late.rows import late_rows
from repair.certify.late.why import why_rows
from repair.certify.limits import driven_rows, physical_rows, weakened
from repair.certify.motion import Motion, States, along_curve, through_states
from repair.certify.plane import ContactTime, contact_rows, contact_time_row, road_rows, traffic_words
from repair.certify.record import other_versions, record_rows, searched_again
from repair.certify.solution import (
    agreement_rows,
    columns_row,
    form_rows,
    official_rows,
    only_states,
    start_rows,
)
from repair.certify.traffic import Traffic, read_traffic
from repair.curves.base import Curve, SplicedCurve
from repair.curves.codec import read_curve
from repair.errors import RepairError
from repair.io.result_json import read_record, scenario_of
from repair.onward.leg import Leg, leg_from_dict
from repair.terminal.traffic import traffic_until
from repair.timegrid import steps_until

if TYPE_CHECKING:
    from repair.preparation import Prepared

__all__ = ["certify"]


def certify(folder: Path) -> Certificate:
    """Recompute every margin of the result in ``folder``.

    Raises
    ------
    RepairError
        If there is no result, no trajectory in it, or the scenario is not the one it was made from.
    """
    folder = Path(folder)
    content = read_record(folder)
    said = bool((content.get("bound") or {}).get("proof_file") or content.get("explanation"))
    said |= (content.get("mitigation") or {}).get("ends") is not None
    if content.get("solution_file") is None and not said:
        raise RepairError(
            f"{folder} holds no trajectory to certify: "
            f"{content.get('status_sentence', content.get('status'))}"
        )
    try:
        return _certified(folder, content) if content.get("solution_file") else _proofs(folder, content)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise RepairError(
            f"{folder} cannot be certified, its result.json does not hold together: "
            f"{type(error).__name__} {error}"
        ) from error


def _certified(folder: Path, content: Mapping[str, Any]) -> Certificate:
    """All rows."""
    from repair.scene.reading import read_file, read_solution

    path, prepared = _prepare(folder, content)
    scene, dt = prepared.scene, prepared.scene.dt
    curve = read_curve(content.get("curve"))
    file = folder / str(content["solution_file"])
    if not file.is_file():
        raise RepairError(f"the solution file {file} is not there any more")
    solution = read_solution(file)
    part, states = only_states(solution, file.name)
    anew = read_file(path)
    problem = anew.problems[scene.planning_problem_id]
    first = scene.initial_time_step
    t_rep = 0.0 if curve is None else float(content["f_ttr_s"])
    t_end = prepared.t_reference if curve is None else prepared.t_end
    driven: Curve = prepared.reference if curve is None else SplicedCurve(prepared.reference, curve, t_rep)
    t_repaired = t_end = steps_until(t_end, dt) * dt
    if (leg := _leg(content)) is not None:
        driven, t_end = SplicedCurve(driven, leg, leg.t_start), steps_until(leg.t_end, dt) * dt
    if not 0.0 <= t_rep < t_end:
        raise RepairError(
            f"the repair in {folder} begins at {t_rep:g} s, and what it is for ends at {t_end:g} s"
        )
    planned = along_curve(driven, scene.frame, scene.vehicle, t_end, dt, float(states.orientation[0]))
    written = through_states(states, first, dt, scene.vehicle)
    ways = planned, written
    n_steps = max(scene.n_steps, steps_until(t_end, dt))
    longer = scene if n_steps == scene.n_steps else replace(scene, obstacles=traffic_until(scene, n_steps))
    traffic = read_traffic(anew.scenario, problem, longer, prepared.config, n_steps)

    rows: list[CertificateRow] = []
    if curve is not None:
        said = content.get("capabilities") or {}
        rows += seam_rows(
            prepared.reference, curve, t_rep, jumps=bool(said.get("jumps", False)), jump=jump_said(content)
        )
        rows += derivative_rows(curve, prepared.limits, keeps_hull=bool(said.get("keeps_hull", True)))
        allowed, margin = boxes_kept(content), prepared.config.checker.margin
        rows += clearance_rows(curve, prepared.occupancy, dt, t_repaired, allowed, margin)
    followed = math.inf if curve is None else t_rep
    rows += driven_rows(planned, prepared.limits, prepared.checker.reference_limits, followed)
    rows += physical_rows(states, dt, scene.vehicle)
    rows += contact_rows(prepared, ways, traffic, t_rep)
    road = road_rows(prepared, anew.scenario, ways)
    steps = first, first + steps_until(t_end, dt)
    name = str(anew.scenario.scenario_id)
    rows += [*road, *form_rows(solution, part, states, steps, name, scene.planning_problem_id, scene.vehicle)]
    rows += start_rows(states, problem, scene.vehicle, prepared.config.reference.source)
    rows += agreement_rows(states, planned, scene.vehicle, dt, first)
    rows += _record_rows(content, prepared, curve, states, traffic)
    rows += late_rows(folder, content, prepared, anew.scenario, traffic, _reference(content, prepared))
    rows += why_rows(content, prepared, other_versions(content))
    gap, kept = float(prepared.config.checker.road_gap), all(row.ok for row in road)
    rows += official_rows(file, scene.official(), problem, on_road=kept, gap=gap, goal=_claims_goal(content))
    return Certificate(
        folder,
        str(content.get("scenario")),
        str(content.get("backend")),
        str(content.get("status")),
        content.get("f_ttr_s"),
        tuple(rows),
        *_under(prepared),
        traffic_words(traffic),
    )


def _proofs(folder: Path, content: Mapping[str, Any]) -> Certificate:
    """Of a result without a repair: what it says about when it is too late, why, and what is hit then."""
    from repair.scene.reading import read_file

    path, prepared = _prepare(folder, content)
    scene, anew = prepared.scene, read_file(path)
    problem = anew.problems[scene.planning_problem_id]
    traffic = read_traffic(anew.scenario, problem, scene, prepared.config, scene.n_steps)
    rows = late_rows(folder, content, prepared, anew.scenario, traffic, _reference(content, prepared))
    rows += why_rows(content, prepared, other_versions(content))
    rows += [*status_row(content, rows), *impact_rows(folder, content, prepared, anew, traffic)]
    scenario, backend, status = (str(content.get(name)) for name in ("scenario", "backend", "status"))
    words = traffic_words(traffic)
    return Certificate(folder, scenario, backend, status, None, tuple(rows), *_under(prepared), words)


def _reference(content: Mapping[str, Any], prepared: Prepared) -> Motion:
    """The reference, driven anew from the orientation of the written trajectory on."""
    scene = prepared.scene
    until = steps_until(prepared.t_reference, scene.dt) * scene.dt
    start = float(content["trajectory"]["orientation_rad"][0])
    return along_curve(prepared.reference, scene.frame, scene.vehicle, until, scene.dt, start)


def _leg(content: Mapping[str, Any]) -> Leg | None:
    """What is driven after the evasive part."""
    leg = (content.get("onward") or {}).get("leg")
    return None if leg is None else leg_from_dict(leg)


def _claims_goal(content: Mapping[str, Any]) -> bool:
    onward = content.get("onward") or {}
    return onward.get("kind") == "goal" and bool(onward.get("reached"))


# -- reading -----------------------------------------------------------------------------------------


def _prepare(folder: Path, content: Mapping[str, Any]) -> tuple[Path, Prepared]:
    """The scenario of the result, loaded and laid out again; and its file."""
    from repair.config.load import recorded_config
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene

    origin = content.get("provenance") or {}
    path = scenario_of(folder, content)
    config = recorded_config(content)
    scene = load_scene(path, config)
    if scene.planning_problem_id != origin.get("planning_problem_id"):
        raise RepairError(
            f"{folder} is of planning problem {origin.get('planning_problem_id')}, "
            f"and by its configuration it would be {scene.planning_problem_id}"
        )
    return path, prepare(scene, config, content.get("given_reference"))


def _record_rows(
    content: Mapping[str, Any], prepared: Prepared, curve: Curve | None, states: States, traffic: Traffic
) -> list[CertificateRow]:
    """What ``result.json`` says of the conflict, of itself and of the solution file."""
    dt = prepared.scene.dt
    until = steps_until(prepared.t_reference, dt) * dt
    start = float(states.orientation[0])
    reference = along_curve(
        prepared.reference, prepared.scene.frame, prepared.scene.vehicle, until, dt, start
    )
    conflict = content.get("conflict") or {}
    told = ContactTime(content.get("contact_ttc_s"), conflict.get("contact_obstacle_id"))
    rows = [contact_time_row(prepared, reference, traffic, told)]
    rows.append(columns_row(states, content.get("trajectory") or {}))
    return [*rows, *record_rows(content, searched_again(content, prepared, curve))]


def _under(prepared: Prepared) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What the result was judged by, in words; and what of that allows more than usual."""
    from repair.check.settings import CheckerConfig
    from repair.problem.limits import resolve_limits
    from repair.problem.settings import LimitsConfig

    scene, asked, usual = prepared.scene, prepared.config.checker, CheckerConfig()
    by = tuple(f"{k}={_word(v)}" for k, v in asdict(asked).items() if v != [])
    limits = asdict(prepared.limits)
    by += tuple(f"{name}={limits[name]:g}" for name in ("v_max", "a_min", "a_max", "a_lat", "a_total"))
    by += (f"after_prediction={prepared.config.scene.after_prediction}",)
    weaker = [f"checker.{name}=false" for name in ("limits", "road") if not getattr(asked, name)]
    more = [name for name in ("tolerance", "road_gap") if getattr(asked, name) > getattr(usual, name)]
    if asked.clearance < usual.clearance and not asked.margin:
        more.append("clearance")
    weaker += [f"checker.{n}={_word(getattr(asked, n))} (usual: {getattr(usual, n):g})" for n in more]
    if asked.official == "never":
        weaker.append("checker.official=never")
    common = resolve_limits(LimitsConfig(), scene.vehicle, float(scene.start[1, 0]), scene.dt)
    return by, (*weaker, *weakened(prepared.limits, common))


def _word(value: Any) -> str:
    return (
        str(value).lower()
        if isinstance(value, bool)
        else f"{value:g}"
        if isinstance(value, float)
        else str(value)
    )
