"""The rows of a study in one SQLite file: each written the moment it is there, none of them twice."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from repair.errors import OutputError, RepairError, in_words
from repair.io.alone import Alone
from repair.study.plan import Task, package_version
from repair.study.rows import STUDY, Table

__all__ = ["STORE_FILE", "Store"]

STORE_FILE = STUDY.stored_in
_SCHEMA = "1"
_SQL = {bool: "INTEGER", int: "INTEGER", float: "REAL", str: "TEXT"}
_PATIENCE = 30.0  # how long to wait for another process that writes [s]


def _column(name: str, kind: type) -> str:
    """A column as it is declared: SQLite itself would take anything for anything."""
    held = {bool: f"{name} IN (0, 1)", str: f"typeof({name}) = 'text'"}.get(
        kind, f"typeof({name}) = '{_SQL[kind].lower()}'"
    )
    return f"{name} {_SQL[kind]} CHECK ({name} IS NULL OR {held})"


_TABLES = """
CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE tasks (
    position INTEGER PRIMARY KEY, key TEXT NOT NULL, file TEXT NOT NULL, path TEXT NOT NULL,
    sha256 TEXT NOT NULL, backend TEXT NOT NULL, reference TEXT NOT NULL, variation TEXT NOT NULL,
    varied TEXT NOT NULL
);
CREATE TABLE rows (
    key TEXT PRIMARY KEY, sha256 TEXT NOT NULL, config_sha256 TEXT NOT NULL, version TEXT NOT NULL,
    {columns}, result BLOB
);
"""


class Store:
    """The database of a study, or of what else is run as one.

    Parameters
    ----------
    folder : Path
        It is made, and the file in it, if need be.
    table : Table
        What its rows are.
    fresh : bool
        Begin anew: what is there is forgotten.
    readonly : bool
        Something has to be there, and stays as it is.

    Raises
    ------
    RepairError
        If it cannot be made or read, was made by a version with other columns, or another study writes there.
    """

    def __init__(
        self, folder: Path, table: Table = STUDY, *, fresh: bool = False, readonly: bool = False
    ) -> None:
        self.path = folder / table.stored_in
        self.table = table
        self.alone: Alone | None = None
        try:
            if not readonly:
                folder.mkdir(parents=True, exist_ok=True)
                self.alone = Alone(folder, f"a {table.name}")
                if fresh:
                    for end in ("", "-wal", "-shm"):
                        self.path.with_name(self.path.name + end).unlink(missing_ok=True)
            elif not self.path.is_file():
                raise RepairError(f"{folder} holds no {table.stored_in}; {table.made_by} write one")
            self._open(readonly)
        except BaseException as error:
            self._let_in()
            if isinstance(error, OSError):
                why = error.strerror or error
                raise OutputError(f"the store {self.path} cannot be made: {why}") from error
            raise

    def _let_in(self) -> None:
        if self.alone is not None:
            self.alone.close()

    def _open(self, readonly: bool) -> None:
        try:
            # One thread writes; a lane of a cluster answers in threads of its own, and its row is taken here.
            self.base = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None)
            self.base.row_factory = sqlite3.Row
            if not readonly:
                self.base.execute("PRAGMA journal_mode=WAL")
                self.base.execute("PRAGMA synchronous=NORMAL")
            there = {row[0] for row in self.base.execute("SELECT name FROM sqlite_master WHERE type='table'")}
            if not there and not readonly:
                self.base.executescript(f"BEGIN IMMEDIATE; {self._tables()} COMMIT;")
                self.tell(schema=_SCHEMA)
                there = {"rows"}
            columns = {row[1] for row in self.base.execute("PRAGMA table_info(rows)")}
        except sqlite3.Error as error:
            raise RepairError(f"the store {self.path} cannot be used: {in_words(error)}") from error
        if self.about().get("schema") != _SCHEMA or not columns >= set(self.table.columns):
            raise RepairError(
                f"the store {self.path} was made by a version of this program with other columns; "
                "begin in another folder"
            )

    def _tables(self) -> str:
        return _TABLES.format(columns=", ".join(_column(*each) for each in self.table.columns.items()))

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file; what was written is in it."""
        with suppress(sqlite3.Error):
            self.base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        self.base.close()
        self._let_in()

    def about(self) -> dict[str, str]:
        """What is told about the study: its text, the command, versions."""
        try:
            return {row["name"]: row["value"] for row in self.base.execute("SELECT name, value FROM about")}
        except sqlite3.Error as error:
            raise RepairError(f"the store {self.path} cannot be used: {in_words(error)}") from error

    def tell(self, **words: str) -> None:
        """Note something about the study.

        Raises
        ------
        OutputError
            As :meth:`add`.
        """
        with self._written("what is told of it"):
            self.base.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", words.items())

    def plan(self, tasks: Iterable[Task]) -> None:
        """Note what the study is; rows that are no part of it stay, and are not shown.

        Raises
        ------
        OutputError
            As :meth:`add`.
        """
        listed = []
        for k, t in enumerate(tasks):
            words = (t.key, t.file, t.path, t.sha256, t.backend, t.reference, t.variation)
            listed.append((k, *map(_storable, words), json.dumps(dict(t.varied))))
        with self._written("what is to be made"):
            self.base.execute("DELETE FROM tasks")
            self.base.executemany(f"INSERT INTO tasks VALUES ({', '.join('?' * 9)})", listed)

    def done(self) -> set[str]:
        """The keys of all rows."""
        return {row["key"] for row in self.base.execute("SELECT key FROM rows")}

    def done_of(self, tasks: Iterable[Task]) -> set[str]:
        """The keys of the tasks whose rows are there, but for those that another limit than now has ended."""
        query = "SELECT key, status, detail FROM rows"
        said = {row["key"]: (row["status"], row["detail"]) for row in self.base.execute(query)}
        return {task.key for task in tasks if task.key in said and task.still_lost(*said[task.key])}

    def add(self, task: Task, row: Mapping[str, Any], whole: bytes | None) -> None:
        """Write a row; it is there when this returns, whatever comes then.

        Raises
        ------
        OutputError
            With the reason of the operating system, or of SQLite.
        """
        held = [_storable(row[name]) for name in self.table.columns]
        values = [task.key, task.sha256, task.config_sha256, package_version(), *held, whole]
        names = ("key", "sha256", "config_sha256", "version", *self.table.columns, "result")
        with self._written("a row"):
            # A row that a limit has ended makes room for what came of another limit.
            lost = "status IN ('timeout', 'memory')"
            self.base.execute(f"DELETE FROM rows WHERE key = ? AND {lost}", (task.key,))
            self.base.execute(
                f"INSERT INTO rows ({', '.join(names)}) VALUES ({', '.join('?' * len(names))})", values
            )

    def rows(self) -> Iterator[dict[str, Any]]:
        """The rows of the study in its order, as far as they are there, with the settings that vary."""
        named = ", ".join(f"rows.{name}" for name in self.table.columns if name != "file")
        named = f"tasks.file AS file, tasks.varied AS varied, {named}"
        query = f"SELECT {named} FROM tasks JOIN rows USING (key) ORDER BY position"
        for found in self.base.execute(query):
            row: dict[str, Any] = {}
            for name, kind in self.table.columns.items():
                value = found[name]
                row[name] = bool(value) if value is not None and kind is bool else value
                if name == "reference":
                    row.update(json.loads(found["varied"]))
            yield row

    def whole(self, position: int) -> bytes | None:
        """The whole result of a task, compressed; None where there is none."""
        query = "SELECT result FROM tasks JOIN rows USING (key) WHERE position = ?"
        found = self.base.execute(query, (position,)).fetchone()
        return None if found is None else found["result"]

    def versions(self) -> list[str]:
        """Of this package, by which the rows of the study were made."""
        query = "SELECT DISTINCT version FROM tasks JOIN rows USING (key) ORDER BY version"
        return [row["version"] for row in self.base.execute(query)]

    def tasks(self) -> list[dict[str, Any]]:
        """What the study is: each task with its position, and whether its row is there."""
        joined = "tasks LEFT JOIN rows USING (key) ORDER BY position"
        query = f"SELECT tasks.*, rows.key IS NOT NULL AS done FROM {joined}"
        return [dict(row) | {"done": bool(row["done"])} for row in self.base.execute(query)]

    @contextmanager
    def _written(self, what: str) -> Iterator[None]:
        """All that is written within, or nothing and an error in words."""
        try:
            with _Transaction(self.base):
                yield
        except sqlite3.Error as error:
            raise OutputError(f"{what} cannot be written to {self.path}: {in_words(error)}") from error


def _storable(value: Any) -> Any:
    """What is left of a file name that is no UTF-8 is escaped."""
    return value.encode("utf-8", "backslashreplace").decode() if isinstance(value, str) else value


class _Transaction:
    """All of it, or nothing."""

    def __init__(self, base: sqlite3.Connection) -> None:
        self.base = base

    def __enter__(self) -> None:
        self.base.execute("BEGIN IMMEDIATE")

    def __exit__(self, kind: object, *_: object) -> None:
        self.base.execute("COMMIT" if kind is None else "ROLLBACK")
