"""The paper's backend: soft penalties on a uniform B-spline, deformation then refinement.

Deformation (Sec. IV-C) minimises J = lambda_s J_s + lambda_c J_c + lambda_d J_d with the start of
the curve fixed and its end free; refinement (Sec. IV-D) minimises J' = lambda_s J_s + lambda_d J_d
+ lambda_f J_f with both ends fixed and the duration kept (T' = T). Both costs are convex: there is
one minimum, and Newton steps or the paper's L-BFGS (``ego.solver``) lead to it.
"""

from __future__ import annotations

import time
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.bspline import UniformBSpline, fit_to_curve, n_points_for
from repair.config import Config, DeformWeights, EgoConfig, RefineWeights
from repair.solvers.minimise import Minimum, OutOfTime, lbfgs, newton
from repair.solvers.penalties import SoftBounds, feasibility_bounds
from repair.solvers.spline_cost import SplineCost, fitting_band
from repair.types import Array, Curve, Limits, RepairProblem, Side, SolveResult, SolveStatus, frozen

__all__ = ["EgoBackend", "Pairs", "anchor_pairs"]

# NumPy compares with plain integers several times faster than with an enumeration's members.
_AHEAD = int(Side.AHEAD)
# Of each side, in their order: the axis of v, and its sign. Ahead and left lie at the upper corner of the
# box, behind and right at the lower one.
_AXIS = np.array([0, 0, 1, 1])
_SIGN = np.array([-1.0, 1.0, 1.0, -1.0])
# An array of no dimension is taken by NumPy two or three times faster than a number of Python's.
_ZERO = np.zeros(())
_STRAIGHT = np.array(1e-9)  # curvature [1/m]


class Pairs(NamedTuple):
    """The paper's {p, v} pairs, one row each: d = (Q_i - p) . v with v along an axis.

    ``row`` control point, ``axis`` 0 for s and 1 for l, ``sign`` of v on that axis, ``anchor`` the
    coordinate of p on that axis [m], ``threshold`` the s_f of the pair [m].
    """

    row: np.ndarray
    axis: np.ndarray
    sign: np.ndarray
    anchor: np.ndarray
    threshold: np.ndarray

    def along(self, axis: int) -> Pairs:
        """The pairs whose v points along an axis."""
        kept = self.axis == axis
        return self if np.count_nonzero(kept) == len(kept) else Pairs(*(column[kept] for column in self))

    def distance(self, points: Array) -> Array:
        """Obstacle distance d_ij of every pair (paper, Definition 3)."""
        return np.asarray(self.sign * (points[self.row, self.axis] - self.anchor))


