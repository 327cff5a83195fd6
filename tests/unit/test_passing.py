"""Ways past obstacles: which manoeuvres are open, that their guides are free, and on which side they are."""

from __future__ import annotations

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests import toy

from repair.arrays import frozen
from repair.problem.lateral import lateral_profiles, quintics
from repair.problem.passing import _least_bad, open_passings, possible_maneuvers
from repair.problem.problem import Maneuver, Side
from repair.problem.speeds import Bends, speed_profiles
from repair.problem.surroundings import sides_of, surroundings
from repair.reference.profile import SpeedProfile
from repair.scene.road.bounds import LateralBounds

MARGIN = 0.1
# The way that comes closest where none is open is added at this cost; it may collide.
NOT_OPEN = 1e3
STRAIGHT = (np.array([0.0, 500.0]), np.array([0.0, 0.0]))


def ways(
    *boxes,
    v0=10.0,
    t_rep=0.0,
    t_end=5.0,
    bounds=toy.WIDE,
    lateral=True,
    limits=toy.LIMITS,
    curvature=STRAIGHT,
):
    """All passings, by manoeuvre."""
    obstacles = toy.occupancy(*boxes)
    t = t_rep + toy.DT * np.arange(round((t_end - t_rep) / toy.DT) + 1)
    reference = toy.constant(v0).sample(t)
    start = frozen([reference.position[0], reference.velocity[0], reference.acceleration[0]])
    found = open_passings(reference, start, obstacles, bounds, limits, MARGIN, lateral, curvature)
    assert len({p.maneuver for p in found}) == len(found)
    assert [p.cost for p in found] == sorted(p.cost for p in found)
    for passing in found:
        check(passing, obstacles, start, limits)
    return {p.maneuver: p for p in found}


def open_ways(*boxes, **keys):
    return {m for m, p in ways(*boxes, **keys).items() if p.cost < NOT_OPEN}


def check(passing, obstacles, start, limits):
    """What holds for every guide that is open, by brute force."""
    guide = passing.guide
    np.testing.assert_allclose(guide.position[0], start[0], atol=1e-9)
    np.testing.assert_allclose(guide.velocity[0], start[1], atol=1e-9)
    assert passing.side.shape == (len(obstacles), len(guide))
    assert (guide.velocity[:, 0] >= -1e-9).all()
    assert guide.velocity[:, 0].max() <= max(limits.v_max, start[1, 0]) + 1e-9
    assert guide.acceleration[:, 0].min() >= limits.a_min - 1e-9
    assert guide.acceleration[:, 0].max() <= limits.a_max + 1e-9
    if passing.cost >= NOT_OPEN:
        return
    for i, t in enumerate(guide.t):
        s, l = guide.position[i]  # noqa: E741
        for j in range(len(obstacles)):
            k = round(t / toy.DT)
            low, high = obstacles.lower[j, k], obstacles.upper[j, k]
            if np.isnan(low[0]):
                continue
            room = {
                Side.BEHIND: low[0] - s,
                Side.AHEAD: s - high[0],
                Side.LEFT: l - high[1],
                Side.RIGHT: low[1] - l,
            }
            assert max(room.values()) >= MARGIN - 1e-9, (passing.maneuver, t, j)
            assert room[Side(passing.side[j, i])] >= MARGIN - 1e-9
    fine = guide.t[0] + np.arange(0.0, guide.t[-1] - guide.t[0], 0.01)
    lower, upper = obstacles.at(fine)
    position = np.column_stack([np.interp(fine, guide.t, guide.position[:, r]) for r in range(2)])
    depth = np.minimum(position - lower, upper - position).min(axis=2)
    # between two guide times a corner can be cut, by no more than half of what the two move against
    # each other in a step
    speeds = [
        np.abs(np.diff(corner, axis=1)).max(initial=0.0, where=np.isfinite(np.diff(corner, axis=1)))
        for corner in (obstacles.lower, obstacles.upper)
    ]
    step = max(speeds) + np.abs(np.diff(guide.position, axis=0)).max()
    assert np.nanmax(depth, initial=-np.inf) <= 0.5 * step


