"""The soft backend: costs and gradients against the literal transcription, optima against exact ones."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from benchmarks import literal
from scipy.optimize import minimize
from scipy.sparse import csr_array
from tests import toy

from repair.arrays import frozen
from repair.backend.base import SolveResult, SolveStatus
from repair.curves.base import FrenetTrajectory
from repair.curves.bases import derivative_matrix, fitted_knots
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.problem.problem import Maneuver, Passing, Side
from repair.solvers.ego.backend import EgoBackend
from repair.solvers.ego.bounds import bend_speed, slowest_bend
from repair.solvers.ego.cost_structure import SIZES, Sizes, cost_structure
from repair.solvers.ego.minimise import Minimum, minimiser, newton
from repair.solvers.ego.pairs import Pairs, anchor_pairs, pushes
from repair.solvers.ego.settings import DeformWeights, EgoConfig, RefineWeights
from repair.solvers.ego.stages import Stages

# The paper's two stages and nothing else.
PLAIN = EgoConfig(rebounds=0, guard=False)
SIDES = (Side.BEHIND, Side.AHEAD, Side.LEFT, Side.RIGHT)
# 1. a block on the path, 2. a car that comes from the right, 3. a car in front that brakes
BOXES = (
    toy.box((22.0, 30.0), (-1.5, 1.2)),
    toy.box((14.0, 24.0), (-9.0, -4.0), v=(0.0, 3.0)),
    toy.box((12.0, 20.0), (-1.0, 1.0), v=(4.0, 0.0)),
)


def passing_by(problem, side):
    """A guide that moves to that side of everything; whether it is free does not matter here."""
    t = problem.t_rep + toy.DT * np.arange(round((problem.t_end - problem.t_rep) / toy.DT) + 1)
    tau = t - problem.t_rep
    rate = {Side.BEHIND: -4.0, Side.AHEAD: 2.0}.get(side, 0.0)
    sideways = {Side.LEFT: 3.0, Side.RIGHT: -3.0}.get(side, 0.0) * np.clip(tau / 1.5, 0.0, 1.0)
    v0 = problem.start[1, 0]
    stop = np.minimum(tau, v0 / 4.0) if rate < 0 else tau
    position = np.column_stack([problem.start[0, 0] + v0 * stop + 0.5 * rate * stop**2, sideways])
    rest = frozen(np.zeros((len(t), 2)))
    guide = FrenetTrajectory(frozen(t), frozen(position), rest, rest, rest)
    return Passing(Maneuver.YIELD, guide, np.full((len(problem.occupancy), len(t)), side, dtype=np.int8), 0.0)


def make_problem(side=Side.BEHIND, *, boxes=BOXES, **keys):
    bare = toy.problem(boxes, **keys)
    return replace(bare, passing=passing_by(bare, side))


@pytest.mark.parametrize("spacing", [0.1, 0.37])
@pytest.mark.parametrize("first, last, axes", [(0, 12, 2), (3, 12, 2), (3, 10, 1)])
def test_what_is_laid_out_once_holds_for_every_spacing(spacing, first, last, axes):
    n, width, weight = 12, 3 * axes, 1.7
    made = cost_structure(n, axes, first, last, spacing, weight, width)
    orders = [derivative_matrix(n, k, spacing) for k in (1, 2, 3)]
    assert np.array_equal(made.stack, np.vstack(orders))
    free = np.kron(np.vstack(orders)[:, first:last], np.eye(axes))
    assert np.array_equal(made.dense, np.concatenate((free, -free)))
    smooth = np.kron(np.vstack(orders[1:])[:, first:last], np.eye(axes))
    hessian = 2.0 * weight * smooth.T @ smooth
    size = len(hessian)
    band = np.zeros((size, width + 1))
    for c in range(size):
        for r in range(c, min(c + width + 1, size)):
            band[c, r - c] = hessian[r, c]
    assert made.band.reshape(size, width + 1) == pytest.approx(band, rel=1e-12, abs=1e-9)


def swerving_reference(n=14, spacing=0.4):
    rng = np.random.default_rng(5)
    s = 10.0 * spacing * np.arange(n)
    return UniformBSpline(0.0, spacing, 3, frozen(np.column_stack([s, 0.4 * rng.normal(size=n)])))


class Run(NamedTuple):
    """The two costs that the backend made, the minima it took of them (on both axes), and its result."""

    deformation: object
    refinement: object
    deformed: object
    refined: object
    result: SolveResult


def run(problem, config=PLAIN, *, spacing=0.4, sizes=SIZES):
    made, minimise = [], minimiser(config)

    def spy(cost, deadline, **how):
        made.append((cost, minimise(cost, deadline, **how)))
        return made[-1][1]

    result = EgoBackend(config, spacing=spacing, minimise=spy, sizes=sizes).solve(problem)
    n, spacing = fitted_knots(problem.t_end - problem.t_rep, spacing, 3)
    initial = fit_to_curve(problem.reference, problem.t_rep, n, 3, spacing).points
    costs, minima = zip(*made, strict=True)
    return Run(*costs, *(Minimum(whole(points, initial), *rest) for points, *rest in minima), result)


def whole(moved, initial):
    """Control points on both axes, from those on the axes that move."""
    return np.concatenate((moved, initial[:, moved.shape[1] :]), axis=1)


CASES = [
    pytest.param(
        side, lateral, t_end, spacing, id=f"{side.name.lower()}-{'sl' if lateral else 's'}-{t_end}-{spacing}"
    )
    for side in SIDES
    for lateral in (True, False)
    for t_end, spacing in ((4.0, 0.4), (2.5, 0.2))
]


@pytest.mark.parametrize("side, lateral, t_end, spacing", CASES)
def test_gradients_and_hessians_by_finite_differences(side, lateral, t_end, spacing):
    problem = make_problem(side, t_end=t_end, lateral=lateral)
    made = run(problem, replace(PLAIN, max_iterations=20), spacing=spacing)
    rng = np.random.default_rng(0)
    for cost in (made.deformation, made.refinement):
        for metre in (0.05, 0.5, 5.0):  # the last one lies beyond all joints
            u = metre * rng.normal(size=cost.size)
            point = cost(u)
            hessian = from_band(cost.hessian(point))
            for _ in range(3):
                direction = rng.normal(size=cost.size)
                direction /= np.linalg.norm(direction)
                step = 1e-6
                ahead, behind = cost(u + step * direction), cost(u - step * direction)
                numeric = (ahead.value - behind.value) / (2.0 * step)
                room = 1e-5 * np.linalg.norm(point.gradient) + 1e-10 * abs(point.value) / step
                assert point.gradient @ direction == pytest.approx(numeric, abs=room)
                bent = (ahead.gradient - behind.gradient) / (2.0 * step)
                room = 1e-4 * np.abs(hessian @ direction).max() + 1e-9 * np.abs(point.gradient).max() / step
                np.testing.assert_allclose(hessian @ direction, bent, atol=room)


@pytest.mark.parametrize("side, lateral, t_end, spacing", CASES)
def test_small_and_large_problems_are_evaluated_alike(side, lateral, t_end, spacing):
    """One dense matrix below a size, the structure of the spline above it, sparse beyond another."""
    problem = make_problem(side, t_end=t_end, lateral=lateral, reference=swerving_reference(18))
    costs = []
    small = Sizes(dense=10**9, bands=10**9)
    for sizes in (small, Sizes(dense=0, bands=0), Sizes(dense=0, bands=0, sparse=0)):
        made = run(problem, spacing=spacing, sizes=sizes)
        costs.append((made.deformation, made.refinement))
    rng = np.random.default_rng(2)
    for dense, *others in zip(*costs, strict=True):
        assert dense.structure.dense is not None
        assert dense.structure.bands is not None
        for metre in (0.0, 0.3, 4.0):
            u = metre * rng.normal(size=dense.size)
            one = dense(u)
            room = 1e-6 + 1e-9 * np.abs(one.gradient).max()  # where terms cancel, their rounding stays
            for cost, kind in zip(others, (np.ndarray, csr_array), strict=True):
                assert cost.structure.dense is None
                assert cost.structure.bands is None
                assert isinstance(cost.structure.free, kind)
                other = cost(u)
                assert one.value == pytest.approx(other.value, rel=1e-9)
                np.testing.assert_allclose(one.gradient, other.gradient, rtol=1e-9, atol=room)
                np.testing.assert_allclose(dense.hessian(one), cost.hessian(other), rtol=1e-9, atol=1e-9)
                np.testing.assert_allclose(dense.closed_form(), cost.closed_form(), rtol=1e-6, atol=1e-6)


class Shifted:
    """A cost with another place to begin at, and how often it was evaluated."""

    def __init__(self, cost, begin):
        self.cost, self.begin, self.size, self.evaluated = cost, begin, cost.size, 0

    def __call__(self, u):
        self.evaluated += 1
        return self.cost(self.begin + u)

    def hessian(self, point):
        return self.cost.hessian(point)

    def points(self, u):
        return self.cost.points(self.begin + u)


def test_newton_takes_no_step_from_the_minimum():
    cost = run(make_problem(Side.BEHIND)).deformation
    exact = newton(cost, 100, 1e-9)
    begin = (exact.points - cost.points(np.zeros(cost.size)))[cost.free].ravel()
    again = Shifted(cost, begin)
    minimum = newton(again, 100, 1e-6)
    assert again.evaluated == 1
    assert minimum.converged
    np.testing.assert_array_equal(minimum.points, cost.points(begin))


def from_band(band):
    """The symmetric matrix of a band in lower form."""
    size = band.shape[1]
    matrix = np.zeros((size, size))
    for offset, diagonal in enumerate(band[:size]):
        matrix += np.diag(diagonal[: size - offset], -offset)
        if offset:
            matrix += np.diag(diagonal[: size - offset], offset)
    return matrix


@pytest.mark.parametrize("side, lateral, t_end, spacing", CASES)
def test_costs_are_the_literal_ones(side, lateral, t_end, spacing):
    problem = make_problem(side, t_end=t_end, lateral=lateral)
    config = replace(
        PLAIN,
        w_v=0.7,
        w_a=1.3,
        w_j=0.4,
        deform=DeformWeights(1.5, 20.0, 0.8),
        refine=RefineWeights(0.7, 3.0, 0.6),
    )
    check_costs(problem, config, spacing, run(problem, config, spacing=spacing))


def check_costs(problem, config, spacing, made):
    n, spacing = fitted_knots(problem.t_end - problem.t_rep, spacing, 3)
    axes = [0, 1] if problem.lateral else [0]
    bounds = literal.bounds_of(problem, config)
    initial = fit_to_curve(problem.reference, problem.t_rep, n, 3, spacing)
    shape = initial.points.copy()
    guide = problem.passing.guide
    for i in range(3, n):
        shape[i] = [np.interp(initial.greville[i], guide.t, guide.position[:, r]) for r in range(2)]
    pairs = literal.make_pairs(problem, shape.tolist(), 3, spacing)
    if not problem.lateral:
        pairs = [p for p in pairs if p.v[1] == 0.0]
    deformed = made.deformed.points.tolist()
    rng = np.random.default_rng(1)
    for scale in (0.0, 0.3, 3.0):
        u = scale * rng.normal(size=(n - 3) * len(axes))
        value, gradient, _ = made.deformation(u)
        points = whole(made.deformation.points(u), initial.points).tolist()
        weights = config.deform
        expected, slope = literal.deformation_cost(
            points, pairs, spacing, bounds, weights.smooth, weights.collision, weights.feasible
        )
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-6)
        free = np.array(slope)[3:, axes].ravel()
        np.testing.assert_allclose(gradient, free, rtol=1e-9, atol=1e-9 * np.abs(gradient).max() + 1e-6)

        u = scale * rng.normal(size=(n - 6) * len(axes))
        value, gradient, _ = made.refinement(u)
        weights = config.refine
        expected, slope = literal.refinement_cost(
            whole(made.refinement.points(u), initial.points).tolist(),
            deformed,
            3,
            spacing,
            bounds,
            weights.smooth,
            weights.feasible,
            weights.fit,
        )
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-6)
        free = np.array(slope)[3 : n - 3, axes].ravel()
        np.testing.assert_allclose(gradient, free, rtol=1e-9, atol=1e-9 * np.abs(gradient).max() + 1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_pairs_are_the_literal_ones(side):
    boxes = (*BOXES, toy.box((5.0, 60.0), (-1.0, 1.0), present=(1.0, 2.0)))  # appears and disappears
    problem = make_problem(side, boxes=boxes, t_rep=0.3)
    n = 13
    shape = fit_to_curve(problem.reference, 0.3, n, 3, 0.4)
    pairs = anchor_pairs(problem, shape.greville, shape.points, 3)
    mine = {
        (int(i), int(axis), float(sign), round(float(anchor), 9), round(float(s_f), 9))
        for i, axis, sign, anchor, s_f in zip(*pairs, strict=True)
    }
    expected = set()
    for pair in literal.make_pairs(problem, shape.points.tolist(), 3, 0.4):
        axis = 0 if pair.v[0] != 0.0 else 1
        expected.add((pair.i, axis, pair.v[axis], round(pair.p[axis], 9), round(pair.s_f, 9)))
    assert mine == expected
    assert len(pairs.row) == len(expected)
    assert min(pairs.row) >= 3


def test_distance_is_that_of_definition_3():
    problem = make_problem(Side.BEHIND)
    shape = fit_to_curve(problem.reference, 0.0, 13, 3, 0.4)
    pairs = anchor_pairs(problem, shape.greville, shape.points, 3)
    distances = pairs.distance(shape.points)
    for k in range(len(pairs.row)):
        v = np.zeros(2)
        v[pairs.axis[k]] = pairs.sign[k]
        anchor = shape.points[pairs.row[k]].copy()
        anchor[pairs.axis[k]] = pairs.anchor[k]
        assert distances[k] == pytest.approx((shape.points[pairs.row[k]] - anchor) @ v)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("lateral", [True, False])
@pytest.mark.parametrize("solver", ["newton", "lbfgs"])
def test_soft_optimum_is_the_exact_one(side, lateral, solver):
    """Where the quadratic part is made round the Hessian is at least the identity, which bounds the gap."""
    problem = make_problem(side, lateral=lateral)
    config = replace(PLAIN, solver=solver, max_iterations=1000)
    made = run(problem, config)
    for cost, minimum in ((made.deformation, made.deformed), (made.refinement, made.refined)):
        exact = by_trust_region(cost)
        best = cost(exact).value
        gap = minimum.cost - best
        size = 1 if solver == "newton" else cost.size  # L-BFGS looks at the gradient's largest entry
        assert -1e-9 * best - 1e-6 <= gap <= 0.5 * size * config.tolerance**2 + 1e-6
        root = np.linalg.cholesky(from_band(cost.quadratic()))
        u = (minimum.points[:, : cost.axes] - cost.points(np.zeros(cost.size)))[cost.free].ravel()
        assert np.linalg.norm(root.T @ (u - exact)) <= np.sqrt(size) * config.tolerance + 1e-5
        assert cost(u).value == pytest.approx(minimum.cost, rel=1e-9, abs=1e-6)
    assert made.result.status is SolveStatus.SOLVED
    assert made.result.objective == made.refined.cost


def by_trust_region(cost):
    """Minimum of a convex cost by somebody else's method, with a Hessian of difference quotients."""

    def hessian(u):
        step = 1e-6
        columns = [(cost(u + step * e)[1] - cost(u - step * e)[1]) / (2.0 * step) for e in np.eye(len(u))]
        return 0.5 * (np.array(columns) + np.array(columns).T)

    options = {"gtol": 1e-6, "maxiter": 3000}
    start, method = np.zeros(cost.size), "trust-exact"
    return minimize(lambda u: cost(u)[:2], start, jac=True, hess=hessian, method=method, options=options).x


