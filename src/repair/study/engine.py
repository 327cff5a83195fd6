"""Rows made by several processes, each of which is given one task after the other.

A *lane* is one process: of this machine, by joblib's loky, or a worker of a Dask cluster. It is given the
tasks of one scenario, so that what they have in common is made once. A lane has one task at a time, so that
who ends a process, by a crash or by taking too long, is known, and nobody else's row is lost with it.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

from repair.errors import RepairError
from repair.study.plan import Task
from repair.study.rows import failed_row, one_line, strict
from repair.study.worker import NOW, TOO_MUCH_MEMORY, Answer, begin, parts_of_the_program, run_task, started

__all__ = ["Lane", "Lanes", "LocalLanes", "rows_of"]

_GRACE = 2.0  # a process ends itself when a row takes too long; after this much more it is ended [s]
_MOST = 300.0  # a process that takes so much makes room for a new one, between two scenarios [MB]
_LOOKS = 0.1  # how often it is looked at the clock [s]


Work = Callable[[Task], Answer]


class Lane(Protocol):
    """One process that can be given tasks, and be replaced.

    Where it takes ``most`` MB it is replaced before the next scenario.
    """

    name: str
    most: float

    def give(self, task: Task) -> Future[Answer]:
        """Have a task done; the process is started if need be."""
        ...

    def ready(self) -> bool:
        """Whether the process has started; the clock of a task does not run before."""
        ...

    def replace(self) -> bool:
        """End the process, whatever it does; whether there will be another one."""
        ...


class Lanes(Protocol):
    """All that there are now; more may come, and some may go."""

    def now(self) -> Sequence[Lane]:
        """Those that can be given tasks."""
        ...

    def close(self) -> None:
        """End them."""
        ...


@dataclass
class _Local:
    """A process of this machine."""

    name: str
    work: Work
    parts: bytes = b""  # what the program has registered
    most: float = _MOST
    executor: Any = None
    hello: Future[str] | None = None

    def give(self, task: Task) -> Future[Answer]:
        if self.executor is None:
            from joblib.externals.loky import ProcessPoolExecutor

            threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
            with _no_interrupts():
                self.executor = ProcessPoolExecutor(
                    max_workers=1, initializer=begin, initargs=(os.getpid(), self.parts), env=threads
                )
                self.hello = self.executor.submit(started)
        made: Future[Answer] = self.executor.submit(self.work, task)
        return made

    def ready(self) -> bool:
        return self.hello is not None and self.hello.done()

    def replace(self) -> bool:
        if self.executor is not None:
            self.executor.shutdown(wait=True, kill_workers=True)
        self.executor = self.hello = None
        return True


@contextmanager
def _no_interrupts() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, even before their first line; here it is heard afterwards."""
    if sys.platform == "win32":
        yield
        return
    import multiprocessing.resource_tracker as own

    from joblib.externals.loky.backend import resource_tracker

    for tracker in (own, resource_tracker):  # as they start they have it heard again
        tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class LocalLanes:
    """Processes of this machine (joblib's loky).

    Parameters
    ----------
    count : int
    work : callable
        What is done with a task, in a process of its own. What the program has registered is known there.

    Raises
    ------
    RepairError
        If that cannot be handed over.
    """

    def __init__(self, count: int, work: Work = run_task) -> None:
        if count < 1:
            raise RepairError(f"{count} worker processes are asked for; at least one is needed")
        # A worker that has grown by 300 MB ends itself after a row, and another one takes the next: no news.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        parts = parts_of_the_program()
        self.lanes = [_Local(f"worker {k + 1}", work, parts) for k in range(count)]

    def now(self) -> Sequence[Lane]:
        """All of them; a process is started when it is first given something."""
        return self.lanes

    def close(self) -> None:
        """End the processes, whatever they do."""
        for lane in self.lanes:
            lane.replace()


