"""The files of a result, written as one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.io.commonroad import is_solved, to_solution
from repair.io.files import write_files
from repair.io.result_json import to_dict, to_json

if TYPE_CHECKING:
    from repair.api import RepairResult

__all__ = ["save", "saved"]


# -- files -----------------------------------------------------------------------------------------


def save(result: RepairResult, folder: Path, *, figure: bool = True) -> list[Path]:
    """Write ``result.json``, the solution file, and the figures; see :func:`saved`.

    Returns
    -------
    list of Path
        What was written, ``result.json`` first.
    """
    return saved(result, folder, figure=figure)[1]


def saved(result: RepairResult, folder: Path, *, figure: bool = True) -> tuple[dict[str, Any], list[Path]]:
    """Write ``result.json``, the solution file, and the figures into a folder, which is made if need be.

    A reconstruction, which nobody else has, is put beside them. Without a verified trajectory there
    is no solution file, and one of an earlier run in the same folder is removed.

    Returns
    -------
    dict
        The content of ``result.json``, with the names of the other files.
    list of Path
        What was written, ``result.json`` first.

    Raises
    ------
    OutputError
        If the folder or a file in it cannot be written; nothing half-written is left.
    """
    scene, content = result.prepared.scene, to_dict(result)
    name = re.sub(r"[^\w.-]", "_", scene.id)[:100]
    solution, figures = f"solution_{name}.xml", ("profiles.png", "birdseye.png")
    files: dict[str, bytes] = {}
    if is_solved(result):
        from commonroad.common.solution import CommonRoadSolutionWriter

        content["solution_file"] = solution
        files[solution] = CommonRoadSolutionWriter(to_solution(result)).dump().encode()
    if figure:
        from repair.report.birdseye import birdseye_figure
        from repair.report.profiles import profile_figure
        from repair.report.style import render

        content["figure_files"] = list(figures)
        for file, draw in zip(figures, (profile_figure, birdseye_figure), strict=True):
            files[file] = render(draw(result))
    if content["provenance"]["kind"] == "reconstruction" and scene.path is not None and scene.path.is_file():
        content["scenario_file"] = scene.path.name
        files[scene.path.name] = scene.path.read_bytes()
    result_file = {"result.json": to_json(content).encode()}
    stale = [file for file in (solution, *figures) if file not in files]
    return content, write_files(folder, {**result_file, **files}, stale)
