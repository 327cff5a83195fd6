"""What a bound stands on, one part after the other, against motions and shapes at random."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from repair.bounds.forbidden import forbidden
from repair.bounds.motion import Motions
from repair.bounds.relaxed import Drive, Relaxation, Rows, excess

CORNERS = np.array([[3.6, 0.85], [-0.7, 0.85], [-0.7, -0.85], [3.6, -0.85]])


def motions(rear: float, speed: float, rate: float = 0.0, top: float = 10.0) -> Motions:
    velocity = np.array([speed, rear * rate])
    ahead = 0.0 if rear else 1.5
    return Motions(
        np.zeros(2), velocity, 0.0, rate, top, 0.45, rear, ahead, 2.2, 0.9, 0.5 * top, top, 3.0 * top
    )


@given(st.integers(0, 2**32 - 1), st.floats(-3.1, 3.1), st.floats(0.0, 2.5))
@settings(max_examples=60, deadline=None)
def test_from_a_forbidden_place_the_body_meets_the_shape_at_every_heading(seed, low, width):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (rng.integers(3, 7), 2)) * rng.uniform(0.5, 5.0, 2)
    hull = shapely.MultiPoint(points).convex_hull
    if hull.geom_type != "Polygon" or hull.area < 0.05:
        return
    shape = np.asarray(shapely.geometry.polygon.orient(hull).exterior.coords)[:-1]
    polygon = forbidden(shape, CORNERS, low, low + width)
    if polygon is None:
        return
    weight = rng.dirichlet(np.ones(len(polygon)), 20)
    places = np.concatenate((polygon, weight @ polygon))
    obstacle = shapely.Polygon(shape)
    for place in places:
        for heading in rng.uniform(low, low + width, 12):
            c, s = math.cos(heading), math.sin(heading)
            body = shapely.Polygon(CORNERS @ np.array([[c, s], [-s, c]]) + place)
            assert body.distance(obstacle) <= 1e-9


def test_forbidden_places_are_nearly_all_of_them_where_the_heading_is_known():
    shape = np.array([[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]])
    found = shapely.Polygon(forbidden(shape, CORNERS, -1e-3, 1e-3))
    exact = shapely.box(-2.0 - 3.6, -1.85, 2.0 + 0.7, 1.85)
    assert exact.covers(found)
    assert found.area > 0.97 * exact.area


def body_motion(m: Motions, rng: np.random.Generator, times: np.ndarray) -> tuple[np.ndarray, ...]:
    """Headings, velocities and positions at the times, of accelerations at random within what is assumed."""
    dt, steps = 2e-3, round(times[-1] / 2e-3)
    place, psi = np.zeros(2), m.heading
    theta, speed = math.atan2(m.velocity[1], m.velocity[0]), m.speed
    pieces = rng.integers(1, 6)
    angle = rng.uniform(-math.pi, math.pi, pieces)
    kept = [(psi, speed * np.array([math.cos(theta), math.sin(theta)]), place.copy())]
    for n in range(steps):
        a = 0.999 * m.acceleration * np.array([math.cos(x := angle[n * pieces // steps]), math.sin(x)])
        push = min(a[0], m.forward, m.power / max(speed, 1e-9))
        new = max(speed + push * dt, 0.0)
        bend = np.clip(a[1] / max(speed, 1e-3), -m.curvature * speed, m.curvature * speed)
        way, course = 0.5 * (speed + new) * dt, theta + 0.5 * bend * dt
        if m.rear:
            turn = way * math.sin(course - psi) / m.rear
            if abs(math.sin(course - psi)) > m.rear * m.curvature:  # the wheels do not turn that far
                turn = math.copysign(way * m.curvature, turn)
                bend = turn / dt
            psi += turn
        theta += bend * dt
        psi = psi if m.rear else theta
        speed = new
        place = place + way * np.array([math.cos(course), math.sin(course)])
        kept.append((psi, speed * np.array([math.cos(theta), math.sin(theta)]), place.copy()))
    index = np.rint(times / dt).astype(int)
    return tuple(np.array([kept[i][j] for i in index]) for j in range(3))


@given(st.integers(0, 2**32 - 1), st.sampled_from((0.0, 1.5)), st.floats(0.0, 25.0), st.floats(-0.4, 0.4))
@settings(max_examples=30, deadline=None)
def test_no_motion_turns_more_than_the_bounds_say(seed, rear, speed, rate):
    rng = np.random.default_rng(seed)
    m = motions(rear, speed, rate * min(1.0, speed / 5.0))
    times = np.arange(0.0, 1.01, 0.05)
    turning = m.turning(times)
    heading, velocity, _ = body_motion(m, rng, times)
    assert (heading >= turning.low - 2e-3).all()
    assert (heading <= turning.high + 2e-3).all()
    turned = np.abs(heading[:, None] - heading[None])
    assert (turned <= np.abs(turning.turned[:, None] - turning.turned[None]) + 2e-3).all()
    fast = np.hypot(*velocity.T) > 0.5
    slip = np.abs(np.arctan2(velocity[:, 1], velocity[:, 0]) - heading)
    assert (slip[fast] <= turning.slip[fast] + 5e-3).all()


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 20.0))
@settings(max_examples=60, deadline=None)
def test_what_has_an_excess_is_kept_by_no_motion(seed, speed):
    rng = np.random.default_rng(seed)
    m = motions(0.0, speed)
    times = np.arange(0.0, 0.81, 0.05)
    count = int(rng.integers(1, 6))
    angle = rng.uniform(-math.pi, math.pi, count)
    rows = Rows(
        rng.integers(1, len(times), count),
        np.stack((np.cos(angle), np.sin(angle)), axis=1),
        rng.uniform(-2.0, 12.0, count),
        rng.random(count) < 0.3,
    )
    rows = rows._replace(level=np.where(rows.moving, 0.0, rows.level))
    axis = np.tile([1.0, 0.0], (len(times) - 1, 1))
    drive = Drive(axis, np.full(len(axis), 6.0), np.full(len(axis), 9.0))
    relaxed = Relaxation(m, times)
    place, velocity, slack, multipliers = relaxed.solve(rows, drive)
    value = np.where(
        rows.moving,
        np.sum(rows.direction * velocity[rows.instant], axis=1),
        np.sum(rows.direction * place[rows.instant], axis=1) - rows.level,
    )
    assert (value >= -slack * np.where(rows.moving, 1.0 / 0.3, 1.0) - 1e-5).all()
    if not multipliers.sum() or excess(m, times, rows, drive, multipliers) <= 0.0:
        return
    # at random: piecewise constant accelerations within the set
    turn = rng.uniform(-math.pi, math.pi, (200, len(times) - 1))
    a = 10.0 * np.stack((np.cos(turn), np.sin(turn)), axis=2)
    a[..., 0] = np.clip(a[..., 0], -9.0, 6.0)
    h = 0.05
    v = np.concatenate((np.zeros((200, 1, 2)), np.cumsum(a * h, axis=1)), axis=1) + m.velocity
    p = np.cumsum(h * v[:, :-1] + 0.5 * h * h * a, axis=1)
    p = np.concatenate((np.zeros((200, 1, 2)), p), axis=1)
    at = np.where(
        rows.moving,
        np.sum(v[:, rows.instant] * rows.direction, axis=2),
        np.sum(p[:, rows.instant] * rows.direction, axis=2) - rows.level,
    )
    assert (at @ multipliers < 0.0).all()


def test_braking_distance_is_the_bound_of_a_wall():
    """Before a wall that cannot be passed, the relaxed motion stops where a braking vehicle does."""
    m = motions(0.0, 12.0)
    times = np.arange(0.0, 2.001, 0.05)
    drive = Drive(np.tile([1.0, 0.0], (len(times) - 1, 1)), np.full(40, 5.0), np.full(40, 10.0))
    for gap, kept in ((7.3, True), (7.1, False)):  # v² / (2 a) = 7.2
        rows = Rows(np.array([24]), np.array([[-1.0, 0.0]]), np.array([-gap]), np.array([False]))
        _, _, slack, multipliers = Relaxation(m, times).solve(rows, drive)
        assert (slack < 1e-3) is kept
        if not kept:
            assert excess(m, times, rows, drive, multipliers) == pytest.approx(0.1, abs=0.01)
