"""Checks by name that a repair has to pass beside those that :mod:`repair.check.checker` always makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from repair.check.verdict import Violation
from repair.curves.plane import CartesianPath
from repair.errors import ConfigError
from repair.problem.problem import RepairProblem
from repair.registry import Registry
from repair.vehicle.states import DrivenStates

__all__ = ["CHECKS", "Check", "Driven", "register"]


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

CHECKS: Registry[Check] = Registry("check", {}, error=ConfigError, group="repair.checks")


def register(name: str, check: Check) -> None:
    """Add a check of your own for this process; ``checker.extra: [name]`` asks for it.

    Raises
    ------
    ConfigError
        If the name is taken.
    """
    CHECKS.register(name, check)
