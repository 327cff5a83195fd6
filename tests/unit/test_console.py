"""What the console says is true: peaks by their sign, checks that were off, until when, notes once."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from tests import roads

import repair
from repair.cli.command import main
from repair.cli.streams import as_json
from repair.io.destination import require_folder
from repair.report.notes import grouped
from repair.report.sweep import sweep_report
from repair.report.text import probe_table, summary
from repair.study.rows import COLUMNS, SweepSettings
from repair.study.task import run_file

CONSTANT = ["reference.source=constant"]
SWEEP_HELP = "(see `repair sweep --help`)"


@pytest.fixture(autouse=True)
def _no_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COMMONROAD_SCENARIOS", raising=False)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return a straight road with a slower car ahead."""
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    return file


def told(path, *overrides, **keys):
    """The record of a repair, and what is printed of it as lines."""
    record = repair.repair(path, overrides=[*CONSTANT, *overrides], **keys).to_dict()
    return record, summary(record, None).splitlines()


def line(lines, name):
    return next(text for text in lines if text.startswith(name))


# -- the status line -------------------------------------------------------------------------------


def test_every_verdict_says_until_when(path):
    record, lines = told(path)
    assert record["status"] == "found"
    assert record["checked_until_s"] == record["t_end_s"]
    assert f"passed every check; checked until {record['t_end_s']:.3g} s" in line(lines, "Status")
    record, lines = told(path, "scene.horizon=1.0")
    assert record["status"] == "no_conflict"
    assert record["checked_until_s"] == 1.0
    assert "the reference can be followed to its end, until 1 s" in line(lines, "Status")
    record, lines = told(
        path, "limits.a_min=-0.1", "limits.a_max=0.1", "limits.a_lat=0.1", "limits.a_total=0.15"
    )
    assert record["status"] == "none_feasible"
    assert f"checked until {record['checked_until_s']:.3g} s" in line(lines, "Status")
    record, lines = told(path, "search.time_limit=0")
    assert record["status"] == "budget_exhausted"
    assert f"checked until {record['checked_until_s']:.3g} s" in line(lines, "Status")


def test_checks_that_were_off_are_not_passed(path):
    record, lines = told(path, "checker.road=false", "checker.limits=false", "checker.official=never")
    status = line(lines, "Status")
    assert {"road", "limits", "drivability checker"} <= set(record["checks_off"])
    assert "passed every check but those that were off (road, limits, drivability checker)" in status
    record, lines = told(path, "checker.road=false", "scene.horizon=1.0")
    assert record["checks_off"] == ["road"]
    assert "not looked at: road" in line(lines, "Status")
    assert told(path)[0]["checks_off"] == []


def test_contact_and_margin_are_told_apart(path):
    record, lines = told(path)
    assert record["conflict"]["margin_only"] is False
    assert "contact)" in line(lines, "Status")
    assert "nothing is touched" not in "\n".join(lines)
    record, _ = told(path, "scene.horizon=1.0")
    assert record["conflict"]["margin_only"] is None


def test_a_margin_without_contact(tmp_path):
    # A car that stands beside the lane, so near that only the margin is entered.
    beside = roads.car(30, roads.state(60.0, 2.05, v=0.0))
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    wide = roads.lanelet(1, range(0, 401, 20), [0.0] * 21, width=9.0)
    file.write_text(roads.scenario(road=wide, obstacles=beside), encoding="utf-8")
    record, lines = told(file, "scene.s_offset=3", "scene.l_offset=1.4", preset="scenario_1")
    assert record["conflict"]["kind"] == "margin"
    assert record["conflict"]["margin_only"] is True
    assert "(conflict: margin only, nothing is touched)" in line(lines, "Status")
    assert "is entered; nothing is touched" in line(lines, "TTC")


