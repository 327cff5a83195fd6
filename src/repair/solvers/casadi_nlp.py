"""The hard-constraint backend: the same uniform B-spline as an NLP, solved by IPOPT or SQP.

What a curve that this backend calls solved keeps, recomputed from the solution with NumPy:

* speed (0 to v_max), lateral speed, s'' and l'', s''' and l''', and the direction of travel
  (|l'| <= tan(heading) s'): the Bernstein points of every piece are inside, so the curve is, at
  *every* time from t_rep on;
* obstacles, ``obstacles: hull``: for every window (at most one scenario step long) the Bernstein
  points lie beyond the moving edge of the inflated box, so the curve is clear at *every* time until
  t_end, the box moving linearly between scenario steps (:mod:`repair.solvers.separation`);
  ``obstacles: sampled``: the curve is clear at the control points' Greville times, and only there;
* the road's edges: as ``hull``, with the narrowest width over the s the curve covers in a window;
* accelerations in the plane (friction circle, lateral limit) and the curvature of the driven path,
  the axis' curvature included: at the ends of all windows, and only there.

Sides of passing are not searched here: they are the guide's, window by window. The axis' curvature
and the road's width over s enter as lines around the last path; the NLP is solved again around its
own solution until the exact values agree.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from repair.bspline import UniformBSpline, fit_to_curve, n_points_for, splice_points
from repair.config import CasadiConfig, Config
from repair.errors import BackendError
from repair.solvers.nlp_model import STANDSTILL, Model, Solution, Structure, build_model
from repair.solvers.separation import Separation, Windows, road_room, separate
from repair.types import Array, Curve, FrenetTrajectory, RepairProblem, SolveResult, SolveStatus, frozen

__all__ = ["CasadiBackend", "make"]

TOLERANCE = 1e-6  # largest violation of a curve that is called solved
_TIGHTEN = 1e-7  # bounds are taken in by this much, so that the solver's own tolerance stays inside
_INF = np.inf
_TRUST = 8.0  # [m] that s may move between the first two rounds; half of it in the next, and so on
_SIDES = 4  # sets of sides that are tried
_FRICTION = 0.995  # share of the friction circle used at the samples, for what happens in between
_EDGE = 0.05  # [m] kept from the edge of the road
_OWN = 0.05  # [m] by which the body's ends may always leave the axis' own
_ROAD_SLACK = 0.5  # [m] of s either way of the guide over which the road must be wide enough

_STATUS = {
    "Solve_Succeeded": SolveStatus.SOLVED,
    "Solved_To_Acceptable_Level": SolveStatus.SOLVED,
    "Feasible_Point_Found": SolveStatus.SOLVED,
    "Infeasible_Problem_Detected": SolveStatus.INFEASIBLE,
    "Maximum_Iterations_Exceeded": SolveStatus.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": SolveStatus.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": SolveStatus.TIME_LIMIT,
    "User_Requested_Stop": SolveStatus.TIME_LIMIT,
}


@dataclass(frozen=True)
class _Sampled:
    """A sampled guide as a :class:`repair.types.Curve`, linear in between, at end speed beyond."""

    trajectory: FrenetTrajectory

    @property
    def t_start(self) -> float:
        return float(self.trajectory.t[0])

    @property
    def t_end(self) -> float:
        return float(self.trajectory.t[-1])

    def sample(self, t: Array) -> FrenetTrajectory:
        times = np.asarray(t, dtype=np.float64)
        known = self.trajectory
        beyond = np.maximum(times - self.t_end, 0.0)[:, None]
        position = np.column_stack([np.interp(times, known.t, known.position[:, k]) for k in (0, 1)])
        velocity = np.column_stack([np.interp(times, known.t, known.velocity[:, k]) for k in (0, 1)])
        zero = np.zeros_like(position)
        return FrenetTrajectory(times, position + beyond * velocity, velocity, zero, zero)


@dataclass
class _Instance:
    """One problem laid out for its model; s is counted from the start of the repair."""

    problem: RepairProblem
    model: Model
    origin: Array  # (2,): [s at the start, 0]
    head: Array  # (p, 2)
    windows: Windows
    lower: list[Array]
    upper: list[Array]
    separation: Separation | None = None


class CasadiBackend:
    """Hard constraints through CasADi.

    Parameters
    ----------
    config : CasadiConfig
    degree : int
        Degree of the B-spline.
    spacing : float
        Knot spacing [s].
    """

    name = "casadi"
    relaxes = True

    def __init__(self, config: CasadiConfig | None = None, *, degree: int = 3, spacing: float = 0.2) -> None:
        self.config = config or CasadiConfig()
        self.degree = degree
        self.spacing = spacing

    def solve(
        self, problem: RepairProblem, *, warm_start: Curve | None = None, time_limit: float | None = None
    ) -> SolveResult:
        """Solve one repair.

        Raises
        ------
        repair.errors.BackendError
            If the problem is malformed (no time left between t_rep and t_end, states not finite).
        """
        begin = time.perf_counter()
        _require(problem)
        deadline = None if time_limit is None else begin + time_limit
        try:
            model = build_model(self._structure(problem, timed=time_limit is not None))
        except (BackendError, ImportError) as error:
            return SolveResult(
                SolveStatus.UNAVAILABLE, build_time=time.perf_counter() - begin, detail=str(error)
            )
        instance, points = self._instance(problem, model, warm_start)
        built = time.perf_counter()
        result = self._rounds(instance, points, deadline, time_limit)
        return SolveResult(
            status=result.status, curve=result.curve, objective=result.objective, iterations=result.iterations,
            build_time=built - begin, solve_time=time.perf_counter() - built, detail=result.detail,
            residuals=result.residuals,
        )  # fmt: skip

    def _structure(self, problem: RepairProblem, timed: bool) -> Structure:
        c = self.config
        return Structure(
            n=n_points_for(problem.t_end - problem.t_rep, self.spacing, self.degree),
            degree=self.degree,
            spacing=self.spacing,
            windows=max(1, int(np.ceil(self.spacing / problem.dt - 1e-9))),
            lateral=problem.lateral,
            sampled=c.obstacles == "sampled",
            weights=(c.w_acceleration, c.w_jerk, c.w_reference),
            solver=c.solver,
            max_iterations=c.max_iterations,
            tolerance=c.tolerance,
            tangent=float(np.tan(c.heading)),
            overhang=c.overhang,
            timed=timed,
        )

    # -- layout ----------------------------------------------------------------------------------

    def _instance(
        self, problem: RepairProblem, model: Model, warm_start: Curve | None
    ) -> tuple[_Instance, Array]:
        """Lay out the problem, and the initial control points (n, 2)."""
        n, p, h = model.structure.n, self.degree, self.spacing
        reference = fit_to_curve(problem.reference, problem.t_rep, n, p, h)
        origin = np.array([problem.start[0, 0], 0.0])
        state = problem.reference.sample([problem.t_rep])
        derivatives = np.zeros((p, 2))
        derivatives[:3] = problem.start
        if p > 3:
            derivatives[3] = state.jerk[0]
        head = splice_points(derivatives, p, h) - origin
        guide: Curve = problem.reference if problem.passing is None else _Sampled(problem.passing.guide)
        points = fit_to_curve(guide, problem.t_rep, n, p, h).points - origin
        points = np.vstack([head, points[p:]])
        if not problem.lateral:
            points[p:, 1] = reference.points[p:, 1]
        windows = _windows(problem, model)
        lower, upper = self._limit_bounds(problem, model)
        return _Instance(problem, model, origin, head, windows, lower, upper), points

    def _limit_bounds(self, problem: RepairProblem, model: Model) -> tuple[list[Array], list[Array]]:
        """Bounds of the derivative rows; those of the position rows are filled in later."""
        limits = problem.limits
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

    # -- rounds ----------------------------------------------------------------------------------

    def _rounds(
        self, instance: _Instance, points: Array, deadline: float | None, time_limit: float | None
    ) -> SolveResult:
        """Solve around the guide, then around the solution, until the exact constraints are kept."""
        problem, model = instance.problem, instance.model
        why = _start_violation(instance)
        if why:
            return SolveResult(SolveStatus.INFEASIBLE, detail=why)
        separation, points, why = self._open(instance, points)
        if why:
            return SolveResult(SolveStatus.INFEASIBLE, detail=why)
        iterations = 0
        for round_ in range(self.config.rounds):
            trust = _TRUST * 0.5**round_ if round_ else None
            low, high = self._bounds(instance, separation, points, trust)
            points, status, word, count = self._run(instance, points, low, high, deadline)
            iterations += count
            residuals = self._residuals(instance, separation, points)
            kept = max(residuals.values()) <= TOLERANCE
            if status is not SolveStatus.SOLVED or kept:
                break
            if deadline is not None and time.perf_counter() > deadline:
                status = SolveStatus.TIME_LIMIT
                break
            shape = (model.obstacle @ points)[instance.windows.row] + instance.origin
            room = _room(instance, shape, min(_ROAD_SLACK, 0.5 * trust) if trust else _ROAD_SLACK)
            separation = separate(
                problem, instance.windows, len(model.obstacle), shape, room, separation.side
            )
        detail = word
        if status is SolveStatus.SOLVED and not kept:
            status, detail = (
                SolveStatus.NUMERICAL_ERROR,
                f"{_worst(residuals)} after {self.config.rounds} rounds",
            )
        elif status is SolveStatus.TIME_LIMIT and time_limit is not None:
            detail = f"time limit of {time_limit:g} s"
        elif status not in (SolveStatus.SOLVED, SolveStatus.INFEASIBLE):
            detail = f"{word}; at the last iterate {_worst(residuals)}"
        curve = None
        if kept and status is not SolveStatus.INFEASIBLE:
            curve = UniformBSpline(problem.t_rep, self.spacing, self.degree, frozen(points + instance.origin))
        objective = self._objective(instance, points)
        return SolveResult(status, curve, objective, iterations, detail=detail, residuals=residuals)

    def _open(self, instance: _Instance, points: Array) -> tuple[Separation, Array, str]:
        """Sides of passing for which the linear rows have a solution, that solution, or why there is none.

        The guide's sides come first. Where they contradict the limits, the curve that misses the
        obstacles by the least is asked for its sides instead, and so on.
        """
        model, problem, windows = instance.model, instance.problem, instance.windows
        slope = self._slope(instance)
        moment = windows.start[:, None] + windows.fraction * (windows.end - windows.start)[:, None]
        guide: Curve = problem.reference if problem.passing is None else _Sampled(problem.passing.guide)
        shape = guide.sample(moment.ravel()).position.reshape(*moment.shape, 2)
        if not problem.lateral:
            shape[..., 1] = (model.obstacle @ points)[windows.row, 1]
        room = _room(instance, shape)
        why, before = "", None
        for _ in range(_SIDES):
            separation = separate(problem, windows, len(model.obstacle), shape, room)
            if separation.why:
                return separation, points, separation.why
            if before is not None and np.array_equal(separation.side, before):
                break
            before = separation.side
            why = why or _gap(separation)
            low, high = self._bounds(instance, separation, points)
            x, feasible = model.unknowns(points), False
            if not _gap(separation):
                x, feasible = model.presolve(x, slope, low, high)
            if feasible is not False:
                return separation, model.with_unknowns(points, x), ""
            elastic = model.elastic(slope, low, high)
            if elastic is None:
                return separation, points, "no curve from the start state keeps the limits and the road"
            points = model.with_unknowns(points, elastic[0])
            why = why or _missed(instance, separation, points, elastic[1])
            shape = (model.obstacle @ points)[windows.row] + instance.origin
            room = _room(instance, shape)
        return separation, points, why

    def _run(
        self, instance: _Instance, points: Array, low: Array, high: Array, deadline: float | None
    ) -> tuple[Array, SolveStatus, str, int]:
        """One NLP: the new control points, the status, the solver's word, the iterations."""
        model = instance.model
        x0, slope, data = model.unknowns(points), self._slope(instance), self._sample_data(instance, points)
        solution = model.solve(x0, data, slope, low, high, deadline)
        status, word = _status(model, solution), solution.word
        if model.structure.solver != "ipopt" and status not in (SolveStatus.SOLVED, SolveStatus.TIME_LIMIT):
            # An SQP that does not converge proves nothing; IPOPT has the last word.
            oracle = build_model(replace(model.structure, solver="ipopt"))
            solution = oracle.solve(x0, data, slope, low, high, deadline)
            status, word = _status(oracle, solution), f"{word}, then IPOPT: {solution.word}"
        return model.with_unknowns(points, solution.x), status, word, solution.iterations

    def _bounds(
        self, instance: _Instance, separation: Separation, around: Array, trust: float | None = None
    ) -> tuple[Array, Array]:
        """Bounds of all rows of the model, taken in by the solver's own tolerance.

        ``around`` are control points nearby; with ``trust`` [m] s stays that close to their curve.
        """
        model = instance.model
        lower, upper = list(instance.lower), list(instance.upper)
        for k, rows in enumerate(model.linear):
            if rows.family == "obstacles":
                shift = instance.origin[rows.axis]
                lower[k] = separation.lower[:, rows.axis] - shift
                upper[k] = separation.upper[:, rows.axis] - shift
                if trust is not None and rows.axis == 0:
                    here = rows.matrix @ around[:, 0]
                    lower[k] = np.maximum(lower[k], np.minimum(here - trust, upper[k]))
                    upper[k] = np.minimum(upper[k], np.maximum(here + trust, lower[k]))
        if instance.problem.lateral:
            ends = _room_of_ends(instance, around, min(_ROAD_SLACK, trust or _INF), _EDGE)
            lower += [ends[0], ends[2]]
            upper += [ends[1], ends[3]]
        low, high = model.bounds(instance.head, lower, upper)
        return low + _TIGHTEN, high - _TIGHTEN

    def _slope(self, instance: _Instance) -> Array:
        """Linear part of the objective (m,): pull towards the reference, and the given points."""
        model, problem = instance.model, instance.problem
        p, axes = self.degree, model.structure.axes
        wanted = problem.reference.sample(problem.t_rep + model.gauss_tau).position - instance.origin
        slope = model.hessian[p:, :p] @ instance.head - model.pull[p:] @ wanted
        return np.asarray(slope[:, :axes].T.ravel())

    def _sample_data(self, instance: _Instance, points: Array) -> Array:
        """What the nonlinear rows need to know: the given points' share, and the axis' curvature."""
        model, problem, p = instance.model, instance.problem, self.degree
        data = np.zeros((len(model.tau), 8))
        for k, basis in enumerate(model.samples):
            data[:, k] = basis[:, :p] @ instance.head[:, 0]
            data[:, 3 + k] = basis[:, :p] @ instance.head[:, 1] if problem.lateral else basis @ points[:, 1]
        s = model.samples[0] @ points[:, 0]
        kappa, slope = _axis_curvature(problem, s + instance.origin[0])
        data[:, 6], data[:, 7] = kappa - slope * s, slope
        return data

    # -- what came out ---------------------------------------------------------------------------

    def _objective(self, instance: _Instance, points: Array) -> float:
        model, problem = instance.model, instance.problem
        wanted = problem.reference.sample(problem.t_rep + model.gauss_tau).position - instance.origin
        value = 0.5 * np.sum(points * (model.hessian @ points)) - np.sum(points * (model.pull @ wanted))
        offset = 0.5 * np.sum(model.reference_weight[:, None] * wanted**2)
        return float(value + offset)

    def _residuals(self, instance: _Instance, separation: Separation, points: Array) -> dict[str, float]:
        """Largest violation of every family, from the control points and the problem alone."""
        model, problem = instance.model, instance.problem
        found: dict[str, float] = {}
        for k, rows in enumerate(model.linear):
            value = rows.matrix @ points[:, rows.axis]
            if rows.family == "obstacles":
                value = value + instance.origin[rows.axis]
                low, high = separation.lower[:, rows.axis], separation.upper[:, rows.axis]
            else:
                low, high = instance.lower[k], instance.upper[k]
            worst = max(float(np.max(low - value)), float(np.max(value - high)), 0.0)
            found[rows.family] = max(found.get(rows.family, 0.0), worst)
        if problem.lateral:
            v = model.velocity @ points
            found["heading"] = max(
                0.0, float(np.max(np.abs(v[:, 1]) - np.tan(self.config.heading) * v[:, 0]))
            )
            found["road"] = _road_violation(instance, points)
        found |= _plane_violations(instance, points)
        return found


