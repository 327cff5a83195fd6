"""docs/sweep.md and the figures of docs/evaluation.md, written from the rows of a study.

repair study benchmarks/evaluation.yaml --out OUT --workers 2 && python -m benchmarks.evaluation OUT
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from repair.errors import RepairError
from repair.io.files import write_files
from repair.report.sweep import sweep_report
from repair.study.rows import as_sweep_row
from repair.study.store import Store

Row = Mapping[str, Any]
COMMAND = "repair study benchmarks/evaluation.yaml"
_BLOCK = re.compile(r"(<!-- figures of the study -->\n).*?(<!-- /figures of the study -->)", re.DOTALL)
_BROKEN = ("crash", "timeout", "memory", "input_error")
_JUDGED = (
    "official_feasible", "official_collision_free", "official_on_road", "official_solved",
    "official_vehicle_model", "official_connected", "official_start", "official_egos_apart",
)  # fmt: skip


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser("python -m benchmarks.evaluation", description=__doc__)
    parser.add_argument("study", type=Path, help="the folder of the study")
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    arguments = parser.parse_args(argv)
    with Store(arguments.study, readonly=True) as store:
        missing = sum(not task["done"] for task in store.tasks())
        rows = [as_sweep_row(row) for row in store.rows()]
    if missing or not rows:
        raise RepairError(f"{missing} rows of the study in {arguments.study} are not there yet")
    page = arguments.docs / "evaluation.md"
    text, found = _BLOCK.subn(
        lambda block: block[1] + "\n".join(said(rows)) + "\n" + block[2], page.read_text("utf-8")
    )
    if found != 1:
        raise RepairError(f"{page} has no place for the figures, or several")
    report = sweep_report(rows, COMMAND)
    made = {"evaluation.md": text.encode(), "sweep.md": report.encode("utf-8", "backslashreplace")}
    print(*write_files(arguments.docs, made), sep="\n")
    return 0


def said(rows: Sequence[Row]) -> list[str]:
    """What the rows say, a line of a list each."""
    backends = list(dict.fromkeys(row["backend"] for row in rows))
    cases: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        cases.setdefault((row["file"], row["reference"]), {})[row["backend"]] = row
    broken = [row for row in rows if row["status"] in _BROKEN]
    conflicts = [
        case
        for case in cases.values()
        if any(row["status"] not in ("no_conflict", *_BROKEN) for row in case.values())
    ]
    return [
        f"- {len(rows)} searches, {len(cases)} trajectories to follow, {len(broken)} rows that "
        "could not be run.",
        *_soundness(rows),
        *_repaired(conflicts, backends),
        *_apart(conflicts, cases, backends),
        f"- {sum(bool(row['decided_by']) for row in rows)} answers hang on the end of a prediction (column "
        "`decided_by` of the study).",
    ]


def _soundness(rows: Sequence[Row]) -> list[str]:
    judged = [row for row in rows if row["official_feasible"] is not None]
    rejected = sum(any(row.get(key) is False for key in _JUDGED) for row in judged)
    certified = [row for row in rows if row["certificate"]]
    violated = sum(row["certificate"] != "ok" for row in certified)
    return [
        f"- {len(judged)} trajectories judged by all that `valid_solution` asks for but the goal: "
        f"{rejected} rejected.",
        f"- {len(certified)} certificates recomputed from the written files, {violated} with a violated "
        "margin. The certificate shares no measurement with the checker.",
    ]


def _found(row: Row | None, *, alone: bool = False) -> bool:
    return row is not None and row["status"] == "found" and not (alone and row["by_fallback"])


def _share(part: int, whole: int) -> str:
    return f"{part} ({100.0 * part / whole:.1f} %)" if whole else "none"


def _repaired(conflicts: Sequence[Mapping[str, Row]], backends: Sequence[str]) -> list[str]:
    """How many conflicts are repaired: with a backend chosen, and by that alone."""
    braking = [c for c in conflicts if any(isinstance(row["ttb_s"], float) for row in c.values())]
    lines = [
        f"- Of {len(conflicts)} conflicts, {len(braking)} of which braking at 8 m/s² along the path avoids:"
    ]
    for name in backends:
        chosen = sum(_found(c.get(name)) for c in conflicts)
        alone = sum(_found(c.get(name), alone=True) for c in conflicts)
        helped = sum(_found(c.get(name), alone=True) for c in braking)
        lines.append(
            f"  with `{name}` chosen {_share(chosen, len(conflicts))} are repaired, by itself "
            f"{_share(alone, len(conflicts))}, and {_share(helped, len(braking))} of those that "
            "braking avoids."
        )
    return ["\n".join(lines)]


def _apart(
    conflicts: Sequence[Mapping[str, Row]], cases: Mapping[Any, Mapping[str, Row]], backends: Sequence[str]
) -> list[str]:
    """Where backends do not agree."""
    missed = {
        alone: sum(
            not _found(c.get(name), alone=alone) and any(_found(row) for row in c.values())
            for c in conflicts
            for name in backends
        )
        for alone in (False, True)
    }
    lines = [
        f"- In {missed[False]} searches a backend finds nothing where another's repair is verified; each by "
        f"itself would in {missed[True]}, and the table below says why."
    ]
    pairs = [c for c in cases.values() if {"casadi", "ego"} <= c.keys()]
    if pairs:
        lower = sum(_value(c["casadi"]) < _value(c["ego"]) - 1e-9 for c in pairs)
        above = sum(_value(c["casadi"]) > _value(c["ego"]) + 1e-9 for c in pairs)
        lines.append(
            f"- `casadi`'s F-TTR is not below `ego`'s in {len(pairs) - lower} of {len(pairs)} cases, "
            f"and above it in {above}."
        )
    return lines


def _value(row: Row) -> float:
    if row["status"] == "no_conflict":
        return float("inf")
    return float(row["f_ttr_s"]) if row["status"] == "found" else -1.0


if __name__ == "__main__":
    raise SystemExit(main())