# -- peaks -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "low, high, there, absent",
    [
        (-1.87, -0.16, ["peak deceleration -1.87"], ["peak acceleration"]),
        (0.10, 1.50, ["peak acceleration 1.50"], ["peak deceleration"]),
        (-2.0, 0.7, ["peak deceleration -2.00", "peak acceleration 0.70"], []),
        (0.0, 0.0, ["peak acceleration 0.00"], ["peak deceleration"]),
        (-0.001, 0.3, ["peak acceleration 0.30"], ["peak deceleration"]),
    ],
)
def test_peaks_by_their_sign(low, high, there, absent, path):
    record, _ = told(path)
    record |= {"peak_deceleration_mps2": low, "peak_acceleration_mps2": high}
    text = line(summary(record, None).splitlines(), "Repair")
    assert all(words in text for words in there)
    assert not any(words in text for words in absent)


def test_peak_acceleration_is_in_every_output(path):
    record, _ = told(path)
    head, units, first, *_ = probe_table(record["probes"])
    assert head.split()[3:7] == ["a_min", "a_max", "a_lat", "v_min"]
    assert units.split().count("[m/s²]") == 3
    assert f"{record['probes'][0]['peak_acceleration_mps2']:.2f}" in first
    assert "peak_acceleration_mps2" in COLUMNS
    settings = SweepSettings(references=["constant"], official=False)
    (row,) = run_file(path, settings)
    assert row["peak_acceleration_mps2"] == record["peak_acceleration_mps2"]
    assert row["margin_only"] is False
    assert row["checked_until_s"] == record["t_end_s"]


def test_the_report_of_a_sweep_has_margins_of_their_own(path):
    settings = SweepSettings(references=["constant"], official=False)
    (row,) = run_file(path, settings)
    text = sweep_report([row | {"file": "a.xml", "margin_only": True, "conflict": "margin"}, row], "x")
    assert "conflicts that are margin only" in text
    assert "| margin only |" in text


# -- notes -----------------------------------------------------------------------------------------


def test_the_same_note_is_one_line():
    notes = [f"obstacle {k} has no prediction and is taken to stand still" for k in (12, 15, *range(20, 29))]
    (text,) = grouped(["first", *notes])[1:]
    assert text == "obstacles 12, 15 and 9 more have no prediction and are taken to stand still"
    assert grouped(notes[:1]) == notes[:1]
    assert grouped(notes[:2]) == ["obstacles 12 and 15 have no prediction and are taken to stand still"]
    assert grouped(notes[:3]) == ["obstacles 12, 15 and 20 have no prediction and are taken to stand still"]


def test_figures_that_differ_become_a_range():
    notes = [
        f"obstacle {k} is (partly) outside of the frame's domain from t = {t} s; only it is seen there"
        for k, t in ((36, 8.8), (337, 6.3), (5, 12))
    ]
    assert grouped(notes) == [
        "obstacles 36, 337 and 5 are (partly) outside of the frame's domain from t = 6.3 to 12 s; "
        "only them is seen there"
    ]


def test_notes_about_more_than_one_thing_stay_apart():
    notes = [
        "obstacle 1 follows obstacle 2", "obstacle 1 follows obstacle 3", "the road ends 30 m ahead",
        "the road ends 40 m ahead", "the ego starts 0.30 m inside the margin of obstacle 5; as it is",
        "the ego starts 0.20 m inside the margin of obstacle 6; as it is",
        "lanelet 4 has no length and is ignored", "lanelet 9 has no length and is ignored",
    ]  # fmt: skip
    assert grouped(notes) == [
        *notes[:4],
        "the ego starts 0.20 to 0.30 m inside the margin of obstacles 5 and 6; as it is",
        "lanelets 4 and 9 have no length and are ignored",
    ]
    assert grouped([]) == []
    assert grouped(["a", "a"]) == ["a"]


def test_the_record_keeps_every_note(tmp_path):
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    cars = "".join(roads.car(k, roads.state(100.0 + 10.0 * k, 60.0, v=0.0)) for k in range(31, 42))
    file.write_text(roads.scenario(obstacles=roads.SLOW + cars), encoding="utf-8")
    record, lines = told(file)
    assert sum("has no prediction" in note for note in record["notes"]) == 11
    assert sum("no prediction" in text for text in lines) == 1
    assert "obstacles 31, 32 and 9 more have no prediction" in "\n".join(lines)


