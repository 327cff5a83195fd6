"""The paper's formulas written out, loop by loop, as a first reading of the paper would be coded.

Nothing here is meant to be fast. Scalars and lists only: no matrices, no caching, no
preconditioning. It serves twice: the tests hold the package's costs and gradients against it, and
the benchmarks measure the package's speed against it. Equation names are the paper's (Sec. III-IV).

    python -m benchmarks.literal DEU_Flensburg-6_1_T-1.xml [preset]

prints the times of both.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from repair.curves.base import FrenetTrajectory
from repair.problem.problem import RepairProblem

Points = list[list[float]]

# ---------------------------------------------------------------- III-B: B-splines


def basis(i: int, p: int, t: float, knots: list[float]) -> float:
    """Cox-de Boor recursion (eq. bspline)."""
    if p == 0:
        return 1.0 if knots[i] <= t < knots[i + 1] else 0.0
    left = (t - knots[i]) / (knots[i + p] - knots[i]) * basis(i, p - 1, t, knots)
    right = (knots[i + p + 1] - t) / (knots[i + p + 1] - knots[i + 1]) * basis(i + 1, p - 1, t, knots)
    return left + right


def uniform_knots(n: int, p: int, t_start: float, dt: float) -> list[float]:
    """M = N_c + p_b + 1 knots; the span of the curve begins at knot p_b."""
    return [t_start + (k - p) * dt for k in range(n + p + 1)]


def difference(points: Points, dt: float) -> Points:
    """One more derivative of the control points (eq. v_a_j)."""
    return [[(points[i + 1][r] - points[i][r]) / dt for r in range(2)] for i in range(len(points) - 1)]


def derivatives(points: Points, dt: float) -> tuple[Points, Points, Points]:
    """Control points V, A and J."""
    v = difference(points, dt)
    a = difference(v, dt)
    return v, a, difference(a, dt)


def evaluate(points: Points, p: int, t_start: float, dt: float, t: float, order: int = 0) -> list[float]:
    """Phi or one of its derivatives at t."""
    for _ in range(order):
        points = difference(points, dt)
    p -= order
    knots = uniform_knots(len(points), p, t_start, dt)
    total = [0.0, 0.0]
    for i in range(len(points)):
        weight = basis(i, p, t, knots)
        for r in range(2):
            total[r] += weight * points[i][r]
    return total


@dataclass
class LiteralCurve:
    """A B-spline that is sampled by the recursion."""

    t_start: float
    spacing: float
    degree: int
    points: Points

    @property
    def t_end(self) -> float:
        return self.t_start + (len(self.points) - self.degree) * self.spacing

    def sample(self, t: Any) -> FrenetTrajectory:
        times = [float(x) for x in np.atleast_1d(np.asarray(t, dtype=np.float64))]
        columns: list[Points] = [[], [], [], []]
        for x in times:
            inside = min(max(x, self.t_start), self.t_end)
            for order, column in enumerate(columns):
                column.append(evaluate(self.points, self.degree, self.t_start, self.spacing, inside, order))
        return FrenetTrajectory(np.array(times), *(np.array(c) for c in columns))


# ---------------------------------------------------------------- IV-C: penalties


def zeros(n: int) -> Points:
    return [[0.0, 0.0] for _ in range(n)]


_STENCIL = {1: (-1.0, 1.0), 2: (1.0, -2.0, 1.0), 3: (-1.0, 3.0, -3.0, 1.0)}


def smoothness(points: Points, dt: float) -> tuple[float, Points]:
    """J_s and its gradient."""
    _, a, j = derivatives(points, dt)
    value = 0.0
    gradient = zeros(len(points))
    for order, control in ((2, a), (3, j)):
        for i in range(len(control)):
            for r in range(2):
                value += control[i][r] ** 2
                for k in range(order + 1):
                    gradient[i + k][r] += 2.0 * control[i][r] * _STENCIL[order][k] / dt**order
    return value, gradient


def j_c(c: float, s_f: float) -> float:
    """Collision penalty of one pair."""
    if c <= 0.0:
        return 0.0
    if c <= s_f:
        return c**3
    return 3.0 * s_f * c**2 - 3.0 * s_f**2 * c + s_f**3


def j_c_slope(c: float, s_f: float) -> float:
    if c <= 0.0:
        return 0.0
    if c <= s_f:
        return 3.0 * c**2
    return 6.0 * s_f * c - 3.0 * s_f**2


class Pair(NamedTuple):
    """One {p, v} pair: control point, anchor p, unit vector v, safety threshold s_f."""

    i: int
    p: tuple[float, float]
    v: tuple[float, float]
    s_f: float


def collision(points: Points, pairs: list[Pair]) -> tuple[float, Points]:
    """J_c and its gradient, with d = (Q_i - p) . v and c = s_f - d."""
    value = 0.0
    gradient = zeros(len(points))
    for pair in pairs:
        d = 0.0
        for r in range(2):
            d += (points[pair.i][r] - pair.p[r]) * pair.v[r]
        c = pair.s_f - d
        value += j_c(c, pair.s_f)
        for r in range(2):
            gradient[pair.i][r] -= j_c_slope(c, pair.s_f) * pair.v[r]
    return value, gradient


def coefficients(c_m: float, c_j: float, elastic: float) -> tuple[float, float, float, float, float, float]:
    """a_1, b_1, c_1, a_2, b_2, c_2 that make f twice continuously differentiable."""
    m = elastic * c_m
    d = c_j - m
    a2 = 3.0 * d
    b2 = -6.0 * d * m - 3.0 * d**2
    c2 = 3.0 * d * m**2 + 3.0 * d**2 * m + d**3
    return a2, -b2, c2, a2, b2, c2


def f(c_r: float, c_m: float, c_j: float, elastic: float) -> float:
    """Feasibility penalty of one coordinate."""
    a1, b1, c1, a2, b2, c2 = coefficients(c_m, c_j, elastic)
    if c_r <= -c_j:
        return a1 * c_r**2 + b1 * c_r + c1
    if c_r < -elastic * c_m:
        return (-elastic * c_m - c_r) ** 3
    if c_r <= elastic * c_m:
        return 0.0
    if c_r < c_j:
        return (c_r - elastic * c_m) ** 3
    return a2 * c_r**2 + b2 * c_r + c2


def f_slope(c_r: float, c_m: float, c_j: float, elastic: float) -> float:
    a1, b1, _, a2, b2, _ = coefficients(c_m, c_j, elastic)
    if c_r <= -c_j:
        return 2.0 * a1 * c_r + b1
    if c_r < -elastic * c_m:
        return -3.0 * (-elastic * c_m - c_r) ** 2
    if c_r <= elastic * c_m:
        return 0.0
    if c_r < c_j:
        return 3.0 * (c_r - elastic * c_m) ** 2
    return 2.0 * a2 * c_r + b2


@dataclass
class Bounds:
    """c_m of V, A and J on each axis: ``highest[k][r]``, and ``lowest[k][r]`` as magnitudes.

    The paper has one c_m for both signs; here braking and accelerating may have different ones, and
    the lowest longitudinal speed is left to :func:`reversing`.
    """

    highest: list[list[float]]
    lowest: list[list[float]]
    weights: tuple[float, float, float]
    elastic: float
    joint: float
    reverse: float
    reverse_joint: float = 0.01


def feasibility(points: Points, dt: float, bounds: Bounds) -> tuple[float, Points]:
    """J_d and its gradient."""
    value = 0.0
    gradient = zeros(len(points))
    for k, control in enumerate(derivatives(points, dt)):
        for i in range(len(control)):
            for r in range(2):
                x = control[i][r]
                if k == 0 and r == 0 and x < 0.0:
                    continue
                c_m = bounds.highest[k][r] if x >= 0.0 else bounds.lowest[k][r]
                w = bounds.weights[k]
                cost = w * f(x, c_m, bounds.joint * c_m, bounds.elastic)
                slope = w * f_slope(x, c_m, bounds.joint * c_m, bounds.elastic)
                value += cost
                for q in range(k + 2):
                    gradient[i + q][r] += slope * _STENCIL[k + 1][q] / dt ** (k + 1)
    return value, gradient


def reversing(points: Points, dt: float, bounds: Bounds) -> tuple[float, Points]:
    """Penalty of longitudinal speeds below zero, f with c_m = 0, and its gradient.

    Not in the paper, which bounds |v| and lets its car reverse. Its weight is not part of lambda_d.
    """
    value = 0.0
    gradient = zeros(len(points))
    v = derivatives(points, dt)[0]
    for i in range(len(v)):
        if v[i][0] < 0.0:
            value += bounds.reverse * f(v[i][0], 0.0, bounds.reverse_joint, bounds.elastic)
            slope = bounds.reverse * f_slope(v[i][0], 0.0, bounds.reverse_joint, bounds.elastic)
            gradient[i][0] -= slope / dt
            gradient[i + 1][0] += slope / dt
    return value, gradient


# ---------------------------------------------------------------- IV-D: fitting


def fitting(points: Points, deformed: Points, p: int, dt: float) -> tuple[float, Points]:
    """J_f and its gradient: at the knots, displacement along the deformed curve^2 / 25 + across it^2."""
    value = 0.0
    n = len(points)
    gradient = zeros(n)
    knots = uniform_knots(n, p, 0.0, dt)
    for k in range(n - p + 1):
        t = k * dt
        old = evaluate(deformed, p, 0.0, dt, t)
        new = evaluate(points, p, 0.0, dt, t)
        velocity = evaluate(deformed, p, 0.0, dt, t, 1)
        speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2)
        along = [velocity[0] / speed, velocity[1] / speed] if speed > 1e-3 else [1.0, 0.0]
        shift = [new[0] - old[0], new[1] - old[1]]
        axial = shift[0] * along[0] + shift[1] * along[1]
        radial = -shift[0] * along[1] + shift[1] * along[0]
        value += axial**2 / 25.0 + radial**2
        slope = [
            2.0 * axial * along[0] / 25.0 - 2.0 * radial * along[1],
            2.0 * axial * along[1] / 25.0 + 2.0 * radial * along[0],
        ]
        for i in range(n):
            weight = basis(i, p, t, knots)
            for r in range(2):
                gradient[i][r] += weight * slope[r]
    return value, gradient


def weighted(terms: list[tuple[float, tuple[float, Points]]], n: int) -> tuple[float, Points]:
    """Sum of lambda * (value, gradient)."""
    value = 0.0
    gradient = zeros(n)
    for weight, (part, slope) in terms:
        value += weight * part
        for i in range(n):
            for r in range(2):
                gradient[i][r] += weight * slope[i][r]
    return value, gradient


def deformation_cost(
    points: Points,
    pairs: list[Pair],
    dt: float,
    bounds: Bounds,
    smooth: float,
    collide: float,
    feasible: float,
) -> tuple[float, Points]:
    """J = lambda_s J_s + lambda_c J_c + lambda_d J_d and its gradient."""
    terms = [
        (smooth, smoothness(points, dt)),
        (collide, collision(points, pairs)),
        (feasible, feasibility(points, dt, bounds)),
        (1.0, reversing(points, dt, bounds)),
    ]
    return weighted(terms, len(points))


def refinement_cost(
    points: Points,
    deformed: Points,
    p: int,
    dt: float,
    bounds: Bounds,
    smooth: float,
    feasible: float,
    fit: float,
) -> tuple[float, Points]:
    """J' = lambda_s J_s + lambda_d J_d + lambda_f J_f and its gradient (T' = T)."""
    terms = [
        (smooth, smoothness(points, dt)),
        (feasible, feasibility(points, dt, bounds)),
        (1.0, reversing(points, dt, bounds)),
        (fit, fitting(points, deformed, p, dt)),
    ]
    return weighted(terms, len(points))


# ---------------------------------------------------------------- from a problem to a curve


def bounds_of(problem: RepairProblem, ego: Any) -> Bounds:
    """The limits of a problem as c_m."""
    lim = problem.limits
    return Bounds(
        highest=[[lim.v_max, lim.v_lat], [lim.a_max, lim.a_lat], [lim.j_lon, lim.j_lat]],
        lowest=[[0.0, lim.v_lat], [-lim.a_min, lim.a_lat], [lim.j_lon, lim.j_lat]],
        weights=(ego.w_v, ego.w_a, ego.w_j),
        elastic=ego.elastic,
        joint=ego.joint,
        reverse=ego.reverse,
    )


def interpolate(x: float, grid: Any, values: Any) -> float:
    """Linear interpolation, constant beyond the ends."""
    if x <= grid[0]:
        return float(values[0])
    for k in range(len(grid) - 1):
        if x <= grid[k + 1]:
            share = (x - grid[k]) / (grid[k + 1] - grid[k])
            return float(values[k] + share * (values[k + 1] - values[k]))
    return float(values[-1])


def box_at(problem: RepairProblem, j: int, t: float) -> tuple[list[float], list[float]] | None:
    """Corners of obstacle j's inflated box at t, or None where it is absent."""
    grid = problem.occupancy.t
    step = float(grid[1] - grid[0]) if len(grid) > 1 else 1.0
    where = t / step
    if abs(where - round(where)) < 1e-6:
        where = float(round(where))
    if where < 0.0 or where > len(grid) - 1:
        return None
    k = math.floor(where)
    share = where - k
    corners = []
    for table in (problem.occupancy.lower, problem.occupancy.upper):
        corner = []
        for r in range(2):
            x = float(table[j][k][r])
            if share > 0.0:
                x = (1.0 - share) * x + share * float(table[j][k + 1][r])
            if math.isnan(x):
                return None
            corner.append(x)
        corners.append(corner)
    return corners[0], corners[1]