@pytest.mark.parametrize("lateral", [True, False])
@pytest.mark.parametrize("spacing", [0.4, 0.1, 0.0125])
def test_both_minimisers_end_in_the_same_place(lateral, spacing):
    problem = make_problem(Side.BEHIND, lateral=lateral)
    config = replace(PLAIN, tolerance=1e-4, max_iterations=2000)
    results = [
        EgoBackend(replace(config, solver=name), spacing=spacing).solve(problem)
        for name in ("newton", "lbfgs")
    ]
    t = np.linspace(0.0, 4.0, 81)
    ours, theirs = (r.curve.sample(t).position for r in results)
    np.testing.assert_allclose(ours, theirs, atol=2e-3)
    assert results[0].objective == pytest.approx(results[1].objective, rel=1e-6)
    assert results[0].status is SolveStatus.SOLVED
    assert results[0].iterations < 60


def test_refined_start_and_end_are_those_of_the_deformation():
    result = EgoBackend(PLAIN).solve(make_problem(Side.LEFT))
    deformed, refined = result.stages["deformation"], result.stages["refinement"]
    np.testing.assert_array_equal(deformed.points[:3], refined.points[:3])
    np.testing.assert_array_equal(deformed.points[-3:], refined.points[-3:])
    assert not np.array_equal(deformed.points, refined.points)
    np.testing.assert_array_equal(result.curve.points, refined.points)


