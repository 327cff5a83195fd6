"""The hull guarantee: what is kept on Bernstein points is kept by the curve at every time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests import toy
from tests.contract import problems

from repair.arrays import frozen
from repair.backend.base import SolveStatus
from repair.curves.bases import derivative_matrix
from repair.curves.bspline import UniformBSpline
from repair.problem.passing import open_passings
from repair.solvers.casadi.backend import CasadiBackend
from repair.solvers.casadi.rows import bernstein_rows
from repair.solvers.casadi.settings import CasadiConfig

SOLVERS = st.sampled_from(["ipopt", "sqpmethod"])


@st.composite
def boxes(draw):
    """One to three boxes that move, come and go, or turn up between the windows' ends."""
    found = []
    for _ in range(draw(st.integers(1, 3))):
        s0, l0 = draw(st.floats(8.0, 45.0)), draw(st.floats(-8.0, 8.0))
        size = draw(st.floats(1.0, 8.0)), draw(st.floats(0.5, 3.0))
        v = draw(st.floats(-6.0, 9.0)), draw(st.floats(-4.0, 4.0))
        begin = draw(st.sampled_from([0.0, 0.0, 0.73, 1.5]))
        end = draw(st.sampled_from([np.inf, np.inf, 2.2]))
        found.append(toy.box((s0, s0 + size[0]), (l0, l0 + size[1]), v, (begin, end)))
    return found


def kinked(occupancy, seed):
    """The same boxes with their edges shaken at every step, so that they do not move on a line."""
    rng = np.random.default_rng(seed)
    shake = rng.uniform(-0.15, 0.15, occupancy.lower.shape)
    return replace(occupancy, lower=frozen(occupancy.lower + shake), upper=frozen(occupancy.upper + shake))


@settings(max_examples=60, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
@given(boxes(), st.integers(0, 1000), SOLVERS, st.sampled_from([0.0, 0.1, 0.37]), st.booleans())
def test_a_solved_curve_is_clear_at_every_millisecond(some, seed, solver, t_rep, lateral):
    bare = toy.problem(kinked(toy.occupancy(*some), seed), t_rep=t_rep, t_end=t_rep + 3.5, lateral=lateral)
    times = t_rep + toy.DT * np.arange(36)
    axis = (bare.curvature_s, bare.curvature)
    passings = open_passings(
        bare.reference.sample(times), bare.start, bare.occupancy, bare.bounds, bare.limits, 0.1, lateral, axis
    )
    assume(passings)
    backend = CasadiBackend(CasadiConfig(solver=solver), spacing=0.25)
    for passing in passings:
        problem = replace(bare, passing=passing)
        result = backend.solve(problem)
        if result.status is not SolveStatus.SOLVED:
            assert result.curve is None or max(result.residuals.values()) <= 1e-6
            continue
        assert max(result.residuals.values()) <= 1e-6
        assert problems.clearance(problem, result.curve) >= -1e-6
        samples = result.curve.sample(np.arange(t_rep, problem.t_end, 1e-3))
        limits, v, a = problem.limits, samples.velocity, samples.acceleration
        assert v[:, 0].min() >= -1e-6
        assert v[:, 0].max() <= limits.v_max + 1e-6
        assert np.abs(v[:, 1]).max() <= limits.v_lat + 1e-6
        assert a[:, 0].min() >= limits.a_min - 1e-6
        assert a[:, 0].max() <= limits.a_max + 1e-6
        assert np.abs(samples.jerk).max() <= limits.j_lon + 1e-4
        assert np.hypot(a[:, 0], a[:, 1]).max() <= limits.a_total + 1e-6
        assert np.abs(samples.position[:, 1]).max() <= 6.0 + 1e-6


@given(
    st.integers(3, 5), st.integers(1, 6), st.integers(1, 4), st.floats(0.05, 1.0), st.integers(0, 10**6),
    st.integers(0, 2),
)  # fmt: skip
def test_bernstein_rows_bound_the_curve_and_touch_it_at_their_ends(
    degree, segments, cuts, spacing, seed, order
):
    n = degree + segments
    points = np.random.default_rng(seed).normal(size=(n, 2))
    curve = UniformBSpline(0.0, spacing, degree, frozen(points))
    p = degree - order
    rows = bernstein_rows(n - order, p, (cuts,) * segments) @ derivative_matrix(n, order, spacing) @ points
    ends = np.arange(segments * cuts + 1) * spacing / cuts
    inside = (np.arange(segments * cuts * 20) + 0.5) * spacing / cuts / 20

    def value(t):
        samples = curve.sample(t)
        return (samples.position, samples.velocity, samples.acceleration)[order]

    scale = 1e-9 * max(1.0, np.abs(rows).max())
    np.testing.assert_allclose(rows[::p], value(ends), atol=10 * scale)
    for k, t in enumerate(inside.reshape(-1, 20)):
        own = rows[k * p : k * p + p + 1]
        assert (value(t) >= own.min(axis=0) - scale).all()
        assert (value(t) <= own.max(axis=0) + scale).all()
