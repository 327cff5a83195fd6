"""One file through every backend and reference."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

from repair.config import load_config
from repair.errors import BackendError, RepairError
from repair.study.rows import COLUMNS, SweepSettings, combinations, failed_row, one_line


def run_file(path: Path, settings: SweepSettings) -> list[dict[str, Any]]:
    """All rows of one file; anything that goes wrong in it is a row."""
    from repair.scene.commonroad import load_scene

    begin = time.perf_counter()
    try:
        config = load_config(settings.preset, overrides=settings.overrides)
        scene = load_scene(path, config)
    except RepairError as error:
        return [
            failed_row(path.name, b, r, "input_error", one_line(error)) for b, r in combinations(settings)
        ]
    loaded = time.perf_counter() - begin
    rows = []
    for backend, reference in combinations(settings):
        try:
            rows.append(_row(path.name, scene, backend, reference, settings, loaded))
        except RepairError as error:
            # What a backend's own failure is reported as is no fault of the input.
            broken = isinstance(error, BackendError) and isinstance(error.__cause__, Exception)
            status = "crash" if broken else "input_error"
            rows.append(failed_row(path.name, backend, reference, status, one_line(error)))
        except Exception as error:
            detail = f"{type(error).__name__}: {one_line(error)}"
            rows.append(failed_row(path.name, backend, reference, "crash", detail))
    return rows


def _row(
    file: str, scene: Any, backend: str, reference: str, settings: SweepSettings, loaded: float
) -> dict[str, Any]:
    from repair.api import search
    from repair.baselines.evasive.times import evasive_ttr
    from repair.preparation import prepare
    from repair.search.result import SearchStatus
    from repair.solvers.registry import make_backend

    overrides = [*settings.overrides, f"reference.source={reference}"]
    config = load_config(settings.preset, overrides=overrides, backend=backend)
    begin = time.perf_counter()
    prepared = prepare(scene, config)
    prepared_in = time.perf_counter() - begin
    result = search(prepared, make_backend(backend, config))
    content = result.to_dict()
    evasive = evasive_ttr(prepared, config.evasive)
    best = result.search.best
    failing = result.search.probes[0] if best is None and result.search.probes else None
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row.update({key: content[key] for key in COLUMNS if key in content})
    row.update(
        file=file,
        reference=reference,
        detail=_why(failing) if failing is not None else "",
        conflict=content["conflict"]["kind"],
        margin_only=content["conflict"]["margin_only"],
        obstacle_id=content["conflict"]["obstacle_id"],
        from_behind=content["conflict"]["from_behind"],
        ttb_s=_text(evasive.ttb),
        ttr_s=_text(evasive.ttr),
        largest_residual=max(best.solve.residuals.values(), default=None) if best is not None else None,
        probes=" ".join(
            f"{p.t_rep:g}:{'+' if p.feasible else '-'.join(('', *p.verdict.reasons))}"
            for p in result.search.probes
        ),
        load_time_s=round(loaded, 4),
        prepare_time_s=round(prepared_in, 4),
        **{f"{name}_time_s": round(result.phases[name], 5) for name in ("search", "solve", "check")},
    )
    row.update(_ending(content["terminal"]))
    if (onward := content["onward"]) is not None:
        row.update(onward=onward["kind"], onward_reached=onward["reached"], onward_detail=onward["sentence"])
    if settings.official and result.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        row.update(_official(result))
    if settings.certify and result.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        row["certificate"] = _certificate(result)
    return row


def _text(value: float) -> float | str:
    """Numbers as they are; CriMe's infinities as words, because JSON has none."""
    return "inf" if value == float("inf") else "-inf" if value == -float("inf") else round(value, 6)


def _why(probe: Any) -> str:
    tried = "; ".join(probe.tried)
    details = "; ".join(f"{v.reason.value} at {v.time:.2f} s: {v.detail}" for v in probe.verdict.violations)
    return f"{tried} | {details}" if tried else details


def _ending(terminal: dict[str, Any] | None) -> dict[str, Any]:
    """How a repair ends, and what breaks it."""
    if terminal is None:
        return {}
    met = [(how, one) for how, one in terminal["extended"].items() if one is not None]
    met += [("", one) for one in terminal["details"]]
    words = (
        f"{how + ': ' if how else ''}{one['reason']} at {one['t_s']:.2f} s: {one['detail']}"
        for how, one in met
    )
    return {
        "ending": terminal["ending"],
        "ending_maneuver": terminal["maneuver"],
        "ending_detail": "; ".join(words),
    }


def _certificate(result: Any) -> str:
    """``ok``, or the margins that are violated."""
    from repair.certify.recompute import certify

    with tempfile.TemporaryDirectory() as folder:
        result.save(folder, figure=False)
        certificate = certify(Path(folder))
    return "; ".join(row.name for row in certificate.rows if row.claim and not row.ok) or "ok"


def _official(result: Any) -> dict[str, Any]:
    """Write the solution, read it back, have it checked."""
    from commonroad.common.solution import CommonRoadSolutionWriter
    from commonroad.planning.planning_problem import PlanningProblemSet

    from repair.io.official import check_solution_file

    scene = result.prepared.scene
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "solution.xml"
        file.write_bytes(CommonRoadSolutionWriter(result.to_solution()).dump().encode())
        problems = PlanningProblemSet([scene.planning_problem])
        verdict = check_solution_file(file, scene.official(), problems)
    return {
        "official_feasible": verdict.feasible,
        "official_collision_free": verdict.collision_free,
        "official_on_road": verdict.on_road,
        "official_solved": verdict.solved,
        "official_vehicle_model": verdict.vehicle_model,
        "official_connected": verdict.connected,
        "official_start": verdict.starts,
        "official_goal": verdict.goal,
        "official_egos_apart": verdict.egos_apart,
        "official_valid": verdict.valid,
        "road_method": verdict.road_method,
        "official_time_s": round(time.perf_counter() - begin, 4),
    }
