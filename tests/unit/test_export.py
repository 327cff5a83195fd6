"""A result as JSON, as CommonRoad objects, as files, and as figures; on the bundled reconstruction."""

from __future__ import annotations

import errno
import json
import os
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from repair import load_result
from repair.api import RepairResult, repair
from repair.backend.base import SolveResult, SolveStatus
from repair.certify.recompute import certify
from repair.check.verdict import Conflict
from repair.config import load_config
from repair.curves.bernstein import BernsteinCurve
from repair.curves.bspline import UniformBSpline
from repair.curves.codec import curve_to_dict, read_curve
from repair.errors import OutputError, RepairError
from repair.io.commonroad import scenario_bytes, to_dynamic_obstacle, to_solution, to_trajectory
from repair.io.result_json import read_record, to_json
from repair.report.birdseye import birdseye_figure
from repair.report.profiles import profile_figure, stages_figure
from repair.report.style import render
from repair.save import FORMATS, Files
from repair.scene.commonroad import load_scene, scene_from_scenario
from repair.scene.provenance import provenance
from repair.search.result import SearchResult, SearchStatus

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # protobuf's deprecations, on import
    from repair.paper.synthetic import write_scenario

CONFIG = load_config(preset="scenario_1")
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scenario("scenario_1", tmp_path_factory.mktemp("scenario"))


@pytest.fixture(scope="module")
def found(scenario_file: Path) -> RepairResult:
    result = repair(scenario_file, CONFIG)
    assert result.status is SearchStatus.FOUND
    return result


def ended(result: RepairResult, status: SearchStatus, **search: Any) -> RepairResult:
    """The same result, had the search ended otherwise: no curve, no peaks."""
    empty = SearchResult(status, replace(result.search.conflict, **search), None, None, ())
    return replace(result, search=empty, peaks=None)


@pytest.fixture(scope="module")
def no_repair(found: RepairResult) -> RepairResult:
    return ended(found, SearchStatus.NONE_FEASIBLE)


def strict(text: str) -> dict[str, Any]:
    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is not JSON")

    content = json.loads(text, parse_constant=refuse)
    assert isinstance(content, dict)
    return content


def without_times(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if not k.endswith("time_s")}
    return [without_times(v) for v in value] if isinstance(value, list) else value


# -- JSON ------------------------------------------------------------------------------------------


def test_json_is_strict_and_gives_the_same_object(found: RepairResult) -> None:
    content = found.to_dict()
    assert strict(to_json(content)) == content


def test_every_figure_has_its_unit_in_the_key(found: RepairResult) -> None:
    units = ("_s", "_m", "_mps", "_mps2", "_mps3", "_rad", "_per_m")
    plain = {"objective"}  # a sum of terms of different units

    def walk(value: Any, key: str) -> None:
        if isinstance(value, dict):
            for name, item in value.items():
                if name not in ("config", "residuals", "time_s"):
                    walk(item, name)
        elif isinstance(value, list):
            for item in value:
                walk(item, key)
        elif isinstance(value, float):
            assert key.endswith(units) or key in plain, key

    walk(found.to_dict(), "")


def test_content_of_a_repair(found: RepairResult) -> None:
    content = found.to_dict()
    assert content["status"] == "found"
    assert content["ttc_s"] == round(found.ttc, 9)
    assert content["f_ttr_s"] == pytest.approx(found.f_ttr)
    assert content["maneuver"] == "yield"
    assert content["provenance"]["kind"] == "reconstruction"
    assert content["provenance"]["path"] is None
    assert len(content["provenance"]["sha256"]) == 64
    assert content["conflict"]["obstacle_id"] == found.search.conflict.obstacle_id
    assert [p["t_rep_s"] for p in content["probes"]] == [round(p.t_rep, 9) for p in found.search.probes]
    assert content["config"]["search"]["delta_t"] == 0.4
    assert {"python", "numpy", "scipy", "casadi", "commonroad-io"} <= set(content["versions"])
    assert found.peaks is not None
    assert content["peak_deceleration_mps2"] == pytest.approx(found.peaks.min_acceleration)
    best = max((p for p in content["probes"] if p["feasible"]), key=lambda p: p["t_rep_s"])
    for name in ("peak_deceleration_mps2", "peak_lateral_acceleration_mps2", "min_speed_mps"):
        assert best[name] == content[name]


