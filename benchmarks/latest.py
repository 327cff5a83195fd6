"""How late can it still be repaired? The latest verified repair of each backend, and the bound.

    python -m benchmarks.latest FOLDER [--backend ego casadi ...] [--reference constant ...] [--out FILE]

Each t_rep of the grid below the bound is asked, the latest first, until one is verified: what the rule
``scan`` ends with, in fewer probes. The last lines say which share of the cases is how far from the bound
(``search``), which no repair can reach.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from pathlib import Path
from typing import Any

from repair.api import find
from repair.bounds.latest import too_late
from repair.config import load_config
from repair.errors import RepairError
from repair.preparation import Prepared, prepare
from repair.scene.commonroad import load_scene
from repair.search.result import SearchStatus
from repair.solvers.registry import make_backend
from repair.timegrid import INSTANT, intervals

GAPS = (0.1, 0.2, 0.4)


def latest(prepared: Prepared, name: str, bound: float) -> tuple[float | None, float]:
    """The latest t_rep of the grid with a verified repair, and the processor time of the search [s]."""
    config = prepared.config
    backend, begin = make_backend(name, config), time.process_time()
    end = min(prepared.conflict.time, bound)
    for k in range(max(intervals(end - INSTANT, config.search.delta_t), 1) - 1, -1, -1):
        found = find(prepared, backend, visits=(k * config.search.delta_t,))
        if found.status is SearchStatus.FOUND:
            return k * config.search.delta_t, time.process_time() - begin
    return None, time.process_time() - begin


def rows_of(
    file: Path, reference: str, backends: list[str], step: float, more: list[str]
) -> list[dict[str, Any]]:
    """A row for each backend; none where there is no conflict that can be avoided."""
    rows = []
    for name in backends:
        keys = [f"reference.source={reference}", f"search.delta_t={step}", *more]
        config = load_config(overrides=keys, backend=name)
        prepared = prepare(load_scene(file, config), config)
        conflict = prepared.conflict
        if not math.isfinite(conflict.time) or conflict.contact_time <= 0.0:
            return []
        begin = time.process_time()
        bound = min(too_late(prepared, config.bound), conflict.time)
        spent = time.process_time() - begin
        f_ttr, seconds = latest(prepared, name, bound)
        rows.append(
            {
                "file": file.name, "reference": reference, "backend": name, "ttc_s": round(conflict.time, 6),
                "bound_s": round(bound, 6), "latest_s": None if f_ttr is None else round(f_ttr, 6),
                "search_cpu_s": round(seconds, 3), "bound_cpu_s": round(spent, 3),
            }
        )  # fmt: skip
    return rows


def gap_of(row: dict[str, Any], step: float) -> float:
    """From the latest repair to the first point of the grid that is proven too late [s]."""
    first = intervals(row["bound_s"], step) * step
    return float(first - (-step if row["latest_s"] is None else row["latest_s"]))


def summary(rows: list[dict[str, Any]], step: float) -> list[str]:
    """Shares of the cases by their gap, for each backend and for the best of all."""
    cases: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        cases.setdefault((row["file"], row["reference"]), []).append(row)
    names = list(dict.fromkeys(row["backend"] for row in rows))
    lines = [f"{'':10} " + "  ".join(f"<= {gap:g} s" for gap in GAPS) + "   none   CPU median, p90, all [s]"]
    for name in [*names, "best"]:
        own = [
            min((r for r in case if name in (r["backend"], "best")), key=lambda r: gap_of(r, step))
            for case in cases.values()
        ]
        shares = [100.0 * sum(gap_of(r, step) <= gap + 1e-6 for r in own) / len(own) for gap in GAPS]
        text = f"{name:10} " + "  ".join(f"{share:6.0f} %" for share in shares)
        text += f"  {sum(r['latest_s'] is None for r in own):5d}"
        if name != "best":
            times = sorted(r["search_cpu_s"] for r in own)
            most = times[int(0.9 * (len(times) - 1))]
            text += f"   {times[len(times) // 2]:.2f}, {most:.2f}, {sum(times):.0f}"
        lines.append(text)
    return [f"{len(cases)} cases", *lines]


def main() -> int:
    """Measure, print, and write the rows where a file is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--backend", nargs="+", default=["ego", "qptr", "shooting", "casadi"])
    parser.add_argument("--reference", nargs="+", default=["constant", "accelerate"])
    parser.add_argument("--step", type=float, default=0.1, help="of the grid [s]")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th file from the K-th on")
    parser.add_argument("--out", type=Path, help="a CSV file")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE")
    asked = parser.parse_args()
    first, every = map(int, asked.part.split("/"))
    rows: list[dict[str, Any]] = []
    for file in sorted(asked.folder.glob("*.xml"))[first::every]:
        for reference in asked.reference:
            try:
                made = rows_of(file, reference, asked.backend, asked.step, asked.set)
            except RepairError as error:
                print(f"{file.name} {reference}: {error}", file=sys.stderr)
                continue
            for row in made:
                print(" ".join(str(value) for value in row.values()), flush=True)
            rows += made
            if asked.out is not None and rows:
                with asked.out.open("w", newline="") as stream:
                    writer = csv.DictWriter(stream, list(rows[0]))
                    writer.writeheader()
                    writer.writerows(rows)
    if rows:
        print("\n".join(summary(rows, asked.step)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
