"""The penalty functions: the paper's pieces, their joints, their gradients."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks import literal

from repair.curves.bases import derivative_matrix
from repair.solvers.ego.penalties import REVERSE_JOINT, SoftBounds, feasibility_bounds

MAXIMA = np.array([[10.0, 2.0], [3.0, 2.5], [8.0, 9.0]])
MINIMA = np.array([[0.0, -2.0], [-6.0, -2.5], [-8.0, -9.0]])
WEIGHTS = (1.5, 0.7, 0.2)


def cubic_quadratic(excess, joint):
    """Penalty, slope and curvature of each excess."""
    joints = np.broadcast_to(joint, excess.shape)
    each = [
        SoftBounds.of(np.zeros(1), np.full(1, d), np.ones(1)).evaluate(np.full(1, e))
        for e, d in zip(excess, joints, strict=True)
    ]
    return np.array([x[0] for x in each]), *(np.array([x[k][0] for x in each]) for k in (1, 2))


class bounds:
    """Both sides as one penalty of derivatives (3n - 6, 2): value, slope, curvature."""

    def __init__(self, n, **keys):
        settings = {"elastic": 0.9, "joint_factor": 1.5, "reverse_weight": 500.0} | keys
        self.sides = feasibility_bounds(n, MAXIMA, MINIMA, WEIGHTS, **settings)
        self.upper, self.lower = self.sides[0].limit, -self.sides[1].limit

    def evaluate(self, x):
        found = [
            SoftBounds(*(column.ravel() for column in side)).evaluate(sign * x.ravel())
            for sign, side in zip((1.0, -1.0), self.sides, strict=True)
        ]
        slope = (found[0][1] - found[1][1]).reshape(x.shape)
        return found[0][0] + found[1][0], slope, (found[0][2] + found[1][2]).reshape(x.shape)


def literal_bounds(**keys):
    settings = {"elastic": 0.9, "joint": 1.5, "reverse": 500.0} | keys
    return literal.Bounds(MAXIMA.tolist(), (-MINIMA).tolist(), WEIGHTS, **settings)


def second_derivative(function, x, step=1e-5):
    return (function(x + step) - function(x - step)) / (2.0 * step)


@pytest.mark.parametrize("joint", [0.3, 1.0, 4.2])
def test_collision_penalty_is_the_papers(joint):
    excess = np.array(
        [-2.0, -1e-9, 0.0, 0.1 * joint, joint - 1e-9, joint, joint + 1e-9, 2.0 * joint, 40.0 * joint]
    )
    value, slope, _ = cubic_quadratic(excess, joint)
    np.testing.assert_allclose(value, [literal.j_c(c, joint) for c in excess], rtol=1e-12)
    np.testing.assert_allclose(slope, [literal.j_c_slope(c, joint) for c in excess], rtol=1e-12)


@pytest.mark.parametrize("c_m, factor, elastic", [(10.0, 1.5, 0.95), (0.5, 1.1, 0.8), (3.0, 4.0, 0.99)])
def test_derived_constants_close_the_joints_twice_differentiably(c_m, factor, elastic):
    c_j, m = factor * c_m, elastic * c_m
    a1, b1, c1, a2, b2, c2 = literal.coefficients(c_m, c_j, elastic)
    # the right joint: value, slope and curvature of the cubic are those of the parabola
    assert a2 * c_j**2 + b2 * c_j + c2 == pytest.approx((c_j - m) ** 3, rel=1e-9)
    assert 2 * a2 * c_j + b2 == pytest.approx(3 * (c_j - m) ** 2, rel=1e-9)
    assert 2 * a2 == pytest.approx(6 * (c_j - m), rel=1e-12)
    # and the left one
    assert a1 * c_j**2 - b1 * c_j + c1 == pytest.approx((c_j - m) ** 3, rel=1e-9)
    assert -2 * a1 * c_j + b1 == pytest.approx(-3 * (c_j - m) ** 2, rel=1e-9)
    assert 2 * a1 == pytest.approx(6 * (c_j - m), rel=1e-12)


@pytest.mark.parametrize("c_m, factor, elastic", [(10.0, 1.5, 0.95), (0.5, 1.1, 0.8), (3.0, 4.0, 0.99)])
def test_feasibility_penalty_is_the_papers_with_these_constants(c_m, factor, elastic):
    c_j, m = factor * c_m, elastic * c_m
    c_r = np.array([-3 * c_j, -c_j, -0.5 * (c_j + m), -m, 0.0, m, 0.5 * (c_j + m), c_j, 3 * c_j])
    above, slope_above, _ = cubic_quadratic(c_r - m, c_j - m)
    below, slope_below, _ = cubic_quadratic(-m - c_r, c_j - m)
    np.testing.assert_allclose(
        above + below, [literal.f(c, c_m, c_j, elastic) for c in c_r], rtol=1e-9, atol=1e-12
    )
    slope = [literal.f_slope(c, c_m, c_j, elastic) for c in c_r]
    np.testing.assert_allclose(slope_above - slope_below, slope, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("joint", [0.25, 1.0, 5.0])
def test_penalty_is_twice_continuously_differentiable_at_its_joints(joint):
    tiny = 1e-7
    for at in (0.0, joint):
        value, slope, _ = cubic_quadratic(np.array([at - tiny, at + tiny]), joint)
        assert value[1] - value[0] == pytest.approx(0.0, abs=1e-5 * joint**2)
        assert slope[1] - slope[0] == pytest.approx(0.0, abs=1e-5 * joint)
        bend = [second_derivative(lambda e: float(cubic_quadratic(np.array([e]), joint)[1][0]), x)
                for x in (at - 2e-5, at + 2e-5)]  # fmt: skip
        assert bend[1] - bend[0] == pytest.approx(0.0, abs=6.0 * 4e-5 + 1e-6)
    # beyond the joint the curvature stays what it is there
    far = second_derivative(lambda e: float(cubic_quadratic(np.array([e]), joint)[1][0]), 7.0 * joint)
    assert far == pytest.approx(6.0 * joint, rel=1e-6)


def test_penalty_slope_by_finite_differences():
    rng = np.random.default_rng(0)
    excess, joint = rng.uniform(-2.0, 6.0, 400), rng.uniform(0.1, 3.0, 400)
    step = 1e-6
    numeric = (cubic_quadratic(excess + step, joint)[0] - cubic_quadratic(excess - step, joint)[0]) / (
        2.0 * step
    )
    np.testing.assert_allclose(cubic_quadratic(excess, joint)[1], numeric, rtol=1e-6, atol=1e-8)
    ahead, behind = (cubic_quadratic(excess + sign * step, joint)[1] for sign in (1.0, -1.0))
    bend = cubic_quadratic(excess, joint)[2]
    np.testing.assert_allclose(bend, (ahead - behind) / (2.0 * step), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("n", [7, 12, 20])
@pytest.mark.parametrize("seed", range(3))
def test_feasibility_is_the_papers_with_its_gradient(n, seed):
    rng = np.random.default_rng(seed)
    dt = 0.4
    points = np.cumsum(rng.normal(size=(n, 2)) * [4.0, 1.0], axis=0)
    stack = np.vstack([derivative_matrix(n, k, dt) for k in (1, 2, 3)])
    value, slope, _ = bounds(n).evaluate(stack @ points)
    parts = [part(points.tolist(), dt, literal_bounds()) for part in (literal.feasibility, literal.reversing)]
    expected, gradient = sum(p[0] for p in parts), np.array(parts[0][1]) + np.array(parts[1][1])
    assert value == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(stack.T @ slope, gradient, rtol=1e-9, atol=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("n", [4, 9, 16])
@pytest.mark.parametrize("scale", [0.9, 1.3, 8.0], ids=["below the joints", "around", "far beyond"])
def test_feasibility_gradient_by_finite_differences(n, scale):
    rng = np.random.default_rng(n)
    feasibility = bounds(n, reverse_weight=20.0)
    span = np.repeat(np.maximum(MAXIMA, -MINIMA), [n - 1, n - 2, n - 3], axis=0)
    derivatives = rng.uniform(-1.0, 1.0, span.shape) * span * scale
    _, slope, _ = feasibility.evaluate(derivatives)
    step = 1e-6
    for r, axis in [(0, 0), (n - 2, 1), (n - 1, 0), (2 * n - 4, 1), (2 * n - 3, 0), (3 * n - 7, 1)]:
        ends = []
        for sign in (1.0, -1.0):
            moved = derivatives.copy()
            moved[r, axis] += sign * step
            ends.append(feasibility.evaluate(moved)[0])
        assert slope[r, axis] == pytest.approx(
            (ends[0] - ends[1]) / (2 * step), rel=2e-5, abs=1e-4 + 1e-9 * ends[0]
        )


def test_nothing_is_charged_within_the_elastic_limits():
    n = 8
    feasibility = bounds(n)
    inside = np.clip(np.zeros_like(feasibility.upper), feasibility.lower, feasibility.upper)
    for x in (inside, feasibility.upper, feasibility.lower):
        value, *derivatives = feasibility.evaluate(x)
        assert value == 0.0
        assert not np.any(derivatives)


def test_each_side_is_charged_by_its_own_limit():
    n = 5
    feasibility = bounds(n)
    braking = np.zeros_like(feasibility.upper)
    braking[n - 1, 0] = -5.0  # allowed: the limit is -6
    assert feasibility.evaluate(braking)[0] == 0.0
    assert feasibility.evaluate(-braking)[0] > 0.0  # 5 is too much throttle: the limit is 3


def test_reversing_is_charged_from_zero_on_and_only_along_s():
    n = 5
    feasibility = bounds(n)
    rows = np.zeros_like(feasibility.upper)
    rows[0, 0] = -0.2
    value, slope, _ = feasibility.evaluate(rows)
    assert value == pytest.approx(500.0 * literal.f(-0.2, 0.0, REVERSE_JOINT, 0.9))
    assert slope[0, 0] < 0.0
    rows[0] = [0.0, -0.2]
    assert feasibility.evaluate(rows)[0] == 0.0


def test_the_gradient_does_not_share_memory_with_the_input():
    feasibility = bounds(5)
    rows = 20.0 * np.ones_like(feasibility.upper)
    before = rows.copy()
    _, slope, _ = feasibility.evaluate(rows)
    slope[:] = 0.0
    np.testing.assert_array_equal(rows, before)
