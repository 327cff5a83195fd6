"""The hard-constraint backend: its rows, its bounds, its statuses, and what it recomputes."""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest
from tests import toy
from tests.contract import problems

from repair.arrays import frozen
from repair.backend.base import SolveStatus
from repair.curves.bspline import UniformBSpline
from repair.deadline import OutOfTime
from repair.problem.problem import SIDE_AXIS, SIDE_SIGN, Maneuver, Side
from repair.scene.frame import FrenetFrame
from repair.scene.road.bounds import LateralBounds
from repair.solvers.casadi.backend import CasadiBackend
from repair.solvers.casadi.buffered import Buffered, KeptBySize
from repair.solvers.casadi.instance import lay_out, limit_values
from repair.solvers.casadi.model import Model, Solution, build_model, megabytes
from repair.solvers.casadi.nlp import _nonlinear, plane_acceleration
from repair.solvers.casadi.residuals import residuals_of
from repair.solvers.casadi.rows import RowKind
from repair.solvers.casadi.separation import NOBODY, ROAD, SIDE_OF_BOUND, road_room, separate
from repair.solvers.casadi.settings import CasadiConfig
from repair.solvers.casadi.sides import open_sides
from repair.solvers.casadi.windows import Windows

INF = np.inf


def windows(start=0.0, count=4, width=0.1, degree=3):
    edges = start + width * np.arange(count + 1)
    row = np.arange(count)[:, None] * degree + np.arange(degree + 1)
    return Windows(edges[:-1], edges[1:], row, np.arange(degree + 1) / degree)


def separated(problem, side, w=None, room=None):
    w = w or windows()
    shape = np.zeros((*w.row.shape, 2))
    sides = np.full((len(problem.occupancy), len(w.start)), side, dtype=np.intp)
    return separate(problem, w, int(w.row.max()) + 1, shape, room, sides)


def owners(found, side):
    return {found.owner(row, side) for row in range(len(found.lower))}


# -- separation ------------------------------------------------------------------------------------


def test_the_tables_of_the_sides_are_in_their_order():
    tables = {side: (SIDE_AXIS[side], SIDE_SIGN[side]) for side in Side}
    assert tables == {Side.BEHIND: (0, -1), Side.AHEAD: (0, 1), Side.LEFT: (1, 1), Side.RIGHT: (1, -1)}
    assert {side for pair in SIDE_OF_BOUND for side in pair} == set(Side)
    for axis, (lower, upper) in enumerate(SIDE_OF_BOUND):
        assert (tables[lower], tables[upper]) == ((axis, 1), (axis, -1))


def test_a_linear_edge_is_taken_over_exactly():
    problem = toy.problem([toy.box((20.0, 25.0), (-1.0, 1.0), v=(3.0, 0.0))], lateral=False)
    found = separated(problem, Side.BEHIND)
    np.testing.assert_allclose(found.upper[:, 0], 20.0 + 3.0 * found.times - 0.1, atol=1e-9)
    assert owners(found, Side.BEHIND) == {100}
    assert np.isinf(found.lower).all()
    assert np.isinf(found.upper[:, 1]).all()


@pytest.mark.parametrize(
    "side, end, axis, value",
    [(Side.AHEAD, "lower", 0, 25.1), (Side.LEFT, "lower", 1, 1.1), (Side.RIGHT, "upper", 1, -1.1)],
)
def test_sides_bound_their_own_axis(side, end, axis, value):
    problem = toy.problem([toy.box((20.0, 25.0), (-1.0, 1.0))])
    room = (np.full(4, -6.0), np.full(4, 6.0))
    found = separated(problem, side, room=room)
    np.testing.assert_allclose(getattr(found, end)[:, axis], value)