def _status(model: Model, solution: Solution) -> SolveStatus:
    if model.structure.solver == "ipopt":
        return _STATUS.get(solution.word, SolveStatus.NUMERICAL_ERROR)
    if not solution.violation <= TOLERANCE:
        timed_out = solution.word == "User_Requested_Stop"
        return SolveStatus.TIME_LIMIT if timed_out else SolveStatus.NUMERICAL_ERROR
    if solution.word == "Search_Direction_Becomes_Too_Small":
        return SolveStatus.SOLVED  # the QP's step is nil: a stationary point
    return _STATUS.get(solution.word, SolveStatus.NUMERICAL_ERROR)


def _require(problem: RepairProblem) -> None:
    if not problem.t_end - problem.t_rep > 1e-9:
        raise BackendError(f"the repair ends at {problem.t_end:g} s, before it begins at {problem.t_rep:g} s")
    if not np.isfinite(problem.start).all():
        raise BackendError(f"the state at t_rep = {problem.t_rep:g} s is not finite")


def _windows(problem: RepairProblem, model: Model) -> Windows:
    """The windows that begin before the end of the repair."""
    structure = model.structure
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


def _room(instance: _Instance, shape: Array, slack: float = _ROAD_SLACK) -> tuple[Array, Array] | None:
    """Room on the road over the s that a curve's window points (W, C, 2) cover, and ``slack`` around."""
    problem = instance.problem
    if not problem.lateral or not len(shape):
        return None
    s, own = shape[..., 0], problem.start[0, 1]
    return road_room(problem.bounds, s.min(axis=1) - slack, s.max(axis=1) + slack, own, own, _EDGE)