@pytest.mark.parametrize("t_rep", [0.0, 0.4, 1.1])
@pytest.mark.parametrize("degree", [3, 4, 5])
def test_repair_starts_in_the_state_of_the_reference(t_rep, degree):
    reference = swerving_reference(24)
    problem = make_problem(Side.BEHIND, t_rep=t_rep, reference=reference)
    result = EgoBackend(PLAIN, degree=degree, spacing=0.4).solve(problem)
    start, wanted = result.curve.sample(t_rep), reference.sample(t_rep)
    np.testing.assert_allclose(start.position, wanted.position, atol=1e-9)
    np.testing.assert_allclose(start.velocity, wanted.velocity, atol=1e-8)
    np.testing.assert_allclose(start.acceleration, wanted.acceleration, atol=1e-7)


def test_without_lateral_freedom_the_path_of_the_reference_is_kept():
    problem = make_problem(Side.BEHIND, lateral=False, reference=swerving_reference())
    result = EgoBackend(PLAIN).solve(problem)
    path = problem.reference.sample(np.linspace(0.0, 4.0, 401)).position
    driven = result.curve.sample(np.linspace(0.0, 4.0, 41)).position
    aside = np.interp(driven[:, 0], path[:, 0], path[:, 1])
    assert np.abs(driven[:, 0] - path[::10, 0]).max() > 1.0  # it is driven at another speed
    np.testing.assert_allclose(driven[:, 1], aside, atol=0.02)


