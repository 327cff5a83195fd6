"""The uniform B-spline against SciPy's, the recursion of the paper, and its own promises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from benchmarks import literal
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from repair.curves.bases import (
    basis_matrix,
    bernstein_matrix,
    derivative_matrix,
    n_points_for,
    segment_matrix,
    to_bernstein,
)
from repair.curves.bspline import UniformBSpline, sampling_at
from repair.curves.fitting import fit_to_curve, splice_points
from repair.curves.sampling import evaluated
from repair.reference.profile import SpeedProfile

DEGREES = (3, 4, 5)


def random_spline(degree, seed=0, n=None, t_start=1.3, spacing=0.4):
    rng = np.random.default_rng(seed)
    return UniformBSpline(t_start, spacing, degree, rng.normal(size=(n or degree + 6, 2)) * 10.0)


def scipy_spline(spline):
    knots = (
        spline.t_start + (np.arange(len(spline.points) + spline.degree + 1) - spline.degree) * spline.spacing
    )
    return BSpline(knots, spline.points, spline.degree)


@pytest.mark.parametrize("degree", DEGREES)
def test_values_and_derivatives_are_those_of_scipy(degree):
    spline = random_spline(degree)
    t = np.linspace(spline.t_start, spline.t_end, 101)[:-1]
    sampled, exact = spline.sample(t), scipy_spline(spline)
    for order, values in enumerate((sampled.position, sampled.velocity, sampled.acceleration, sampled.jerk)):
        np.testing.assert_allclose(
            values, exact.derivative(order)(t) if order else exact(t), rtol=1e-9, atol=1e-8
        )


@pytest.mark.parametrize("degree", DEGREES)
def test_values_are_those_of_the_cox_de_boor_recursion(degree):
    spline = random_spline(degree, seed=1)
    plain = literal.LiteralCurve(spline.t_start, spline.spacing, degree, spline.points.tolist())
    t = spline.t_start + np.array([0.0, 0.1, 0.4, 0.77, 1.2, 2.4 - 1e-9])
    for name in ("position", "velocity", "acceleration", "jerk"):
        np.testing.assert_allclose(
            getattr(spline.sample(t), name), getattr(plain.sample(t), name), rtol=1e-8, atol=1e-7
        )


@pytest.mark.parametrize("degree", DEGREES)
def test_basis_is_a_partition_of_unity_and_not_negative(degree):
    n = degree + 4
    matrix = basis_matrix(np.linspace(0.0, 4 * 0.25, 41), n, degree, 0.25)
    assert matrix.min() >= -1e-15
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-13)
    assert ((matrix > 1e-14).sum(axis=1) <= degree + 1).all()


@pytest.mark.parametrize("degree", DEGREES)
def test_control_points_act_around_their_greville_times(degree):
    # A straight line is reproduced by control points that lie on it at those times.
    line = UniformBSpline(2.0, 0.3, degree, np.zeros((degree + 5, 2)))
    points = np.column_stack([3.0 + 2.0 * line.greville, -1.0 * line.greville])
    sampled = UniformBSpline(2.0, 0.3, degree, points).sample(np.linspace(2.0, line.t_end, 17))
    np.testing.assert_allclose(sampled.position[:, 0], 3.0 + 2.0 * sampled.t, atol=1e-12)
    np.testing.assert_allclose(sampled.velocity[:, 1], -1.0, atol=1e-11)


@pytest.mark.parametrize("degree", DEGREES)
def test_derivative_points_are_control_points_of_the_derivative(degree):
    spline = random_spline(degree, seed=2)
    t = np.linspace(spline.t_start, spline.t_end, 31)[:-1]
    for order, name in ((1, "velocity"), (2, "acceleration"), (3, "jerk")):
        points = spline.derivative_points(order)
        np.testing.assert_allclose(
            points, derivative_matrix(len(spline.points), order, 0.4) @ spline.points, atol=1e-9
        )
        derived = UniformBSpline(spline.t_start, spline.spacing, degree - order, points)
        expected = scipy_spline(derived)(t)
        np.testing.assert_allclose(getattr(spline.sample(t), name), expected, rtol=1e-9, atol=1e-8)


def test_derivative_points_are_those_of_the_paper():
    spline = random_spline(3, seed=3)
    for matrix, points in zip(
        (spline.derivative_points(k) for k in (1, 2, 3)),
        literal.derivatives(spline.points.tolist(), 0.4),
        strict=True,
    ):
        np.testing.assert_allclose(matrix, points, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("degree", DEGREES)
def test_bernstein_segments_are_the_same_curve_in_a_tighter_hull(degree):
    from math import comb

    spline = random_spline(degree, seed=4)
    u = np.linspace(0.0, 1.0, 11)
    bernstein = np.column_stack([comb(degree, k) * u**k * (1 - u) ** (degree - k) for k in range(degree + 1)])
    for k, (control, wide) in enumerate(zip(spline.bernstein_segments(), spline.segments(), strict=True)):
        values = bernstein @ control
        exact = spline.sample(spline.t_start + (k + u) * spline.spacing).position
        np.testing.assert_allclose(values, exact, atol=1e-11)
        assert (exact <= control.max(axis=0) + 1e-11).all()
        assert (exact >= control.min(axis=0) - 1e-11).all()
        assert (control.max(axis=0) <= wide.max(axis=0) + 1e-11).all()
        assert (control.min(axis=0) >= wide.min(axis=0) - 1e-11).all()


def test_neighbouring_bernstein_segments_share_their_end_point():
    segments = random_spline(3, seed=5).bernstein_segments()
    np.testing.assert_allclose(segments[:-1, -1], segments[1:, 0], atol=1e-12)


@pytest.mark.parametrize("degree", DEGREES)
def test_splice_is_exact_and_leaves_the_rest_free(degree):
    rng = np.random.default_rng(6)
    state = rng.normal(size=(degree, 2)) * [[20.0, 2.0]]
    head = splice_points(state, degree, 0.4)
    for tail in (np.zeros((5, 2)), rng.normal(size=(5, 2)) * 50.0):
        at = UniformBSpline(0.8, 0.4, degree, np.vstack([head, tail])).sample(0.8)
        for k, values in enumerate((at.position, at.velocity, at.acceleration, at.jerk)[:degree]):
            np.testing.assert_allclose(values[0], state[k], rtol=1e-10, atol=1e-8)


@pytest.mark.parametrize("degree", [3, 4])  # a quintic also has a fourth derivative, which no sample tells
def test_fit_reproduces_a_spline_on_the_same_knots(degree):
    spline = random_spline(degree, seed=7, t_start=0.0, n=degree + 12)
    fitted = fit_to_curve(spline, 1.2, degree + 9, degree, 0.4)
    np.testing.assert_allclose(fitted.points, spline.points[3:], atol=5e-4)
    t = np.linspace(1.2, spline.t_end, 50)
    np.testing.assert_allclose(fitted.sample(t).position, spline.sample(t).position, atol=1e-4)


@dataclass(frozen=True)
class Hidden:
    """A curve of which nothing is known but what it answers."""

    curve: UniformBSpline

    @property
    def t_start(self):
        return self.curve.t_start

    @property
    def t_end(self):
        return self.curve.t_end

    def sample(self, t):
        return self.curve.sample(t)


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("t_start", [0.0, 0.4, 0.73, 4.0])  # the last one reaches beyond the end
def test_fit_to_a_spline_is_the_fit_to_any_curve(degree, t_start):
    for of_degree, spacing in ((3, 0.5), (4, 0.3)):
        spline = random_spline(of_degree, seed=11, t_start=0.0, n=of_degree + 14, spacing=spacing)
        fitted = fit_to_curve(spline, t_start, degree + 6, degree, 0.4)
        plain = fit_to_curve(Hidden(spline), t_start, degree + 6, degree, 0.4)
        np.testing.assert_allclose(fitted.points, plain.points, rtol=1e-9, atol=1e-9)
        assert (fitted.t_start, fitted.degree, fitted.spacing) == (t_start, degree, 0.4)


@pytest.mark.parametrize("degree", DEGREES)
def test_fit_keeps_the_state_at_its_start_exactly(degree):
    profile = SpeedProfile.from_accelerations(5.0, 12.0, [1.0, 1.0, 4.0], [-3.0, 1.0, 0.0])
    for t in (0.0, 0.35, 0.9):
        fitted = fit_to_curve(profile, t, degree + 8, degree, 0.4)
        start, wanted = fitted.sample(t), profile.sample(t)
        np.testing.assert_allclose(start.position, wanted.position, atol=1e-9)
        np.testing.assert_allclose(start.velocity, wanted.velocity, atol=1e-9)
        np.testing.assert_allclose(start.acceleration, wanted.acceleration, atol=1e-8)


def test_fit_of_a_parabola_is_the_parabola_up_to_the_last_control_point():
    profile = SpeedProfile.from_accelerations(0.0, 20.0, [6.0], [-2.0])
    fitted = fit_to_curve(profile, 1.0, 13, 3, 0.4)
    t = np.linspace(1.0, fitted.t_end, 80)
    np.testing.assert_allclose(fitted.sample(t).position, profile.sample(t).position, atol=1e-6)
    np.testing.assert_allclose(fitted.derivative_points(2)[:, 0], -2.0, atol=1e-3)


@pytest.mark.parametrize("degree", DEGREES)
def test_large_samplings_are_sparse_and_the_same(degree):
    spline = random_spline(degree, seed=12, n=degree + 40)
    t = np.linspace(spline.t_start - 0.5, spline.t_end + 0.7, 333)
    shape = (t.tobytes(), spline.t_start, len(spline.points), degree, spline.spacing)
    sparse, dense = (sampling_at(*shape, dense=size) for size in (0, 10**9))
    assert isinstance(sparse, csr_array)
    assert isinstance(dense, np.ndarray)
    columns = zip(evaluated(sparse, spline.points), evaluated(dense, spline.points), strict=True)
    sampled = spline.sample(t)
    for (one, other), name in zip(columns, ("position", "velocity", "acceleration", "jerk"), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())
        np.testing.assert_allclose(
            getattr(sampled, name), other, rtol=1e-12, atol=1e-12 * np.abs(other).max()
        )


def test_beyond_both_ends_the_speed_of_the_end_is_held():
    spline = random_spline(3, seed=8)
    for edge, beyond in ((spline.t_start, spline.t_start - 1.7), (spline.t_end, spline.t_end + 2.5)):
        at, out = spline.sample(edge), spline.sample(beyond)
        np.testing.assert_allclose(out.velocity, at.velocity)
        np.testing.assert_allclose(out.position, at.position + (beyond - edge) * at.velocity)
        assert not out.acceleration.any()
        assert not out.jerk.any()


def test_the_end_of_the_span_belongs_to_the_last_segment():
    spline = random_spline(3, seed=9)
    close, end = spline.sample(spline.t_end - 1e-7), spline.sample(spline.t_end)
    np.testing.assert_allclose(end.position, close.position, atol=1e-4)
    np.testing.assert_allclose(end.jerk, close.jerk, atol=1e-6)


def test_cached_matrices_cannot_be_written():
    for matrix in (segment_matrix(3), bernstein_matrix(3), to_bernstein(3), derivative_matrix(7, 2, 0.4)):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 1.0


def test_what_a_caller_does_to_a_sample_does_not_reach_the_next_one():
    spline = random_spline(3, seed=10)
    t = np.linspace(spline.t_start, spline.t_end, 9)
    first = spline.sample(t)
    kept = first.position.copy()
    for values in (first.position, first.velocity, first.acceleration, first.jerk):
        values[:] = np.nan
    again = spline.sample(t)
    np.testing.assert_array_equal(again.position, kept)
    assert np.isfinite(again.jerk).all()
    # and what happens to the caller's times does not reach the sample's cache either
    t += 0.05
    assert not np.array_equal(spline.sample(t).position, kept)


def test_fit_does_not_alias_its_caches():
    profile = SpeedProfile.from_accelerations(0.0, 10.0, [8.0], [0.5])
    first = fit_to_curve(profile, 0.0, 12, 3, 0.4)
    with pytest.raises(ValueError, match="read-only"):
        first.points[:] = 0.0
    np.testing.assert_array_equal(first.points, fit_to_curve(profile, 0.0, 12, 3, 0.4).points)


@pytest.mark.parametrize(
    "duration, spacing, segments",
    [(4.0, 0.4, 10), (4.1, 0.4, 11), (1.2000000000000002, 0.4, 3), (0.0, 0.4, 1)],
)
def test_number_of_control_points_covers_the_duration(duration, spacing, segments):
    assert n_points_for(duration, spacing, 3) == segments + 3


@pytest.mark.parametrize("degree", DEGREES)
def test_speeds_are_within_the_bounds_by_control_points_alone(degree):
    spline = random_spline(degree, seed=7)
    slowest, fastest = spline.speed_bounds()
    speed = spline.sample(np.linspace(spline.t_start, spline.t_end, 400)).velocity[:, 0]
    assert slowest <= speed.min() < speed.max() <= fastest
    assert (slowest, fastest) == pytest.approx(
        (spline.derivative_points(1)[:, 0].min(), spline.derivative_points(1)[:, 0].max())
    )
    _, low, high = spline.speed_hulls()
    assert slowest - 1e-9 <= low.min() <= high.max() <= fastest + 1e-9
