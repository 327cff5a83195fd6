"""The checker's short cuts: what they settle, the full tests settle in the same way."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from repair.check.limits import plane_accelerations, plane_excess, surely_kept
from repair.check.peaks import peaks
from repair.curves.bspline import UniformBSpline
from repair.curves.plane import STANDSTILL, CartesianPath, held_headings
from repair.scene.frame import FrenetFrame
from repair.scene.road.gaps import Gaps
from repair.scene.traffic.obstacle import Obstacle
from repair.vehicle import transitions_fast
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.single_track import body_angles, driven_states
from repair.vehicle.transitions import direct_check, transition_errors
from repair.vehicle.transitions_fast import clearly_drivable
from repair.world.collision import CollisionWorld
from repair.world.road import RoadBoundary, grouping
from repair.world.road_corridor import RoadCorridor, _reach
from repair.world.tracks import AFTER, BEFORE, INSTANT

EGO = load_vehicle(1)


def driven(rng, n=60, spread=5.0):
    """Poses (n,) along a random drive through the middle of [0, 60] x [-spread, spread]."""
    speed = rng.uniform(0.0, 0.8) * (1.0 + 0.5 * np.sin(np.linspace(0, rng.uniform(0, 4), n)))
    heading = rng.uniform(-np.pi, np.pi) * (rng.random() < 0.3) + np.cumsum(rng.normal(0, 0.03) + np.zeros(n))
    x = rng.uniform(5, 30) + np.cumsum(speed * np.cos(heading))
    y = rng.uniform(-spread, spread) + np.cumsum(speed * np.sin(heading))
    return x, y, heading + rng.normal(0, 0.05, n)


# ------------------------------------------------------------------- the path


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_keeps_to_the_path_is_carried_as_anything_else(seed):
    rng = np.random.default_rng(seed)
    along = np.linspace(0.0, 60.0, 60)
    turned = np.exp(1j * rng.uniform(-3, 3)) * (along + 1j * rng.uniform(0, 5) * np.sin(along / 9.0))
    frame = FrenetFrame.from_points(turned.view(np.float64).reshape(-1, 2))
    n = int(rng.integers(1, 60))
    motion = np.zeros((4, n))
    motion[2] = rng.choice([0.0, 0.005, 0.5, 5.0]) + rng.normal(0, rng.choice([0.0, 0.1, 1.0]), n)
    motion[0] = rng.uniform(-5, 60) + 0.025 * np.cumsum(motion[2])
    t = 0.025 * np.arange(n)
    kept = frame.carry(t, motion)
    motion[1] = 1e-300  # nowhere else, but no longer nothing
    for found, plain in zip(kept, frame.carry(t, motion), strict=True):
        np.testing.assert_allclose(found, plain, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(kept.xy, frame.position(motion[0]), rtol=1e-12, atol=1e-12)


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=12))
def test_the_heading_of_a_stop_is_that_of_the_last_moving_sample(moving):
    heading, fallback = np.arange(len(moving)) + 1.0, np.full(len(moving), -1.0)
    last, wanted = moving.index(True) if any(moving) else None, []
    for k, moves in enumerate(moving):
        last = k if moves else last
        wanted.append(-1.0 if last is None else heading[last])
    pace = np.where(moving, STANDSTILL, 0.5 * STANDSTILL)
    assert held_headings(heading, fallback, pace).tolist() == wanted


@pytest.mark.parametrize("sideways", [0.0, 0.3])
def test_a_path_knows_its_steps_and_turns(sideways):
    frame = FrenetFrame.from_points(np.column_stack((np.arange(60.0), 4.0 * np.sin(np.arange(60) / 9.0))))
    t = 0.025 * np.arange(40)
    motion = np.array((9.0 + 8.0 * t - t**2, sideways * t, 8.0 - 2.0 * t, sideways + 0.0 * t))
    path = frame.carry(t, motion)
    np.testing.assert_allclose(path.step, np.hypot(*np.diff(path.xy, axis=0).T))
    np.testing.assert_array_equal(path.turn, np.diff(path.heading))
    assert path.slowest == path.speed.min()
    assert path.longest == path.step.max()
    assert path.sharpest == np.abs(path.turn).max()
    for row in range(4):
        holed = motion.copy()
        holed[row, 7] = np.nan
        found = frame.carry(t, holed)
        assert np.isnan(found.slowest + found.longest + found.sharpest)


# ------------------------------------------------------------------- the road


def lanelet(left, right):
    fields = dict.fromkeys(("adj_left", "adj_left_same_direction", "adj_right", "adj_right_same_direction"))
    return SimpleNamespace(lanelet_id=1, left_vertices=left, right_vertices=right, **fields)


def ragged_road(rng):
    """A road along x whose edges have spikes into it."""
    x = np.sort(rng.uniform(-20, 90, 40))
    sides = []
    for side in (1.0, -1.0):
        y = side * (rng.uniform(2, 7) + rng.uniform(0, 1, 40))
        spikes = rng.random(40) < rng.choice([0.0, 0.1])
        y[spikes] -= side * rng.uniform(0, 3, spikes.sum())
        sides.append(np.column_stack((x, y)))
    network = SimpleNamespace(lanelets=[lanelet(*sides)])
    return RoadBoundary(SimpleNamespace(lanelet_network=network), EGO)


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_box_around_several_poses_is_on_the_road_only_if_they_are(seed):
    rng = np.random.default_rng(seed)
    road = ragged_road(rng)
    x, y, heading = driven(rng, int(rng.integers(1, 90)), 3.0)
    inside = road.inside(road.outline(x, y, heading))
    assert inside[road.surely_inside(x, y, heading)].all()
    first = road.first_off_road(x, y, heading)
    assert first == (None if inside.all() else int(np.argmin(inside)))


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_first_gap_that_is_crossed_is_that_of_one_pose_after_the_other(seed):
    rng = np.random.default_rng(seed)
    road = ragged_road(rng)
    corner = np.column_stack((rng.uniform(0, 60, 6), rng.uniform(-6, 6, 6)))
    gaps = shapely.union_all(shapely.box(*corner.T, *(corner + rng.uniform(0.01, 1.5, (6, 2))).T))
    road.__dict__["_gaps"] = Gaps(gaps)
    x, y, heading = driven(rng, int(rng.integers(1, 90)), 3.0)
    if rng.random() < 0.2:
        x[rng.integers(len(x))] = np.nan
    bodies = shapely.polygons(road.outline(x, y, heading))
    crossed = np.flatnonzero(shapely.area(shapely.intersection(bodies, gaps)) > 1e-5)
    found = road.over_a_gap(x, y, heading)
    assert (found and found[0]) == (int(crossed[0]) if len(crossed) else None)


def test_most_poses_on_a_wide_road_are_settled_by_boxes():
    edge = np.array([[-20.0, 5.0], [90.0, 5.0]])
    network = SimpleNamespace(lanelets=[lanelet(edge, edge * (1, -1))])
    road = RoadBoundary(SimpleNamespace(lanelet_network=network), EGO)
    x = np.linspace(0.0, 60.0, 161)
    assert road.surely_inside(x, np.sin(x / 9.0), 0.1 * np.cos(x / 9.0)).all()


def test_the_last_pose_fills_up_the_last_group():
    assert grouping(10, 4).T.tolist() == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 9, 9]]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_poses_that_are_nowhere_are_off_the_road(bad):
    edge = np.array([[-20.0, 5.0], [90.0, 5.0]])
    network = SimpleNamespace(lanelets=[lanelet(edge, edge * (1, -1))])
    road = RoadBoundary(SimpleNamespace(lanelet_network=network), EGO)
    for column in range(2):
        poses = np.zeros((3, 20))
        poses[0] = np.linspace(0.0, 5.0, 20)
        poses[column, 7] = bad
        assert road.first_off_road(*poses) == 7


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_corridor_holds_only_what_is_on_the_road(seed):
    rng = np.random.default_rng(seed)
    road = ragged_road(rng)
    along = np.linspace(-30.0, 95.0, 60)
    bends = rng.uniform(0, 4) * np.sin(along / rng.uniform(8, 40) + rng.uniform(0, 6))
    frame = FrenetFrame.from_points(np.column_stack((along, bends)))
    corridor = RoadCorridor(road, frame, EGO)
    s, l = rng.uniform(-5, frame.length + 5, 400), rng.normal(0, 2, 400)  # noqa: E741
    xy = frame.to_cartesian(s, l)
    orientation = frame.heading(s) + rng.normal(0, rng.choice([0.0, 0.1, 1.0]), 400)
    s = s + rng.choice([0.0, 0.0, 1.0, 200.0], 400)  # a wrong cell may only say that it does not know
    held = corridor.holds(s, np.ascontiguousarray(xy).view(np.complex128)[:, 0], orientation)
    assert road.inside(road.outline(*xy.T, orientation))[held].all()


def reach(u, w, along):
    """Return least and largest w of an edge's part with |u| <= along in exact numbers; None without one."""
    (u0, u1), (w0, w1), along = (Fraction(v) for v in u), (Fraction(v) for v in w), Fraction(along)
    parts = [Fraction(0), Fraction(1)]
    if u0 != u1:
        parts += [p for p in ((side - u0) / (u1 - u0) for side in (along, -along)) if 0 <= p <= 1]
    found = [w0 + p * (w1 - w0) for p in parts if abs(u0 + p * (u1 - u0)) <= along]
    return (min(found), max(found)) if found else None


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_edge_reaches_farther_than_the_corridor_takes_it(seed):
    """However little it goes on along the axis: differences may be as small as numbers get."""
    rng = np.random.default_rng(seed)
    along, count = 3.3, 40
    first = rng.choice([0.0, along, -along, *rng.uniform(-5.0, 5.0, 4)], count)
    run = rng.choice([-1.0, 0.0, 1.0], count) * 10.0 ** rng.choice([0, -1, -5, -7, -12, -307, -320], count)
    u, w = np.array([first, first + run]), rng.uniform(-15.0, 15.0, (2, count))
    low, high = _reach(u, w, along)
    for k in range(count):
        plain = reach(u[:, k], w[:, k], along)
        if plain is None:
            continue
        assert low[k] <= plain[0] + 1e-7
        assert high[k] >= plain[1] - 1e-7
        if abs(u[1, k] - u[0, k]) > 1e-6:
            assert (low[k], high[k]) == pytest.approx([float(v) for v in plain], abs=1e-7)