def test_costs_are_the_literal_ones_where_the_reference_swerves():
    problem = make_problem(Side.BEHIND, lateral=True, reference=swerving_reference())
    check_costs(problem, PLAIN, 0.4, run(problem))


def test_costs_include_what_stands_sideways():
    problem = make_problem(Side.BEHIND, lateral=False, reference=swerving_reference())
    check_costs(problem, PLAIN, 0.4, run(problem))


def test_free_road_keeps_a_straight_reference():
    bare = toy.problem(())
    result = EgoBackend().solve(bare)
    t = np.linspace(0.0, 4.0, 21)
    np.testing.assert_allclose(result.curve.sample(t).position[:, 0], 10.0 * t, atol=1e-3)
    assert result.status is SolveStatus.SOLVED
    assert result.objective < 1e-3


def test_a_wall_is_kept_clear_of_and_rebounds_push_harder():
    boxes = (toy.box((25.0, 60.0), (-20.0, 20.0)),)
    problem = make_problem(Side.BEHIND, boxes=boxes, lateral=False)
    soft = EgoBackend(PLAIN).solve(problem)
    config = replace(PLAIN, deform=DeformWeights(collision=0.001))
    weak = EgoBackend(config).solve(problem)
    hard = EgoBackend(replace(config, rebounds=6)).solve(problem)
    end = [r.stages["deformation"].points[-1, 0] for r in (soft, weak, hard)]
    assert end[0] < 25.0
    assert end[1] > 25.0  # too soft: the control points collide
    assert end[2] < end[1]
    assert "round(s)" in hard.detail


