"""A study from beginning to end: what is there is kept, the rest is made and written row by row."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Any

from repair.errors import RepairError, in_words
from repair.progress import Progress
from repair.study.engine import Lanes, LocalLanes, rows_of
from repair.study.plan import Study, Task, tasks_of
from repair.study.rows import SweepSettings, as_sweep_row
from repair.study.store import Store

__all__ = ["Ran", "estimate", "require_settings", "run_study", "sweep", "sweep_study"]

_BROKEN = ("crash", "timeout", "memory", "input_error")


@dataclass(frozen=True)
class Ran:
    """What came of a run.

    Attributes
    ----------
    tasks, before, made : int
        Rows of the study; those that were there; those that were made now.
    """

    tasks: int
    before: int
    made: int

    @property
    def left(self) -> int:
        """Rows that are not there yet."""
        return self.tasks - self.before - self.made


def run_study(
    tasks: Sequence[Task],
    store: Store,
    lanes: Lanes,
    *,
    limit: int | None = None,
    progress: bool | None = None,
) -> Ran:
    """Make the rows that the store does not have.

    Parameters
    ----------
    tasks : sequence of Task
    store : Store
    lanes : Lanes
        What works; closed at the end.
    limit : int, optional
        Make at most as many rows.
    progress : bool, optional
        Whether it is told how far it is.

    Raises
    ------
    OutputError
        If a row cannot be written.
    """
    store.plan(tasks)
    there = store.done_of(tasks)
    missing = {task.key: task for task in tasks if task.key not in there}
    wanted = list(missing.values())[:limit]
    before = len(tasks) - len(missing)
    if not wanted:
        lanes.close()
        return Ran(len(tasks), before, 0)
    shown = Progress(before + len(wanted), before, progress)
    try:
        for task, (row, whole) in rows_of(wanted, lanes, idle=shown.idle):
            store.add(task, row, whole)
            shown.one(broken=row["status"] in _BROKEN)
    finally:
        shown.close()
    return Ran(len(tasks), before, shown.made)


def estimate(
    tasks: Sequence[Task], store: Store | None, workers: int, limit: int | None = None
) -> tuple[int, float | None]:
    """How many rows are there, and how long the others will take [s]; None where no row says anything.

    Of the others, the first ``limit`` are counted. A row takes as long as those of its backend and variation
    have taken, else those of its backend, else all.
    """
    if store is None:
        return 0, None
    there = store.done_of(tasks)
    missing = [task for task in tasks if task.key not in there][:limit]
    query = "SELECT backend, variation, row_time_s FROM rows WHERE row_time_s IS NOT NULL"
    known: dict[tuple[str, ...], list[float]] = {}
    for row in store.base.execute(query):
        for name in ((row["backend"], row["variation"]), (row["backend"],), ()):
            known.setdefault(name, []).append(row["row_time_s"])
    if not known:
        return len(there), None
    means = {name: fmean(times) for name, times in known.items()}
    seconds = sum(
        means.get((task.backend, task.variation), means.get((task.backend,), means[()])) for task in missing
    )
    return len(there), seconds / max(workers, 1)


# -- a sweep is a study of one folder ---------------------------------------------------------------


def require_settings(settings: SweepSettings) -> None:
    """See that the settings of a sweep make sense; what they name is seen to by :func:`sweep_study`.

    Raises
    ------
    RepairError
        Naming what is wrong.
    """
    if not settings.jobs >= 1:
        raise RepairError(f"jobs is {settings.jobs}; a sweep takes at least one worker process")
    if not settings.timeout > 0.0:
        raise RepairError(f"timeout is {settings.timeout:g} s; it has to be positive")


def sweep_study(folder: Path, settings: SweepSettings) -> Study:
    """The study of all ``*.xml`` files of a folder.

    Raises
    ------
    RepairError
        If the folder has no scenario files.
    """
    require_settings(settings)
    try:
        files = sorted(folder.glob("*.xml")) if folder.is_dir() else []
    except (OSError, ValueError) as error:
        raise RepairError(f"the folder {folder} cannot be read: {in_words(error)}") from error
    if not files:
        raise RepairError(f"{folder} is not a folder with CommonRoad scenario files (*.xml)")
    return Study(
        tuple(files), tuple(dict.fromkeys(settings.backends)), tuple(dict.fromkeys(settings.references)),
        preset=settings.preset, settings=settings.overrides, official=settings.official,
        certify=settings.certify, timeout=settings.timeout,
    )  # fmt: skip


def sweep(
    folder: Path,
    settings: SweepSettings,
    *,
    out: Path | None = None,
    resume: bool = False,
    progress: bool | None = None,
) -> list[dict[str, Any]]:
    """Run over all ``*.xml`` files of a folder.

    Parameters
    ----------
    folder : Path
    settings : SweepSettings
    out : Path, optional
        Where the rows are stored as they come; by default nowhere.
    resume : bool
        Go on with what is stored there; otherwise that is forgotten.
    progress : bool, optional
        Whether it is told how far it is.

    Returns
    -------
    list of dict
        Rows with the keys :data:`repair.study.rows.COLUMNS`, in the order of the files.

    Raises
    ------
    RepairError
        If the folder has no scenario files, or the settings ask for what there is not: before any work.
    """
    tasks = tasks_of(replace(sweep_study(folder, settings), results=out is not None))
    with tempfile.TemporaryDirectory(prefix="repair-") as aside, ExitStack() as opened:
        store = opened.enter_context(Store(Path(aside) if out is None else out, fresh=not resume))
        words = [*settings.backends, "--reference", *settings.references]
        store.tell(command=f"repair sweep {folder.name} --backend {' '.join(words)}")
        run_study(tasks, store, LocalLanes(settings.jobs), progress=progress)
        return [as_sweep_row(row) for row in store.rows()]
