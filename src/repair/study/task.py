"""One row: a scenario by a reference, a backend and a configuration; what rows share is made once."""

from __future__ import annotations

import ctypes
import gc
import json
import tempfile
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.errors import BackendError, RepairError
from repair.study.plan import NO_MEMORY, Study, Task, tasks_of
from repair.study.rows import (
    STUDY_COLUMNS,
    SweepSettings,
    as_sweep_row,
    combinations,
    failed_row,
    one_line,
    strict,
)

if TYPE_CHECKING:
    from repair.baselines.evasive.times import EvasiveResult
    from repair.config.schema import Config
    from repair.preparation import Prepared
    from repair.scene.scene import Scene

__all__ = ["Kept", "guarded", "packed", "row_of", "run_file", "unpacked"]

_PREPARED = 4  # preparations of one scenario that are kept: of as many references, or other settings


@dataclass
class Kept:
    """What rows of one scenario have in common, kept until a row of another scenario is asked for.

    The time that each part took is told with every row that uses it.
    """

    file: tuple[str, str] | None = None
    scenes: dict[str, tuple[Scene, float]] = field(default_factory=dict)
    prepared: dict[str, tuple[Prepared, float]] = field(default_factory=dict)
    evaded: dict[tuple[str, str], tuple[EvasiveResult, float]] = field(default_factory=dict)

    def turn_to(self, task: Task) -> None:
        """Forget another scenario."""
        if self.file != (task.path, task.sha256):
            for each in (self.scenes, self.prepared, self.evaded):
                each.clear()
            if self.file is not None:
                gc.unfreeze()
                gc.collect()
                _give_back()
            self.file = (task.path, task.sha256)

    def scene(self, task: Task) -> tuple[Scene, float]:
        """The scene as the configuration reads it, and how long that took [s]."""
        from repair.scene.commonroad import load_scene

        key = _text(task.config.to_dict()["scene"])
        if key not in self.scenes:
            begin = time.perf_counter()
            # Reading makes hundreds of thousands of small objects that all stay: to look for garbage among
            # them, again and again, takes longer than anything else with them.
            collects = gc.isenabled()
            gc.disable()
            try:
                self.scenes[key] = load_scene(task.path, task.config), time.perf_counter() - begin
            finally:
                if collects:
                    gc.freeze()
                    gc.enable()
        return self.scenes[key]

    def situation(self, task: Task) -> tuple[Prepared, float]:
        """What is searched, made for this row's configuration, and how long the preparation took [s]."""
        from repair.preparation import prepare, what_matters

        key = _text(what_matters(task.config))
        if key in self.prepared:
            like, spent = self.prepared[key]
            return _for_row(like, task.config), spent
        scene, _ = self.scene(task)
        begin = time.perf_counter()
        made = prepare(scene, task.config)
        spent = time.perf_counter() - begin
        while len(self.prepared) >= _PREPARED:
            self.prepared.pop(next(iter(self.prepared)))
        self.prepared[key] = made, spent
        return _for_row(made, task.config), spent

    def evasive(self, task: Task, prepared: Prepared) -> tuple[EvasiveResult, float]:
        """The fixed evasive manoeuvres, and how long they took [s]."""
        from repair.baselines.evasive.times import evasive_ttr

        values = task.config.to_dict()
        key = _text(values["evasive"]), _text(values["reference"]) + _text(_prepared_by(task))
        if key not in self.evaded:
            begin = time.perf_counter()
            self.evaded[key] = evasive_ttr(prepared, task.config.evasive), time.perf_counter() - begin
        return self.evaded[key]


def _give_back() -> None:
    """Have the C library return what is free to the system, where it can: else the peaks add up."""
    with suppress(OSError, AttributeError, TypeError):  # not glibc
        ctypes.CDLL(None).malloc_trim(0)


def _for_row(prepared: Prepared, config: Config) -> Prepared:
    """What is prepared, for one row; who judges ends after the search is the same for all of them."""
    from repair.preparation import again_for

    again = again_for(prepared, config)
    if config.checker.terminal == "report":
        vars(again)["ends"] = prepared.ends
    return again


def _prepared_by(task: Task) -> dict[str, Any]:
    from repair.preparation import what_matters

    return what_matters(task.config)


def _text(values: Any) -> str:
    return json.dumps(values, sort_keys=True, default=str)


def row_of(task: Task, kept: Kept) -> tuple[dict[str, Any], bytes | None]:
    """The row of a task, whatever happens, and the whole result, compressed.

    Anything that is raised is a row that says so.
    """
    kept.turn_to(task)
    return guarded(task, lambda: _row(task, kept))


def guarded(
    task: Task, make: Callable[[], tuple[dict[str, Any], bytes | None]]
) -> tuple[dict[str, Any], bytes | None]:
    """What is made of a task; anything that is raised is a row that says so."""
    begin = time.perf_counter()
    whole: bytes | None = None
    try:
        row, whole = make()
    except RepairError as error:
        # What a backend's own failure is reported as is no fault of the input.
        broken = isinstance(error, BackendError) and isinstance(error.__cause__, Exception)
        row = _failed(task, "crash" if broken else "input_error", one_line(error))
    except MemoryError:
        row = _failed(task, "memory", NO_MEMORY)
    except Exception as error:
        row = _failed(task, "crash", f"{type(error).__name__}: {one_line(error)}")
    row.update(variation=task.variation, row_time_s=round(time.perf_counter() - begin, 4))
    return strict(row, task.table), whole


def _failed(task: Task, status: str, detail: str) -> dict[str, Any]:
    return failed_row(task.file, task.backend, task.reference, status, detail, task.table)


