"""Many scenarios, many backends: each file through reference, TTC, search and the official checker.

A row for every (file, backend, reference), whatever happens: a file that does not load, a crash of
the interpreter or a time-out is a row that says so. Work is done by worker processes that are
replaced when they die or hang; rows come out in the order of the files, whatever the number of
workers.
"""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from repair.config import load_config
from repair.errors import RepairError, in_words
from repair.study.rows import SweepSettings, combinations, failed_row
from repair.study.task import run_file

__all__ = ["require_settings", "sweep"]


# -- workers ---------------------------------------------------------------------------------------


def _serve(pipe: Any, settings: SweepSettings) -> None:
    """Worker: rows for every path that comes down the pipe, until None comes."""
    while (path := pipe.recv()) is not None:
        pipe.send(run_file(Path(path), settings))


class _Worker:
    """A process that can be asked, waited for, and replaced."""

    def __init__(self, settings: SweepSettings) -> None:
        self.settings = settings
        self.process: Any = None
        self.task: int | None = None
        self.deadline = 0.0

    def give(self, index: int, path: Path) -> None:
        if self.process is None or not self.process.is_alive():
            context = multiprocessing.get_context("spawn")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=_serve, args=(theirs, self.settings), daemon=True)
            self.process.start()
            theirs.close()
        self.pipe.send(str(path))
        self.task, self.deadline = index, time.monotonic() + self.settings.timeout

    def collect(self) -> list[dict[str, Any]] | str | None:
        """Rows, or what became of the worker, or None while it is busy."""
        try:
            if self.pipe.poll(0.02):
                return self.pipe.recv()  # type: ignore[no-any-return]
        except (EOFError, OSError):
            self.stop()
            return f"the worker process ended with exit code {self.process.exitcode}"
        if time.monotonic() > self.deadline:
            self.stop()
            return f"no answer within {self.settings.timeout:g} s"
        return None

    def stop(self) -> None:
        if self.process is not None:
            if self.process.is_alive():
                self.process.kill()
            self.process.join(5.0)


def require_settings(settings: SweepSettings) -> None:
    """See that every backend can be made, every reference is known, and there is somebody to do the work.

    Raises
    ------
    RepairError
        Naming what is wrong.
    """
    from repair.solvers.registry import make_backend

    if not settings.jobs >= 1:
        raise RepairError(f"jobs is {settings.jobs}; a sweep takes at least one worker process")
    if not settings.timeout > 0.0:
        raise RepairError(f"timeout is {settings.timeout:g} s; it has to be positive")
    for backend, reference in combinations(settings):
        overrides = [*settings.overrides, f"reference.source={reference}"]
        make_backend(backend, load_config(settings.preset, overrides=overrides, backend=backend))


def sweep(folder: Path, settings: SweepSettings, *, progress: bool | None = None) -> list[dict[str, Any]]:
    """Run over all ``*.xml`` files of a folder.

    Parameters
    ----------
    folder : Path
    settings : SweepSettings
    progress : bool, optional
        Show a progress bar; by default only on a terminal.

    Returns
    -------
    list of dict
        Rows with the keys :data:`COLUMNS`, in the order of the files.

    Raises
    ------
    RepairError
        If the folder has no scenario files, or the settings ask for what there is not: before any work.
    """
    require_settings(settings)
    try:
        files = sorted(folder.glob("*.xml")) if folder.is_dir() else []
    except (OSError, ValueError) as error:
        raise RepairError(f"the folder {folder} cannot be read: {in_words(error)}") from error
    if not files:
        raise RepairError(f"{folder} is not a folder with CommonRoad scenario files (*.xml)")
    from tqdm import tqdm

    rows: list[list[dict[str, Any]]] = [[] for _ in files]
    workers = [_Worker(settings) for _ in range(settings.jobs)]
    waiting = iter(range(len(files)))
    shown = sys.stderr.isatty() if progress is None else progress
    with tqdm(total=len(files), disable=not shown, unit="file", leave=False) as bar:
        try:
            for worker in workers:
                _next(worker, waiting, files)
            while any(w.task is not None for w in workers):
                for worker in workers:
                    if worker.task is None or (answer := worker.collect()) is None:
                        continue
                    name = files[worker.task].name
                    if isinstance(answer, str):
                        status = "timeout" if answer.startswith("no answer") else "crash"
                        answer = [
                            failed_row(name, b, r, status, answer_text)
                            for b, r in combinations(settings)
                            for answer_text in (answer,)
                        ]
                    rows[worker.task] = answer
                    bar.update()
                    _next(worker, waiting, files)
        finally:
            for worker in workers:
                worker.stop()
    return [row for group in rows for row in group]


def _next(worker: _Worker, waiting: Iterable[int], files: Sequence[Path]) -> None:
    worker.task = None
    for index in waiting:
        worker.give(index, files[index])
        return
