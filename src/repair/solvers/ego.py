"""The paper's backend: soft penalties on a uniform B-spline, deformation then refinement.

Deformation (Sec. IV-C) minimises J = lambda_s J_s + lambda_c J_c + lambda_d J_d with the start of
the curve fixed and its end free; refinement (Sec. IV-D) minimises J' = lambda_s J_s + lambda_d J_d
+ lambda_f J_f with both ends fixed and the duration kept (T' = T). The smoothness (and fitting)
terms are quadratic; the minimisation runs in the coordinates in which that quadratic is the
identity (a Cholesky preconditioner), which changes the path of L-BFGS and not its goal.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.bspline import UniformBSpline, basis_matrix, derivative_matrix, fit_to_curve, n_points_for
from repair.config import Config, EgoConfig
from repair.solvers.penalties import Feasibility, cubic_quadratic, feasibility_bounds
from repair.types import Array, Curve, Limits, RepairProblem, Side, SolveResult, SolveStatus, frozen

__all__ = ["EgoBackend", "Pairs", "anchor_pairs"]


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
    n = len(times)
    parts: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array, Array, Array]] = []
    passing = problem.passing
    if passing is not None and len(problem.occupancy):
        lower, upper = problem.occupancy.at(times)
        side = passing.side_at(times)
        inside = (lower < shape) & (shape < upper)
        along = (side == Side.BEHIND) | (side == Side.AHEAD)
        concerned = np.where(along, inside[..., 1], inside[..., 0])
        concerned[:, :first] = False
        obstacle, row = np.nonzero(concerned)
        chosen = side[obstacle, row]
        axis = np.where(along[obstacle, row], 0, 1)
        # Ahead and left lie at the upper corner of the box, behind and right at the lower one.
        positive = (chosen == Side.AHEAD) | (chosen == Side.LEFT)
        anchor = np.where(positive, upper[obstacle, row, axis], lower[obstacle, row, axis])
        sign = np.where(positive, 1.0, -1.0)
        parts.append((row, axis, sign, anchor, np.full(len(row), problem.clearance)))
    if problem.lateral:
        right, left = problem.bounds.at(shape[first:, 0])
        row = np.arange(first, n)
        ones = np.ones(n - first)
        edge = np.full(n - first, min(problem.clearance, 0.2))
        for sign_value, anchor in ((1.0, right), (-1.0, left)):
            parts.append((row, np.ones_like(row), sign_value * ones, anchor, edge))
    if not parts:
        empty = np.empty(0)
        return Pairs(empty.astype(np.intp), empty.astype(np.intp), empty, empty, empty)
    return Pairs(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@dataclass(frozen=True)
class _Quadratic:
    """Cached structure of the deformation on one axis, in the preconditioned coordinates y.

    With H = 2 lambda_s (A'A + J'J) and its free block L L', the free points are x = x_hat + W y with
    W = L'^-1, and lambda_s J_s = y'y / 2 + the rest that the fixed points leave (W = I and y'Hy / 2
    without preconditioning).
    """

    degree: int
    hessian: Array  # (n, n)
    centre: Array  # (m, p): x_hat from the fixed points
    w: Array  # (m, m)
    w_inverse: Array  # (m, m)
    curvature: Array  # (m, m): W'HW
    stack: Array  # (3n - 6, n): [V; A; J] of all control points
    stack_w: Array  # (3n - 6, m)


@lru_cache(maxsize=128)
def _stack(n: int, spacing: float) -> Array:
    return frozen(np.vstack([derivative_matrix(n, k, spacing) for k in (1, 2, 3)]))


@lru_cache(maxsize=128)
def _smoothness(n: int, spacing: float, weight: float) -> Array:
    acceleration, jerk = derivative_matrix(n, 2, spacing), derivative_matrix(n, 3, spacing)
    return frozen(2.0 * weight * (acceleration.T @ acceleration + jerk.T @ jerk))


@lru_cache(maxsize=128)
def _deformation_structure(
    n: int, degree: int, spacing: float, weight: float, precondition: bool
) -> _Quadratic:
    hessian, stack = _smoothness(n, spacing, weight), _stack(n, spacing)
    block = hessian[degree:, degree:]
    # The straight line that the fixed points begin is the minimiser.
    centre = -np.linalg.solve(block, hessian[degree:, :degree])
    w_inverse = np.linalg.cholesky(block).T if precondition else np.eye(n - degree)
    w = np.linalg.inv(w_inverse)
    return _Quadratic(
        degree, hessian, frozen(centre), frozen(w), frozen(w_inverse), frozen(w.T @ block @ w), stack,
        frozen(stack[:, degree:] @ w),
    )  # fmt: skip


@lru_cache(maxsize=128)
def _feasibility(n: int, limits: Limits, config: tuple[float, ...], scale: float) -> Feasibility:
    w_v, w_a, w_j, elastic, joint, reverse = config
    maxima = np.array(
        [[limits.v_max, limits.v_lat], [limits.a_max, limits.a_lat], [limits.j_lon, limits.j_lat]]
    )
    minima = np.array([[0.0, -limits.v_lat], [limits.a_min, -limits.a_lat], [-limits.j_lon, -limits.j_lat]])
    weights = (scale * w_v, scale * w_a, scale * w_j)
    return feasibility_bounds(n, maxima, minima, weights, elastic, joint, reverse)


def _closest(pairs: Pairs, points: Array) -> float:
    """Smallest obstacle distance of all pairs, inf without any."""
    return float(pairs.distance(points).min()) if pairs.row.size else float("inf")


def _bend_speed(problem: RepairProblem, points: Array) -> Array:
    """Speed (n - 1,) at which the bends along the control points use 0.8 of the lateral limit."""
    bend = np.abs(problem.curvature_at(points[:, 0]))
    return np.sqrt(0.8 * problem.limits.a_lat / np.maximum(np.maximum(bend[1:], bend[:-1]), 1e-9))


def _standing(points: Array, degree: int) -> Array:
    """Stand instead of rolling back: what is left of a reversing motion becomes a standstill.

    Non-decreasing control points make the speed non-negative on the whole curve (convex hull).
    """
    result = points.copy()
    result[degree - 1 :, 0] = np.maximum.accumulate(points[degree - 1 :, 0])
    return frozen(result)


class _OutOfTime(Exception):
    pass


@dataclass
class _Minimum:
    points: Array
    cost: float
    iterations: int
    converged: bool


class EgoBackend:
    """Deformation and refinement by L-BFGS (paper, Sec. IV; after EGO-Planner, Zhou et al. 2021).

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
            deformed, pairs, feasibility, rounds = self._deform(problem, initial, deadline)
            refined = self._refine(problem, initial, deformed, feasibility, deadline)
            if self.config.guard and _closest(pairs, refined.points) < min(
                0.0, _closest(pairs, deformed.points)
            ):
                refined = deformed
        except _OutOfTime:
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
    ) -> tuple[_Minimum, Pairs, tuple[Feasibility, Feasibility], int]:
        """Minimise J; while control points still collide, double lambda_c and start again."""
        config = self.config
        collision = config.deform.collision
        shape = self._led_points(problem, initial)
        points = initial.points
        led = shape
        rounds = 0
        for _ in range(config.rebounds + 1):
            rounds += 1
            feasibility, cap = self._bounds(problem, led)
            pairs = anchor_pairs(problem, initial.greville, shape, self.degree)
            minimum = self._minimise_deformation(
                problem, initial, points, pairs, collision, feasibility[0], deadline
            )
            led = points = minimum.points
            clear = _closest(pairs, points) >= 0.0
            # The speed limit of a bend was taken where the guide is; see whether it holds here.
            slow = (np.diff(points[:, 0]) / self.spacing <= 1.02 * _bend_speed(problem, points)).all()
            if clear and (slow or cap is None):
                break
            if not clear:
                collision *= 2.0
        return minimum, pairs, feasibility, rounds

    def _led_points(self, problem: RepairProblem, initial: UniformBSpline) -> Array:
        """Where the guide leads the control points (the reference where there is no guide)."""
        if problem.passing is None:
            return initial.points
        guide = problem.passing.guide
        led = np.column_stack([np.interp(initial.greville, guide.t, guide.position[:, k]) for k in (0, 1)])
        led[: self.degree] = initial.points[: self.degree]
        return led

    def _minimise_deformation(
        self,
        problem: RepairProblem,
        initial: UniformBSpline,
        start: Array,
        pairs: Pairs,
        collision: float,
        feasibility: Feasibility,
        deadline: float | None,
    ) -> _Minimum:
        config, n = self.config, len(initial.points)
        cached = _deformation_structure(
            n, self.degree, self.spacing, config.deform.smooth, config.precondition
        )
        head = initial.points[: self.degree]
        base = np.vstack([head, cached.centre @ head])
        if not problem.lateral:
            pairs = Pairs(*(c[pairs.axis == 0] for c in pairs))
            base[:, 1] = initial.points[:, 1]
        cost = _Cost(base, cached, feasibility, 2 if problem.lateral else 1, pairs, collision, deadline)
        y, value, iterations, converged = self._lbfgs(cost, cost.coordinates(start))
        return _Minimum(cost.points(y), value, iterations, converged)

    def _bounds(
        self, problem: RepairProblem, led: Array
    ) -> tuple[tuple[Feasibility, Feasibility], Array | None]:
        """Bounds of both stages, and the speeds (n - 1,) that a bend allows where it matters."""
        c, n = self.config, len(led)
        key = (c.w_v, c.w_a, c.w_j, c.elastic, c.joint, c.reverse)
        deform, refine = (
            _feasibility(n, problem.limits, key, scale) for scale in (c.deform.feasible, c.refine.feasible)
        )
        cap = _bend_speed(problem, led)
        if (cap >= c.elastic * problem.limits.v_max).all():
            return (deform, refine), None
        upper = deform.upper.copy()
        upper[: n - 1, 0] = np.minimum(upper[: n - 1, 0], cap)
        return (replace(deform, upper=upper), replace(refine, upper=upper)), cap

    def _lbfgs(
        self, cost: Callable[[Array], tuple[float, Array]], y0: Array
    ) -> tuple[Array, float, int, bool]:
        from scipy.optimize import fmin_l_bfgs_b

        config = self.config
        y, value, info = fmin_l_bfgs_b(
            cost, y0, maxiter=config.max_iterations, pgtol=config.tolerance, factr=1e3, m=10, maxls=40
        )
        return y, float(value), int(info["nit"]), info["warnflag"] != 1

    # -- refinement ------------------------------------------------------------------------------

    def _refine(
        self,
        problem: RepairProblem,
        initial: UniformBSpline,
        deformed: _Minimum,
        feasibility: tuple[Feasibility, Feasibility],
        deadline: float | None,
    ) -> _Minimum:
        """Minimise J' from the deformed curve; both axes are coupled by the fitting term."""
        n, p = len(initial.points), self.degree
        if n <= 2 * p:
            return deformed
        terms = self._refinement_terms(deformed.points, 2 if problem.lateral else 1)
        # Where no limit is touched J' is quadratic and its minimiser is a closed form.
        move = -np.linalg.solve(terms.hessian, terms.slope)
        points = deformed.points.copy()
        points[p : n - p, : terms.axes] += move.reshape(terms.axes, -1).T
        if feasibility[1].evaluate(_stack(n, self.spacing) @ points)[1] is None:
            return _Minimum(points, terms.constant + 0.5 * float(terms.slope @ move), 0, True)
        cost = _RefineCost(
            deformed.points,
            terms,
            feasibility[1],
            _stack(n, self.spacing),
            p,
            self.config.precondition,
            deadline,
        )
        y, value, iterations, converged = self._lbfgs(cost, cost.origin)
        return _Minimum(cost.points(y), value, iterations, converged)

    def _refinement_terms(self, points: Array, axes: int) -> _RefineTerms:
        """lambda_s J_s + lambda_f J_f around the deformed control points (n, 2)."""
        config, p, n = self.config.refine, self.degree, len(points)
        free, m = slice(p, n - p), n - 2 * p
        hessian = _fitting_hessian(points, p, self.spacing, config.fit, axes)
        smooth = _smoothness(n, self.spacing, config.smooth)
        for k in range(axes):
            hessian[k * m : (k + 1) * m, k * m : (k + 1) * m] += smooth[free, free]
        # The fitting term vanishes at the deformed curve; only smoothness has a slope there.
        bent = smooth @ points
        return _RefineTerms(hessian, bent[free, :axes].T.ravel(), 0.5 * float(np.vdot(points, bent)), axes)


