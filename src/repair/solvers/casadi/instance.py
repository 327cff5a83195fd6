"""One repair problem laid out for its NLP: bounds, data, objective, and what a solution violates."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.problem.problem import RepairProblem
from repair.solvers.casadi.model import SAMPLED, STANDSTILL, Model
from repair.solvers.casadi.rows import FAMILIES
from repair.solvers.casadi.separation import Boxes, Separation, Windows, boxes_in, road_room

__all__ = ["ROAD_SLACK", "TOLERANCE", "Instance", "plane_acceleration"]

TOLERANCE = 1e-6  # largest violation of a curve that is called solved
ROAD_SLACK = 0.5  # [m] of s either way of the last path over which the road must be wide enough
_TIGHTEN = 1e-7  # bounds are taken in by this much, so that the solver's own tolerance stays inside
_CROSSED = 5e-7  # of bounds that touch each other or nearly so
_FRICTION = 0.995  # share of the friction circle used at the samples, for what happens in between
_EDGE = 0.05  # [m] kept from the edge of the road
_OWN = 0.05  # [m] by which the body's ends may always leave the axis' own
_INF = np.inf
_MODEST = np.where(np.isin(np.arange(12), (2, 3)), _FRICTION, 1.0)  # for the rows of the accelerations


_STEP = 0.25  # [m] of s either way for the slope of the axis' curvature
_AROUND = np.array([[0.0], [_STEP], [-_STEP]])


def axis_curvature(problem: RepairProblem, s: Array) -> tuple[Array, Array]:
    """Curvature of the axis and its slope over s (K,)."""
    kappa, ahead, behind = problem.curvature_at(s + _AROUND)
    return kappa, (ahead - behind) / (2.0 * _STEP)


def _excess(*values: Any) -> float:
    """The largest of 0 and these numbers; NaN if one of them is (the built-in ``max`` may lose it)."""
    return float(np.maximum.reduce((0.0, *values)))


def plane_acceleration(problem: RepairProblem, states: Array) -> tuple[Array, Array]:
    """Acceleration along and across the axis (K,) of states (K, 3, 2)."""
    return _in_plane(*axis_curvature(problem, states[:, 0, 0]), states.swapaxes(0, 1))


def _in_plane(kappa: Array, slope: Array, states: Array) -> tuple[Array, Array]:
    """The same for states (3, K, 2), where the axis' curvature is known."""
    l, (v, w), (a, b) = states[0, :, 1], states[1].T, states[2].T  # noqa: E741
    scale, square = 1.0 - kappa * l, v**2
    return scale * a - 2.0 * kappa * v * w - slope * l * square, b + scale * kappa * square


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
        self.relaxed: Array | None = None  # the optimum of the linear rows, once it is known
        # The given points' share of the linear rows, and of the samples' states.
        self.given = model.given @ head.T.ravel()
        self.state_given = (model.sampled_given @ head).reshape(3, -1, 2)
        self.lower, self.upper = self._limit_bounds()

    def shape(self, points: Array) -> Array:
        """Points (W, C, 2) of all windows, for control points (n, 2) less the origin."""
        return np.asarray((self.model.obstacle @ points + self.origin)[self.windows.row])

    @cached_property
    def boxes(self) -> Boxes | None:
        """The obstacles as the windows see them."""
        return boxes_in(self.problem, self.windows)

    @cached_property
    def wanted(self) -> Array:
        """The reference's positions at the objective's points of integration, less the origin."""
        problem = self.problem
        return problem.reference.sample(problem.t_rep + self.model.gauss_tau).position - self.origin

    @cached_property
    def pulled(self) -> Array:
        """What the reference pulls at each control point (n, 2)."""
        return np.asarray(self.model.pull @ self.wanted)

    @cached_property
    def slope(self) -> Array:
        """Linear part of the objective (m,): pull towards the reference, and the given points."""
        p, axes = self.model.structure.degree, self.model.structure.axes
        slope = self.model.hessian[p:, :p] @ self.head - self.pulled[p:]
        return np.asarray(slope[:, :axes].T.ravel())

    def _windows(self) -> Windows:
        """The windows that begin before the end of the repair."""
        problem, structure = self.problem, self.model.structure
        p, h = structure.degree, structure.spacing
        if structure.sampled:
            times = problem.t_rep + (np.arange(p, structure.n) - (p - 1) / 2) * h
            keep = np.flatnonzero(times <= problem.t_end + 1e-9)
            return Windows(times[keep], times[keep], keep[:, None], np.zeros(1))
        edges = problem.t_rep + self.model.edge
        count = int(edges[:-1].searchsorted(problem.t_end - 1e-9))
        return Windows(
            edges[:count], edges[1 : count + 1], self.model.window_row[:count], self.model.fraction
        )

    @cached_property
    def _limit_values(self) -> tuple[Array, Array]:
        """Smallest and largest value of every kind of row, in the order of ``Layout.kind``."""
        c = self.problem.limits
        side = c.a_lat if c.a_lat < c.a_total - 1e-9 else _INF
        low = [0.0, -c.v_lat, c.a_min, -c.a_lat, -c.j_lon, -c.j_lat]
        high = [c.v_max, c.v_lat, c.a_max, c.a_lat, c.j_lon, c.j_lat]
        low += [-_INF, 0.0, -_INF, -side, c.a_min, -c.curvature]
        high += [_INF, _INF, (_FRICTION * c.a_total) ** 2, side, c.a_max, c.curvature]
        return np.array(low), np.array(high)

    def _limit_bounds(self, modest: bool = False) -> tuple[Array, Array]:
        """Bounds of all rows; those of the position rows and the body's ends are filled in later."""
        model, (least, most) = self.model, self._limit_values
        if modest:
            least, most = least * _MODEST, most * _MODEST
        low, high = least[model.kind], most[model.kind]
        low[: model.linear_count] -= self.given
        high[: model.linear_count] -= self.given
        return low, high

    @cached_property
    def _modest(self) -> tuple[Array, Array]:
        return self._limit_bounds(modest=True)

    def bounds(
        self, separation: Separation, around: Array | None, trust: float | None = None, modest: bool = False
    ) -> tuple[Array, Array]:
        """Bounds of all rows of the model, taken in by the solver's own tolerance.

        ``around`` are control points nearby, for the body's ends (left open without it); with ``trust``
        [m] s stays that close to their curve. ``modest`` keeps the accelerations inside the share of the
        friction circle that the nonlinear rows use, for a solution that is sought without those rows.
        """
        model = self.model
        base = self._modest if modest else (self.lower, self.upper)
        low, high = base[0].copy(), base[1].copy()
        for axis, kept, span in model.bounded:
            shift = self.given[span] + self.origin[axis]
            lower, upper = separation.lower[kept, axis] - shift, separation.upper[kept, axis] - shift
            if trust is not None and around is not None and axis == 0:
                here = (model.obstacle @ around[:, 0])[kept] - self.given[span]
                lower = np.maximum(lower, np.minimum(here - trust, upper))
                upper = np.minimum(upper, np.maximum(here + trust, lower))
            low[span], high[span] = lower, upper
        if self.problem.lateral and around is not None:
            s = model.samples[0] @ around[:, 0] + self.origin[0]
            ends = slice(len(low) - 2 * len(s), None)
            low[ends], high[ends] = self._room_of_ends(s, min(ROAD_SLACK, trust or _INF), _EDGE)
        low += _TIGHTEN
        high -= _TIGHTEN
        # Where there is exactly room for one value, that is left no room by what was just taken.
        crossed = ((low > high) & (low - high <= _CROSSED)).nonzero()[0]
        low[crossed] = high[crossed] = 0.5 * (low[crossed] + high[crossed])
        return low, high

    def sample_data(self, points: Array) -> Array:
        """What the nonlinear rows need to know: the given points' share, and the axis' curvature."""
        model, problem = self.model, self.problem
        data = np.empty((SAMPLED, len(model.tau)))
        data[:3] = self.state_given[..., 0]
        data[3:6] = self.state_given[..., 1] if problem.lateral else [b @ points[:, 1] for b in model.samples]
        s = model.samples[0] @ points[:, 0]
        kappa, slope = axis_curvature(problem, s + self.origin[0])
        data[6], data[7] = kappa - slope * s, slope
        return data

    def objective(self, points: Array) -> float:
        """The whole objective at these control points, constants included."""
        value = (points * (0.5 * (self.model.hessian @ points) - self.pulled)).sum()
        return float(value + 0.5 * (self.model.reference_weight @ self.wanted**2).sum())

    def keeps_circle(self, points: Array) -> bool:
        """Whether the rows that are nonlinear with s alone are kept, as tightly as the solver is asked to."""
        first, count = self.model.linear_count, len(self.model.tau)
        along, across = plane_acceleration(self.problem, self._states(points).swapaxes(0, 1))
        total, side = self.upper[first] - _TIGHTEN, self.upper[first + count] - _TIGHTEN
        return bool((along**2 + across**2).max() <= total and np.abs(across).max() <= side)

    def _states(self, points: Array) -> Array:
        """Positions, velocities, accelerations (3, S, 2) at the samples."""
        states = (self.model.evaluated[self.model.family_start[-1] :] @ points).reshape(3, -1, 2)
        states[0] += self.origin
        return np.asarray(states)

    def start_violation(self) -> str:
        """The first limit that the given state itself breaks, as a sentence."""
        problem, limits = self.problem, self.problem.limits
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

    def room(self, shape: Array, slack: float = ROAD_SLACK) -> tuple[Array, Array] | None:
        """Room on the road over the s that a curve's window points (W, C, 2) cover, and ``slack`` around."""
        problem = self.problem
        if not problem.lateral or not len(shape):
            return None
        s, own = shape[..., 0], problem.start[0, 1]
        return road_room(problem.bounds, s.min(axis=1) - slack, s.max(axis=1) + slack, own, own, _EDGE)

    def _room_of_ends(self, s: Array, slack: float, edge: float) -> tuple[Array, Array]:
        """Right and left end of the road (2 S,) at the body's front, then at its back, for samples at s.

        The road is wide enough for the ends of a body that follows the axis, whatever the bounds say.
        """
        problem, model = self.problem, self.model
        reach, start = model.structure.overhang, float(problem.start[0, 1])
        around = np.linspace(-slack, slack, 5)[:, None] if slack else 0.0
        swing = -0.5 * reach**2 * problem.curvature_at(np.atleast_2d(s + around))
        right, left = start + swing.min(axis=0) - _OWN, start + swing.max(axis=0) + _OWN
        ends = np.concatenate((s + reach, s - reach))
        own = np.concatenate((right, right)), np.concatenate((left, left))
        right, left = road_room(problem.bounds, ends - slack, ends + slack, *own, edge)
        over = problem.t_rep + model.tau > problem.t_end + 1e-9
        if over.any():
            right.reshape(2, -1)[:, over] = -_INF
            left.reshape(2, -1)[:, over] = _INF
        return right, left

    @cached_property
    def _row_limits(self) -> tuple[Array, ...]:
        """Bounds (R, 2) of velocity, acceleration and jerk at all of their Bernstein points."""
        return tuple(side[:6].reshape(3, 2)[self.model.order] for side in self._limit_values)

    def residuals(self, separation: Separation, points: Array) -> dict[str, float]:
        """Largest violation of every family, from the control points and the problem alone."""
        model, problem, first = self.model, self.problem, self.model.family_start
        value = model.evaluated @ points
        placed = value[first[3] : first[4]] + self.origin
        states = value[first[4] :].reshape(3, -1, 2)
        states[0] += self.origin
        (low, high), moving = self._row_limits, value[: first[3]]
        derivatives = np.maximum.reduceat(np.maximum(low - moving, moving - high), first[:3])
        depth = np.maximum(separation.lower - placed, placed - separation.upper).max(axis=0)
        axes = model.structure.axes
        worst = [*derivatives[:, :axes].max(axis=1).tolist(), float(depth[:axes].max())]
        # What is not a number stays one: max() keeps its first argument then.
        found = {family: max(x, 0.0) for family, x in zip(FAMILIES, worst, strict=True)}
        if problem.lateral:
            v = value[: first[1]]
            found["heading"] = max(float((np.abs(v[:, 1]) - model.structure.tangent * v[:, 0]).max()), 0.0)
            found["road"] = self._road_violation(placed)
        return found | self._plane_violations(states)

    def _plane_violations(self, states: Array) -> dict[str, float]:
        """Accelerations and curvature at the ends of the windows, with the axis' true curvature."""
        problem, limits = self.problem, self.problem.limits
        kappa, slope = axis_curvature(problem, states[0, :, 0])
        along, across = _in_plane(kappa, slope, states)
        found = {
            "friction": _excess(np.hypot(along, across).max() - limits.a_total),
            "lateral_acceleration": _excess(np.abs(across).max() - limits.a_lat),
        }
        if problem.lateral:
            found["longitudinal_acceleration"] = max(
                0.0, float(along.max()) - limits.a_max, limits.a_min - float(along.min())
            )
            (s, l), (v, w) = states[0].T, states[1].T  # noqa: E741
            forward = (1.0 - kappa * l) * v
            square = forward**2 + w**2 + STANDSTILL
            speed = np.sqrt(square)
            bend = (forward * across - w * along) / (square * speed)
            found["curvature"] = _excess(np.abs(bend).max() - limits.curvature)
            reach = self.model.structure.overhang
            middle, swing = l - 0.5 * reach**2 * kappa, reach * w / speed
            ends = np.concatenate((middle + swing, middle - swing))
            right, left = self._room_of_ends(s, 0.0, 0.0)
            found["body_on_road"] = _excess((right - ends).max(), (ends - left).max())
        return found

    def _road_violation(self, placed: Array) -> float:
        """How far the points of l leave the road anywhere over the s that their window covers."""
        problem, row = self.problem, self.windows.row
        if not len(row):
            return 0.0
        s, l = placed[:, 0][row], placed[:, 1][row]  # noqa: E741
        own = problem.start[0, 1]
        right, left = road_room(problem.bounds, s.min(axis=1), s.max(axis=1), own, own, 0.0)
        return _excess((right - l.min(axis=1)).max(), (l.max(axis=1) - left).max())
