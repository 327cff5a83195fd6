"""The QP, its corridor, its solvers, and the three different ways to have no answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.contract import problems
from tests.toy import box, constant, problem

from repair.backend.base import SolveStatus
from repair.baselines.qptr import backend as qptr
from repair.baselines.qptr import qp
from repair.baselines.qptr.backend import QptrBackend, make
from repair.baselines.qptr.corridor import Corridor, NoCorridor, build_corridor, require_open
from repair.baselines.qptr.qp import QpAnswer, infeasibility, proven_violation, solve_projection
from repair.baselines.qptr.qp_residuals import RawAnswer
from repair.baselines.qptr.qp_solvers import OSQP_TOLERANCES, SETTINGS, osqp_answer
from repair.baselines.qptr.qp_trial import braking_problem, require_solver
from repair.baselines.qptr.settings import QptrConfig
from repair.baselines.qptr.time_grid import time_grid
from repair.baselines.qptr.walls import line_below
from repair.config import load_config
from repair.curves.base import FrenetTrajectory
from repair.errors import BackendError, ConfigError
from repair.problem.problem import Maneuver, Passing
from repair.problem.surroundings import sides_of

SOLVERS = ("osqp", "daqp", "clarabel")


def guided(boxes, accelerations, *, shift=0.0, **keys):
    """A problem whose guide changes speed at a constant rate to a stop, and moves sideways by ``shift``."""
    base = problem(boxes, **keys)
    t = base.t_rep + base.dt * np.arange(round((base.t_end - base.t_rep) / base.dt) + 1)
    tau, v0 = t - base.t_rep, base.start[1, 0]
    run = np.minimum(tau, v0 / -accelerations) if accelerations < 0 else tau
    u = np.clip(tau / 1.5, 0.0, 1.0)
    side = base.start[0, 1] + shift * u**3 * (10 - 15 * u + 6 * u**2)
    position = np.column_stack([base.start[0, 0] + v0 * run + 0.5 * accelerations * run**2, side])
    zero = np.zeros_like(position)
    guide = FrenetTrajectory(t, position, zero, zero, zero)
    maneuver = Maneuver.LEFT if shift else Maneuver.YIELD
    sides = sides_of(position, *base.occupancy.at(t))
    return problem(boxes, passing=Passing(maneuver, guide, sides, 0.0), **keys)


def stop_before(s, **keys):
    return guided([box((s, s + 10), (-1, 1))], -8.0, lateral=False, **keys)


def corridor_of(task, pieces=8):
    return build_corridor(task, time_grid(task, pieces))


# -- corridor --------------------------------------------------------------------------------------


def test_corridor_ends_before_the_box_and_holds_the_guide():
    task = stop_before(20.0)
    corridor = corridor_of(task)
    assert corridor.s[1].max() <= 20.0 - task.margin + 1e-9
    low, high = corridor.control_bounds(5, 0)
    times = np.concatenate(
        [np.linspace(a, b, 6) for a, b in zip(corridor.edges[:-1], corridor.edges[1:], strict=True)]
    )
    guide = np.interp(times, task.passing.guide.t, task.passing.guide.position[:, 0])
    assert np.all(guide >= low - 1e-6)
    assert np.all(guide <= high + 1e-6)


def test_every_trapezoid_is_below_the_free_space():
    moving = guided([box((18, 24), (-1, 1), v=(3.0, 0.0), present=(0.7, 3.2))], -3.0, lateral=False)
    corridor = corridor_of(moving)
    lower, _ = moving.occupancy.at(moving.occupancy.t)
    for i in range(8):
        for t, bound in zip(moving.occupancy.t, lower[0, :, 0], strict=True):
            if corridor.edges[i] <= t <= corridor.edges[i + 1] and np.isfinite(bound):
                weight = (t - corridor.edges[i]) / 0.5
                line = (1 - weight) * corridor.s[1, i, 0] + weight * corridor.s[1, i, 1]
                assert line <= bound - moving.margin + 1e-5


def test_box_beside_the_path_does_not_matter():
    task = guided([box((5, 50), (2, 4))], 0.0, lateral=False)
    corridor = corridor_of(task)
    assert corridor.s[1].min() > 50.0


def test_passing_on_the_left_closes_the_right():
    task = guided([box((25, 35), (-2, 2))], 0.0, shift=3.0)
    corridor = corridor_of(task)
    beside = (corridor.edges[:-1] >= 2.5) & (corridor.edges[1:] <= 3.5)
    assert np.all(corridor.l[0, beside] >= 2.0 + task.margin - 1e-9)


def test_no_corridor_where_full_braking_comes_too_far():
    # -8 m/s² takes 6.25 m to the stop, and 0.1 m are kept from the box.
    close = stop_before(6.4)
    corridor_of(close)
    closer = stop_before(6.3)
    with pytest.raises(NoCorridor):
        corridor_of(closer)


def test_no_corridor_where_the_start_is_inside():
    task = guided([box((-1, 5), (-1, 1))], -4.0, lateral=False)
    with pytest.raises(NoCorridor):
        corridor_of(task)


def test_the_times_of_a_piece_lead_from_edge_to_edge():
    """On and between steps, and beyond the last step."""
    for t_rep, t_end in ((0.0, 4.0), (0.33, 3.77), (4.0, 8.6)):
        grid = time_grid(problem([], t_rep=t_rep, t_end=t_end), 7)
        np.testing.assert_allclose(grid.times[grid.index[:, 0]], grid.edges[:-1])
        np.testing.assert_allclose(grid.times[grid.index[:, -1]], grid.edges[1:])


@pytest.mark.parametrize("seed", range(5))
def test_the_line_below_many_points_is_that_of_all_pairs(seed):
    """Many times are taken by the hull of their points, few by all pairs: the same lines."""
    random = np.random.default_rng(seed)
    grid = time_grid(problem([], t_rep=0.33, t_end=4.0), 7)
    at = 8.0 * grid.times + random.normal(0.0, 0.3, len(grid.times))
    guide, values = at[grid.index], (at + random.uniform(-1.0, 20.0, len(at)))[grid.index]
    assert len(grid.base) > 0
    by_hull = replace(grid, base=grid.base[:0], second=grid.second[:0], ratio=grid.ratio[..., :0])
    np.testing.assert_allclose(line_below(by_hull, values, guide), line_below(grid, values, guide), atol=1e-5)


def test_a_short_time_step_adds_no_pairs_of_times():
    steps = np.arange(801) * 0.01
    short = replace(problem([]).occupancy, t=steps, lower=np.empty((0, 801, 2)), upper=np.empty((0, 801, 2)))
    grid = time_grid(replace(problem([], t_rep=0.0, t_end=4.0), occupancy=short), 8)
    assert grid.index.shape == (8, 51)
    assert grid.ratio.nbytes < 10 * grid.index.nbytes


def test_a_corridor_is_open_or_refused():
    """The start may lie in it or not; nothing else of the corridor is different."""
    task = problem([], lateral=False)
    corridor = corridor_of(task)
    require_open(task, corridor)
    with pytest.raises(NoCorridor, match="beyond the first trapezoid"):
        require_open(task, Corridor(corridor.edges, corridor.s - 200.0, corridor.l))


def test_corridor_without_obstacles_is_what_the_speed_limit_leaves():
    corridor = corridor_of(problem([], lateral=False))
    assert np.ptp(corridor.s[1]) == 0.0
    assert corridor.s[1, 0, 0] == pytest.approx(30.0 * 4.0 + 1.0)


# -- backend ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
def test_solved_within_corridor_and_limits(solver):
    task = stop_before(20.0)
    answer = QptrBackend(QptrConfig(solver=solver)).solve(task)
    assert answer.status is SolveStatus.SOLVED
    assert max(answer.residuals.values()) < 1e-3
    samples = answer.curve.sample(np.linspace(0.0, 4.0, 200))
    assert samples.position[:, 0].max() <= 20.0 - task.margin + 1e-3
    assert samples.velocity[:, 0].min() >= -1e-4
    assert samples.acceleration[:, 0].min() >= task.limits.a_min - 1e-3
    begin = answer.curve.sample([0.0])
    np.testing.assert_allclose(
        [begin.position[0], begin.velocity[0], begin.acceleration[0]], task.start, atol=1e-6
    )


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_corridor_and_no_solution_are_two_answers(solver):
    backend = QptrBackend(QptrConfig(solver=solver))
    closed = backend.solve(stop_before(6.0))
    assert closed.status is SolveStatus.NO_CORRIDOR
    assert closed.curve is None
    # Full braking at once would do; with limited jerk the polynomial cannot.
    impossible = backend.solve(stop_before(6.6))
    assert impossible.status is SolveStatus.INFEASIBLE
    assert impossible.curve is None
    assert "no common point" in impossible.detail


def test_solvers_agree_on_verdict_and_objective():
    backends = [QptrBackend(QptrConfig(solver=s)) for s in SOLVERS]
    for s in (6.0, 6.6, 8.0, 10.0, 12.0, 16.0, 25.0, 60.0):
        answers = [b.solve(stop_before(s)) for b in backends]
        assert len({a.status for a in answers}) == 1, (s, [a.detail for a in answers])
        objectives = [a.objective for a in answers if a.curve is not None]
        assert np.ptp(objectives) <= 1e-3 * (1.0 + min(objectives, default=0.0)) if objectives else True


@pytest.mark.parametrize("name", sorted({**problems.FEASIBLE, **problems.INFEASIBLE}))
def test_solvers_agree_on_the_contract_problems(name):
    made = problems.FEASIBLE[name]() if name in problems.FEASIBLE else problems.INFEASIBLE[name][0]()
    answers = [QptrBackend(QptrConfig(solver=s)).solve(made) for s in SOLVERS]
    assert len({a.status for a in answers}) == 1, [a.detail for a in answers]
    objectives = [a.objective for a in answers if a.curve is not None]
    assert np.ptp(objectives) <= 1e-3 * (1.0 + min(objectives, default=0.0)) if objectives else True


def test_swerves_and_ends_parallel_to_the_path():
    task = guided([box((25, 35), (-2, 2))], 0.0, shift=3.0)
    answer = QptrBackend(QptrConfig(solver="daqp")).solve(task)
    assert answer.status is SolveStatus.SOLVED
    beside = answer.curve.sample(np.linspace(2.6, 3.4, 40))
    assert beside.position[:, 1].min() >= 2.0 + task.margin - 1e-4
    end = answer.curve.sample([answer.curve.t_end])
    np.testing.assert_allclose(end.velocity[0, 1], 0.0, atol=1e-6)


def test_follows_the_reference_where_nothing_is_in_the_way():
    answer = QptrBackend(QptrConfig(solver="daqp")).solve(problem([], lateral=False))
    t = np.linspace(0.0, 4.0, 30)
    np.testing.assert_allclose(answer.curve.sample(t).position, constant().sample(t).position, atol=1e-6)
    assert answer.objective == pytest.approx(0.0, abs=1e-9)


def test_residuals_and_objective_are_those_of_the_curve():
    task = guided([box((25, 35), (-2, 2))], 0.0, shift=3.0)
    backend = QptrBackend(QptrConfig())
    answer = backend.solve(task)
    times = np.linspace(0.0, 4.0, 20_001)
    ours, reference = answer.curve.sample(times), task.reference.sample(times)
    integrand = np.sum(ours.jerk**2 + 0.1 * (ours.position - reference.position) ** 2, axis=1)
    # Jerk jumps at the joints, so the midpoints of fine steps are what to expect the integral from.
    assert answer.objective == pytest.approx(
        0.5 * (integrand[1:] + integrand[:-1]) @ np.diff(times), rel=1e-3
    )
    points = answer.curve.points
    bounds = [corridor_of(task).control_bounds(5, axis) for axis in (0, 1)]
    low, high = (np.stack(b, axis=1).reshape(points.shape) for b in zip(*bounds, strict=True))
    excess = float(np.maximum(points - high, low - points).max())
    assert answer.residuals["corridor"] == pytest.approx(max(excess, 0.0), abs=1e-9)
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        limit = {1: (30.0, 3.0), 2: (8.0, 4.0), 3: (60.0, 60.0)}[order]
        assert np.all(np.abs(answer.curve.derivative_points(order)) <= np.array(limit) + 1e-6), name
    assert set(answer.residuals) == {"corridor", "velocity", "acceleration", "jerk", "start", "joints"}


def test_residuals_tell_a_curve_that_breaks_the_limits(monkeypatch):
    def claim(rows, *_):
        return QpAnswer(SolveStatus.SOLVED, np.full(rows.shape[1], 20.0), 0.0, "claimed")

    monkeypatch.setattr(qptr, "solve_projection", claim)
    answer = QptrBackend(QptrConfig()).solve(stop_before(20.0))
    for order, name, low, high in ((1, "velocity", 0.0, 30.0), (2, "acceleration", -8.0, 4.0)):
        values = answer.curve.derivative_points(order)[..., 0].ravel()[1:]
        expected = max(values.max() - high, low - values.min())
        assert expected > 0.1
        assert answer.residuals[name] == pytest.approx(expected, rel=1e-9)
    jerk = np.abs(answer.curve.derivative_points(3)[..., 0]).max()
    assert answer.residuals["jerk"] == pytest.approx(jerk - 60.0, rel=1e-9)
    assert max(answer.residuals["start"], answer.residuals["joints"]) < 1e-6


@pytest.mark.parametrize("solver", SOLVERS)
def test_answer_does_not_depend_on_what_was_solved_before(solver):
    near, far = stop_before(12.0), stop_before(16.0)
    backend = QptrBackend(QptrConfig(solver=solver))
    first = backend.solve(near).curve.points
    backend.solve(far)
    np.testing.assert_array_equal(backend.solve(near).curve.points, first)
    np.testing.assert_array_equal(QptrBackend(QptrConfig(solver=solver)).solve(near).curve.points, first)


def test_no_time_left_is_a_status():
    answer = QptrBackend(QptrConfig(solver="osqp")).solve(stop_before(20.0), time_limit=0.0)
    assert answer.status is SolveStatus.TIME_LIMIT


def test_problem_without_duration_is_malformed():
    with pytest.raises(BackendError, match="no duration"):
        QptrBackend(QptrConfig(solver="daqp")).solve(problem([], t_rep=4.0, t_end=4.0))


# -- solvers ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
def test_offered_solvers_are_not_refused(solver):
    require_solver(solver)


def test_unknown_solver_names_those_there_are():
    with pytest.raises(BackendError, match=r"nosuch.*daqp"):
        QptrBackend(QptrConfig(solver="nosuch"))


def test_solver_with_wrong_answers_is_refused_by_name():
    def broken(rows, *_):
        return RawAnswer(np.zeros(rows.shape[1]), np.zeros(len(rows)), "solved")

    with pytest.raises(BackendError, match=r"'daqp' is refused: .*braking problem"):
        require_solver("daqp", call=broken)


def test_answer_is_judged_by_its_residuals_not_by_its_name():
    rows, lower, upper = braking_problem(14.75)
    claim = RawAnswer(np.full(18, 1e3), np.zeros(len(rows)), "solved")
    answer = solve_projection(rows, lower, upper, "daqp", call=lambda *_: claim)
    assert answer.z is None
    assert answer.status is SolveStatus.NUMERICAL_ERROR


@pytest.mark.parametrize("solver", SOLVERS)
def test_infinite_bounds_bound_nothing_and_nothing_is_written_to(solver):
    rows, lower, upper = braking_problem(14.75)
    idle = np.concatenate([rows, rows[:5]])
    none = np.full(5, np.inf)
    given = idle.copy(), np.append(lower, -none), np.append(upper, none)
    expected = solve_projection(rows, lower, upper, solver)
    found = solve_projection(*given, solver)
    assert found.status is SolveStatus.SOLVED
    np.testing.assert_allclose(found.z, expected.z, atol=1e-5)
    np.testing.assert_array_equal(given[0], idle)
    # The layout is no matter: daqp itself would read the wrong numbers.
    strided = np.stack([given[1], given[2]], axis=1)
    again = solve_projection(np.asfortranarray(idle), strided[:, 0], strided[:, 1], solver)
    np.testing.assert_allclose(again.z, expected.z, atol=1e-5)


@pytest.mark.parametrize("gap", [0.0, 5.0, 13.0, 13.7])
def test_no_solution_is_proved_without_the_linear_program(gap, monkeypatch):
    least = infeasibility(*braking_problem(gap))
    assert 1e-5 < proven_violation(*braking_problem(gap)) <= least + 1e-9
    monkeypatch.setattr(qp, "infeasibility", lambda *_: pytest.fail("not needed"))
    assert solve_projection(*braking_problem(gap), "daqp").status is SolveStatus.INFEASIBLE


def test_linear_program_decides_where_there_is_no_proof(monkeypatch):
    def tired(*_):
        return RawAnswer(None, None, "maximum iterations reached")

    monkeypatch.setattr(qp, "proven_violation", lambda *_: 0.0)
    assert solve_projection(*braking_problem(13.0), "daqp").status is SolveStatus.INFEASIBLE
    answer = solve_projection(*braking_problem(14.75), "osqp", call=tired)
    assert answer.status is SolveStatus.ITERATION_LIMIT


@pytest.mark.parametrize("gap", [13.76, 13.85, 14.75, 100.0])
def test_nothing_is_proved_against_a_problem_with_a_solution(gap):
    assert proven_violation(*braking_problem(gap)) == 0.0


def test_a_loose_osqp_answer_is_tightened():
    def loose(rows, lower, upper, *_):
        return osqp_answer(rows, lower, upper, SETTINGS["osqp"] | {"polishing": False}, OSQP_TOLERANCES[:1])

    exact = solve_projection(*braking_problem(13.85), "daqp").z
    np.testing.assert_allclose(solve_projection(*braking_problem(13.85), "osqp").z, exact, atol=1e-4)
    assert solve_projection(*braking_problem(13.85), "osqp", call=loose).z is None


def test_shortest_stop_of_the_braking_problem():
    assert infeasibility(*braking_problem(13.80)) == pytest.approx(0.0, abs=1e-9)
    assert infeasibility(*braking_problem(13.70)) > 1e-3


def test_configuration():
    assert make(load_config(backend="qptr")).config.solver == "daqp"
    config = load_config(backend="qptr", overrides=["qptr.solver=daqp", "qptr.continuity=3"])
    assert make(config).config.continuity == 3
    with pytest.raises(ConfigError, match=r"qptr\.continuity"):
        load_config(overrides=["qptr.continuity=7"])
    with pytest.raises(BackendError, match="continuity"):
        QptrBackend(QptrConfig(degree=3, continuity=3))
