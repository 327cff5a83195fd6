"""The paper's Scenario 1: its published figures, on the official file and on the bundled reconstruction.

Paper, Sec. V-B and Table I: TTC 2.9 s, iterates 0, 0.8, 1.2, 1.6, F-TTR 1.6 s, peak deceleration -1.86 m/s².
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import pytest

from repair.cli.command import main

FILE = "DEU_Flensburg-6_1_T-1.xml"


@pytest.fixture(scope="module", params=["official", "reconstruction"])
def source(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Kind of provenance, and the scenario's file."""
    if request.param == "official":
        return "official", request.getfixturevalue("scenarios") / FILE
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # protobuf's deprecations, on import
        from repair.paper.synthetic import write_scenario
    return "reconstruction", write_scenario("scenario_1", tmp_path_factory.mktemp("scenario"))


def run(argv: list[str], folder: Path) -> dict[str, Any]:
    assert main(["run", *argv, "--out", str(folder), "--no-figure"]) == 0
    content: dict[str, Any] = json.loads((folder / "result.json").read_text("utf-8"))
    return content


@pytest.fixture(scope="module")
def folder(source: tuple[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("result")
    run([str(source[1]), "--preset", "scenario_1"], made)
    return made


@pytest.fixture
def result(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "result.json").read_text("utf-8"))
    return content


def test_provenance_is_labelled(source: tuple[str, Path], result: dict[str, Any]) -> None:
    assert result["provenance"]["kind"] == source[0]
    assert result["provenance"]["name"] == source[1].name


def test_published_times(result: dict[str, Any]) -> None:
    assert result["status"] == "found"
    assert result["ttc_s"] == 2.9
    assert result["conflict"]["kind"] == "margin"
    assert result["f_ttr_s"] == 1.6
    assert [p["t_rep_s"] for p in result["probes"]] == [0.0, 0.8, 1.2, 1.6]
    assert all(p["feasible"] for p in result["probes"])


def test_deceleration_and_speed(result: dict[str, Any]) -> None:
    assert -2.1 <= result["peak_deceleration_mps2"] <= -1.5
    assert result["min_speed_mps"] >= -0.05


@pytest.mark.parametrize("rule", [["search.upper=null"], ["search.upper=null", "search.rule=scan"]])
def test_other_rules_give_the_same_f_ttr(
    rule: list[str], source: tuple[str, Path], result: dict[str, Any], tmp_path: Path
) -> None:
    again = run([str(source[1]), "--preset", "scenario_1", "--set", *rule], tmp_path)
    assert again["f_ttr_s"] == result["f_ttr_s"]
    assert again["ttc_s"] == result["ttc_s"]
    assert max(p["t_rep_s"] for p in again["probes"]) > 1.6


def test_official_checks_accept_the_solution_file(source: tuple[str, Path], folder: Path) -> None:
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.common.solution import CommonRoadSolutionReader
    from commonroad_dc.boundary.boundary import create_road_boundary_obstacle
    from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_object
    from commonroad_dc.feasibility import solution_checker as official

    scenario, problems = CommonRoadFileReader(str(source[1])).open()
    content = json.loads((folder / "result.json").read_text("utf-8"))
    solution = CommonRoadSolutionReader.open(str(folder / content["solution_file"]))
    answers = official.solution_feasible(solution, scenario.dt, problems)
    assert all(answer[0] for answer in answers.values())
    assert official.starts_at_correct_state(solution, problems)
    assert not official.obstacle_collision(scenario, problems, solution)
    # official.boundary_collision needs the non-free package triangle; this is the checker's other way.
    _, road_edge = create_road_boundary_obstacle(scenario, method="obb_rectangles")
    ego = next(iter(solution.create_dynamic_obstacle().values()))
    assert not road_edge.collide(create_collision_object(ego))


def test_the_official_file_is_used_where_it_is_found(
    scenarios: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COMMONROAD_SCENARIOS", str(scenarios))
    assert main(["run"]) == 0
    out = capsys.readouterr().out
    assert "official file, sha256 a9891d6e4080" in out
    assert "preset scenario_1" in out
