"""Impact speeds beside those of full braking: generated situations, and the conflicts of a folder.

``python -m benchmarks.mitigation [DIR]`` prints a table by kind of situation, with the bound beside it, and
every case of the folder in which full braking hits something. Nothing may be harder than full braking, and
where it is proven that nothing avoids a collision, nothing may.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
import warnings
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

from tests.unavoidable import grid, situation

import repair
from repair.bounds.latest import bound
from repair.bounds.settings import BoundConfig
from repair.errors import RepairError
from repair.mitigation.settings import MitigationConfig

REFERENCES = ("constant", "accelerate")
PATIENT = MitigationConfig(time_limit=600.0)
HEAD = (
    "situations", "conflicts", "full braking hits", "proven", "hit less hard", "avoided", "harder",
    "largest gain [m/s]", "median gain where less [m/s]", "processor time: median, largest [s]",
)  # fmt: skip


def measured(path: Path, reference: str) -> dict[str, Any] | None:
    """One case; None where there is nothing to mitigate."""
    config = repair.load_config(overrides=[f"reference.source={reference}"])
    try:
        prepared = repair.prepare(repair.load_scene(path, config), config)
        begin = time.process_time()
        found = repair.mitigate(prepared, PATIENT)
    except RepairError:
        return None
    spent = time.process_time() - begin
    late = bound(prepared, BoundConfig(kinds=["vehicle"]))["vehicle"]
    best, full = found.best, found.braking
    return {"best": best, "full": full, "proven": late.time <= 0.0, "time": spent}


def generated(folder: Path) -> Iterator[tuple[str, str, dict[str, Any] | None]]:
    """Kind, words and measures of every generated situation."""
    for kind, own, gap, speed, width in grid():
        file = folder / "scenario.xml"
        file.write_text(situation(kind, own, gap, speed, width), encoding="utf-8")
        yield kind, f"{own:g} m/s, {gap:.1f} m, {speed:g} m/s, road {width:g} m", measured(file, "constant")


def row(name: str, cases: list[dict[str, Any]]) -> tuple[str, ...]:
    """The row of a kind."""
    hits = [c for c in cases if c["full"] is None or c["full"].impact.kind != "none"]
    gains = [
        (c["full"].impact.speed if c["full"] else math.inf)
        - (c["best"].impact.speed if c["best"] else math.inf)
        for c in hits
    ]
    none = [c for c in hits if c["best"] is not None and c["best"].impact.kind == "none"]
    harder = [c for c, gain in zip(hits, gains, strict=True) if not gain >= 0.0]
    harder += [c for c in none if c["proven"]]
    less = [gain for c, gain in zip(hits, gains, strict=True) if gain > 0.01]
    times = [c["time"] for c in cases]
    counts = (cases, hits, [c for c in cases if c["proven"]], less, none, harder)
    return (
        name, *(str(len(one)) for one in counts), f"{max(gains, default=0.0):.2f}",
        f"{median(less):.2f}" if less else "–", f"{median(times):.2f}, {max(times):.2f}",
    )  # fmt: skip


def speed(motion: Any) -> float:
    """Impact speed [m/s]; infinite for what cannot be driven."""
    return math.inf if motion is None else float(motion.impact.speed)


def words(motion: Any) -> str:
    """A motion for people."""
    if motion is None:
        return "cannot be driven"
    impact = motion.impact
    if impact.kind == "none":
        return f"{motion.maneuver}: nothing touched"
    who = "road left" if impact.obstacle_id is None else f"{impact.obstacle_id}"
    return f"{motion.maneuver}: {impact.speed:.2f} m/s at {impact.time:.2f} s ({who})"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    by_kind: dict[str, list[dict[str, Any]]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as aside:
        for kind, _, case in generated(Path(aside)):
            if case is not None:
                by_kind[kind].append(case)
    lines = []
    if arguments.folder:
        for file in sorted(arguments.folder.glob("*.xml")):
            for reference in REFERENCES:
                case = measured(file, reference)
                if case is None:
                    continue
                by_kind["folder"].append(case)
                if case["full"] is None or case["full"].impact.kind != "none":
                    proven = "proven" if case["proven"] else ""
                    lines.append((file.stem, reference, words(case["full"]), words(case["best"]), proven))
    print("| " + " | ".join(HEAD) + " |\n" + "|---" * len(HEAD) + "|")
    for kind, cases in by_kind.items():
        print("| " + " | ".join(row(kind, cases)) + " |")
    if lines:
        print("\n| file | reference | full braking | least | |\n|---|---|---|---|---|")
        for line in lines:
            print("| " + " | ".join(line) + " |")


if __name__ == "__main__":
    main()
