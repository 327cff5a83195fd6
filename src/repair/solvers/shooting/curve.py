"""A driven trajectory as a curve: quintic pieces with its states at the ends of the steps."""

from __future__ import annotations

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.bernstein import BernsteinCurve
from repair.problem.problem import RepairProblem
from repair.solvers.shooting.motion import Car, Driven, halved

__all__ = ["curve_along", "curve_of"]


def curve_of(problem: RepairProblem, driven: Driven, car: Car) -> BernsteinCurve:
    """The first of the trajectories; its acceleration jumps where the controls do.

    Parameters
    ----------
    problem : RepairProblem
    driven : Driven
    car : Car
        That drove them, in two parts to a step.
    """
    s, l, v, chi, beta, a, rate, along, aside = (column[0] for column in halved(car, driven))  # noqa: E741
    frame = problem.shapes.frame if problem.shapes is not None else None
    kappa = frame.curvature(s) if frame is not None else problem.curvature_at(s)
    change = frame.curvature_rate(s) if frame is not None else np.zeros_like(s)
    scale = 1.0 - kappa * l
    turn = v * np.sin(beta) / car.vehicle.rear - kappa * along

    def bends(k: slice) -> Array:
        """Second derivatives at one end of the steps, of the controls within them."""
        chi_rate = turn[k] + rate
        cos, sin = np.cos(chi[k]), np.sin(chi[k])
        scale_rate = -change[k] * along[k] * l[k] - kappa[k] * aside[k]
        forward = (a * cos - v[k] * sin * chi_rate - along[k] * scale_rate) / scale[k]
        return np.array((forward, a * sin + v[k] * cos * chi_rate))

    first, last = bends(slice(None, -1)), bends(slice(1, None))
    return _quintics(problem, np.array((s, l)), np.array((along, aside)), first, last, 0.5 * car.dt)


def curve_along(problem: RepairProblem, driven: Driven, car: Car) -> BernsteinCurve:
    """The first of the trajectories, which keep to the path of the reference, at its offset then."""
    s, v, a = driven.s[0], driven.v[0], driven.a[0]
    times = problem.t_rep + car.dt * np.arange(len(s))
    path = problem.reference.sample(times)
    l, rate, bend = path.position[:, 1], path.velocity[:, 1], path.acceleration[:, 1]  # noqa: E741
    first, last = np.array((a, bend[:-1])), np.array((a, bend[1:]))
    return _quintics(problem, np.array((s, l)), np.array((v, rate)), first, last, car.dt)


def _quintics(
    problem: RepairProblem, place: Array, speed: Array, first: Array, last: Array, h: float
) -> BernsteinCurve:
    """Pieces of ``h`` seconds with places and speeds (2, T + 1), and second derivatives (2, T) at both ends.

    The control points of a quintic are its ends, and what its derivatives there move them by.
    """
    begin, end = place[:, :-1], place[:, 1:]
    v0, v1 = speed[:, :-1], speed[:, 1:]
    points = np.array(
        (
            begin,
            begin + h / 5.0 * v0,
            begin + 2.0 * h / 5.0 * v0 + h * h / 20.0 * first,
            end - 2.0 * h / 5.0 * v1 + h * h / 20.0 * last,
            end - h / 5.0 * v1,
            end,
        )
    )
    return BernsteinCurve(problem.t_rep, h, frozen(points.transpose(2, 0, 1)))