def side_at(problem: RepairProblem, j: int, t: float) -> int:
    """Side of obstacle j at t: 0 behind, 1 ahead, 2 left, 3 right."""
    assert problem.passing is not None
    grid = problem.passing.guide.t
    nearest = 0
    for k in range(len(grid)):
        if abs(grid[k] - t) < abs(grid[nearest] - t) - 1e-9:
            nearest = k
    return int(problem.passing.side[j][nearest])


def make_pairs(problem: RepairProblem, shape: Points, p: int, dt: float) -> list[Pair]:
    """{p, v} pairs of the control points that may move, each at its own (Greville) time."""
    pairs = []
    for i in range(p, len(shape)):
        t = problem.t_rep + (i - (p - 1) / 2) * dt
        s, l = shape[i]  # noqa: E741
        if problem.passing is not None:
            for j in range(len(problem.occupancy)):
                box = box_at(problem, j, t)
                if box is None:
                    continue
                lower, upper = box
                side = side_at(problem, j, t)
                if side in (0, 1) and lower[1] < l < upper[1]:
                    if side == 0:
                        pairs.append(Pair(i, (lower[0], l), (-1.0, 0.0), problem.clearance))
                    else:
                        pairs.append(Pair(i, (upper[0], l), (1.0, 0.0), problem.clearance))
                if side in (2, 3) and lower[0] < s < upper[0]:
                    if side == 2:
                        pairs.append(Pair(i, (s, upper[1]), (0.0, 1.0), problem.clearance))
                    else:
                        pairs.append(Pair(i, (s, lower[1]), (0.0, -1.0), problem.clearance))
        if problem.lateral:
            right = interpolate(s, problem.bounds.s, problem.bounds.right)
            left = interpolate(s, problem.bounds.s, problem.bounds.left)
            edge = min(problem.clearance, 0.2)
            pairs.append(Pair(i, (s, right), (0.0, 1.0), edge))
            pairs.append(Pair(i, (s, left), (0.0, -1.0), edge))
    return pairs


