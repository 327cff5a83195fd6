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
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.baselines.bernstein import BernsteinCurve, QpStructure, qp_structure
from repair.baselines.corridor import NoCorridor, build_corridor, time_grid
from repair.baselines.qp import require_solver, solve_projection
from repair.config import Config, QptrConfig
from repair.errors import BackendError
from repair.types import Array, Curve, Limits, RepairProblem, SolveResult, SolveStatus

__all__ = ["QptrBackend", "make"]

_FIXED = 1e-9  # a row of smaller norm depends on the start alone
_START = 1e-4  # by how much the start's own control points may break a bound (m, m/s, ...)
_FAMILIES = ("corridor", "velocity", "acceleration", "jerk", "start", "joints")
_WORDS = ("corridor", "speed limits", "acceleration limits", "jerk limits")


@dataclass(frozen=True)
class _AxisQp:
    """All of one axis's QP that depends on neither start, reference nor corridor.

    What is left is its *task*: the start state and the reference at the quadrature nodes, (3 + K,).
    With z (m,) free, the control points are ``points @ task + basis @ z``, and z = 0 is the optimum
    without bounds. The *values* of control points are those of position to jerk, one after the other
    (R,), then the start state and the jumps at the joints.

    Attributes
    ----------
    structure : QpStructure
    points : (N, 3 + K) array
    families : (6,) int array
        Where each of ``_FAMILIES`` begins in the values.
    bounds : (2, R') array
        Lower and upper bounds of the values, as far as the limits give them.
    bounded : (B,) int array
        The values that z moves, then those that follow from the start alone.
    free : int
        How many of them z moves.
    rows : (free, m) array
        How z moves them, divided by ``scale`` so as to be of unit norm.
    scale : (B,) array
    at_rest : (B, 3 + K) array
        Map from a task to the bounded values at z = 0, divided by ``scale``.
    judged : (R' + 2 K, N) array
        Map from control points to their values, and to the terms whose squares add up to the objective:
        jerk, deviation. The same for both axes.
    weights : (K,) array
        Of the deviation in these terms.
    """

    structure: QpStructure
    points: Array
    families: npt.NDArray[np.intp]
    bounds: Array
    bounded: npt.NDArray[np.intp]
    free: int
    rows: Array
    scale: Array
    at_rest: Array
    judged: Array
    weights: Array

    def objective(self, terms: Array, task: Array) -> float:
        """Jerk and deviation from the task's reference, of the ``terms`` (2 K,) without it."""
        terms[len(self.weights) :] -= self.weights * task[3:]
        return float(terms @ terms)

    def violations(self, values: Array, bounds: Array) -> Array:
        """Largest violation of each of ``_FAMILIES``, negative where a bound is nowhere touched."""
        excess = np.maximum(values - bounds[1], bounds[0] - values)
        return np.asarray(np.maximum.reduceat(excess, self.families))

    def broken(self, left: Array, name: str) -> str:
        """Which bound the start alone breaks, from the room ``left`` (2, B) to the bounds; "" if none."""
        left = left[:, self.free :]
        if not np.count_nonzero(left[0] > _START) and not np.count_nonzero(left[1] < -_START):
            return ""
        excess = np.maximum(left[0], -left[1])
        family = np.searchsorted(self.families, self.bounded[self.free :], side="right") - 1
        worst = [excess[family == k].max(initial=0.0) for k in range(len(_WORDS))]
        return "; ".join(
            f"the start state leads {by:.2g} out of the {what} of {name} before anything can be done"
            for by, what in zip(worst, _WORDS, strict=True)
            if by > _START
        )


