"""The paper's Table II, regenerated: the time of a search, split by phase, with the machine named."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from repair.errors import ConfigError, RepairError
from repair.paper.cases import origin_of, origin_text, paper_scenes
from repair.progress import Progress
from repair.report.tables import DASH, Section, Table, against
from repair.search.result import SearchResult

if TYPE_CHECKING:
    from repair.preparation import Prepared
    from repair.scene.scene import Scene

__all__ = ["literal_transcription", "machine", "table2"]

_PACKAGES = (
    "numpy",
    "scipy",
    "casadi",
    "qpsolvers",
    "osqp",
    "commonroad-io",
    "commonroad-drivability-checker",
)

# Table II of the paper: mean and standard deviation of the search, and of one iteration of it [s].
_PAPER_TIMES = {1: ((1.714, 0.004), (0.426, 0.001)), 2: ((0.506, 0.003), (0.169, 0.001))}


def machine() -> dict[str, Any]:
    """The machine and the versions that a time was measured with."""
    from importlib.metadata import PackageNotFoundError, version

    model = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
        model = next(
            (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), model
        )
    except OSError:
        pass
    versions: dict[str, str | None] = {}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    return {
        "platform": platform.platform(),
        "cpu": model or "unknown",
        "logical_cpus": os.cpu_count(),
        "python": platform.python_version(),
        "blas_threads": os.environ.get("OMP_NUM_THREADS"),
        "versions": versions,
    }


def literal_transcription() -> Callable[[Prepared], tuple[float, int]] | None:
    """``literal`` of :func:`table2`, from ``benchmarks/literal.py`` of a checkout; None where there is none.

    It bisects on the same grid and takes the direct kinematic check, so that what is compared is the
    arithmetic; with CommonRoad's own check on every transition, as in the paper, it would be slower still.
    """
    import sys
    from importlib.util import module_from_spec, spec_from_file_location

    # Beside the sources of a checkout (also where it is installed with -e); no package of that name counts.
    file = Path(__file__).resolve().parents[3] / "benchmarks" / "literal.py"
    name = "repair._literal"
    spec = spec_from_file_location(name, file) if file.is_file() else None
    if spec is None or spec.loader is None:
        return None
    module = module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)

    def search(prepared: Prepared) -> tuple[float, int]:
        found = module.literal_search(
            prepared.source, prepared.conflict, prepared.checker, prepared.config, "direct"
        )
        return found.wall_time, len({p.t_rep for p in found.probes})

    return search


def table2(
    scenario_dir: Path | str | None = None,
    *,
    runs: int = 100,
    backends: Sequence[str] = ("ego", "casadi", "qptr"),
    scenarios: Sequence[int] = (1, 2),
    literal: Callable[[Prepared], tuple[float, int]] | None = None,
    literal_runs: int = 3,
    overrides: Sequence[str] = (),
) -> Table:
    """Table II: time of a whole search and of one iteration of it.

    Parameters
    ----------
    scenario_dir : path, optional
        See :func:`table1`.
    runs : int
        Searches that are timed, after one that is not.
    backends : sequence of str
    scenarios : sequence of int
    literal : callable, optional
        Runs one search by the literal transcription of the paper's formulas and returns its wall time
        [s] and number of iterations; without it the ratio is "not measured". The ratio is that of the
        times of one iteration: the two need not visit the same number of t_rep.
    literal_runs : int
        How often that is done.
    overrides : sequence of ``"key=value"``
        Laid over the presets.

    Raises
    ------
    ConfigError
        If ``runs`` is not positive.
    """
    if runs < 1 or literal_runs < 1:
        raise ConfigError(f"table II needs at least one run, not {min(runs, literal_runs)}")
    scenes = paper_scenes(scenario_dir, scenarios)
    sections, data = [], []
    bar = Progress(len(scenarios) * len(backends) * runs, of="runs")
    for number, scene in scenes.items():
        rows = []
        for name in backends:
            row, prepared = _timed(name, number, scene, runs, overrides, bar.one)
            if name == "ego" and literal is not None and prepared is not None:
                slow = [
                    seconds / max(n, 1) for seconds, n in (literal(prepared) for _ in range(literal_runs))
                ]
                row["literal_iteration_s"] = _spread(slow)
                row["literal_ratio"] = round(float(np.mean(slow)) / row["iteration_s"]["mean"], 3)
            rows.append(row)
        origin = origin_of(scene)
        data.append({"scenario": number, "provenance": origin, "paper": _paper_times(number), "rows": rows})
        sections.append(_section2(number, origin, rows))
    bar.close()
    host = machine()
    title = "Table II: computation time, paper and ours"
    return Table(
        title, tuple(sections), _notes2(runs, host), {"runs": runs, "machine": host, "scenarios": data}
    )


def _notes2(runs: int, host: dict[str, Any]) -> tuple[str, ...]:
    versions = ", ".join(f"{k} {v}" for k, v in host["versions"].items() if v)
    return (
        f"Mean ± standard deviation over {runs} searches after one that is not counted; milliseconds.",
        f"Measured on {host['cpu']} ({host['logical_cpus']} logical CPUs), {host['platform']}, "
        f"Python {host['python']}, {versions}.",
        "Absolute times do not compare across machines; the paper's machine is an Intel Core i7-12700H. "
        "The ratio to the literal transcription of the paper's formulas is measured here, in the same run.",
        "Build: setting up the solver's problem; solve: the solver; check: collision, road, limits, "
        "kinematics; rest: obstacles within reach, sides of passing, the search itself.",
    )


def _spread(values: npt.ArrayLike) -> dict[str, float]:
    array = np.asarray(values, dtype=np.float64)
    return {"mean": float(array.mean()), "std": float(array.std(ddof=1)) if len(array) > 1 else 0.0}


def _paper_times(number: int) -> dict[str, dict[str, float]]:
    total, each = _PAPER_TIMES[number]
    return {"search_s": {"mean": total[0], "std": total[1]}, "iteration_s": {"mean": each[0], "std": each[1]}}


def _timed(
    name: str, number: int, scene: Scene, runs: int, overrides: Sequence[str], step: Callable[[], Any]
) -> tuple[dict[str, Any], Prepared | None]:
    """Time ``runs`` searches of one backend."""
    from repair.api import find
    from repair.config import load_config
    from repair.preparation import prepare
    from repair.solvers.registry import make_backend

    config = load_config(preset=f"scenario_{number}", overrides=[f"backend={name}", *overrides])
    row: dict[str, Any] = {"backend": name, "literal_iteration_s": None, "literal_ratio": None}
    try:
        backend = make_backend(name, config)
        prepared = prepare(scene, config)
    except RepairError as error:
        return {**row, "status": f"not available: {error}"}, None

    def search() -> SearchResult:
        return find(prepared, backend)

    found = search()  # not timed: matrices are made and libraries loaded
    walls, parts = [], []
    for _ in range(runs):
        begin = time.perf_counter()
        found = search()
        walls.append(time.perf_counter() - begin)
        parts.append([
            sum(p.solve.build_time for p in found.probes),
            sum(p.solve.solve_time for p in found.probes),
            sum(p.check_time for p in found.probes),
        ])  # fmt: skip
        step()
    iterations = max(len(found.probes), 1)
    columns = np.column_stack([parts, np.array(walls) - np.sum(parts, axis=1)])
    row |= {
        "status": found.status.value,
        "f_ttr_s": against(None, found.f_ttr)["ours"],
        "iterations": len(found.probes),
    }
    row |= {"search_s": _spread(walls), "iteration_s": _spread(np.array(walls) / iterations)}
    for key, column in zip(("build_s", "solve_s", "check_s", "rest_s"), columns.T, strict=True):
        row[key] = _spread(column)
    return row, prepared


def _section2(number: int, origin: dict[str, Any], rows: Sequence[dict[str, Any]]) -> Section:
    def span(values: dict[str, float]) -> str:
        return f"{1e3 * values['mean']:.2f} ± {1e3 * values['std']:.2f}"

    paper = _paper_times(number)
    columns = (
        "",
        "search",
        "per iteration",
        "iterations",
        "build",
        "solve",
        "check",
        "rest",
        "literal / ours",
    )
    lines = [("paper", span(paper["search_s"]), span(paper["iteration_s"]), *([DASH] * 6))]
    for row in rows:
        if "search_s" not in row:
            lines.append((row["backend"], *([DASH] * 7), row["status"]))
            continue
        ratio = "not measured" if row["backend"] == "ego" else DASH
        if row["literal_ratio"] is not None:
            ratio = f"{row['literal_ratio']:.0f}"
        times = [span(row[key]) for key in ("build_s", "solve_s", "check_s", "rest_s")]
        lines.append(
            (
                row["backend"],
                span(row["search_s"]),
                span(row["iteration_s"]),
                str(row["iterations"]),
                *times,
                ratio,
            )
        )
    return Section(
        f"Scenario {number} ({origin_text(origin)}), times in ms", columns, tuple(lines), 1, "this machine"
    )
