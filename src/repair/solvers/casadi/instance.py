"""One repair problem laid out for its NLP: windows, bounds, data of the samples, objective."""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.base import Curve
from repair.curves.bspline import greville_offsets
from repair.curves.fitting import fit_to_curve, splice_points
from repair.curves.sampled import SampledCurve
from repair.problem.lateral import LastPath, kept_path
from repair.problem.limits import Limits
from repair.problem.problem import RepairProblem
from repair.solvers.casadi.model import Model
from repair.solvers.casadi.nlp import axis_curvature, body, in_plane
from repair.solvers.casadi.rows import SAMPLED, Datum, RowKind
from repair.solvers.casadi.separation import Separation, road_room
from repair.solvers.casadi.windows import Boxes, Windows, boxes_in, meeting
from repair.timegrid import INSTANT

__all__ = [
    "ROAD_SLACK",
    "Instance",
    "guide_of",
    "lay_out",
    "limit_values",
    "overhang_of",
]

ROAD_SLACK = 0.5  #: [m] of s either way of the last path over which the road must be wide enough
_TIGHTEN = 1e-7  # bounds are taken in by this much, so that the solver's own tolerance stays inside
_CROSSED = 5e-7  # of bounds that touch each other or nearly so
_FRICTION = 0.995  # share of the friction circle used at the samples, for what happens in between
_EDGE = 0.05  # [m] kept from the edge of the road
_OWN = 0.05  # [m] by which the body's ends may always leave the axis' own
_INF = np.inf
# Factors of the bounds by kind of row: those of the accelerations are taken in.
_MODEST = np.ones(len(RowKind))
_MODEST[[RowKind.ACCELERATION_S, RowKind.ACCELERATION_L]] = _FRICTION


def guide_of(problem: RepairProblem) -> Curve:
    """The curve that shows the way: the guide, or the reference where there is none."""
    return problem.reference if problem.passing is None else SampledCurve(problem.passing.guide)


@lru_cache(maxsize=128)
def limit_values(limits: Limits) -> tuple[Array, Array]:
    """Smallest and largest value (13,) of every :class:`repair.solvers.casadi.rows.RowKind`."""
    side = limits.a_lat if limits.a_lat < limits.a_total - 1e-9 else _INF
    values = {
        RowKind.VELOCITY_S: (0.0, limits.v_max),
        RowKind.VELOCITY_L: (-limits.v_lat, limits.v_lat),
        RowKind.ACCELERATION_S: (limits.a_min, limits.a_max),
        RowKind.ACCELERATION_L: (-limits.a_lat, limits.a_lat),
        RowKind.JERK_S: (-limits.j_lon, limits.j_lon),
        RowKind.JERK_L: (-limits.j_lat, limits.j_lat),
        RowKind.PLACE: (-_INF, _INF),
        RowKind.HEADING: (0.0, _INF),
        RowKind.CIRCLE: (-_INF, (_FRICTION * limits.a_total) ** 2),
        RowKind.ACROSS: (-side, side),
        RowKind.ALONG: (limits.a_min, limits.a_max),
        RowKind.CURVATURE: (-limits.curvature, limits.curvature),
        RowKind.STOP: (-_INF, _INF),
    }
    low, high = zip(*(values[kind] for kind in RowKind), strict=True)
    return frozen(low), frozen(high)


