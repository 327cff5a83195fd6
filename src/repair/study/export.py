"""The rows of a study or a sweep as files for other programs."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from repair.errors import RepairError
from repair.study.rows import COLUMNS, STUDY_COLUMNS, SweepSettings, type_of
from repair.study.store import Store

__all__ = ["FORMATS", "csv_text", "export", "write_sweep"]

FORMATS = ("csv", "parquet")


def csv_text(rows: Iterable[Mapping[str, Any]], columns: Iterable[str]) -> bytes:
    """Rows as CSV in UTF-8; what is not there is empty, and truth is ``True`` or ``False``."""
    table = io.StringIO()
    writer = csv.DictWriter(table, list(columns), lineterminator="\n", extrasaction="raise")
    writer.writeheader()
    writer.writerows(rows)
    return table.getvalue().encode("utf-8", "backslashreplace")


def export(store: Store, form: str) -> tuple[str, bytes]:
    """The name and the content of a file with all rows of a study.

    Parameters
    ----------
    form : str
        One of :data:`FORMATS`.

    Raises
    ------
    RepairError
        If there is no row, or pyarrow is missing that Parquet needs.
    """
    rows = list(store.rows())
    if not rows:
        raise RepairError(f"{store.path} holds no row of its study yet")
    if form == "csv":
        return "study.csv", csv_text(rows, rows[0])
    return "study.parquet", _parquet(rows)


def _parquet(rows: list[dict[str, Any]]) -> bytes:
    """Rows as Parquet, each column of its own type."""
    try:
        import pyarrow
        import pyarrow.parquet as parquet
    except ImportError as error:
        raise RepairError(f"Parquet needs the package pyarrow: pip install pyarrow ({error})") from error
    kinds = {bool: pyarrow.bool_(), int: pyarrow.int64(), float: pyarrow.float64(), str: pyarrow.string()}
    made = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        if name in STUDY_COLUMNS:
            made[name] = pyarrow.array(values, kinds[type_of(name)])
        else:  # a setting that varies
            held = {type(value) for value in values if value is not None}
            kind = (
                kinds.get(float if held == {int, float} else next(iter(held), str)) if len(held) < 3 else None
            )
            if kind is None or (len(held) > 1 and held != {int, float}):
                values, kind = [None if v is None else str(v) for v in values], kinds[str]
            made[name] = pyarrow.array(values, kind)
    target = io.BytesIO()
    parquet.write_table(pyarrow.table(made), target)
    return target.getvalue()


def write_sweep(
    rows: list[dict[str, Any]], folder: Path, settings: SweepSettings, source: Path
) -> list[Path]:
    """Write ``sweep.csv`` and ``sweep.json`` (rows, settings, checksums of the files)."""
    from repair.io.files import write_files
    from repair.io.result_json import to_json

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
    return write_files(
        folder, {"sweep.csv": csv_text(rows, COLUMNS), "sweep.json": to_json(content).encode()}
    )
