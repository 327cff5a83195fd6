"""Plain numbers for files."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from repair.arrays import column, number

metres = st.floats(-1e6, 1e6, allow_nan=False)


@given(st.lists(metres | st.sampled_from([math.nan, math.inf, -0.0, 5e6]), max_size=8))
def test_a_column_is_rounded_as_each_number_is(values):
    found = column(values)
    assert len(found) == len(values)
    for got, value in zip(found, values, strict=True):
        if not math.isfinite(value):
            assert got is None
            continue
        assert abs(got - round(value, 9)) <= 1.1e-9
        assert math.copysign(1.0, got) == 1.0 or got < 0.0


@given(st.lists(metres, min_size=1, max_size=8))
def test_what_is_rounded_already_stays_to_the_last_bit(values):
    rounded = np.round(values, 4) + 0.0
    assert column(rounded) == rounded.tolist()


def test_what_means_nothing_is_no_figure_of_a_result():
    """A solver that diverges leaves residuals of 1e18 behind, which whoever reads the result refuses."""
    assert [number(x) for x in (2.9000000000000004, -1e14, 1e15, -1e18, math.inf, math.nan, None)] == [
        2.9, -1e14, None, None, None, None, None,
    ]  # fmt: skip
