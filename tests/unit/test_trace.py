"""drawtonomy's files: the structure its format asks for, and what a trace says against the solution file."""

from __future__ import annotations

import json
import math
import re
from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.roads import SLOW, driving, lanelet, problem, scenario, state
from tests.unavoidable import situation

import repair
from repair.certify.recompute import certify
from repair.cli.command import main
from repair.io.trace.fingerprint import fingerprint
from repair.scene.reading import read_solution

CHECKS = [
    "solved_all_problems", "goal_reached", "starts_at_correct_state", "obstacle_collision",
    "boundary_collision", "ego_collision", "solution_feasible",
]  # fmt: skip


def is_number(value) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def states_objections(states, where: str) -> list[str]:
    if not isinstance(states, list) or not states:
        return [f"{where}: no states"]
    if not all(isinstance(one, dict) and all(is_number(one.get(key)) for key in "txy") for one in states):
        return [f"{where}: a state without t, x, y"]
    found = [
        f"{where}: {key} is no number" for key in "hv" if not all(is_number(k.get(key, 0.0)) for k in states)
    ]
    times = [one["t"] for one in states]
    return found + ([] if all(np.diff(times) > 0.0) else [f"{where}: times do not go up"])


def plan_objections(plan, where: str) -> list[str]:
    found = states_objections(plan.get("states"), where)
    if found:
        return found
    if not is_number(plan.get("t")) or abs(plan["t"] - plan["states"][0]["t"]) > 1e-6:
        found.append(f"{where}: it is not issued where it begins")
    for k, one in enumerate(plan.get("candidates", [])):
        found += states_objections(one.get("states"), f"{where}, candidate {k}")
        if not isinstance(one.get("feasible", True), bool):
            found.append(f"{where}, candidate {k}: feasible is no truth value")
        if "reason" in one and not (isinstance(one["reason"], str) and one["reason"]):
            found.append(f"{where}, candidate {k}: a reason without words")
    return found


def objections(trace) -> list[str]:
    """What the format drawtonomy-planning-trace-v1 does not allow, as its package 0.3.0 states it."""
    found = []
    if trace.get("schema") != "drawtonomy-planning-trace-v1" or trace.get("frame") not in ("center", "ref"):
        found.append("schema or frame")
    for key in ("scenarioFingerprint", "solutionFingerprint"):
        if key in trace and not re.fullmatch("sha256:[0-9a-f]{64}", trace[key]):
            found.append(key)
    tracks = trace.get("tracks")
    if not isinstance(tracks, list) or not tracks:
        return [*found, "no tracks"]
    for track in tracks:
        if ("role" in track) == ("name" in track) or track.get("role", "ego") != "ego":
            found.append("whose track it is")
        body = track.get("vehicle", {"length": 1.0, "width": 1.0})
        if not all(is_number(body.get(key)) and body[key] > 0.0 for key in ("length", "width")):
            found.append("the vehicle's size")
        if not is_number(body.get("refToCenter", 0.0)) or body.get("refToCenter", 0.0) < 0.0:
            found.append("the vehicle's rear axle")
        found += states_objections(track.get("driven"), "driven")
        plans = track.get("plans")
        if not isinstance(plans, list) or not plans:
            return [*found, "no plans"]
        for k, plan in enumerate(plans):
            found += plan_objections(plan, f"plan {k}")
        if len({plan.get("t") for plan in plans}) != len(plans):
            found.append("two plans at one time")
    return found


def mismatches(trace, solution: np.ndarray | None, dt: float) -> list[str]:
    """Where what is driven is not the solution (K, 3) [step, x, y], or a plan begins where the ego is not."""
    track = trace["tracks"][0]
    driven = np.array([[k["t"] / dt, k["x"], k["y"]] for k in track["driven"]])
    found = []
    if solution is not None and (driven.shape != solution.shape or np.abs(driven - solution).max() > 1e-6):
        found.append("driven")
    at = {round(step): place for step, *place in driven}
    for k, plan in enumerate(track["plans"]):
        first = plan["states"][0]
        if np.abs(np.subtract(at[round(first["t"] / dt)], (first["x"], first["y"]))).max() > 1e-6:
            found.append(f"plan {k}")
    return found


