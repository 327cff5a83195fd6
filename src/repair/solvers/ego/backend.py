"""The paper's backend: soft penalties on a uniform B-spline, deformation then refinement.

Deformation (Sec. IV-C) minimises J = lambda_s J_s + lambda_c J_c + lambda_d J_d with the start of
the curve fixed and its end free; refinement (Sec. IV-D) minimises J' = lambda_s J_s + lambda_d J_d
+ lambda_f J_f with both ends fixed and the duration kept (T' = T). Both costs are convex: there is
one minimum, and Newton steps or the paper's L-BFGS (``ego.solver``) lead to it.
"""

from __future__ import annotations

import time

import numpy as np

from repair.arrays import Array
from repair.backend.base import SolveResult, SolveStatus
from repair.config import Config
from repair.curves.base import Curve
from repair.curves.bases import n_points_for
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.problem.problem import RepairProblem
from repair.solvers.ego.bounds import bend_speed, feasibility, with_pairs
from repair.solvers.ego.minimise import Minimum, OutOfTime, lbfgs, newton
from repair.solvers.ego.pairs import Pairs, anchor_pairs, closest_distance
from repair.solvers.ego.penalties import SoftBounds
from repair.solvers.ego.settings import DeformWeights, EgoConfig, RefineWeights
from repair.solvers.ego.spline_cost import SplineCost, fitting_band

__all__ = ["EgoBackend"]


def _standing(points: Array, degree: int) -> Array:
    """Stand instead of rolling back: what is left of a reversing motion becomes a standstill.

    Non-decreasing control points make the speed non-negative on the whole curve (convex hull).
    """
    result = points.copy()
    np.maximum.accumulate(points[degree - 1 :, 0], out=result[degree - 1 :, 0])
    result.setflags(write=False)
    return result