def test_windows_that_straddle_a_step_cover_its_kink():
    """Windows of 0.1 s that begin at 0.05 s see the edge of a box that jerks at every step."""
    bare = toy.problem([toy.box((20.0, 25.0), (-1.0, 1.0))], lateral=False)
    lower = bare.occupancy.lower.copy()
    lower[0, ::2, 0] -= 0.4
    problem = replace(bare, occupancy=replace(bare.occupancy, lower=frozen(lower)))
    w = windows(start=0.05)
    found = separated(problem, Side.BEHIND, w)
    t = np.linspace(0.05, 0.45, 401)
    edge = problem.occupancy.at(t)[0][0, :, 0] - problem.margin
    for k in range(4):
        share = (t - w.start[k]) / 0.1
        own = (share >= 0.0) & (share <= 1.0)
        points = found.upper[w.row[k], 0]
        assert (points[0] + (points[-1] - points[0]) * share[own] <= edge[own] + 1e-9).all()


def test_an_obstacle_that_is_there_for_an_instant_bounds_that_instant():
    problem = toy.problem([toy.box((20.0, 25.0), (-1.0, 1.0), present=(0.2, 0.2))], lateral=False)
    found = separated(problem, Side.BEHIND)
    bounded = np.isfinite(found.upper[:, 0])
    np.testing.assert_allclose(found.times[bounded], [0.2])


def test_an_obstacle_that_appears_within_a_window_bounds_all_of_it():
    problem = toy.problem([toy.box((20.0, 25.0), (-1.0, 1.0), present=(0.2, INF))], lateral=False)
    found = separated(problem, Side.BEHIND, windows(start=0.05))
    np.testing.assert_array_equal(np.isfinite(found.upper[:, 0]), found.times > 0.149)


def test_who_starts_nearer_than_the_margin_keeps_its_distance():
    problem = toy.problem([toy.box((0.04, 5.0), (-1.0, 1.0), v=(20.0, 0.0))], lateral=False)
    found = separated(problem, Side.BEHIND)
    np.testing.assert_allclose(found.upper[0, 0], 0.0, atol=1e-12)


def test_the_tightest_of_two_wins_and_is_named():
    boxes = [toy.box((30.0, 35.0), (-1.0, 1.0)), toy.box((20.0, 25.0), (-1.0, 1.0))]
    found = separated(toy.problem(boxes, lateral=False), Side.BEHIND)
    np.testing.assert_allclose(found.upper[:, 0], 19.9)
    assert owners(found, Side.BEHIND) == {101}


def test_obstacles_out_of_the_roads_reach_ask_for_nothing():
    problem = toy.problem([toy.box((20.0, 25.0), (7.0, 9.0))])
    room = (np.full(4, -6.0), np.full(4, 6.0))
    found = separated(problem, Side.BEHIND, room=room)
    assert np.isinf(found.upper[:, 0]).all()
    np.testing.assert_allclose(found.upper[:, 1], 6.0)
    assert owners(found, Side.RIGHT) == {ROAD}
    assert owners(found, Side.BEHIND) == {NOBODY}


def test_the_room_is_that_of_the_narrowest_place():
    bounds = LateralBounds(frozen([0, 10, 20, 30]), frozen([-3, -1, -3, -3]), frozen([3, 3, 2, 3]))
    right, left = road_room(bounds, np.array([5.0, 12.0]), np.array([15.0, 14.0]), 0.0, 0.0, 0.0)
    np.testing.assert_allclose(right, [-1.0, -1.4])
    np.testing.assert_allclose(left, [2.5, 2.6])