def anchor_pairs(problem: RepairProblem, times: Array, shape: Array, first: int) -> Pairs:
    """Pairs for the control points ``first``.. of a curve whose points lie at ``shape``.

    Parameters
    ----------
    times : (n,) array
        Greville times [s]: each control point meets the obstacles at its own time.
    shape : (n, 2) array
        Where the control points lie or are led to; decides which boxes stand in their way.
    first : int
        Points before this one are fixed and get no pair.

    Notes
    -----
    A box that the ego passes behind or ahead of concerns the points inside its lateral interval,
    one passed on the left or right those inside its longitudinal interval.
    """
    parts: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array, Array, Array]] = []
    passing = problem.passing
    if passing is not None and len(problem.occupancy):
        lower, upper = problem.occupancy.at(times[first:])
        side = passing.side_at(times[first:]).ravel()
        free = shape[first:]
        inside = ((lower < free) & (free < upper)).reshape(-1, 2)
        found = np.where(side <= _AHEAD, inside[:, 1], inside[:, 0]).nonzero()[0]
        chosen = side.take(found)
        axis, sign = _AXIS.take(chosen), _SIGN.take(chosen)
        corner = 2 * found + axis
        anchor = np.where(sign > _ZERO, upper.ravel().take(corner), lower.ravel().take(corner))
        parts.append((found % len(free) + first, axis, sign, anchor, np.full(len(found), problem.clearance)))
    if problem.lateral:
        right, left = problem.bounds.at(shape[first:, 0])
        row = np.arange(first, len(times))
        ones = np.ones(len(row))
        edge = np.full(len(row), min(problem.clearance, 0.2))
        for sign_value, anchor in ((1.0, right), (-1.0, left)):
            parts.append((row, np.ones_like(row), sign_value * ones, anchor, edge))
    if len(parts) == 1:
        return Pairs(*parts[0])
    if not parts:
        empty = np.empty(0)
        return Pairs(empty.astype(np.intp), empty.astype(np.intp), empty, empty, empty)
    return Pairs(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@lru_cache(maxsize=128)
def _feasibility(
    n: int, limits: Limits, config: tuple[float, ...], scale: float, axes: tuple[int, ...]
) -> SoftBounds:
    """Bounds of the stacked derivatives on some axes, and of their negatives; lambda_d is in the weights."""
    w_v, w_a, w_j, elastic, joint, reverse = config
    maxima = np.array(
        [[limits.v_max, limits.v_lat], [limits.a_max, limits.a_lat], [limits.j_lon, limits.j_lat]]
    )
    minima = np.array([[0.0, -limits.v_lat], [limits.a_min, -limits.a_lat], [-limits.j_lon, -limits.j_lat]])
    weights = (scale * w_v, scale * w_a, scale * w_j)
    sides = feasibility_bounds(n, maxima, minima, weights, elastic, joint, reverse)
    chosen = list(axes)
    return SoftBounds(
        *(frozen(np.concatenate([c[:, chosen].ravel() for c in both])) for both in zip(*sides, strict=True))
    )


def _with_pairs(bounds: SoftBounds, pairs: Pairs, collision: float) -> SoftBounds:
    """The bounds, and for each pair that of -Q . v: from d = s_f on the penalty j_c starts."""
    weight = np.full(len(pairs.row), 6.0 * collision)
    return SoftBounds(
        np.concatenate((bounds.limit, -pairs.sign * pairs.anchor - pairs.threshold)),
        np.concatenate((bounds.joint, pairs.threshold)),
        np.concatenate((bounds.sixfold, weight)),
        np.concatenate((bounds.bend, weight * pairs.threshold)),
    )


def _closest(pairs: Pairs, points: Array) -> float:
    """Smallest obstacle distance of all pairs, inf without any."""
    return float(pairs.distance(points).min()) if pairs.row.size else float("inf")


def _bend_speed(problem: RepairProblem, points: Array) -> Array:
    """Speed (n - 1,) at which the bends along the control points use 0.8 of the lateral limit."""
    bend = np.abs(problem.curvature_at(points[:, 0]))
    return np.asarray(
        np.sqrt(0.8 * problem.limits.a_lat / np.maximum(np.maximum(bend[1:], bend[:-1]), _STRAIGHT))
    )


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
            if self.config.guard and _closest(pairs, refined.points) < min(
                0.0, _closest(pairs, deformed.points)
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
            clear = _closest(pairs, led) >= 0.0
            # The speed limit of a bend was taken where the guide is; see whether it holds here.
            if clear and (cap is None or self._slow_enough(problem, led)):
                break
            if not clear:
                collision *= 2.0
        return minimum, pairs, cap, rounds

    def _slow_enough(self, problem: RepairProblem, points: Array) -> bool:
        allowed = 1.02 * self.spacing * _bend_speed(problem, points)
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
        bounds = _with_pairs(self._bounds(problem, n, weights.feasible, cap), pairs, collision)
        cost = SplineCost(
            start[:, :axes], self.degree, n, self.spacing, weights.smooth, bounds,
            pairs.row * axes + pairs.axis, -pairs.sign, constant=self._resting(problem, start, weights),
        )  # fmt: skip
        return self._minimise(cost, start, deadline)

    def _cap(self, problem: RepairProblem, led: Array) -> Array | None:
        """The speeds (n - 1,) that a bend allows, where it matters."""
        cap = _bend_speed(problem, led)
        return None if cap.item(cap.argmin()) >= self.config.elastic * problem.limits.v_max else cap

    def _bounds(self, problem: RepairProblem, n: int, scale: float, cap: Array | None) -> SoftBounds:
        """Bounds of the derivatives on the axes that move."""
        axes = (0, 1) if problem.lateral else (0,)
        bounds = _feasibility(n, problem.limits, self._penalties, scale, axes)
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
        bounds = _feasibility(n, problem.limits, self._penalties, weights.feasible, (1,))
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