def fit_reference(problem: RepairProblem, p: int, dt: float) -> Points:
    """Control points of the reference from t_rep on: exact state there, least squares after it."""
    n = max(1, math.ceil((problem.t_end - problem.t_rep) / dt - 1e-9)) + p
    knots = uniform_knots(n, p, 0.0, dt)
    times = [k * dt / 4.0 for k in range(4 * (n - p) + 1)]
    target = problem.reference.sample([problem.t_rep + t for t in times])
    state = [target.position[0], target.velocity[0], target.acceleration[0], target.jerk[0]]
    # the first p control points are the state at the start
    rows = []
    for order in range(p):
        unit_rows = []
        for i in range(p):
            unit = [[0.0, 0.0] for _ in range(p + 1)]
            unit[i][0] = 1.0
            unit_rows.append(evaluate(unit, p, 0.0, dt, 0.0, order)[0])
        rows.append(unit_rows)
    head = np.linalg.solve(np.array(rows), np.array([state[k] if k < 4 else [0.0, 0.0] for k in range(p)]))
    left, right = [], []
    for k, t in enumerate(times):
        row = [basis(i, p, t, knots) for i in range(n)]
        left.append(row[p:])
        right.append([target.position[k][r] - sum(row[i] * head[i][r] for i in range(p)) for r in range(2)])
    for i in range(n - p):
        row = [0.0] * n
        for k in range(p + 1):
            row[i + k] = 1e-6 * (-1.0) ** (p - k) * math.comb(p, k)
        left.append(row[p:])
        right.append([-sum(row[i] * head[i][r] for i in range(p)) for r in range(2)])
    tail = np.linalg.lstsq(np.array(left), np.array(right), rcond=None)[0]
    return [list(map(float, q)) for q in [*head, *tail]]


