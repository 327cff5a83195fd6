"""The files of a simulation."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from repair.io.files import write_files
from repair.report.loop.page import simulation_page
from repair.report.loop.table import cycles_of, groups_of, summary, table_of
from repair.study.export import csv_text

__all__ = ["write_simulation"]


def write_simulation(drives: Sequence[dict[str, Any]], folder: Path) -> list[Path]:
    """Write ``simulation.csv``, ``simulation.json``, ``simulation.md`` and ``report.html``.

    Parameters
    ----------
    drives : sequence of dict
        As :func:`repair.simulate.many.run.drives_in` reads them.
    folder : Path

    Raises
    ------
    OutputError
        With the reason of the operating system.
    """
    content: dict[str, Any] = {
        f"{prediction}, {policy}": {**summary(own), "cycles_ms": cycles_of(own)}
        for (prediction, policy), own in groups_of(drives).items()
    }
    rows = [{name: value for name, value in one.items() if name != "drive"} for one in drives]
    files = {
        "simulation.json": json.dumps(content, indent=1, allow_nan=False).encode(),
        "simulation.csv": csv_text(rows, rows[0]),
        "report.html": simulation_page(drives).encode("utf-8", "backslashreplace"),
        "simulation.md": (table_of(drives) + "\n").encode("utf-8", "backslashreplace"),
    }
    return write_files(folder, files)