def test_the_corridor_holds_nearly_up_to_the_edge():
    edge = np.array([[-20.0, 5.0], [90.0, 5.0]])
    network = SimpleNamespace(lanelets=[lanelet(edge, edge * (1, -0.5))])
    road = RoadBoundary(SimpleNamespace(lanelet_network=network), EGO)
    corridor = RoadCorridor(road, FrenetFrame.from_points(np.array([[0.0, 0.0], [60.0, 0.0]])), EGO)
    s = np.linspace(0.0, 60.0, 161)
    for y, held in ((4.9, True), (5.1, False), (-2.4, True), (-2.6, False)):
        centre = s + 1j * (y - np.sign(y) * 0.5 * EGO.width)
        assert corridor.holds(s, centre, np.zeros(161)).all() == held
        assert corridor.holds(s, centre, np.zeros(161)).any() == held


def test_the_corridor_does_not_hold_what_is_nowhere():
    edge = np.array([[-20.0, 5.0], [90.0, 5.0]])
    network = SimpleNamespace(lanelets=[lanelet(edge, edge * (1, -1))])
    road = RoadBoundary(SimpleNamespace(lanelet_network=network), EGO)
    corridor = RoadCorridor(road, FrenetFrame.from_points(np.array([[0.0, 0.0], [60.0, 0.0]])), EGO)
    for place in (complex(np.nan, 0.0), complex(3.0, np.nan), 1e300 + 0j):
        assert not corridor.holds(np.array([3.0]), np.array([place]), np.zeros(1)).any()
    for angle in (np.nan, np.inf, 1e300):
        assert not corridor.holds(np.array([3.0]), np.array([3.0 + 0j]), np.array([angle])).any()
    nowhere = RoadBoundary(SimpleNamespace(lanelet_network=SimpleNamespace(lanelets=[])), EGO)
    corridor = RoadCorridor(nowhere, FrenetFrame.from_points(np.array([[0.0, 0.0], [60.0, 0.0]])), EGO)
    assert not corridor.holds(np.array([3.0]), np.array([3.0 + 0j]), np.zeros(1)).any()