def _room_of_ends(
    instance: _Instance, points: Array, slack: float, edge: float
) -> tuple[Array, Array, Array, Array]:
    """Right and left end of the road at the body's front, then at its back, for all samples.

    The road is wide enough for the ends of a body that follows the axis, whatever the bounds say.
    """
    problem, model = instance.problem, instance.model
    reach = model.structure.overhang
    s = model.samples[0] @ points[:, 0] + instance.origin[0]
    swing = -0.5 * reach**2 * problem.curvature_at(s[:, None] + np.linspace(-slack, slack, 5))
    own = float(problem.start[0, 1]) + np.stack([swing.min(axis=1) - _OWN, swing.max(axis=1) + _OWN])
    over = problem.t_rep + model.tau > problem.t_end + 1e-9
    found = []
    for shift in (reach, -reach):
        right, left = road_room(problem.bounds, s + shift - slack, s + shift + slack, own[0], own[1], edge)
        found += [np.where(over, -_INF, right), np.where(over, _INF, left)]
    return found[0], found[1], found[2], found[3]


def _missed(instance: _Instance, separation: Separation, points: Array, miss: float) -> str:
    """The obstacle that is missed by the most, as a sentence."""
    position = instance.model.obstacle @ points + instance.origin
    depth = np.stack([separation.lower - position, position - separation.upper])
    row = int(np.argmax(np.max(depth, axis=(0, 2)) > 0.99 * miss - 1e-6))
    end, axis = np.unravel_index(int(np.argmax(depth[:, row])), (2, 2))
    who = (separation.lower_by, separation.upper_by)[int(end)][row, axis]
    return (
        f"every curve within the limits comes at least {miss:.2f} m too close to {separation.who(who)} "
        f"(t = {separation.times[row]:.2f} s)"
    )


