"""Many scenarios, many backends: each file through reference, TTC, search and the official checker.

A row for every (file, backend, reference), whatever happens: a file that does not load, a crash of
the interpreter or a time-out is a row that says so. Work is done by worker processes that are
replaced when they die or hang; rows come out in the order of the files, whatever the number of
workers.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repair.config import load_config
from repair.errors import RepairError

__all__ = ["COLUMNS", "SweepSettings", "sweep", "write_sweep"]

COLUMNS = (
    "file", "backend", "reference", "status", "detail", "conflict", "obstacle_id", "from_behind", "ttc_s",
    "contact_ttc_s", "f_ttr_s", "ttb_s", "ttr_s", "maneuver", "peak_deceleration_mps2",
    "peak_lateral_acceleration_mps2", "min_speed_mps", "largest_residual", "probes", "official_feasible",
    "official_collision_free", "official_on_road", "road_method", "certificate", "load_time_s",
    "prepare_time_s", "search_time_s", "solve_time_s", "check_time_s", "official_time_s",
)  # fmt: skip


@dataclass(frozen=True)
class SweepSettings:
    """What a sweep does with each file.

    Attributes
    ----------
    backends, references : sequence of str
    preset : str or None
    overrides : sequence of str
        ``key=value``, for all backends.
    official : bool
        Write each trajectory as a solution file and have CommonRoad's checker judge it.
    certify : bool
        Write each result and recompute its margins from the files (:func:`repair.certify.certify`).
    timeout : float
        Wall time for one file [s], all backends and references together.
    jobs : int
        Worker processes.
    """

    backends: Sequence[str] = ("ego",)
    references: Sequence[str] = ("planner",)
    preset: str | None = None
    overrides: Sequence[str] = ()
    official: bool = True
    certify: bool = False
    timeout: float = 300.0
    jobs: int = 1


def _combinations(settings: SweepSettings) -> list[tuple[str, str]]:
    return [(backend, reference) for reference in settings.references for backend in settings.backends]


def _failed(file: str, backend: str, reference: str, status: str, detail: str) -> dict[str, Any]:
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row.update(file=file, backend=backend, reference=reference, status=status, detail=detail)
    return row


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:300]


def run_file(path: Path, settings: SweepSettings) -> list[dict[str, Any]]:
    """All rows of one file; anything that goes wrong in it is a row."""
    from repair.scene.commonroad import load_scene

    begin = time.perf_counter()
    try:
        config = load_config(settings.preset, overrides=settings.overrides)
        scene = load_scene(
            path,
            planning_problem=config.scene.planning_problem,
            vehicle=config.scene.vehicle,
            horizon=config.scene.horizon,
            after_prediction=config.scene.after_prediction,
        )
    except RepairError as error:
        return [_failed(path.name, b, r, "input_error", _one_line(error)) for b, r in _combinations(settings)]
    loaded = time.perf_counter() - begin
    rows = []
    for backend, reference in _combinations(settings):
        try:
            rows.append(_row(path.name, scene, backend, reference, settings, loaded))
        except RepairError as error:
            rows.append(_failed(path.name, backend, reference, "input_error", _one_line(error)))
        except Exception as error:
            detail = f"{type(error).__name__}: {_one_line(error)}"
            rows.append(_failed(path.name, backend, reference, "crash", detail))
    return rows


def _row(
    file: str, scene: Any, backend: str, reference: str, settings: SweepSettings, loaded: float
) -> dict[str, Any]:
    from repair.api import prepare, search
    from repair.baselines.evasive import evasive_ttr
    from repair.export import to_dict
    from repair.solvers.registry import make_backend
    from repair.types import SearchStatus

    overrides = [*settings.overrides, f"reference.source={reference}"]
    config = load_config(settings.preset, overrides=overrides, backend=backend)
    begin = time.perf_counter()
    prepared = prepare(scene, config)
    prepared_in = time.perf_counter() - begin
    result = search(prepared, make_backend(backend, config))
    content = to_dict(result)
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


def _certificate(result: Any) -> str:
    """``ok``, or the margins that are violated."""
    from repair.certify import certify
    from repair.export import save

    with tempfile.TemporaryDirectory() as folder:
        save(result, Path(folder), figure=False)
        certificate = certify(Path(folder))
    return "; ".join(row.name for row in certificate.rows if not row.ok) or "ok"


def _official(result: Any) -> dict[str, Any]:
    """Write the solution, read it back, have it checked."""
    from commonroad.common.solution import CommonRoadSolutionWriter
    from commonroad.planning.planning_problem import PlanningProblemSet

    from repair.official import check_solution_file

    scene = result.prepared.scene
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "solution.xml"
        file.write_bytes(CommonRoadSolutionWriter(result.to_solution()).dump().encode())
        own = () if scene.recorded_ego is None else (scene.recorded_ego.id,)
        problems = PlanningProblemSet([scene.planning_problem])
        verdict = check_solution_file(file, scene.scenario, problems, without=own)
    return {
        "official_feasible": verdict.feasible,
        "official_collision_free": verdict.collision_free,
        "official_on_road": verdict.on_road,
        "road_method": verdict.road_method,
        "official_time_s": round(time.perf_counter() - begin, 4),
    }


# -- workers ---------------------------------------------------------------------------------------


def _serve(pipe: Any, settings: SweepSettings) -> None:
    """Worker: rows for every path that comes down the pipe, until None comes."""
    while (path := pipe.recv()) is not None:
        pipe.send(run_file(Path(path), settings))


class _Worker:
    """A process that can be asked, waited for, and replaced."""

    def __init__(self, settings: SweepSettings) -> None:
        self.settings = settings
        self.process: Any = None
        self.task: int | None = None
        self.deadline = 0.0

    def give(self, index: int, path: Path) -> None:
        if self.process is None or not self.process.is_alive():
            context = multiprocessing.get_context("spawn")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=_serve, args=(theirs, self.settings), daemon=True)
            self.process.start()
            theirs.close()
        self.pipe.send(str(path))
        self.task, self.deadline = index, time.monotonic() + self.settings.timeout

    def collect(self) -> list[dict[str, Any]] | str | None:
        """Rows, or what became of the worker, or None while it is busy."""
        try:
            if self.pipe.poll(0.02):
                return self.pipe.recv()  # type: ignore[no-any-return]
        except (EOFError, OSError):
            self.stop()
            return f"the worker process ended with exit code {self.process.exitcode}"
        if time.monotonic() > self.deadline:
            self.stop()
            return f"no answer within {self.settings.timeout:g} s"
        return None

    def stop(self) -> None:
        if self.process is not None:
            if self.process.is_alive():
                self.process.kill()
            self.process.join(5.0)


def sweep(folder: Path, settings: SweepSettings, *, progress: bool | None = None) -> list[dict[str, Any]]:
    """Run over all ``*.xml`` files of a folder.

    Parameters
    ----------
    folder : Path
    settings : SweepSettings
    progress : bool, optional
        Show a progress bar; by default only on a terminal.

    Returns
    -------
    list of dict
        Rows with the keys :data:`COLUMNS`, in the order of the files.

    Raises
    ------
    RepairError
        If the folder has no scenario files.
    """
    files = sorted(folder.glob("*.xml")) if folder.is_dir() else []
    if not files:
        raise RepairError(f"{folder} is not a folder with CommonRoad scenario files (*.xml)")
    from tqdm import tqdm

    load_config(settings.preset, overrides=settings.overrides)
    rows: list[list[dict[str, Any]]] = [[] for _ in files]
    workers = [_Worker(settings) for _ in range(max(1, settings.jobs))]
    waiting = iter(range(len(files)))
    shown = sys.stderr.isatty() if progress is None else progress
    with tqdm(total=len(files), disable=not shown, unit="file", leave=False) as bar:
        try:
            for worker in workers:
                _next(worker, waiting, files)
            while any(w.task is not None for w in workers):
                for worker in workers:
                    if worker.task is None or (answer := worker.collect()) is None:
                        continue
                    name = files[worker.task].name
                    if isinstance(answer, str):
                        status = "timeout" if answer.startswith("no answer") else "crash"
                        answer = [
                            _failed(name, b, r, status, answer_text)
                            for b, r in _combinations(settings)
                            for answer_text in (answer,)
                        ]
                    rows[worker.task] = answer
                    bar.update()
                    _next(worker, waiting, files)
        finally:
            for worker in workers:
                worker.stop()
    return [row for group in rows for row in group]


def _next(worker: _Worker, waiting: Iterable[int], files: Sequence[Path]) -> None:
    worker.task = None
    for index in waiting:
        worker.give(index, files[index])
        return


def write_sweep(
    rows: list[dict[str, Any]], folder: Path, settings: SweepSettings, source: Path
) -> list[Path]:
    """Write ``sweep.csv`` and ``sweep.json`` (rows, settings, checksums of the files)."""
    from repair.export import to_json, write_files

    table = io.StringIO()
    writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    content = {
        "settings": {
            "backends": list(settings.backends),
            "references": list(settings.references),
            "preset": settings.preset,
            "overrides": list(settings.overrides),
        },
        "files": {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in sorted(source.glob("*.xml"))},
        "rows": rows,
    }
    json.dumps(content, allow_nan=False)
    return write_files(
        folder, {"sweep.csv": table.getvalue().encode(), "sweep.json": to_json(content).encode()}
    )
