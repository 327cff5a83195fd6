"""Figures of a result: what is marked in them, at which scale, and in which form they are written."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from tests import roads

import repair
from repair.cli import main
from repair.errors import OutputError
from repair.report.birdseye import birdseye_figure
from repair.report.lines import Along, driven_line, lateral_acceleration, overlapped
from repair.report.profiles import profile_figure
from repair.report.style import FigureStyle, render


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return straight roads: a slow car ahead at 10 m/s, and the same at 25 m/s, far along."""
    folder = tmp_path_factory.mktemp("roads")
    made = {}
    for name, text in {
        "slow": roads.scenario(obstacles=roads.driving(30, 45.0, 0.0, 2.0)),
        "far": roads.scenario(
            problems=roads.problem(start=roads.state(20.0, 0.0, v=25.0)),
            obstacles=roads.driving(30, 95.0, 0.0, 5.0),
        ),
    }.items():
        made[name] = folder / f"{name}.xml"
        made[name].write_text(text, encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def outcomes(files):
    overrides = ["reference.source=constant", "fallback=[]"]
    return {name: repair.repair(file, overrides=overrides).outcome for name, file in files.items()}


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_has_the_limits_and_the_ttc(outcomes):
    outcome = outcomes["slow"]
    words = "\n".join(legend(profile_figure(outcome)))
    limits = outcome.record["limits"]
    for value in (limits["a_min_mps2"], limits["a_max_mps2"], limits["a_lat_mps2"], limits["v_max_mps"]):
        assert f"{value:.3g}" in words
    assert f"TTC {outcome.ttc:.4g} s" in words
    assert "the ego's length" in words
    axes = profile_figure(outcome).axes
    assert not [text for panel in axes[1:] for text in panel.texts]  # nothing is written over a curve


def test_far_ways_are_shown_from_the_reference(outcomes):
    near, far = outcomes["slow"], outcomes["far"]
    assert near.status == far.status == "found"
    assert profile_figure(near).axes[0].get_ylabel() == "distance driven s [m]"
    panel = profile_figure(far).axes[0]
    assert panel.get_ylabel() == "ahead of the reference [m]"
    bottom, top = panel.get_ylim()
    assert top - bottom < 0.6 * np.ptp(far.drawing.lines[0].s)
    along = Along.of(far.drawing)
    reference = far.drawing.lines[0]
    np.testing.assert_allclose(along(reference.t, reference.s), 0.0, atol=1e-9)
    beyond = reference.t[-1] + np.array([1.0])
    np.testing.assert_allclose(along(beyond, reference.s[-1:]), -reference.speed[-1], atol=1e-9)


def test_the_view_from_above_shows_where_something_happens(outcomes):
    far = outcomes["far"]
    low, high = birdseye_figure(far).axes[0].get_xlim()
    reference = far.drawing.lines[0]
    assert low > reference.x[0] - 10.0 + 1e-6  # not from the very start
    opponent = next(body for body in far.drawing.bodies if body.id == 30)
    middle = opponent.outlines[far.drawing.steps[0]].mean(axis=0)
    assert low < middle[0] < high


def test_what_is_driven_is_the_reference_and_then_the_repair(outcomes):
    outcome = outcomes["slow"]
    line, free = driven_line(outcome)
    reference = outcome.drawing.lines[0]
    repair_line = next(
        x for x in outcome.drawing.lines if x.kind == "repair" and abs(x.t_rep - outcome.f_ttr) < 1e-9
    )
    assert free
    assert (np.diff(line.t) > 0.0).all()
    assert line.t[0] == reference.t[0]
    assert line.s[-1] == repair_line.s[-1]


def test_who_is_drawn_over_somebody_is_marked(outcomes):
    drawing = outcomes["slow"].drawing
    half = Along.of(drawing).half
    reference, box = drawing.lines[0], drawing.boxes[0]
    found = overlapped(drawing, reference, half)
    rear = np.interp(reference.t, box.t, box.low) + drawing.s_offset
    front = np.interp(reference.t, box.t, box.high) - drawing.s_offset
    assert found.any()
    np.testing.assert_array_equal(found, (reference.s + half > rear) & (reference.s - half < front))
    aside = replace(reference, s=reference.s - 200.0)
    assert not overlapped(drawing, aside, half).any()


def test_lateral_acceleration_is_that_of_the_check(outcomes):
    """A curve that swerves: the peak in the picture is the one of the record."""
    outcome = outcomes["far"]
    for probe in outcome.probes:
        line = next(
            x for x in outcome.drawing.lines if x.kind == "repair" and abs(x.t_rep - probe["t_rep_s"]) < 1e-9
        )
        drawn = float(np.abs(lateral_acceleration(line)).max())
        assert drawn == pytest.approx(probe["peak_lateral_acceleration_mps2"], rel=0.1, abs=0.1)


@pytest.mark.parametrize("form", ["pdf", "svg"])
def test_forms_and_sizes(files, tmp_path, form):
    begins = {"pdf": b"%PDF", "svg": b"<?xml"}[form]
    argv = ["run", str(files["slow"]), "--reference", "constant", "--out", str(tmp_path), "--format", form]
    (tmp_path / "profiles.png").write_bytes(b"of another run")
    assert main([*argv, "--width", "3.5", "--font-size", "7"]) == 0
    record = json.loads((tmp_path / "result.json").read_text("utf-8"))
    assert record["figure_files"] == [f"profiles.{form}", f"birdseye.{form}"]
    assert {path.name for path in tmp_path.iterdir()} >= {*record["figure_files"], "report.html"}
    assert (tmp_path / f"profiles.{form}").read_bytes().startswith(begins)
    assert not (tmp_path / "profiles.png").exists()


def test_a_narrow_figure_is_as_wide_as_it_is_asked_for(outcomes):
    style = FigureStyle(width=3.5, font_size=7.0)
    for draw in (profile_figure, birdseye_figure):
        content = render(draw(outcomes["slow"], style))
        width = int.from_bytes(content[16:20], "big") / 150.0  # of a PNG, at 150 dots per inch
        assert width == pytest.approx(3.5, abs=0.4)


@pytest.mark.parametrize("wrong", [{"format": "bmp"}, {"width": 0.1}, {"font_size": "big"}, {"width": True}])
def test_styles_that_are_none(wrong):
    with pytest.raises(OutputError, match="figures"):
        FigureStyle(**wrong)


def test_a_style_without_figures_is_an_error(files, tmp_path, capsys):
    for argv in (["--width", "5"], ["--out", str(tmp_path), "--no-figure", "--format", "pdf"]):
        assert main(["run", str(files["slow"]), *argv]) == 2
        assert "need --out DIR" in capsys.readouterr().err


def test_without_plotly_there_is_a_note(files, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    (tmp_path / "report.html").write_text("of another run")
    assert main(["run", str(files["slow"]), "--reference", "constant", "--out", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert "no report.html: a report needs the package plotly: pip install" in out
    assert err == ""
    assert not (tmp_path / "report.html").exists()
    record = json.loads((tmp_path / "result.json").read_text("utf-8"))
    assert record["report_file"] is None
    assert "plotly" in record["report_file_problem"]
    assert repair.load_result(tmp_path).f_ttr == record["f_ttr_s"]


def test_very_many_curves_do_not_fill_the_legend(files):
    overrides = ["reference.source=constant", "fallback=[]", "search.rule=scan", "search.delta_t=0.1"]
    outcome = repair.repair(files["slow"], overrides=overrides).outcome
    names = legend(profile_figure(outcome))
    assert len(outcome.probes) > 12
    assert sum(name.startswith("$t_{rep}$") for name in names) <= 4
    assert sum("F-TTR" in name for name in names) == 1
    assert any("others between" in name for name in names)
