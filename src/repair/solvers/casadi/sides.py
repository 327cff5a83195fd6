"""On which sides of the obstacles the curve may pass: the sides for which the linear rows have a solution."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.curves.base import Curve
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.deadline import in_time
from repair.problem.problem import SIDE_AXIS, SIDE_SIGN, RepairProblem
from repair.solvers.casadi.instance import Instance, guide_of, lay_out
from repair.solvers.casadi.model import Model
from repair.solvers.casadi.residuals import residuals_of
from repair.solvers.casadi.separation import SIDE_OF_BOUND, Separation, separate, sides_near

__all__ = ["Opening", "keeping_to", "no_nearer", "open_sides"]

_SIDES = 4  # sets of sides that are tried
_GIVEN = 1e-3  # [m] of a margin that is given up beyond what a curve gives up, for what is to stay near it


class Opening(NamedTuple):
    """What was found for some sides of passing.

    Attributes
    ----------
    separation : Separation
        The last sides that were tried.
    points : (n, 2) array
        Control points less the origin: the optimum of the linear rows, where they have one.
    why : str
        Why there is none; empty where there is.
    closest : (points, residuals) or None
        The curve that keeps all rows but the obstacles' and misses those by the least, and what it
        violates; None where none was looked for.
    """

    separation: Separation
    points: Array
    why: str
    closest: tuple[Array, dict[str, float]] | None


def open_sides(instance: Instance, points: Array) -> Opening:
    """Sides of passing for which the linear rows have a solution, that solution, or why there is none.

    The guide's sides come first. Where they contradict the limits, the curve that misses the
    obstacles by the least is asked for its sides instead, and so on.

    Parameters
    ----------
    instance : Instance
        Its ``relaxed`` is set where there is a solution.
    points : (n, 2) array
        Control points to begin with, less the origin.

    Raises
    ------
    repair.deadline.OutOfTime
        If the deadline passes before.
    """
    model, problem, windows, boxes = instance.model, instance.problem, instance.windows, instance.boxes
    slope = instance.slope
    moment = windows.moment
    shape = guide_of(problem).sample(moment.ravel()).position.reshape(*moment.shape, 2)
    if not problem.lateral:
        shape[..., 1] = (model.obstacle @ points)[windows.row, 1]
    room = instance.room(shape)
    why, before = "", None
    closest: tuple[Array, dict[str, float]] | None = None
    for _ in range(_SIDES):
        in_time()
        side = None if before is None or boxes is None else sides_near(problem, boxes, shape)
        if side is not None and np.array_equal(side, before):
            break
        separation = separate(problem, windows, len(model.obstacle), shape, room, side, boxes)
        if separation.why:
            return Opening(separation, points, separation.why, closest)
        before = separation.side
        gap = _gap_in(separation)
        why = why or gap
        low, high = instance.bounds(separation, None)
        x, possible = (None, False) if gap else model.presolve(model.unknowns(points), slope, low, high)
        if x is not None:
            points = instance.relaxed = instance.on_path(model.with_unknowns(points, x))
        if possible:
            return Opening(separation, points, "", closest)
        modest = instance.bounds(separation, None, modest=True)
        elastic = model.elastic(slope, *modest) or model.elastic(slope, low, high)
        if elastic is None:
            why = why or "no curve from the start state keeps the limits and the road"
            return Opening(separation, points, why, closest)
        points = instance.on_path(model.with_unknowns(points, elastic[0]))
        miss = float(elastic[1]) + separation.lent  # of the margin, not of what is asked of who starts nearer
        if closest is None or miss < closest[1]["obstacles"]:
            closest = points, residuals_of(instance, separation, points) | {"obstacles": miss}
        why = why or _missed(instance, separation, points, elastic[1])
        shape = instance.shape(points)
        room = instance.room(shape)
    return Opening(separation, points, why, closest)


def keeping_to(problem: RepairProblem, model: Model, curve: Curve) -> tuple[Instance, Separation, Array]:
    """A problem with the sides of a curve, and of its margin only what that curve keeps.

    Returns
    -------
    instance : Instance
    separation : Separation
    points : (n, 2) array
        The curve's control points, less the origin.
    """
    instance, separation, points = _around(problem, model, curve)
    if instance.boxes is not None and len(instance.boxes.start):
        # As far as the start is inside of an obstacle, on the side on which it is the least.
        inside = float(np.nan_to_num(instance.boxes.start, nan=np.inf).max(axis=1).min())
        if inside < min(problem.margin, 0.0):
            instance, separation, points = _around(replace(problem, margin=inside), model, curve)
    missed = 0.0 if separation.why else residuals_of(instance, separation, points)["obstacles"]
    if missed > 0.0:
        less = replace(problem, margin=instance.problem.margin - missed - _GIVEN)
        instance, separation, points = _around(less, model, curve, separation.side)
    return instance, separation, points


def no_nearer(instance: Instance, separation: Separation, points: Array) -> Separation:
    """The same sides, with nobody to be passed nearer than a curve of these control points passes them."""
    if separation.claims is None:
        return separation
    asked = np.isfinite(separation.claims.max(axis=1)).swapaxes(0, 1)  # (W, C, 4)
    table = np.zeros((len(separation.lower), asked.shape[-1]), dtype=np.bool_)
    np.logical_or.at(table, separation.windows.row, asked)
    place = instance.model.obstacle @ points + instance.origin
    lower, upper = separation.lower.copy(), separation.upper.copy()
    for side, axis in enumerate(SIDE_AXIS.tolist()):
        rows = table[:, side]
        if SIDE_SIGN[side] > 0.0:
            lower[rows, axis] = np.maximum(lower[rows, axis], place[rows, axis] - _GIVEN)
        else:
            upper[rows, axis] = np.minimum(upper[rows, axis], place[rows, axis] + _GIVEN)
    return replace(separation, lower=lower, upper=upper)


def _around(
    problem: RepairProblem, model: Model, curve: Curve, side: npt.NDArray[np.intp] | None = None
) -> tuple[Instance, Separation, Array]:
    n, p, h = model.structure.n, model.structure.degree, model.structure.spacing
    instance, points = lay_out(problem, model, aside=True)
    fit = fit_to_curve(curve, problem.t_rep, n, p, h)
    if isinstance(curve, UniformBSpline) and (len(curve.points), curve.degree, curve.spacing) == (n, p, h):
        fit = curve
    points[p:] = fit.points[p:] - instance.origin
    shape = instance.shape(points)
    room, rows = instance.room(shape), len(model.obstacle)
    separation = separate(problem, instance.windows, rows, shape, room, side, instance.boxes)
    return instance, separation, points


def _missed(instance: Instance, separation: Separation, points: Array, miss: float) -> str:
    """The obstacle that is missed by the most, as a sentence."""
    position = instance.model.obstacle @ points + instance.origin
    depth = np.array((separation.lower - position, position - separation.upper))
    row = int(np.argmax(np.max(depth, axis=(0, 2)) > 0.99 * miss - 1e-6))
    end, axis = np.unravel_index(int(np.argmax(depth[:, row])), (2, 2))
    side = SIDE_OF_BOUND[int(axis)][int(end)]
    return (
        f"passing as the guide does, every curve within the limits comes at least {miss:.2f} m too close to "
        f"{separation.who(row, side)} (t = {separation.times[row]:.2f} s)"
    )


def _gap_in(separation: Separation) -> str:
    """The first place where the bounds leave nothing, as a sentence; empty where there is none."""
    closed = separation.lower > separation.upper + 2e-7
    if not closed.any():
        return ""
    row, axis = (int(i[0]) for i in np.nonzero(closed))
    below, above = (separation.who(row, side) for side in SIDE_OF_BOUND[axis])
    who = f"{below} and {above} leave" if below != above else f"{below} alone leaves"
    return f"{who} no gap at t = {separation.times[row]:.2f} s"