def test_a_grid_of_one_point_is_said(path):
    record, lines = told(path, "search.delta_t=60")
    (note,) = [note for note in record["notes"] if "one point" in note]
    assert note.startswith("search.delta_t is 60 s, not below the TTC of")
    assert note in "\n".join(lines)
    assert [p["t_rep_s"] for p in record["probes"]] == [0.0]
    assert not [note for note in told(path)[0]["notes"] if "one point" in note]
    record, _ = told(path, "search.upper=0.3")
    assert [note for note in record["notes"] if "search.upper of 0.3 s" in note]


# -- before the work -------------------------------------------------------------------------------


def refused(argv, capsys):
    assert main([str(word) for word in argv]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("repair: ")
    assert err.count("\n") == 1
    return err


@pytest.fixture
def no_work(monkeypatch):
    def begun(*_, **__):
        pytest.fail("it has begun")

    monkeypatch.setattr("repair.api.repair", begun)
    monkeypatch.setattr("repair.study.run.run_study", begun)


@pytest.mark.usefixtures("no_work")
def test_what_is_wrong_is_said_before_the_work(path, capsys, tmp_path):
    file = tmp_path / "file"
    file.write_text("in the way")
    folder = path.parent
    assert "is a file" in refused(["run", path, "--out", file], capsys)
    assert "is a file" in refused(["run", path, "--out", file / "below"], capsys)
    assert "is a file" in refused(["sweep", folder, "--out", file], capsys)
    assert "is a file" in refused(["sweep", folder, "--report", file / "report.md"], capsys)
    assert "is a folder" in refused(["sweep", folder, "--report", tmp_path], capsys)
    assert "is a file" in refused(["figures", "--out", file], capsys)
    assert "'foo' is unknown; there are ego" in refused(["sweep", folder, "--backend", "foo"], capsys)
    assert "cannot be made" in refused(["run", path, "--out", "a" * 400], capsys)
    assert file.read_text() == "in the way"


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    "argv, words",
    [
        (["--jobs", "0"], "--jobs is 0"),
        (["--jobs", "many"], "invalid int value"),
        (["--timeout", "0"], "--timeout is 0 s"),
        (["--timeout", "nan"], "--timeout is nan s"),
        (["--reference", "foo"], "'foo' is none of"),
        (["--nonsense"], "--nonsense"),
    ],
)
def test_a_sentence_names_the_right_help(argv, words, path, capsys):
    err = refused(["sweep", path.parent, *argv], capsys)
    assert words in err
    assert err.rstrip().endswith(SWEEP_HELP)


def test_the_help_of_other_verbs(path, capsys):
    assert "(see `repair run --help`)" in refused(["run", path, "--reference", "nowhere"], capsys)
    assert "(see `repair run --help`)" in refused(["run", path, "second.xml"], capsys)
    assert "(see `repair --help`)" in refused(["nonsense"], capsys)


