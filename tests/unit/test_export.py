"""A result as JSON, as CommonRoad objects, as files, and as figures; on the bundled reconstruction."""

from __future__ import annotations

import errno
import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from repair import arrays as export
from repair.api import RepairResult, repair
from repair.backend.base import SolveResult, SolveStatus
from repair.check.verdict import Conflict
from repair.config import load_config
from repair.curves.bernstein import BernsteinCurve
from repair.curves.bspline import UniformBSpline
from repair.errors import OutputError
from repair.io.commonroad import to_dynamic_obstacle, to_solution, to_trajectory
from repair.io.result_json import to_dict, to_json
from repair.save import save, saved
from repair.scene.commonroad import load_scene, scene_from_scenario
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
    content = to_dict(found)
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

    walk(to_dict(found), "")


def test_content_of_a_repair(found: RepairResult) -> None:
    content = to_dict(found)
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
    content = to_dict(found)
    curve, driven = content["curve"], content["trajectory"]
    assert curve["type"] == "uniform_bspline"
    points = np.array(curve["control_points_m"])
    again = UniformBSpline(curve["t_start_s"], curve["spacing_s"], curve["degree"], points)
    t = np.array(driven["t_s"])
    late = t >= content["f_ttr_s"] - 1e-9
    np.testing.assert_allclose(again.sample(t[late]).position[:, 0], np.array(driven["s_m"])[late], atol=1e-8)


def test_other_curves_are_written_too(found: RepairResult) -> None:
    pieces = np.arange(24.0).reshape(2, 6, 2)
    written = export._curve(BernsteinCurve(1.6, 0.5, pieces))
    assert written is not None
    assert written["type"] == "bernstein"
    np.testing.assert_array_equal(written["control_points_m"], pieces)
    sampled = export._curve(found.curve, 1.0)
    assert sampled is not None
    assert sampled["type"] == "samples"
    assert len(sampled["t_s"]) == len(sampled["s_m"]) == len(sampled["l_mps2"]) == 11


def test_same_input_same_content_apart_from_times(scenario_file: Path, found: RepairResult) -> None:
    again = to_dict(repair(scenario_file, CONFIG))
    assert without_times(again) == without_times(to_dict(found))
    assert to_json(without_times(again)) == to_json(without_times(to_dict(found)))


@pytest.mark.parametrize("status", [s for s in SearchStatus if s is not SearchStatus.FOUND])
def test_without_a_repair_figures_are_null(found: RepairResult, status: SearchStatus) -> None:
    inf = float("inf")
    times = {"time": inf, "contact_time": inf, "kind": "none"} if status is SearchStatus.NO_CONFLICT else {}
    content = strict(to_json(to_dict(ended(found, status, **times))))
    assert content["status"] == status.value
    for name in ("f_ttr_s", "peak_deceleration_mps2", "min_speed_mps", "curve", "maneuver", "solution_file"):
        assert content[name] is None
    assert (content["ttc_s"] is None) == (status is SearchStatus.NO_CONFLICT)


def test_infinite_and_missing_numbers_are_null(found: RepairResult) -> None:
    probe = replace(
        found.search.probes[0], solve=SolveResult(SolveStatus.INFEASIBLE, residuals={"a": float("nan")})
    )
    search = replace(found.search, probes=(probe,), conflict=Conflict(float("inf")))
    content = strict(to_json(to_dict(replace(found, search=search))))
    assert content["ttc_s"] is None
    assert content["contact_ttc_s"] is None
    assert content["probes"][0]["objective"] is None
    assert content["probes"][0]["residuals"] == {"a": None}
    assert content["probes"][0]["peak_deceleration_mps2"] is None


def test_provenance_of_a_file_and_of_memory(found: RepairResult, tmp_path: Path) -> None:
    scene = found.prepared.scene
    memory = scene_from_scenario(scene.scenario, scene.planning_problem)
    assert export.provenance(memory)["kind"] == "reconstruction"
    copied = tmp_path / "other.xml"
    assert scene.path is not None
    copied.write_text(scene.path.read_text("utf-8").replace("reconstruction", "recording"), "utf-8")
    other = load_scene(copied)
    assert export.provenance(other)["kind"] == "file"
    assert export.provenance(other)["path"] == str(copied.resolve())
    assert export.provenance(replace(other, path=None))["kind"] == "memory"
    # The name alone does not make a file official.
    assert export.provenance(replace(other, id="DEU_Flensburg-6_1_T-1"))["kind"] == "file"


# -- CommonRoad ------------------------------------------------------------------------------------


def test_trajectory_starts_where_the_planning_problem_does(found: RepairResult) -> None:
    trajectory, scene = to_trajectory(found), found.prepared.scene
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
    assert to_dynamic_obstacle(result, 4711).obstacle_id == 4711


