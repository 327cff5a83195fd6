"""Problems of known answer that a QP solver must get right before it is believed."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from repair.arrays import Array
from repair.backend.base import SolveStatus
from repair.baselines.qptr.qp import solve_projection
from repair.baselines.qptr.qp_solvers import SolverCall, call_solver
from repair.baselines.qptr.structure import qp_structure
from repair.errors import BackendError

__all__ = ["braking_problem", "objection", "require_solver"]


def braking_problem(gap: float) -> tuple[Array, Array, Array]:
    """A small problem of known answer: from 10 m/s, quintic pieces, at -4 m/s² at most, within ``gap`` [m].

    Returns
    -------
    rows, lower, upper
        See :func:`repair.baselines.qptr.qp.solve_projection`; the origin is the optimum without constraints.
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
def objection(solver: str, call: SolverCall = call_solver) -> str | None:
    """Why a solver, called in this way, cannot be trusted, from problems of known answer; None if it can."""
    for gap, optimum in _KNOWN.items():
        answer = solve_projection(*braking_problem(gap), solver, call=call)
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


def require_solver(solver: str, call: SolverCall = call_solver) -> None:
    """Refuse a solver that is not there or that does not give the known answers.

    Parameters
    ----------
    solver : str
        Any name that qpsolvers knows here.
    call : SolverCall
        How it is called.

    Raises
    ------
    BackendError
        Naming the solver, the reason, and the solvers that there are.
    """
    from qpsolvers import available_solvers

    if solver not in available_solvers:
        known = ", ".join(sorted(available_solvers)) or "none"
        raise BackendError(f"qptr.solver is {solver!r}, which qpsolvers does not find here; it finds {known}")
    why = objection(solver, call)
    if why is not None:
        raise BackendError(f"qptr.solver {solver!r} is refused: {why}")
