"""What drawtonomy-commonroad says of the files of folders; run in its environment, one JSON object a line."""

from __future__ import annotations

import json
import sys
import warnings
from pathlib import Path
from typing import Any

from drawtonomy_cr.serve import build_bundle
from drawtonomy_cr.trace import TraceSelfCheckError, _solution_states, self_check
from drawtonomy_cr.verdict import build_verdict


def traced(bundle: Any, dt: float) -> tuple[dict[str, Any], str]:
    """The trace, and what the package's own check objects to; empty for nothing."""
    trace = json.loads(bundle.trace.read_text(encoding="utf-8"))
    solution = None if bundle.solution is None else _solution_states(bundle.solution)
    try:
        self_check(trace, dt, solution_states=solution, verbose=False)
    except TraceSelfCheckError as error:
        return trace, " ".join(str(error).split())[:300]
    issued = [plan["t"] for plan in trace["tracks"][0]["plans"]]
    if len(set(issued)) != len(issued):
        return trace, "two plans at one time"
    return trace, ""


def judged(bundle: Any, trace: dict[str, Any]) -> str:
    """Where the package's verdict on the same files differs from ours; empty for nowhere."""
    ours = json.loads(bundle.verdict.read_text(encoding="utf-8"))
    theirs = build_verdict(bundle.scenario, bundle.solution)
    said = []
    for key in ("schema", "scenarioFingerprint", "solutionFingerprint", "benchmarkId", "scenarioId", "dt"):
        if ours.get(key) != theirs[key]:
            said.append(f"{key} {ours.get(key)}, and {theirs[key]}")
        if key.endswith("Fingerprint") and trace.get(key) != theirs[key]:
            said.append(f"{key} of the trace {trace.get(key)}, and {theirs[key]}")
    for mine, other in zip(ours["checks"], theirs["checks"], strict=True):
        if (mine["name"], mine["status"]) != (other["name"], other["status"]):
            said.append(f"{mine['name']} {mine['status']}, and {other['name']} {other['status']}")
    return "; ".join(said)


def row(folder: Path) -> dict[str, Any]:
    """What the package says of one folder."""
    bundle, problem = build_bundle(folder)
    if bundle is None or bundle.trace is None:
        none = {"states": 0, "plans": 0, "candidates": 0, "solution": False, "verdict": ""}
        return {"name": folder.name, **none, "trace": problem or "no trace is found"}
    from commonroad.common.file_reader import CommonRoadFileReader

    scenario, _ = CommonRoadFileReader(str(bundle.scenario)).open()
    trace, said = traced(bundle, float(scenario.dt))
    track = trace["tracks"][0]
    verdict = ""
    if bundle.solution is not None:
        verdict = "no verdict is found" if bundle.verdict is None else judged(bundle, trace)
    return {
        "name": folder.name, "states": len(track["driven"]), "plans": len(track["plans"]),
        "candidates": sum(len(plan.get("candidates", [])) for plan in track["plans"]),
        "solution": bundle.solution is not None, "trace": said, "verdict": verdict,
    }  # fmt: skip


def main() -> int:
    """One line for each folder."""
    warnings.simplefilter("ignore")
    for folder in sys.argv[1:]:
        print(json.dumps(row(Path(folder))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
