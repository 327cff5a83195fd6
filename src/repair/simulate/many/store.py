"""Rows of a simulation, one line of JSON each, written the moment they are there; none of them twice."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from repair.errors import OutputError, RepairError

__all__ = ["ROWS_FILE", "Rows"]

ROWS_FILE = "simulation.jsonl"


class Rows:
    """The rows of a folder.

    Parameters
    ----------
    folder : Path or None
        None keeps them in memory.

    Raises
    ------
    RepairError
        If the folder holds something else under that name.
    """

    def __init__(self, folder: Path | None) -> None:
        self.path = None if folder is None else folder / ROWS_FILE
        self._rows: dict[str, dict[str, Any]] = {}
        if self.path is None:
            return
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            text = self.path.read_text(encoding="utf-8") if self.path.is_file() else ""
            whole, _, torn = text.rpartition("\n")
            if torn:  # what was being written when a run was killed
                self.path.write_text(f"{whole}\n" if whole else "", encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{self.path} cannot be used: {error.strerror or error}") from error
        for k, line in enumerate(whole.splitlines()):
            try:
                row = json.loads(line)
                self._rows[row["key"]] = row
            except (ValueError, KeyError, TypeError) as error:
                raise RepairError(f"{self.path}: line {k + 1} is no row of a simulation") from error

    def __contains__(self, key: str) -> bool:
        return key in self._rows

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self._rows.values())

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, key: str, row: dict[str, Any]) -> None:
        """Write a row; it is there when this returns.

        Raises
        ------
        OutputError
            With the reason of the operating system.
        """
        self._rows[key] = {"key": key, **row}
        if self.path is None:
            return
        line = json.dumps(self._rows[key], allow_nan=False, separators=(",", ":"))
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as error:
            raise OutputError(f"{self.path} cannot be written: {error.strerror or error}") from error