BLOCK = toy.box((40.0, 48.0), (-1.0, 1.0))


def test_nothing_in_the_way_is_following():
    found = ways()
    assert set(found) == {Maneuver.YIELD}
    guide = found[Maneuver.YIELD].guide
    np.testing.assert_allclose(guide.position[:, 0], 10.0 * guide.t, atol=1e-9)
    assert not guide.position[:, 1].any()
    assert found[Maneuver.YIELD].cost == pytest.approx(0.0)


def test_static_block_with_room_on_both_sides():
    found = ways(BLOCK)
    assert {m for m, p in found.items() if p.cost < NOT_OPEN} == {
        Maneuver.YIELD,
        Maneuver.LEFT,
        Maneuver.RIGHT,
    }
    assert found[Maneuver.LEFT].guide.position[-1, 1] > 1.0
    assert found[Maneuver.RIGHT].guide.position[-1, 1] < -1.0
    assert found[Maneuver.YIELD].guide.position[-1, 0] < 40.0
    passed = found[Maneuver.LEFT].guide.position[:, 0] > 40.0
    assert (
        found[Maneuver.LEFT].side[0, passed & (found[Maneuver.LEFT].guide.position[:, 0] < 47.0)] == Side.LEFT
    ).all()
    assert (found[Maneuver.YIELD].side[0] == Side.BEHIND).all()


@pytest.mark.parametrize(
    "bounds, expected",
    [
        (toy.NARROW, set()),
        (LateralBounds(frozen([0.0, 500.0]), frozen([-0.5, -0.5]), frozen([6.0, 6.0])), {Maneuver.LEFT}),
        (LateralBounds(frozen([0.0, 500.0]), frozen([-6.0, -6.0]), frozen([0.5, 0.5])), {Maneuver.RIGHT}),
        # the road narrows beside the block
        (
            LateralBounds(
                frozen([0.0, 38.0, 40.0, 500.0]), frozen([-6.0, -6.0, -0.5, -0.5]), frozen([6.0] * 4)
            ),
            {Maneuver.LEFT},
        ),
    ],
)
def test_only_where_there_is_room_beside_it(bounds, expected):
    assert open_ways(BLOCK, bounds=bounds) == expected | {Maneuver.YIELD}


def test_without_lateral_freedom_it_stays_on_the_path():
    assert open_ways(BLOCK, lateral=False) == {Maneuver.YIELD}


def test_a_second_block_closes_one_side():
    assert open_ways(BLOCK, toy.box((-20.0, 60.0), (1.2, 6.0))) == {Maneuver.YIELD, Maneuver.RIGHT}


def test_too_late_to_stop_leaves_the_sides():
    close = toy.box((14.0, 24.0), (-0.3, 0.3))
    assert open_ways(close, v0=14.0) <= {Maneuver.LEFT, Maneuver.RIGHT}
    assert Maneuver.LEFT in open_ways(toy.box((18.0, 24.0), (-0.3, 0.3)), v0=17.0)


def test_crossing_car_lets_one_yield_or_go_ahead():
    car = toy.box((16.0, 22.0), (-12.0, -8.0), v=(0.0, 4.0))  # on the path from 2 s to 3 s
    found = ways(car, lateral=False)
    assert {m for m, p in found.items() if p.cost < NOT_OPEN} == {Maneuver.YIELD, Maneuver.GO_AHEAD}
    at = round(2.5 / toy.DT)
    assert found[Maneuver.YIELD].guide.position[at, 0] < 16.0
    assert found[Maneuver.GO_AHEAD].guide.position[at, 0] > 22.0
    assert found[Maneuver.YIELD].side[0, at] == Side.BEHIND
    assert found[Maneuver.GO_AHEAD].side[0, at] == Side.AHEAD


def test_crossing_car_that_is_too_long_to_go_ahead_of():
    car = toy.box((16.0, 60.0), (-12.0, -8.0), v=(0.0, 4.0))
    assert open_ways(car, lateral=False) == {Maneuver.YIELD}


