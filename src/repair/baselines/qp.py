"""One strictly convex QP through qpsolvers, with the answer checked against the problem itself.

The solvers report in words of their own and not all of them are right, so: a solution counts when
its residuals and its duality gap, recomputed here, are small, whatever it is called; "no solution"
counts when a linear program agrees that the constraints have no common point. A solver that fails
this on small problems of known answer is refused by name.
"""

from __future__ import annotations

import time
import warnings
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from repair.baselines.bernstein import qp_structure
from repair.errors import BackendError
from repair.types import Array, SolveStatus

__all__ = ["QpAnswer", "braking_problem", "require_solver", "solve_projection"]

#: Largest violation of a constraint (rows of unit norm) in a solution that counts as one.
FEASIBLE = 1e-5
#: Largest relative duality gap of a solution.
OPTIMAL = 1e-4

# Tolerances well below what the checker can see; the defaults of the first-order methods are not.
_SETTINGS: dict[str, dict[str, Any]] = {
    "osqp": {
        "eps_abs": 1e-6,
        "eps_rel": 1e-8,
        "eps_prim_inf": 1e-7,
        "max_iter": 50_000,
        "polishing": True,
        "scaling": 0,  # the rows have unit norm and the Hessian is the identity already
    },
    "clarabel": {"tol_feas": 1e-9, "tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9},
    "daqp": {"primal_tol": 1e-8, "dual_tol": 1e-10},
}
_TIMED = ("osqp", "clarabel", "daqp")
_SPARSE = ("osqp", "clarabel", "qpalm", "highs", "piqp", "ecos", "scs", "hpipm")


class QpAnswer(NamedTuple):
    """Status, the point (None without one), its largest violation, and the particulars."""

    status: SolveStatus
    z: Array | None
    violation: float
    detail: str


def solve_projection(
    origin: Array, rows: Array, limit: Array, solver: str, time_limit: float | None = None
) -> QpAnswer:
    """The point next to ``origin`` with ``rows @ z <= limit``.

    Parameters
    ----------
    origin : (m,) array
        Where the objective ``|z - origin|^2 / 2`` is smallest.
    rows : (r, m) array
        Of unit norm.
    limit : (r,) array
    solver : str
        Any name that qpsolvers knows here.
    time_limit : float, optional
        Wall time [s], for the solvers that take one.
    """
    if time_limit is not None and time_limit <= 0.0:
        return QpAnswer(SolveStatus.TIME_LIMIT, None, np.inf, "no time left")
    room = limit - rows @ origin
    if room.min(initial=0.0) >= 0.0:
        return QpAnswer(SolveStatus.SOLVED, origin, 0.0, "no constraint is active")
    begin = time.perf_counter()
    try:
        solution = _call(rows, room, solver, time_limit)
    except Exception as error:  # the solvers' own exceptions have no common base
        return QpAnswer(
            SolveStatus.NUMERICAL_ERROR, None, np.inf, f"{solver}: {type(error).__name__}: {error}"
        )
    word = _word(solution)
    z = None
    if solution.x is not None and np.isfinite(solution.x).all():
        z = np.asarray(solution.x, dtype=np.float64)
    violation = float(np.max(rows @ z - room, initial=0.0)) if z is not None else np.inf
    if z is not None and violation <= FEASIBLE and _gap(rows, room, z, solution.z) <= OPTIMAL:
        return QpAnswer(SolveStatus.SOLVED, origin + z, violation, f"{solver}: {word}")
    if time_limit is not None and time.perf_counter() - begin >= 0.99 * time_limit:
        return QpAnswer(SolveStatus.TIME_LIMIT, None, violation, f"{solver}: time limit of {time_limit:g} s")
    gap = infeasibility(rows, room)
    if gap > FEASIBLE:
        return QpAnswer(
            SolveStatus.INFEASIBLE, None, gap, f"{solver}: {word}; the constraints have no common point"
        )
    detail = f"{solver}: {word}, although the constraints have a common point"
    return QpAnswer(
        SolveStatus.ITERATION_LIMIT if "max" in word else SolveStatus.NUMERICAL_ERROR, None, violation, detail
    )


def _call(rows: Array, room: Array, solver: str, time_limit: float | None) -> Any:
    """``min |z|^2 / 2`` subject to ``rows @ z <= room``: a ``qpsolvers.Solution``."""
    from qpsolvers import Problem, solve_problem

    settings = dict(_SETTINGS.get(solver, {}))
    if time_limit is not None and solver in _TIMED:
        settings["time_limit"] = time_limit
    hessian, matrix = np.eye(rows.shape[1]), rows.copy()
    if solver in _SPARSE:
        from scipy.sparse import csc_matrix

        hessian, matrix = csc_matrix(hessian), csc_matrix(rows)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a failure is told by the status, not by a warning
        return solve_problem(
            Problem(hessian, np.zeros(rows.shape[1]), matrix, room.copy()), solver=solver, **settings
        )


def _gap(rows: Array, room: Array, z: Array, multipliers: Any) -> float:
    """Duality gap of ``min |z|^2 / 2`` subject to ``rows @ z <= room``, relative to ``1 + |z|^2 / 2``."""
    if multipliers is None or not np.isfinite(multipliers).all():
        return np.inf
    y = np.maximum(np.asarray(multipliers, dtype=np.float64), 0.0)
    primal = 0.5 * float(z @ z)
    return abs(primal + 0.5 * float(np.sum((rows.T @ y) ** 2)) + float(room @ y)) / (1.0 + primal)


def _word(solution: Any) -> str:
    """The solver's own status word, as far as qpsolvers passes it on."""
    extras = solution.extras or {}
    info = extras.get("info")
    word = (
        getattr(info, "status", None)
        or extras.get("status")
        or ("solved" if solution.found else "no solution")
    )
    return str(word).lower()


def infeasibility(rows: Array, limit: Array) -> float:
    """Smallest possible violation of ``rows @ z <= limit`` (rows of unit norm); 0 if z exists."""
    from scipy.optimize import linprog

    m = rows.shape[1]
    answer = linprog(
        np.append(np.zeros(m), 1.0),
        A_ub=np.column_stack([rows, -np.ones(len(rows))]),
        b_ub=limit,
        bounds=[(None, None)] * m + [(0.0, None)],
        method="highs",
    )
    return float(answer.x[-1]) if answer.success else np.inf


def braking_problem(gap: float) -> tuple[Array, Array, Array]:
    """A small problem of known answer: from 10 m/s, quintic pieces, at -4 m/s² at most, within ``gap`` [m].

    Returns
    -------
    origin, rows, limit
        See :func:`solve_projection`.
    """
    pieces, degree = 6, 5
    structure = qp_structure(pieces, degree, 0.5, 2, 1.0, 0.1)
    start = structure.lift @ np.array([0.0, 10.0, 0.0])
    reference = structure.weights * 10.0 * structure.nodes
    origin = -structure.basis.T @ (structure.hessian @ start - 0.2 * structure.at_nodes.T @ reference)
    upper = (np.full(len(structure.times), gap), np.full(pieces * 5, 15.0), np.full(pieces * 4, 2.0))
    lower = (np.full(len(structure.times), -1.0), np.zeros(pieces * 5), np.full(pieces * 4, -4.0))
    rows, limit = [], []
    for k in range(3):
        at_start = structure.derivatives[k] @ start
        rows += [structure.reach[k], -structure.reach[k]]
        limit += [upper[k] - at_start, at_start - lower[k]]
    stacked, bounds = np.vstack(rows), np.concatenate(limit)
    norm = np.linalg.norm(stacked, axis=1)
    keep = norm > 1e-9
    return origin, stacked[keep] / norm[keep, None], bounds[keep] / norm[keep]


# Gap [m] -> optimal value, None where there is no solution (the shortest stop takes 13.75 m: daqp, clarabel
# and a linear program agree to all digits given here).
_KNOWN: dict[float, float | None] = {13.0: None, 13.7: None, 13.85: 88.7392, 14.75: 52.4394}


@lru_cache(maxsize=32)
def _objection(solver: str) -> str | None:
    """Why a solver cannot be trusted, from problems of known answer; None if it can."""
    for gap, optimum in _KNOWN.items():
        origin, rows, limit = braking_problem(gap)
        answer = solve_projection(origin, rows, limit, solver)
        if optimum is None:
            if answer.status is not SolveStatus.INFEASIBLE:
                return (
                    f"a braking problem without solution it calls {answer.status.value!r} ({answer.detail})"
                )
            continue
        if answer.z is None:
            return f"a braking problem with a solution it calls {answer.status.value!r} ({answer.detail})"
        value = 0.5 * float(np.sum((answer.z - origin) ** 2))
        if abs(value - optimum) > 1e-4 * abs(optimum):
            return f"on a braking problem it stops at the value {value:.6g}, the optimum is {optimum:.6g}"
    return None


def require_solver(solver: str) -> None:
    """Refuse a solver that is not there or that does not give the known answers.

    Raises
    ------
    BackendError
        Naming the solver, the reason, and the solvers that there are.
    """
    from qpsolvers import available_solvers

    if solver not in available_solvers:
        known = ", ".join(sorted(available_solvers)) or "none"
        raise BackendError(f"qptr.solver is {solver!r}, which qpsolvers does not find here; it finds {known}")
    objection = _objection(solver)
    if objection is not None:
        raise BackendError(f"qptr.solver {solver!r} is refused: {objection}")
