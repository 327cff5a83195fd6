"""The files of a result, written as one; what is written is a list of formats."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from repair.bounds.latest import Bound
from repair.bounds.written import PROOF_FILE, proof_bytes
from repair.errors import OutputError, foreign
from repair.io.commonroad import (
    in_the_form_of_a_solution,
    no_solution_because,
    scenario_bytes,
    to_solution,
)
from repair.io.files import write_files
from repair.io.result_json import DRAWING_FILE, RESULT_FILE, drawing_bytes, to_json
from repair.io.trace.considered import Considered
from repair.io.trace.planning import trace_bytes
from repair.io.trace.verdict import verdict_bytes
from repair.mitigation.mitigate import Mitigation
from repair.outcome.data import Outcome
from repair.registry import Registry, called, loaded
from repair.report.style import FORMATS as FIGURE_FORMATS
from repair.report.style import FigureStyle, render
from repair.scene.scene import Scene
from repair.search.result import SearchStatus
from repair.vehicle.parameters import VEHICLE_NAMES
from repair.vehicle.states import DrivenStates

__all__ = ["FORMATS", "Files", "Format", "Saved", "register", "saved"]

REPORT_FILE = "report.html"
_FIGURES = ("profiles", "birdseye", "timeline")


@dataclass(frozen=True)
class Saved:
    """What a format may write from.

    Attributes
    ----------
    outcome : Outcome
    scene : Scene
    states : DrivenStates
        What is driven, at the scenario's steps.
    status : SearchStatus
    figures : bool or FigureStyle
        Whether figures are wanted, and how they are written.
    bounds : mapping
        From when on it is proven too late, by kind.
    mitigation : Mitigation or None
        The motion that hits least hard, where nothing was found.
    considered : tuple of Considered or None
        The trajectories that were looked at, where a planning trace of them is wanted.
    """

    outcome: Outcome
    scene: Scene
    states: DrivenStates
    status: SearchStatus
    figures: bool | FigureStyle
    bounds: Mapping[str, Bound] = field(default_factory=dict)
    mitigation: Mitigation | None = None
    considered: tuple[Considered, ...] | None = None

    @property
    def name(self) -> str:
        """The benchmark id, fit for the name of a file."""
        return re.sub(r"[^\w.-]", "_", self.scene.id)[:100]


@dataclass(frozen=True)
class Files:
    """What a format writes.

    Attributes
    ----------
    files : dict
        Name to content.
    record : dict
        Keys of ``result.json`` that name the files.
    stale : tuple of str
        Names that an earlier run would have left, and that are not written now.
    """

    files: dict[str, bytes]
    record: dict[str, Any]
    stale: tuple[str, ...] = ()


Format = Callable[[Saved], Files]


def solution_file(result: Saved) -> Files:
    """The driven trajectory as a CommonRoad solution, where there is a verified one."""
    name, content = f"solution_{result.name}.xml", _solution(result)
    if content is None:
        return Files({}, {"solution_file": None}, (name,))
    return Files({name: content}, {"solution_file": name})


def _solution(result: Saved) -> bytes | None:
    """The content of the solution file; None where there is no verified trajectory."""
    if no_solution_because(result.scene, result.status):
        return None
    from commonroad.common.solution import CommonRoadSolutionWriter

    solution = to_solution(result.scene, result.states, result.status)
    written: str = CommonRoadSolutionWriter(solution).dump()
    return written.encode()


def mitigation_file(result: Saved) -> Files:
    """The motion that hits least hard, in the form of a solution, which it is not: it ends in a collision."""
    name, told = f"mitigation_{result.name}.xml", result.outcome.record.get("mitigation")
    best = None if result.mitigation is None else result.mitigation.best
    if told is None or best is None or result.scene.vehicle.type_id not in VEHICLE_NAMES:
        return Files({}, {}, (name,))
    from commonroad.common.solution import CommonRoadSolutionWriter

    written = in_the_form_of_a_solution(result.scene, best.states)
    content = CommonRoadSolutionWriter(written).dump().encode()
    return Files({name: content}, {"mitigation": {**told, "solution_file": name}})


def drawing_file(result: Saved) -> Files:
    """What the figures show, so that they can be drawn from the folder."""
    content = drawing_bytes(result.outcome)
    if content is None:
        return Files({}, {"drawing_file": None}, (DRAWING_FILE,))
    return Files({DRAWING_FILE: content}, {"drawing_file": DRAWING_FILE})


def figure_files(result: Saved) -> Files:
    """The figures, where they are wanted."""
    stale = tuple(f"{name}.{form}" for name in _FIGURES for form in FIGURE_FORMATS)
    if not result.figures:
        return Files({}, {"figure_files": []}, stale)
    style = FigureStyle() if result.figures is True else result.figures
    from repair.report.birdseye import birdseye_figure
    from repair.report.profiles import profile_figure
    from repair.report.timeline import timeline_figure

    drawing = (profile_figure, birdseye_figure, timeline_figure)
    made = {name: draw(result.outcome, style) for name, draw in zip(_FIGURES, drawing, strict=True)}
    drawn = {
        f"{name}.{style.format}": render(figure, style.format)
        for name, figure in made.items()
        if figure is not None
    }
    return Files(drawn, {"figure_files": list(drawn)}, stale)


def report_file(result: Saved) -> Files:
    """The page of the result, where figures are wanted; without Plotly the record says why there is none."""
    none: dict[str, Any] = {"report_file": None}
    if not result.figures:
        return Files({}, none, (REPORT_FILE,))
    from repair.report.page.html import PlotlyMissing
    from repair.report.page.one import result_page

    try:
        page = result_page(result.outcome)
    except PlotlyMissing as error:
        return Files({}, none | {"report_file_problem": str(error)}, (REPORT_FILE,))
    return Files({REPORT_FILE: page.encode("utf-8", "backslashreplace")}, {"report_file": REPORT_FILE})


def scenario_file(result: Saved) -> Files:
    """The scenario, if it is a reconstruction or from memory: nobody else has it."""
    path, kind = result.scene.path, result.outcome.record["provenance"]["kind"]
    if kind == "reconstruction" and path is not None and path.is_file():
        return Files({path.name: path.read_bytes()}, {"scenario_file": path.name})
    if kind != "memory":
        return Files({}, {"scenario_file": None})
    name = f"{result.name}.xml"
    try:
        content = scenario_bytes(result.scene)
    except OutputError as error:
        return Files({}, {"scenario_file": None, "scenario_file_problem": str(error)}, (name,))
    return Files(
        {name: content}, {"scenario_file": name, "scenario_sha256": hashlib.sha256(content).hexdigest()}
    )


def trace_files(result: Saved) -> Files:
    """What was planned, and the verdict on it, for drawtonomy; where a trace is wanted.

    Without a verified trajectory there is no solution, and so no verdict on one.
    """
    stem = f"solution_{result.name}"
    traced, judged = f"{stem}.planning-trace.json", f"{stem}.verdict.json"
    if result.considered is None:
        return Files({}, {}, (traced, judged))
    scenario, solution = _scenario(result.scene), _solution(result)
    record, scene = result.outcome.record, result.scene
    files = {traced: trace_bytes(record, scene, result.states, result.considered, scenario, solution)}
    if scenario is not None and solution is not None:
        files[judged] = verdict_bytes(scenario, solution)
    return Files(
        files, {"trace_file": traced, "verdict_file": judged if judged in files else None}, (traced, judged)
    )


def _scenario(scene: Scene) -> bytes | None:
    """The scenario's file as it was read, or as it is written beside the result; None where it is no more."""
    if scene.path is None:
        try:
            return scenario_bytes(scene)
        except OutputError:
            return None
    content = scene.path.read_bytes() if scene.path.is_file() else b""
    return content if hashlib.sha256(content).hexdigest() == scene.sha256 else None