def test_fast_follower_is_not_gone_behind():
    rear = toy.box((-20.0, -12.0), (-1.0, 1.0), v=(16.0, 0.0))
    assert open_ways(rear, lateral=False) == {Maneuver.GO_AHEAD}


def test_closing_gap_is_not_open():
    """Nowhere to stop, both sides taken: what comes closest is named, and told apart by its cost."""
    wall = toy.box((12.0, 400.0), (-10.0, 10.0))
    found = ways(wall, v0=25.0)
    assert len(found) == 1
    only = next(iter(found.values()))
    assert only.cost >= NOT_OPEN
    assert only.guide.position[-1, 0] < 25.0 * 5.0
    left, right = (
        toy.box((10.0, 400.0), (4.0, 9.0), v=(0.0, -4.0)),
        toy.box((10.0, 400.0), (-9.0, -4.0), v=(0.0, 4.0)),
    )
    assert open_ways(left, right, v0=25.0) == set()


def test_slower_lead_car_is_yielded_to():
    lead = toy.box((20.0, 26.0), (-1.0, 1.0), v=(4.0, 0.0))
    found = ways(lead, bounds=toy.NARROW)
    assert set(found) == {Maneuver.YIELD}
    assert found[Maneuver.YIELD].guide.velocity[-1, 0] < 10.0
    assert (found[Maneuver.YIELD].side == Side.BEHIND).all()


def test_obstacle_that_appears_and_goes_counts_while_it_is_there():
    early = toy.box((20.0, 30.0), (-1.0, 1.0), present=(0.0, 1.0))
    assert ways(early)[Maneuver.YIELD].cost == pytest.approx(0.0)
    late = toy.box((20.0, 30.0), (-1.0, 1.0), present=(2.5, 3.0))
    assert ways(late)[Maneuver.YIELD].cost > 0.0


def test_standing_ego_can_wait():
    assert Maneuver.YIELD in open_ways(toy.box((1.0, 5.0), (-3.0, -1.0), v=(0.0, 1.0)), v0=0.0)


def test_braking_in_a_bend_leaves_room_in_the_friction_circle():
    bend = (np.array([0.0, 500.0]), np.array([0.05, 0.05]))
    found = ways(BLOCK, lateral=False, v0=9.0, curvature=bend)
    for passing in found.values():
        if passing.cost < NOT_OPEN:
            v, a = passing.guide.velocity[:, 0], passing.guide.acceleration[:, 0]
            assert np.hypot(a, 0.05 * v**2).max() <= 0.9 * toy.LIMITS.a_total + 1e-9


def test_later_start_times_are_the_same_problem():
    early = ways(BLOCK)
    shifted = SpeedProfile.from_accelerations(0.0, 10.0, [20.0], [0.0]).sample(1.0).position[0, 0]
    block = toy.box((40.0 + shifted, 48.0 + shifted), (-1.0, 1.0))
    late = ways(block, t_rep=1.0, t_end=6.0)
    assert early.keys() == late.keys()
    for maneuver, passing in early.items():
        np.testing.assert_allclose(
            passing.guide.position + np.array([shifted, 0.0]), late[maneuver].guide.position, atol=1e-6
        )
        np.testing.assert_allclose(late[maneuver].guide.t, passing.guide.t + 1.0)


def test_side_at_is_that_of_the_nearest_guide_time():
    car = toy.box((16.0, 22.0), (-12.0, -8.0), v=(0.0, 4.0))
    passing = ways(car, lateral=False)[Maneuver.GO_AHEAD]
    times = np.array([-1.0, 0.0, 0.04, 0.06, 2.5, 99.0])
    expected = passing.side[:, [0, 0, 0, 1, 25, len(passing.guide) - 1]]
    np.testing.assert_array_equal(passing.side_at(times), expected)


boxes = st.tuples(
    st.floats(3.0, 60.0),
    st.floats(1.0, 12.0),
    st.floats(-8.0, 6.0),
    st.floats(0.5, 5.0),
    st.floats(-12.0, 12.0),
    st.floats(-5.0, 5.0),
    st.floats(0.0, 2.0),
    st.floats(0.3, 9.0),
)


