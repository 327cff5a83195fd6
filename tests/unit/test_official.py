"""What CommonRoad asks of a solution, each by itself: a solution that fails one says which."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from commonroad.common.solution import CommonRoadSolutionWriter
from commonroad.planning.planning_problem import PlanningProblem, PlanningProblemSet
from tests.roads import SLOW, driving, scenario

import repair
from repair.io.official import check_solution_file


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A car ahead that is slower; the goal is a time only."""
    file = tmp_path_factory.mktemp("official") / "scenario.xml"
    file.write_text(scenario(obstacles=SLOW), encoding="utf-8")
    return repair.repair(file, backend="qptr", overrides=["reference.source=constant"])


def verdict(result, tmp_path, change=lambda states: None, traffic=None):
    solution = deepcopy(result.to_solution())
    change(solution.planning_problem_solutions[0].trajectory.state_list)
    file = tmp_path / "solution.xml"
    file.write_bytes(CommonRoadSolutionWriter(solution).dump().encode())
    scene = result.prepared.scene
    problems = PlanningProblemSet([scene.planning_problem])
    return check_solution_file(file, traffic or scene.official(), problems)


PARTS = (
    "solved",
    "vehicle_model",
    "connected",
    "starts",
    "feasible",
    "collision_free",
    "on_road",
    "egos_apart",
)


def failing(answer):
    return {name for name in (*PARTS, "goal") if not getattr(answer, name)}


def test_a_repair_passes_all_of_it(result, tmp_path):
    answer = verdict(result, tmp_path)
    assert failing(answer) == set()
    assert answer.ok
    assert answer.valid


def turned(states):
    states[0].orientation += 0.2


def beside(states):
    for state in states:
        state.position = np.add(state.position, (0.0, 0.5))


def off_the_road(states):
    for state in states:
        state.position = np.add(state.position, (0.0, 2.0))


def jumps(states):
    for state in states[10:]:
        state.position = np.add(state.position, (3.0, 0.0))


def ends_early(states):
    del states[25:]


@pytest.mark.parametrize(
    "change, expected",
    [
        (turned, {"starts", "feasible"}),
        (beside, {"starts"}),
        (off_the_road, {"starts", "on_road"}),
        (jumps, {"connected", "feasible", "collision_free"}),  # ahead, onto the other car
        (ends_early, {"goal"}),
    ],
)
def test_what_is_wrong_is_said(result, tmp_path, change, expected):
    answer = verdict(result, tmp_path, change)
    assert failing(answer) == expected
    assert not answer.valid
    assert answer.ok == (expected == {"goal"})


def test_who_is_met_is_said(result, tmp_path):
    from commonroad.common.file_reader import CommonRoadFileReader

    file = tmp_path / "other.xml"
    file.write_text(scenario(obstacles=driving(30, 30.0, 0.0, 0.0)), encoding="utf-8")
    assert failing(verdict(result, tmp_path, traffic=CommonRoadFileReader(str(file)).open()[0])) == {
        "collision_free"
    }


def test_another_problem_is_another_problem(result, tmp_path):
    scene = result.prepared.scene
    known = scene.planning_problem
    other = PlanningProblem(known.planning_problem_id + 1, known.initial_state, known.goal)
    solution = result.to_solution()
    file = tmp_path / "solution.xml"
    file.write_bytes(CommonRoadSolutionWriter(solution).dump().encode())
    both = PlanningProblemSet([known, other])
    assert failing(check_solution_file(file, scene.official(), both)) == {"solved"}
