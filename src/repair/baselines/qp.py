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
import warnings
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.baselines.bernstein import qp_structure
from repair.errors import BackendError
from repair.types import Array, SolveStatus

__all__ = ["QpAnswer", "braking_problem", "require_solver", "solve_projection"]

#: Largest violation of a constraint (rows of unit norm) in a solution that counts as one.
FEASIBLE = 1e-5
#: Largest relative duality gap of a solution.
OPTIMAL = 1e-4
# A proof that there is no solution counts for |z| up to here; |z|^2 / 2 is the objective.
_FAR = 1e4
# Price of |z|^2 in the search for such a proof, against that of the violation squared.
_SOFT = 1e-8

# Tolerances well below what the checker can see; the defaults of the first-order methods are not.
_SETTINGS: dict[str, dict[str, Any]] = {
    "osqp": {
        "eps_prim_inf": 1e-7,
        "max_iter": 50_000,
        "polishing": True,
        "scaling": 0,  # the rows have unit norm and the Hessian is the identity already
        "verbose": False,
    },
    "clarabel": {"tol_feas": 1e-9, "tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9},
    "daqp": {"primal_tol": 1e-8, "dual_tol": 1e-10},
}
_OSQP_TOLERANCES = tuple({"eps_abs": e, "eps_rel": 0.01 * e} for e in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6))
#: Violation and relative gap of an answer that further iterations cannot better.
_EXACT = 1e-8
_TIMED = ("osqp", "clarabel", "daqp")
_SPARSE = ("clarabel", "qpalm", "highs", "piqp", "ecos", "scs", "hpipm")
_DAQP_WORDS = {
    1: "solved",
    -1: "infeasible",
    -2: "cycling",
    -3: "unbounded",
    -4: "maximum iterations reached",
    -5: "nonconvex",
    -6: "overdetermined",
    -7: "time limit reached",
}


class QpAnswer(NamedTuple):
    """Status, the point (None without one), its largest violation, and the particulars."""

    status: SolveStatus
    z: Array | None
    violation: float
    detail: str


class _Raw(NamedTuple):
    """What a solver says: point, multipliers (positive at an upper bound), and its own status word."""

    z: Array | None
    multipliers: Array | None
    word: str


