"""Are the answers the same? Results of two versions compared, value by value.

    python -m benchmarks.answers write DIR              every file, reference and backend: a folder each
    python -m benchmarks.answers compare BEFORE AFTER   differences; exit status 1 where there are any

What differs by nature is left out: times (keys that end in ``time_s``), paths, versions. Keys that only one
side has are listed one by one, with how often, and are no difference by themselves; a value that differs is,
unless ``--expect KEY`` names it. The solution files have to be equal byte for byte. ``write`` takes the files
of COMMONROAD_SCENARIOS (or ``--scenarios FOLDER``); it uses ``repair.repair`` and ``save`` alone, and
so runs under an earlier version as well (put the file anywhere and call it by its path).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

REFERENCES = ("constant", "accelerate", "planner")
BACKENDS = ("ego", "casadi", "qptr")
#: Whose values differ by nature.
LEFT_OUT = ("versions", "time_s")


def write(folder: Path, scenarios: Path, part: int = 0, parts: int = 1) -> int:
    """Every file of a folder through every reference and backend."""
    import repair

    files = sorted(scenarios.glob("*.xml"))[part::parts]
    for k, file in enumerate(files):
        for reference in REFERENCES:
            for backend in BACKENDS:
                out = folder / file.stem / reference / backend
                try:
                    found = repair.repair(file, backend=backend, overrides=[f"reference.source={reference}"])
                    found.save(out, figure=False)
                except repair.RepairError as error:
                    out.mkdir(parents=True, exist_ok=True)
                    (out / "error.txt").write_text(str(error), encoding="utf-8")
        print(f"{k + 1} of {len(files)}: {file.name}", file=sys.stderr)
    return 0


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys of a nested value with what is there; lists of plain values count as one."""
    if isinstance(value, dict):
        for name, inner in value.items():
            if name in LEFT_OUT or name.endswith("time_s"):
                continue
            if name == "path" and key == "provenance":
                continue
            yield from leaves(inner, f"{key}.{name}" if key else name)
        if not value:
            yield key, {}
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for index, inner in enumerate(value):
            yield from leaves(inner, f"{key}[{index}]")
    else:
        yield key, value


def compare(before: Path, after: Path, expected: list[str]) -> int:
    """Print what differs; the number of results with a differing value decides the exit status."""
    results = sorted(p.parent.relative_to(before) for p in before.rglob("result.json"))
    more = {p.parent.relative_to(after) for p in after.rglob("result.json")} - set(results)
    gone: Counter[str] = Counter()
    new: Counter[str] = Counter()
    changed: Counter[str] = Counter()
    first: dict[str, str] = {}
    bad: set[Path] = set(more)
    solutions = 0
    for name in results:
        if not (after / name / "result.json").is_file():
            bad.add(name)
            changed["(no result any more)"] += 1
            continue
        old, made = (
            dict(leaves(json.loads((side / name / "result.json").read_text(encoding="utf-8"))))
            for side in (before, after)
        )
        for key in old.keys() - made.keys():
            gone[key] += 1
        for key in made.keys() - old.keys():
            new[key] += 1
        for key in old.keys() & made.keys():
            # As they are written: 1 and 1.0 are not the same.
            if json.dumps(old[key]) != json.dumps(made[key]):
                changed[key] += 1
                if key not in expected:
                    bad.add(name)
                first.setdefault(key, f"{name}: {str(old[key])[:60]} -> {str(made[key])[:60]}")
        for file in sorted((before / name).glob("solution_*.xml")):
            solutions += 1
            other = after / name / file.name
            if not other.is_file() or other.read_bytes() != file.read_bytes():
                changed["(solution file)"] += 1
                bad.add(name)
                first.setdefault("(solution file)", str(name))
    print(f"{len(results)} results and {solutions} solution files compared, {len(bad)} results differ")
    parts = (("keys that are new", new), ("keys that are gone", gone), ("values that differ", changed))
    for title, counted in parts:
        print(f"{title}: {'none' if not counted else ''}")
        for key, count in sorted(counted.items()):
            meant = "  as expected" if key in expected else ""
            print(f"  {key}  ({count}){meant}" + (f"  {first[key]}" if key in first else ""))
    return 1 if bad else 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.answers", description=__doc__.splitlines()[0])
    verbs = parser.add_subparsers(dest="verb", required=True)
    writing = verbs.add_parser("write")
    writing.add_argument("folder", type=Path)
    writing.add_argument("--scenarios", type=Path, default=Path(os.environ.get("COMMONROAD_SCENARIOS", ".")))
    writing.add_argument("--part", type=int, nargs=2, default=(0, 1), metavar=("K", "N"), help="part K of N")
    comparing = verbs.add_parser("compare")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--expect", metavar="KEY", nargs="+", default=[], help="values that may differ")
    arguments = parser.parse_args()
    if arguments.verb == "write":
        return write(arguments.folder, arguments.scenarios, *arguments.part)
    return compare(arguments.before, arguments.after, arguments.expect)


if __name__ == "__main__":
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[_name] = "1"
    sys.exit(main())