@dataclass
class TwoStages:
    """What the two optimisations found."""

    reference: Points
    deformed: Points
    refined: Points
    costs: tuple[float, float]
    iterations: tuple[int, int]
    evaluations: tuple[int, int]


def repair_once(problem: RepairProblem, ego: Any, p: int, dt: float) -> TwoStages:
    """Trajectory deformation, then trajectory refinement, by L-BFGS-B from SciPy."""
    from scipy.optimize import minimize

    bounds = bounds_of(problem, ego)
    reference = fit_reference(problem, p, dt)
    n = len(reference)
    shape = [list(q) for q in reference]
    if problem.passing is not None:
        guide = problem.passing.guide
        for i in range(p, n):
            t = problem.t_rep + (i - (p - 1) / 2) * dt
            shape[i] = [interpolate(t, guide.t, guide.position[:, r]) for r in range(2)]
    pairs = make_pairs(problem, shape, p, dt)
    axes = [0, 1] if problem.lateral else [0]

    def insert(x: Any, points: Points, first: int, last: int) -> Points:
        moved = [list(q) for q in points]
        at = 0
        for i in range(first, last):
            for r in axes:
                moved[i][r] = float(x[at])
                at += 1
        return moved

    def extract(points: Points, first: int, last: int) -> Any:
        return np.array([points[i][r] for i in range(first, last) for r in axes])

    def deform(x: Any) -> tuple[float, Any]:
        value, gradient = deformation_cost(
            insert(x, reference, p, n), pairs, dt, bounds,
            ego.deform.smooth, ego.deform.collision, ego.deform.feasible,
        )  # fmt: skip
        return value, extract(gradient, p, n)

    options = {"maxiter": ego.max_iterations, "gtol": ego.tolerance}
    first = minimize(deform, extract(reference, p, n), jac=True, method="L-BFGS-B", options=options)
    deformed = insert(first.x, reference, p, n)

    def refine(x: Any) -> tuple[float, Any]:
        value, gradient = refinement_cost(
            insert(x, deformed, p, n - p), deformed, p, dt, bounds,
            ego.refine.smooth, ego.refine.feasible, ego.refine.fit,
        )  # fmt: skip
        return value, extract(gradient, p, n - p)

    if n <= 2 * p:
        costs = (float(first.fun), float(first.fun))
        return TwoStages(reference, deformed, deformed, costs, (int(first.nit), 0), (int(first.nfev), 0))
    second = minimize(refine, extract(deformed, p, n - p), jac=True, method="L-BFGS-B", options=options)
    return TwoStages(
        reference, deformed, insert(second.x, deformed, p, n - p), (float(first.fun), float(second.fun)),
        (int(first.nit), int(second.nit)), (int(first.nfev), int(second.nfev)),
    )  # fmt: skip