def test_solution_file_passes_the_official_check(found: RepairResult, tmp_path: Path) -> None:
    from commonroad.common.solution import CommonRoadSolutionReader
    from commonroad.planning.planning_problem import PlanningProblemSet
    from commonroad_dc.feasibility.solution_checker import solution_feasible, starts_at_correct_state

    content, _ = saved(found, tmp_path, figure=False)
    scene = found.prepared.scene
    problems = PlanningProblemSet([scene.planning_problem])
    solution = CommonRoadSolutionReader.open(str(tmp_path / content["solution_file"]))
    answer = solution_feasible(solution, scene.dt, problems)[scene.planning_problem_id]
    assert answer[0]
    assert starts_at_correct_state(solution, problems)
    written = solution.planning_problem_solutions[0].trajectory.state_list
    for ours, theirs in zip(to_trajectory(found).state_list, written, strict=True):
        np.testing.assert_array_equal(ours.position, theirs.position)
        assert (ours.velocity, ours.orientation) == (theirs.velocity, theirs.orientation)


def test_a_colliding_trajectory_is_no_solution(no_repair: RepairResult, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="no tested time-to-repair has a feasible repair"):
        to_solution(no_repair)
    content, written = saved(no_repair, tmp_path, figure=False)
    assert content["solution_file"] is None
    assert not list(tmp_path.glob("solution_*"))
    assert written[0] == tmp_path / "result.json"


# -- files -----------------------------------------------------------------------------------------


def test_save_writes_all_files_and_nothing_else(found: RepairResult, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    written = save(found, folder)
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
    save(found, tmp_path, figure=True)
    (tmp_path / "mine.txt").write_text("kept")
    save(no_repair, tmp_path, figure=False)
    left = {p.name for p in tmp_path.iterdir()}
    assert not any(name.startswith("solution_") or name.endswith(".png") for name in left)
    assert {"mine.txt", "result.json"} <= left


def test_solution_file_is_the_same_every_time(found: RepairResult, tmp_path: Path) -> None:
    one, two = (saved(found, tmp_path / name, figure=False)[1] for name in ("one", "two"))
    assert [p.name for p in one] == [p.name for p in two]
    for a, b in zip(one[1:], two[1:], strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_a_full_disk_leaves_nothing_behind(
    found: RepairResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def full(path: Path, content: bytes) -> None:
        calls.append(path)
        path.write_bytes(content[:10])
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("repair.files._write", full)
    with pytest.raises(OutputError, match="No space left on device"):
        save(found, tmp_path / "a" / "b", figure=False)
    assert list(tmp_path.iterdir()) == []
    assert len(calls) == 2


def test_a_folder_that_cannot_be_made(found: RepairResult, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(OutputError, match="cannot be"):
            save(found, folder, figure=False)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_name_taken_by_a_folder(found: RepairResult, tmp_path: Path) -> None:
    (tmp_path / "result.json").mkdir()
    with pytest.raises(OutputError, match="results cannot be written"):
        save(found, tmp_path, figure=False)
    assert not list(tmp_path.glob(".*"))


# -- figures ---------------------------------------------------------------------------------------


def test_figures_are_drawn_without_global_state(found: RepairResult) -> None:
    import sys

    from repair.report.birdseye import birdseye_figure
    from repair.report.profiles import profile_figure, stages_figure
    from repair.report.style import render

    before = "matplotlib.pyplot" in sys.modules
    figure = profile_figure(found)
    assert [a.get_ylabel().replace("\n", " ") for a in figure.axes] == [
        "distance driven s [m]", "speed [m/s]", "acceleration [m/s²]",
    ]  # fmt: skip
    assert figure.axes[-1].get_xlabel() == "time t [s]"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "reference" in labels
    assert sum(label.startswith("$t_{rep}$") for label in labels) == len(found.search.probes)
    assert sum("F-TTR" in label for label in labels) == 1
    assert render(figure) == render(profile_figure(found))
    assert "reconstruction" in figure.axes[0].get_title()
    for other in (birdseye_figure(found), stages_figure(found)):
        assert render(other).startswith(PNG)
    assert ("matplotlib.pyplot" in sys.modules) == before


def test_figures_without_a_repair(no_repair: RepairResult) -> None:
    from repair.report.birdseye import birdseye_figure
    from repair.report.profiles import profile_figure, stages_figure
    from repair.report.style import render

    for draw in (profile_figure, birdseye_figure):
        assert render(draw(no_repair), "svg")
    with pytest.raises(ValueError, match="no probe"):
        stages_figure(no_repair)