def run(tmp_path, text: str, *keys: str, backend: str = "ego"):
    """The record of a repair, its trace, its verdict, and the states of the solution's file."""
    file, folder = tmp_path / "scenario.xml", tmp_path / "out"
    file.write_text(text, encoding="utf-8")
    result = repair.repair(file, backend=backend, overrides=["reference.source=constant", *keys])
    outcome, paths = result.saved(folder, figure=False, trace=True)
    record = outcome.record
    traced = (folder / record["trace_file"]).read_bytes()
    assert b"drawtonomy-planning-trace-v1" in traced[:8192]  # where readers look for it
    verdict, solution = None, None
    if record["verdict_file"] is not None:
        verdict = json.loads((folder / record["verdict_file"]).read_text("utf-8"))
    if record["solution_file"] is not None:
        assert record["trace_file"] == record["solution_file"].replace(".xml", ".planning-trace.json")
        read = read_solution(folder / record["solution_file"]).planning_problem_solutions[0]
        solution = np.array([[k.time_step, *k.position] for k in read.trajectory.state_list])
    assert {path.name for path in paths} == {path.name for path in folder.iterdir()}
    return record, json.loads(traced), verdict, solution


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """A slower car ahead, and a goal that is a time only."""
    return run(tmp_path_factory.mktemp("trace"), scenario(obstacles=SLOW))


def test_a_repair_has_two_plans_and_what_was_looked_at_beside_them(slow):
    record, trace, _, solution = slow
    assert objections(trace) == []
    assert mismatches(trace, solution, 0.1) == []
    first, second = trace["tracks"][0]["plans"]
    assert first["t"] == 0.0
    assert record["f_ttr_s"] - 0.1 < second["t"] <= record["f_ttr_s"]
    reference = [10.0 * k["t"] + 20.0 for k in first["states"]]
    assert [k["x"] for k in first["states"]] == pytest.approx(reference)
    tried = [k["repair"]["t_rep_s"] for k in first["candidates"]]
    assert sorted([*tried, record["f_ttr_s"]]) == sorted(p["t_rep_s"] for p in record["probes"])
    assert [k["repair"]["kind"] for k in second["candidates"]] == ["stop"]
    assert trace["repair"]["f_ttr_s"] == record["f_ttr_s"]
    assert "trajectory" not in trace["repair"]["terminal"]
    body = trace["tracks"][0]["vehicle"]
    assert (body["type"], body["length"]) == ("FORD_ESCORT", pytest.approx(4.298))


def test_a_rejected_candidate_says_why_in_the_words_of_the_format(slow):
    record, trace, _, _ = slow
    words = {"infeasible_collision", "infeasible_kinematic", "infeasible_rule"}
    candidates = [k for plan in trace["tracks"][0]["plans"] for k in plan["candidates"]]
    assert any(not k["feasible"] for k in candidates)
    for one in candidates:
        assert one.get("reason") in ({None} if one["feasible"] else words)
    later = [p for p in record["probes"] if not p["feasible"] and p["t_rep_s"] > record["f_ttr_s"]]
    assert later
    assert all(p["reasons"] for p in trace["repair"]["probes"] if not p["feasible"])


def test_the_verdict_is_that_of_the_checker_on_the_two_files(slow, tmp_path):
    _, trace, verdict, _ = slow
    assert [k["name"] for k in verdict["checks"]] == CHECKS
    said = {k["name"]: k["status"] for k in verdict["checks"]}
    assert {said[name] for name in CHECKS if name != "boundary_collision"} == {"PASS"}
    assert said["boundary_collision"] in ("PASS", "SKIP")  # SKIP without the package triangle
    for key in ("scenarioFingerprint", "solutionFingerprint"):
        assert verdict[key] == trace[key]
    assert (verdict["schema"], verdict["scenarioId"]) == ("drawtonomy-verdict/1", trace["scenario"])
    # A goal that a repair does not reach, and a second planning problem that nobody solves, are failures.
    goal = f"<goalState><position>{_circle(300.0)}</position>{_time(30, 40)}</goalState>"
    both = problem(100, goal=goal) + problem(101)
    _, _, verdict, _ = run(tmp_path, scenario(obstacles=SLOW, problems=both))
    failed = {k["name"]: k["message"] for k in verdict["checks"] if k["status"] == "FAIL"}
    assert set(failed) == {"solved_all_problems", "goal_reached"}
    assert "GoalNotReached" in failed["goal_reached"]


