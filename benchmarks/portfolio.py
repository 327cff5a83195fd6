"""What a portfolio costs against its members, and whether it finds what they find.

    python -m benchmarks.portfolio FOLDER [--reference constant ...] [--rule bisect] [--part K/N] [--out FILE]

For each conflict every member of ``portfolio.members`` searches alone, and the portfolio with all of them;
processor time of the search, everything built before. The ratio is that of the portfolio to the slowest of
the members that it asked.
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
from repair.config import load_config
from repair.errors import RepairError
from repair.preparation import Prepared, prepare
from repair.scene.commonroad import load_scene
from repair.search.result import SearchResult
from repair.solvers.registry import make_backend


def searched(prepared: Prepared, name: str) -> tuple[SearchResult, float]:
    """The search of one backend and its processor time [s]; the fastest of three, so that all is built."""
    backend, times = make_backend(name, prepared.config), []
    for _ in range(3):
        begin = time.process_time()
        found = find(prepared, backend)
        times.append(time.process_time() - begin)
    return found, min(times)


def row_of(file: Path, reference: str, rule: str, step: float) -> dict[str, Any] | None:
    """One conflict; None where there is none that can be avoided."""
    keys = [
        f"reference.source={reference}", f"search.delta_t={step}", f"search.rule={rule}", "fallback=[]",
    ]  # fmt: skip
    config = load_config(overrides=keys, backend="portfolio")
    prepared = prepare(load_scene(file, config), config)
    if not math.isfinite(prepared.conflict.time) or prepared.conflict.contact_time <= 0.0:
        return None
    row: dict[str, Any] = {"file": file.name, "reference": reference}
    alone = {name: searched(prepared, name) for name in config.section("portfolio").members}
    together, spent = searched(prepared, "portfolio")
    asked = {probe.by for probe in together.probes}
    for name, (found, seconds) in alone.items():
        row |= {f"{name}_f_ttr_s": found.f_ttr, f"{name}_cpu_s": round(seconds, 4)}
    slowest = max(seconds for name, (_, seconds) in alone.items() if name in asked)
    earlier = [n for n, (found, _) in alone.items() if found.f_ttr is not None and together.f_ttr is None]
    return row | {
        "portfolio_f_ttr_s": together.f_ttr, "portfolio_cpu_s": round(spent, 4),
        "asked": " ".join(name for name in alone if name in asked), "missed": " ".join(earlier),
        "ratio": round(spent / slowest, 3),
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> str:
    """Quantiles of the ratio, and where the portfolio found nothing and a member did."""
    ratios = sorted(row["ratio"] for row in rows)
    at = {share: ratios[round(share * (len(ratios) - 1))] for share in (0.5, 0.9, 1.0)}
    over, missed = sum(ratio > 1.2 for ratio in ratios), sum(bool(row["missed"]) for row in rows)
    return (
        f"{len(rows)} conflicts: ratio {at[0.5]:.2f} in the median, {at[0.9]:.2f} at p90, {at[1.0]:.2f} at "
        f"most, above 1.2 in {over}; nothing found where a member finds a repair in {missed}"
    )


def main() -> int:
    """Measure, print, and write the rows where a file is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--reference", nargs="+", default=["constant", "accelerate"])
    parser.add_argument("--rule", default="bisect")
    parser.add_argument("--step", type=float, default=0.1, help="of the grid [s]")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th file from the K-th on")
    parser.add_argument("--out", type=Path, help="a CSV file")
    asked = parser.parse_args()
    first, every = map(int, asked.part.split("/"))
    rows: list[dict[str, Any]] = []
    for file in sorted(asked.folder.glob("*.xml"))[first::every]:
        for reference in asked.reference:
            try:
                row = row_of(file, reference, asked.rule, asked.step)
            except RepairError as error:
                print(f"{file.name} {reference}: {error}", file=sys.stderr)
                continue
            if row is not None:
                rows.append(row)
                print(" ".join(str(value) for value in row.values()), flush=True)
                if asked.out is not None:
                    with asked.out.open("w", newline="") as stream:
                        writer = csv.DictWriter(stream, list(row))
                        writer.writeheader()
                        writer.writerows(rows)
    if rows:
        print(summary(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
