"""Our traces and verdicts before drawtonomy's own package: ``python -m benchmarks.drawtonomy FOLDER``.

The files that ``repair run --trace`` writes are written here, and read in an environment that has the
published package (``requirements.txt`` beside this file, Python 3.11 or later; ``--env DIR`` keeps it):
its schema, its check of a trace against the solution, how it finds the files of a folder, its own verdict
on the same two files.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

from benchmarks.elsewhere import environment, told

REQUIREMENTS = Path(__file__).with_name("requirements.txt")


def written(files: list[Path], aside: Path, backend: str, reference: str) -> list[Path]:
    """One folder for each file that can be used: scenario, solution, trace, verdict."""
    from tqdm import tqdm

    import repair
    from repair.errors import RepairError

    folders = []
    for file in tqdm(files, disable=None, desc="repair"):
        folder = aside / file.stem
        try:
            keys = [f"reference.source={reference}", "mitigation.wanted=true"]
            result = repair.repair(file, backend=backend, overrides=keys)
            result.save(folder, figure=False, trace=True)
        except RepairError as error:
            print(f"{file.name}: {error}", file=sys.stderr)
            continue
        shutil.copy(file, folder)
        folders.append(folder)
    return folders


def line_of(row: dict[str, Any]) -> str:
    """A row of the table."""
    said = row["trace"] or "as it has to be"
    verdict = (row["verdict"] or "the same") if row["solution"] else "no solution"
    return f"{row['name']:34} {row['states']:6d} {row['plans']:5d} {row['candidates']:10d}  {said}; {verdict}"


def main() -> int:
    """Write, ask, print; exit status 1 where the package objects to anything."""
    parser = argparse.ArgumentParser(description="Traces and verdicts before drawtonomy's own package.")
    parser.add_argument("folder", type=Path, help="folder of CommonRoad files")
    parser.add_argument("--files", type=int, default=10, help="how many; the first by name")
    parser.add_argument("--backend", default="ego")
    parser.add_argument("--reference", default="constant")
    parser.add_argument("--env", type=Path, help="where the package's environment is, or is to be kept")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    files = sorted(arguments.folder.glob("*.xml"))[: arguments.files]
    with tempfile.TemporaryDirectory(prefix="repair-drawtonomy-") as aside:
        python = environment((arguments.env or Path(aside) / "env").resolve(), REQUIREMENTS)
        folders = written(files, Path(aside) / "results", arguments.backend, arguments.reference)
        rows = told(python, "benchmarks.drawtonomy.theirs", *map(str, folders))
    print(f"{'scenario':34} states plans candidates  the trace; its verdict beside ours")
    for row in rows:
        print(line_of(row))
    objected = sum(bool(row["trace"] or row["verdict"]) for row in rows)
    judged = sum(bool(row["solution"]) for row in rows)
    print(f"{len(rows)} traces, {judged} verdicts; drawtonomy-commonroad objects to {objected}")
    return 1 if objected else 0


if __name__ == "__main__":
    sys.exit(main())
