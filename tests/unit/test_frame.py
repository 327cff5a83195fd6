"""The Frenet frame: parametrisation, smoothness, projection, and trajectories in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from repair.arrays import Array
from repair.curves.base import FrenetTrajectory
from repair.curves.plane import STANDSTILL
from repair.errors import ScenarioError
from repair.scene.frame import FrenetFrame
from repair.scene.road.beside import alone, to_frenet_around, to_frenet_from

TURN_RADIUS = 8.0


def turn(radius: float = TURN_RADIUS, angle: float = 1.4, before: float = 30.0, after: float = 30.0) -> Array:
    """Straight, arc to the left, straight; finely sampled."""
    straight = np.stack([np.arange(-before, 0.0, 0.5), np.zeros(int(2 * before))], axis=1)
    phi = np.linspace(0.0, angle, 200)
    arc = radius * np.stack([np.sin(phi), 1.0 - np.cos(phi)], axis=1)
    run = np.arange(0.5, after, 0.5)[:, None] * np.array([np.cos(angle), np.sin(angle)])
    return np.concatenate([straight, arc, arc[-1] + run])


@pytest.fixture(scope="module")
def frame() -> FrenetFrame:
    return FrenetFrame.from_points(turn())


def trajectory(s: Array, l: Array, v: Array, w: Array) -> FrenetTrajectory:  # noqa: E741
    zero = np.zeros((len(s), 2))
    return FrenetTrajectory(
        np.arange(len(s)) * 0.1, np.stack([s, l], axis=1), np.stack([v, w], axis=1), zero, zero
    )  # fmt: skip


def test_curvature_of_a_circle() -> None:
    phi = np.linspace(0.0, 4.0, 400)
    made = FrenetFrame.from_points(10.0 * np.stack([np.cos(phi), np.sin(phi)], axis=1), smoothing=0.05)
    inside = made.curvature_table[20:-20]
    np.testing.assert_allclose(inside, 0.1, atol=2e-3)


def test_unit_speed(frame: FrenetFrame) -> None:
    s = np.linspace(-5.0, frame.length + 5.0, 4001)
    speed = np.linalg.norm(np.diff(frame.position(s), axis=0), axis=1) / np.diff(s)
    np.testing.assert_allclose(speed, 1.0, atol=1e-4)


def test_derivatives_against_finite_differences(frame: FrenetFrame) -> None:
    s, h = np.random.default_rng(1).uniform(1.0, frame.length - 1.0, 300), 1e-4
    step = (frame.position(s + h) - frame.position(s - h)) / (2 * h)
    np.testing.assert_allclose(np.arctan2(step[:, 1], step[:, 0]), frame.heading(s), atol=1e-7)
    np.testing.assert_allclose(
        (frame.heading(s + h) - frame.heading(s - h)) / (2 * h), frame.curvature(s), atol=1e-5
    )
    knot = np.abs(np.rint(s / frame.s[1]) * frame.s[1] - s) < 2 * h  # the rate jumps at knots
    rate = (frame.curvature(s + h) - frame.curvature(s - h)) / (2 * h)
    np.testing.assert_allclose(rate[~knot], frame.curvature_rate(s)[~knot], atol=1e-5)


def test_a_bend_is_curvature_and_rate(frame: FrenetFrame) -> None:
    s = np.linspace(-2.0, frame.length + 2.0, 77)
    curvature, rate = frame.bend(s)
    np.testing.assert_array_equal(curvature, frame.curvature(s))
    np.testing.assert_array_equal(rate, frame.curvature_rate(s))


def test_curvature_is_continuous(frame: FrenetFrame) -> None:
    s = np.concatenate([frame.s, [0.0, frame.length]])
    np.testing.assert_allclose(frame.curvature(s - 1e-9), frame.curvature(s + 1e-9), atol=1e-6)
    assert frame.curvature(-3.0) == 0.0
    assert frame.curvature(frame.length + 3.0) == 0.0


@given(st.floats(-20.0, 120.0), st.floats(-0.8, 0.8))
def test_round_trip(s: float, part: float) -> None:
    made = FrenetFrame.from_points(turn())
    kappa = max(np.max(np.abs(made.curvature_table)), 1e-6)
    l = part / kappa  # noqa: E741
    back = made.to_frenet(made.to_cartesian(s, l))
    np.testing.assert_allclose(back, [s, l], atol=1e-6)


def test_projection_outside_of_the_domain(frame: FrenetFrame) -> None:
    arc = 30.0 + 0.7 * TURN_RADIUS
    assert np.isnan(frame.to_frenet(frame.to_cartesian(arc, 0.99 / float(frame.curvature(arc))))).all()
    assert np.isnan(frame.to_frenet(np.array([[-20.0, -61.0]]))).all()
    assert np.isnan(frame.to_frenet(np.array([[np.nan, 1.0]]))).all()
    np.testing.assert_allclose(frame.to_frenet(np.array([-130.0, 2.0])), [-100.0, 2.0], atol=0.1)
    assert frame.to_frenet(np.zeros((0, 2))).shape == (0, 2)
    assert frame.to_frenet(np.zeros((3, 4, 2))).shape == (3, 4, 2)


@settings(max_examples=40, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_from_a_place_near_by_it_is_the_same_projection(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(0.0, rng.choice([0.02, 0.1, 0.25]), 60))
    path = np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]) * 3.0, axis=0)
    frame = FrenetFrame.from_points(path, max_lateral=20.0)
    middle = path[rng.integers(0, len(path), 40)] + rng.normal(0.0, rng.choice([2.0, 12.0]), (40, 2))
    outlines = middle[:, None] + rng.uniform(-3.0, 3.0, (40, 5, 2))
    points, start = outlines.reshape(-1, 2), frame.to_frenet(middle)[:, 0].repeat(5)
    np.testing.assert_allclose(to_frenet_from(frame, points, start), frame.to_frenet(points), atol=1e-9)
    for at in (frame.nearest(middle), np.full(len(middle), -1)):
        found = to_frenet_around(frame, points, middle, np.full(len(middle), 5), at)
        np.testing.assert_allclose(found, frame.to_frenet(points), atol=1e-9)
    # and from anywhere: where that is too far, it is searched for
    start = rng.uniform(0.0, frame.length, len(points))
    np.testing.assert_allclose(to_frenet_from(frame, points, start), frame.to_frenet(points), atol=1e-9)


def test_most_of_what_is_beside_a_road_is_known_to_be_nearest(frame: FrenetFrame) -> None:
    s = np.linspace(1.0, frame.length - 1.0, 200)
    for side in (-1.0, 1.0):
        bend = np.maximum(side * frame.curvature(s), 0.0)
        reach = alone(frame, s, np.full(200, side))
        assert (reach <= 1.0 / np.maximum(bend, 1e-9)).all()
        assert np.median(reach) > 4.0


def test_a_bend_between_two_places_counts_as_well() -> None:
    """A metre of a bend, and back, between two of the places that are looked at: its middle is a bound."""
    heading = np.where(np.arange(80) < 42, 0.0, np.where(np.arange(80) < 44, 1.3, 0.52))
    path = np.cumsum(0.5 * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    made = FrenetFrame.from_points(path, max_lateral=20.0)
    assert np.abs(made.curvature_table).max() > 0.5
    for side in (-1.0, 1.0):
        reach = alone(made, made.s, np.full(len(made.s), side))
        assert (reach * side * made.curvature_table).max() < 0.7
        assert reach.max() > 10.0


def test_near_picks_the_branch_where_the_path_passes_twice() -> None:
    phi = np.linspace(0.0, 2.2 * 2 * np.pi, 800)
    made = FrenetFrame.from_points(12.0 * np.stack([np.cos(phi), np.sin(phi)], axis=1), smoothing=0.02)
    point = made.to_cartesian(20.0, 0.5)
    around = 2 * np.pi * 12.0
    assert made.to_frenet(point, near=22.0)[0] == pytest.approx(20.0, abs=1e-6)
    assert made.to_frenet(point, near=22.0 + around)[0] == pytest.approx(20.0 + around, abs=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_smoothing_stays_within_its_tolerance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.uniform(-0.35, 0.35, 12))
    coarse = np.cumsum(6.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    made = FrenetFrame.from_points(coarse, smoothing=0.15)
    assert (
        np.nanmax(np.abs(made.to_frenet(coarse)[:, 1])) < 0.25
    )  # the tolerance, and half a chord between samples
    assert np.max(np.abs(made.curvature_table)) < 0.35 / 1.5


def test_coarse_arc_comes_out_near_the_truth() -> None:
    phi = np.linspace(0.0, 1.5, 8)
    arc = TURN_RADIUS * np.stack([np.sin(phi), 1.0 - np.cos(phi)], axis=1)
    straight = np.array([[-40.0, 0.0], [-20.0, 0.0]])
    run = arc[-1] + np.array([[20.0], [40.0]]) * np.array([np.cos(1.5), np.sin(1.5)])
    made = FrenetFrame.from_points(np.concatenate([straight, arc, run]))
    assert np.max(made.curvature_table) == pytest.approx(1.0 / TURN_RADIUS, rel=0.25)
    assert np.min(made.curvature_table) > -0.02
    assert np.max(np.abs(made.curvature_rate(made.s))) < 0.05


def test_malformed_paths() -> None:
    with pytest.raises(ScenarioError, match="not finite"):
        FrenetFrame.from_points([[0.0, 0.0], [np.inf, 0.0]])
    with pytest.raises(ScenarioError, match="shorter"):
        FrenetFrame.from_points([[1.0, 1.0], [1.0, 1.0], [1.2, 1.0]])
    with pytest.raises(ScenarioError, match="shape"):
        FrenetFrame.from_points([1.0, 2.0, 3.0])
    assert FrenetFrame.from_points([[0, 0], [0, 0], [4, 0], [4, 0]]).length == pytest.approx(4.0)


def test_tables_are_read_only(frame: FrenetFrame) -> None:
    with pytest.raises(ValueError, match="read-only"):
        frame.s[0] = 1.0


def test_scalar_and_nan_arguments(frame: FrenetFrame) -> None:
    assert frame.position(1.0).shape == (2,)
    assert frame.heading(np.zeros((2, 3))).shape == (2, 3)
    assert np.isnan(frame.position(np.nan)).all()


def test_cartesian_speed_and_heading_match_finite_differences(frame: FrenetFrame) -> None:
    t = np.linspace(0.0, 5.0, 501)
    s, l = 10.0 + 8.0 * t, np.sin(t)  # noqa: E741
    zero = np.zeros((len(t), 2))
    made = FrenetTrajectory(
        t, np.stack([s, l], axis=1), np.stack([np.full_like(t, 8.0), np.cos(t)], axis=1), zero, zero
    )
    path = frame.cartesian(made)
    velocity = np.gradient(path.xy, t, axis=0)[1:-1]
    np.testing.assert_allclose(np.hypot(*velocity.T), path.speed[1:-1], atol=2e-3)
    np.testing.assert_allclose(np.arctan2(velocity[:, 1], velocity[:, 0]), path.heading[1:-1], atol=2e-3)
    assert path.distance[-1] == pytest.approx(np.sum(np.hypot(*np.diff(path.xy, axis=0).T)))
    assert path.distance[-1] == pytest.approx(np.trapezoid(path.speed, t), rel=1e-4)


def test_heading_is_held_where_the_vehicle_stands(frame: FrenetFrame) -> None:
    n = 6
    speed = np.array([0.0, 1.0, 1.0, 0.5 * STANDSTILL, 0.0, 0.0])
    sideways = np.array([0.0, 0.1, 0.2, -0.5 * STANDSTILL, 0.0, 0.0])
    path = frame.cartesian(trajectory(np.full(n, 5.0), np.zeros(n), speed, sideways))
    slip = path.heading - float(frame.heading(5.0))
    np.testing.assert_allclose(slip[0], np.arctan(0.1))
    np.testing.assert_allclose(slip[2:], np.arctan(0.2))
    standing = frame.cartesian(trajectory(np.full(n, 36.0), np.zeros(n), np.zeros(n), np.zeros(n)))
    np.testing.assert_allclose(standing.heading, float(frame.heading(36.0)))


def test_reversing_keeps_the_heading(frame: FrenetFrame) -> None:
    s = np.linspace(10.0, 5.0, 6)
    path = frame.cartesian(trajectory(s, np.zeros(6), np.full(6, -2.0), np.zeros(6)))
    np.testing.assert_allclose(path.heading, frame.heading(s), atol=1e-9)
    np.testing.assert_allclose(path.speed, -2.0, rtol=1e-3)