def test_the_curve_can_be_rebuilt(found: RepairResult) -> None:
    content = found.to_dict()
    curve, driven = content["curve"], content["trajectory"]
    assert curve["type"] == "uniform_bspline"
    points = np.array(curve["control_points_m"])
    again = UniformBSpline(curve["t_start_s"], curve["spacing_s"], curve["degree"], points)
    read = read_curve(curve)
    assert isinstance(read, UniformBSpline)
    np.testing.assert_array_equal(read.points, points)
    assert (read.t_start, read.spacing, read.degree) == (again.t_start, again.spacing, again.degree)
    t = np.array(driven["t_s"])
    late = t >= content["f_ttr_s"] - 1e-9
    np.testing.assert_allclose(again.sample(t[late]).position[:, 0], np.array(driven["s_m"])[late], atol=1e-8)


def test_other_curves_are_written_too(found: RepairResult) -> None:
    pieces = np.arange(24.0).reshape(2, 6, 2)
    written = curve_to_dict(BernsteinCurve(1.6, 0.5, pieces))
    assert written is not None
    assert written["type"] == "bernstein"
    np.testing.assert_array_equal(written["control_points_m"], pieces)
    read = read_curve(written)
    assert isinstance(read, BernsteinCurve)
    assert (read.t_start, read.duration) == (1.6, 0.5)
    np.testing.assert_array_equal(read.points, pieces)
    assert curve_to_dict(None) is read_curve(None) is None
    sampled = curve_to_dict(found.curve, 1.0)
    assert sampled is not None
    with pytest.raises(RepairError, match=r"the curve in result\.json"):
        read_curve(sampled)
    assert sampled["type"] == "samples"
    assert len(sampled["t_s"]) == len(sampled["s_m"]) == len(sampled["l_mps2"]) == 11


def test_same_input_same_content_apart_from_times(scenario_file: Path, found: RepairResult) -> None:
    again = repair(scenario_file, CONFIG).to_dict()
    assert without_times(again) == without_times(found.to_dict())
    assert to_json(without_times(again)) == to_json(without_times(found.to_dict()))


@pytest.mark.parametrize("status", [s for s in SearchStatus if s is not SearchStatus.FOUND])
def test_without_a_repair_figures_are_null(found: RepairResult, status: SearchStatus) -> None:
    inf = float("inf")
    times = {"time": inf, "contact_time": inf, "kind": "none"} if status is SearchStatus.NO_CONFLICT else {}
    content = strict(to_json(ended(found, status, **times).to_dict()))
    assert content["status"] == status.value
    for name in ("f_ttr_s", "peak_deceleration_mps2", "min_speed_mps", "curve", "maneuver", "solution_file"):
        assert content[name] is None
    assert (content["ttc_s"] is None) == (status is SearchStatus.NO_CONFLICT)


def test_infinite_and_missing_numbers_are_null(found: RepairResult) -> None:
    probe = replace(
        found.search.probes[0], solve=SolveResult(SolveStatus.INFEASIBLE, residuals={"a": float("nan")})
    )
    search = replace(found.search, probes=(probe,), conflict=Conflict(float("inf")))
    content = strict(to_json(replace(found, search=search).to_dict()))
    assert content["ttc_s"] is None
    assert content["contact_ttc_s"] is None
    assert content["probes"][0]["objective"] is None
    assert content["probes"][0]["residuals"] == {"a": None}
    assert content["probes"][0]["peak_deceleration_mps2"] is None


