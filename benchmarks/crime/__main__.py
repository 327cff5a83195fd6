"""F-TTR beside CommonRoad-CriMe's TTR: ``python -m benchmarks.crime FOLDER [--files 10] [--env DIR]``.

CriMe pins a drivability checker that clashes with ours. So its environment is another one, built by this
script from the pinned versions of ``requirements.txt`` beside it (``--env`` keeps it for the next time). Here
the reference is followed and repaired; there the same states become a vehicle of the scenario, and CriMe is
asked for its TTC (of the intended trajectory, TTC*), its TTR, and for our F-TTR, a measure class there
(``benchmarks/crime/measure.py``).

Taken are the first files of the folder, by name, whose reference meets something.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

from benchmarks.elsewhere import environment, told

REQUIREMENTS = Path(__file__).with_name("requirements.txt")


def ours(file: Path, backend: str, reference: str) -> dict[str, Any] | None:
    """The record of a repair, and the states of its reference; None where nothing is in conflict."""
    import numpy as np

    import repair
    from repair.timegrid import steps_until

    keys = [f"reference.source={reference}", "metrics=[ttr]"]
    result = repair.repair(file, backend=backend, overrides=keys)
    if result.status is repair.SearchStatus.NO_CONFLICT:
        return None
    prepared, scene = result.prepared, result.prepared.scene
    t = np.arange(steps_until(prepared.t_reference, scene.dt) + 1) * scene.dt
    driven = scene.frame.cartesian(prepared.reference.sample(t))
    names = {"x": driven.xy[:, 0], "y": driven.xy[:, 1], "heading": driven.heading, "speed": driven.speed}
    return {
        "file": str(file.resolve()),
        "record": result.to_dict(),
        "initial_time_step": scene.initial_time_step,
        "length": scene.vehicle.length,
        "width": scene.vehicle.width,
        "reference": {name: values.tolist() for name, values in names.items()},
    }


def collected(folder: Path, files: int, backend: str, reference: str) -> list[dict[str, Any]]:
    """Rows of the first files with a conflict; what cannot be used is said."""
    from tqdm import tqdm

    from repair.errors import RepairError

    rows: list[dict[str, Any]] = []
    with tqdm(total=files, disable=None, desc="repair") as bar:
        for file in sorted(folder.glob("*.xml")):
            try:
                row = ours(file, backend, reference)
            except RepairError as error:
                print(f"{file.name}: {error}", file=sys.stderr)
                continue
            if row is not None:
                rows.append(row)
                bar.update()
            if len(rows) == files:
                break
    return rows


def seconds(value: Any) -> str:
    """A time for the table."""
    if value is None:
        return "–"
    try:
        return f"{float(value):.2f}".replace("inf", "∞")
    except ValueError:
        return str(value)


def table(rows: list[dict[str, Any]], theirs: list[dict[str, Any]]) -> str:
    """Markdown: ours beside theirs [s]."""
    lines = ["| file | TTC | CriMe TTC* | TTR | CriMe TTR | F-TTR | F-TTR in CriMe |", "|---|" + "---:|" * 6]
    for row, said in zip(rows, theirs, strict=True):
        record = row["record"]
        own = [record["contact_ttc_s"], record["metrics"]["ttr"]["value_s"], record["f_ttr_s"]]
        cells = [v for pair in zip(own, (said["ttc"], said["ttr"], said["f_ttr"]), strict=True) for v in pair]
        lines.append(f"| {Path(row['file']).stem} | " + " | ".join(map(seconds, cells)) + " |")
    return "\n".join(lines)


def main() -> int:
    """Ask both, print the table."""
    parser = argparse.ArgumentParser(description="F-TTR beside CommonRoad-CriMe's TTR.")
    parser.add_argument("folder", type=Path, help="folder of CommonRoad files")
    parser.add_argument("--files", type=int, default=10)
    parser.add_argument("--backend", default="ego")
    parser.add_argument("--reference", default="constant")
    parser.add_argument("--env", type=Path, help="where CriMe's environment is, or is to be kept")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = collected(arguments.folder, arguments.files, arguments.backend, arguments.reference)
    with tempfile.TemporaryDirectory(prefix="repair-crime-") as aside:
        python = environment((arguments.env or Path(aside) / "env").resolve(), REQUIREMENTS)
        handed = Path(aside) / "rows.json"
        handed.write_text(json.dumps(rows), encoding="utf-8")
        theirs = told(python, "benchmarks.crime.theirs", str(handed))
    print(table(rows, theirs))
    return 0


if __name__ == "__main__":
    sys.exit(main())
