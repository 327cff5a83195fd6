"""The CasADi functions of the hard NLP, built once for each structure and parametric in all else.

Everything that is linear in the control points (derivative limits, obstacles, room, direction of
travel) is a constant matrix with bounds that change from problem to problem
(:mod:`repair.solvers.casadi.rows`); what is not is :mod:`repair.solvers.casadi.nlp`. A :class:`Model`
therefore depends on sizes and settings alone and is kept, as many as there is room for.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repair.arrays import Array
from repair.backend.base import SolveStatus
from repair.deadline import Estimate, held, in_time
from repair.solvers.casadi.buffered import (
    Buffered,
    Deadline,
    KeptBySize,
    last_line,
    quadratic_program,
    sparse,
    unavailable,
)
from repair.solvers.casadi.nlp import make_nlp
from repair.solvers.casadi.rows import Layout, RowKind, Structure

__all__ = ["TOLERANCE", "Model", "Solution", "build_model", "megabytes", "status_of"]

TOLERANCE = 1e-6  #: largest violation of a curve that is called solved
_DAQP_INFEASIBLE = -1
_KEPT, _IDLE = 54.0, 27.0  # of models, their NLPs included, and of those not asked for lately as well [MB]
# What making a model takes [s], by entry of its matrix, and an NLP, by sample; CasADi cannot be interrupted.
# Before any was made they are those of a slow machine.
_LAID_OUT = Estimate(5e-7)
_MADE = {
    (solver, lateral): Estimate(rate)
    for solver, lateral, rate in (
        ("ipopt", True, 3e-3), ("ipopt", False, 1.5e-3),
        ("sqpmethod", True, 2e-3), ("sqpmethod", False, 1e-3),
    )
}  # fmt: skip
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
        in_time(_LAID_OUT.of(structure.entries), "the model")
        begin = time.perf_counter()
        with _LAID_OUT.watch(structure.entries):
            self._lay_out(structure)
        self.build_time = time.perf_counter() - begin

    def _lay_out(self, structure: Structure) -> None:
        import casadi as ca

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

    @cached_property
    def nlp(self) -> Buffered:
        """The function that solves the NLP, made when it is first asked for.

        Raises
        ------
        BackendError
            If CasADi cannot make it.
        OutOfTime
            If making it takes longer than there is time.
        """
        s = self.structure
        estimate = _MADE[s.solver, s.lateral]
        in_time(estimate.of(s.points), "making the NLP")
        begin = time.perf_counter()
        try:
            with estimate.watch(s.points):
                function, self._deadline = make_nlp(self, self._hessian, self._matrix)
                return Buffered(function)
        except RuntimeError as error:
            raise unavailable(error) from error
        finally:
            self.build_time += time.perf_counter() - begin

    @property
    def compiled(self) -> bool:
        """Whether the NLP has been made."""
        return "nlp" in vars(self)

    def _compile_elastic(self) -> None:
        """The QP in which all obstacle rows give way by the same, smallest possible amount."""
        import casadi as ca

        matrix = self.free
        owner = np.repeat([rows.kind == RowKind.PLACE for rows in self.linear], [len(k) for k in self.kept])
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

        Parameters
        ----------
        slope : (m,) array
            Linear part of the objective.
        low, high : (R,) array
            Bounds of all rows; those of the nonlinear ones are left aside.

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
        with held(self._lock):
            out = self._elastic_qp(g=g, lba=lba, uba=uba, lbx=self._elastic_low)
            if int(self._elastic_qp.stats()["return_status"]) <= 0:
                return None
            return out["x"][:-1].copy(), float(out["x"][-1])

    def presolve(self, x0: Array, slope: Array, low: Array, high: Array) -> tuple[Array | None, bool]:
        """The convex QP of the objective and the linear rows alone.

        Parameters
        ----------
        x0 : (m,) array
            Initial guess of the unknowns.
        slope : (m,) array
            Linear part of the objective.
        low, high : (R,) array
            Bounds of all rows; those of the nonlinear ones are left aside.

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
        with held(self._lock):
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
            See :class:`repair.solvers.casadi.rows.Datum`.
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
        OutOfTime
            If making it takes longer than there is time, or another thread uses it for longer.
        """
        with held(self._lock):
            function = self.nlp
            in_time()
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


def megabytes(structure: Structure) -> float:
    """About how much memory a model takes, its NLP included [MB] (measured, within a third)."""
    return 4e-5 * structure.entries + (0.17 if structure.lateral else 0.065) * structure.points


#: The model of a structure, made at the first call and kept; :class:`repair.deadline.OutOfTime` if making it
#: takes longer than there is time.
build_model: KeptBySize[Structure, Model] = KeptBySize(Model, megabytes, _KEPT, _IDLE)


def status_of(model: Model, solution: Solution) -> SolveStatus:
    """What a solver's word means. An SQP's word alone proves nothing: what it left has to keep the rows."""
    if model.structure.solver == "ipopt":
        return _STATUS.get(solution.word, SolveStatus.NUMERICAL_ERROR)
    if not solution.violation <= TOLERANCE:
        timed_out = solution.word == "User_Requested_Stop"
        return SolveStatus.TIME_LIMIT if timed_out else SolveStatus.NUMERICAL_ERROR
    if solution.word == "Search_Direction_Becomes_Too_Small":
        return SolveStatus.SOLVED  # the QP's step is nil: a stationary point
    return _STATUS.get(solution.word, SolveStatus.NUMERICAL_ERROR)