def test_provenance_of_a_file_and_of_memory(found: RepairResult, tmp_path: Path) -> None:
    scene = found.prepared.scene
    memory = scene_from_scenario(scene.scenario, scene.planning_problem)
    assert provenance(memory)["kind"] == "reconstruction"
    copied = tmp_path / "other.xml"
    assert scene.path is not None
    copied.write_text(scene.path.read_text("utf-8").replace("reconstruction", "recording"), "utf-8")
    other = load_scene(copied)
    assert provenance(other)["kind"] == "file"
    assert provenance(other)["path"] == str(copied.resolve())
    assert provenance(replace(other, path=None))["kind"] == "memory"
    # The name alone does not make a file official.
    assert provenance(replace(other, id="DEU_Flensburg-6_1_T-1"))["kind"] == "file"


# -- CommonRoad ------------------------------------------------------------------------------------


def test_trajectory_starts_where_the_planning_problem_does(found: RepairResult) -> None:
    scene = found.prepared.scene
    trajectory = to_trajectory(scene, found.states)
    first = trajectory.state_list[0]
    assert trajectory.initial_time_step == first.time_step == scene.initial_time_step
    np.testing.assert_allclose(first.position, scene.planning_problem.initial_state.position, atol=1e-3)
    assert len(trajectory.state_list) == len(found.states)
    assert found.trajectory.state_list[-1].time_step == scene.initial_time_step + len(found.states) - 1


def test_dynamic_obstacle_fits_into_the_scenario(scenario_file: Path) -> None:
    result = repair(scenario_file, CONFIG)
    scenario = result.prepared.scene.scenario
    ego = result.to_dynamic_obstacle()
    taken = {o.obstacle_id for o in scenario.obstacles} | {result.prepared.scene.planning_problem_id}
    assert ego.obstacle_id not in taken
    assert ego.prediction.initial_time_step == ego.initial_state.time_step + 1
    assert ego.obstacle_shape.length == result.prepared.scene.vehicle.length
    scenario.add_objects(ego)
    assert scenario.obstacle_by_id(ego.obstacle_id) is ego
    assert result.to_dynamic_obstacle(4711).obstacle_id == 4711
    direct = to_dynamic_obstacle(result.prepared.scene, result.states, 4711)
    assert direct.obstacle_id == 4711
    np.testing.assert_array_equal(direct.initial_state.position, ego.initial_state.position)


def test_solution_file_passes_the_official_check(found: RepairResult, tmp_path: Path) -> None:
    from commonroad.common.solution import CommonRoadSolutionReader
    from commonroad.planning.planning_problem import PlanningProblemSet
    from commonroad_dc.feasibility.solution_checker import solution_feasible, starts_at_correct_state

    outcome, _ = found.saved(tmp_path, figure=False)
    content = outcome.record
    scene = found.prepared.scene
    problems = PlanningProblemSet([scene.planning_problem])
    solution = CommonRoadSolutionReader.open(str(tmp_path / content["solution_file"]))
    answer = solution_feasible(solution, scene.dt, problems)[scene.planning_problem_id]
    assert answer[0]
    assert starts_at_correct_state(solution, problems)
    written = solution.planning_problem_solutions[0].trajectory.state_list
    for ours, theirs in zip(found.trajectory.state_list, written, strict=True):
        np.testing.assert_array_equal(ours.position, theirs.position)
        assert (ours.velocity, ours.orientation) == (theirs.velocity, theirs.orientation)


def test_a_colliding_trajectory_is_no_solution(no_repair: RepairResult, tmp_path: Path) -> None:
    for ask in (
        no_repair.to_solution,
        lambda: to_solution(no_repair.prepared.scene, no_repair.states, no_repair.status),
    ):
        with pytest.raises(OutputError, match="no tested time-to-repair has a feasible repair"):
            ask()
    outcome, written = no_repair.saved(tmp_path, figure=False)
    content = outcome.record
    assert content["solution_file"] is None
    assert not list(tmp_path.glob("solution_*"))
    assert written[0] == tmp_path / "result.json"


