"""Advancement between two samples, one pair at a time."""

import cmath

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from repair.world.advance import FINEST, Motion, circle_left, first_touch, polygons_left, rectangle_left

HALF = complex(2.0, 1.0)
number = st.floats(-1.0, 1.0)


def motion(
    place, way, size=complex(1.0, 0.5), turn=0.0, heading=0.0, swing=0.0, start=3.0, span=0.5, spare=0.0
):
    return Motion(start, span, place, way, size, 0j, 0.3, turn, heading, swing, abs(size), spare)


def test_the_time_of_the_first_contact():
    ahead = cmath.rect(1.0, 0.3)  # the ego looks that way; 3 m from middle to middle is contact
    pair = motion(5.0 * ahead, -4.0 * ahead, heading=0.3)
    time = first_touch(pair, HALF, rectangle_left)
    assert time == pytest.approx(3.0 + 0.5 * 0.5, abs=FINEST)
    assert time <= 3.25
    assert first_touch(pair, HALF, rectangle_left, until=3.2) is None
    assert first_touch(motion(5.0 * ahead, 4.0 * ahead), HALF, rectangle_left) is None
    assert first_touch(motion(5.0 * ahead, 0j, heading=0.3, spare=2.01), HALF, rectangle_left) == 3.0
    ring = pair._replace(size=complex(1.0, 1.0))
    assert first_touch(ring, HALF, circle_left) == pytest.approx(3.25, abs=FINEST)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.tuples(*[number] * 8))
def test_never_later_than_what_a_dense_look_finds(drawn):
    x, y, dx, dy, turn, heading, swing, wide = drawn
    size = complex(0.6 + 0.5 * wide, 0.5)
    pair = motion(complex(5 * x, 5 * y), complex(6 * dx, 6 * dy), size, 2 * turn, 3 * heading, 3 * swing)
    corners = np.array([size, size.conjugate(), -size, -size.conjugate()])
    square = np.stack((corners.real, corners.imag), axis=1)
    left, reach = polygons_left((square,))
    time = first_touch(pair, HALF, rectangle_left)
    same = first_touch(pair._replace(reach=reach), HALF, left)
    assert (time is None) == (same is None)
    assert time is None or time == pytest.approx(same, abs=2 * FINEST)
    for share in np.linspace(0.0, 1.0, 400):
        axis = cmath.rect(1.0, -(pair.orientation + share * pair.turn))
        own = cmath.rect(1.0, pair.heading + share * pair.swing) * axis
        if rectangle_left((pair.place + share * pair.way) * axis, 0j, own, size, HALF) < 0.0:
            assert time is not None
            assert time <= pair.start + share * pair.span
            break
