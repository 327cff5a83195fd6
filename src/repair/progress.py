"""How far something long has come: a bar on a terminal, and elsewhere a line every half a minute."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

__all__ = ["Progress", "counted"]

T = TypeVar("T")

_TOLD_EVERY = 30.0  # how often there is a line where nobody watches a bar [s]


class Progress:
    """What is shown on standard error.

    Parameters
    ----------
    total, before : int
        How many there are to be at the end, and at the beginning.
    shown : bool, optional
        Whether anything is to be seen; by default it is.
    of : str
        What is counted.
    """

    def __init__(self, total: int, before: int = 0, shown: bool | None = None, *, of: str = "rows") -> None:
        from tqdm import tqdm

        stream = sys.stderr
        terminal = stream is not None and stream.isatty()
        self.lines = shown is not False and not terminal and stream is not None
        hidden = shown is False or not terminal
        self.bar = tqdm(total=total, initial=before, disable=hidden, desc=of, leave=False)
        self.total, self.before, self.made, self.broken, self.of = total, before, 0, 0, of
        self.begin = self.told = time.monotonic()

    def one(self, *, broken: bool = False) -> None:
        """One more, which may be one that could not be run."""
        self.made += 1
        self.broken += broken
        self.bar.update()
        self.idle()

    def idle(self) -> None:
        """Tell, if it is time to."""
        now = time.monotonic()
        if self.lines and now - self.told >= _TOLD_EVERY:
            self.told = now
            print(self.words(now - self.begin), file=sys.stderr, flush=True)

    def words(self, spent: float) -> str:
        """How far it is, after so many seconds."""
        there = self.before + self.made
        left = f", about {spent / self.made * (self.total - there):.0f} s left" if self.made else ""
        failed = f", {self.broken} could not be run" if self.broken else ""
        return f"repair: {there} of {self.total} {self.of}{failed}{left}"

    def close(self) -> None:
        """Take the bar away."""
        self.bar.close()


def counted(made: Iterable[T], total: int, of: str, shown: bool | None = None) -> Iterator[T]:
    """What is made, one after the other, and how far it is meanwhile."""
    progress = Progress(total, shown=shown, of=of)
    try:
        for one in made:
            yield one
            progress.one()
    finally:
        progress.close()
