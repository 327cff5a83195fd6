"""QPTR: a quadratic program of Bernstein pieces in a convex driving corridor (the paper's baseline).

Path and speed are planned together in (s, l, t): the control points stay in the corridor and those
of the derivatives in the limits, so that the whole curve does; jerk and deviation from the reference
are minimised. Acceleration is bounded on each axis of the frame, which is all a QP can express: that
the repaired trajectory also keeps the friction circle, and the lateral acceleration of a curve, is
for the checker to say.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from repair.baselines.bernstein import BernsteinCurve, QpStructure, qp_structure
from repair.baselines.corridor import Corridor, NoCorridor, build_corridor
from repair.baselines.qp import require_solver, solve_projection
from repair.config import Config, QptrConfig
from repair.errors import BackendError
from repair.types import Array, Curve, Limits, RepairProblem, SolveResult, SolveStatus, frozen

__all__ = ["QptrBackend", "make"]

_FIXED = 1e-9  # a row of smaller norm depends on the start alone
_START = 1e-4  # by how much the start's own control points may break a bound (m, m/s, ...)


@dataclass(frozen=True)
class _Axis:
    """One axis of the QP: control points x = offset + structure.basis @ z, rows @ z <= limit."""

    structure: QpStructure
    origin: Array
    rows: Array
    limit: Array
    offset: Array
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
        pieces = max(1, int(np.ceil(duration / self.config.spacing - 1e-9)))
        edges = np.asarray(problem.t_rep + duration / pieces * np.arange(pieces + 1))
        try:
            corridor = build_corridor(problem, edges)
        except NoCorridor as closed:
            spent = time.perf_counter() - begin
            return SolveResult(SolveStatus.NO_CORRIDOR, build_time=spent, detail=str(closed))
        axes = [self._axis(problem, corridor, axis) for axis in range(2 if problem.lateral else 1)]
        built = time.perf_counter()
        broken = "; ".join(a.broken for a in axes if a.broken)
        if broken:
            return SolveResult(SolveStatus.INFEASIBLE, build_time=built - begin, detail=broken)
        origin, rows, limit = _joined(axes)
        left = None if time_limit is None else time_limit - (built - begin)
        answer = solve_projection(origin, rows, limit, self.config.solver, left)
        solved = time.perf_counter()
        if answer.z is None:
            return SolveResult(
                answer.status, build_time=built - begin, solve_time=solved - built, detail=answer.detail
            )
        curve = self._curve(problem, axes, answer.z)
        return SolveResult(
            status=answer.status,
            curve=curve,
            objective=self._objective(problem, axes[0].structure, curve),
            build_time=built - begin,
            solve_time=solved - built,
            detail=answer.detail,
            residuals=residuals(problem, corridor, curve, self.config.continuity),
        )

    def _structure(self, edges: Array, axis: int) -> QpStructure:
        """Sideways the repair comes to rest, so as to end parallel to the path; along it the end is free."""
        c, pieces = self.config, len(edges) - 1
        duration = float(edges[-1] - edges[0]) / pieces
        return qp_structure(pieces, c.degree, duration, c.continuity, c.w_jerk, c.w_deviation, axis == 1)

    def _axis(self, problem: RepairProblem, corridor: Corridor, axis: int) -> _Axis:
        structure = self._structure(corridor.edges, axis)
        reference = problem.reference.sample(problem.t_rep + structure.nodes).position[:, axis]
        low, high = corridor.control_bounds(structure.degree)
        # s from its start: what is left are numbers of the same size on both axes
        shift = float(problem.start[0, 0]) if axis == 0 else 0.0
        offset = structure.lift @ (problem.start[:, axis] - [shift, 0.0, 0.0])
        pull = (
            2.0 * self.config.w_deviation * structure.at_nodes.T @ (structure.weights * (reference - shift))
        )
        lower, upper = _derivative_bounds(problem.limits, structure, axis)
        lower[0], upper[0] = low[..., axis].ravel() - shift, high[..., axis].ravel() - shift
        rows, limit, broken = _rows(structure, offset, lower, upper, "sl"[axis])
        origin = -structure.basis.T @ (structure.hessian @ offset - pull)
        return _Axis(structure, origin, rows, limit, offset, broken)

    def _curve(self, problem: RepairProblem, axes: list[_Axis], z: Array) -> BernsteinCurve:
        structure, used = axes[0].structure, 0
        columns: list[Array] = []
        for axis in axes:
            m = len(axis.origin)
            columns.append(axis.offset + axis.structure.basis @ z[used : used + m])
            used += m
        columns[0] = columns[0] + float(problem.start[0, 0])
        if not problem.lateral:
            columns.append(_reference_points(problem, structure))
        shape = (structure.pieces, structure.degree + 1)
        points = np.stack([c.reshape(shape) for c in columns], axis=2)
        return BernsteinCurve(problem.t_rep, structure.duration, frozen(points))

    def _objective(self, problem: RepairProblem, structure: QpStructure, curve: BernsteinCurve) -> float:
        times = problem.t_rep + structure.nodes
        ours, reference = curve.sample(times), problem.reference.sample(times)
        jerk = np.sum(ours.jerk**2, axis=1)
        deviation = np.sum((ours.position - reference.position) ** 2, axis=1)
        return float(structure.weights @ (self.config.w_jerk * jerk + self.config.w_deviation * deviation))


def _reference_points(problem: RepairProblem, structure: QpStructure) -> Array:
    """Control points of l that follow the reference (least squares, exact start)."""
    lateral = problem.reference.sample(problem.t_rep + structure.nodes).position[:, 1]
    offset = structure.lift @ problem.start[:, 1]
    fit = np.linalg.lstsq(
        structure.at_nodes @ structure.basis, lateral - structure.at_nodes @ offset, rcond=None
    )[0]
    return np.asarray(offset + structure.basis @ fit)


def _derivative_bounds(limits: Limits, structure: QpStructure, axis: int) -> tuple[list[Array], list[Array]]:
    """Bounds of the control points of speed, acceleration and jerk; the place of position is left empty."""
    if axis == 0:
        low, high = (0.0, limits.a_min, -limits.j_lon), (limits.v_max, limits.a_max, limits.j_lon)
    else:
        low = (-limits.v_lat, -limits.a_lat, -limits.j_lat)
        high = (limits.v_lat, limits.a_lat, limits.j_lat)
    counts = [structure.pieces * (structure.degree + 1 - k) for k in (1, 2, 3)]
    lower = [np.empty(0), *(np.full(n, value) for n, value in zip(counts, low, strict=True))]
    upper = [np.empty(0), *(np.full(n, value) for n, value in zip(counts, high, strict=True))]
    for k in (1, 2):
        # Speed and acceleration at the start are the reference's doing, not the repair's.
        lower[k][0], upper[k][0] = -np.inf, np.inf
    return lower, upper


def _rows(
    structure: QpStructure, offset: Array, lower: list[Array], upper: list[Array], name: str
) -> tuple[Array, Array, str]:
    """Rows of unit norm, their limits, and which bound the start alone breaks ("" if none)."""
    blocks, limits, broken = [], [], []
    for k, what in enumerate(("corridor", "speed limits", "acceleration limits", "jerk limits")):
        value = structure.derivatives[k] @ offset
        norm = np.linalg.norm(structure.reach[k], axis=1)
        free = norm > _FIXED * norm.max()
        excess = np.maximum(value - upper[k], lower[k] - value)[~free].max(initial=-np.inf)
        if excess > _START:
            broken.append(
                f"the start state leads {excess:.2g} out of the {what} of {name} before anything can be done"
            )
        for sign, bound in ((1.0, upper[k]), (-1.0, lower[k])):
            use = free & np.isfinite(bound)
            blocks.append(sign * structure.reach[k][use] / norm[use, None])
            limits.append(sign * (bound - value)[use] / norm[use])
    return np.vstack(blocks), np.concatenate(limits), "; ".join(broken)


def _joined(axes: list[_Axis]) -> tuple[Array, Array, Array]:
    """Both axes as one QP: s(t) and l(t) together."""
    if len(axes) == 1:
        return axes[0].origin, axes[0].rows, axes[0].limit
    from scipy.linalg import block_diag

    return (
        np.concatenate([a.origin for a in axes]),
        block_diag(*(a.rows for a in axes)),
        np.concatenate([a.limit for a in axes]),
    )


def residuals(
    problem: RepairProblem, corridor: Corridor, curve: BernsteinCurve, continuity: int
) -> dict[str, float]:
    """Largest violation of every family of constraints by the control points, in their own units."""
    limits = problem.limits
    axes = slice(0, 2 if problem.lateral else 1)
    low, high = corridor.control_bounds(curve.degree)
    bounds = {
        "velocity": ([0.0, -limits.v_lat], [limits.v_max, limits.v_lat]),
        "acceleration": ([limits.a_min, -limits.a_lat], [limits.a_max, limits.a_lat]),
        "jerk": ([-limits.j_lon, -limits.j_lat], [limits.j_lon, limits.j_lat]),
    }

    def excess(values: Array, lower: Array, upper: Array) -> float:
        return float(np.maximum(values - upper, lower - values)[..., axes].max(initial=0.0))

    found = {"corridor": excess(curve.points, low, high)}
    for order, (name, (lower, upper)) in enumerate(bounds.items(), start=1):
        values = curve.derivative_points(order).reshape(-1, 2)
        found[name] = excess(values[1 if order < 3 else 0 :], np.array(lower), np.array(upper))
    begin = curve.sample([curve.t_start])
    state = np.concatenate([begin.position, begin.velocity, begin.acceleration])
    found["start"] = float(np.abs(state - problem.start)[:, axes].max())
    jumps = [
        np.abs(curve.derivative_points(k)[:-1, -1] - curve.derivative_points(k)[1:, 0]).max(initial=0.0)
        for k in range(continuity + 1)
    ]
    found["joints"] = float(max(jumps))
    return found


def make(config: Config) -> QptrBackend:
    """The backend as the configuration describes it."""
    return QptrBackend(config.qptr)
