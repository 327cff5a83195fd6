"""The files of a simulation."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

from repair.io.files import write_files
from repair.report.loop.page import simulation_page
from repair.report.loop.table import cycles_of, groups_of, summary, table_of
from repair.simulate.many.store import Rows
from repair.simulate.measures import COLUMNS

__all__ = ["write_simulation"]


def write_simulation(rows: Rows, folder: Path) -> list[Path]:
    """Write ``simulation.csv``, ``simulation.json``, ``simulation.md`` and ``report.html``.

    Raises
    ------
    OutputError
        With the reason of the operating system.
    """
    listed = list(rows)
    content: dict[str, Any] = {
        f"{prediction}, {policy}": {**summary(own), "cycles_ms": cycles_of(own)}
        for (prediction, policy), own in groups_of(listed).items()
    }
    table = io.StringIO()
    columns = (*COLUMNS, "status", "detail")
    writer = csv.DictWriter(table, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(listed)
    files = {
        "simulation.json": json.dumps(content, indent=1, allow_nan=False).encode(),
        "simulation.csv": table.getvalue().encode("utf-8", "backslashreplace"),
        "report.html": simulation_page(listed).encode("utf-8", "backslashreplace"),
        "simulation.md": (table_of(listed) + "\n").encode("utf-8", "backslashreplace"),
    }
    return write_files(folder, files)
