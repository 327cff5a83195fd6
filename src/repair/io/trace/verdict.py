"""What CommonRoad's own checker says of a solution, as a verdict file of drawtonomy.

The format is ``drawtonomy-verdict/1``, of the package drawtonomy-commonroad 0.3.0; the writer is our own.
Judged are the two files as they are, each read anew: the scenario with all that it holds, whatever of it
the search left out.
"""

from __future__ import annotations

import json
import tempfile
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

from repair.io.official import OfficialVerdict, check_solution_file
from repair.io.trace.fingerprint import fingerprint
from repair.scene.reading import read_file, read_solution

__all__ = ["SCHEMA", "verdict_bytes"]

SCHEMA = "drawtonomy-verdict/1"

_TOOL = "commonroad-drivability-checker"
#: CommonRoad's questions in the order in which ``valid_solution`` asks them, and what they are called here.
_QUESTIONS = {
    "solved_all_problems": "solved",
    "goal_reached": "goal",
    "starts_at_correct_state": "starts",
    "obstacle_collision": "collision_free",
    "boundary_collision": "on_road",
    "ego_collision": "egos_apart",
    "solution_feasible": "feasible",
}


def verdict_bytes(scenario: bytes, solution: bytes) -> bytes:
    """The content of the file.

    Parameters
    ----------
    scenario, solution : bytes
        CommonRoad XML.

    Returns
    -------
    bytes
        JSON. It says when it was made, so that it is another one each time.

    Raises
    ------
    ScenarioError
        If one of the files cannot be read.
    """
    from commonroad.planning.planning_problem import PlanningProblemSet

    with tempfile.TemporaryDirectory(prefix="repair-verdict-") as aside:
        files = Path(aside) / "scenario.xml", Path(aside) / "solution.xml"
        for file, written in zip(files, (scenario, solution), strict=True):
            file.write_bytes(written)
        read, solved = read_file(files[0]), read_solution(files[1])
        problems = PlanningProblemSet(list(read.problems.values()))
        answer = check_solution_file(files[1], read.scenario, problems)
    models = [part.vehicle_model.name for part in solved.planning_problem_solutions]
    content = {
        "schema": SCHEMA,
        "scenarioFingerprint": fingerprint(scenario),
        "solutionFingerprint": fingerprint(solution),
        "benchmarkId": solved.benchmark_id,
        "scenarioId": read.benchmark_id,
        "dt": float(read.scenario.dt),
        "tool": {"name": _TOOL, "version": version(_TOOL)},
        "generatedAt": f"{datetime.now(timezone.utc):%Y-%m-%dT%H:%M:%SZ}",
        "checks": [_check(answer, *question, models) for question in _QUESTIONS.items()],
    }
    known = {key: value for key, value in content.items() if value is not None}
    return (json.dumps(known, indent=2, allow_nan=False) + "\n").encode()


def _check(answer: OfficialVerdict, name: str, ours: str, models: list[str]) -> dict[str, Any]:
    """One question with its answer; ``SKIP`` where CommonRoad could not ask it itself."""
    made: dict[str, Any] = {"name": name}
    if name == "boundary_collision" and answer.road_method != "triangulation":
        made |= {"status": "SKIP", "message": _instead(answer)}
    elif getattr(answer, ours):
        made["status"] = "PASS"
    else:
        made |= {"status": "FAIL", "message": answer.words.get(ours, f"{name}: no")}
    if name == "solution_feasible" and models:
        made["vehicleModel"] = models[0]
    return made


def _instead(answer: OfficialVerdict) -> str:
    """Why the edge of the road was not asked about as usual, and what another method says."""
    why = "the package triangle is not installed, or cannot lay out this road"
    if answer.road_method == "none":
        return f"not asked: {why}"
    word = "stays on" if answer.on_road else "leaves"
    return f"not asked: {why}; by {answer.road_method} the ego {word} the road"
