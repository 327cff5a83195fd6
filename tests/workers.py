"""Processes that can be asked, waited for, and replaced: for input that may break or hang one."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

__all__ = ["answers"]

Task = TypeVar("Task")
_MEMORY = 8 << 30  # address space of a worker [bytes]


def _serve(pipe: Any, work: Callable[[Any], Any]) -> None:
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)
    os.dup2(quiet, 2)
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    except (ImportError, ValueError, OSError):  # no such limit here: the hard time limit remains
        pass
    import repair.api  # noqa: F401  not on the clock of the first input

    pipe.send("ready")
    while (task := pipe.recv()) is not None:
        pipe.send(work(*task))


class _Worker:
    def __init__(self, work: Callable[[Any], Any], limit: float) -> None:
        self.work, self.limit, self.process, self.task = work, limit, None, None

    def give(self, task: Any) -> None:
        if self.process is None:
            context = multiprocessing.get_context("spawn")
            self.pipe, theirs = context.Pipe()
            self.process = context.Process(target=_serve, args=(theirs, self.work), daemon=True)
            self.process.start()
            theirs.close()
            self.pipe.recv()
        self.pipe.send((task,))
        self.task, self.deadline = task, time.monotonic() + self.limit

    def collect(self) -> tuple[bool, Any] | None:
        """Whether there is an answer, and it or why there is none; None while it is busy."""
        try:
            if self.pipe.poll(0.05):
                return True, self.pipe.recv()
        except (EOFError, OSError):
            self.process.join(5.0)
            code, self.process = self.process.exitcode, None
            return False, f"the process ended with exit code {code}"
        if time.monotonic() < self.deadline:
            return None
        self.stop()
        return False, f"no answer within {self.limit:g} s"

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.join(5.0)
            self.process = None


def answers(
    tasks: Iterable[Task],
    work: Callable[[Task], Any],
    lost: Callable[[Task, str], Any],
    *,
    jobs: int = 1,
    limit: float = 30.0,
) -> Iterator[Any]:
    """What ``work`` answers to each task, in the order in which the answers come.

    Parameters
    ----------
    tasks : iterable
    work : callable
        Runs in a process of its own; a function of a module, or a partial of one.
    lost : callable
        What is answered for a task whose process ended or hung, and the words for that.
    jobs : int
        Processes.
    limit : float
        Time for one task [s].
    """
    waiting = iter(tasks)
    workers = [_Worker(work, limit) for _ in range(max(1, jobs))]
    try:
        busy = [w for w, task in zip(workers, waiting, strict=False) if w.give(task) is None]
        while busy:
            for worker in list(busy):
                came = worker.collect()
                if came is None:
                    continue
                yield came[1] if came[0] else lost(worker.task, came[1])
                task = next(waiting, None)
                if task is None:
                    busy.remove(worker)
                else:
                    worker.give(task)
    finally:
        for worker in workers:
            worker.stop()
