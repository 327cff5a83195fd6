"""The deadline of what is being done: set by whoever has a time limit, looked at by whatever takes long.

It belongs to the context (:mod:`contextvars`) and is not handed from function to function: between a
search and what takes its time lie seams (checks, vehicles, references) whose signatures are others'.
Without a limit nothing looks at a clock.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar
from threading import Lock

from repair.errors import OutOfTime

__all__ = ["Estimate", "OutOfTime", "held", "in_time", "limited", "time_left", "until"]

_NEVER = float("inf")
_NOTHING = nullcontext()
_AT: ContextVar[float] = ContextVar("repair.deadline", default=_NEVER)


def until(at: float | None) -> AbstractContextManager[None]:
    """Set the deadline inside of a ``with`` block; one that is set already stays where it is earlier.

    Not to be held across the ``yield`` of a generator: it would hold for whoever asked that.

    Parameters
    ----------
    at : float or None
        Of :func:`time.perf_counter` [s]; None sets nothing.
    """
    return _NOTHING if at is None else _until(at)


@contextmanager
def _until(at: float) -> Iterator[None]:
    token = _AT.set(min(_AT.get(), at))
    try:
        yield
    finally:
        _AT.reset(token)


def limited() -> bool:
    """Whether there is a deadline."""
    return _AT.get() != _NEVER


def time_left() -> float:
    """Time until the deadline [s]; infinite without one, never below 0."""
    at = _AT.get()
    return at if at == _NEVER else max(at - time.perf_counter(), 0.0)


def in_time(needed: float = 0.0, what: str = "") -> None:
    """Go on only while there is time.

    Parameters
    ----------
    needed : float
        How long the next piece takes, which cannot be interrupted [s].
    what : str
        That piece in words, for the message.

    Raises
    ------
    OutOfTime
        If the deadline passes before that.
    """
    at = _AT.get()
    if at != _NEVER and time.perf_counter() + needed >= at:
        raise OutOfTime(f"{what} takes about {needed:.2f} s, which are not left" if needed else what)


def held(lock: Lock) -> AbstractContextManager[object]:
    """Hold a lock that another thread may hold for long.

    Raises
    ------
    OutOfTime
        On entering, if it is not to be had before the deadline.
    """
    return _held(lock) if limited() else lock


@contextmanager
def _held(lock: Lock) -> Iterator[None]:
    if not lock.acquire(timeout=time_left()):
        raise OutOfTime("another thread holds what is needed")
    try:
        yield
    finally:
        lock.release()


class Estimate:
    """How long something takes that cannot be interrupted, from how long it took.

    Parameters
    ----------
    rate : float
        Seconds by unit of size, before anything was seen.
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._seen = False

    def of(self, size: float) -> float:
        """Seconds for a size, a quarter more than what was seen."""
        return 1.25 * self.rate * size

    @contextmanager
    def watch(self, size: float) -> Iterator[None]:
        """See how long a ``with`` block takes, in processor time: waiting for the machine says nothing."""
        begin = time.thread_time()
        yield
        rate = (time.thread_time() - begin) / max(size, 1e-9)
        self.rate = max(rate, 0.8 * self.rate) if self._seen else rate
        self._seen = True
