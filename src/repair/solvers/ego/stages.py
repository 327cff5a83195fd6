"""The two stages: deformation (paper, Sec. IV-C) and refinement (Sec. IV-D), each a cost and its minimum."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from repair.arrays import Array
from repair.curves.bspline import UniformBSpline
from repair.problem.problem import RepairProblem
from repair.solvers.ego.bounds import bend_speed, feasibility, slowest_bend, with_pairs
from repair.solvers.ego.cost_structure import SIZES, Sizes
from repair.solvers.ego.fitting_term import fitting_band
from repair.solvers.ego.minimise import Minimiser, Minimum, minimiser
from repair.solvers.ego.pairs import Pairs, anchor_pairs, pushes
from repair.solvers.ego.penalties import SoftBounds
from repair.solvers.ego.settings import DeformWeights, EgoConfig, RefineWeights
from repair.solvers.ego.spline_cost import SplineCost, resting_cost

__all__ = ["Deformed", "Stages"]


class Deformed(NamedTuple):
    """What the deformation leaves.

    Attributes
    ----------
    minimum : Minimum
    pairs : Pairs
        The {p, v} pairs it was made with.
    cap : (n - 1,) array or None
        The speeds that the bends allowed; None where they did not matter.
    rounds : int
        How often J was minimised.
    """

    minimum: Minimum
    pairs: Pairs
    cap: Array | None
    rounds: int


class Stages:
    """The stages of one configuration.

    Parameters
    ----------
    config : EgoConfig
    degree : int
        Degree of the B-spline.
    minimise : Minimiser, optional
        How the costs are minimised; as ``config.solver`` says where it is not given.
    sizes : Sizes
        Up to which sizes a cost takes the forms for small problems.
    """

    def __init__(
        self,
        config: EgoConfig,
        degree: int,
        minimise: Minimiser | None = None,
        sizes: Sizes = SIZES,
    ) -> None:
        self.config, self.degree, self.sizes = config, degree, sizes
        self.minimise = minimiser(config) if minimise is None else minimise
        c = config
        self._penalties = (c.w_v, c.w_a, c.w_j, c.elastic, c.joint, c.reverse)
        self._rest: tuple[Array, tuple[Any, ...], float] | None = None

    def deform(self, problem: RepairProblem, initial: UniformBSpline, deadline: float | None) -> Deformed:
        """Minimise J; while control points still collide, double lambda_c and start again.

        It is doubled as often at once as the deepest collision takes at least.

        Parameters
        ----------
        problem : RepairProblem
        initial : UniformBSpline
            The reference from t_rep on; the curve keeps its first points.
        deadline : float or None
            Of :func:`time.perf_counter` [s].

        Raises
        ------
        repair.deadline.OutOfTime
            If the deadline passes before.
        """
        config = self.config
        collision = config.deform.collision
        greville, spacing = initial.greville, initial.spacing
        shape = _led_points(problem, initial, greville)
        pairs = anchor_pairs(problem, greville, shape, self.degree)
        minimum = Minimum(initial.points, np.inf, 0, False)
        moved = pairs if problem.lateral else pairs.along(0)
        resting = self._resting(problem, initial.points, spacing, config.deform)
        led = shape
        straight = slowest_bend(problem) >= config.elastic * problem.limits.v_max
        left, rounds, cost = config.rebounds, 0, None
        while True:
            rounds += 1
            cap = None if straight else self._cap(problem, led)
            cost = self._deforming(problem, minimum.points, spacing, moved, collision, cap, resting, cost)
            minimum = self._whole(cost, minimum.points, deadline)
            led = minimum.points
            doublings = min(pushes(pairs, led), left) if left else 0
            # The speed limit of a bend was taken where the guide is; see whether it holds here.
            fits = not doublings and (cap is None or _slow_enough(problem, led, spacing))
            if fits or rounds > config.rebounds:
                break
            collision *= 2.0**doublings
            left -= doublings
        return Deformed(minimum, pairs, cap, rounds)

    def refine(
        self,
        problem: RepairProblem,
        deformed: Minimum,
        spacing: float,
        cap: Array | None,
        deadline: float | None,
    ) -> Minimum:
        """Minimise J' from the deformed curve; both axes are coupled by the fitting term.

        Parameters
        ----------
        problem : RepairProblem
        deformed : Minimum
            Of the deformation; its first and last points are kept.
        spacing : float
            Of its knots [s].
        cap : (n - 1,) array or None
            The speeds that its bends allowed.
        deadline : float or None
            Of :func:`time.perf_counter` [s].

        Raises
        ------
        repair.deadline.OutOfTime
            If the deadline passes before.
        """
        weights, points, p = self.config.refine, deformed.points, self.degree
        n, axes = len(points), 2 if problem.lateral else 1
        if n <= 2 * p:
            return deformed
        cost = SplineCost(
            points[:, :axes], p, n - p, spacing, weights.smooth,
            self._bounds(problem, n, weights.feasible, cap),
            fit=fitting_band(points, p, spacing, weights.fit, axes),
            constant=self._resting(problem, points, spacing, weights), sizes=self.sizes,
        )  # fmt: skip
        return self._whole(cost, points, deadline, near_closed_form=True)

    def _deforming(
        self,
        problem: RepairProblem,
        start: Array,
        spacing: float,
        pairs: Pairs,
        collision: float,
        cap: Array | None,
        resting: float,
        last: SplineCost | None,
    ) -> SplineCost:
        """J with some lambda_c; ``last`` is that of the round before."""
        weights, n = self.config.deform, len(start)
        axes = 2 if problem.lateral else 1
        bounds = with_pairs(self._bounds(problem, n, weights.feasible, cap), pairs, collision)
        if last is not None:
            return last.again(start[:, :axes], bounds)
        return SplineCost(
            start[:, :axes], self.degree, n, spacing, weights.smooth, bounds,
            pairs.row * axes + pairs.axis, -pairs.sign,
            constant=resting, sizes=self.sizes,
        )  # fmt: skip

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
        self, problem: RepairProblem, points: Array, spacing: float, weights: DeformWeights | RefineWeights
    ) -> float:
        """What l costs where it may not move: a constant."""
        if problem.lateral or not np.count_nonzero(points[:, 1]):
            return 0.0
        key = problem.limits, spacing, weights.smooth, weights.feasible
        known = self._rest  # a search asks for the same again and again
        if known is None or known[1] != key or not np.array_equal(known[0], points[:, 1]):
            bounds = feasibility(len(points), problem.limits, self._penalties, weights.feasible, (1,))
            cost = resting_cost(points[:, 1:], spacing, weights.smooth, bounds, self.sizes)
            known = self._rest = points[:, 1].copy(), key, cost
        return known[2]

    def _whole(
        self, cost: SplineCost, start: Array, deadline: float | None, near_closed_form: bool = False
    ) -> Minimum:
        """The minimum with both axes; what the cost does not know of stays as in ``start``."""
        minimum = self.minimise(cost, deadline, near_closed_form=near_closed_form)
        axes = minimum.points.shape[1]
        if axes == start.shape[1]:
            return minimum
        points = start.copy()
        points[:, :axes] = minimum.points
        return Minimum(points, minimum.cost, minimum.iterations, minimum.converged)


def _slow_enough(problem: RepairProblem, points: Array, spacing: float) -> bool:
    allowed = 1.02 * spacing * bend_speed(problem, points)
    return bool((points[1:, 0] - points[:-1, 0] <= allowed).all())


def _led_points(problem: RepairProblem, initial: UniformBSpline, times: Array) -> Array:
    """Where the guide leads the control points (the reference where there is no guide)."""
    if problem.passing is None:
        return initial.points
    guide = problem.passing.guide
    # Both axes at once, as the parts of complex numbers.
    position = np.ascontiguousarray(guide.position).view(np.complex128)[:, 0]
    led = np.interp(times, guide.t, position).view(np.float64).reshape(-1, 2)
    led[: initial.degree] = initial.points[: initial.degree]
    return led