def run_file(path: Path, settings: SweepSettings) -> list[dict[str, Any]]:
    """All rows of one file as a sweep has them, made here; anything that goes wrong in it is a row."""
    study = Study(
        (path,), tuple(settings.backends), tuple(settings.references), preset=settings.preset,
        settings=settings.overrides, official=settings.official, certify=settings.certify, results=False,
    )  # fmt: skip
    try:
        tasks = tasks_of(study)
    except RepairError as error:
        return [
            as_sweep_row(failed_row(path.name, b, r, "input_error", one_line(error)))
            for b, r in combinations(settings)
        ]
    kept = Kept()
    return [as_sweep_row(row_of(task, kept)[0]) for task in tasks]


def packed(
    record: dict[str, Any], drawing: dict[str, Any] | None, certificate: dict[str, Any] | None = None
) -> bytes:
    """A whole result, compressed: what ``result.json`` and ``drawing.json`` hold, and its certificate."""
    whole = {"record": record, "drawing": drawing, "certificate": certificate}
    text = json.dumps(whole, allow_nan=False, separators=(",", ":"))
    return zlib.compress(text.encode("utf-8", "backslashreplace"), 6)


def unpacked(whole: bytes) -> dict[str, Any]:
    """``record``, ``drawing`` and, where it was asked for, ``certificate`` of a stored result."""
    content: dict[str, Any] = json.loads(zlib.decompress(whole))
    return content


def _row(task: Task, kept: Kept) -> tuple[dict[str, Any], bytes | None]:
    from repair.api import make, search
    from repair.io.drawing_json import drawing_to_dict
    from repair.search.result import SearchStatus

    prepared, prepared_in = kept.situation(task)
    _, loaded_in = kept.scene(task)
    result = search(prepared, make(task.config))
    content = result.to_dict()
    evasive, evaded_in = kept.evasive(task, prepared)
    best = result.search.best
    failing = result.search.probes[0] if best is None and result.search.probes else None
    row: dict[str, Any] = dict.fromkeys(STUDY_COLUMNS)
    row.update({key: content[key] for key in STUDY_COLUMNS if key in content})
    conflict, spent = content["conflict"], result.phases
    row.update(
        file=task.file,
        backend=task.backend,
        reference=task.reference,
        detail=_why(failing) if failing is not None else "",
        conflict=conflict["kind"],
        **{
            name: conflict[name]
            for name in ("margin_only", "obstacle_id", "contact_obstacle_id", "from_behind")
        },
        **_evasive(evasive),
        largest_residual=max(best.solve.residuals.values(), default=None) if best is not None else None,
        probes=" ".join(
            f"{p.t_rep:g}:{'+' if p.feasible else '-'.join(('', *p.verdict.reasons))}"
            for p in result.search.probes
        ),
        load_time_s=round(loaded_in, 4),
        prepare_time_s=round(prepared_in, 4),
        evasive_time_s=round(evaded_in, 5),
        other_time_s=round(max(spent["search"] - spent["build"] - spent["solve"] - spent["check"], 0.0), 5),
        **{f"{name}_time_s": round(spent[name], 5) for name in ("search", "build", "solve", "check")},
    )
    row.update(_ending(content["terminal"]))
    row.update(_late(content))
    if (onward := content["onward"]) is not None:
        row.update(onward=onward["kind"], onward_reached=onward["reached"], onward_detail=onward["sentence"])
    if task.official and result.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        row.update(_official(result))
    certificate = None
    if task.certify and result.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        row["certificate"], certificate = _certificate(result)
    if not task.results:
        return row, None
    drawing = result.outcome.drawing
    return row, packed(content, None if drawing is None else drawing_to_dict(drawing), certificate)


def _evasive(found: EvasiveResult) -> dict[str, Any]:
    """TTB and TTR with why they have their value; no figure where it is infinite."""
    from repair.baselines.evasive.maneuvers import EvasiveManeuver

    brake = found.status[EvasiveManeuver.BRAKE]
    best = brake if found.maneuver is None else found.status[found.maneuver]
    finite = {"ttb": found.ttb, "ttr": found.ttr}
    return {
        **{f"{k}_s": round(v, 6) if abs(v) != float("inf") else None for k, v in finite.items()},
        "ttb_status": brake.value,
        "ttr_status": best.value,
    }


def _why(probe: Any) -> str:
    tried = "; ".join(probe.tried)
    details = "; ".join(f"{v.reason.value} at {v.time:.2f} s: {v.detail}" for v in probe.verdict.violations)
    return f"{tried} | {details}" if tried else details


def _late(content: dict[str, Any]) -> dict[str, Any]:
    """The bound, and the impact speeds where nothing was found; where they were asked for."""
    bound, hit = content["bound"] or {}, content["mitigation"] or {}
    return {
        "t_bound_s": bound.get("t_bound_s"),
        "gap_s": bound.get("gap_s"),
        "impact_speed_mps": hit.get("impact_speed_mps"),
        "braking_impact_speed_mps": (hit.get("full_braking") or {}).get("impact_speed_mps"),
    }


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


def _certificate(result: Any) -> tuple[str, dict[str, Any]]:
    """``ok``, or the margins that are violated; and all of them."""
    from repair.certify.certificate import as_table
    from repair.certify.recompute import certify

    with tempfile.TemporaryDirectory() as folder:
        result.save(folder, figure=False)
        certificate = certify(Path(folder))
    return "; ".join(certificate.broken) or "ok", as_table(certificate)


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