@pytest.mark.parametrize("push", [1.0, 1.9, 3.0, 8.0, 200.0])
def test_lambda_c_is_doubled_as_often_as_it_takes(push):
    """One control point, pushed into a box by a constant force."""
    room, joint = 0.3, 3.0 * 0.3**2
    force = push * joint
    depth = room * (1.0 + force / joint) / 2.0  # where 6 D e - 3 D^2 is the force
    pairs = Pairs(*(np.array([v]) for v in (0, 0, -1.0, 10.0, room)))
    found = pushes(pairs, np.array([[10.0 - room + depth, 0.0]]))
    assert found == (math.ceil(math.log2(push)) if push > 1.0 else 0)
    assert force <= 2.0**found * joint + 1e-9  # with an excess of D it is out of the box


@pytest.mark.parametrize("at, kappa", [(3.0, 0.1), (3.0, 0.3), (6.0, 0.2)])
def test_in_a_bend_the_rounds_go_on_until_the_speed_fits_the_places(at, kappa):
    """With lambda_c doubled at once fewer rounds are needed for the boxes, and none fewer for the bend."""
    s = np.linspace(0.0, 150.0, 301)
    bends = kappa * np.exp(-(((s - at) / 4.0) ** 2))
    wall = (toy.box((6.0, 200.0), (-20.0, 20.0)),)
    problem = make_problem(Side.BEHIND, boxes=wall, lateral=False)
    problem = replace(problem, curvature_s=frozen(s), curvature=frozen(bends))
    config = EgoConfig(rebounds=3)
    n, spacing = fitted_knots(problem.t_end, 0.4, 3)
    initial = fit_to_curve(problem.reference, 0.0, n, 3, spacing)
    found = Stages(config, 3).deform(problem, initial, None)
    assert found.cap is not None
    speeds = np.diff(found.minimum.points[:, 0]) / spacing
    fits = (speeds <= 1.02 * bend_speed(problem, found.minimum.points)).all()
    assert fits or found.rounds == 1 + config.rebounds