class EgoBackend:
    """Deformation and refinement (paper, Sec. IV; after EGO-Planner, Zhou et al. 2021).

    Parameters
    ----------
    config : EgoConfig
        Weights and solver settings.
    degree : int
        Degree of the B-spline.
    spacing : float
        Knot spacing [s].
    """

    name = "ego"

    def __init__(self, config: EgoConfig | None = None, *, degree: int = 3, spacing: float = 0.4) -> None:
        self.config = config or EgoConfig()
        self.degree = degree
        self.spacing = spacing
        c = self.config
        self._penalties = (c.w_v, c.w_a, c.w_j, c.elastic, c.joint, c.reverse)

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """Deform and refine; the result is soft and it is for the checker to judge it.

        Raises
        ------
        repair.errors.BackendError
            Never for a well-formed problem.
        """
        begin = time.perf_counter()
        deadline = begin + time_limit if time_limit is not None else None
        n = n_points_for(problem.t_end - problem.t_rep, self.spacing, self.degree)
        initial = fit_to_curve(problem.reference, problem.t_rep, n, self.degree, self.spacing)
        built = time.perf_counter()
        try:
            deformed, pairs, cap, rounds = self._deform(problem, initial, deadline)
            refined = self._refine(problem, deformed, cap, deadline)
            if self.config.guard and closest_distance(pairs, refined.points) < min(
                0.0, closest_distance(pairs, deformed.points)
            ):
                refined = deformed
        except OutOfTime:
            now = time.perf_counter()
            return SolveResult(
                SolveStatus.TIME_LIMIT, build_time=built - begin, solve_time=now - built,
                detail=f"time limit of {time_limit:g} s",
            )  # fmt: skip
        curves = {
            name: UniformBSpline(
                problem.t_rep, self.spacing, self.degree, _standing(minimum.points, self.degree)
            )
            for name, minimum in (("deformation", deformed), ("refinement", refined))
        }
        converged = deformed.converged and refined.converged
        return SolveResult(
            status=SolveStatus.SOLVED if converged else SolveStatus.ITERATION_LIMIT,
            curve=curves["refinement"],
            objective=refined.cost,
            iterations=deformed.iterations + refined.iterations,
            build_time=built - begin,
            solve_time=time.perf_counter() - built,
            detail=f"deformation {deformed.iterations} iterations in {rounds} round(s), "
            f"refinement {refined.iterations}",
            stages=curves,
        )

    # -- deformation -----------------------------------------------------------------------------

    def _deform(
        self, problem: RepairProblem, initial: UniformBSpline, deadline: float | None
    ) -> tuple[Minimum, Pairs, Array | None, int]:
        """Minimise J; while control points still collide, double lambda_c and start again."""
        config = self.config
        collision = config.deform.collision
        greville = initial.greville
        shape = self._led_points(problem, initial, greville)
        pairs = anchor_pairs(problem, greville, shape, self.degree)
        minimum = Minimum(initial.points, np.inf, 0, False)
        led = shape
        for rounds in range(1, config.rebounds + 2):
            cap = self._cap(problem, led)
            minimum = self._minimise_deformation(problem, minimum.points, pairs, collision, cap, deadline)
            if rounds > config.rebounds:
                break
            led = minimum.points
            clear = closest_distance(pairs, led) >= 0.0
            # The speed limit of a bend was taken where the guide is; see whether it holds here.
            if clear and (cap is None or self._slow_enough(problem, led)):
                break
            if not clear:
                collision *= 2.0
        return minimum, pairs, cap, rounds

    def _slow_enough(self, problem: RepairProblem, points: Array) -> bool:
        allowed = 1.02 * self.spacing * bend_speed(problem, points)
        return bool((points[1:, 0] - points[:-1, 0] <= allowed).all())

    def _led_points(self, problem: RepairProblem, initial: UniformBSpline, times: Array) -> Array:
        """Where the guide leads the control points (the reference where there is no guide)."""
        if problem.passing is None:
            return initial.points
        guide = problem.passing.guide
        # Both axes at once, as the parts of complex numbers.
        position = np.ascontiguousarray(guide.position).view(np.complex128)[:, 0]
        led = np.interp(times, guide.t, position).view(np.float64).reshape(-1, 2)
        led[: self.degree] = initial.points[: self.degree]
        return led

    def _minimise_deformation(
        self,
        problem: RepairProblem,
        start: Array,
        pairs: Pairs,
        collision: float,
        cap: Array | None,
        deadline: float | None,
    ) -> Minimum:
        weights, n = self.config.deform, len(start)
        if not problem.lateral:
            pairs = pairs.along(0)
        axes = 2 if problem.lateral else 1
        bounds = with_pairs(self._bounds(problem, n, weights.feasible, cap), pairs, collision)
        cost = SplineCost(
            start[:, :axes], self.degree, n, self.spacing, weights.smooth, bounds,
            pairs.row * axes + pairs.axis, -pairs.sign, constant=self._resting(problem, start, weights),
        )  # fmt: skip
        return self._minimise(cost, start, deadline)

    def _cap(self, problem: RepairProblem, led: Array) -> Array | None:
        """The speeds (n - 1,) that a bend allows, where it matters."""
        cap = bend_speed(problem, led)
        return None if cap.item(cap.argmin()) >= self.config.elastic * problem.limits.v_max else cap

    def _bounds(self, problem: RepairProblem, n: int, scale: float, cap: Array | None) -> SoftBounds:
        """Bounds of the derivatives on the axes that move."""
        axes = (0, 1) if problem.lateral else (0,)
        bounds = feasibility(n, problem.limits, self._penalties, scale, axes)
        if cap is None:
            return bounds
        limit = bounds.limit.copy()
        speeds = limit[: (n - 1) * len(axes) : len(axes)]
        np.minimum(speeds, cap, out=speeds)
        return SoftBounds(limit, bounds.joint, bounds.sixfold, bounds.bend)

    def _resting(
        self, problem: RepairProblem, points: Array, weights: DeformWeights | RefineWeights
    ) -> float:
        """What l costs where it may not move: a constant."""
        if problem.lateral or not np.count_nonzero(points[:, 1]):
            return 0.0
        n = len(points)
        bounds = feasibility(n, problem.limits, self._penalties, weights.feasible, (1,))
        cost = SplineCost(points[:, 1:], 0, n, self.spacing, weights.smooth, bounds)
        return cost(np.zeros(n)).value

    def _minimise(
        self, cost: SplineCost, start: Array, deadline: float | None, near_closed_form: bool = False
    ) -> Minimum:
        """Minimise over the free control points; what the cost does not know of stays as in ``start``."""
        c = self.config
        if c.solver == "newton":
            minimum = newton(cost, c.max_iterations, c.tolerance, deadline, near_closed_form=near_closed_form)
        else:
            minimum = lbfgs(cost, c.max_iterations, c.tolerance, deadline, precondition=c.precondition)
        axes = minimum.points.shape[1]
        if axes == start.shape[1]:
            return minimum
        points = start.copy()
        points[:, :axes] = minimum.points
        return Minimum(points, minimum.cost, minimum.iterations, minimum.converged)

    # -- refinement ------------------------------------------------------------------------------

    def _refine(
        self, problem: RepairProblem, deformed: Minimum, cap: Array | None, deadline: float | None
    ) -> Minimum:
        """Minimise J' from the deformed curve; both axes are coupled by the fitting term."""
        weights, points, p = self.config.refine, deformed.points, self.degree
        n, axes = len(points), 2 if problem.lateral else 1
        if n <= 2 * p:
            return deformed
        cost = SplineCost(
            points[:, :axes], p, n - p, self.spacing, weights.smooth,
            self._bounds(problem, n, weights.feasible, cap),
            fit=fitting_band(points, p, self.spacing, weights.fit, axes),
            constant=self._resting(problem, points, weights),
        )  # fmt: skip
        return self._minimise(cost, points, deadline, near_closed_form=True)


def make(config: Config) -> EgoBackend:
    """The backend as the configuration describes it."""
    return EgoBackend(config.ego, degree=config.repair.degree, spacing=config.repair.spacing)