def _gap(separation: Separation) -> str:
    """Name the first place where the bounds leave nothing."""
    closed = separation.lower > separation.upper + 2e-7
    if not closed.any():
        return ""
    row, axis = (int(i[0]) for i in np.nonzero(closed))
    below, above = separation.lower_by[row, axis], separation.upper_by[row, axis]
    t = separation.times[row]
    return f"{separation.who(below)} and {separation.who(above)} leave no gap at t = {t:.2f} s"


def _start_violation(instance: _Instance) -> str:
    """The first limit that the given state itself breaks, as a sentence."""
    problem, limits = instance.problem, instance.problem.limits
    (s, l), (v, w), (a, b) = problem.start  # noqa: E741
    along, across = _plane_acceleration(problem, problem.start[None].reshape(1, 3, 2))
    total = float(np.hypot(along, across)[0])
    checks = (
        (v < -TOLERANCE, f"the start speed {v:.2f} m/s is below 0"),
        (v > limits.v_max + TOLERANCE, f"the start speed {v:.2f} m/s is above v_max {limits.v_max:.2f} m/s"),
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
            f"the start acceleration {total:.2f} m/s² is outside the friction circle of {limits.a_total:.2f} m/s²",
        ),
    )
    return next((text for bad, text in checks if bad), "")


