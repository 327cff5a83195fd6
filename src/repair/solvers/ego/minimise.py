"""Minimisers of a :class:`repair.solvers.ego.spline_cost.SplineCost`: Newton steps, or L-BFGS.

The cost is convex and has one minimum; which way leads there is a matter of speed.

Source: Nocedal and Wright, *Numerical Optimization*, 2nd edition 2006, chapters 3 and 7; L-BFGS
is the paper's.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg.lapack import dpbtrf, dpbtrs, dtbtrs

from repair.arrays import Array
from repair.deadline import OutOfTime
from repair.solvers.ego.settings import EgoConfig
from repair.solvers.ego.spline_cost import SplineCost

__all__ = ["Minimiser", "Minimum", "lbfgs", "minimiser", "newton"]

_SUFFICIENT = 1e-4  # share of the promised decrease that a step must bring (Armijo)
_SHORTEST = 1e-9


class Minimum(NamedTuple):
    """Control points (n, axes), their cost, how many iterations it took, and whether they sufficed."""

    points: Array
    cost: float
    iterations: int
    converged: bool


class Minimiser(Protocol):
    """A way to the minimum of a cost."""

    def __call__(
        self, cost: SplineCost, deadline: float | None, *, near_closed_form: bool = False
    ) -> Minimum:
        """Minimise; see :func:`newton`."""
        ...


def minimiser(config: EgoConfig) -> Minimiser:
    """The way that ``config.solver`` names, with its number of iterations and its tolerance."""

    def by_newton(cost: SplineCost, deadline: float | None, *, near_closed_form: bool = False) -> Minimum:
        limit, tolerance = config.max_iterations, config.tolerance
        return newton(cost, limit, tolerance, deadline, near_closed_form=near_closed_form)

    def by_lbfgs(cost: SplineCost, deadline: float | None, *, near_closed_form: bool = False) -> Minimum:
        limit, tolerance = config.max_iterations, config.tolerance
        return lbfgs(cost, limit, tolerance, deadline, precondition=config.precondition)

    return by_newton if config.solver == "newton" else by_lbfgs


def _in_time(deadline: float | None) -> None:
    if deadline is not None and time.perf_counter() > deadline:
        raise OutOfTime


def newton(
    cost: SplineCost,
    limit: int,
    tolerance: float,
    deadline: float | None = None,
    *,
    near_closed_form: bool = False,
) -> Minimum:
    """Newton's method with a backtracking line search (Boyd and Vandenberghe, *Convex Optimization*, 9.5).

    Parameters
    ----------
    cost : SplineCost
    limit : int
        Largest number of iterations.
    tolerance : float
        On the Newton decrement, which is the gradient's norm where the Hessian is made round; taken
        after a step with the Hessian from before it.
    deadline : float, optional
        Of :func:`time.perf_counter` [s].
    near_closed_form : bool
        Begin at the minimum of the quadratic part, and not at u = 0; without active penalties that is all.

    Raises
    ------
    OutOfTime
        If the deadline passes before.
    """
    u, here = np.zeros(cost.size), None
    if near_closed_form and (found := cost.closed_form()) is not None:
        u, here = found, cost(found)
        if not np.count_nonzero(here.curvature):
            return Minimum(cost.points(u), here.value, 1, True)
    here = here or cost(u)
    for iteration in range(1, limit + 1):
        _in_time(deadline)
        factor, failed = _factored(cost.hessian(here))
        if failed or not math.isfinite(here.value):
            return Minimum(cost.points(u), here.value, iteration - 1, False)
        step = dpbtrs(factor, here.gradient, lower=1)[0]
        descent = float(step.dot(here.gradient))
        if descent <= tolerance * tolerance:  # it began at the minimum
            return Minimum(cost.points(u), here.value, iteration, True)
        share = 1.0
        moved = u - step
        there = cost(moved)
        while not there.value <= here.value - _SUFFICIENT * share * descent:
            share *= 0.5
            if share < _SHORTEST:  # rounding leaves no better point than this one
                return Minimum(cost.points(u), here.value, iteration, False)
            moved = u - share * step
            there = cost(moved)
        u, here = moved, there
        if float(dpbtrs(factor, here.gradient, lower=1)[0].dot(here.gradient)) <= tolerance * tolerance:
            return Minimum(cost.points(u), here.value, iteration, True)
    return Minimum(cost.points(u), here.value, limit, False)


def _factored(band: Array) -> tuple[Array, int]:
    """Cholesky factor of a band, and whether there is none.

    Without a weight on smoothness some directions cost nothing; a whisper of it keeps them where they are.
    """
    factor, failed = dpbtrf(band, lower=1)
    if failed:
        band = np.array(band)
        band[0] += 1e-9 * max(float(np.abs(band[0]).max()), 1e-9)
        factor, failed = dpbtrf(band, lower=1)
    return factor, failed


def lbfgs(
    cost: SplineCost,
    limit: int,
    tolerance: float,
    deadline: float | None = None,
    *,
    precondition: bool = True,
) -> Minimum:
    """L-BFGS (SciPy), in coordinates y in which the quadratic part of the cost is the identity.

    With H = L L' of that part, u = L'^-1 y; this changes the path and not the goal.

    Parameters
    ----------
    cost : SplineCost
    limit : int
        Largest number of iterations.
    tolerance : float
        On the largest entry of the gradient by y (by u without ``precondition``).
    deadline : float, optional
        Of :func:`time.perf_counter` [s].
    precondition : bool
        Take these coordinates.

    Raises
    ------
    OutOfTime
        If the deadline passes before.
    """
    from scipy.optimize import fmin_l_bfgs_b

    factor, failed = _factored(cost.quadratic()) if precondition else (None, 1)
    if failed:
        factor = None

    def moved(y: Array) -> Array:
        return y if factor is None else dtbtrs(factor, y[:, None], uplo="L", trans="T")[0][:, 0]

    def evaluate(y: Array) -> tuple[float, Array]:
        _in_time(deadline)
        value, gradient, *_ = cost(moved(y))
        if factor is not None:
            gradient = dtbtrs(factor, gradient[:, None], uplo="L", trans="N")[0][:, 0]
        return value, gradient

    y, value, info = fmin_l_bfgs_b(
        evaluate, np.zeros(cost.size), maxiter=limit, pgtol=tolerance, factr=1e3, m=10, maxls=40
    )
    return Minimum(cost.points(moved(y)), float(value), int(info["nit"]), info["warnflag"] == 0)
