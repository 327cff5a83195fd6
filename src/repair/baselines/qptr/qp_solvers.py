"""The QP solvers, each in its own words: daqp and OSQP directly, all others through qpsolvers."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.baselines.qptr.qp_residuals import RawAnswer, duality_gap, violation_of

__all__ = ["OSQP_TOLERANCES", "SETTINGS", "SolverCall", "call_solver", "daqp_frame", "osqp_answer"]

#: ``rows, lower, upper, solver, time_limit`` to what the solver says of ``min |z|^2 / 2`` between the bounds.
SolverCall = Callable[[Array, Array, Array, str, float | None], RawAnswer]

#: By solver. Tolerances well below what the checker can see; the defaults of the first-order methods are not.
SETTINGS: dict[str, dict[str, Any]] = {
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
#: Those of OSQP, one after the other.
OSQP_TOLERANCES = tuple({"eps_abs": e, "eps_rel": 0.01 * e} for e in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6))
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


def call_solver(rows: Array, lower: Array, upper: Array, solver: str, time_limit: float | None) -> RawAnswer:
    """``min |z|^2 / 2`` subject to ``lower <= rows @ z <= upper``, as the solver answers it.

    Parameters
    ----------
    rows : (r, m) array
        Of unit norm, C-contiguous.
    lower, upper : (r,) array
        May be infinite.
    solver : str
        Any name that qpsolvers knows here.
    time_limit : float or None
        Wall time [s], for the solvers that take one.
    """
    settings = dict(SETTINGS.get(solver, {}))
    if time_limit is not None and solver in _TIMED:
        settings["time_limit"] = time_limit
    if solver == "daqp":
        return _daqp(rows, lower, upper, settings)
    if solver == "osqp":
        return osqp_answer(rows, lower, upper, settings)
    return _qpsolvers(rows, lower, upper, solver, settings)


@lru_cache(maxsize=128)
def daqp_frame(m: int, r: int, kind: int = 0) -> tuple[Array, Array, npt.NDArray[np.intc]]:
    """Hessian, linear term and kinds of the constraints (0: hard, 8: soft), for daqp."""
    return np.eye(m), np.zeros(m), np.full(r, kind, dtype=np.intc)


def _daqp(rows: Array, lower: Array, upper: Array, settings: dict[str, Any]) -> RawAnswer:
    import daqp

    hessian, linear, kinds = daqp_frame(rows.shape[1], len(rows))
    z, _, flag, info = daqp.solve(hessian, linear, rows, upper, lower, kinds, **settings)
    return RawAnswer(z if flag > 0 else None, info["lam"], _DAQP_WORDS.get(flag, f"exit flag {flag}"))


def osqp_answer(
    rows: Array,
    lower: Array,
    upper: Array,
    settings: Mapping[str, Any],
    tolerances: Sequence[Mapping[str, float]] = OSQP_TOLERANCES,
) -> RawAnswer:
    """OSQP, with tolerances that tighten until its polishing has the right constraints active.

    From then on the answer is exact and further iterations gain nothing; that is often long before
    the iterates themselves are close. A new solver each time: the answer depends on nothing else.

    Parameters
    ----------
    rows, lower, upper
        See :func:`call_solver`.
    settings : mapping
        OSQP's own, ``time_limit`` among them where there is one.
    tolerances : sequence of mappings
        Settings that replace each other, at least one.
    """
    import osqp
    from scipy.sparse import csc_matrix, eye

    begin = time.perf_counter()
    m = rows.shape[1]
    solver = osqp.OSQP()
    first, *others = tolerances
    solver.setup(eye(m, format="csc"), np.zeros(m), csc_matrix(rows), lower, upper, **{**settings, **first})
    answer = solver.solve(raise_error=False)
    for tighter in others:
        word = str(answer.info.status).lower()
        raw = RawAnswer(answer.x, answer.y, word)
        if word != "solved" or (
            violation_of(rows, lower, upper, answer.x) <= _EXACT
            and duality_gap(rows, lower, upper, raw) <= _EXACT
        ):
            return raw
        if "time_limit" in settings:
            tighter = {**tighter, "time_limit": settings["time_limit"] - (time.perf_counter() - begin)}
            if tighter["time_limit"] <= 0.0:
                return raw
        solver.update_settings(**tighter)
        answer = solver.solve(raise_error=False)
    return RawAnswer(answer.x, answer.y, str(answer.info.status).lower())


def _qpsolvers(rows: Array, lower: Array, upper: Array, solver: str, settings: dict[str, Any]) -> RawAnswer:
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
        return RawAnswer(None, None, word)
    multipliers = np.zeros(len(rows))
    multipliers[above] += solution.z[: above.sum()]
    multipliers[below] -= solution.z[above.sum() :]
    return RawAnswer(np.asarray(solution.x, dtype=np.float64), multipliers, word)


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
