"""Searches of this version and of an earlier one, side by side over a folder.

    python -m benchmarks.before FOLDER --before 1925924 [--backend ego "casadi ipopt"] [--out FILE]

Both versions run in a process of their own and take each file in turn, so that both see the same machine.
Processor time of a warm search, everything built before and no other backend asked instead.
"""

from __future__ import annotations

import argparse
import csv
import pickle
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cycle import ROOT, earlier, under
from repair.timegrid import INSTANT

BACKENDS = {
    "ego": ("ego", ()),
    "qptr": ("qptr", ()),
    "casadi ipopt": ("casadi", ("casadi.solver=ipopt",)),
    "casadi sqpmethod": ("casadi", ("casadi.solver=sqpmethod",)),
    "casadi ipopt alone": ("casadi", ("casadi.solver=ipopt",)),
    "casadi sqpmethod alone": ("casadi", ("casadi.solver=sqpmethod",)),
    "shooting": ("shooting", ()),
    "portfolio": ("portfolio", ()),
}
DEFAULT = ["ego", "qptr", "casadi ipopt", "casadi sqpmethod"]  # what early versions have as well
REFERENCES = ("constant", "accelerate")


class Version:
    """A process that searches under the sources of a folder."""

    def __init__(self, sources: Path, plain: tuple[str, ...]) -> None:
        self._plain = plain
        self._process = under(sources, "before_worker.py")

    def __call__(self, file: Path, backend: str, keys: list[str]) -> tuple[str, float | None, float]:
        """Status, F-TTR [s], processor time [s]."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        pickle.dump((str(file), backend, [*keys, *self._plain]), process.stdin)
        process.stdin.flush()
        answer: tuple[str, float | None, float] = pickle.load(process.stdout)
        return answer

    def close(self) -> None:
        """Let the process end."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def summary(label: str, rows: list[dict[str, Any]]) -> list[str]:
    """Ratios of the times, and every answer that is another one."""
    both = [row for row in rows if np.isfinite(row["before_s"]) and np.isfinite(row["now_s"])]
    if not both:
        return [f"{label}: nothing to search"]
    before, now = (np.array([row[key] for row in both]) for key in ("before_s", "now_s"))
    words = [
        f"{name} {1e3 * was:.1f} -> {1e3 * took:.1f} ms ({was / took:.2f} x)"
        for name, was, took in (
            ("median", np.median(before), np.median(now)),
            ("p95", np.percentile(before, 95), np.percentile(now, 95)),
            ("in all", before.sum(), now.sum()),
        )
    ]
    lines = [f"{label}: {len(both)} searches, {', '.join(words)}"]
    later = earlier_ = same = 0
    for row in rows:
        was, got = (-1.0 if row[k] is None else row[k] for k in ("before_f_ttr_s", "now_f_ttr_s"))
        if row["before"] == row["now"] and abs(was - got) <= INSTANT:
            same += 1
            continue
        later += got > was + INSTANT
        earlier_ += got < was - INSTANT
        lines.append(
            f"  {row['file']} {row['reference']}: {row['before']} {row['before_f_ttr_s']} -> "
            f"{row['now']} {row['now_f_ttr_s']}"
        )
    lines.insert(1, f"  the same answer {same}, a later F-TTR {later}, an earlier one or none {earlier_}")
    return lines


def main() -> int:
    """Measure, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.before", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--before", required=True, metavar="COMMIT")
    parser.add_argument("--backend", nargs="+", default=DEFAULT, choices=list(BACKENDS))
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE")
    parser.add_argument("--out", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory(prefix="repair-before-") as folder:
        # an earlier version has no such key, and no other backend that it would ask
        versions = {
            "before": Version(earlier(arguments.before, Path(folder)), ()),
            "now": Version(ROOT / "src", ("fallback=[]",)),
        }
        for label in arguments.backend:
            backend, keys = BACKENDS[label]
            mine: list[dict[str, Any]] = []
            for file in sorted(arguments.folder.glob("*.xml")):
                for reference in REFERENCES:
                    row: dict[str, Any] = {"backend": label, "file": file.name, "reference": reference}
                    for name, search in versions.items():
                        asked = [f"reference.source={reference}", *keys, *arguments.set]
                        if name == "now" and label.endswith(" alone"):  # as the earlier version is
                            asked.append("casadi.helpers=[]")
                        row[name], row[f"{name}_f_ttr_s"], row[f"{name}_s"] = search(file, backend, asked)
                    mine.append(row)
            print("\n".join(summary(label, mine)), flush=True)
            rows += mine
        for search in versions.values():
            search.close()
    if arguments.out and rows:
        with arguments.out.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