def test_nobody_doubles_where_nothing_collides_or_no_room_is_wanted():
    none = Pairs(*(np.empty(0, dtype=np.intp) for _ in range(5)))
    assert pushes(none, np.zeros((3, 2))) == 0
    touching = Pairs(*(np.array([v]) for v in (0, 0, -1.0, 10.0, 0.0)))
    assert pushes(touching, np.array([[11.0, 0.0]])) == 1


@pytest.mark.parametrize("rebounds", [0, 1, 3])
def test_lambda_c_is_doubled_no_more_often_than_asked(rebounds):
    """The deformation is the same as that of a weight so many times larger."""
    boxes = (toy.box((5.0, 60.0), (-20.0, 20.0)),)  # too close to stop in front of it
    problem = make_problem(Side.BEHIND, boxes=boxes, lateral=False)
    found = EgoBackend(replace(PLAIN, rebounds=rebounds)).solve(problem)
    weight = PLAIN.deform.collision * 2.0**rebounds
    alike = EgoBackend(replace(PLAIN, deform=DeformWeights(collision=weight))).solve(problem)
    got, wanted = (r.stages["deformation"].points for r in (found, alike))
    np.testing.assert_allclose(got, wanted, atol=1e-3)
    assert got[-1, 0] > 5.0


def test_braking_does_not_reverse():
    boxes = (toy.box((16.0, 60.0), (-20.0, 20.0)),)
    problem = make_problem(Side.BEHIND, boxes=boxes, lateral=False, t_end=6.0)
    result = EgoBackend(EgoConfig()).solve(problem)
    assert result.curve.sample(np.linspace(0.0, 6.0, 200)).velocity[:, 0].min() > -0.06


def test_time_limit_gives_a_status_and_no_curve():
    result = EgoBackend(EgoConfig()).solve(make_problem(Side.LEFT), time_limit=0.0)
    assert result.status is SolveStatus.TIME_LIMIT
    assert result.curve is None
    assert "0 s" in result.detail


def test_iteration_limit_is_told():
    result = EgoBackend(replace(PLAIN, max_iterations=1)).solve(make_problem(Side.LEFT))
    assert result.status is SolveStatus.ITERATION_LIMIT
    assert result.curve is not None


def test_preconditioning_changes_the_path_and_not_the_goal():
    problem = make_problem(Side.LEFT)
    results = [
        EgoBackend(
            replace(PLAIN, solver="lbfgs", precondition=on, max_iterations=20_000, tolerance=1e-5)
        ).solve(problem)
        for on in (True, False)
    ]
    # The flat directions of the plain problem are hardly observed; what counts is the cost.
    assert results[0].objective <= results[1].objective * (1 + 1e-3) + 1e-3
    assert results[0].iterations < results[1].iterations


def test_solving_twice_gives_the_same_and_leaves_the_problem_alone():
    problem = make_problem(Side.RIGHT)
    before = (problem.start.copy(), problem.occupancy.lower.copy(), problem.passing.side.copy())
    backend = EgoBackend()
    first, second = backend.solve(problem), backend.solve(problem)
    np.testing.assert_array_equal(first.curve.points, second.curve.points)
    np.testing.assert_array_equal(before[0], problem.start)
    np.testing.assert_array_equal(before[1], problem.occupancy.lower)
    np.testing.assert_array_equal(before[2], problem.passing.side)
    with pytest.raises(ValueError, match="read-only"):
        first.curve.points[0, 0] = 1.0


@pytest.mark.parametrize("duration", [0.1, 0.4, 0.9, 1.3])
def test_short_repairs_have_a_result(duration):
    problem = make_problem(Side.BEHIND, t_rep=1.0, t_end=1.0 + duration)
    result = EgoBackend(spacing=0.4).solve(problem)
    assert result.curve is not None
    assert np.isfinite(result.curve.points).all()
    assert result.curve.t_end >= problem.t_end - 1e-9


