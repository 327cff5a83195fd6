"""In the process that makes rows: it ends when a row takes too long or too much, and with who started it."""

from __future__ import annotations

import faulthandler
import logging
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

from repair.errors import RepairError, in_words
from repair.registry import adopt, registered
from repair.study.plan import Task, package_version
from repair.study.task import Kept, row_of

__all__ = [
    "NOW", "TOO_MUCH_MEMORY", "Answer", "begin", "parts_of_the_program", "peak_memory", "run_task", "started",
]  # fmt: skip

#: A row, and the whole result.
Answer = tuple[dict[str, Any], bytes | None]
#: With a row comes what its process takes when it is made [MB]; that is no column.
NOW = "worker_memory_now_mb"
#: The exit status of a process that has taken more memory than it may.
TOO_MUCH_MEMORY = 77
_LOOKS = 0.1  # how often the watch looks [s]
_EVER = 1e6  # longer than any row takes, and not too long for the clock [s]

_kept = Kept()
_alone = threading.Lock()  # a process may have several threads, and what is kept belongs to one scenario
_watch: _Watch | None = None


class _Watch(threading.Thread):
    """Ends the process where it takes too much memory, or where who started it is gone."""

    def __init__(self, parent: int | None) -> None:
        super().__init__(daemon=True, name="watch")
        self.parent = parent
        self.memory = float("inf")

    def run(self) -> None:
        """Look, again and again."""
        while True:
            if self.parent is not None and os.getppid() != self.parent:
                os._exit(1)
            if _memory_now() > self.memory:
                os._exit(TOO_MUCH_MEMORY)
            time.sleep(_LOOKS)


def begin(parent: int | None = None, parts: bytes = b"") -> None:
    """Make a process ready: quiet, deaf to Ctrl-C, which is for who started it, and watched.

    Parameters
    ----------
    parent : int, optional
        The process without which this one is to end.
    parts : bytes
        What the program that started it has registered (:func:`parts_of_the_program`).
    """
    global _watch  # noqa: PLW0603  one for each process
    if parent is not None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        logging.getLogger().addHandler(logging.NullHandler())
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
    if _watch is None:
        _watch = _Watch(parent)
        _watch.start()
    if parts:
        from joblib.externals.loky.backend.reduction import loads

        adopt(loads(parts))


def parts_of_the_program() -> bytes:
    """What this program has registered, for the processes that it starts; empty where it has nothing.

    Raises
    ------
    RepairError
        If a part cannot be handed over.
    """
    parts = registered()
    if not parts:
        return b""
    from joblib.externals.loky.backend.reduction import dumps

    try:
        return bytes(dumps(parts))
    except Exception as error:  # whatever a foreign object raises
        names = ", ".join(repr(part[2]) for part in parts)
        raise RepairError(
            f"what this program registered ({names}) cannot be handed to other processes: {in_words(error)}; "
            "let an installed package announce it"
        ) from error


def started() -> str:
    """Import what rows need, so that it is not on the clock of the first one; the version of the package."""
    import repair.api  # noqa: F401

    return package_version()


def run_task(task: Task, make: Callable[[Task, Kept], Answer] = row_of) -> Answer:
    """The row of a task. Where it takes too long or too much memory the process ends instead.

    Parameters
    ----------
    task : Task
    make : callable
        What makes rows.
    """
    with _alone:
        begin()
        assert _watch is not None
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            _watch.memory = task.memory
            # A thread that needs no lock of the interpreter: also what never comes back to Python ends.
            faulthandler.dump_traceback_later(min(task.timeout, _EVER), exit=True, file=nowhere)
            try:
                row, whole = make(task, _kept)
            finally:
                faulthandler.cancel_dump_traceback_later()
                _watch.memory = float("inf")
        row["worker_peak_memory_mb"], row[NOW] = round(peak_memory(), 1), _memory_now()
        return row, whole


def _memory_now() -> float:
    """Memory that this process takes now, or at most where the system does not say [MB]."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            pages = int(file.read().split()[1])
    except (OSError, ValueError, IndexError):
        return peak_memory()
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def peak_memory() -> float:
    """Memory that this process has taken at most [MB]."""
    try:
        import resource
    except ImportError:  # not on Windows
        return 0.0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (2**20 if sys.platform == "darwin" else 2**10)