def proof_file(result: Saved) -> Files:
    """The proofs of the bounds, where there are any."""
    said = result.outcome.record.get("bound")
    if not any(bound.proven for bound in result.bounds.values()) or said is None:
        return Files({}, {}, (PROOF_FILE,))
    proofs = proof_bytes(result.bounds)
    named = {"proof_file": PROOF_FILE, "proof_sha256": hashlib.sha256(proofs).hexdigest()}
    return Files({PROOF_FILE: proofs}, {"bound": {**said, **named}})


FORMATS: Registry[Format] = Registry(
    "output format",
    {
        "solution": solution_file,
        "mitigation": mitigation_file,
        "figures": figure_files,
        "report": report_file,
        "scenario": scenario_file,
        "drawing": drawing_file,
        "proof": proof_file,
        "trace": trace_files,
    },
    error=OutputError,
    group="repair.formats",
    admit=called,
)


def register(name: str, written: Format) -> None:
    """Add an output format of your own for this process; every result that is saved then has its files.

    Parameters
    ----------
    name : str
    written : callable
        A function of a result to files: :class:`Files`.

    Raises
    ------
    OutputError
        If the name is taken.
    """
    FORMATS.register(name, written)


def saved(result: Saved, folder: Path) -> tuple[Outcome, list[Path]]:
    """Write ``result.json`` and the files of every format into a folder, which is made if need be.

    Files of an earlier run that have no successor are removed.

    Returns
    -------
    Outcome
        Its record names the files.
    list of Path
        What was written, ``result.json`` first.

    Raises
    ------
    OutputError
        If a format fails, or the folder or a file in it cannot be written; nothing half-written is left.
    """
    record = dict(result.outcome.record)
    files: dict[str, bytes] = {}
    stale: list[str] = []
    for name, written in FORMATS.items():
        with foreign(f"format {name!r}", OutputError):
            made = loaded(written)(result)
        record.update(made.record)
        files.update(made.files)
        stale += made.stale
    result_file = {RESULT_FILE: to_json(record).encode()}
    gone = [name for name in stale if name not in files]
    return replace(result.outcome, record=record), write_files(folder, {**result_file, **files}, gone)