@lru_cache(maxsize=64)
def _axis_qp(
    axis: int,
    limits: Limits,
    pieces: int,
    duration: float,
    degree: int,
    continuity: int,
    w_jerk: float,
    w_deviation: float,
) -> _AxisQp:
    """Sideways the repair comes to rest, so as to end parallel to the path; along it the end is free."""
    s = qp_structure(pieces, degree, duration, continuity, w_jerk, w_deviation, axis == 1)
    pull = 2.0 * w_deviation * s.at_nodes.T * s.weights
    given = np.hstack([s.lift, np.zeros_like(pull)])  # control points of the task with z = 0 at their origin
    origin = s.basis.T @ (np.hstack([np.zeros_like(s.lift), pull]) - s.hessian @ given)
    points = given + s.basis @ origin

    start = np.vstack([s.derivatives[k][:1] for k in range(3)])
    jumps = s.jumps if len(s.jumps) else np.zeros((1, len(points)))
    blocks = (*s.derivatives, start, jumps)
    values, counts = np.vstack(blocks), [len(block) for block in blocks]
    families = np.cumsum([0, *counts[:-1]])

    norms = [np.linalg.norm(reach, axis=1) for reach in s.reach]
    moved = np.concatenate([norm > _FIXED * norm.max(initial=0.0) for norm in norms])
    bounded, free = np.concatenate([np.flatnonzero(moved), np.flatnonzero(~moved)]), int(moved.sum())
    scale = np.where(moved, np.concatenate(norms), 1.0)[bounded]
    bounds = np.zeros((2, len(values)))
    for k, bound in enumerate(_derivative_bounds(limits, axis), start=1):
        bounds[:, families[k] : families[k + 1]] = np.array(bound)[:, None]
        if k < 3:  # speed and acceleration at the start are the reference's doing, not the repair's
            bounds[:, families[k]] = -np.inf, np.inf
    weights = np.sqrt(w_deviation * s.weights)
    return _AxisQp(
        structure=s,
        points=points,
        families=families,
        bounds=bounds,
        bounded=bounded,
        free=free,
        rows=np.vstack(s.reach)[bounded[:free]] / scale[:free, None],
        scale=scale,
        at_rest=values[bounded] @ points / scale[:, None],
        judged=np.vstack(
            [values, np.sqrt(w_jerk * s.weights)[:, None] * s.jerk_at_nodes, weights[:, None] * s.at_nodes]
        ),
        weights=weights,
    )


def _derivative_bounds(limits: Limits, axis: int) -> tuple[tuple[float, float], ...]:
    """Bounds of speed, acceleration and jerk."""
    if axis == 0:
        return (0.0, limits.v_max), (limits.a_min, limits.a_max), (-limits.j_lon, limits.j_lon)
    return (-limits.v_lat, limits.v_lat), (-limits.a_lat, limits.a_lat), (-limits.j_lat, limits.j_lat)


class _Axis(NamedTuple):
    """One axis of one problem.

    Attributes
    ----------
    qp : _AxisQp
    task : (3 + K,) array
    bounds : (2, R') array
        Of all values.
    lower, upper : (free,) array
        What ``qp.rows @ z`` may be.
    broken : str
        Which bound the start alone breaks.
    """

    qp: _AxisQp
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
            axes, tasks = self._axes(problem, duration)
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
        """The QP of each axis that is planned, and the tasks of both axes (2, 3 + K)."""
        pieces = max(1, math.ceil(duration / self.config.spacing - 1e-9))
        grid = time_grid(problem, pieces)
        # Rounded, so that repairs of the same duration share what has been built for it.
        length = round(duration / pieces, 12)
        c = self.config
        qps = [
            _axis_qp(axis, problem.limits, pieces, length, c.degree, c.continuity, c.w_jerk, c.w_deviation)
            for axis in range(2 if problem.lateral else 1)
        ]
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


def _axis(qp: _AxisQp, task: Array, corridor: Array, shift: float, name: str) -> _Axis:
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
    objective, worst = 0.0, np.zeros(len(_FAMILIES))
    for axis, (a, free) in enumerate(zip(axes, z, strict=True)):
        x = a.qp.points @ a.task + a.qp.structure.basis @ free
        judged = qp.judged @ x
        worst = np.maximum(worst, qp.violations(judged[:count], a.bounds))
        objective += qp.objective(judged[count:], a.task)
        points[:, axis] = x
    points[:, 0] += problem.start[0, 0]
    if not problem.lateral and np.count_nonzero(tasks[1]):  # most references are the path itself
        x = s.follow @ tasks[1]
        objective += qp.objective(qp.judged[count:] @ x, tasks[1])
        points[:, 1] = x
    points.setflags(write=False)
    curve = BernsteinCurve(problem.t_rep, s.duration, points.reshape(s.pieces, -1, 2))
    return curve, objective, dict(zip(_FAMILIES, worst.tolist(), strict=True))


def make(config: Config) -> QptrBackend:
    """The backend as the configuration describes it."""
    return QptrBackend(config.qptr)
