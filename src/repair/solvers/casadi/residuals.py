"""What a curve violates, recomputed with NumPy from its control points and the problem alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import BackendError
from repair.problem.problem import RepairProblem
from repair.solvers.casadi.instance import Instance
from repair.solvers.casadi.model import TOLERANCE
from repair.solvers.casadi.nlp import axis_curvature, body, in_plane, plane_acceleration
from repair.solvers.casadi.rows import FAMILIES, RowKind
from repair.solvers.casadi.separation import Separation, road_room
from repair.timegrid import INSTANT

__all__ = ["largest_violation", "require_whole", "residuals_of", "start_violation", "worst_family"]


def residuals_of(instance: Instance, separation: Separation, points: Array) -> dict[str, float]:
    """Largest violation of every family of constraints, from the control points and the problem alone.

    Parameters
    ----------
    instance : Instance
    separation : Separation
        Its sides of passing.
    points : (n, 2) array
        Control points less the origin.
    """
    model, problem, first = instance.model, instance.problem, instance.model.family_start
    place, samples = first[-2:]
    value = model.evaluated @ points
    placed = value[place:samples] + instance.origin
    states = value[samples:].reshape(3, -1, 2)
    states[0] += instance.origin
    (low, high), moving = instance.row_limits, value[:place]
    derivatives = np.maximum.reduceat(np.maximum(low - moving, moving - high), first[:-2])
    depth = np.maximum(separation.lower - placed, placed - separation.upper).max(axis=0)
    axes = model.structure.axes
    worst = [*derivatives[:, :axes].max(axis=1).tolist(), float(depth[:axes].max())]
    # What is not a number stays one: max() keeps its first argument then.
    found = {family: max(x, 0.0) for family, x in zip(FAMILIES, worst, strict=True)}
    if problem.lateral:
        v = value[: first[1]]
        found["heading"] = max(float((np.abs(v[:, 1]) - model.structure.tangent * v[:, 0]).max()), 0.0)
        found["road"] = _road_violation(instance, placed)
    if instance.within is not None:
        ends = next(rows.matrix for rows in model.linear if rows.kind == RowKind.STOP) @ points[:, 0]
        found["ending"] = _excess((ends + instance.origin[0] - instance.within).max())
    return found | _plane_violations(instance, states)


def _plane_violations(instance: Instance, states: Array) -> dict[str, float]:
    """Accelerations and curvature at the ends of the windows, with the axis' true curvature."""
    problem, limits = instance.problem, instance.problem.limits
    kappa, slope = axis_curvature(problem, states[0, :, 0])
    along, across = in_plane(kappa, slope, states)
    found = {
        "friction": _excess(np.hypot(along, across).max() - limits.a_total),
        "lateral_acceleration": _excess(np.abs(across).max() - limits.a_lat),
    }
    if problem.lateral:
        found["longitudinal_acceleration"] = max(
            0.0, float(along.max()) - limits.a_max, limits.a_min - float(along.min())
        )
        bend, *places = body(kappa, states, along, across, instance.model.structure.overhang)
        found["curvature"] = _excess(np.abs(bend).max() - limits.curvature)
        ends = np.concatenate(places)
        right, left = instance.room_of_ends(states[0, :, 0], 0.0, 0.0)
        found["body_on_road"] = _excess((right - ends).max(), (ends - left).max())
    return found


def _road_violation(instance: Instance, placed: Array) -> float:
    """How far the points of l leave the road anywhere over the s that their window covers."""
    problem, row = instance.problem, instance.windows.row
    if not len(row):
        return 0.0
    s, l = placed[:, 0][row], placed[:, 1][row]  # noqa: E741
    own = problem.start[0, 1]
    right, left = road_room(problem.bounds, s.min(axis=1), s.max(axis=1), own, own, 0.0)
    return _excess((right - l.min(axis=1)).max(), (l.max(axis=1) - left).max())


def _excess(*values: Any) -> float:
    """The largest of 0 and these numbers; NaN if one of them is (the built-in ``max`` may lose it)."""
    return float(np.maximum.reduce((0.0, *values)))


def require_whole(problem: RepairProblem) -> None:
    """See that a problem is one.

    Raises
    ------
    BackendError
        If no time is left between t_rep and t_end, or the start is not finite.
    """
    if not problem.t_end - problem.t_rep > INSTANT:
        raise BackendError(f"the repair ends at {problem.t_end:g} s, before it begins at {problem.t_rep:g} s")
    if not np.isfinite(problem.start).all():
        raise BackendError(f"the state at t_rep = {problem.t_rep:g} s is not finite")


def start_violation(problem: RepairProblem) -> str:
    """The first limit that the given state itself breaks, as a sentence; empty where it keeps all."""
    limits = problem.limits
    v, a = (float(x) for x in problem.start[1:, 0])
    along, across = plane_acceleration(problem, problem.start[None])
    total = float(np.hypot(along, across)[0])
    if v < -TOLERANCE:
        return f"the start speed {v:.2f} m/s is below 0"
    if v > limits.v_max + TOLERANCE:
        return f"the start speed {v:.2f} m/s is above v_max {limits.v_max:.2f} m/s"
    if a < limits.a_min - TOLERANCE:
        return f"the start acceleration {a:.2f} m/s² is below a_min {limits.a_min:.2f} m/s²"
    if a > limits.a_max + TOLERANCE:
        return f"the start acceleration {a:.2f} m/s² is above a_max {limits.a_max:.2f} m/s²"
    if total > limits.a_total + TOLERANCE:
        circle = f"the friction circle of {limits.a_total:.2f} m/s²"
        return f"the start acceleration {total:.2f} m/s² is outside {circle}"
    return ""


def largest_violation(residuals: dict[str, float]) -> float:
    """The largest violation; NaN if one of them is."""
    return float(np.maximum.reduce(tuple(residuals.values())))


def worst_family(residuals: dict[str, float]) -> str:
    """The family that is violated by the most, as a sentence."""
    family = max(residuals, key=lambda k: residuals[k])
    return f"{family} is violated by {residuals[family]:.2g}"
