"""The NLP in CasADi's symbols: its nonlinear rows, its exact or positive definite Hessian, its solver.

Everything that is linear in the control points is a constant matrix
(:mod:`repair.solvers.casadi.rows`); only the accelerations and the curvature of the driven path, and
where the ends of the body are, are nonlinear. The same with NumPy stands below.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import Array
from repair.problem.problem import RepairProblem
from repair.solvers.casadi.buffered import Deadline, deadline_callback, sparse
from repair.solvers.casadi.rows import SAMPLED, Datum, Layout, Structure

__all__ = ["axis_curvature", "body", "in_plane", "make_nlp", "plane_acceleration"]

_STANDSTILL = 0.01  # added to the squared speed [m²/s²] where the path's curvature divides by it
_STEP = 0.25  # [m] of s either way for the slope of the axis' curvature
_AROUND = np.array([[0.0], [_STEP], [-_STEP]])


def make_nlp(layout: Layout, hessian: Any, matrix: Any) -> tuple[Any, Deadline | None]:
    """The function that solves the NLP of a layout.

    Parameters
    ----------
    layout : Layout
    hessian, matrix : casadi.DM
        Of the objective, and the linear rows, over the unknowns.

    Returns
    -------
    casadi.Function
        Parameters are the samples' data, row by row (:class:`repair.solvers.casadi.rows.Datum`), and the
        linear part of the objective.
    Deadline or None
        The watch over it, if it is timed.

    Raises
    ------
    RuntimeError
        Of CasADi, where it cannot make the solver.
    """
    import casadi as ca

    s, p = layout.structure, layout.structure.degree
    m = s.n - p
    x = ca.SX.sym("x", m * s.axes)
    count = len(layout.tau)
    data = ca.SX.sym("data", count, SAMPLED)
    slope = ca.SX.sym("slope", m * s.axes)
    objective = 0.5 * ca.bilin(hessian, x, x) + ca.dot(slope, x)
    axes = [x[k * m : (k + 1) * m] for k in range(s.axes)]
    along, across, rest = _nonlinear(layout, axes, data)
    g = ca.vertcat(ca.mtimes(matrix, x), along**2 + across**2, across, *rest)
    nlp = {"x": x, "p": ca.vertcat(ca.vec(data), slope), "f": objective, "g": g}
    curvature = None
    if s.solver != "ipopt":
        # The objective's own Hessian and the friction circles' J'J, positive definite always.
        factor, multiplier = ca.SX.sym("factor"), ca.SX.sym("multiplier", g.numel())
        circle = ca.fmax(multiplier[matrix.shape[0] : matrix.shape[0] + count], 0.0)
        bent = factor * hessian
        for part in (along, across):
            slope_of = ca.jacobian(part, x)
            bent += 2.0 * ca.mtimes(slope_of.T, ca.repmat(circle, 1, x.numel()) * slope_of)
        names = ["x", "p", "lam_f", "lam_g"]
        curvature = ca.Function("curvature", [x, nlp["p"], factor, multiplier], [bent], names, ["hess"])
    return _solver(s, nlp, curvature)


def _nonlinear(layout: Layout, axes: list[Any], data: Any) -> tuple[Any, Any, list[Any]]:
    """Accelerations, curvature of the driven path, ends of the body at the samples.

    With c = 1 - kappa l the velocity in the axis' tangent and normal is (c s', l'), and the
    acceleration (c s'' - 2 kappa s' l' - kappa' l s'^2, l'' + c kappa s'^2). The ends of a straight
    body of half length d lie at l - kappa d^2 / 2 +- d sin(heading).
    """
    import casadi as ca

    p = layout.structure.degree
    free = [sparse(b[:, p:]) for b in layout.samples]
    s, v, a = (ca.mtimes(free[k], axes[0]) + data[:, Datum.S + k] for k in range(3))
    if layout.structure.lateral:
        l, w, b = (ca.mtimes(free[k], axes[1]) + data[:, Datum.L + k] for k in range(3))  # noqa: E741
    else:
        l, w, b = (data[:, Datum.L + k] for k in range(3))  # noqa: E741
    slope = data[:, Datum.BEND_SLOPE]
    kappa = data[:, Datum.BEND] + slope * s
    scale = 1.0 - kappa * l
    along = scale * a - 2.0 * kappa * v * w - slope * l * v**2
    across = b + scale * kappa * v**2
    rest = []
    if layout.structure.lateral:
        forward = scale * v
        square = forward**2 + w**2 + _STANDSTILL
        middle = l - 0.5 * layout.structure.overhang**2 * kappa
        swing = layout.structure.overhang * w / square**0.5
        rest = [along, (forward * across - w * along) / square**1.5, middle + swing, middle - swing]
    return along, across, rest


def _solver(s: Structure, nlp: dict[str, Any], curvature: Any) -> tuple[Any, Deadline | None]:
    """The function, and the watch over it."""
    import casadi as ca

    watch: Deadline | None = None
    options: dict[str, Any] = {"print_time": False, "show_eval_warnings": False, "error_on_fail": False}
    if s.timed:
        watch = deadline_callback(nlp)
        options["iteration_callback"] = watch.callback
    if s.solver == "ipopt":
        options["ipopt"] = {
            "print_level": 0, "sb": "yes", "max_iter": s.max_iterations, "tol": s.tolerance,
            "constr_viol_tol": 1e-8, "bound_relax_factor": 0.0, "mu_strategy": "adaptive",
            # What has no solution is found to have none in a third of the iterations; nothing else changes.
            # The rows are all of a size: to permute and scale them takes up to half of an iteration.
            "expect_infeasible_problem": "yes", "mumps_permuting_scaling": 0,
        }  # fmt: skip
    else:
        options |= {
            "print_header": False, "print_iteration": False, "print_status": False,
            "max_iter": s.max_iterations, "tol_pr": 1e-8, "tol_du": max(s.tolerance, 1e-6),
            "qpsol": "daqp", "qpsol_options": {"error_on_fail": False},
            "hessian_approximation": "exact", "hess_lag": curvature,
        }  # fmt: skip
    return ca.nlpsol("repair", s.solver, nlp, options), watch


def axis_curvature(problem: RepairProblem, s: Array) -> tuple[Array, Array]:
    """Curvature of the axis and its slope over s (K,)."""
    kappa, ahead, behind = problem.curvature_at(s + _AROUND)
    return kappa, (ahead - behind) / (2.0 * _STEP)


def plane_acceleration(problem: RepairProblem, states: Array) -> tuple[Array, Array]:
    """Acceleration along and across the axis (K,) of states (K, 3, 2)."""
    return in_plane(*axis_curvature(problem, states[:, 0, 0]), states.swapaxes(0, 1))


def in_plane(kappa: Array, slope: Array, states: Array) -> tuple[Array, Array]:
    """Acceleration along and across the axis (K,) of states (3, K, 2) where its curvature is known."""
    l, (v, w), (a, b) = states[0, :, 1], states[1].T, states[2].T  # noqa: E741
    scale, square = 1.0 - kappa * l, v**2
    return scale * a - 2.0 * kappa * v * w - slope * l * square, b + scale * kappa * square


def body(
    kappa: Array, states: Array, along: Array, across: Array, overhang: float
) -> tuple[Array, Array, Array]:
    """Curvature of the driven path, and l of the body's front and back (K,), of states (3, K, 2).

    Parameters
    ----------
    kappa, along, across : (K,) array
        Curvature of the axis, and the accelerations of :func:`in_plane`.
    overhang : float
        Half the length of the body [m].
    """
    l, (v, w) = states[0, :, 1], states[1].T  # noqa: E741
    forward = (1.0 - kappa * l) * v
    square = forward**2 + w**2 + _STANDSTILL
    speed = np.sqrt(square)
    middle, swing = l - 0.5 * overhang**2 * kappa, overhang * w / speed
    return (forward * across - w * along) / (square * speed), middle + swing, middle - swing
