"""Parts of a cycle under a deadline: none is begun that would not end in time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from repair.deadline import in_time
from repair.preparation import Phases

__all__ = ["LEAST", "Pace", "Paced"]

_KEPT = 15  # times of a part that are looked at
LEAST = 3  #: with less of them nobody knows how long it takes
_MORE = 1.25  # and so much longer it may take
_AGAIN = 1500  # of a part that was left out so often nobody knows any more: the machine may be another


class Pace:
    """How long one part takes, from how long it took: processor time, since waiting says nothing."""

    def __init__(self) -> None:
        self._took: deque[float] = deque(maxlen=_KEPT)
        self._left_out = 0

    @property
    def expected(self) -> float:
        """[s]; 0 where nobody knows."""
        if len(self._took) < LEAST:
            return 0.0
        return _MORE * sorted(self._took)[(3 * len(self._took)) // 4]

    def left_out(self) -> None:
        """It was not begun."""
        self._left_out += 1
        if self._left_out >= _AGAIN:
            self._took.clear()

    def took(self, seconds: float) -> None:
        """It was done."""
        self._took.append(seconds)
        self._left_out = 0


@dataclass
class Paced(Phases):
    """Phases of a cycle, each of which ends by the deadline of the context or is not begun.

    Attributes
    ----------
    paces : dict
        How long each phase takes; kept from cycle to cycle.
    """

    paces: dict[str, Pace] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the time of a ``with`` block to a phase.

        Raises
        ------
        repair.deadline.OutOfTime
            On entering, if there is no time for it.
        """
        pace = self.paces.setdefault(name, Pace())
        pace.left_out()
        in_time(pace.expected, name)
        begin, wall = time.thread_time(), time.perf_counter()
        try:
            yield
            pace.took(time.thread_time() - begin)
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - wall
