"""What a cycle is asked, looked at before anything is done."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from repair.cycle.paced import Paced
from repair.errors import ConfigError, in_words
from repair.timegrid import INSTANT

__all__ = ["Asked", "Others", "is_number", "require_deadline", "since", "spare", "step_of"]


@dataclass(frozen=True)
class Asked:
    """A cycle that is asked for: when it begins [s] and at which step, since when and until when [s]."""

    now: float
    step: int
    begin: float
    at: float | None
    phases: Paced
    rebuilt: list[str] = field(default_factory=list)

    @property
    def told(self) -> tuple[str, ...]:
        """What was laid out anew."""
        return tuple(self.rebuilt)


class Others(NamedTuple):
    """All others there are, and from which probability on their modes count."""

    traffic: Iterable[Any] | None
    threshold: float

    @classmethod
    def of(cls, traffic: Iterable[Any] | None, threshold: float | None) -> Others:
        """As they are given.

        Raises
        ------
        ConfigError
            If there is a threshold, and nobody whose modes it could be about.
        """
        if threshold is not None and traffic is None:
            raise ConfigError("threshold is about the modes of traffic=, and none is given")
        return cls(traffic, 0.0 if threshold is None else threshold)


def is_number(value: Any) -> bool:
    """Whether it is a real number, of Python or NumPy."""
    return isinstance(value, Real) and not isinstance(value, bool)


def require_deadline(deadline: Any) -> None:
    """Refuse a deadline that is none.

    Raises
    ------
    ConfigError
        With what it is.
    """
    if deadline is not None and not (is_number(deadline) and deadline > 0.0):
        raise ConfigError(f"the deadline is {in_words(deadline)}; it has to be positive [s]")


def step_of(now: Any, dt: float) -> int:
    """The step of the scenario at a time [s].

    Raises
    ------
    ConfigError
        If it is no time, or lies between two steps.
    """
    if not (is_number(now) and np.isfinite(now) and now >= 0.0):
        raise ConfigError(f"now is {in_words(now)}; it is a time from the planning problem's start on [s]")
    step = round(float(now) / dt)
    if abs(step * dt - now) > INSTANT * max(1.0, now):
        raise ConfigError(f"now is {now:g} s; it has to be a multiple of the step of {dt:g} s")
    return step


def since(begin: float) -> float:
    """Wall time since then [s]."""
    return time.perf_counter() - begin


def spare(deadline: float) -> float:
    """What is left for making the answer of what was found [s]."""
    return min(1e-3, 0.1 * deadline)