# ---------------------------------------------------------------- feasibility and Algorithm 1


def first_collision(problem: RepairProblem, curve: LiteralCurve) -> float | None:
    """First scenario step at which the ego, a point, is inside an inflated box."""
    steps = math.floor((problem.t_end - problem.t_rep) / problem.dt + 1e-6)
    for k in range(steps + 1):
        t = problem.t_rep + k * problem.dt
        s, l = evaluate(curve.points, curve.degree, curve.t_start, curve.spacing, min(t, curve.t_end))  # noqa: E741
        for j in range(len(problem.occupancy)):
            box = box_at(problem, j, t)
            if box is not None and box[0][0] < s < box[1][0] and box[0][1] < l < box[1][1]:
                return t
    return None


@dataclass
class LiteralProbe:
    """One t_rep: the verdict and where the time went [s]."""

    t_rep: float
    feasible: bool
    reason: str
    stages: TwoStages
    solve_time: float
    collision_time: float
    kinematic_time: float


@dataclass
class LiteralResult:
    """What the search found."""

    f_ttr: float | None
    curve: LiteralCurve | None
    probes: list[LiteralProbe] = field(default_factory=list)
    wall_time: float = 0.0


def drivable(problem: RepairProblem, curve: LiteralCurve, checker: Any, check: str) -> bool:
    """The kinematic check: the drivability checker on every transition, or the package's direct check."""
    from repair.curves.base import SplicedCurve
    from repair.vehicle.commonroad_ks import official_check
    from repair.vehicle.transitions import direct_check

    whole = SplicedCurve(problem.reference, curve, problem.t_rep)
    states = checker.drive(whole, problem.t_end).every(checker.config.substeps)
    scene = checker.scene
    if check == "official":
        return bool(official_check(states, scene.dt, scene.vehicle).ok.all())
    return bool(direct_check(states, scene.dt, scene.vehicle).ok.all())


