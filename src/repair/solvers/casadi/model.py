"""The CasADi functions of the hard NLP, built once for each structure and parametric in all else.

Everything that is linear in the control points (derivative limits, obstacles, room, direction of
travel) is a constant matrix with bounds that change from problem to problem
(:mod:`repair.solvers.casadi.rows`); only the accelerations and the curvature of the driven path, and
where the ends of the body are, are nonlinear. A :class:`Model` therefore depends on sizes and settings
alone and is kept for the life of the process.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.solvers.casadi.buffered import (
    Buffered,
    Deadline,
    deadline_callback,
    last_line,
    quadratic_program,
    sparse,
    unavailable,
)
from repair.solvers.casadi.rows import Layout, Structure

__all__ = ["SAMPLED", "STANDSTILL", "Model", "Solution", "build_model"]

#: Parameters of every sample of the nonlinear rows: the part of s, s', s'', l, l', l'' that does not
#: depend on the unknowns, and the axis' curvature as a line in s (value, slope).
SAMPLED = 8
# Added to the squared speed [m²/s²] where the path's curvature divides by it.
STANDSTILL = 0.01
_DAQP_INFEASIBLE = -1


@dataclass(frozen=True)
class Solution:
    """What the solver left.

    Attributes
    ----------
    x : (m,) array
        The unknowns.
    word : str
        The solver's return status, or the last line of what it threw.
    iterations : int
    violation : float
        Largest violation of any row.
    """

    x: Array
    word: str
    iterations: int
    violation: float


class Model(Layout):
    """One NLP: its constant matrices, and the functions that solve it.

    The NLP itself is made when it is first solved: many problems end before, with the linear rows.
    ``build_time`` is what has been spent on making functions so far [s].
    """

    def __init__(self, structure: Structure) -> None:
        import casadi as ca

        begin = time.perf_counter()
        super().__init__(structure)
        self._deadline: Deadline | None = None
        self._lock = threading.Lock()  # models are shared, and so are their buffers
        p = structure.degree
        self._hessian = ca.DM(np.kron(np.eye(structure.axes), self.hessian[p:, p:]))
        self._matrix = sparse(self.free)
        try:
            if not ca.has_nlpsol(structure.solver):
                ca.load_nlpsol(structure.solver)  # says why it cannot
            self._qp = quadratic_program("presolve", self._hessian, self._matrix)
            self._compile_elastic()
        except RuntimeError as error:
            raise unavailable(error) from error
        self.build_time = time.perf_counter() - begin

    @cached_property
    def _function(self) -> Buffered:
        begin = time.perf_counter()
        try:
            return Buffered(self._compile())
        except RuntimeError as error:
            raise unavailable(error) from error
        finally:
            self.build_time += time.perf_counter() - begin

    def _compile(self) -> Any:
        import casadi as ca

        s, p = self.structure, self.structure.degree
        m = s.n - p
        x = ca.SX.sym("x", m * s.axes)
        count = len(self.tau)
        data = ca.SX.sym("data", count, SAMPLED)
        slope = ca.SX.sym("slope", m * s.axes)
        hessian, matrix = self._hessian, self._matrix
        objective = 0.5 * ca.bilin(hessian, x, x) + ca.dot(slope, x)
        axes = [x[k * m : (k + 1) * m] for k in range(s.axes)]
        along, across, rest = self._nonlinear(axes, data)
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
        return self._make_solver(nlp, curvature)

    def _compile_elastic(self) -> None:
        """The QP in which all obstacle rows give way by the same, smallest possible amount."""
        import casadi as ca

        matrix = self.free
        owner = np.repeat([rows.family == "obstacles" for rows in self.linear], [len(k) for k in self.kept])
        self._soft = np.flatnonzero(owner)
        count, m = matrix.shape
        a = np.zeros((count + len(self._soft), m + 1))
        a[:count, :m] = matrix
        a[count:, :m] = matrix[self._soft]
        a[self._soft, m], a[count:, m] = 1.0, -1.0
        h = 1e-4 * np.eye(m + 1)
        h[:m, :m] += 1e-4 * np.kron(
            np.eye(self.structure.axes), self.hessian[self.structure.degree :, self.structure.degree :]
        )
        self._elastic_qp = quadratic_program("elastic", ca.DM(h), sparse(a))
        self._elastic_low = np.full(m + 1, -np.inf)
        self._elastic_low[m] = 0.0

    def elastic(self, slope: Array, low: Array, high: Array) -> tuple[Array, float] | None:
        """Unknowns that keep all linear rows but the obstacles', and those as nearly as possible.

        Returns
        -------
        x : (m,) array
        miss : float
            By how much [m] the obstacle rows are missed. None instead of both if even the other rows
            contradict each other.
        """
        rows = self.linear_count
        low, upper = low[:rows], high[:rows].copy()
        upper[self._soft] = np.inf
        if (low > upper).any():
            return None
        lba = np.concatenate((low, np.full(len(self._soft), -np.inf)))
        uba = np.concatenate((upper, high[self._soft]))
        g = np.append(1e-4 * slope, 100.0)
        with self._lock:
            out = self._elastic_qp(g=g, lba=lba, uba=uba, lbx=self._elastic_low)
            if int(self._elastic_qp.stats()["return_status"]) <= 0:
                return None
            return out["x"][:-1].copy(), float(out["x"][-1])

    def _nonlinear(self, axes: list[Any], data: Any) -> tuple[Any, Any, list[Any]]:
        """Accelerations, curvature of the driven path, ends of the body at the samples.

        With c = 1 - kappa l the velocity in the axis' tangent and normal is (c s', l'), and the
        acceleration (c s'' - 2 kappa s' l' - kappa' l s'^2, l'' + c kappa s'^2). The ends of a straight
        body of half length d lie at l - kappa d^2 / 2 +- d sin(heading).
        """
        import casadi as ca

        p = self.structure.degree
        free = [sparse(b[:, p:]) for b in self.samples]
        s, v, a = (ca.mtimes(free[k], axes[0]) + data[:, k] for k in range(3))
        if self.structure.lateral:
            l, w, b = (ca.mtimes(free[k], axes[1]) + data[:, 3 + k] for k in range(3))  # noqa: E741
        else:
            l, w, b = data[:, 3], data[:, 4], data[:, 5]  # noqa: E741
        slope = data[:, 7]
        kappa = data[:, 6] + slope * s
        scale = 1.0 - kappa * l
        along = scale * a - 2.0 * kappa * v * w - slope * l * v**2
        across = b + scale * kappa * v**2
        rest = []
        if self.structure.lateral:
            forward = scale * v
            square = forward**2 + w**2 + STANDSTILL
            middle = l - 0.5 * self.structure.overhang**2 * kappa
            swing = self.structure.overhang * w / square**0.5
            rest = [along, (forward * across - w * along) / square**1.5, middle + swing, middle - swing]
        return along, across, rest

    def _make_solver(self, nlp: dict[str, Any], curvature: Any) -> Any:
        import casadi as ca

        s = self.structure
        options: dict[str, Any] = {"print_time": False, "show_eval_warnings": False, "error_on_fail": False}
        if s.timed:
            self._deadline = deadline_callback(nlp)
            options["iteration_callback"] = self._deadline.callback
        if s.solver == "ipopt":
            options["ipopt"] = {
                "print_level": 0, "sb": "yes", "max_iter": s.max_iterations, "tol": s.tolerance,
                "constr_viol_tol": 1e-8, "bound_relax_factor": 0.0, "mu_strategy": "adaptive",
            }  # fmt: skip
        else:
            options |= {
                "print_header": False, "print_iteration": False, "print_status": False,
                "max_iter": s.max_iterations, "tol_pr": 1e-8, "tol_du": max(s.tolerance, 1e-6),
                "qpsol": "daqp", "qpsol_options": {"error_on_fail": False},
                "hessian_approximation": "exact", "hess_lag": curvature,
            }  # fmt: skip
        return ca.nlpsol("repair", s.solver, nlp, options)

    def presolve(self, x0: Array, slope: Array, low: Array, high: Array) -> tuple[Array | None, bool]:
        """The convex QP of the objective and the linear rows alone.

        Returns
        -------
        x : array or None
            Its solution, where daqp has found one.
        possible : bool
            False if daqp has proven that the linear rows contradict each other: then so does the NLP.
        """
        rows = self.linear_count
        if (low[:rows] > high[:rows]).any():
            return None, False  # CasADi calls this an error
        with self._lock:
            out = self._qp(g=slope, lba=low[:rows], uba=high[:rows], x0=x0)
            word = int(self._qp.stats()["return_status"])
            if word > 0:
                return out["x"].copy(), True
        return None, word != _DAQP_INFEASIBLE

    def solve(
        self, x0: Array, data: Array, slope: Array, low: Array, high: Array, deadline: float | None
    ) -> Solution:
        """Run the solver.

        Parameters
        ----------
        x0 : (m,) array
            Initial guess of the unknowns.
        data : (8, S) array
            See :data:`SAMPLED`.
        slope : (m,) array
            Linear part of the objective.
        low, high : (R,) array
            Bounds of all rows: the linear ones, then the nonlinear ones.
        deadline : float or None
            ``time.perf_counter()`` at which to stop; needs ``timed``.

        Raises
        ------
        BackendError
            If CasADi cannot make the solver.
        """
        with self._lock:
            function = self._function
            if self._deadline is not None:
                self._deadline.at = deadline if deadline is not None else float("inf")
            try:
                out = function(x0=x0, p=np.concatenate((data.ravel(), slope)), lbg=low, ubg=high)
            except RuntimeError as error:
                return Solution(x0, last_line(error), 0, np.inf)
            x, g = out["x"].copy(), out["g"]
            violation = float(np.maximum(low - g, g - high).max(initial=0.0))
            try:
                stats = function.stats()
            except RuntimeError:  # sqpmethod has no word for a QP that fails
                return Solution(x, "QP_Failed", 0, violation)
        return Solution(x, str(stats["return_status"]), int(stats.get("iter_count", 0)), violation)


@lru_cache(maxsize=256)
def build_model(structure: Structure) -> Model:
    """The model of a structure; made at the first call, kept after that."""
    return Model(structure)
