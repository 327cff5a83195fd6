"""What holds for every B-spline: hulls, splices, linearity."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from repair.curves.bases import basis_matrix
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import splice_points

coordinate = st.floats(-200.0, 200.0, allow_subnormal=False)


@st.composite
def splines(draw):
    degree = draw(st.sampled_from([3, 4, 5]))
    n = draw(st.integers(degree + 1, degree + 12))
    spacing = draw(st.sampled_from([0.05, 0.1, 0.2, 0.4, 1.0]))
    points = draw(arrays(np.float64, (n, 2), elements=coordinate))
    return UniformBSpline(draw(st.floats(0.0, 5.0)), spacing, degree, points)


@given(splines(), arrays(np.float64, 7, elements=st.floats(0.0, 1.0)))
def test_every_segment_stays_in_both_of_its_hulls(spline, u):
    scale = 1e-9 * (1.0 + np.abs(spline.points).max())
    for k, (wide, tight) in enumerate(zip(spline.segments(), spline.bernstein_segments(), strict=True)):
        inside = np.clip(u, 1e-6, 1.0 - 1e-6)
        position = spline.sample(spline.t_start + (k + inside) * spline.spacing).position
        for hull in (wide, tight):
            assert (position <= hull.max(axis=0) + scale).all()
            assert (position >= hull.min(axis=0) - scale).all()


@given(splines())
def test_derivatives_stay_between_their_control_points(spline):
    t = np.linspace(spline.t_start, spline.t_end, 40)
    sampled = spline.sample(t)
    for order, values in ((1, sampled.velocity), (2, sampled.acceleration), (3, sampled.jerk)):
        points = spline.derivative_points(order)
        slack = 1e-9 * (1.0 + np.abs(spline.points).max() / spline.spacing**order)
        assert (values <= points.max(axis=0) + slack).all()
        assert (values >= points.min(axis=0) - slack).all()


@given(splines())
def test_cutting_at_a_knot_gives_back_the_control_points(spline):
    at = spline.sample(spline.t_start)
    state = np.array([at.position[0], at.velocity[0], at.acceleration[0]])
    if spline.degree == 3:
        head = splice_points(state, 3, spline.spacing)
        np.testing.assert_allclose(head, spline.points[:3], atol=1e-8 * (1.0 + np.abs(spline.points).max()))


@given(splines(), st.integers(0, 12), st.floats(-3.0, 3.0))
def test_a_control_point_moves_only_its_own_segments(spline, index, shift):
    index %= len(spline.points)
    moved = spline.points.copy()
    moved[index] += shift
    other = UniformBSpline(spline.t_start, spline.spacing, spline.degree, moved)
    tau = np.linspace(0.0, spline.t_end - spline.t_start, 50)
    difference = other.sample(spline.t_start + tau).position - spline.sample(spline.t_start + tau).position
    segment = np.minimum(np.floor(tau / spline.spacing + 1e-9), len(spline.points) - spline.degree - 1)
    touched = (segment <= index) & (index <= segment + spline.degree)
    assert np.abs(difference[~touched]).max(initial=0.0) < 1e-9
    expected = shift * basis_matrix(tau, len(spline.points), spline.degree, spline.spacing)[:, index]
    np.testing.assert_allclose(difference[:, 0], expected, atol=1e-9)


@given(splines())
def test_position_velocity_and_acceleration_are_continuous_at_the_knots(spline):
    knots = spline.t_start + np.arange(1, len(spline.points) - spline.degree) * spline.spacing
    eps = 1e-7
    if not len(knots):
        return
    left, right = spline.sample(knots - eps), spline.sample(knots + eps)
    highest = np.abs(spline.points).max() + 1.0
    for order, (a, b) in enumerate(
        (
            (left.position, right.position),
            (left.velocity, right.velocity),
            (left.acceleration, right.acceleration),
        )
    ):
        change = 2.0 * eps * 16.0 * highest / spline.spacing ** (order + 1)  # bound on the next derivative
        np.testing.assert_allclose(a, b, atol=change + 1e-9 * highest / spline.spacing**order)