# -- files -----------------------------------------------------------------------------------------


def test_save_writes_all_files_and_nothing_else(found: RepairResult, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    written = found.save(folder)
    assert sorted(p.name for p in written) == sorted(p.name for p in folder.iterdir())
    content = strict((folder / "result.json").read_text("utf-8"))
    assert written[0].name == "result.json"
    assert content["scenario_file"] in {p.name for p in written}
    for name in content["figure_files"]:
        assert (folder / name).read_bytes().startswith(PNG)
    assert load_scene(folder / content["scenario_file"]).sha256 == content["provenance"]["sha256"]


def test_saving_again_removes_what_no_longer_holds(
    found: RepairResult, no_repair: RepairResult, tmp_path: Path
) -> None:
    found.save(tmp_path, figure=True)
    (tmp_path / "mine.txt").write_text("kept")
    no_repair.save(tmp_path, figure=False)
    left = {p.name for p in tmp_path.iterdir()}
    assert not any(name.startswith("solution_") or name.endswith(".png") for name in left)
    assert {"mine.txt", "result.json"} <= left


def test_solution_file_is_the_same_every_time(found: RepairResult, tmp_path: Path) -> None:
    one, two = (found.saved(tmp_path / name, figure=False)[1] for name in ("one", "two"))
    assert [p.name for p in one] == [p.name for p in two]
    for a, b in zip(one[1:], two[1:], strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_a_full_disk_leaves_nothing_behind(
    found: RepairResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def full(descriptor: int) -> None:
        calls.append(descriptor)
        os.ftruncate(descriptor, 10)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left on device"):
        found.save(tmp_path / "a" / "b", figure=False)
    assert list(tmp_path.iterdir()) == []
    assert len(calls) == 2


def test_a_folder_that_cannot_be_made(found: RepairResult, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(OutputError, match="cannot be"):
            found.save(folder, figure=False)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_name_taken_by_a_folder(found: RepairResult, tmp_path: Path) -> None:
    (tmp_path / "result.json").mkdir()
    with pytest.raises(OutputError, match="results cannot be written"):
        found.save(tmp_path, figure=False)
    assert not list(tmp_path.glob(".*"))


# -- figures ---------------------------------------------------------------------------------------


def test_figures_are_drawn_without_global_state(found: RepairResult) -> None:
    import sys

    before = "matplotlib.pyplot" in sys.modules
    figure = profile_figure(found.outcome)
    assert [a.get_ylabel().replace("\n", " ") for a in figure.axes] == [
        "distance driven s [m]", "speed [m/s]", "acceleration [m/s²]", "lateral acc. [m/s²]",
    ]  # fmt: skip
    assert figure.axes[-1].get_xlabel() == "time t [s]"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "reference" in labels
    assert sum(label.startswith("$t_{rep}$") for label in labels) == len(found.search.probes)
    assert sum("F-TTR" in label for label in labels) == 1
    assert render(figure) == render(profile_figure(found.outcome))
    for kind in ("svg", "pdf"):
        one, two = (render(profile_figure(found.outcome), kind) for _ in range(2))
        assert one == two
    assert "reconstruction" in figure.axes[0].get_title()
    for other in (birdseye_figure(found.outcome), stages_figure(found.outcome)):
        assert render(other).startswith(PNG)
    assert ("matplotlib.pyplot" in sys.modules) == before


def test_figures_without_a_repair(no_repair: RepairResult) -> None:
    for draw in (profile_figure, birdseye_figure):
        assert render(draw(no_repair.outcome), "svg")
    with pytest.raises(ValueError, match="no probe"):
        stages_figure(no_repair.outcome)


# -- read back -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(found: RepairResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("saved")
    found.save(made)
    return made


@pytest.fixture
def copied(folder: Path, tmp_path: Path) -> Path:
    """A folder that a test may spoil."""
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    return tmp_path


def edit(file: Path, change: Any) -> None:
    content = json.loads(file.read_text("utf-8"))
    change(content)
    file.write_text(json.dumps(content), "utf-8")


def test_the_record_of_a_folder_is_its_file(found: RepairResult, folder: Path) -> None:
    outcome = load_result(folder)
    assert outcome.record == strict((folder / "result.json").read_text("utf-8")) == read_record(folder)
    assert load_result(str(folder)).record == outcome.record
    files = ("solution_file", "figure_files", "report_file", "scenario_file", "drawing_file")
    assert {**outcome.record, **dict.fromkeys(files)} == {**found.to_dict(), **dict.fromkeys(files)}
    assert all(outcome.record[name] for name in files)
    assert (outcome.scenario, outcome.backend, outcome.status) == (found.prepared.scene.id, "ego", "found")
    assert outcome.ttc == pytest.approx(found.ttc)
    assert outcome.f_ttr == pytest.approx(found.f_ttr)
    assert [p["t_rep_s"] for p in outcome.probes] == pytest.approx([p.t_rep for p in found.search.probes])
    assert outcome.metrics == {}


def test_the_outcome_that_saving_gives_is_the_one_that_is_read(found: RepairResult, tmp_path: Path) -> None:
    outcome, written = found.saved(tmp_path, figure=False)
    assert load_result(tmp_path).record == outcome.record
    assert {p.name for p in written} == {p.name for p in tmp_path.iterdir()}
    assert found.to_dict()["solution_file"] is None  # what is in memory names no files


@pytest.mark.exhaustive
def test_figures_from_the_folder_are_those_that_were_saved(found: RepairResult, folder: Path) -> None:
    outcome = load_result(folder)
    assert outcome.drawing is not None
    for name, draw in (("profiles.png", profile_figure), ("birdseye.png", birdseye_figure)):
        assert render(draw(outcome)) == (folder / name).read_bytes()
    assert render(stages_figure(outcome)) == render(stages_figure(found.outcome))
    for probe in found.search.probes:
        one, two = (stages_figure(x, probe.t_rep) for x in (outcome, found.outcome))
        assert render(one, "svg") == render(two, "svg")


@pytest.mark.thinned(2)
@pytest.mark.parametrize("status", [s for s in SearchStatus if s is not SearchStatus.FOUND])
def test_a_result_without_a_repair_is_read_back_too(
    found: RepairResult, status: SearchStatus, tmp_path: Path
) -> None:
    inf = float("inf")
    times = {"time": inf, "contact_time": inf, "kind": "none"} if status is SearchStatus.NO_CONFLICT else {}
    result = ended(found, status, **times)
    result.save(tmp_path)
    outcome = load_result(tmp_path)
    assert outcome.record == strict((tmp_path / "result.json").read_text("utf-8"))
    assert outcome.status == status.value
    assert outcome.ttc == pytest.approx(result.ttc)
    assert outcome.f_ttr == (inf if status is SearchStatus.NO_CONFLICT else None)
    assert render(profile_figure(outcome)) == (tmp_path / "profiles.png").read_bytes()
    assert render(birdseye_figure(outcome)) == (tmp_path / "birdseye.png").read_bytes()


DAMAGE = [b"", b"{", b"[]", b"7", b"null", b"\xff\xfe\x00", b"[" * 100_000, b"{}"]


@pytest.mark.parametrize("name", ["result.json", "drawing.json"])
@pytest.mark.parametrize("content", DAMAGE, ids=lambda content: repr(content[:4]))
def test_a_damaged_file_is_named(copied: Path, name: str, content: bytes) -> None:
    (copied / name).write_bytes(content)
    with pytest.raises(RepairError, match=name) as raised:
        load_result(copied)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["result.json", "drawing.json"])
def test_a_missing_file_is_named(copied: Path, name: str) -> None:
    (copied / name).unlink()
    with pytest.raises(RepairError, match=name):
        load_result(copied)
    (copied / name).mkdir()
    with pytest.raises(RepairError, match=name):
        load_result(copied)


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    for folder in (tmp_path / "nowhere", tmp_path):
        with pytest.raises(RepairError, match=folder.name):
            load_result(folder)


@pytest.mark.parametrize("missing", ["status", "config"])
def test_what_is_no_result_is_refused(copied: Path, missing: str) -> None:
    edit(copied / "result.json", lambda content: content.pop(missing))
    for ask in (load_result, certify):
        with pytest.raises(RepairError, match=r"result\.json is not the result of a repair"):
            ask(copied)
    edit(copied / "result.json", lambda content: content.update(status="found", config=3))
    for ask in (load_result, certify):
        with pytest.raises(RepairError, match=r"result\.json is not the result of a repair"):
            ask(copied)


def test_a_drawing_that_lacks_something_is_damaged(folder: Path, copied: Path) -> None:
    names = json.loads((folder / "drawing.json").read_text("utf-8"))
    for name in names.keys() - {"schema"}:
        (copied / "drawing.json").write_bytes((folder / "drawing.json").read_bytes())
        edit(copied / "drawing.json", lambda content, name=name: content.pop(name))
        with pytest.raises(RepairError, match=r"drawing\.json is damaged"):
            load_result(copied)


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c.update(lines=[]),
        lambda c: c.update(lines=7),
        lambda c: c["lines"][0].pop("x"),
        lambda c: c["lines"][0].update(x=["wide"]),
        lambda c: c.update(start_s_m=None),
        lambda c: c.update(steps=[]),
        lambda c: c.update(ego=[[1.0, 2.0]]),
        lambda c: c["bodies"][0].update(outlines=3),
        lambda c: c["bodies"][0].update(id="a"),
        lambda c: c.update(boxes=[{"id": 1}]),
        lambda c: c.update(areas=[[1.0]]),
        lambda c: c["lines"][1]["speed"].pop(),
        lambda c: c["lines"][1].update(
            {key: [] for key, value in c["lines"][1].items() if isinstance(value, list)}
        ),
        lambda c: c["lines"][1]["t"].__setitem__(3, None),
        lambda c: c["boxes"][0]["high"].pop(),
        lambda c: c["bodies"][0].update(outlines={"0": []}),
        lambda c: c["ego"][0].__setitem__(1, None),
        lambda c: c.update(ego=[]),
        lambda c: c["edges"][0][0].__setitem__(0, None),
        lambda c: c["unrepaired"].pop(),
    ],
)
def test_a_drawing_of_another_shape_is_damaged(copied: Path, change: Any) -> None:
    edit(copied / "drawing.json", change)
    with pytest.raises(RepairError, match=r"drawing\.json is damaged"):
        load_result(copied)


def without_what_is_new(folder: Path) -> None:
    """What an earlier version left: no drawing, no metrics, no capabilities, a seed nobody used."""

    def change(content: dict[str, Any]) -> None:
        for name in ("metrics", "capabilities", "drawing_file"):
            content.pop(name)
        content["config"]["seed"] = 0
        content["versions"]["commonroad-repair"] = "0.0.9"
        for section, name in (("scene", "smoothing"), ("checker", "extra")):
            content["config"][section].pop(name)
        content["config"].pop("metrics")
        content["config"]["casadi"]["overhang"] = 2.25

    edit(folder / "result.json", change)
    (folder / "drawing.json").unlink()


def test_a_result_of_an_earlier_version_is_read(found: RepairResult, copied: Path) -> None:
    without_what_is_new(copied)
    outcome = load_result(copied)
    assert outcome.drawing is None
    assert outcome.metrics == {}
    assert outcome.f_ttr == pytest.approx(found.f_ttr)
    assert outcome.record == strict((copied / "result.json").read_text("utf-8"))
    for draw in (profile_figure, birdseye_figure, stages_figure):
        with pytest.raises(RepairError, match="nothing to draw"):
            draw(outcome)
    from repair.report.text import summary

    assert "F-TTR     1.60 s" in summary(outcome.record, None)


def test_a_result_of_an_earlier_version_is_certified(copied: Path) -> None:
    before = certify(copied)
    without_what_is_new(copied)
    after = certify(copied)
    assert before.ok
    assert after.ok
    assert any("other versions of commonroad-repair" in row.unit for row in after.rows)


# -- formats ---------------------------------------------------------------------------------------


def test_every_format_names_its_files(found: RepairResult, tmp_path: Path) -> None:
    own = ("solution", "mitigation", "figures", "report", "scenario", "drawing", "proof", "trace")
    assert FORMATS.names() == own

    def text(result: Any) -> Files:
        return Files({f"{result.name}.txt": b"mine"}, {"text_file": f"{result.name}.txt"}, ("old.txt",))

    (tmp_path / "old.txt").write_text("of an earlier run")
    FORMATS.register("text", text)
    try:
        outcome, written = found.saved(tmp_path, figure=False)
    finally:
        FORMATS.unregister("text")
    name = outcome.record["text_file"]
    assert (tmp_path / name).read_bytes() == b"mine"
    assert written[0].name == "result.json"
    assert {p.name for p in written} == {p.name for p in tmp_path.iterdir()}  # old.txt is gone
    assert load_result(tmp_path).record["text_file"] == name
    assert "text_file" not in found.saved(tmp_path, figure=False)[0].record


def test_a_scenario_from_memory_need_not_say_who_made_it(
    scenario_file: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    made = load_scene(scenario_file, CONFIG)
    scenario = made.scenario
    scenario.author = scenario.affiliation = scenario.source = scenario.tags = scenario.location = None
    result = repair(scene_from_scenario(scenario, made.planning_problem, CONFIG), CONFIG)
    assert result.status is SearchStatus.FOUND
    result.save(tmp_path, figure=False)
    assert not caplog.records
    assert certify(tmp_path).ok


def test_a_scenario_from_memory_is_written_to_the_last_digit(scenario_file: Path, tmp_path: Path) -> None:
    made = load_scene(scenario_file, CONFIG)
    made.scenario.translate_rotate(np.array([0.1, 1e-7]), 0.7)
    made.planning_problem.translate_rotate(np.array([0.1, 1e-7]), 0.7)
    file = tmp_path / "scenario.xml"
    file.write_bytes(scenario_bytes(scene_from_scenario(made.scenario, made.planning_problem, CONFIG)))
    read = load_scene(file, CONFIG)
    for one, other in zip(
        made.scenario.lanelet_network.lanelets, read.scenario.lanelet_network.lanelets, strict=True
    ):
        np.testing.assert_array_equal(one.left_vertices, other.left_vertices)
    for one, other in zip(made.scenario.dynamic_obstacles, read.scenario.dynamic_obstacles, strict=True):
        ends = [o.prediction.trajectory.state_list[-1] for o in (one, other)]
        np.testing.assert_array_equal(ends[0].position, ends[1].position)


def test_a_scenario_that_cannot_be_written_is_missed_with_the_reason(
    found: RepairResult, tmp_path: Path
) -> None:
    found.save(tmp_path, figure=False)
    file = tmp_path / "result.json"
    record = json.loads(file.read_text())
    record |= {"scenario_file": None, "scenario_file_problem": "writing the scenario failed: so it goes"}
    file.write_text(json.dumps(record))
    with pytest.raises(RepairError, match=r"does not hold the scenario .*: writing .* so it goes"):
        certify(tmp_path)
