"""The line of the time to react: three parts that cover it, in text and in a figure."""

from __future__ import annotations

from itertools import pairwise

import matplotlib.colors
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unavoidable import situation

import repair
from repair.report.style import render
from repair.report.sweep import sweep_report
from repair.report.text import headline
from repair.report.timeline import parts_of, text_bar, timeline_figure
from repair.study.rows import COLUMNS

TIMES = st.floats(0.0, 10.0, allow_subnormal=False)
MAYBE = st.one_of(st.none(), TIMES)


@given(f_ttr=MAYBE, late=MAYBE, ttc=st.floats(0.05, 10.0))
def test_the_parts_cover_the_time_until_the_conflict(f_ttr, late, ttc):
    parts = parts_of(f_ttr, late, ttc)
    assert parts[0].begin == 0.0
    assert parts[-1].end == ttc
    assert all(a.end == b.begin for a, b in pairwise(parts))
    order = ["verified", "unknown", "proven too late"]
    assert [p.what for p in parts] == [w for w in order if w in {p.what for p in parts}]
    bar = text_bar(f_ttr, late, ttc)
    assert bar.isascii()
    assert len(bar) == 40
    assert len(set(bar)) == len(parts)


def test_the_bar_of_known_times():
    assert text_bar(1.0, 1.5, 2.0, 8) == "====??xx"
    assert text_bar(None, 0.0, 2.0, 8) == "xxxxxxxx"
    assert text_bar(None, None, 2.0, 8) == "????????"
    assert text_bar(2.0, None, 2.0, 8) == "========"
    assert text_bar(None, 1.0, 2.0, 8) == "????xxxx"


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    file = tmp_path_factory.mktemp("timeline") / "scenario.xml"
    file.write_text(situation("wall", 15.0, 40.0, width=3.5), encoding="utf-8")
    keys = ["reference.source=constant", "bound.wanted=true", "search.delta_t=0.1"]
    return repair.repair(file, overrides=keys)


def test_the_console_has_a_line(outcome):
    record = outcome.to_dict()
    line = dict(headline(record))["Timeline"]
    assert line.startswith("0 |=")
    assert "x proven too late" in line
    assert "Timeline" not in dict(headline({**record, "bound": None}))


def test_the_figure_has_a_bar_of_the_right_length_for_each_part(outcome, tmp_path):
    record = outcome.to_dict()
    figure = timeline_figure(outcome.outcome)
    bars = [p for p in figure.axes[0].patches if p.get_height() == 0.6]
    kinds = record["bound"]["kinds"]
    expected = [
        (part.begin, part.end - part.begin)
        for one in kinds.values()
        for part in parts_of(record["f_ttr_s"], one["t_bound_s"], record["ttc_s"])
    ]
    np.testing.assert_allclose([(b.get_x(), b.get_width()) for b in bars], expected, atol=1e-9)
    assert len({b.get_facecolor() for b in bars}) == 3
    assert render(figure) == render(timeline_figure(outcome.outcome))
    written = {path.name for path in outcome.save(tmp_path)}
    assert "timeline.png" in written
    assert "timeline.png" in repair.load_result(tmp_path).record["figure_files"]


def test_the_colours_are_told_apart_by_who_sees_no_red_or_no_green(outcome):
    """Simulated after Viénot, Brettel and Mollon (1999), in linear RGB; lightness differs as well."""
    bars = [p for p in timeline_figure(outcome.outcome).axes[0].patches if p.get_height() == 0.6]
    colours = {p.get_facecolor()[:3] for p in bars}
    linear = np.array([matplotlib.colors.to_rgb(c) for c in colours]) ** 2.2
    blind = {
        "no red": [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
        "no green": [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
        "neither": [[0.2126, 0.7152, 0.0722]] * 3,
    }
    for matrix in blind.values():
        seen = np.clip(linear @ np.array(matrix).T, 0.0, 1.0) ** (1 / 2.2)
        apart = [np.linalg.norm(a - b) for i, a in enumerate(seen) for b in seen[:i]]
        assert min(apart) > 0.12


def test_without_a_bound_there_is_no_figure(outcome):
    record = {**outcome.to_dict(), "bound": None}
    assert timeline_figure(repair.Outcome(record)) is None


def test_a_sweep_shows_the_lines_and_the_impacts():
    row = dict.fromkeys(COLUMNS) | {
        "file": "a.xml", "backend": "ego", "reference": "constant", "status": "found", "conflict": "margin",
        "ttc_s": 2.0, "f_ttr_s": 1.0, "t_bound_s": 1.6, "gap_s": 0.6, "probes": "", "ttr_s": 1.0,
        "ttb_s": 1.0, "peak_deceleration_mps2": -4.0,
    }  # fmt: skip
    lost = row | {"status": "unavoidable", "f_ttr_s": None, "t_bound_s": 0.0, "gap_s": None}
    lost |= {"file": "b.xml", "impact_speed_mps": 3.5, "braking_impact_speed_mps": 4.25}
    text = sweep_report([row, lost], "x")
    assert f"`{'=' * 15}{'?' * 9}{'x' * 6}`" in text
    assert "| b.xml | constant | ego | unavoidable | 3.5 | 4.25 |" in text
    assert "How late is too late" not in sweep_report([row | {"t_bound_s": None, "gap_s": None}], "x")