def test_the_narrowest_place_is_found_anywhere():
    """Against a fine grid, before, within and beyond the table."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        s = frozen(np.sort(rng.uniform(0.0, 30.0, 12)))
        bounds = LateralBounds(s, frozen(rng.uniform(-4.0, -1.0, 12)), frozen(rng.uniform(1.0, 4.0, 12)))
        low = rng.uniform(-5.0, 35.0, 8)
        high = low + rng.choice([0.0, 0.1, 3.0, 20.0], 8)
        right, left = road_room(bounds, low, high, 0.0, 0.0, 0.05)
        for k in range(8):
            fine = np.union1d(np.linspace(low[k], high[k], 200), s[(s >= low[k]) & (s <= high[k])])
            most, least = bounds.at(fine)
            np.testing.assert_allclose(right[k], min(most.max() + 0.05, 0.0))
            np.testing.assert_allclose(left[k], max(least.min() - 0.05, 0.0))


# -- the plane -------------------------------------------------------------------------------------


def test_accelerations_in_the_plane_are_those_of_the_driven_path():
    """Against second differences of the positions on an axis whose curvature changes."""
    u = np.linspace(0.0, 60.0, 200)
    frame = FrenetFrame.from_points(np.column_stack([u, 8.0 * np.sin(u / 15.0)]))
    s = np.arange(0.0, 60.0, 0.05)
    problem = replace(toy.problem([]), curvature_s=frozen(s), curvature=frozen(frame.curvature(s)))
    t = np.arange(0.0, 4.0, 1e-3)
    position = np.column_stack([5.0 + 6.0 * t + 0.5 * t**2, 1.5 * np.sin(t)])
    velocity = np.column_stack([6.0 + t, 1.5 * np.cos(t)])
    acceleration = np.column_stack([np.ones_like(t), -1.5 * np.sin(t)])
    states = np.stack([position, velocity, acceleration], axis=1)
    along, across = plane_acceleration(problem, states)
    xy = frame.to_cartesian(position[:, 0], position[:, 1])
    truth = np.gradient(np.gradient(xy, t, axis=0), t, axis=0)
    size = np.hypot(along, across)[5:-5]
    np.testing.assert_allclose(size, np.hypot(*truth.T)[5:-5], atol=0.03)


def bend(curvature=0.1, **keys):
    s = np.arange(0.0, 200.0, 0.5)
    kappa = curvature * np.clip((s - 15.0) / 10.0, 0.0, 1.0)
    return replace(problems.guided(toy.problem([], lateral=False, t_end=5.0, **keys)), curvature_s=frozen(s),
                   curvature=frozen(kappa))  # fmt: skip


@pytest.mark.parametrize("solver", ["ipopt", "sqpmethod"])
def test_it_slows_down_for_a_bend(solver):
    """10 m/s into a curvature of 0.1 1/m would be 10 m/s²; the limit is 4 m/s² across."""
    problem = bend()
    result = CasadiBackend(CasadiConfig(solver=solver)).solve(problem)
    assert result.status is SolveStatus.SOLVED, result.detail
    samples = result.curve.sample(np.arange(0.0, 5.0, 1e-3))
    lateral = problem.curvature_at(samples.position[:, 0]) * samples.velocity[:, 0] ** 2
    assert lateral.max() <= 4.0 + 0.01
    assert np.hypot(lateral, samples.acceleration[:, 0]).max() <= 8.0 + 1e-6


@pytest.mark.parametrize("solver", ["ipopt", "sqpmethod"])
def test_the_optimum_of_the_linear_rows_is_the_answer_only_where_it_keeps_the_others(monkeypatch, solver):
    """No solver is asked on a straight road, and would have said the same; in a bend it is."""
    asked, solve = [], Model.solve

    def spy(self, *rest):
        asked.append(self.structure.solver)
        return solve(self, *rest)

    monkeypatch.setattr(Model, "solve", spy)
    backend = CasadiBackend(CasadiConfig(solver=solver))
    slower = toy.problem([toy.box((20.0, 25.0), (-1.0, 1.0), v=(4.0, 0.0))], lateral=False)
    for problem in (problems.guided(slower), problems.static_block_left()):
        found = backend.solve(problem)
        assert not asked
        with monkeypatch.context() as patch:
            patch.setattr("repair.solvers.casadi.backend._answered", lambda *_: False)
            its_own = backend.solve(problem)
        assert asked
        asked.clear()
        assert found.status is its_own.status is SolveStatus.SOLVED
        assert found.objective > 1.0
        np.testing.assert_allclose(found.objective, its_own.objective, rtol=1e-5)
        np.testing.assert_allclose(found.curve.points, its_own.curve.points, atol=1e-3)
    backend.solve(bend())
    assert solver in asked


def test_the_nonlinear_rows_are_those_of_the_nlp():
    """What is computed without CasADi, against its own values: bounds in between are kept, or are not."""
    problem = replace(
        problems.static_block_left(), curvature=frozen([0.0, 0.02]), curvature_s=frozen([0.0, 50.0])
    )
    model = build_model(CasadiBackend().structure(problem))
    instance, points = lay_out(problem, model)
    x = casadi.SX.sym("x", len(model.unknowns(points)))
    data = instance.sample_data(points)
    m = len(points) - model.structure.degree
    along, across, rest = _nonlinear(model, [x[:m], x[m:]], casadi.DM(data.T))
    rows = casadi.Function("rows", [x], [casadi.vertcat(along**2 + across**2, across, *rest)])
    value = np.asarray(rows(model.unknowns(points))).ravel()
    linear = np.full(model.linear_count, np.nan)
    for k in range(0, len(value), 7):
        for shift, kept in ((1e-6, True), (-1e-6, False)):
            high = np.full(len(value), np.inf)
            high[k] = value[k] + shift
            low = np.full(len(value), -np.inf)
            assert instance.keeps_curved(points, np.append(linear, low), np.append(linear, high)) is kept


# -- rows ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lateral", [True, False])
def test_every_row_is_bounded_by_what_its_kind_says(lateral):
    """Against the limits themselves, row by row, with nothing given yet."""
    problem = problems.static_block_left() if lateral else problems.static_block()
    model = build_model(CasadiBackend().structure(problem))
    low, high = limit_values(problem.limits)
    limits, samples, linear = problem.limits, len(model.tau), model.linear_count
    for rows, kept, place in zip(
        model.linear, model.kept, np.cumsum([0, *map(len, model.kept)]), strict=False
    ):
        own = model.kind[place : place + len(kept)]
        assert (own == rows.kind).all()
        assert (RowKind(rows.kind) is RowKind.PLACE) == (rows.family == "obstacles")
    circle = (0.995 * limits.a_total) ** 2
    assert (high[model.kind[linear : linear + samples]] == circle).all()
    assert (high[model.kind[linear + samples : linear + 2 * samples]] == limits.a_lat).all()
    bounds = {"velocity": (limits.v_max, limits.v_lat), "acceleration": (limits.a_max, limits.a_lat)}
    for rows in model.linear:
        if rows.family in bounds:
            assert high[rows.kind] == bounds[rows.family][rows.axis]
    assert len(model.kind) == linear + samples * (6 if lateral else 2)
    assert (low <= high).all()


# -- statuses --------------------------------------------------------------------------------------


def test_residuals_see_what_a_curve_breaks():
    backend, problem = CasadiBackend(), problems.static_block()
    result = backend.solve(problem)
    instance, points = lay_out(problem, build_model(backend.structure(problem)))
    separation, _, why, _ = open_sides(instance, points)
    assert why == ""
    moved = result.curve.points - instance.origin
    assert max(residuals_of(instance, separation, moved).values()) <= 1e-6
    moved = moved.copy()
    moved[-3:, 0] += 30.0
    broken = residuals_of(instance, separation, moved)
    assert broken["obstacles"] > 10.0
    assert broken["jerk"] > 1.0


def test_the_model_is_built_once():
    backend = CasadiBackend(spacing=0.23)
    backend.solve(problems.static_block())
    before = build_model.cache_info()
    again = backend.solve(problems.crossing_car())
    after = build_model.cache_info()
    assert after.misses == before.misses
    assert again.status is SolveStatus.SOLVED


def test_models_are_kept_as_far_as_there_is_room():
    structure = CasadiBackend().structure(problems.static_block())
    kept = KeptBySize(lambda key: object(), megabytes, 3.5 * megabytes(structure))
    four = [replace(structure, tolerance=10.0**-k) for k in range(4, 8)]
    made = [kept(key) for key in four[:3]]
    assert [kept(key) for key in four[:3]] == made
    kept(four[3])  # and the first one goes
    assert kept.cache_info().currsize == 3
    assert kept(four[2]) is made[2]
    assert kept(four[0]) is not made[0]
    large = replace(structure, n=200)
    assert kept(large) is kept(large)
    assert kept.cache_info().currsize == 1
    assert build_model.megabytes <= build_model.cache_info().maxsize


def test_what_was_not_asked_for_lately_goes_sooner():
    kept = KeptBySize(lambda key: object(), lambda key: 1.0, 4.0, 2.0, 6)
    first = [kept(key) for key in range(4)]
    assert [kept(key) for key in range(4)] == first  # all of them lately
    for _ in range(6):
        kept(3)
    kept(4)
    assert kept.cache_info().currsize == 2
    assert kept(3) is first[3]


def test_of_what_cannot_be_made_nothing_stays():
    def make(key):
        raise OutOfTime("no time")

    kept = KeptBySize(make, lambda key: 1.0, 4.0)
    for key in range(3):
        with pytest.raises(OutOfTime):
            kept(key)
    assert not kept._asked
    assert kept.cache_info().misses == 3


def test_the_nlp_is_made_when_it_is_first_solved(monkeypatch):
    """Its time is building time, and what CasADi says against it then is a status too."""
    backend = CasadiBackend(CasadiConfig(solver="sqpmethod"), spacing=0.29)
    straight = toy.problem([], lateral=False, t_end=5.0)
    model = build_model(backend.structure(straight))
    assert backend.solve(straight).status is SolveStatus.SOLVED
    assert not model.compiled
    first, again = backend.solve(bend()), backend.solve(bend())
    assert model.compiled
    assert again.build_time < 0.5 * first.build_time

    def refuse(*_):
        raise RuntimeError("first line\nno licence")

    monkeypatch.setattr(casadi, "nlpsol", refuse)
    other = CasadiBackend(CasadiConfig(solver="sqpmethod", max_iterations=77), spacing=0.29)
    refused = other.solve(bend())
    assert refused.status is SolveStatus.UNAVAILABLE
    assert "no licence" in refused.detail
    assert not build_model(other.structure(bend())).compiled


@pytest.mark.parametrize("solver, most", [("ipopt", 200), ("sqpmethod", 80)])
def test_each_solver_has_the_iterations_that_it_needs(solver, most):
    for given, wanted in ((None, most), (7, 7), (1000, 1000)):
        config = CasadiConfig(solver=solver, max_iterations=given)
        assert CasadiBackend(config).structure(bend()).max_iterations == wanted


def test_iteration_limit():
    config = CasadiConfig(solver="ipopt", max_iterations=1)
    result = CasadiBackend(config).solve(bend())
    assert result.status is SolveStatus.ITERATION_LIMIT
    assert "Maximum_Iterations_Exceeded" in result.detail
    if result.curve is not None:
        assert max(result.residuals.values()) <= 1e-6


def test_a_missing_plugin_is_a_status():
    result = CasadiBackend(CasadiConfig(solver="knitro")).solve(problems.static_block())
    assert result.status is SolveStatus.UNAVAILABLE
    assert result.curve is None
    assert "knitro" in result.detail


@pytest.mark.parametrize(
    "word", ["Restoration_Failed", "Invalid_Number_Detected", "Error_In_Step_Computation"]
)
def test_other_words_of_the_solver_are_numerical_errors(monkeypatch, word):
    monkeypatch.setattr(Model, "solve", lambda self, x0, *rest: Solution(x0, word, 3, 0.0))
    result = CasadiBackend().solve(bend())
    assert result.status is SolveStatus.NUMERICAL_ERROR
    assert word in result.detail


def test_what_the_solver_throws_is_a_status(monkeypatch):
    backend, problem = CasadiBackend(spacing=0.31), bend()

    def throws(**keys):
        raise RuntimeError("first line\nthe plugin gave up")

    monkeypatch.setattr(build_model(backend.structure(problem)), "nlp", throws)
    result = backend.solve(problem)
    assert result.status is SolveStatus.NUMERICAL_ERROR
    assert "the plugin gave up" in result.detail


def test_claimed_but_not_kept_is_a_numerical_error(monkeypatch):
    """A solver that calls anything solved is not believed."""

    def lies(self, x0, *rest):
        return Solution(x0 + np.linspace(0.0, 40.0, len(x0)), "Solve_Succeeded", 1, 0.0)

    monkeypatch.setattr(Model, "solve", lies)
    result = CasadiBackend().solve(bend())
    assert result.status is SolveStatus.NUMERICAL_ERROR
    assert result.curve is None
    assert "is violated by" in result.detail


@pytest.mark.parametrize("solver", ["ipopt", "sqpmethod"])
def test_it_keeps_quiet(solver, capfd):
    backend = CasadiBackend(CasadiConfig(solver=solver), spacing=0.27)
    for make in (*problems.FEASIBLE.values(), problems.too_near, bend):
        backend.solve(make())
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err == ""


@pytest.mark.parametrize("cause, expected", [(KeyboardInterrupt(), KeyboardInterrupt), (None, SystemError)])
def test_an_interrupt_inside_casadi_is_an_interrupt(cause, expected):
    """Python reports what was raised below CasADi's buffers as the cause of a SystemError."""

    class Function:
        def buffer(self):
            return None, self.evaluate

        def evaluate(self):
            raise SystemError("returned a result with an exception set") from cause

        def name_in(self):
            return []

        name_out = name_in

    with pytest.raises(expected):
        Buffered(Function())()