def _circle(x: float) -> str:
    return f"<circle><radius>1.0</radius><center><x>{x}</x><y>0.0</y></center></circle>"


def _time(start: int, end: int) -> str:
    return f"<time><intervalStart>{start}</intervalStart><intervalEnd>{end}</intervalEnd></time>"


def test_times_are_those_of_the_scenario_which_the_planning_problem_begins_later(tmp_path):
    wanted = problem(100, state(20.0, 0.0, k=7))
    text = scenario(obstacles=driving(30, 45.0, 0.0, 2.0, range(1, 60)), problems=wanted)
    _, trace, _, solution = run(tmp_path, text)
    assert solution[0, 0] == 7
    assert trace["tracks"][0]["driven"][0]["t"] == pytest.approx(0.7)
    assert objections(trace) == []
    assert mismatches(trace, solution, 0.1) == []


def test_a_repair_between_two_steps_is_planned_at_the_step_before(tmp_path):
    record, trace, _, solution = run(tmp_path, scenario(obstacles=SLOW), "search.delta_t=0.033")
    issued = trace["tracks"][0]["plans"][1]["t"]
    assert 0.0 < record["f_ttr_s"] - issued < 0.1
    assert issued / 0.1 == pytest.approx(round(issued / 0.1))
    assert mismatches(trace, solution, 0.1) == []


def test_without_a_conflict_there_is_one_plan_and_nothing_else_was_looked_at(tmp_path):
    record, trace, verdict, solution = run(tmp_path, scenario(obstacles=driving(30, 100.0, 0.0, 15.0)))
    assert record["status"] == "no_conflict"
    assert objections(trace) == []
    assert mismatches(trace, solution, 0.1) == []
    assert [set(plan) for plan in trace["tracks"][0]["plans"]] == [{"t", "states"}]
    assert verdict is not None


def test_where_nothing_is_found_there_is_a_trace_and_no_verdict(tmp_path):
    record, trace, verdict, solution = run(tmp_path, situation("wall", 18.0, 6.0), "mitigation.wanted=true")
    assert record["status"] == "unavoidable"
    assert (verdict, solution) == (None, None)
    assert "solutionFingerprint" not in trace
    assert objections(trace) == []
    assert mismatches(trace, None, 0.1) == []
    (plan,) = trace["tracks"][0]["plans"]
    assert {k["feasible"] for k in plan["candidates"]} == {False}
    assert [k["reason"] for k in plan["candidates"] if k["repair"]["kind"] == "mitigation"] == [
        "infeasible_collision"
    ]
    assert trace["repair"]["bound"]["t_bound_s"] == 0.0


def test_a_repair_from_the_start_on_is_the_only_plan(tmp_path):
    text = scenario(
        obstacles=driving(30, 20.0 + 4.4 + 5.2, 0.0, 0.0), road=lanelet(1, range(0, 401, 20), [0.0] * 21)
    )
    record, trace, _, solution = run(tmp_path, text, "repair.lateral=none", backend="shooting")
    assert (record["status"], record["f_ttr_s"]) == ("found", 0.0)
    (plan,) = trace["tracks"][0]["plans"]
    assert plan["states"] == trace["tracks"][0]["driven"]
    kinds = [k["repair"]["kind"] for k in plan["candidates"]]
    assert kinds[-1] == "reference"
    assert plan["candidates"][-1]["reason"] == "infeasible_collision"
    assert objections(trace) == []
    assert mismatches(trace, solution, 0.1) == []


