"""Bernstein chains and the linear algebra of their QPs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array

from repair.arrays import frozen
from repair.baselines.qptr.structure import qp_structure
from repair.curves.base import Curve, is_curve
from repair.curves.bernstein import BernsteinCurve, bernstein_basis, sampling_at
from repair.curves.sampling import evaluated


def chain(seed=0, pieces=4, degree=5):
    points = np.random.default_rng(seed).normal(size=(pieces, degree + 1, 2))
    return BernsteinCurve(1.0, 0.5, frozen(points))


def test_basis_is_a_partition_of_unity():
    values = bernstein_basis(np.linspace(0.0, 1.0, 11), 5)
    assert np.all(values >= 0.0)
    np.testing.assert_allclose(values.sum(axis=1), 1.0, atol=1e-14)


def test_is_a_curve_over_its_span():
    curve = chain()
    assert isinstance(curve, Curve)
    for thing in (curve, None, np.zeros(3), "curve", SimpleNamespace(t_start=0.0, t_end=1.0, sample=None)):
        assert is_curve(thing) == isinstance(thing, Curve)
    assert (curve.t_start, curve.t_end, curve.degree) == (1.0, 3.0, 5)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_agree_with_finite_differences(order):
    curve, step = chain(order), 1e-5
    t = np.array([1.1, 1.73, 2.2, 2.9])
    names = ("position", "velocity", "acceleration", "jerk")
    after, before = (getattr(curve.sample(t + d), names[order - 1]) for d in (step, -step))
    exact = getattr(curve.sample(t), names[order])
    np.testing.assert_allclose((after - before) / (2 * step), exact, rtol=1e-6, atol=1e-4)


def test_stays_in_the_hull_of_its_control_points():
    curve = chain(3)
    for piece in range(4):
        inside = curve.sample(np.linspace(1.0 + 0.5 * piece, 1.5 + 0.5 * piece - 1e-9, 50)).position
        assert np.all(inside <= curve.points[piece].max(axis=0) + 1e-12)
        assert np.all(inside >= curve.points[piece].min(axis=0) - 1e-12)


def test_a_line_has_its_own_values_as_control_points():
    structure = qp_structure(3, 5, 0.4, 2, 1.0, 0.1)
    curve = BernsteinCurve(0.0, 0.4, np.stack([2.0 + 3.0 * structure.times] * 2, axis=1).reshape(3, 6, 2))
    t = np.linspace(0.0, 1.2, 20)
    np.testing.assert_allclose(curve.sample(t).position[:, 0], 2.0 + 3.0 * t, atol=1e-12)


def test_large_samplings_are_sparse_and_the_same():
    curve, t = chain(4, pieces=9), np.linspace(0.7, 6.0, 200)
    sparse, dense = (sampling_at(t.tobytes(), 1.0, 9, 5, 0.5, dense=size) for size in (0, 10**9))
    assert isinstance(sparse, csr_array)
    assert isinstance(dense, np.ndarray)
    points = curve.points.reshape(-1, 2)
    sampled, columns = curve.sample(t), zip(evaluated(sparse, points), evaluated(dense, points), strict=True)
    for (one, other), name in zip(columns, ("position", "velocity", "acceleration", "jerk"), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())
        np.testing.assert_allclose(
            getattr(sampled, name), other, rtol=1e-12, atol=1e-12 * np.abs(other).max()
        )


def test_beyond_the_span_the_end_speed_is_held():
    curve = chain(5)
    end, late = curve.sample([3.0]), curve.sample([3.5])
    np.testing.assert_allclose(late.position, end.position + 0.5 * end.velocity, atol=1e-9)
    assert not late.acceleration.any()


@pytest.mark.parametrize("continuity", [2, 3])
@pytest.mark.parametrize("settles", [False, True])
def test_start_joints_and_end_hold_for_every_free_vector(continuity, settles):
    structure = qp_structure(4, 5, 0.5, continuity, 1.0, 0.1, settles)
    z = np.random.default_rng(1).normal(size=structure.basis.shape[1])
    x = structure.lift @ np.array([1.0, 2.0, -0.5]) + structure.basis @ z
    curve = BernsteinCurve(0.0, 0.5, np.stack([x, x], axis=1).reshape(4, 6, 2))
    begin = curve.sample([0.0])
    state = [begin.position[0, 0], begin.velocity[0, 0], begin.acceleration[0, 0]]
    np.testing.assert_allclose(state, [1.0, 2.0, -0.5], atol=1e-9)
    for order in range(continuity + 1):
        points = curve.derivative_points(order)
        np.testing.assert_allclose(points[:-1, -1], points[1:, 0], atol=1e-7)
    end = curve.sample([2.0])
    at_rest = abs(end.velocity[0, 0]) < 1e-8 and abs(end.acceleration[0, 0]) < 1e-8
    assert at_rest == settles


def test_hessian_over_the_free_vector_is_the_identity():
    structure = qp_structure(5, 5, 0.5, 2, 1.0, 0.1)
    reduced = structure.basis.T @ structure.hessian @ structure.basis
    np.testing.assert_allclose(reduced, np.eye(len(reduced)), atol=1e-8)


def test_quadrature_is_exact_for_jerk_and_deviation():
    from scipy.integrate import trapezoid  # NumPy 1 has no np.trapezoid

    structure = qp_structure(2, 5, 0.7, 2, 1.0, 1.0)
    x = np.random.default_rng(2).normal(size=len(structure.times))
    curve = BernsteinCurve(0.0, 0.7, np.stack([x, x], axis=1).reshape(2, 6, 2))
    fine = np.linspace(0.0, 1.4, 40_001)
    samples = curve.sample(fine)
    integral = trapezoid(samples.jerk[:, 0] ** 2 + samples.position[:, 0] ** 2, fine)
    assert 0.5 * x @ structure.hessian @ x == pytest.approx(integral, rel=1e-3)


def test_follow_reproduces_a_polynomial_with_its_start():
    structure = qp_structure(3, 5, 0.6, 2, 1.0, 0.1)
    course = np.polynomial.Polynomial([0.3, -0.2, 0.4, 0.1, -0.05, 0.02])
    task = np.concatenate([[course.deriv(k)(0.0) for k in range(3)], course(structure.nodes)])
    x = structure.follow @ task
    curve = BernsteinCurve(0.0, 0.6, np.stack([x, x], axis=1).reshape(3, 6, 2))
    t = np.linspace(0.0, 1.8, 25)
    np.testing.assert_allclose(curve.sample(t).position[:, 0], course(t), atol=1e-9)
    np.testing.assert_allclose(curve.sample(t).jerk[:, 0], course.deriv(3)(t), atol=1e-6)


def test_jumps_are_those_of_the_derivatives():
    structure = qp_structure(3, 5, 0.6, 2, 1.0, 0.1)
    x = np.random.default_rng(4).normal(size=len(structure.times))
    curve = BernsteinCurve(0.0, 0.6, np.stack([x, x], axis=1).reshape(3, 6, 2))
    found = (structure.jumps @ x).reshape(2, 3).T
    for order in range(3):
        points = curve.derivative_points(order)[..., 0]
        np.testing.assert_allclose(found[order], points[:-1, -1] - points[1:, 0], rtol=1e-9)
