"""Curves from whose end the vehicle can be braked to a standstill, for backends that can bound an end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from repair.arrays import Array
from repair.backend.base import Closest, SolveResult
from repair.problem.problem import RepairProblem
from repair.terminal.room import missed_by

__all__ = ["able_to_stop"]

_ENDS = 2  # times that a curve is asked for again: who slows down may end on another path
_KEPT = 1e-6  # [m] that a stop may get too far


def able_to_stop(
    result: SolveResult, problem: RepairProblem, ask: Callable[[Array], SolveResult]
) -> SolveResult:
    """Instead of a curve that ends too fast behind what is ahead one that ends slowly enough, if any does.

    What was found with the end as it comes is the closest then: the judge of ends knows more ways to come to
    rest than full braking along the path, and may accept it.

    Parameters
    ----------
    result : SolveResult
        Found with the end as it comes.
    problem : RepairProblem
        Where its ``afterwards`` is None, the result is left as it is.
    ask : callable
        Solves the problem again, with what :meth:`repair.terminal.room.RoomToStop.within` says of the end.
    """
    after, found = problem.afterwards, result
    for _ in range(_ENDS):
        curve = found.curve
        if curve is None and found.closest is not None and not problem.strict:
            curve = found.closest.curve
        if after is None or curve is None:
            break
        within = after.within(problem, curve)
        if missed_by(curve, problem.t_end, within) <= _KEPT:
            break
        again = ask(within)
        if again.curve is None and (found.curve is not None or again.closest is None):
            return replace(found, detail=f"{found.detail}; to be able to stop after it: {again.detail}")
        before = found.closest
        if found.curve is not None:
            before = Closest(found.curve, 0.0, found.residuals, "that which ends as it comes", before)
        iterations = found.iterations + again.iterations
        if again.curve is None and again.closest is not None:
            closest = replace(again.closest, residuals=again.residuals, instead=before)
            found = replace(found, closest=closest, iterations=iterations)
        else:
            found = replace(again, closest=before, iterations=iterations)
    return found