def test_literal_two_stages_end_where_the_backend_ends():
    problem = make_problem(Side.BEHIND, lateral=False)
    config = replace(PLAIN, max_iterations=5000, tolerance=1e-4)
    plain = literal.repair_once(problem, config, 3, 0.4)
    made = run(problem, config)
    np.testing.assert_allclose(plain.deformed, made.deformed.points, atol=0.02)
    np.testing.assert_allclose(plain.refined, made.refined.points, atol=0.02)
    assert plain.costs == pytest.approx((made.deformed.cost, made.refined.cost), rel=1e-3)


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_literal_fit_of_the_reference_is_the_backends(degree):
    problem = make_problem(Side.BEHIND, t_rep=0.7)
    plain = literal.fit_reference(problem, degree, 0.4)
    fitted = fit_to_curve(problem.reference, 0.7, len(plain), degree, 0.4)
    np.testing.assert_allclose(fitted.points, plain, atol=1e-6)


def test_literal_search_finds_the_same_f_ttr_in_scenario_1(scenarios):
    from repair.config import load_config
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene
    from repair.search.search import search_f_ttr
    from repair.solvers.registry import make_backend

    path = scenarios / "DEU_Flensburg-6_1_T-1.xml"
    if not path.exists():
        pytest.skip(f"{path.name} is not in COMMONROAD_SCENARIOS")
    config = load_config(preset="scenario_1")
    prepared = prepare(load_scene(path), config)
    source, conflict, checker = prepared.source, prepared.conflict, prepared.checker
    fast = search_f_ttr(source, conflict, make_backend("ego", config), checker, config.search)
    plain = literal.literal_search(source, conflict, checker, config, check="direct")
    assert conflict.time == pytest.approx(2.9)
    assert plain.f_ttr == pytest.approx(fast.f_ttr)
    assert plain.f_ttr == pytest.approx(1.6)
    assert [p.t_rep for p in plain.probes] == pytest.approx([0.0, 0.8, 1.2, 1.6])
    for slow, quick in zip(plain.probes, fast.probes, strict=True):
        problem = source.at(slow.t_rep)[0]
        t = np.linspace(problem.t_rep, problem.t_end, 30)
        curve = UniformBSpline(problem.t_rep, 0.4, 3, np.array(slow.stages.refined))
        np.testing.assert_allclose(curve.sample(t).position, quick.solve.curve.sample(t).position, atol=0.05)


@pytest.mark.parametrize("solver", ["newton", "lbfgs"])
@pytest.mark.parametrize(
    "weights",
    [{"refine": RefineWeights(smooth=0.0, fit=0.0)}, {"deform": DeformWeights(smooth=0.0)}],
    ids=["refinement", "deformation"],
)
def test_without_smoothness_there_is_still_a_finite_curve(solver, weights):
    config = replace(PLAIN, solver=solver, **weights)
    result = EgoBackend(config).solve(make_problem(Side.BEHIND, lateral=False))
    assert result.curve is not None
    assert np.isfinite(result.curve.points).all()
    assert np.isfinite(result.objective)


def test_no_bend_is_slower_than_the_sharpest():
    rng = np.random.default_rng(3)
    s = np.linspace(0.0, 80.0, 30)
    problem = replace(
        make_problem(SIDES[0], lateral=False), curvature_s=s, curvature=0.1 * rng.uniform(-1.0, 0.4, 30)
    )
    points = np.column_stack([np.sort(rng.uniform(-10.0, 90.0, 200)), np.zeros(200)])
    allowed = bend_speed(problem, points)
    assert slowest_bend(problem) <= allowed.min() * (1.0 + 1e-12)
    assert slowest_bend(problem) > 0.8 * allowed.min()


def test_what_rests_is_charged_for_each_problem():
    stages = EgoBackend(PLAIN).stages
    for offset in (0.3, 0.5, 0.3):
        points = np.column_stack([np.arange(12.0), offset * np.arange(12.0) ** 2])
        for problem in (make_problem(SIDES[0], lateral=False), make_problem(SIDES[0], lateral=True)):
            fresh = EgoBackend(PLAIN).stages
            args = (problem, points, 0.4, PLAIN.deform)
            assert stages._resting(*args) == fresh._resting(*args)
            eased = replace(problem, limits=problem.limits.reserving(0.2))
            assert stages._resting(eased, *args[1:]) == fresh._resting(eased, *args[1:])
