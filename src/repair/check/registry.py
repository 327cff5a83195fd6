"""Checks by name that a repair has to pass beside those that :mod:`repair.check.checker` always makes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from repair.check.verdict import Violation
from repair.curves.plane import CartesianPath
from repair.errors import ConfigError, foreign, in_words, kind_of
from repair.problem.problem import RepairProblem
from repair.registry import Registry, called
from repair.vehicle.states import DrivenStates

__all__ = ["CHECKS", "Check", "Driven", "register", "violations_of"]


@dataclass(frozen=True)
class Driven:
    """A repaired trajectory as it is driven, from one scenario step before ``t_rep`` on.

    Attributes
    ----------
    problem : RepairProblem
        What was asked for: limits, obstacles in (s, l), the reference.
    path : CartesianPath
        The vehicle's centre, densely sampled.
    states : DrivenStates
        The vehicle at the same samples.
    late : int
        Sample at which the repair begins; before it the reference is followed.
    """

    problem: RepairProblem
    path: CartesianPath
    states: DrivenStates
    late: int


#: Says what is wrong with a driven trajectory; nothing where it is good.
Check = Callable[[Driven], Sequence[Violation]]

CHECKS: Registry[Check] = Registry("check", {}, error=ConfigError, group="repair.checks", admit=called)


def register(name: str, check: Check) -> None:
    """Add a check of your own for this process; ``checker.extra: [name]`` asks for it.

    Parameters
    ----------
    name : str
    check : callable
        A function of a driven trajectory to what is wrong with it: :data:`Check`.

    Raises
    ------
    ConfigError
        If the name is taken.
    """
    CHECKS.register(name, check)


def violations_of(checks: Mapping[str, Check], driven: Driven) -> list[Violation]:
    """What all these checks say.

    Raises
    ------
    ConfigError
        If one of them raises, or says something else than :class:`Violation`; the sentence names it.
    """
    found: list[Violation] = []
    for name, check in checks.items():
        with foreign(f"check {name!r}", ConfigError):
            said: Any = check(driven)
        if not isinstance(said, Sequence):
            raise ConfigError(f"check {name!r} gave {kind_of(said)}; it has to give a list of violations")
        if strange := [one for one in said if not isinstance(one, Violation)]:
            raise ConfigError(f"check {name!r} gave {in_words(strange[0])} among its violations")
        found += said
    return found