@given(st.lists(boxes, max_size=4), st.floats(0.0, 20.0), st.booleans(), st.sampled_from([1.0, 3.0, 5.0]))
def test_every_open_guide_is_free_and_on_the_side_it_says(rows, v0, lateral, t_end):
    """``ways`` checks every passing by brute force."""
    found = ways(
        *(
            toy.box((s, s + a), (l, l + b), v=(vs, vl), present=(round(begin, 1), begin + stay))
            for s, a, l, b, vs, vl, begin, stay in rows  # noqa: E741
        ),
        v0=v0,
        t_end=t_end,
        lateral=lateral,
    )
    assert found  # at least the way that comes closest
    if not lateral:
        assert found.keys() <= {Maneuver.YIELD, Maneuver.GO_AHEAD}


@given(
    st.floats(0.0, 25.0),
    st.floats(-3.0, 3.0),
    st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=30),
    st.integers(0, 43),
)
def test_the_quick_look_at_the_bends_allows_nothing_that_the_long_one_does_not(v0, a0, bends, p):
    tau = toy.DT * np.arange(41)
    speeds = speed_profiles(np.array([[0.0, 0.0], [v0, 0.0], [a0, 0.0]]), tau, toy.LIMITS)
    curvature = (np.linspace(-5.0, 60.0, len(bends)), np.array(bends))
    bends = Bends(speeds, toy.LIMITS, curvature)
    if bends.surely_allow(p):
        assert bends.excess(p) == 0.0
    assert bends.allow(p) == (bends.excess(slice(None))[p] == 0.0)


@given(
    st.floats(0.0, 40.0), st.floats(0.1, 12.0), st.sampled_from([3, 17, 41]), st.sampled_from([0.1, 0.2, 0.4])
)
def test_a_harsh_change_is_never_allowed_unless_it_changes_nothing(v0, a_total, count, step):
    """Such profiles are not looked at; one that changes nothing is the first one again, which is."""
    limits = replace(toy.LIMITS, a_total=a_total)
    tau = step * np.arange(count)
    speeds = speed_profiles(np.array([[0.0, 0.0], [v0, 0.0], [0.0, 0.0]]), tau, limits)
    excess = Bends(speeds, limits, STRAIGHT).excess(slice(None))
    assert not speeds.family.harsh[0]  # to hold the speed asks nothing of the tyres
    for p in speeds.family.harsh.nonzero()[0]:
        assert excess[p] > 0.0 or np.allclose(speeds.s[:, p], speeds.s[:, 0], rtol=0.0, atol=1e-12)


@given(
    st.floats(-3.0, 3.0),
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.floats(-6.0, 6.0),
    st.floats(0.3, 7.0),
)
def test_a_lateral_motion_joins_its_ends_smoothly(l0, v0, a0, target, duration):
    """Within the duration against the boundary conditions and finite differences; at rest afterwards."""
    tau = np.linspace(0.0, duration, 2001)
    start = np.array([l0, v0, a0])
    pair = np.array([target, -target]), np.array([duration, 1.5 * duration])
    position, rate, acceleration = (values[0] for values in quintics(start, *pair, tau))
    np.testing.assert_allclose((position[0], rate[0], acceleration[0]), start, atol=1e-9)
    np.testing.assert_allclose((position[-1], rate[-1], acceleration[-1]), (target, 0.0, 0.0), atol=1e-9)
    scale = 1.0 + np.abs(acceleration).max()
    np.testing.assert_allclose(np.gradient(position, tau)[1:-1], rate[1:-1], atol=1e-2 * scale)
    np.testing.assert_allclose(np.gradient(rate, tau)[1:-1], acceleration[1:-1], atol=1e-1 * scale)
    later = quintics(start, *pair, np.array([duration + 0.1, 2.0 * duration]))
    np.testing.assert_allclose(later[0][0], target, atol=1e-9)
    assert not later[1][0].any()
    assert not later[2][0].any()


