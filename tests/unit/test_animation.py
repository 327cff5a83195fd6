"""A result as a film."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

import repair
from repair.cli.command import main
from repair.errors import OutputError
from repair.outcome.data import Drawing
from repair.r157.cases import LENGTH, grid
from repair.r157.motion import stated
from repair.r157.scenario import scene_at
from repair.report.film.drive import film_of_drive
from repair.report.film.frames import animation, frames_of
from repair.report.film.result import film_of_result


@pytest.fixture(scope="module")
def cut_in():
    """A cut-in of UN R157 that is repaired, and the point."""
    points = grid("cut_in_low")
    (row,) = np.flatnonzero(
        (points.ego == 60)
        & (points.other == 20)
        & (points.distance == 25)
        & (np.abs(points.lateral - 1.0) < 0.01)
    )
    scene = scene_at(points, int(row), 5.0)
    overrides = ["reference.source=constant", "repair.after_conflict=1.0"]
    return repair.repair(scene, overrides=overrides).outcome, points.at(np.array([row]))


def middle(patch):
    corners = patch.get_xy()
    return 0.5 * (corners.min(axis=0) + corners.max(axis=0))


def test_everybody_is_where_he_is(cut_in):
    outcome, point = cut_in
    for k in (0, 7, 15):
        (figure,) = frames_of(film_of_result(outcome), [k])
        others = stated(point, 0.1, 5.0)
        x, y = float(others.rear[k, 0]) + LENGTH, float(others.offset[k, 0])
        for axes in figure.axes:
            assert middle(axes.patches[0]) == pytest.approx([x, y], abs=1e-3)
            assert np.ptp(axes.patches[0].get_xy(), axis=0) == pytest.approx([LENGTH, 1.9], abs=2e-2)


def test_the_panels_part_at_the_f_ttr(cut_in):
    outcome, _ = cut_in
    at = round(outcome.f_ttr / 0.1)

    def egos(k):
        (figure,) = frames_of(film_of_result(outcome), [k])
        return [middle(axes.patches[-1]) for axes in figure.axes], figure

    (planned, driven), figure = egos(at - 1)
    assert planned == pytest.approx(driven, abs=1e-2)
    assert "F-TTR in 0.10 s" in figure.axes[1].get_title()
    (planned, driven), figure = egos(at + 5)
    assert planned[0] > driven[0] + 0.3
    assert "repaired, since" in figure.axes[1].get_title()
    (_, _), figure = egos(round(outcome.ttc / 0.1) + 1)
    assert "in conflict" in figure.axes[0].get_title()


def test_a_drive_counts_down_says_what_is_done_and_stays_where_it_is_struck():
    t = np.arange(21) * 0.1
    lines = {"t": t, "plan_x": 10.0 * t, "x": np.minimum(10.0 * t, 5.0 + 4.0 * (t - 0.5))}
    still = dict.fromkeys(("y", "orientation", "plan_y", "plan_orientation"), [0.0] * 21)
    cycles = [
        {"t": 0.0, "mode": "plan", "f_ttr": 0.5}, {"t": 0.4, "mode": "plan", "f_ttr": 0.1},
        {"t": 0.5, "mode": "repair", "f_ttr": 0.0}, {"t": 1.2, "mode": "brake", "f_ttr": None},
    ]  # fmt: skip
    row = {
        "file": "DEU_Somewhere-1_1_T-1.xml", "shift_s": 1.0, "prediction": "lane", "policy": "f_ttr",
        "plan_contact_s": 1.04, "plan_contact_id": 7, "contact_s": 1.96, "contact_id": None,
        "impact_speed_mps": 3.0, "first_intervention_s": 0.5,
        "drive": {"dt": 0.1, "states": {k: list(v) for k, v in {**lines, **still}.items()}, "cycles": cycles},
    }  # fmt: skip
    body = np.array([[2.0, 1.0], [-2.0, 1.0], [-2.0, -1.0], [2.0, -1.0]])
    drawing = Drawing(0.0, 0.0, 2.0, (20, 0), body, np.zeros((21, 3)), None, (), (), (), (), ())
    film = film_of_drive(row, drawing)
    planned, driven = film.panels
    assert driven.titles[2] == "f_ttr: F-TTR in 0.30 s"
    assert driven.titles[8] == "f_ttr: a repair is driven"
    assert driven.titles[15] == "f_ttr: full braking"
    assert driven.titles[20] == "f_ttr: contact at 3.0 m/s"
    assert planned.titles[10:12] == ("as planned", "as planned, in contact")
    assert film.opponent == 7
    assert driven.mark == pytest.approx([5.0, 0.0])
    assert "traffic 1 s later" in film.title
    for k, (figure,) in ((k, frames_of(film, [k])) for k in (0, 20)):
        left, right = (middle(axes.patches[-1]) for axes in figure.axes)
        assert left == pytest.approx([min(1.0 * k, 11.0), 0.0])  # it stays where it was struck
        assert right == pytest.approx([lines["x"][k], 0.0])
        for axes in figure.axes:
            assert axes.get_xlim()[0] < min(left[0], right[0]) < axes.get_xlim()[1]


def test_a_gif_has_a_frame_for_each_step(cut_in):
    from PIL import Image

    outcome, _ = cut_in
    outcome = replace(outcome, drawing=replace(outcome.drawing, until=0.4))
    with Image.open(io.BytesIO(animation(film_of_result(outcome)))) as film:
        steps = round(outcome.drawing.until / 0.1) + 1
        assert (
            abs(film.n_frames - steps) <= 1
        )  # the last one stays a second: equal frames are one longer frame
        assert film.info["duration"] == 100


@pytest.mark.skipif(
    shutil.which("ffmpeg") is None or shutil.which("ffprobe") is None, reason="ffmpeg is not there"
)
def test_an_mp4_has_a_frame_for_each_step_and_plays_in_its_own_time(cut_in, tmp_path):
    outcome, _ = cut_in
    outcome = replace(outcome, drawing=replace(outcome.drawing, until=0.4))
    (tmp_path / "film.mp4").write_bytes(animation(film_of_result(outcome), "mp4"))
    said = "stream=codec_name,pix_fmt,width,height,nb_read_frames,avg_frame_rate,duration"
    asked = ["ffprobe", "-v", "error", "-count_frames", "-show_entries", said, "-of", "json", "film.mp4"]
    (film,) = json.loads(subprocess.run(asked, cwd=tmp_path, check=True, capture_output=True).stdout)[
        "streams"
    ]
    assert (film["codec_name"], film["pix_fmt"], film["avg_frame_rate"]) == ("h264", "yuv420p", "10/1")
    assert film["width"] % 2 == film["height"] % 2 == 0
    assert int(film["nb_read_frames"]) == 5 + 10  # the last one stays a second
    assert float(film["duration"]) == pytest.approx(1.5)
    shown = ["ffmpeg", "-v", "error", "-i", "film.mp4", "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    raw = subprocess.run(shown, cwd=tmp_path, check=True, capture_output=True).stdout
    frames = np.frombuffer(raw, np.uint8).reshape(-1, film["height"] * film["width"]).astype(float)
    moved = np.abs(np.diff(frames, axis=0)).mean(axis=1)
    assert (moved[:4] > 5.0 * moved[4:].max()).all()  # compression alone changes what stands still


@pytest.mark.parametrize("last", ["exit 1", "cat > /dev/null; exit 1"], ids=["at once", "in the end"])
def test_an_ffmpeg_that_makes_nothing_is_one_sentence(cut_in, tmp_path, monkeypatch, caplog, last):
    outcome, _ = cut_in
    outcome = replace(outcome, drawing=replace(outcome.drawing, until=0.4))
    tool = tmp_path / "ffmpeg"
    tool.write_text(f"#!/bin/sh\necho 'many words' >&2; echo 'Unknown encoder h264' >&2; {last}\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    with pytest.raises(OutputError, match=r"^ffmpeg made no film: Unknown encoder h264; a \.gif"):
        animation(film_of_result(outcome), "mp4")
    assert not caplog.records


def test_what_is_no_film_is_refused(cut_in, tmp_path, capsys, monkeypatch):
    outcome, _ = cut_in
    with pytest.raises(OutputError, match=r"a \.gif or an \.mp4"):
        animation(film_of_result(outcome), "avi")
    from matplotlib.animation import FFMpegWriter

    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(OutputError, match="ffmpeg, which is not there"):
        animation(film_of_result(outcome), "mp4")
    assert main(["animate", str(tmp_path), "--out", "film.txt"]) == 2
    assert "a film is a .gif or an .mp4" in capsys.readouterr().err
    assert main(["animate", str(tmp_path)]) == 2
