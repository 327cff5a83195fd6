"""One contract for every backend: what a solve may return, on the same small problems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import toy
from tests.contract import problems

from repair.arrays import frozen
from repair.backend.base import Capabilities, Closest, SolveResult, SolveStatus
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.config import load_config
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.errors import BackendError
from repair.search.result import SearchStatus
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig
from repair.solvers.registry import BACKENDS, available, backend_names, make_backend, register

HARD = ("casadi-ipopt", "casadi-sqpmethod", "casadi-ipopt-sampled")
_OVERRIDES = {
    "casadi": {
        "casadi-ipopt": [],
        "casadi-sqpmethod": ["casadi.solver=sqpmethod"],
        "casadi-ipopt-sampled": ["casadi.obstacles=sampled"],
    }
}
VARIANTS = {
    variant: (name, overrides)
    for name, reason in available().items()
    if reason is None
    for variant, overrides in _OVERRIDES.get(name, {name: []}).items()
}
ALL = {**problems.FEASIBLE, **{name: make for name, (make, _) in problems.INFEASIBLE.items()}}


def backend_of(variant, *more):
    name, overrides = VARIANTS[variant]
    return make_backend(name, load_config(overrides=[*overrides, *more], backend=name))


@pytest.fixture(params=sorted(VARIANTS))
def variant(request):
    return request.param


def assert_contract(problem, result, capabilities):
    assert isinstance(result, SolveResult)
    assert isinstance(result.status, SolveStatus)
    assert result.build_time >= 0.0
    assert result.solve_time >= 0.0
    assert result.curve is not None or result.detail, "no curve and no word about why"
    if result.status is SolveStatus.SOLVED and result.residuals:
        assert max(result.residuals.values()) <= 1e-6
    if result.curve is None:
        return
    assert result.curve.t_start == pytest.approx(problem.t_rep)
    assert result.curve.t_end >= problem.t_end - 1e-9
    t = np.linspace(problem.t_rep, problem.t_end, 200)
    samples = result.curve.sample(t)
    assert all(np.isfinite(x).all() for x in (samples.position, samples.velocity, samples.acceleration))
    start = [samples.position[0], samples.velocity[0], samples.acceleration[0]]
    known = 2 if capabilities.jumps else 3
    np.testing.assert_allclose(start[:known], problem.start[:known], atol=1e-5)
    if not problem.lateral:
        np.testing.assert_allclose(
            samples.position[:, 1], problem.reference.sample(t).position[:, 1], atol=1e-6
        )


@pytest.mark.thinned(3)
@pytest.mark.parametrize("name", sorted(ALL))
def test_every_problem_keeps_the_contract(variant, name):
    problem = ALL[name]()
    backend = backend_of(variant)
    first, second = backend.solve(problem), backend.solve(problem)
    assert_contract(problem, first, backend.capabilities)
    assert second.status is first.status
    if isinstance(first.curve, UniformBSpline):
        np.testing.assert_array_equal(first.curve.points, second.curve.points)


@pytest.mark.parametrize("name", ["free_road", "static_block", "crossing_car"])
def test_easy_problems_are_solved(variant, name):
    problem = problems.FEASIBLE[name]()
    result = backend_of(variant).solve(problem)
    assert result.curve is not None, result.detail
    assert problems.clearance(problem, result.curve) > -0.3


@pytest.mark.parametrize("name", sorted(problems.FEASIBLE))
@pytest.mark.parametrize("hard", [v for v in HARD if v in VARIANTS])
def test_hard_backends_solve_what_is_feasible(hard, name):
    problem = problems.FEASIBLE[name]()
    result = backend_of(hard).solve(problem)
    assert result.status is SolveStatus.SOLVED, result.detail
    if "sampled" not in hard:
        assert problems.clearance(problem, result.curve) >= problem.margin - 1e-6
    v = result.curve.sample(np.arange(problem.t_rep, problem.t_end, 1e-3)).velocity[:, 0]
    assert v.min() >= -1e-6
    assert v.max() <= problem.limits.v_max + 1e-6


@pytest.mark.parametrize("name", sorted(problems.INFEASIBLE))
@pytest.mark.parametrize("hard", [v for v in HARD if v in VARIANTS])
def test_hard_backends_say_why_not(hard, name):
    make, words = problems.INFEASIBLE[name]
    result = backend_of(hard).solve(make())
    assert result.status is SolveStatus.INFEASIBLE
    assert result.curve is None
    assert words in result.detail


@pytest.mark.parametrize("name", sorted(ALL))
def test_ipopt_and_sqp_agree(name):
    if not {"casadi-ipopt", "casadi-sqpmethod"} <= VARIANTS.keys():
        pytest.skip("casadi is not installed")
    problem = ALL[name]()
    ipopt, sqp = (backend_of(v).solve(problem) for v in ("casadi-ipopt", "casadi-sqpmethod"))
    assert ipopt.status is sqp.status
    if ipopt.curve is not None:
        assert sqp.objective == pytest.approx(ipopt.objective, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("limit", [0.0, 1e-4, 10.0])
def test_a_time_limit_is_a_status(variant, limit):
    problem = problems.static_block_left()
    backend = backend_of(variant)
    result = backend.solve(problem, time_limit=limit)
    assert_contract(problem, result, backend.capabilities)
    if limit == 0.0 and variant in HARD:
        assert result.status is SolveStatus.TIME_LIMIT


def test_warm_starts_do_not_change_the_answer(variant):
    backend = backend_of(variant)
    problem = problems.static_block()
    cold = backend.solve(problem)
    later = backend.solve(replace(problem), warm_start=cold.curve)
    assert later.status is cold.status
    t = np.linspace(problem.t_rep, problem.t_end, 50)
    np.testing.assert_allclose(later.curve.sample(t).position, cold.curve.sample(t).position, atol=1e-2)


class _Source:
    """One problem for each t_rep: a standing box on the path."""

    def at(self, t_rep):
        boxes = [toy.box((30.0, 40.0), (-2.0, 2.0))]
        return (problems.forced(toy.problem(boxes, t_rep=t_rep, t_end=6.0, lateral=False)),)

    def relaxed(self, t_rep):
        return ()

    notches = ((), (), ())

    def widened(self, t_rep):
        return ()

    def along(self, manoeuvre, kind, *, jumps=False):
        return self.at(manoeuvre.t_start)[0]

    def without_guide(self, t_rep):
        return self.at(t_rep)


class _Checker(toy.Judging):
    def check(self, problem, curve):
        hit = problems.clearance(problem, curve, 0.01) < 0.0
        return Verdict((Violation(Reason.COLLISION, problem.t_rep),) if hit else ())


class _Braking:
    """A fourth backend: full braking, nothing else."""

    name = "toy"
    capabilities = Capabilities()

    def solve(self, problem, *, warm_start=None, time_limit=None):
        stop = problem.passing.guide
        curve = fit_to_curve(_Interpolated(stop), problem.t_rep, 40, 3, 0.2)
        return SolveResult(SolveStatus.SOLVED, curve, objective=0.0)


class _Interpolated:
    def __init__(self, trajectory):
        self.trajectory = trajectory

    def sample(self, t):
        known = self.trajectory
        columns = (known.position, known.velocity)
        values = [frozen(np.column_stack([np.interp(t, known.t, c[:, k]) for k in (0, 1)])) for c in columns]
        zero = frozen(np.zeros_like(values[0]))
        return replace(known, t=t, position=values[0], velocity=values[1], acceleration=zero, jerk=zero)


@pytest.fixture
def fourth():
    register("toy", lambda config: _Braking())
    yield "toy"
    BACKENDS.unregister("toy")


def test_a_fourth_backend_needs_one_line(fourth):
    assert fourth in backend_names()
    backend = make_backend(fourth, load_config())
    found = search_f_ttr(_Source(), Conflict(3.0, "margin"), backend, _Checker(), SearchConfig(delta_t=0.4))
    assert found.status is SearchStatus.FOUND
    # 30 m at 10 m/s, less 6.25 m of braking and what the fitted spline needs for the step of acceleration
    assert 1.6 <= found.f_ttr <= 2.4


def test_the_search_drives_every_backend(variant):
    found = search_f_ttr(
        _Source(), Conflict(3.0, "margin"), backend_of(variant), _Checker(), SearchConfig(delta_t=0.4)
    )
    assert found.status is SearchStatus.FOUND
    assert found.f_ttr >= 0.8


def test_a_malformed_problem_raises():
    if "casadi-ipopt" not in VARIANTS:
        pytest.skip("casadi is not installed")
    with pytest.raises(BackendError, match="before it begins"):
        backend_of("casadi-ipopt").solve(replace(problems.static_block(), t_end=-1.0))


def test_a_hard_backend_shows_the_curve_that_comes_closest():
    """Boxes are wider than vehicles: what misses the margin by the least may still be free."""
    problem = problems.too_near()
    solve = backend_of("casadi-ipopt").solve(problem)
    assert solve.status is SolveStatus.INFEASIBLE
    assert solve.curve is None
    assert solve.residuals["obstacles"] > 0.0
    assert isinstance(solve.closest, Closest)
    assert solve.closest.curve.t_start == pytest.approx(problem.t_rep)
    # How far it is from stopping in time: where it stops, measured from outside.
    stop = solve.closest.curve.sample(np.arange(problem.t_rep, problem.t_end, 1e-3)).position[:, 0].max()
    assert solve.closest.miss == pytest.approx(problem.margin + stop - 5.0, abs=0.01)


def test_who_solves_comes_closest_to_nothing(variant):
    for make in problems.FEASIBLE.values():
        solve = backend_of(variant).solve(make())
        assert solve.curve is None or solve.closest is None


def test_every_backend_says_what_it_is_able_to_do(variant):
    backend = backend_of(variant)
    assert isinstance(backend.capabilities, Capabilities)
    assert backend.capabilities.relaxes == backend.capabilities.keeps_hull == (variant in HARD)
    assert backend.name == VARIANTS[variant][0]


def test_who_keeps_the_hull_says_how_far_it_is_from_the_obstacles(variant):
    """As ``Capabilities.keeps_hull`` promises; the certificate relies on it."""
    backend, problem = backend_of(variant), problems.static_block()
    if backend.capabilities.keeps_hull:
        assert backend.solve(problem).residuals["obstacles"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("strict", [False, True])
def test_the_checker_may_accept_the_closest_curve_unless_the_problem_is_strict(strict):
    problem = replace(problems.too_near(), strict=strict)

    class Source:
        notches = ((), (), ())

        def at(self, t_rep):
            return (problem,)

        def relaxed(self, t_rep):
            return ()

    class Lenient(toy.Judging):
        def check(self, problem, curve):
            return Verdict()

    conflict = Conflict(time=0.3, kind="margin", obstacle_id=1)
    found = search_f_ttr(Source(), conflict, backend_of("casadi-ipopt"), Lenient(), SearchConfig())
    if strict:
        assert found.status is SearchStatus.NONE_FEASIBLE
    else:
        assert found.status is SearchStatus.FOUND
        assert found.best.margin < problem.margin
