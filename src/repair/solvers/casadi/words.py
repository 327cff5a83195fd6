"""What the hard backend says of its solves: statuses, and obstacles by name."""

from __future__ import annotations

import numpy as np

from repair.arrays import Array
from repair.backend.base import SolveStatus
from repair.problem.problem import Side
from repair.solvers.casadi.instance import TOLERANCE, Instance
from repair.solvers.casadi.model import Model, Solution
from repair.solvers.casadi.separation import Separation

__all__ = ["gap_of", "largest_violation", "missed", "status_of", "worst_family"]
# On which sides of an obstacle the lower and the upper bounds of s and l are.
_SIDE_OF = ((Side.AHEAD, Side.BEHIND), (Side.LEFT, Side.RIGHT))

_STATUS = {
    "Solve_Succeeded": SolveStatus.SOLVED,
    "Solved_To_Acceptable_Level": SolveStatus.SOLVED,
    "Feasible_Point_Found": SolveStatus.SOLVED,
    "Infeasible_Problem_Detected": SolveStatus.INFEASIBLE,
    "Maximum_Iterations_Exceeded": SolveStatus.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": SolveStatus.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": SolveStatus.TIME_LIMIT,
    "User_Requested_Stop": SolveStatus.TIME_LIMIT,
}


def status_of(model: Model, solution: Solution) -> SolveStatus:
    if model.structure.solver == "ipopt":
        return _STATUS.get(solution.word, SolveStatus.NUMERICAL_ERROR)
    if not solution.violation <= TOLERANCE:
        timed_out = solution.word == "User_Requested_Stop"
        return SolveStatus.TIME_LIMIT if timed_out else SolveStatus.NUMERICAL_ERROR
    if solution.word == "Search_Direction_Becomes_Too_Small":
        return SolveStatus.SOLVED  # the QP's step is nil: a stationary point
    return _STATUS.get(solution.word, SolveStatus.NUMERICAL_ERROR)


def missed(instance: Instance, separation: Separation, points: Array, miss: float) -> str:
    """The obstacle that is missed by the most, as a sentence."""
    position = instance.model.obstacle @ points + instance.origin
    depth = np.array((separation.lower - position, position - separation.upper))
    row = int(np.argmax(np.max(depth, axis=(0, 2)) > 0.99 * miss - 1e-6))
    end, axis = np.unravel_index(int(np.argmax(depth[:, row])), (2, 2))
    side = _SIDE_OF[int(axis)][int(end)]
    return (
        f"passing as the guide does, every curve within the limits comes at least {miss:.2f} m too close to "
        f"{separation.who(row, side)} (t = {separation.times[row]:.2f} s)"
    )


def gap_of(separation: Separation) -> str:
    """Name the first place where the bounds leave nothing."""
    closed = separation.lower > separation.upper + 2e-7
    if not closed.any():
        return ""
    row, axis = (int(i[0]) for i in np.nonzero(closed))
    below, above = (separation.who(row, side) for side in _SIDE_OF[axis])
    who = f"{below} and {above} leave" if below != above else f"{below} alone leaves"
    return f"{who} no gap at t = {separation.times[row]:.2f} s"


def largest_violation(residuals: dict[str, float]) -> float:
    """The largest violation; NaN if one of them is."""
    return float(np.maximum.reduce(tuple(residuals.values())))


def worst_family(residuals: dict[str, float]) -> str:
    family = max(residuals, key=lambda k: residuals[k])
    return f"{family} is violated by {residuals[family]:.2g}"
