"""One strictly convex QP, the point next to the origin, with the answer checked against the problem itself.

The solvers report in words of their own and not all of them are right, so: a solution counts when
its residuals and its duality gap, recomputed here, are small, whatever it is called; "no solution"
counts when multipliers prove it (Farkas' lemma, recomputed too) or, without such a proof, a linear
program agrees that the constraints have no common point. A solver that fails this on small problems
of known answer is refused by name.

daqp and OSQP are called directly: qpsolvers knows only one-sided inequalities, which doubles the rows,
and its conversions take longer than daqp does. Every other solver goes through qpsolvers.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

from repair.arrays import Array
from repair.backend.base import SolveStatus
from repair.baselines.qptr.qp_residuals import combined, duality_gap, violation_of
from repair.baselines.qptr.qp_solvers import SolverCall, call_solver, daqp_frame

__all__ = ["QpAnswer", "infeasibility", "proven_violation", "solve_projection"]

#: Largest violation of a constraint (rows of unit norm) in a solution that counts as one.
FEASIBLE = 1e-5
#: Largest relative duality gap of a solution.
OPTIMAL = 1e-4
# A proof that there is no solution counts for |z| up to here; |z|^2 / 2 is the objective.
_FAR = 1e4
# Price of |z|^2 in the search for such a proof, against that of the violation squared.
_SOFT = 1e-8


class QpAnswer(NamedTuple):
    """Status, the point (None without one), its largest violation, and the particulars."""

    status: SolveStatus
    z: Array | None
    violation: float
    detail: str


def solve_projection(
    rows: Array,
    lower: Array,
    upper: Array,
    solver: str,
    time_limit: float | None = None,
    *,
    call: SolverCall = call_solver,
) -> QpAnswer:
    """The point z next to the origin with ``lower <= rows @ z <= upper``.

    Parameters
    ----------
    rows : (r, m) array
        Of unit norm; daqp wants it writable, but leaves it alone.
    lower, upper : (r,) array
        May be infinite.
    solver : str
        Any name that qpsolvers knows here.
    time_limit : float, optional
        Wall time [s], for the solvers that take one.
    call : SolverCall
        How the solver is called; whatever it says is judged all the same.
    """
    if time_limit is not None and time_limit <= 0.0:
        return QpAnswer(SolveStatus.TIME_LIMIT, None, np.inf, "no time left")
    if np.count_nonzero(upper >= 0.0) == len(upper) and np.count_nonzero(lower <= 0.0) == len(lower):
        return QpAnswer(SolveStatus.SOLVED, np.zeros(rows.shape[1]), 0.0, "no constraint is active")
    begin = time.perf_counter()
    # daqp reads on from the first number, whatever the strides are.
    rows, lower, upper = np.ascontiguousarray(rows), np.ascontiguousarray(lower), np.ascontiguousarray(upper)
    try:
        raw = call(rows, lower, upper, solver, time_limit)
    except Exception as error:  # the solvers' own exceptions have no common base
        return QpAnswer(
            SolveStatus.NUMERICAL_ERROR, None, np.inf, f"{solver}: {type(error).__name__}: {error}"
        )
    violation = np.inf
    if raw.z is not None:
        violation = violation_of(rows, lower, upper, raw.z)
        # NaN fails both comparisons.
        if violation <= FEASIBLE and duality_gap(rows, lower, upper, raw) <= OPTIMAL:
            return QpAnswer(SolveStatus.SOLVED, raw.z, violation, f"{solver}: {raw.word}")
    if time_limit is not None and time.perf_counter() - begin >= 0.99 * time_limit:
        return QpAnswer(SolveStatus.TIME_LIMIT, None, violation, f"{solver}: time limit of {time_limit:g} s")
    least = proven_violation(rows, lower, upper)
    if not least > FEASIBLE:
        least = infeasibility(rows, lower, upper)
    if least > FEASIBLE:
        return QpAnswer(
            SolveStatus.INFEASIBLE,
            None,
            least,
            f"{solver}: {raw.word}; the constraints have no common point",
        )
    # OSQP calls what it has at its iteration limit inaccurate.
    limited = "max" in raw.word or "inaccurate" in raw.word
    return QpAnswer(
        SolveStatus.ITERATION_LIMIT if limited else SolveStatus.NUMERICAL_ERROR,
        None,
        violation,
        f"{solver}: {raw.word}, although the constraints have a common point",
    )


def proven_violation(rows: Array, lower: Array, upper: Array) -> float:
    """A violation that no z with ``|z| <= _FAR`` can avoid, 0 where none is proved.

    A z within e of all bounds has ``y @ rows @ z <= allowed + e |y|_1`` for any y; where ``rows.T @ y``
    is zero and what the bounds allow is negative, e cannot be zero (Farkas' lemma). Good multipliers y
    are those of the least squares violation: daqp with soft rows, next to no price on z.
    """
    import daqp

    hessian, linear, kinds = daqp_frame(rows.shape[1], len(rows), 8)
    _, _, flag, info = daqp.solve(hessian, linear, rows, upper, lower, kinds, rho_soft=_SOFT)
    y = info["lam"]
    total = float(np.add.reduce(np.abs(y)))
    if flag <= 0 or not 0.0 < total < np.inf:  # NaN is neither
        return 0.0
    combination, allowed = combined(rows, lower, upper, y)
    return max(-allowed - _FAR * math.sqrt(combination @ combination), 0.0) / total


def infeasibility(rows: Array, lower: Array, upper: Array) -> float:
    """Smallest possible violation of ``lower <= rows @ z <= upper`` (rows of unit norm); 0 if z exists."""
    from scipy.optimize import linprog

    m = rows.shape[1]
    above, below = np.isfinite(upper), np.isfinite(lower)
    matrix = np.vstack([rows[above], -rows[below]])
    answer = linprog(
        np.append(np.zeros(m), 1.0),
        A_ub=np.column_stack([matrix, -np.ones(len(matrix))]),
        b_ub=np.concatenate([upper[above], -lower[below]]),
        bounds=[(None, None)] * m + [(0.0, None)],
        method="highs",
    )
    return float(answer.x[-1]) if answer.success else np.inf
