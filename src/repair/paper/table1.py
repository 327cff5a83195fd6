"""The paper's Table I, regenerated: what the paper prints, what comes out here, and the difference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.backend.base import SolveStatus
from repair.check.verdict import Reason, Violation
from repair.errors import RepairError
from repair.paper.cases import origin_of, origin_text, paper_scenes
from repair.progress import Progress
from repair.report.tables import Section, Table, against, decimal
from repair.search.result import Probe, SearchResult

if TYPE_CHECKING:
    from repair.config import Config
    from repair.preparation import Prepared
    from repair.scene.scene import Scene

__all__ = ["METHODS", "PEAK_NAMES", "Method", "peak_of", "status_of", "table1"]

# Table I of the paper: (F-)TTR [s], and peak [m/s²] or the word that stands in its place.
_PAPER: dict[tuple[str, int], tuple[float, float | str]] = {
    ("qptr_at_ttr", 1): (2.6, "not solvable"),
    ("qptr_at_ttr", 2): (1.3, "infeasible"),
    ("ego", 1): (1.6, -1.86),
    ("ego", 2): (0.8, 4.82),
}
_PAPER_TTC = {1: 2.9, 2: 1.6}
PEAK_NAMES = {1: "max. lon. dec.", 2: "max. lat. acc."}


@dataclass(frozen=True)
class Method:
    """One row of Table I: its key, its name, and the configuration that makes it."""

    key: str
    name: str
    driver: str
    backend: str
    overrides: tuple[str, ...] = ()
    in_paper: bool = True


METHODS = (
    Method("qptr_at_ttr", "QPTR at TTR", "at_ttr", "qptr"),
    Method("ego", "Soft, two stages (the paper's)", "f_ttr", "ego"),
    Method("casadi_ipopt", "Hard NLP (IPOPT)", "f_ttr", "casadi", ("casadi.solver=ipopt",), False),
    Method("casadi_sqp", "Hard NLP (sqpmethod)", "f_ttr", "casadi", ("casadi.solver=sqpmethod",), False),
    Method("qptr", "QPTR in the search", "f_ttr", "qptr", (), False),
)


def table1(
    scenario_dir: Path | str | None = None,
    *,
    methods: Sequence[Method] = METHODS,
    scenarios: Sequence[int] = (1, 2),
    overrides: Sequence[str] = (),
) -> Table:
    """Table I: (F-)TTR and peak accelerations of QPTR at its TTR, the paper's method, and three more rows.

    Parameters
    ----------
    scenario_dir : path, optional
        Folder that may hold the official file of Scenario 1; the reconstruction is used otherwise.
    methods : sequence of Method
    scenarios : sequence of int
        Numbers of the paper's scenarios.
    overrides : sequence of ``"key=value"``
        Laid over the presets.

    Raises
    ------
    RepairError
        If a scenario cannot be used. A backend that is not there becomes a row that says so.
    """
    scenes = paper_scenes(scenario_dir, scenarios)
    sections: list[Section] = []
    data: list[dict[str, Any]] = []
    bar = Progress(len(scenarios) * len(methods), of="rows of table I")
    for number, scene in scenes.items():
        results = []
        for method in methods:
            results.append(_result(method, number, scene, overrides))
            bar.one()
        ttc = next((r["ttc_s"] for r in results if r["ttc_s"] is not None), None)
        origin = origin_of(scene)
        sections.append(_section1(number, origin, ttc, results, methods))
        ttcs = against(_PAPER_TTC[number], ttc)
        data.append({"scenario": number, "provenance": origin, "ttc_s": ttcs, "rows": results})
    bar.close()
    notes = [
        "Difference: ours minus the paper's. docs/reproduction.md explains deviations.",
        "At TTR: the latest start of a fixed evasive manoeuvre, then one repair there. In the search: the "
        "latest t_rep whose repair passes every check.",
    ]
    if any(d["provenance"]["kind"] == "reconstruction" for d in data):
        notes.append("A reconstruction is generated from the paper's text; it is not the paper's own file.")
    title = "Table I: (F-)TTR and repair, paper and ours"
    return Table(title, tuple(sections), tuple(notes), {"scenarios": data})


def _config(method: Method, number: int, overrides: Sequence[str]) -> Config:
    from repair.config import load_config

    keys = [f"driver={method.driver}", f"backend={method.backend}", *method.overrides, *overrides]
    return load_config(preset=f"scenario_{number}", overrides=keys)


def _result(method: Method, number: int, scene: Scene, overrides: Sequence[str]) -> dict[str, Any]:
    """One cell group of Table I as plain values."""
    paper_ttr, paper_peak = _PAPER.get((method.key, number), (None, None))
    row: dict[str, Any] = {
        "key": method.key, "method": method.name, "ttc_s": None, "paper_status": None,
        "ttr_s": against(paper_ttr, None), "maneuver": None, "probes": [],
    }  # fmt: skip
    numeric = paper_peak if isinstance(paper_peak, float) else None
    row["paper_status"] = paper_peak if isinstance(paper_peak, str) else None
    row["peak_mps2"] = against(numeric, None)
    try:
        prepared, found, ttr = _run(_config(method, number, overrides), scene)
    except RepairError as error:
        return {**row, "status": "unavailable", "status_text": f"not available: {error}"}
    probe = found.best if found.best is not None else (found.probes[0] if found.probes else None)
    peak = None
    # Also of a repair that the checker refuses: the paper's "infeasible" is of that kind.
    if probe is not None and probe.solve.curve is not None and (probe.feasible or method.driver == "at_ttr"):
        peak = peak_of(prepared, probe, number)
    row |= {
        "ttc_s": against(None, prepared.conflict.time)["ours"],
        "ttr_s": against(paper_ttr, ttr),
        "peak_mps2": against(numeric, peak),
        "maneuver": _maneuver(found.best),
        "probes": [{"t_rep_s": round(p.t_rep, 6), "answer": _answer(p)} for p in found.probes],
    }
    text = _answer(found.probes[0]) if method.driver == "at_ttr" and found.probes else status_of(found)
    return {**row, "status": found.status.value, "status_text": text}


def _run(config: Config, scene: Scene) -> tuple[Prepared, SearchResult, float | None]:
    """Prepare and run one method; (F-)TTR as the driver has it."""
    from repair.api import find
    from repair.metrics.base import Asked
    from repair.preparation import prepare
    from repair.solvers.registry import make_backend

    backend = make_backend(config.backend, config)
    prepared = prepare(scene, config)
    asked = Asked(prepared, config.evasive)
    found = find(prepared, backend, asked=asked)
    return prepared, found, asked.evasive.ttr if config.driver == "at_ttr" else found.f_ttr


def peak_of(prepared: Prepared, probe: Probe, number: int) -> float:
    """The acceleration that Table I prints for a scenario [m/s²], of a repair that has a curve."""
    from repair.curves.base import SplicedCurve

    assert probe.solve.curve is not None
    curve = SplicedCurve(prepared.reference, probe.solve.curve, probe.t_rep)
    peaks = prepared.checker.peaks(curve, prepared.t_end, probe.t_rep)
    return peaks.min_acceleration if number == 1 else peaks.max_lateral_acceleration


def _answer(probe: Probe) -> str:
    """What one t_rep came to; the ways to fail have different names."""
    if probe.feasible:
        return "feasible"
    if probe.solve.curve is not None:
        return "rejected: " + "; ".join(_words(v) for v in probe.verdict.violations)
    if Reason.NO_PASSAGE in {v.reason for v in probe.verdict.violations}:
        return "no way past is open"
    names = {SolveStatus.NO_CORRIDOR: "no corridor", SolveStatus.INFEASIBLE: "no solution"}
    return names.get(probe.solve.status, probe.solve.status.value.replace("_", " "))


def _words(violation: Violation) -> str:
    """Margin and collision name the obstacle only; who reads has to know which of the two it was."""
    joint = {Reason.MARGIN: "margin of ", Reason.COLLISION: "contact with "}.get(violation.reason, "")
    return joint + violation.detail if violation.detail else violation.reason.value.replace("_", " ")


def _maneuver(probe: Probe | None) -> str | None:
    return None if probe is None or probe.maneuver is None else probe.maneuver.value


def status_of(found: SearchResult) -> str:
    """In words: how the repair passes the conflict, and what the earliest refused t_rep came to."""
    if not found.probes:
        return found.status.sentence
    refused = [p for p in found.probes if not p.feasible]
    parts = [] if found.best is None else [f"feasible ({_maneuver(found.best) or 'follow'})"]
    if refused:
        first = min(refused, key=lambda p: p.t_rep)
        parts.append(f"{first.t_rep:.1f} s: {_answer(first)}")
    return "; ".join(parts)


def _three(values: dict[str, float | None], digits: int) -> tuple[str, str, str]:
    paper, ours, difference = values["paper"], values["ours"], values["difference"]
    return decimal(paper, digits), decimal(ours, digits), decimal(difference, digits, True)


def _section1(
    number: int,
    origin: dict[str, Any],
    ttc: float | None,
    results: Sequence[dict[str, Any]],
    methods: Sequence[Method],
) -> Section:
    head = against(_PAPER_TTC[number], ttc)
    heading = (
        f"Scenario {number} ({origin_text(origin)}): TTC {decimal(head['paper'], 1)} s in the paper, "
        f"{decimal(head['ours'], 1)} s here, difference {decimal(head['difference'], 1, True)} s"
    )
    peak = PEAK_NAMES[number]
    columns = (
        "", "(F-)TTR [s], paper", "ours", "difference",
        f"{peak} [m/s²], paper", "ours", "difference", "status",
    )  # fmt: skip
    rows = []
    for result in results:
        ttr, top = _three(result["ttr_s"], 1), _three(result["peak_mps2"], 2)
        paper = result["paper_status"] or top[0]
        rows.append((result["method"], *ttr, paper, *top[1:], result["status_text"]))
    above = sum(m.in_paper for m in methods)
    return Section(heading, columns, tuple(rows), above if above < len(methods) else None)