def probe(problem: RepairProblem, checker: Any, config: Any, check: str) -> tuple[LiteralProbe, LiteralCurve]:
    """Repair at one t_rep and check it."""
    begin = time.perf_counter()
    stages = repair_once(problem, config.ego, config.repair.degree, config.repair.spacing)
    curve = LiteralCurve(problem.t_rep, config.repair.spacing, config.repair.degree, stages.refined)
    solved = time.perf_counter()
    hit = first_collision(problem, curve)
    collided = time.perf_counter()
    reason = "" if hit is None else f"collision at {hit:.1f} s"
    if hit is None and not drivable(problem, curve, checker, check):
        reason = "kinematics"
    times = (solved - begin, collided - solved, time.perf_counter() - collided)
    return LiteralProbe(problem.t_rep, not reason, reason, stages, *times), curve


def literal_search(
    problem_source: Any, conflict: Any, checker_like: Any, settings: Any, check: str = "official"
) -> LiteralResult:
    """Algorithm 1, bisecting on the grid of Delta T.

    Parameters
    ----------
    problem_source : ProblemSource
        Gives the repair problems of a t_rep; each is tried until one is feasible.
    conflict : Conflict
        Its time is the TTC.
    checker_like : Checker
        Drives the vehicle along a curve; the kinematic check needs the states.
    settings : repair.config.Config
        Sections ``search``, ``repair`` and ``ego``.
    check : str
        ``official``: the drivability checker on every transition (as the paper); ``direct``: the
        package's own check.
    """
    begin = time.perf_counter()
    delta_t = settings.search.delta_t
    end = conflict.time if settings.search.upper is None else min(conflict.time, settings.search.upper)
    result = LiteralResult(None, None)
    feasible, infeasible = -1, math.ceil(end / delta_t - 1e-9)
    k = 0
    while infeasible - feasible > 1:
        ok = False
        for problem in problem_source.at(k * delta_t):
            found, curve = probe(problem, checker_like, settings, check)
            result.probes.append(found)
            if found.feasible:
                result.f_ttr, result.curve, ok = problem.t_rep, curve, True
                break
        if ok:
            feasible = k
        else:
            infeasible = k
        k = (feasible + infeasible) // 2
    result.wall_time = time.perf_counter() - begin
    return result


