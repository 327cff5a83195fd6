"""A result as a film."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest

import repair
from repair.cli.command import main
from repair.errors import OutputError
from repair.r157.cases import LENGTH, grid
from repair.r157.motion import stated
from repair.r157.scenario import scene_at
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
