"""One repair problem laid out for its NLP: bounds, data, objective, and what a solution violates."""

from __future__ import annotations

import numpy as np

from repair.solvers.nlp_model import SAMPLED, STANDSTILL, Model
from repair.solvers.separation import Separation, Windows, road_room
from repair.types import Array, RepairProblem

__all__ = ["ROAD_SLACK", "TOLERANCE", "Instance", "plane_acceleration"]

TOLERANCE = 1e-6  # largest violation of a curve that is called solved
ROAD_SLACK = 0.5  # [m] of s either way of the last path over which the road must be wide enough
_TIGHTEN = 1e-7  # bounds are taken in by this much, so that the solver's own tolerance stays inside
_FRICTION = 0.995  # share of the friction circle used at the samples, for what happens in between
_EDGE = 0.05  # [m] kept from the edge of the road
_OWN = 0.05  # [m] by which the body's ends may always leave the axis' own
_INF = np.inf


def axis_curvature(problem: RepairProblem, s: Array) -> tuple[Array, Array]:
    """Curvature of the axis and its slope over s (K,)."""
    kappa = problem.curvature_at(s)
    step = 0.25
    slope = (problem.curvature_at(s + step) - problem.curvature_at(s - step)) / (2.0 * step)
    return kappa, slope


def plane_acceleration(problem: RepairProblem, states: Array) -> tuple[Array, Array]:
    """Acceleration along and across the axis (K,) of states (K, 3, 2)."""
    (s, l), (v, w), (a, b) = states[:, 0].T, states[:, 1].T, states[:, 2].T  # noqa: E741
    kappa, slope = axis_curvature(problem, s)
    scale = 1.0 - kappa * l
    return scale * a - 2.0 * kappa * v * w - slope * l * v**2, b + scale * kappa * v**2