# ---------------------------------------------------------------- measurement


def best_of(call: Any, repeats: int, number: int = 1) -> float:
    """Shortest time of one call [s]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        for _ in range(number):
            call()
        times.append((time.perf_counter() - begin) / number)
    return min(times)


def cost_times(problem: RepairProblem, config: Any) -> dict[str, float]:
    """Time of one evaluation of J and of J' with gradient [s], literal and as the package does it."""
    from repair.solvers.ego.backend import EgoBackend
    from repair.solvers.ego.minimise import minimiser

    p, dt, ego = config.repair.degree, config.repair.spacing, config.ego
    stages = repair_once(problem, ego, p, dt)
    pairs = make_pairs(problem, stages.reference, p, dt)
    bounds = bounds_of(problem, ego)
    weights, again = ego.deform, ego.refine
    costs: list[Any] = []
    usual = minimiser(ego)

    def spy(cost: Any, *arguments: Any, **keys: Any) -> Any:
        costs.append(cost)
        return usual(cost, *arguments, **keys)

    EgoBackend(ego, degree=p, spacing=dt, minimise=spy).solve(problem)
    times = {
        "literal J": best_of(
            lambda: deformation_cost(
                stages.refined, pairs, dt, bounds, weights.smooth, weights.collision, weights.feasible
            ), 5, 5,
        ),
        "literal J'": best_of(
            lambda: refinement_cost(
                stages.refined, stages.deformed, p, dt, bounds, again.smooth, again.feasible, again.fit
            ), 5, 5,
        ),
    }  # fmt: skip
    for label, cost in zip(("package J", "package J'"), (costs[0], costs[-1]), strict=True):
        u = np.zeros(cost.size)
        times[label] = best_of(lambda cost=cost, u=u: cost(u), 5, 200)
    return times


def main(path: str, preset: str = "scenario_1") -> None:
    """Print the times of the literal transcription and of the package."""
    from repair.config import load_config
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene
    from repair.search.search import search_f_ttr
    from repair.solvers.registry import make_backend

    config = load_config(preset=preset)
    prepared = prepare(load_scene(path), config)
    source, conflict, checker = prepared.source, prepared.conflict, prepared.checker
    backend = make_backend("ego", config)
    for name, seconds in cost_times(source.at(0.0)[0], config).items():
        print(f"{name:12s} {1e6 * seconds:9.1f} us")
    found = search_f_ttr(source, conflict, backend, checker, config.search)
    package = best_of(lambda: search_f_ttr(source, conflict, backend, checker, config.search), 10)
    print(f"package search {1e3 * package:9.2f} ms, F-TTR {found.f_ttr}")
    for check in ("official", "direct"):
        runs = [literal_search(source, conflict, checker, config, check) for _ in range(3)]
        run = min(runs, key=lambda r: r.wall_time)
        fields = ("solve_time", "collision_time", "kinematic_time")
        parts = [sum(getattr(q, name) for q in run.probes) for name in fields]
        print(
            f"literal search ({check}) {1e3 * run.wall_time:9.2f} ms, F-TTR {run.f_ttr}, "
            f"{run.wall_time / package:.0f} times as long; solve, collision, kinematics: "
            + ", ".join(f"{1e3 * part:.1f}" for part in parts)
            + " ms"
        )
        for q in run.probes:
            print(f"  t_rep {q.t_rep:.2f}: {q.reason or 'feasible'}, iterations {q.stages.iterations}")


if __name__ == "__main__":
    import sys

    main(*sys.argv[1:])
