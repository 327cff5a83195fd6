"""On the scenario's steps the problems come from tables; they are those of the general path."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests import toy

from repair.config import load_config
from repair.problem.factory import ProblemFactory
from repair.problem.surroundings import surroundings
from repair.problem.tables import Grid
from repair.reference.profile import SpeedProfile
from repair.vehicle.parameters import load_vehicle

T_END = 4.0
BRAKING = SpeedProfile.from_accelerations(0.0, 12.0, [1.0, 20.0], [0.0, -0.5])


def factory(boxes, reference=BRAKING, t_end=T_END, lateral="road"):
    scene = SimpleNamespace(
        dt=toy.DT,
        start=np.array([[0.0, 0.0], [12.0, 0.0], [0.0, 0.0]]),
        frame=SimpleNamespace(curvature=lambda s: 0.01 * np.sin(0.1 * s)),
        lane=toy.NARROW,
        same_direction=toy.NARROW,
        road=toy.WIDE,
        vehicle=load_vehicle(1),
        obstacles=(),
    )
    config = load_config(overrides=[f"repair.lateral={lateral}"])
    return ProblemFactory(scene, config.repair, toy.LIMITS, toy.occupancy(*boxes), reference, t_end)


def general(boxes, t_rep, margin=None, **keys):
    """The problems at ``t_rep`` without tables."""
    with patch.object(Grid, "over", return_value=None) as over:
        found = factory(boxes, **keys).at(t_rep, margin)
    assert over.called == bool(found)
    return found


def same(one, other):
    assert [p.passing.maneuver for p in one] == [p.passing.maneuver for p in other]
    for a, b in zip(one, other, strict=True):
        assert a.occupancy.ids.tolist() == b.occupancy.ids.tolist()
        np.testing.assert_array_equal(a.passing.side, b.passing.side)
        np.testing.assert_allclose(a.start, b.start, rtol=0.0, atol=1e-12)
        for name in ("t", "position", "velocity", "acceleration", "jerk"):
            one_guide, other_guide = getattr(a.passing.guide, name), getattr(b.passing.guide, name)
            np.testing.assert_allclose(one_guide, other_guide, rtol=0.0, atol=1e-12)


ROWS = st.lists(
    st.tuples(
        st.floats(-20.0, 80.0),
        st.floats(1.0, 20.0),
        st.floats(-8.0, 6.0),
        st.floats(0.5, 4.0),
        st.floats(-3.0, 12.0),
        st.floats(-3.0, 3.0),
        st.floats(0.0, 3.0),
        st.floats(0.0, 8.0),
    ),
    max_size=6,
)


def boxes_of(rows):
    return [
        toy.box((s, s + a), (l, l + b), v=(vs, vl), present=(begin, begin + stay))
        for s, a, l, b, vs, vl, begin, stay in rows  # noqa: E741
    ]


@settings(max_examples=20)
@given(ROWS, st.sampled_from(["road", "none"]), st.sampled_from([None, -0.5, 0.3]))
def test_tables_and_general_path_make_the_same_problems(rows, lateral, margin):
    boxes = boxes_of(rows)
    made = factory(boxes, lateral=lateral)
    for t_rep in (0.0, 0.4, 3 * 0.4, 2.05, 3.9, 4.0):
        same(made.at(t_rep, margin), general(boxes, t_rep, margin, lateral=lateral))


@given(ROWS, st.integers(0, 39), st.floats(-1.0, 1.0))
def test_surroundings_are_those_at_the_references_times(rows, first, margin):
    obstacles = toy.occupancy(*boxes_of(rows))
    grid = Grid.over(obstacles, BRAKING, T_END, toy.DT)
    keep = np.arange(0, len(obstacles), 2)
    near = obstacles.select(keep)
    cut = grid.surroundings(first, keep, near, margin)
    looked_up = surroundings(BRAKING.sample(toy.DT * np.arange(first, 41)), near, margin)
    assert cut.conflict == looked_up.conflict
    for name in ("lower", "upper", "ends", "overlap"):
        a, b = getattr(cut, name), getattr(looked_up, name)
        np.testing.assert_array_equal(a, b)


def test_reference_is_cut_from_the_step_on():
    grid = Grid.over(toy.occupancy(), BRAKING, T_END, toy.DT)
    times = toy.DT * np.arange(12, 41)
    cut, sampled = grid.trajectory(12, times), BRAKING.sample(times)
    for name in ("t", "position", "velocity", "acceleration", "jerk"):
        np.testing.assert_allclose(getattr(cut, name), getattr(sampled, name), rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(grid.states[12], [cut.position[0], cut.velocity[0], cut.acceleration[0]])
    assert not grid.states.flags.writeable


@pytest.mark.parametrize(
    "t, index", [(0.0, 0), (3 * 0.4, 12), (0.1 + 0.2, 3), (0.05, None), (0.3 + 1e-7, None)]
)
def test_a_time_is_on_the_grid_up_to_rounding(t, index):
    assert Grid.over(toy.occupancy(), BRAKING, T_END, toy.DT).index(t) == index


@pytest.mark.parametrize("t_end, duration", [(3.95, 8.0), (4.0, 3.0)])
def test_no_tables_where_the_end_is_off_the_grid_or_beyond_the_boxes(t_end, duration):
    assert Grid.over(toy.occupancy(duration=duration), BRAKING, t_end, toy.DT) is None


@pytest.mark.parametrize("t_end", [3.95, 4.0])
def test_an_end_off_the_grid_is_no_error(t_end):
    ahead = [toy.box((30.0, 35.0), (-1.0, 1.0))]
    found = factory(ahead, t_end=t_end).at(0.4)
    assert found
    same(found, general(ahead, 0.4, t_end=t_end))