class Instance:
    """A problem and its model; s is counted from the start of the repair.

    Parameters
    ----------
    problem : RepairProblem
    model : Model
    origin : (2,) array
        What is taken off the positions: s at the start, and 0.
    head : (p, 2) array
        The given control points, less the origin.
    """

    def __init__(self, problem: RepairProblem, model: Model, origin: Array, head: Array) -> None:
        self.problem, self.model, self.origin, self.head = problem, model, origin, head
        self.windows = self._windows()
        self.lower, self.upper = self._limit_bounds()

    def shape(self, points: Array) -> Array:
        """Points (W, C, 2) of all windows, for control points (n, 2) less the origin."""
        return np.asarray((self.model.obstacle @ points)[self.windows.row] + self.origin)

    def _windows(self) -> Windows:
        """The windows that begin before the end of the repair."""
        problem, structure = self.problem, self.model.structure
        p, h = structure.degree, structure.spacing
        if structure.sampled:
            times = problem.t_rep + (np.arange(p, structure.n) - (p - 1) / 2) * h
            keep = np.flatnonzero(times <= problem.t_end + 1e-9)
            return Windows(times[keep], times[keep], keep[:, None], np.zeros(1))
        count = structure.segments * structure.windows
        edges = problem.t_rep + np.arange(count + 1) * (h / structure.windows)
        keep = np.flatnonzero(edges[:-1] < problem.t_end - 1e-9)
        row = keep[:, None] * p + np.arange(p + 1)
        return Windows(edges[keep], edges[keep + 1], row, np.arange(p + 1) / p)

    def _limit_bounds(self) -> tuple[list[Array], list[Array]]:
        """Bounds of the derivative rows; those of the position rows are filled in later."""
        model, problem, limits = self.model, self.problem, self.problem.limits
        low = {
            ("velocity", 0): 0.0, ("velocity", 1): -limits.v_lat,
            ("acceleration", 0): limits.a_min, ("acceleration", 1): -limits.a_lat,
            ("jerk", 0): -limits.j_lon, ("jerk", 1): -limits.j_lat,
        }  # fmt: skip
        high = {
            ("velocity", 0): limits.v_max, ("velocity", 1): limits.v_lat,
            ("acceleration", 0): limits.a_max, ("acceleration", 1): limits.a_lat,
            ("jerk", 0): limits.j_lon, ("jerk", 1): limits.j_lat,
        }  # fmt: skip
        lower, upper = [], []
        for rows in model.linear:
            key = (rows.family, rows.axis)
            lower.append(np.full(len(rows.matrix), low.get(key, -_INF)))
            upper.append(np.full(len(rows.matrix), high.get(key, _INF)))
        count = len(model.tau)
        total = (_FRICTION * limits.a_total) ** 2
        across = limits.a_lat if limits.a_lat < limits.a_total - 1e-9 else _INF
        lower += [np.full(count, -_INF), np.full(count, -across)]
        upper += [np.full(count, total), np.full(count, across)]
        if problem.lateral:
            lower += [np.full(count, limits.a_min), np.full(count, -limits.curvature)]
            upper += [np.full(count, limits.a_max), np.full(count, limits.curvature)]
        return lower, upper

    def bounds(
        self, separation: Separation, around: Array, trust: float | None = None, modest: bool = False
    ) -> tuple[Array, Array]:
        """Bounds of all rows of the model, taken in by the solver's own tolerance.

        ``around`` are control points nearby; with ``trust`` [m] s stays that close to their curve.
        ``modest`` keeps the accelerations inside the share of the friction circle that the nonlinear
        rows use, for a solution that is sought without those rows.
        """
        model = self.model
        lower, upper = list(self.lower), list(self.upper)
        for k, rows in enumerate(model.linear):
            if rows.family == "obstacles":
                shift = self.origin[rows.axis]
                lower[k] = separation.lower[:, rows.axis] - shift
                upper[k] = separation.upper[:, rows.axis] - shift
                if trust is not None and rows.axis == 0:
                    here = rows.matrix @ around[:, 0]
                    lower[k] = np.maximum(lower[k], np.minimum(here - trust, upper[k]))
                    upper[k] = np.minimum(upper[k], np.maximum(here + trust, lower[k]))
            elif modest and rows.family == "acceleration":
                lower[k], upper[k] = _FRICTION * lower[k], _FRICTION * upper[k]
        if self.problem.lateral:
            ends = self._room_of_ends(around, min(ROAD_SLACK, trust or _INF), _EDGE)
            lower += [ends[0], ends[2]]
            upper += [ends[1], ends[3]]
        low, high = model.bounds(self.head, lower, upper)
        return low + _TIGHTEN, high - _TIGHTEN

    def slope(self) -> Array:
        """Linear part of the objective (m,): pull towards the reference, and the given points."""
        model, problem = self.model, self.problem
        p, axes = self.model.structure.degree, model.structure.axes
        wanted = problem.reference.sample(problem.t_rep + model.gauss_tau).position - self.origin
        slope = model.hessian[p:, :p] @ self.head - model.pull[p:] @ wanted
        return np.asarray(slope[:, :axes].T.ravel())

    def sample_data(self, points: Array) -> Array:
        """What the nonlinear rows need to know: the given points' share, and the axis' curvature."""
        model, problem, p = self.model, self.problem, self.model.structure.degree
        data = np.zeros((len(model.tau), SAMPLED))
        for k, basis in enumerate(model.samples):
            data[:, k] = basis[:, :p] @ self.head[:, 0]
            data[:, 3 + k] = basis[:, :p] @ self.head[:, 1] if problem.lateral else basis @ points[:, 1]
        s = model.samples[0] @ points[:, 0]
        kappa, slope = axis_curvature(problem, s + self.origin[0])
        data[:, 6], data[:, 7] = kappa - slope * s, slope
        return data

    def objective(self, points: Array) -> float:
        """The whole objective at these control points, constants included."""
        model, problem = self.model, self.problem
        wanted = problem.reference.sample(problem.t_rep + model.gauss_tau).position - self.origin
        value = 0.5 * np.sum(points * (model.hessian @ points)) - np.sum(points * (model.pull @ wanted))
        offset = 0.5 * np.sum(model.reference_weight[:, None] * wanted**2)
        return float(value + offset)

    def start_violation(self) -> str:
        """The first limit that the given state itself breaks, as a sentence."""
        problem, limits = self.problem, self.problem.limits
        v, a = problem.start[1:, 0]
        along, across = plane_acceleration(problem, problem.start[None])
        total = float(np.hypot(along, across)[0])
        checks = (
            (v < -TOLERANCE, f"the start speed {v:.2f} m/s is below 0"),
            (
                v > limits.v_max + TOLERANCE,
                f"the start speed {v:.2f} m/s is above v_max {limits.v_max:.2f} m/s",
            ),
            (
                a < limits.a_min - TOLERANCE,
                f"the start acceleration {a:.2f} m/s² is below a_min {limits.a_min:.2f} m/s²",
            ),
            (
                a > limits.a_max + TOLERANCE,
                f"the start acceleration {a:.2f} m/s² is above a_max {limits.a_max:.2f} m/s²",
            ),
            (
                total > limits.a_total + TOLERANCE,
                f"the start acceleration {total:.2f} m/s² is outside the friction circle of "
                f"{limits.a_total:.2f} m/s²",
            ),
        )
        return next((text for bad, text in checks if bad), "")

    def room(self, shape: Array, slack: float = ROAD_SLACK) -> tuple[Array, Array] | None:
        """Room on the road over the s that a curve's window points (W, C, 2) cover, and ``slack`` around."""
        problem = self.problem
        if not problem.lateral or not len(shape):
            return None
        s, own = shape[..., 0], problem.start[0, 1]
        return road_room(problem.bounds, s.min(axis=1) - slack, s.max(axis=1) + slack, own, own, _EDGE)

    def _room_of_ends(self, points: Array, slack: float, edge: float) -> tuple[Array, Array, Array, Array]:
        """Right and left end of the road at the body's front, then at its back, for all samples.

        The road is wide enough for the ends of a body that follows the axis, whatever the bounds say.
        """
        problem, model = self.problem, self.model
        reach = model.structure.overhang
        s = model.samples[0] @ points[:, 0] + self.origin[0]
        swing = -0.5 * reach**2 * problem.curvature_at(s[:, None] + np.linspace(-slack, slack, 5))
        own = float(problem.start[0, 1]) + np.stack([swing.min(axis=1) - _OWN, swing.max(axis=1) + _OWN])
        over = problem.t_rep + model.tau > problem.t_end + 1e-9
        found = []
        for shift in (reach, -reach):
            right, left = road_room(
                problem.bounds, s + shift - slack, s + shift + slack, own[0], own[1], edge
            )
            found += [np.where(over, -_INF, right), np.where(over, _INF, left)]
        return found[0], found[1], found[2], found[3]

    def residuals(self, separation: Separation, points: Array) -> dict[str, float]:
        """Largest violation of every family, from the control points and the problem alone."""
        model, problem = self.model, self.problem
        found: dict[str, float] = {}
        for k, rows in enumerate(model.linear):
            value = rows.matrix @ points[:, rows.axis]
            if rows.family == "obstacles":
                value = value + self.origin[rows.axis]
                low, high = separation.lower[:, rows.axis], separation.upper[:, rows.axis]
            else:
                low, high = self.lower[k], self.upper[k]
            worst = max(float(np.max(low - value)), float(np.max(value - high)), 0.0)
            found[rows.family] = max(found.get(rows.family, 0.0), worst)
        if problem.lateral:
            v = model.velocity @ points
            found["heading"] = max(0.0, float(np.max(np.abs(v[:, 1]) - model.structure.tangent * v[:, 0])))
            found["road"] = self._road_violation(points)
        found |= self._plane_violations(points)
        return found

    def _plane_violations(self, points: Array) -> dict[str, float]:
        """Accelerations and curvature at the ends of the windows, with the axis' true curvature."""
        model, problem, limits = self.model, self.problem, self.problem.limits
        states = np.stack([basis @ points for basis in model.samples], axis=1)
        states[:, 0] += self.origin
        along, across = plane_acceleration(problem, states)
        found = {
            "friction": max(0.0, float(np.max(np.hypot(along, across))) - limits.a_total),
            "lateral_acceleration": max(0.0, float(np.max(np.abs(across))) - limits.a_lat),
        }
        if problem.lateral:
            found["longitudinal_acceleration"] = max(
                0.0, float(np.max(along)) - limits.a_max, limits.a_min - float(np.min(along))
            )
            v, w = states[:, 1].T
            forward = (1.0 - problem.curvature_at(states[:, 0, 0]) * states[:, 0, 1]) * v
            square = forward**2 + w**2 + STANDSTILL
            bend = (forward * across - w * along) / square**1.5
            found["curvature"] = max(0.0, float(np.max(np.abs(bend))) - limits.curvature)
            reach = model.structure.overhang
            middle = states[:, 0, 1] - 0.5 * reach**2 * problem.curvature_at(states[:, 0, 0])
            swing = reach * w / np.sqrt(square)
            ends = self._room_of_ends(points, 0.0, 0.0)
            outside = (
                ends[0] - middle - swing,
                middle + swing - ends[1],
                ends[2] - middle + swing,
                middle - swing - ends[3],
            )
            found["body_on_road"] = max(0.0, *(float(np.max(x)) for x in outside))
        return found

    def _road_violation(self, points: Array) -> float:
        """How far the points of l leave the road anywhere over the s that their window covers."""
        problem, row = self.problem, self.windows.row
        if not len(row):
            return 0.0
        placed = (self.model.obstacle @ points)[row] + self.origin
        own = problem.start[0, 1]
        right, left = road_room(
            problem.bounds, placed[..., 0].min(axis=1), placed[..., 0].max(axis=1), own, own, 0.0
        )
        l = placed[..., 1]  # noqa: E741
        return max(0.0, float(np.max(right[:, None] - l)), float(np.max(l - left[:, None])))