# -------------------------------------------------------------------- contact


def crowd(rng, steps=20):
    """Obstacles of every kind that drive about, some of them only for a while."""
    obstacles = []
    for name in range(int(rng.integers(0, 7))):
        t = np.arange(steps + 1)[:, None] * 0.1
        centre = rng.uniform((0, -6), (45, 6)) + rng.normal(0, 8, 2) * t
        heading = rng.uniform(-4, 4) + rng.normal(0, 1) * t
        size = np.tile(rng.uniform(0.2, 3.0, 2), (steps + 1, 1))
        rows = np.hstack((centre, heading, size))
        if rng.random() < 0.4:
            rows[rng.random(steps + 1) < rng.choice([0.2, 0.8])] = np.nan
        kind = rng.choice(["rectangle", "circle", "polygon"])
        corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * size[0]
        polygons = tuple(() if np.isnan(row).any() else (corners + row[:2],) for row in rows)
        obstacles.append(Obstacle(
            id=name, kind="car", role=str(rng.choice(["dynamic", "set_based"])),
            vertices=np.zeros((steps + 1, 4, 2)), states=np.column_stack((rows[:, :3], rows[:, 3])),
            rectangles=rows if kind == "rectangle" else None,
            circles=rows[:, [0, 1, 3]] if kind == "circle" else None,
            polygons=polygons if kind == "polygon" else (),
        ))  # fmt: skip
    return obstacles


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_looking_at_blocks_drops_no_contact(seed):
    rng = np.random.default_rng(seed)
    substeps = int(rng.integers(1, 6))
    late = {name: int(rng.integers(-3, 4)) for name in range(7)}
    late_crowd = [replace(one, late=late.get(one.id, 0)) for one in crowd(rng)]
    world = CollisionWorld(late_crowd, EGO, 0.1, 20, substeps)
    start = int(rng.integers(0, world.n_samples))
    x, y, heading = driven(rng, int(rng.integers(1, world.n_samples - start + 1)))
    here = x + 1j * y
    found = world.contact_along(here, heading, start)
    assert world.contact_along(here, heading, start, all_pairs=True) == found