def test_a_folder_that_cannot_be_written(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(repair.OutputError, match="is not writable"):
        require_folder(tmp_path / "below")


# -- streams and names -----------------------------------------------------------------------------


def command(*argv, before=None, **environment):
    full = {k: v for k, v in os.environ.items() if k != "COMMONROAD_SCENARIOS"} | environment
    return subprocess.run(
        [sys.executable, "-m", "repair", *argv],
        capture_output=True, env=full, timeout=300, check=False, preexec_fn=before,
    )  # fmt: skip


@pytest.fixture
def strange(path, tmp_path):
    """Return a file whose name is no UTF-8."""
    name = os.fsdecode(b"caf\xe9 \xff.xml")
    file = tmp_path / name
    try:
        file.write_bytes(path.read_bytes())
    except OSError:
        pytest.skip("the file system takes UTF-8 alone")
    return file


@pytest.mark.exhaustive
def test_names_that_are_no_utf8(strange, capsys, tmp_path):
    out = Path(os.fsdecode(os.fsencode(tmp_path) + b"/out\xff"))
    assert main(["run", str(strange), "--reference", "constant", "--out", str(out)]) == 0
    assert "file caf\\udce9 \\udcff.xml" in capsys.readouterr().out
    record = json.loads((out / "result.json").read_bytes())
    assert record["provenance"]["path"] == str(strange)
    assert main(["certify", str(out)]) in (0, 1)
    capsys.readouterr()
    solution = next(out.glob("solution*"))
    assert main(["run", str(strange), "--reference", str(solution), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["config"]["reference"]["file"] == str(solution)
    assert "udcff" in refused(["run", str(strange.with_suffix(".nowhere"))], capsys)
    assert main(["sweep", str(strange.parent), "--reference", "constant", "--no-official"]) == 0
    (row,) = csv.DictReader(io.StringIO(capsys.readouterr().out))
    assert row["file"] == "caf\\udce9 \\udcff.xml"
    argv = ["sweep", str(strange.parent), "--reference", "constant", "--no-official", "--out", str(out)]
    assert main([*argv, "--report", str(out / os.fsdecode(b"\xff.md"))]) == 0
    assert "caf\\udce9" in (out / "sweep.csv").read_text("utf-8")


def test_a_terminal_that_knows_ascii_alone(strange):
    done = command("run", os.fspath(strange), "--reference", "constant", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"m/s\\xb2" in done.stdout
    done = command("run", os.fspath(strange), "--reference", "constant", "--json", PYTHONIOENCODING="ascii")
    assert json.loads(done.stdout)["provenance"]["name"] == strange.name
    assert as_json("plain ²") in ("plain ²", "plain \\u00b2")


@pytest.mark.parametrize(
    "closed",
    [
        pytest.param((1,), marks=pytest.mark.exhaustive),
        pytest.param((2,), marks=pytest.mark.exhaustive),
        (0, 1, 2),
    ],
)
def test_streams_that_are_closed(closed, path, tmp_path):
    def close():
        for number in closed:
            os.close(number)

    argv = ["run", str(path), "--reference", "constant", "--out", str(tmp_path / "out")]
    done = command(*argv, before=close)
    assert done.returncode == 0
    assert done.stderr == b""
    assert json.loads((tmp_path / "out" / "result.json").read_bytes())["status"] == "found"
    assert command("run", "nowhere.xml", before=close).returncode == 2


def test_in_the_same_process_too(path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", None)
    assert main(["run", str(path), "--reference", "constant"]) == 0
    assert sys.stdout is None
    gone = io.StringIO()
    gone.close()
    monkeypatch.setattr(sys, "stdout", gone)
    assert main(["presets"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_an_output_that_takes_nothing():
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "repair", "config", "--table"],
            stdout=full, stderr=subprocess.PIPE, timeout=300, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.decode() == "repair: standard output cannot be written: No space left on device\n"


def test_places_and_amounts_are_printed(path):
    record, _ = told(path)
    record["conflict"] |= {
        "kind": "off_road",
        "detail": "0.05 m² beside the road at (3.0, 4.0)",
        "contact_t_s": None,
    }
    record["contact_ttc_s"] = None
    record["probes"][0] |= {
        "feasible": False, "reasons": ["off_road"],
        "details": [{"reason": "off_road", "t_s": 1.0, "detail": "0.2 m² beside the road at (5.0, 6.0)"}],
    }  # fmt: skip
    lines = summary(record, None).splitlines()
    assert "the reference leaves the road (0.05 m² beside the road at (3.0, 4.0))" in line(lines, "TTC")
    when = record["probes"][0]["t_rep_s"]
    assert f"  {when:.2f} s: off_road at 1.00 s: 0.2 m² beside the road at (5.0, 6.0)" in lines


def test_a_result_shows_itself_on_one_screen(scenarios):
    """Without its arrays, in a terminal and in a notebook; and so do its parts."""
    scene = repair.load_scene(scenarios / "DEU_Flensburg-6_1_T-1.xml")
    result = repair.repair(scene, preset="scenario_1")
    lines = repr(result).splitlines()
    assert len(lines) <= 10
    assert max(map(len, lines)) < 200
    assert any(line.startswith("F-TTR") for line in lines)
    page = result._repr_html_()
    assert "<th" in page
    assert "data:image/png;base64," in page
    for part in (scene, result.prepared, result.outcome):
        assert len(repr(part)) < 300
        assert scene.id in repr(part)