class _Cost:
    """J over the preconditioned coordinates y, flattened (m, axes); axes is 1 for s alone, else 2."""

    def __init__(
        self,
        base: Array,
        cached: _Quadratic,
        feasibility: Feasibility,
        axes: int,
        pairs: Pairs,
        collision: float,
        deadline: float | None,
    ) -> None:
        self.base, self.cached, self.axes, self.deadline = base, cached, axes, deadline
        self.feasibility = feasibility.columns(axes)
        self.w, self.stack_w, self.curvature = cached.w, cached.stack_w, cached.curvature
        self.derivatives = (cached.stack @ base)[:, :axes]
        # What stays constant: the smoothness of the base, and all of l where it may not move.
        self.constant = 0.5 * float(np.vdot(base, cached.hessian @ base))
        if axes == 1:
            resting = feasibility.columns(slice(1, 2)).evaluate((cached.stack @ base)[:, 1:])
            self.constant += resting[0]
        self.pairs, self.collision = pairs, collision
        # d = s_f - excess of every pair is affine in y: excess = offset - rows @ y.
        m = len(base) - cached.degree
        rows = np.zeros((len(pairs.row), m, axes))
        rows[np.arange(len(pairs.row)), :, pairs.axis] = (
            pairs.sign[:, None] * cached.w[pairs.row - cached.degree]
        )
        self.rows = rows.reshape(len(pairs.row), m * axes)
        self.offset = pairs.threshold - pairs.sign * (base[pairs.row, pairs.axis] - pairs.anchor)

    def points(self, y: Array) -> Array:
        """Control points (n, 2) at the coordinates y."""
        points = self.base.copy()
        points[self.cached.degree :, : self.axes] += self.w @ y.reshape(-1, self.axes)
        return points

    def coordinates(self, points: Array) -> Array:
        """The y of control points (n, 2) with the same fixed ones."""
        moved = (points - self.base)[self.cached.degree :, : self.axes]
        return (self.cached.w_inverse @ moved).ravel()

    def __call__(self, y: Array) -> tuple[float, Array]:
        if self.deadline is not None and time.perf_counter() > self.deadline:
            raise _OutOfTime
        moved = y.reshape(-1, self.axes)
        gradient = self.curvature @ moved
        value = self.constant + 0.5 * float(np.vdot(moved, gradient))
        penalty, slope = self.feasibility.evaluate(self.derivatives + self.stack_w @ moved)
        if slope is not None:
            value += penalty
            gradient += self.stack_w.T @ slope
        flat = gradient.ravel()
        if len(self.offset):
            cost, rate = cubic_quadratic(self.offset - self.rows @ y, self.pairs.threshold)
            value += self.collision * float(cost.sum())
            flat = flat - self.collision * (rate @ self.rows)
        return value, flat