@settings(max_examples=120, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_margin_and_contact_are_looked_for_at_once(seed):
    rng = np.random.default_rng(seed)
    world = CollisionWorld(crowd(rng), EGO, 0.1, 20, int(rng.integers(1, 6)))
    start = int(rng.integers(0, world.n_samples))
    x, y, heading = driven(rng, int(rng.integers(1, world.n_samples - start + 1)))
    here, margin = x + 1j * y, float(rng.choice([0.01, 0.4]))
    step = float(np.abs(np.diff(here)).max(initial=0.0))
    beside = world.met_at(start, complex(here[0]), float(heading[0]), margin) if rng.random() < 0.5 else ()
    asked = {"margin": margin, "beside": frozenset(beside), "since": int(rng.integers(0, 5))}
    near, contact = (world.contact_along(here, heading, start, **keys) for keys in (asked, {}))
    assert world.met_along(here, heading, start, step, **asked) == (near, contact)
    late = contact is not None and near is not None and contact.time > near.time
    sooner = world.met_along(here, heading, start, step, **asked, fully=False)
    assert sooner == (near, None if late else contact)
    assert world.contact_along(here, heading, start, **asked, all_pairs=True) == near


@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_pairs_are_looked_at_in_the_order_of_time(seed):
    rng = np.random.default_rng(seed)
    late_crowd = [replace(one, late=int(rng.integers(-1, 2))) for one in crowd(rng)]
    table = CollisionWorld(late_crowd, EGO, 0.1, 20, 2)._table
    tracks, last = len(table.kind), 12
    since = rng.integers(0, 3, tracks)
    track = rng.integers(0, tracks, int(rng.integers(0, 30))) if tracks else np.zeros(0, dtype=int)
    ego = rng.integers(since[track], last + 1)
    expected = set()
    for k, m in zip(ego.tolist(), track.tolist(), strict=True):
        there = np.isfinite(table.heading.reshape(-1, tracks)[3:, m])
        beside = [(j, j + 1) for j in (k - 1, k) if since[m] <= j < last and table.mode[m] != INSTANT]
        held = {BEFORE: (k, k + 1) in beside, AFTER: (k - 1, k) in beside}
        if not held.get(table.mode[m], any(there[i + j - k] for i, j in beside)):
            expected.add((k, m, k))
        expected |= {(i, m, j) for i, j in beside}
    found = [(i, m, j) for i, j, m in table.intervals(ego, (ego + 3) * tracks + track, since, last)]
    assert found == sorted(expected)


# --------------------------------------------------------------------- limits


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_is_well_within_the_limits_breaks_none(seed):
    """Of a spline along a bent frame: what the look at the samples settles, its own derivatives confirm."""
    rng = np.random.default_rng(seed)
    along = np.linspace(0.0, 120.0, 120)
    points = along + 1j * rng.uniform(0, 4) * np.sin(along / rng.uniform(9.0, 30.0))
    frame = FrenetFrame.from_points(points.view(np.float64).reshape(-1, 2))
    count, h = 24, float(rng.choice([0.2, 0.4]))
    speed = np.maximum(rng.uniform(0, 15) + np.cumsum(rng.normal(0, rng.choice([0.05, 0.5]), count)), 0.0)
    side = rng.uniform(0, 1) * np.sin(np.arange(count) / rng.uniform(1.0, 6.0))
    curve = UniformBSpline(0.0, h, 3, np.column_stack((10.0 + np.cumsum(speed) * h, side)))
    t = 0.025 * np.arange(int(rng.integers(3, 120)))
    samples = curve.sample(t[t <= curve.t_end])
    path = frame.cartesian(samples)
    reached = peaks(path)
    share = rng.uniform(0.95, 1.3, 5)  # the limits are near to what is reached
    limits = SimpleNamespace(
        v_max=share[0] * abs(reached.max_speed),
        a_min=min(-1e-3, share[1] * reached.min_acceleration),
        a_max=max(1e-3, share[2] * reached.max_acceleration),
        a_lat=max(1e-3, share[3] * reached.max_lateral_acceleration),
        a_total=max(1e-3, share[4] * reached.max_total_acceleration),
    )
    if surely_kept(path, 0, limits, EGO):
        assert plane_excess(curve, samples, frame, limits, EGO, 0.0) == []


@pytest.mark.parametrize("seed", [60, 75, 106, 371, 437, 475, *range(20)])
def test_peaks_at_the_knots_of_the_axis_are_seen_between_samples(seed):
    """Beside a bend the acceleration jumps where the axis' curvature changes its rate."""
    rng = np.random.default_rng(seed)
    along = np.arange(0.0, 80.0, rng.uniform(0.7, 2.0))
    axis = np.column_stack([along, rng.uniform(0.3, 1.5) * np.sin(along / rng.uniform(4.0, 9.0))])
    frame, k = FrenetFrame.from_points(axis + rng.normal(0.0, 0.02, axis.shape)), np.arange(14)
    ahead = rng.uniform(5, 15) + k * rng.uniform(0.5, 2.5) + rng.uniform(-0.02, 0.02) * k**2
    curve = UniformBSpline(0.0, 0.2, 3, np.column_stack([ahead, rng.uniform(-2, 2) + 0.0 * k]))
    fine = curve.sample(np.arange(0.0, curve.t_end, 1e-3))
    total = np.hypot(*plane_accelerations(frame, fine))
    most = float(total.max()) - 1e-3
    limits = SimpleNamespace(v_max=99.0, a_min=-99.0, a_max=np.inf, a_lat=99.0, a_total=most)
    coarse = curve.sample(np.arange(int(curve.t_end / 0.05) + 1) * 0.05)
    if fine.t[total.argmax()] <= coarse.t[-1]:
        assert plane_excess(curve, coarse, frame, limits, EGO, 0.0)


def test_gentle_driving_is_well_within_the_limits():
    t = 0.025 * np.arange(80)
    path = CartesianPath.through(t, np.zeros(80) * 1j, 0.05 * t, 10.0 - t, 7.0)
    limits = SimpleNamespace(v_max=20.0, a_min=-5.0, a_max=5.0, a_lat=5.0, a_total=5.0)
    assert surely_kept(path, 0, limits, EGO)
    assert surely_kept(path, 30, limits, EGO)
    assert surely_kept(path._replace(slowest=-1e-13), 30, limits, EGO)
    assert not surely_kept(path._replace(slowest=-0.1), 30, limits, EGO)
    for bad in (np.nan, 30.0):
        path.speed[40] = bad
        assert not surely_kept(path, 30, limits, EGO)


# ----------------------------------------------------------------- kinematics


def ride(rng, vehicle, dt):
    """States along a random drive, from gentle to impossible."""
    n = int(rng.integers(2, 40))
    speed = rng.uniform(-2, 20) + np.cumsum(rng.normal(0, rng.choice([0.1, 0.1, 1.0, 10.0]), n)) * dt
    curvature = np.cumsum(rng.normal(0, rng.choice([1e-4, 1e-3, 0.01, 0.1]), n))
    step = speed * dt
    heading = np.cumsum(curvature * step)
    xy = np.cumsum(np.column_stack((np.cos(heading), np.sin(heading))) * step[:, None], axis=0)
    xy += rng.choice([0.0, 0.0, 0.0, 4990.0, 1e6]) + rng.normal(0, rng.choice([0.0, 0.0, 0.003]), (n, 2))
    path = CartesianPath.through(dt * np.arange(n), xy.view(np.complex128)[:, 0], heading, speed, speed.min())
    slip, orientation = body_angles(path, vehicle)
    return xy, speed, slip, orientation


@settings(max_examples=200, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 3, 4]))
def test_clearly_drivable_is_drivable_step_by_step(seed, type_id):
    rng = np.random.default_rng(seed)
    vehicle, dt = load_vehicle(type_id), float(rng.choice([0.04, 0.1, 0.2]))
    motion = ride(rng, vehicle, dt)
    if clearly_drivable(*motion, dt, vehicle):
        states = driven_states(np.arange(len(motion[0])) * dt, *motion, vehicle)
        assert direct_check(states, dt, vehicle).ok.all()