def test_two_obstacles_without_a_gap_are_named():
    boxes = [toy.box((20.0, 30.0), (-2.0, 2.0)), toy.box((-60.0, -3.0), (-2.0, 2.0), v=(12.0, 0.0))]
    bare = problems.forced(toy.problem(boxes, lateral=False, t_end=3.0))
    side = bare.passing.side.copy()
    side[1] = Side.AHEAD
    result = CasadiBackend().solve(replace(bare, passing=replace(bare.passing, sides=side)))
    assert result.status is SolveStatus.INFEASIBLE
    assert "obstacle 10" in result.detail


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_degrees(degree):
    problem = problems.static_block_left()
    result = CasadiBackend(degree=degree, spacing=0.3).solve(problem)
    assert result.status is SolveStatus.SOLVED, result.detail
    assert isinstance(result.curve, UniformBSpline)
    assert result.curve.degree == degree
    assert problems.clearance(problem, result.curve) >= problem.margin - 1e-6


def test_the_body_stays_on_a_narrow_road():
    """Left of a box on a road that just holds the body: its ends must not swing out."""
    bounds = LateralBounds(frozen([0.0, 500.0]), frozen([-3.0, -3.0]), frozen([2.4, 2.4]))
    boxes = [toy.box((30.0, 40.0), (-2.0, 2.0))]
    problem = problems.guided(toy.problem(boxes, bounds=bounds))
    result = CasadiBackend().solve(problem)
    assert result.status is SolveStatus.SOLVED, result.detail
    samples = result.curve.sample(np.arange(0.1, problem.t_end, 0.1))
    swing = 2.15 * np.sin(np.arctan2(samples.velocity[:, 1], samples.velocity[:, 0]))
    assert np.abs(samples.position[:, 1] + swing).max() <= 2.4 + 1e-3


@pytest.mark.parametrize("solver", ["ipopt", "sqpmethod"])
def test_a_road_that_leaves_room_for_one_value_has_a_status(solver):
    """Bounds that touch must not reach CasADi the wrong way round."""
    narrow = LateralBounds(
        frozen([0.0, 75.0, 77.0, 500.0]), frozen([-6.0, -6.0, -0.02, -0.02]), frozen([6.0, 6.0, 0.02, 0.02])
    )
    ahead = toy.problem([toy.box((40.0, 50.0), (-2.0, 2.0))], v0=20.0, t_end=5.0, bounds=narrow)
    result = CasadiBackend(CasadiConfig(solver=solver)).solve(problems.guided(ahead, Maneuver.LEFT))
    # an SQP that does not converge proves nothing
    none = {"ipopt": SolveStatus.INFEASIBLE, "sqpmethod": SolveStatus.NUMERICAL_ERROR}[solver]
    assert result.status in (SolveStatus.SOLVED, none)
    assert (result.curve is None) == (result.status is none)
