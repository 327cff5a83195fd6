"""QPTR: a quadratic program of Bernstein pieces in a convex driving corridor (the paper's baseline).

Path and speed are planned together in (s, l, t): the control points stay in the corridor and those
of the derivatives in the limits, so that the whole curve does; jerk and deviation from the reference
are minimised. Acceleration is bounded on each axis of the frame, which is all a QP can express: that
the repaired trajectory also keeps the friction circle, and the lateral acceleration of a curve, is
for the checker to say. Nothing couples the axes, so each is a QP of its own.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

from repair.arrays import Array
from repair.backend.base import Capabilities, Configuration, SolveResult, SolveStatus
from repair.baselines.qptr.axis import FAMILIES, AxisQp, axis_qp
from repair.baselines.qptr.corridor import NoCorridor, build_corridor
from repair.baselines.qptr.qp import solve_projection
from repair.baselines.qptr.qp_trial import require_solver
from repair.baselines.qptr.settings import QptrConfig
from repair.baselines.qptr.time_grid import time_grid
from repair.curves.base import Curve
from repair.curves.bernstein import BernsteinCurve
from repair.deadline import OutOfTime, in_time, until
from repair.errors import BackendError
from repair.problem.lateral import aside_at
from repair.problem.problem import RepairProblem

__all__ = ["QptrBackend", "make"]


class _Axis(NamedTuple):
    """One axis of one problem.

    Attributes
    ----------
    qp : AxisQp
    task : (3 + K,) array
    bounds : (2, R') array
        Of all values.
    lower, upper : (free,) array
        What ``qp.rows @ z`` may be.
    broken : str
        Which bound the start alone breaks.
    """

    qp: AxisQp
    task: Array
    bounds: Array
    lower: Array
    upper: Array
    broken: str


class QptrBackend:
    """Quadratic-programming trajectory repairing (paper, Sec. V-A; Tong et al. 2023).

    Parameters
    ----------
    config : QptrConfig
        Solver, degree, duration of the pieces, weights.

    Raises
    ------
    BackendError
        If the solver is not there or gives wrong answers to problems of known answer.
    """

    name = "qptr"
    capabilities = Capabilities()

    def __init__(self, config: QptrConfig | None = None) -> None:
        self.config = config or QptrConfig()
        if self.config.continuity >= self.config.degree:
            raise BackendError(
                f"qptr.continuity {self.config.continuity} needs a degree above it, not {self.config.degree}"
            )
        require_solver(self.config.solver)

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """Build the corridor and solve the QP in it; ``warm_start`` is of no use to either.

        Raises
        ------
        BackendError
            If the problem ends before it begins.
        """
        begin = time.perf_counter()
        duration = problem.t_end - problem.t_rep
        if not duration > 0.0:
            raise BackendError(
                f"a repair from t = {problem.t_rep:g} s to {problem.t_end:g} s has no duration"
            )
        try:
            with until(None if time_limit is None else begin + time_limit):
                axes, tasks = self._axes(problem, duration)
        except OutOfTime:
            spent, said = time.perf_counter() - begin, "no time is left"
            said = said if time_limit is None else f"time limit of {time_limit:g} s"
            return SolveResult(SolveStatus.TIME_LIMIT, build_time=spent, detail=said)
        except NoCorridor as closed:
            spent = time.perf_counter() - begin
            return SolveResult(SolveStatus.NO_CORRIDOR, build_time=spent, detail=str(closed))
        built = time.perf_counter()
        broken = "; ".join(a.broken for a in axes if a.broken)
        if broken:
            return SolveResult(SolveStatus.INFEASIBLE, build_time=built - begin, detail=broken)
        found: list[Array] = []
        words: list[str] = []
        for a in axes:
            left = None if time_limit is None else time_limit - (time.perf_counter() - begin)
            answer = solve_projection(a.qp.rows, a.lower, a.upper, self.config.solver, left)
            if answer.z is None:
                spent = time.perf_counter() - built
                return SolveResult(
                    answer.status, build_time=built - begin, solve_time=spent, detail=answer.detail
                )
            found.append(answer.z)
            words.append(answer.detail)
        solved = time.perf_counter()
        curve, objective, residuals = _solution(problem, axes, found, tasks)
        return SolveResult(
            status=SolveStatus.SOLVED,
            curve=curve,
            objective=objective,
            build_time=built - begin,
            solve_time=solved - built,
            detail="; ".join(dict.fromkeys(words)),
            residuals=residuals,
        )

    def _axes(self, problem: RepairProblem, duration: float) -> tuple[list[_Axis], Array]:
        """The QP of each axis that is planned, and the tasks of both axes (2, 3 + K).

        Raises
        ------
        NoCorridor
            If there is none.
        OutOfTime
            If the deadline passes before.
        """
        in_time()
        pieces = max(1, math.ceil(duration / self.config.spacing - 1e-9))
        grid = time_grid(problem, pieces)
        # Rounded, so that repairs of the same duration share what has been built for it.
        length = round(duration / pieces, 12)
        c = self.config
        qps = []
        for axis in range(2 if problem.lateral else 1):
            in_time()
            qps.append(
                axis_qp(axis, problem.limits, pieces, length, c.degree, c.continuity, c.w_jerk, c.w_deviation)
            )
        in_time()
        times = np.concatenate((grid.times, problem.t_rep + qps[0].structure.nodes))
        reference = problem.reference.sample(times).position
        count = len(grid.times)
        corridor = build_corridor(problem, grid, reference[:count])
        # s from its start: what is left are numbers of the same size on both axes
        shift = float(problem.start[0, 0])
        tasks = np.empty((2, 3 + len(times) - count))
        tasks[:, :3], tasks[:, 3:] = problem.start.T, reference[count:].T
        tasks[0, 3:] -= shift
        tasks[0, 0] = 0.0
        return [
            _axis(
                qp, tasks[axis], corridor.control_bounds(c.degree, axis), 0.0 if axis else shift, "sl"[axis]
            )
            for axis, qp in enumerate(qps)
        ], tasks


def _axis(qp: AxisQp, task: Array, corridor: Array, shift: float, name: str) -> _Axis:
    """The bounds of what is free; those of the control points are the ``corridor`` (2, N), shifted."""
    bounds = qp.bounds.copy()
    np.subtract(corridor, shift, out=bounds[:, : qp.families[1]])
    bounds[:, qp.families[4] : qp.families[5]] = task[:3]
    left = bounds.take(qp.bounded, axis=1)
    left /= qp.scale
    left -= qp.at_rest @ task
    return _Axis(qp, task, bounds, left[0, : qp.free], left[1, : qp.free], qp.broken(left, name))


def _solution(
    problem: RepairProblem, axes: list[_Axis], z: list[Array], tasks: Array
) -> tuple[BernsteinCurve, float, dict[str, float]]:
    """Curve, objective, and the largest violation of every family of constraints in their own units."""
    qp, s = axes[0].qp, axes[0].qp.structure
    points, count = np.zeros((len(s.times), 2)), qp.bounds.shape[1]
    objective, worst = 0.0, np.zeros(len(FAMILIES))
    for axis, (a, free) in enumerate(zip(axes, z, strict=True)):
        x = a.qp.points @ a.task + a.qp.structure.basis @ free
        judged = qp.judged @ x
        worst = np.maximum(worst, qp.violations(judged[:count], a.bounds))
        objective += qp.objective(judged[count:], a.task)
        points[:, axis] = x
    points[:, 0] += problem.start[0, 0]
    if not problem.lateral and np.count_nonzero(tasks[1]):  # most references are the path itself
        driven = BernsteinCurve(problem.t_rep, s.duration, points.reshape(s.pieces, -1, 2))
        aside = aside_at(problem, driven.sample(problem.t_rep + s.nodes).position[:, 0])
        if aside is not None:
            tasks[1, 3:] = aside
        x = s.follow @ tasks[1]
        objective += qp.objective(qp.judged[count:] @ x, tasks[1])
        points[:, 1] = x
    points.setflags(write=False)
    curve = BernsteinCurve(problem.t_rep, s.duration, points.reshape(s.pieces, -1, 2))
    return curve, objective, dict(zip(FAMILIES, worst.tolist(), strict=True))


def make(config: Configuration) -> QptrBackend:
    """The backend as the configuration describes it."""
    return QptrBackend(config.section("qptr"))