@pytest.mark.parametrize("errors", ["shift", "turn"])
def test_the_bounds_of_clearly_drivable_hold_for_the_errors(errors, monkeypatch):
    """With one tolerance cut down to a drive's own error, that drive must not pass."""
    name = "POSITION_TOLERANCE" if errors == "shift" else "ORIENTATION_TOLERANCE"
    share = 0.5 if errors == "shift" else 0.4
    rng, asked = np.random.default_rng(3), 0
    for _ in range(3000):
        with monkeypatch.context() as patch:
            motion = ride(rng, EGO, 0.1)
            if not clearly_drivable(*motion, 0.1, EGO):
                continue
            states = driven_states(np.arange(len(motion[0])) * 0.1, *motion, EGO)
            error = float(np.max(transition_errors(states, 0.1, EGO)[errors == "turn"]))
            patch.setattr(transitions_fast, name, error / share * (1.0 - 1e-6))
            asked += error > 1e-6
            assert error <= 1e-9 or not clearly_drivable(*motion, 0.1, EGO)
    assert asked > 100


@pytest.mark.parametrize("column", range(5))
def test_what_is_not_a_number_is_not_clearly_drivable(column):
    t = np.arange(9) * 0.1
    rows = np.array((10.0 * t, 0 * t, 0 * t + 10.0, 0 * t, 0 * t))
    assert clearly_drivable(rows[:2].T, *rows[2:], 0.1, EGO)
    for k in range(9):
        rows[column, k], kept = np.nan, rows[column, k]
        assert not clearly_drivable(rows[:2].T, *rows[2:], 0.1, EGO)
        rows[column, k] = kept