def test_sides_are_made_when_they_are_asked_for():
    beside = toy.box((5.0, 9.0), (3.0, 5.0), present=(1.0, 2.0))
    cars = toy.occupancy(toy.box((30.0, 35.0), (-1.0, 1.0)), beside)
    reference = toy.constant().sample(toy.DT * np.arange(41))
    start = frozen([reference.position[0], reference.velocity[0], reference.acceleration[0]])
    first, *_ = open_passings(reference, start, cars, toy.WIDE, toy.LIMITS, MARGIN, True, STRAIGHT)
    assert "side" not in vars(first)
    known = pickle.loads(pickle.dumps(first))
    expected = sides_of(first.guide.position, *cars.at(first.guide.t))
    np.testing.assert_array_equal(first.side, expected)
    assert (first.side[1, [0, 9, 21, 40]] == Side.BEHIND).all()  # where it is not there
    assert first.side[1, 10] == Side.RIGHT
    assert first.side is vars(first)["side"]
    np.testing.assert_array_equal(known.side, expected)
    np.testing.assert_array_equal(replace(first, cost=0.0).side, expected)
    np.testing.assert_array_equal(replace(first, sides=1 - expected).side, 1 - expected)


@given(st.floats(0.0, 40.0))
def test_all_profiles_lie_between_the_slowest_and_the_fastest(v0):
    tau = toy.DT * np.arange(41)
    speeds = speed_profiles(np.array([[0.0, 0.0], [v0, 0.0], [0.0, 0.0]]), tau, toy.LIMITS)
    assert (speeds.s >= speeds.least[:, None] - 1e-9).all()
    assert (speeds.s <= speeds.most[:, None] + 1e-9).all()


@given(st.lists(boxes, min_size=1, max_size=4), st.floats(0.0, 20.0), st.sampled_from([-0.5, 0.1, 2.0]))
def test_who_gets_past_the_obstacle_in_conflict_goes_ahead(rows, v0, margin):
    """Against all profiles at all times, also where the fastest tells that there is none."""
    cars = toy.occupancy(
        *(
            toy.box((s, s + a), (l, l + b), v=(vs, vl), present=(round(begin, 1), begin + stay))
            for s, a, l, b, vs, vl, begin, stay in rows  # noqa: E741
        )
    )
    reference = toy.constant(v0).sample(toy.DT * np.arange(41))
    met = surroundings(reference, cars, margin)
    start = np.array([reference.position[0], reference.velocity[0], reference.acceleration[0]])
    speeds = speed_profiles(start, reference.t, toy.LIMITS)
    (keep,) = lateral_profiles(start, reference.t, reference, met, toy.LIMITS, toy.WIDE, margin, False)
    found = dict(possible_maneuvers(keep, met, speeds))
    passed = np.zeros(len(speeds.cost), dtype=bool)
    if met.conflict is not None:
        _, upper = cars.at(reference.t)
        front = upper[met.conflict[1], :, 0] + margin
        passed = ((front < speeds.s.T) & met.overlap[met.conflict[1]]).any(axis=1)
    assert Maneuver.GO_AHEAD in found or not passed.any()
    others = found[Maneuver.YIELD]
    np.testing.assert_array_equal(passed, False if others is None else others)
    if Maneuver.GO_AHEAD in found:
        np.testing.assert_array_equal(found[Maneuver.GO_AHEAD], ~passed)


@pytest.mark.parametrize("few", [True, False])
def test_the_least_bad_speed_profile_is_the_least_bad_of_all(few):
    rng = np.random.default_rng(5)
    for _ in range(200):
        excess = np.maximum(rng.normal(size=40), 0.0)
        depth = np.maximum(rng.normal(0.0, 3.0, 40) + 2.0 * few, 0.0)
        depth[rng.random(40) < 0.2] = np.inf
        bends = SimpleNamespace(excess=lambda p, known=excess: known[p], of_all=excess)
        p, badness = _least_bad(depth, bends)
        assert (p, badness) == (int((depth + excess).argmin()), (depth + excess).min())
    assert _least_bad(np.full(40, np.inf), bends)[1] == np.inf
