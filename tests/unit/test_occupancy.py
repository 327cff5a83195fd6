"""Obstacles as boxes in (s, l, t): projection, interpolation, entry, culling."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests import toy

from repair.arrays import frozen
from repair.curves.base import FrenetTrajectory
from repair.scene.frame import FrenetFrame
from repair.scene.traffic.obstacle import Obstacle
from repair.world.boxes import Occupancy, shrink_to_start
from repair.world.occupancy import Within, build_occupancy, first_entry, relevant

STRAIGHT = FrenetFrame.from_points([[0.0, 0.0], [200.0, 0.0]])
_TURN = np.linspace(0.0, 0.5 * np.pi, 60)
# 40 m straight on, a left turn of 12 m radius, and on
BEND = FrenetFrame.from_points(
    np.vstack(
        [
            [[x, 0.0] for x in np.arange(0.0, 40.0, 2.0)],
            np.column_stack([40.0 + 12.0 * np.sin(_TURN), 12.0 - 12.0 * np.cos(_TURN)]),
            [[52.0, y] for y in np.arange(14.0, 60.0, 2.0)],
        ]
    )
)


def outline(x, y, heading, length, width, apart=0.5):
    """Points on the edge of a rectangle, the corners among them."""
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) * [0.5 * length, 0.5 * width]
    points = []
    for a, b in itertools.pairwise(corners):
        count = int(np.ceil(np.hypot(*(b - a)) / apart))
        points += [a + (b - a) * k / count for k in range(count)]
    c, s = np.cos(heading), np.sin(heading)
    return np.array([x, y]) + np.array(points) @ np.array([[c, s], [-s, c]])


def obstacle(rows, number=7, role="dynamic"):
    """An obstacle from rows (x, y, heading, length, width); None where it is absent."""
    present = [outline(*row) for row in rows if row is not None]
    shape = present[0].shape
    vertices = np.array([np.full(shape, np.nan) if row is None else outline(*row) for row in rows])
    states = np.full((len(rows), 4), np.nan)
    return Obstacle(number, "car", role, frozen(vertices), None, None, (), frozen(states))


def path(t, s, l):  # noqa: E741
    t = np.atleast_1d(np.asarray(t, dtype=float))
    position = np.column_stack([np.broadcast_to(s, t.shape), np.broadcast_to(l, t.shape)]).astype(float)
    zero = np.zeros_like(position)
    return FrenetTrajectory(t, position, zero, zero, zero)


# -- projection --------------------------------------------------------------------------------------


@pytest.mark.parametrize("heading", [0.0, 0.4, np.pi / 2, -2.5])
def test_box_of_a_rectangle_on_a_straight_road(heading):
    rows = [(30.0 + k, 2.0 - 0.5 * k, heading, 4.5, 1.8) for k in range(4)]
    boxes, notes = build_occupancy([obstacle(rows)], STRAIGHT, 0.1, 2.25, 1.0)
    half_s = 0.5 * (4.5 * abs(np.cos(heading)) + 1.8 * abs(np.sin(heading)))
    half_l = 0.5 * (4.5 * abs(np.sin(heading)) + 1.8 * abs(np.cos(heading)))
    for k, (x, y, *_) in enumerate(rows):
        np.testing.assert_allclose(boxes.lower[0, k], [x - half_s - 2.25, y - half_l - 1.0], atol=1e-6)
        np.testing.assert_allclose(boxes.upper[0, k], [x + half_s + 2.25, y + half_l + 1.0], atol=1e-6)
    assert notes == ()
    np.testing.assert_allclose(boxes.t, [0.0, 0.1, 0.2, 0.3])


@pytest.mark.parametrize("place", [(30.0, 1.0), (46.0, 3.0), (51.0, 8.0), (53.0, 30.0)])
def test_box_in_a_bend_holds_the_whole_rectangle(place):
    rows = [(*place, 0.3 * k, 4.5, 1.8) for k in range(5)]
    boxes, _ = build_occupancy([obstacle(rows)], BEND, 0.1, 0.0, 0.0)
    for k, (x, y, heading, length, width) in enumerate(rows):
        grid = np.array([(a, b) for a in np.linspace(-0.5, 0.5, 25) for b in np.linspace(-0.5, 0.5, 25)])
        c, s = np.cos(heading), np.sin(heading)
        inside = np.array([x, y]) + (grid * [length, width]) @ np.array([[c, s], [-s, c]])
        frenet = BEND.to_frenet(inside)
        # the outline's points are 0.5 m apart; between two of them it bulges by some millimetres
        assert (frenet >= boxes.lower[0, k] - 0.02).all()
        assert (frenet <= boxes.upper[0, k] + 0.02).all()
        np.testing.assert_allclose(boxes.lower[0, k], frenet.min(axis=0), atol=0.05)
        np.testing.assert_allclose(boxes.upper[0, k], frenet.max(axis=0), atol=0.05)


def test_one_row_for_each_obstacle_in_order():
    rows = [(30.0, 0.0, 0.0, 4.0, 2.0)] * 3
    far = [(30.0, 500.0, 0.0, 4.0, 2.0)] * 3
    given_ = [obstacle(rows, 5), obstacle(far, 3), obstacle(rows, 9, role="static")]
    boxes, notes = build_occupancy(given_, STRAIGHT, 0.1, 0.0, 0.0)
    assert boxes.ids.tolist() == [5, 3, 9]
    assert boxes.static.tolist() == [False, False, True]
    assert np.isnan(boxes.lower[1]).all()
    assert len(notes) == 1
    assert "obstacle 3" in notes[0]


def test_no_obstacles_is_no_error():
    boxes, notes = build_occupancy([], STRAIGHT, 0.1, 1.0, 1.0)
    assert len(boxes) == 0
    assert notes == ()
    assert first_entry(boxes, path([0.0, 1.0], 5.0, 0.0)) is None
    assert len(relevant(boxes, 0.0, 1.0, np.array([0.0, 1.0]), np.array([0.0, 1.0]))) == 0


@pytest.mark.parametrize("frame", [STRAIGHT, BEND])
def test_who_is_left_out_is_out_of_reach(frame):
    """Behind, too far ahead for the time, or too far aside; everybody else has their usual box."""
    rng = np.random.default_rng(5)
    steps, start, aside = 12, 30.0, (2.0, 4.0)
    ways = 2.0 + 4.0 * np.arange(steps)
    within = Within(start, start - 5.0, start + ways[-1] + 5.0, aside, ways)
    left_out = 0
    for turn in range(40):
        s, l = rng.uniform(-15.0, 1.2 * frame.length), rng.uniform(-12.0, 12.0)  # noqa: E741
        x, y = frame.to_cartesian(s, l)
        heading, v = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 25.0)
        size = (rng.uniform(1.0, 12.0), rng.uniform(0.5, 3.0))
        rows = [
            (x + 0.1 * k * v * np.cos(heading), y + 0.1 * k * v * np.sin(heading), heading, *size)
            for k in range(steps)
        ]
        one = replace(
            obstacle(rows, turn, "static" if turn % 5 == 0 else "dynamic"),
            rectangles=np.array(rows) * [1.0, 1.0, 1.0, 0.5, 0.5],
        )
        offset = rng.choice([2.0, 9.0])
        (whole, _), (part, _) = (build_occupancy([one], frame, 0.1, offset, 1.0, w) for w in (None, within))
        known = np.isfinite(part.lower[0, :, 0])
        np.testing.assert_allclose(part.lower[0, known], whole.lower[0, known], atol=1e-8)
        np.testing.assert_allclose(part.upper[0, known], whole.upper[0, known], atol=1e-8)
        left_out += int((~known).sum())
        with np.errstate(invalid="ignore"):
            met = (whole.upper[0, :, 0] > start) & (whole.lower[0, :, 0] < start + ways)
            met &= (whole.upper[0, :, 1] > -aside[0]) & (whole.lower[0, :, 1] < aside[1])
        assert known[met].all()
    assert left_out > 150


def test_absence_is_nan_and_not_noted():
    rows = [None, (30.0, 0.0, 0.0, 4.0, 2.0), (31.0, 0.0, 0.0, 4.0, 2.0), None]
    boxes, notes = build_occupancy([obstacle(rows)], STRAIGHT, 0.1, 0.0, 0.0)
    assert np.isnan(boxes.lower[0, [0, 3]]).all()
    assert np.isfinite(boxes.lower[0, 1:3]).all()
    assert notes == ()


# -- interpolation -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "times", [0.1 * np.arange(12.0), np.linspace(-0.3, 4.7, 41), np.linspace(-1.0, 9.0, 1500)]
)
def test_boxes_at_any_times_are_those_looked_up_one_by_one(times):
    """On and between steps, where an obstacle comes and goes, outside of the steps, kept or not."""
    boxes = toy.occupancy(
        toy.box((18, 24), (-1, 1), v=(3.0, 0.5), present=(0.7, 3.2)),
        toy.box((40, 45), (-2, 2), present=(0.0, 9.0)),
    )
    for corners, found in zip((boxes.lower, boxes.upper), boxes.at(times), strict=True):
        for time, here in zip(times, found.transpose(1, 0, 2), strict=True):
            where = time / toy.DT
            low = round(where) if abs(where - round(where)) < 1e-6 else int(np.floor(where))
            if not 0 <= where <= len(boxes.t) - 1 + 1e-6:
                plain = np.full((2, 2), np.nan)
            elif abs(where - low) < 1e-6:
                plain = corners[:, low]
            else:
                plain = corners[:, low] + (where - low) * (corners[:, low + 1] - corners[:, low])
            np.testing.assert_allclose(here, plain, rtol=0.0, atol=1e-9)


def test_between_steps_the_box_is_interpolated():
    boxes = toy.occupancy(toy.box((10.0, 14.0), (-1.0, 1.0), v=(5.0, -2.0)), duration=1.0)
    times = np.array([0.0, 0.05, 0.1, 0.333, 0.9999999999, 1.0])
    lower, upper = boxes.at(times)
    np.testing.assert_allclose(lower[0], np.array([10.0, -1.0]) + times[:, None] * [5.0, -2.0])
    np.testing.assert_allclose(upper[0], np.array([14.0, 1.0]) + times[:, None] * [5.0, -2.0])


def test_outside_of_the_known_time_there_is_nothing():
    boxes = toy.occupancy(toy.box((10.0, 14.0), (-1.0, 1.0)), duration=1.0)
    lower, upper = boxes.at([-0.05, 1.05, 99.0])
    assert np.isnan(lower).all()
    assert np.isnan(upper).all()


def test_an_obstacle_is_there_at_its_first_and_last_step_and_not_beyond():
    boxes = toy.occupancy(toy.box((10.0, 14.0), (-1.0, 1.0), present=(0.3, 0.6)), duration=1.0)
    lower, _ = boxes.at([0.2, 0.29, 0.3, 0.30000000000000004, 0.45, 0.6, 0.6000000001, 0.61, 0.7])
    np.testing.assert_array_equal(
        np.isfinite(lower[0, :, 0]), [False, False, True, True, True, True, True, False, False]
    )


def test_a_single_step_holds_at_that_step_only():
    boxes = Occupancy(
        frozen([0.0]), np.array([1]), frozen([[[1.0, 1.0]]]), frozen([[[2.0, 2.0]]]), np.array([True])
    )
    lower, _ = boxes.at([0.0, 0.5])
    np.testing.assert_allclose(lower[0, 0], [1.0, 1.0])
    assert np.isnan(lower[0, 1]).all()


def test_select_keeps_rows_together():
    boxes = toy.occupancy(*(toy.box((10.0 * k, 10.0 * k + 4.0), (-1.0, 1.0)) for k in range(4)))
    chosen = boxes.select(np.array([True, False, True, False]))
    assert chosen.ids.tolist() == [100, 102]
    np.testing.assert_array_equal(chosen.lower, boxes.lower[[0, 2]])
    with pytest.raises(ValueError, match="read-only"):
        boxes.lower[0, 0, 0] = 0.0


# -- entry -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "s, l, inside",
    [
        (10.0, 0.0, False),
        (10.0 + 1e-9, 0.0, True),
        (14.0, 0.0, False),
        (12.0, 1.0, False),
        (12.0, -1.0, False),
        (12.0, 1.0 - 1e-9, True),
        (9.0, 0.0, False),
        (12.0, 3.0, False),
    ],
)
def test_the_boundary_of_a_box_is_free(s, l, inside):  # noqa: E741
    boxes = toy.occupancy(toy.box((10.0, 14.0), (-1.0, 1.0)))
    assert (first_entry(boxes, path(0.5, s, l)) == (0, 0)) is inside


def test_first_entry_is_the_first_sample_and_its_obstacle():
    boxes = toy.occupancy(
        toy.box((0.0, 100.0), (3.0, 5.0)),
        toy.box((40.0, 50.0), (-1.0, 1.0)),
        toy.box((15.0, 20.0), (-1.0, 1.0)),
    )
    t = np.arange(61) * 0.1
    assert first_entry(boxes, path(t, 10.0 * t, 0.0)) == (16, 2)
    assert first_entry(boxes.select(np.array([0])), path(t, 10.0 * t, 0.0)) is None


def test_a_moving_box_is_met_in_its_own_time():
    boxes = toy.occupancy(toy.box((20.0, 24.0), (-6.0, -3.0), v=(0.0, 2.0)))
    t = np.arange(61) * 0.1
    found = first_entry(boxes, path(t, 22.0, 0.0))  # upper edge at 0 when t = 1.5
    assert found == (16, 0)


def test_scenario_time_ends_the_obstacles_and_not_the_check():
    boxes = toy.occupancy(toy.box((10.0, 14.0), (-1.0, 1.0)), duration=1.0)
    assert first_entry(boxes, path([1.5, 2.0], 12.0, 0.0)) is None


OFFSETS = (1.0, 0.25)

# -- shrinking to the start --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "start, axis, side",
    [
        ((10.2, 0.0), 0, "lower"),
        ((13.9, 0.0), 0, "upper"),
        ((12.0, 0.9), 1, "upper"),
        ((12.0, -0.95), 1, "lower"),
    ],
)
def test_the_margin_is_taken_back_on_the_nearest_side(start, axis, side):
    boxes = toy.occupancy(
        toy.box((10.0, 14.0), (-1.0, 1.0), v=(1.0, 0.0)), toy.box((50.0, 54.0), (-1.0, 1.0))
    )
    shrunk, notes = shrink_to_start(boxes, np.array(start), set(), OFFSETS)
    depth = getattr(shrunk, side)[0, :, axis] - getattr(boxes, side)[0, :, axis]
    taken = abs(getattr(boxes, side)[0, 0, axis] - start[axis])
    np.testing.assert_allclose(np.abs(depth), taken, atol=1e-5)
    other = "upper" if side == "lower" else "lower"
    np.testing.assert_array_equal(getattr(shrunk, other), getattr(boxes, other))
    np.testing.assert_array_equal(shrunk.lower[1], boxes.lower[1])
    assert first_entry(shrunk, path(0.0, *start)) is None
    assert len(notes) == 1
    assert "100" in notes[0]


def test_true_contact_keeps_its_margin():
    boxes = toy.occupancy(toy.box((10.0, 14.0), (-1.0, 1.0)))
    shrunk, notes = shrink_to_start(boxes, np.array([12.0, 0.0]), {100}, OFFSETS)
    np.testing.assert_array_equal(shrunk.lower, boxes.lower)
    np.testing.assert_array_equal(shrunk.upper, boxes.upper)
    assert notes == ()


def test_nothing_changes_where_the_start_is_free_or_nobody_is_there_yet():
    boxes = toy.occupancy(
        toy.box((10.0, 14.0), (-1.0, 1.0)), toy.box((0.0, 8.0), (-1.0, 1.0), present=(0.5, 9.0))
    )
    for start in ([5.0, 0.0], [10.0, 0.0], [12.0, 1.0]):
        shrunk, notes = shrink_to_start(boxes, np.array(start), set(), OFFSETS)
        assert shrunk is boxes
        assert notes == ()


@given(
    st.lists(st.tuples(st.floats(0, 20), st.floats(0.1, 9), st.floats(-3, 3), st.floats(0.1, 4)), max_size=5)
)
def test_after_shrinking_the_ego_starts_in_no_margin(rows):
    boxes = toy.occupancy(*(toy.box((s, s + a), (l, l + b)) for s, a, l, b in rows), duration=0.5)  # noqa: E741
    start = np.array([10.0, 0.0])
    shrunk, _ = shrink_to_start(boxes, start, set(), OFFSETS)
    assert first_entry(shrunk, path(0.0, *start)) is None
    # of an obstacle there are one or two boxes, each within the whole one
    whole = {int(i): k for k, i in enumerate(boxes.ids)}
    rows = [whole[int(i)] for i in shrunk.ids]
    assert ((shrunk.lower >= boxes.lower[rows]) | np.isnan(shrunk.lower)).all()
    assert ((shrunk.upper <= boxes.upper[rows]) | np.isnan(shrunk.upper)).all()


# -- culling -----------------------------------------------------------------------------------------

moving_box = st.tuples(
    st.floats(-30.0, 60.0),
    st.floats(0.2, 10.0),
    st.floats(-10.0, 10.0),
    st.floats(0.2, 5.0),
    st.floats(-20.0, 20.0),
    st.floats(-20.0, 20.0),
    st.floats(0.0, 2.0),
    st.floats(0.1, 3.0),
)


@given(st.lists(moving_box, min_size=1, max_size=4), st.floats(0.0, 1.5), st.floats(0.2, 2.0), st.data())
def test_culling_keeps_whatever_the_ego_could_touch(rows, t_start, duration, data):
    boxes = toy.occupancy(
        *(
            toy.box((s, s + a), (l, l + b), v=(vs, vl), present=(begin, begin + stay))
            for s, a, l, b, vs, vl, begin, stay in rows  # noqa: E741
        ),
        duration=3.0,
    )
    reach, room = np.array([0.0, 40.0]), np.array([-2.0, 2.0])
    t_end = t_start + duration
    kept = set(relevant(boxes, t_start, t_end, reach, room).ids.tolist())
    share = data.draw(
        st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1)), min_size=1, max_size=30)
    )
    for a, b, c in share:
        t = np.array([t_start + a * duration])
        for k in range(len(boxes)):
            lower, upper = (corner[k, 0] for corner in boxes.at(t))
            # a place within reach, and inside of the box if there is any
            s = np.clip(lower[0] + b * (upper[0] - lower[0]), *reach)
            l = np.clip(lower[1] + c * (upper[1] - lower[1]), *room)  # noqa: E741
            if first_entry(boxes.select(np.array([k])), path(t, s, l)) is not None:
                assert int(boxes.ids[k]) in kept


def test_culling_sees_a_box_that_cuts_the_corner_between_two_steps():
    # at 0.0 s it is beside the room, at 0.1 s behind the reach, and in both at once in between
    lower, upper = [[[-0.5, 2.1], [-5.0, -1.0]]], [[[2.5, 5.1], [-2.0, 2.0]]]
    boxes = Occupancy(frozen([0.0, 0.1]), np.array([1]), frozen(lower), frozen(upper), np.array([False]))
    reach, room = np.array([0.0, 40.0]), np.array([-2.0, 2.0])
    assert first_entry(boxes, path(0.05, 0.1, 1.9)) == (0, 0)
    assert len(relevant(boxes, 0.0, 0.1, reach, room)) == 1


def test_culling_looks_at_the_step_after_an_end_between_steps():
    boxes = toy.occupancy(toy.box((20.0, 24.0), (2.5, 4.0), v=(0.0, -10.0)), duration=3.0)
    reach, room = np.array([0.0, 40.0]), np.array([-2.0, 2.0])
    assert first_entry(boxes, path(0.09, 22.0, 1.95)) == (0, 0)
    assert len(relevant(boxes, 0.0, 0.09, reach, room)) == 1


def test_culling_drops_what_is_out_of_reach():
    boxes = toy.occupancy(
        toy.box((50.0, 60.0), (-1.0, 1.0)),
        toy.box((10.0, 20.0), (3.0, 5.0)),
        toy.box((10.0, 20.0), (-1.0, 1.0), present=(2.5, 3.0)),
        toy.box((10.0, 20.0), (-1.0, 1.0)),
        duration=3.0,
    )
    kept = relevant(boxes, 0.0, 2.0, np.array([0.0, 40.0]), np.array([-2.0, 2.0]))
    assert kept.ids.tolist() == [103]


def test_culling_keeps_whatever_comes_near_within_any_interval():
    """Against brute force: boxes that move fast, appear, or disappear, in windows on and off the steps."""

    rng = np.random.default_rng(3)
    for _ in range(60):
        boxes = []
        for _ in range(8):
            s, l = rng.uniform(-20.0, 60.0), rng.uniform(-20.0, 20.0)  # noqa: E741
            present = np.sort(rng.uniform(0.0, 3.0, 2)) if rng.random() < 0.5 else (0.0, np.inf)
            size = rng.uniform(0.5, 4.0, 2)
            boxes.append(toy.box((s, s + size[0]), (l, l + size[1]), rng.uniform(-40.0, 40.0, 2), present))
        occupancy = toy.occupancy(*boxes, duration=3.0)
        begin, end = np.sort(rng.uniform(0.0, 3.0, 2)) if rng.random() < 0.5 else (0.5, 3.0)
        reach, room = np.sort(rng.uniform(-10.0, 40.0, 2)), np.sort(rng.uniform(-6.0, 6.0, 2))
        kept = set(relevant(occupancy, begin, end, reach, room).ids.tolist())
        for t in np.linspace(begin, end, 101):
            lower, upper = (box[:, 0] for box in occupancy.at([t]))
            met = (upper[:, 0] > reach[0]) & (lower[:, 0] < reach[1])
            met &= (upper[:, 1] > room[0]) & (lower[:, 1] < room[1])
            assert set(occupancy.ids[met].tolist()) <= kept
