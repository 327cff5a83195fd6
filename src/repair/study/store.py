"""The rows of a sweep as files."""

from __future__ import annotations

import csv
import hashlib
import io
from pathlib import Path
from typing import Any

from repair.study.rows import COLUMNS, SweepSettings

__all__ = ["write_sweep"]


def write_sweep(
    rows: list[dict[str, Any]], folder: Path, settings: SweepSettings, source: Path
) -> list[Path]:
    """Write ``sweep.csv`` and ``sweep.json`` (rows, settings, checksums of the files)."""
    from repair.io.files import write_files
    from repair.io.result_json import to_json

    table = io.StringIO()
    writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    content = {
        "settings": {
            "backends": list(settings.backends),
            "references": list(settings.references),
            "preset": settings.preset,
            "overrides": list(settings.overrides),
        },
        "files": {f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in sorted(source.glob("*.xml"))},
        "rows": rows,
    }
    rows_text = table.getvalue().encode("utf-8", "backslashreplace")
    return write_files(folder, {"sweep.csv": rows_text, "sweep.json": to_json(content).encode()})