def overhang_of(problem: RepairProblem) -> float:
    """Half the length of the body [m], to the next centimetre: a little more than it is, never less."""
    return float(np.ceil(100.0 * problem.half_length - 1e-9) / 100.0)


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
    within : (K,) array, optional
        What the end is bounded by, see :mod:`repair.terminal.room`; goes with ``Structure.ending``.
    path_of : LastPath, optional
        Remembers the reference's path from one problem to the next.
    """

    def __init__(
        self,
        problem: RepairProblem,
        model: Model,
        origin: Array,
        head: Array,
        within: Array | None = None,
        path_of: LastPath | None = None,
    ) -> None:
        self.problem, self.model, self.origin, self.head = problem, model, origin, head
        self.within, self._path_of = within, path_of or LastPath()
        self.windows = self._windows()
        self.limits = limit_values(problem.limits)  # by kind of row
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

    def on_path(self, points: Array) -> Array:
        """Control points less the origin with l where the reference's path is, for who keeps to that."""
        problem, structure = self.problem, self.model.structure
        if problem.lateral:
            return points
        placed = points + self.origin
        found = kept_path(problem, placed, structure.degree, structure.spacing, self._path_of) - self.origin
        return points if bool((found[:, 1] == points[:, 1]).all()) else found

    def _windows(self) -> Windows:
        """The windows that begin before the end of the repair."""
        problem, structure = self.problem, self.model.structure
        p, h = structure.degree, structure.spacing
        if structure.sampled:
            times = problem.t_rep + greville_offsets(structure.n, p, h)[p:]
            keep = np.flatnonzero(times <= problem.t_end + INSTANT)
            return Windows(times[keep], times[keep], keep[:, None], np.zeros(1))
        edges = problem.t_rep + self.model.edge
        count = int(edges[:-1].searchsorted(problem.t_end - INSTANT))
        return Windows(
            edges[:count], edges[1 : count + 1], self.model.window_row[:count], self.model.fraction
        )

    @cached_property
    def row_limits(self) -> tuple[Array, ...]:
        """Bounds (R, 2) of velocity, acceleration and jerk at all of their Bernstein points."""
        return tuple(side[: RowKind.PLACE].reshape(3, 2)[self.model.order] for side in self.limits)

    def _limit_bounds(self, modest: bool = False) -> tuple[Array, Array]:
        """Bounds of all rows; those of the position rows and the body's ends are filled in later."""
        model, (least, most) = self.model, self.limits
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

        Parameters
        ----------
        separation : Separation
        around : (n, 2) array or None
            Control points nearby, for the body's ends; those are left open without it.
        trust : float, optional
            How close s stays to their curve [m].
        modest : bool
            Keep the accelerations inside the share of the friction circle that the nonlinear rows use:
            for a solution that is sought without those rows.
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
        if model.stopping is not None and self.within is not None:
            kept, span = model.stopping
            high[span] = self.within[kept] - self.given[span] - self.origin[0]
        if self.problem.lateral and around is not None:
            s = model.samples[0] @ around[:, 0] + self.origin[0]
            ends = slice(len(low) - 2 * len(s), None)
            low[ends], high[ends] = self.room_of_ends(s, min(ROAD_SLACK, trust or _INF), _EDGE)
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
        data[Datum.S : Datum.L] = self.state_given[..., 0]
        sideways = self.state_given[..., 1] if problem.lateral else [b @ points[:, 1] for b in model.samples]
        data[Datum.L : Datum.BEND] = sideways
        s = model.samples[0] @ points[:, 0]
        kappa, slope = axis_curvature(problem, s + self.origin[0])
        data[Datum.BEND], data[Datum.BEND_SLOPE] = kappa - slope * s, slope
        return data

    def objective(self, points: Array) -> float:
        """The whole objective at these control points, constants included."""
        value = (points * (0.5 * (self.model.hessian @ points) - self.pulled)).sum()
        return float(value + 0.5 * (self.model.reference_weight @ self.wanted**2).sum())

    def keeps_curved(self, points: Array, low: Array, high: Array) -> bool:
        """Whether the nonlinear rows are kept, as tightly as the solver is asked to.

        Parameters
        ----------
        points : (n, 2) array
            Control points less the origin, around which :meth:`bounds` made the bounds.
        low, high : (R,) array
            Of all rows.
        """
        states = self._states(points)
        kappa, slope = axis_curvature(self.problem, states[0, :, 0])
        along, across = in_plane(kappa, slope, states)
        rows = [along**2 + across**2, across]
        if self.problem.lateral:
            bend, *ends = body(kappa, states, along, across, self.model.structure.overhang)
            rows += [along, bend, *ends]
        value, first = np.concatenate(rows), self.model.linear_count
        return bool((low[first:] <= value).all() and (value <= high[first:]).all())

    def _states(self, points: Array) -> Array:
        """Positions, velocities, accelerations (3, S, 2) at the samples."""
        states = (self.model.evaluated[self.model.family_start[-1] :] @ points).reshape(3, -1, 2)
        states[0] += self.origin
        return np.asarray(states)

    def room(self, shape: Array, slack: float = ROAD_SLACK) -> tuple[Array, Array] | None:
        """Room on the road over the s that a curve's window points (W, C, 2) cover, and ``slack`` around."""
        problem = self.problem
        if not problem.lateral or not len(shape):
            return None
        s, own = shape[..., 0], problem.start[0, 1]
        return road_room(problem.bounds, s.min(axis=1) - slack, s.max(axis=1) + slack, own, own, _EDGE)

    def room_of_ends(self, s: Array, slack: float, edge: float) -> tuple[Array, Array]:
        """Right and left end of the road (2 S,) at the body's front, then at its back.

        The road is wide enough for the ends of a body that follows the axis, whatever the bounds say.

        Parameters
        ----------
        s : (S,) array
            At the samples [m].
        slack : float
            By how much s may differ from that either way [m].
        edge : float
            Distance kept from either edge [m].
        """
        problem, model = self.problem, self.model
        reach, start = model.structure.overhang, float(problem.start[0, 1])
        around = np.linspace(-slack, slack, 5)[:, None] if slack else 0.0
        swing = -0.5 * reach**2 * problem.curvature_at(np.atleast_2d(s + around))
        right, left = start + swing.min(axis=0) - _OWN, start + swing.max(axis=0) + _OWN
        ends = np.concatenate((s + reach, s - reach))
        own = np.concatenate((right, right)), np.concatenate((left, left))
        right, left = road_room(problem.bounds, ends - slack, ends + slack, *own, edge)
        over = problem.t_rep + model.tau > problem.t_end + INSTANT
        if over.any():
            right.reshape(2, -1)[:, over] = -_INF
            left.reshape(2, -1)[:, over] = _INF
        return right, left


def lay_out(
    problem: RepairProblem,
    model: Model,
    within: Array | None = None,
    path_of: LastPath | None = None,
    *,
    aside: bool = False,
) -> tuple[Instance, Array]:
    """The instance of a problem, and its initial control points (n, 2) less the origin: the guide's.

    Who keeps the reference's path leaves out the obstacles that are beside it, unless its curve may be
    ``aside`` of that.
    """
    structure = model.structure
    n, p, h = structure.n, structure.degree, structure.spacing
    origin = np.array([problem.start[0, 0], 0.0])
    derivatives = np.zeros((p, 2))
    derivatives[:3] = problem.start
    if p > 3:
        derivatives[3] = problem.reference.sample([problem.t_rep]).jerk[0]
    head = splice_points(derivatives, p, h) - origin
    points = fit_to_curve(guide_of(problem), problem.t_rep, n, p, h).points - origin
    points[:p] = head
    if not problem.lateral and problem.passing is not None:
        points[p:, 1] = fit_to_curve(problem.reference, problem.t_rep, n, p, h).points[p:, 1]
    path_of = path_of or LastPath()
    if not problem.lateral and not aside:
        problem = meeting(problem, points[:, 1], path_of(problem.reference, problem.t_rep - p * h), p)
    instance = Instance(problem, model, origin, head, within, path_of)
    return instance, instance.on_path(points)