class _RefineTerms(NamedTuple):
    """Quadratic part of J' in the free control points, axis by axis: c + g'x + x'Hx / 2."""

    hessian: Array
    slope: Array
    constant: float
    axes: int


class _RefineCost:
    """J' over preconditioned coordinates; ``origin`` is the minimiser of its quadratic part."""

    def __init__(
        self,
        deformed: Array,
        terms: _RefineTerms,
        feasibility: Feasibility,
        stack: Array,
        degree: int,
        precondition: bool,
        deadline: float | None,
    ) -> None:
        self.deformed, self.stack, self.feasibility = deformed, stack, feasibility
        self.constant, self.axes, self.deadline = terms.constant, terms.axes, deadline
        self.free = slice(degree, len(deformed) - degree)
        m, axes = len(deformed) - 2 * degree, terms.axes
        factor = np.linalg.cholesky(terms.hessian) if precondition else np.eye(axes * m)
        self.w = np.linalg.inv(factor).T
        self.slope = self.w.T @ terms.slope
        self.curvature = self.w.T @ terms.hessian @ self.w
        self.origin = -np.linalg.solve(self.curvature, self.slope)
        self.stack_w = np.einsum("rn,knx->krx", stack[:, self.free], self.w.reshape(axes, m, axes * m))
        self.base_derivatives = stack @ deformed

    def points(self, y: Array) -> Array:
        """Control points (n, 2) at the coordinates y."""
        points = self.deformed.copy()
        points[self.free, : self.axes] += (self.w @ y).reshape(self.axes, -1).T
        return points

    def __call__(self, y: Array) -> tuple[float, Array]:
        if self.deadline is not None and time.perf_counter() > self.deadline:
            raise _OutOfTime
        bent = self.curvature @ y
        gradient = self.slope + bent
        value = self.constant + float(y @ (self.slope + 0.5 * bent))
        derivatives = self.base_derivatives.copy()
        derivatives[:, : self.axes] += (self.stack_w @ y).T
        penalty, slope = self.feasibility.evaluate(derivatives)
        if slope is not None:
            value += penalty
            gradient = gradient + np.einsum("krx,rk->x", self.stack_w, slope[:, : self.axes])
        return value, gradient