def solve_projection(
    rows: Array, lower: Array, upper: Array, solver: str, time_limit: float | None = None
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
    """
    if time_limit is not None and time_limit <= 0.0:
        return QpAnswer(SolveStatus.TIME_LIMIT, None, np.inf, "no time left")
    if np.count_nonzero(upper >= 0.0) == len(upper) and np.count_nonzero(lower <= 0.0) == len(lower):
        return QpAnswer(SolveStatus.SOLVED, np.zeros(rows.shape[1]), 0.0, "no constraint is active")
    begin = time.perf_counter()
    # daqp reads on from the first number, whatever the strides are.
    rows, lower, upper = np.ascontiguousarray(rows), np.ascontiguousarray(lower), np.ascontiguousarray(upper)
    try:
        raw = _call(rows, lower, upper, solver, time_limit)
    except Exception as error:  # the solvers' own exceptions have no common base
        return QpAnswer(
            SolveStatus.NUMERICAL_ERROR, None, np.inf, f"{solver}: {type(error).__name__}: {error}"
        )
    violation = np.inf
    if raw.z is not None:
        violation = _violation(rows, lower, upper, raw.z)
        # NaN fails both comparisons.
        if violation <= FEASIBLE and _gap(rows, lower, upper, raw) <= OPTIMAL:
            return QpAnswer(SolveStatus.SOLVED, raw.z, violation, f"{solver}: {raw.word}")
    if time_limit is not None and time.perf_counter() - begin >= 0.99 * time_limit:
        return QpAnswer(SolveStatus.TIME_LIMIT, None, violation, f"{solver}: time limit of {time_limit:g} s")
    least = _proven_violation(rows, lower, upper)
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


def _call(rows: Array, lower: Array, upper: Array, solver: str, time_limit: float | None) -> _Raw:
    """``min |z|^2 / 2`` subject to ``lower <= rows @ z <= upper``, as the solver answers it."""
    settings = dict(_SETTINGS.get(solver, {}))
    if time_limit is not None and solver in _TIMED:
        settings["time_limit"] = time_limit
    if solver == "daqp":
        return _daqp(rows, lower, upper, settings)
    if solver == "osqp":
        return _osqp(rows, lower, upper, settings)
    return _qpsolvers(rows, lower, upper, solver, settings)


@lru_cache(maxsize=128)
def _frame(m: int, r: int, kind: int = 0) -> tuple[Array, Array, npt.NDArray[np.intc]]:
    """Hessian, linear term and kinds of the constraints (0: hard, 8: soft), for daqp."""
    return np.eye(m), np.zeros(m), np.full(r, kind, dtype=np.intc)


def _daqp(rows: Array, lower: Array, upper: Array, settings: dict[str, Any]) -> _Raw:
    import daqp

    hessian, linear, kinds = _frame(rows.shape[1], len(rows))
    z, _, flag, info = daqp.solve(hessian, linear, rows, upper, lower, kinds, **settings)
    return _Raw(z if flag > 0 else None, info["lam"], _DAQP_WORDS.get(flag, f"exit flag {flag}"))


def _osqp(rows: Array, lower: Array, upper: Array, settings: dict[str, Any]) -> _Raw:
    """OSQP, with tolerances that tighten until its polishing has the right constraints active.

    From then on the answer is exact and further iterations gain nothing; that is often long before
    the iterates themselves are close. A new solver each time: the answer depends on nothing else.
    """
    import osqp
    from scipy.sparse import csc_matrix, eye

    begin = time.perf_counter()
    m = rows.shape[1]
    solver = osqp.OSQP()
    first, *others = _OSQP_TOLERANCES
    solver.setup(eye(m, format="csc"), np.zeros(m), csc_matrix(rows), lower, upper, **{**settings, **first})
    answer = solver.solve(raise_error=False)
    for tighter in others:
        word = str(answer.info.status).lower()
        raw = _Raw(answer.x, answer.y, word)
        if word != "solved" or (
            _violation(rows, lower, upper, answer.x) <= _EXACT and _gap(rows, lower, upper, raw) <= _EXACT
        ):
            return raw
        if "time_limit" in settings:
            tighter = {**tighter, "time_limit": settings["time_limit"] - (time.perf_counter() - begin)}
            if tighter["time_limit"] <= 0.0:
                return raw
        solver.update_settings(**tighter)
        answer = solver.solve(raise_error=False)
    return _Raw(answer.x, answer.y, str(answer.info.status).lower())


def _qpsolvers(rows: Array, lower: Array, upper: Array, solver: str, settings: dict[str, Any]) -> _Raw:
    from qpsolvers import Problem, solve_problem
    from scipy.sparse import csc_matrix

    above, below = np.isfinite(upper), np.isfinite(lower)
    matrix = np.vstack([rows[above], -rows[below]])
    limit = np.concatenate([upper[above], -lower[below]])
    hessian = np.eye(rows.shape[1])
    if solver in _SPARSE:
        hessian, matrix = csc_matrix(hessian), csc_matrix(matrix)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a failure is told by the status, not by a warning
        solution = solve_problem(
            Problem(hessian, np.zeros(rows.shape[1]), matrix, limit), solver=solver, **settings
        )
    word = _word(solution)
    if solution.x is None or solution.z is None:
        return _Raw(None, None, word)
    multipliers = np.zeros(len(rows))
    multipliers[above] += solution.z[: above.sum()]
    multipliers[below] -= solution.z[above.sum() :]
    return _Raw(np.asarray(solution.x, dtype=np.float64), multipliers, word)


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


def _violation(rows: Array, lower: Array, upper: Array, z: Array) -> float:
    """Largest violation of a bound; NaN stays NaN."""
    value = rows @ z
    return float(np.maximum.reduce(np.concatenate((value - upper, lower - value)), initial=0.0))


def _combined(rows: Array, lower: Array, upper: Array, y: Array) -> tuple[Array, float]:
    """``rows.T @ y`` and the largest value that the bounds allow for ``y @ (rows @ z)``."""
    used = y.nonzero()[0]
    y = y.take(used)
    allowed = np.where(y > 0.0, upper.take(used), lower.take(used))
    return y @ rows.take(used, axis=0), float(y @ allowed)


def _gap(rows: Array, lower: Array, upper: Array, raw: _Raw) -> float:
    """Duality gap of a point and its multipliers, relative to ``1 + |z|^2 / 2``."""
    if raw.z is None or raw.multipliers is None:
        return np.inf
    gradient, allowed = _combined(rows, lower, upper, raw.multipliers)
    primal = 0.5 * float(raw.z @ raw.z)
    return abs(primal + 0.5 * float(gradient @ gradient) + allowed) / (1.0 + primal)


def _proven_violation(rows: Array, lower: Array, upper: Array) -> float:
    """A violation that no z with ``|z| <= _FAR`` can avoid, 0 where none is proved.

    A z within e of all bounds has ``y @ rows @ z <= allowed + e |y|_1`` for any y; where ``rows.T @ y``
    is zero and what the bounds allow is negative, e cannot be zero (Farkas' lemma). Good multipliers y
    are those of the least squares violation: daqp with soft rows, next to no price on z.
    """
    import daqp

    hessian, linear, kinds = _frame(rows.shape[1], len(rows), 8)
    _, _, flag, info = daqp.solve(hessian, linear, rows, upper, lower, kinds, rho_soft=_SOFT)
    y = info["lam"]
    total = float(np.add.reduce(np.abs(y)))
    if flag <= 0 or not 0.0 < total < np.inf:  # NaN is neither
        return 0.0
    combination, allowed = _combined(rows, lower, upper, y)
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


def braking_problem(gap: float) -> tuple[Array, Array, Array]:
    """A small problem of known answer: from 10 m/s, quintic pieces, at -4 m/s² at most, within ``gap`` [m].

    Returns
    -------
    rows, lower, upper
        See :func:`solve_projection`; the origin is the optimum without constraints.
    """
    pieces, degree = 6, 5
    structure = qp_structure(pieces, degree, 0.5, 2, 1.0, 0.1)
    start = structure.lift @ np.array([0.0, 10.0, 0.0])
    reference = structure.weights * 10.0 * structure.nodes
    origin = -structure.basis.T @ (structure.hessian @ start - 0.2 * structure.at_nodes.T @ reference)
    upper = (np.full(len(structure.times), gap), np.full(pieces * 5, 15.0), np.full(pieces * 4, 2.0))
    lower = (np.full(len(structure.times), -1.0), np.zeros(pieces * 5), np.full(pieces * 4, -4.0))
    rows = np.vstack(structure.reach[:3])
    at_origin = np.vstack(structure.derivatives[:3]) @ start + rows @ origin
    norm = np.linalg.norm(rows, axis=1)
    keep = norm > 1e-9
    rows, norm, at_origin = rows[keep] / norm[keep, None], norm[keep], at_origin[keep]
    return (
        rows,
        (np.concatenate(lower)[keep] - at_origin) / norm,
        (np.concatenate(upper)[keep] - at_origin) / norm,
    )


# Gap [m] -> optimal value, None where there is no solution (the shortest stop takes 13.75 m: daqp, clarabel
# and a linear program agree to all digits given here).
_KNOWN: dict[float, float | None] = {13.0: None, 13.7: None, 13.85: 88.7392, 14.75: 52.4394}


@lru_cache(maxsize=32)
def _objection(solver: str) -> str | None:
    """Why a solver cannot be trusted, from problems of known answer; None if it can."""
    for gap, optimum in _KNOWN.items():
        answer = solve_projection(*braking_problem(gap), solver)
        if optimum is None:
            if answer.status is not SolveStatus.INFEASIBLE:
                return (
                    f"a braking problem without solution it calls {answer.status.value!r} ({answer.detail})"
                )
            continue
        if answer.z is None:
            return f"a braking problem with a solution it calls {answer.status.value!r} ({answer.detail})"
        value = 0.5 * float(answer.z @ answer.z)
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