def _axis_curvature(problem: RepairProblem, s: Array) -> tuple[Array, Array]:
    """Curvature of the axis and its slope over s (K,)."""
    kappa = problem.curvature_at(s)
    step = 0.25
    slope = (problem.curvature_at(s + step) - problem.curvature_at(s - step)) / (2.0 * step)
    return kappa, slope


def _plane_acceleration(problem: RepairProblem, states: Array) -> tuple[Array, Array]:
    """Acceleration along and across the axis (K,) of states (K, 3, 2)."""
    (s, l), (v, w), (a, b) = states[:, 0].T, states[:, 1].T, states[:, 2].T  # noqa: E741
    kappa, slope = _axis_curvature(problem, s)
    scale = 1.0 - kappa * l
    return scale * a - 2.0 * kappa * v * w - slope * l * v**2, b + scale * kappa * v**2


def _plane_violations(instance: _Instance, points: Array) -> dict[str, float]:
    """Accelerations and curvature at the ends of the windows, with the axis' true curvature."""
    model, problem, limits = instance.model, instance.problem, instance.problem.limits
    states = np.stack([basis @ points for basis in model.samples], axis=1)
    states[:, 0] += instance.origin
    along, across = _plane_acceleration(problem, states)
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
        ends = _room_of_ends(instance, points, 0.0, 0.0)
        outside = (
            ends[0] - middle - swing,
            middle + swing - ends[1],
            ends[2] - middle + swing,
            middle - swing - ends[3],
        )
        found["body_on_road"] = max(0.0, *(float(np.max(x)) for x in outside))
    return found


def _road_violation(instance: _Instance, points: Array) -> float:
    """How far the hull of l leaves the road anywhere over the s that the curve covers."""
    problem, row = instance.problem, instance.windows.row
    if not len(row):
        return 0.0
    placed = (instance.model.position @ points)[row] + instance.origin
    own = problem.start[0, 1]
    right, left = road_room(
        problem.bounds, placed[..., 0].min(axis=1), placed[..., 0].max(axis=1), own, own, 0.0
    )
    l = placed[..., 1]  # noqa: E741
    return max(0.0, float(np.max(right[:, None] - l)), float(np.max(l - left[:, None])))


def _worst(residuals: dict[str, float]) -> str:
    family = max(residuals, key=lambda k: residuals[k])
    return f"{family} is violated by {residuals[family]:.2g}"


def make(config: Config) -> CasadiBackend:
    """The backend as the configuration describes it."""
    return CasadiBackend(config.casadi, degree=config.repair.degree, spacing=config.repair.spacing)