@dataclass
class _Busy:
    """What a lane is doing."""

    lane: Lane
    task: Task
    future: Future[Answer]
    since: float | None = None

    def late(self, now: float) -> bool:
        """Whether it takes too long; the clock begins when the process is there."""
        if self.since is None and self.lane.ready():
            self.since = now
        return self.since is not None and now > self.since + self.task.timeout + _GRACE

    def spent(self) -> float:
        return 0.0 if self.since is None else time.monotonic() - self.since


@dataclass
class _Queues:
    """Tasks by scenario; a lane keeps to one scenario, and helps another one when there are no more."""

    waiting: deque[deque[Task]]
    taken: dict[str, deque[Task]] = field(default_factory=dict)

    @classmethod
    def of(cls, tasks: Iterable[Task]) -> _Queues:
        groups: dict[tuple[str, str], deque[Task]] = {}
        for task in tasks:
            groups.setdefault((task.file, task.sha256), deque()).append(task)
        return cls(deque(groups.values()))

    def next(self, name: str) -> Task | None:
        """The next task of a lane; None where nothing is left."""
        own = self.taken.get(name)
        if not own and self.waiting:
            own = self.taken[name] = self.waiting.popleft()
        if own:
            return own.popleft()
        longest = max(self.taken.values(), key=len, default=None)
        return longest.pop() if longest else None

    def turns(self, name: str) -> bool:
        """Whether a lane has nothing left of its scenario."""
        return not self.taken.get(name)

    def __bool__(self) -> bool:
        return any(self.waiting) or any(self.taken.values())


def rows_of(
    tasks: Iterable[Task], lanes: Lanes, *, idle: Callable[[], None] = lambda: None
) -> Iterator[tuple[Task, Answer]]:
    """The row of every task, in the order in which they end.

    Parameters
    ----------
    tasks : iterable of Task
    lanes : Lanes
        They are closed at the end, and when who asks for rows stops asking.
    idle : callable
        Called while nothing has ended, a few times a second.

    Yields
    ------
    Task
    Answer
        A row that tells what happened where the process crashed, took too long or too much memory.
    """
    queues = _Queues.of(tasks)
    busy: dict[str, _Busy] = {}
    try:
        while queues or busy:
            for lane in lanes.now():
                if lane.name not in busy and (task := queues.next(lane.name)) is not None:
                    busy[lane.name] = _Busy(lane, task, lane.give(task))
            _wait(busy)
            ended = [each for each in busy.values() if each.future.done() or each.late(time.monotonic())]
            for each in ended:
                del busy[each.lane.name]
                answer = _answer(each)
                # What scenarios leave behind (models, caches, holes in the heap) adds up.
                if answer[0].pop(NOW, 0.0) > each.lane.most and queues.turns(each.lane.name):
                    each.lane.replace()
                yield each.task, answer
            if not ended:
                idle()
    finally:
        lanes.close()


def _wait(busy: dict[str, _Busy]) -> None:
    """Until something has ended, or for a moment."""
    if not busy:
        time.sleep(_LOOKS)
        return
    for each in busy.values():
        each.late(time.monotonic())  # begins its clock
    wait([each.future for each in busy.values()], timeout=_LOOKS, return_when=FIRST_COMPLETED)


def _answer(ended: _Busy) -> Answer:
    """What a task has given, or the row of what has become of its process."""
    task = ended.task
    if not ended.future.done():
        ended.lane.replace()
        return _lost(task, "timeout", task.too_late)
    try:
        return ended.future.result()
    except Exception as error:  # of the executor: what a row raises is told by the row
        spent = ended.spent()
        ended.lane.replace()
        words = one_line(error)
        if f"EXIT({TOO_MUCH_MEMORY})" in words:
            return _lost(task, "memory", task.too_much)
        if spent >= task.timeout - 2.0 * _LOOKS:  # that it had begun may have been noticed a look later
            return _lost(task, "timeout", task.too_late)
        how = re.search(r"\{(.*?)\}", words)
        return _lost(task, "crash", f"the worker process ended: {how.group(1) if how else words}")


def _lost(task: Task, status: str, detail: str) -> Answer:
    row = failed_row(task.file, task.backend, task.reference, status, detail, task.table)
    row["variation"] = task.variation
    return strict(row, task.table), None