def test_from_memory_it_is_of_the_scenario_that_is_written(slow, tmp_path):
    source = tmp_path / "scenario.xml"
    source.write_text(scenario(obstacles=SLOW), encoding="utf-8")
    known = repair.load_scene(source)
    scene = repair.scene_from_scenario(known.scenario, known.planning_problem)
    result = repair.repair(scene, overrides=["reference.source=constant"])
    record = result.saved(tmp_path / "out", figure=False, trace=True)[0].record
    trace = json.loads((tmp_path / "out" / record["trace_file"]).read_text("utf-8"))
    written = (tmp_path / "out" / record["scenario_file"]).read_bytes()
    assert trace["scenarioFingerprint"] == fingerprint(written)


def test_a_result_with_a_trace_is_certified_and_read_back(tmp_path):
    record, _, _, _ = run(tmp_path, scenario(obstacles=SLOW))
    certificate = certify(tmp_path / "out")
    assert certificate.ok, [row for row in certificate.rows if not row.ok]
    assert repair.load_result(tmp_path / "out").record == record


def test_a_run_without_a_trace_leaves_none_of_an_earlier_one(tmp_path):
    out = tmp_path / "out"
    argv = ["run", "scenario_1", "--out", str(out), "--no-figure", "--quiet"]
    assert main([*argv, "--trace"]) == 0
    assert {p.suffixes[-2] for p in out.glob("*.json") if len(p.suffixes) > 1} >= {
        ".planning-trace",
        ".verdict",
    }
    assert main(argv) == 0
    assert list(out.glob("*.planning-trace.json")) == list(out.glob("*.verdict.json")) == []


def test_without_a_folder_it_is_refused(capsys):
    assert main(["run", "scenario_1", "--trace"]) == 2
    assert "--out DIR" in capsys.readouterr().err


@pytest.mark.parametrize(
    "damage",
    [
        lambda t: t.update(schema="drawtonomy-planning-trace-v2"),
        lambda t: t.update(frame="rear"),
        lambda t: t.update(solutionFingerprint="sha256:"),
        lambda t: t["tracks"].clear(),
        lambda t: t["tracks"][0].update(name="ego"),
        lambda t: t["tracks"][0]["vehicle"].update(width=0.0),
        lambda t: t["tracks"][0]["driven"].reverse(),
        lambda t: t["tracks"][0]["driven"][3].pop("x"),
        lambda t: t["tracks"][0]["plans"].append(t["tracks"][0]["plans"][0]),
        lambda t: t["tracks"][0]["plans"][1]["states"].pop(0),
        lambda t: t["tracks"][0]["plans"][0]["candidates"][0].update(feasible=1),
        lambda t: t["tracks"][0]["plans"][0]["candidates"][0].update(reason=""),
        lambda t: t["tracks"][0]["plans"][0]["candidates"][0].update(states=[]),
    ],
)  # fmt: skip
def test_what_looks_at_the_structure_sees_what_is_wrong(slow, damage):
    trace = deepcopy(slow[1])
    damage(trace)
    assert objections(trace)


def test_what_compares_with_the_solution_sees_what_is_wrong(slow):
    _, trace, _, solution = slow
    moved = deepcopy(trace)
    moved["tracks"][0]["driven"][5]["y"] += 1e-5
    assert mismatches(moved, solution, 0.1) == ["driven"]
    moved = deepcopy(trace)
    moved["tracks"][0]["plans"][1]["states"][0]["x"] += 1e-5
    assert mismatches(moved, solution, 0.1) == ["plan 1"]


@given(st.text(alphabet="a \r\n<ä"))
def test_a_name_is_that_of_the_text_whatever_ends_its_lines(text):
    lines = text.replace("\r\n", "\n").replace("\r", "\n")
    name = fingerprint(lines.encode())
    assert re.fullmatch("sha256:[0-9a-f]{64}", name)
    assert fingerprint(b"\xef\xbb\xbf" + lines.replace("\n", "\r\n").encode()) == name
    assert fingerprint(lines.replace("\n", "\r").encode()) == name
    assert fingerprint(lines.encode() + b" ") != name


def test_what_is_no_text_has_no_name():
    assert fingerprint(b"\xff\xfe<") is None