@lru_cache(maxsize=64)
def _knot_basis(n: int, degree: int, spacing: float) -> tuple[Array, Array]:
    tau = np.arange(n - degree + 1) * spacing
    return frozen(basis_matrix(tau, n, degree, spacing)), frozen(basis_matrix(tau, n, degree, spacing, 1))


def _fitting_hessian(points: Array, degree: int, spacing: float, weight: float, axes: int) -> Array:
    """Hessian (axes m, axes m) of lambda_f J_f in the m free control points, around the deformed curve.

    J_f sums over the knots the displacement from the deformed curve, split along its direction of
    travel (axial, divided by 5) and across it: d_a**2 / 25 + d_r**2 (EGO-Planner, eq. 12-13).
    """
    basis, rate = _knot_basis(len(points), degree, spacing)
    velocity = rate @ points
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    # A standing curve has no direction of its own; the lane's is taken.
    moving = speed > 1e-3
    along_s = np.where(moving, velocity[:, 0] / np.where(moving, speed, 1.0), 1.0)
    along_l = np.where(moving, velocity[:, 1] / np.where(moving, speed, 1.0), 0.0)
    free = basis[:, degree : len(points) - degree]
    scaled = 2.0 * weight * free.T
    ss = (scaled * (along_s**2 / 25.0 + along_l**2)) @ free
    if axes == 1:
        return np.asarray(ss)
    ll = (scaled * (along_l**2 / 25.0 + along_s**2)) @ free
    sl = (scaled * (along_s * along_l * (1.0 / 25.0 - 1.0))) @ free
    return np.block([[ss, sl], [sl, ll]])


def make(config: Config) -> EgoBackend:
    """The backend as the configuration describes it."""
    return EgoBackend(config.ego, degree=config.repair.degree, spacing=config.repair.spacing)
