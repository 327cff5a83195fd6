"""Whole drives: Scenario 1, and its variation in which the crossing car stops; the command."""

from __future__ import annotations

import csv
import json
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image
from shapely import affinity

from repair.backend.base import SolveResult, SolveStatus
from repair.cli import main
from repair.errors import ConfigError
from repair.paper.synthetic import write_scenario
from repair.scene.commonroad import load_scene
from repair.scene.scene import InitialState
from repair.scene.traffic.obstacle import Traffic
from repair.search.rules import around
from repair.simulate.carried import Carried
from repair.simulate.eyes import Eyes
from repair.simulate.many.case import Case, case_at, plan_on, simulation_config
from repair.simulate.many.task import drive_of, run_drive
from repair.simulate.world import displaced


@pytest.fixture(scope="module")
def cases(tmp_path_factory) -> dict[str, Case]:
    """Both scenarios, as generated; cycles of 0.1 s."""
    folder, made = tmp_path_factory.mktemp("loop"), {}
    config = simulation_config(overrides=["reference.source=planner"])
    for name in ("scenario_1", "scenario_1_stops"):
        scene = load_scene(write_scenario(name, folder), config)
        made[name] = case_at(plan_on(scene, config), config, 0.0)
    return made


def touched(case: Case, driven) -> list[int]:
    """Whom the ego's rectangle meets at a step, by polygons of the test's own."""
    vehicle, found = case.plan.scene.vehicle, []
    box = shapely.box(-vehicle.half_length, -vehicle.half_width, vehicle.half_length, vehicle.half_width)
    for k, (x, y, yaw) in enumerate(
        zip(*(driven.states[name] for name in ("x", "y", "orientation")), strict=True)
    ):
        own = affinity.translate(affinity.rotate(box, yaw, origin=(0, 0), use_radians=True), x, y)
        for one in case.world.obstacles:
            corners = one.vertices[k]
            if np.isfinite(corners).all() and own.intersects(shapely.Polygon(corners)):
                found.append(one.id)
    return found


def test_a_car_that_stops_is_waited_for(cases):
    case = cases["scenario_1_stops"]
    assert case.never.struck is None
    waits = case.drive("constant_velocity", "f_ttr")
    assert any(cycle.ttc < 3.0 for cycle in waits.cycles)  # for a while it looks as if
    assert {cycle.mode for cycle in waits.cycles} == {"plan"}
    assert waits.states["x"] == pytest.approx(waits.states["plan_x"], abs=1e-6)
    acts = case.drive("constant_velocity", "at_once")
    assert "repair" in {cycle.mode for cycle in acts.cycles}
    assert not touched(case, acts)


def test_a_car_that_crosses_is_avoided_from_the_f_ttr_on(cases):
    case = cases["scenario_1"]
    assert case.never.struck.obstacle_id == 36
    driven = case.drive("recorded", "f_ttr")
    waited = [cycle for cycle in driven.cycles if cycle.mode == "plan" and cycle.ttc < 9.0]
    acts = next(k for k, cycle in enumerate(driven.cycles) if cycle.mode != "plan")
    assert driven.cycles[acts].mode == "repair"
    known = [cycle for cycle in waited if cycle.complete]  # before, the search is carried on
    assert known[0].t < 0.5
    assert driven.cycles[acts].t == pytest.approx(known[0].t + known[0].f_ttr, abs=0.1 + 1e-9)
    falls = np.diff([cycle.f_ttr for cycle in known])
    assert np.abs(falls + 0.1).max() < 0.1 + 1e-9  # it runs down with the clock
    assert driven.struck is None
    assert not touched(case, driven)
    before = round(driven.cycles[acts].t / 0.1)
    assert driven.states["x"][:before] == pytest.approx(driven.states["plan_x"][:before], abs=1e-6)


def test_the_oracle_looks_to_the_end_of_the_record_and_nobody_else(cases):
    case = cases["scenario_1"]
    record = case.world.n_steps
    assert record * case.world.dt > 5.0 + 1e-9
    ahead = {
        name: case.grounds(name).beliefs.ahead(0) for name in ("recorded", "constant_velocity", "delayed")
    }
    assert ahead == {"recorded": record, "constant_velocity": 50, "delayed": 50}
    config = replace(case.config, simulate=replace(case.config.simulate, lookahead=3.0))
    asked = Case(case.plan, case.world, config, case.never)
    assert {asked.grounds(name).beliefs.ahead(0) for name in ahead} == {30}


def test_a_gentle_repair_is_gentle(cases):
    driven = cases["scenario_1"].drive("recorded", "graded")
    assert driven.struck is None
    braked = -np.diff(driven.states["speed"]).min() / 0.1
    assert braked < cases["scenario_1"].config.simulate.gentle[0] + 0.1


@pytest.mark.parametrize("doubt, sure", [(0.0, True), (0.05, True), (20.0, False)])
def test_a_contact_is_sure_that_is_there_ahead_and_behind(cases, doubt, sure):
    case, start = cases["scenario_1"], cases["scenario_1"].plan.scene.initial_state
    config = replace(case.config, simulate=replace(case.config.simulate, doubt=doubt))
    grounds = replace(case.grounds("recorded"), config=config)
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    sight = Eyes(grounds).sight(case.curve, ego, 0)
    assert sight.alarming("contact")
    assert sight.sure() is sure


def test_who_is_met_is_who_a_whole_look_finds(cases):
    seen = set()
    for case in cases.values():
        watch, prepared = case.plan.hard.twin(), case.plan.prepared
        start, scene = prepared.scene.initial_state, prepared.scene
        ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
        for error in (-40.0, -4.0, -0.5, 0.0, 0.5, 4.0, 40.0):
            traffic = Traffic(displaced(scene.obstacles, error, scene.dt), scene.n_steps)
            looked = watch.look(prepared.reference, traffic=traffic, ego=ego)
            met = watch.meets(prepared.reference, traffic=traffic, ego=ego)
            assert met == (looked.conflict.contact_time < np.inf)
            seen.add(met)
    assert seen == {True, False}


def test_a_curve_is_looked_at_where_it_is(cases):
    case = cases["scenario_1"]
    watch, prepared = case.plan.hard.twin(), case.plan.prepared
    start, scene = prepared.scene.initial_state, prepared.scene
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    traffic = Traffic(scene.obstacles, scene.n_steps)
    looked = watch.look(prepared.reference, traffic=traffic, ego=ego)
    assert looked.conflict.time == prepared.conflict.time
    first = watch.answer(looked, visits=(0.0,))
    assert first.f_ttr == 0.0
    assert not first.kept
    found = watch.answer(looked)
    again = watch.answer(looked, enough=0.5)
    assert again.kept
    assert again.f_ttr == found.f_ttr
    assert not watch.twin().answer(looked).kept
    with pytest.raises(ConfigError, match="multiple of the step"):
        watch.look(prepared.reference, traffic=traffic, ego=ego, now=0.03)


@pytest.mark.parametrize("solves", [1, 2, 5])
def test_a_search_that_is_carried_on_ends_where_one_in_one_go_does(cases, solves):
    case = cases["scenario_1"]
    start = case.plan.scene.initial_state
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    watch, other = case.plan.hard.twin(), case.plan.hard.twin()
    traffic = Traffic(case.plan.scene.obstacles, case.plan.scene.n_steps)
    whole = watch.answer(watch.look(case.curve, traffic=traffic, ego=ego), enough=0.1)
    assert whole.complete
    assert whole.solves > solves
    found, cycles, spent = None, 0, []
    while found is None or not found.complete:
        looked = other.look(case.curve, traffic=traffic, ego=ego)
        found = other.answer(looked, enough=0.1, solves=solves)
        assert 0.1 <= found.f_ttr <= whole.f_ttr
        spent.append(found.solves)
        cycles += 1
        assert cycles < 40
    assert cycles > 1
    assert found.f_ttr == whole.f_ttr
    assert max(spent) <= solves + 6  # of a place that is begun all sides are tried, and one place more


class Asked:
    """A backend that says where it was asked, and finds nothing from some time-to-repair on."""

    def __init__(self, backend, shut: float):
        self.backend, self.shut, self.places = backend, shut, []

    def __getattr__(self, name):
        return getattr(self.backend, name)

    def solve(self, problem, **keys):
        self.places.append(round(problem.t_rep, 6))
        if problem.t_rep > self.shut:
            return SolveResult(SolveStatus.INFEASIBLE)
        return self.backend.solve(problem, **keys)


@pytest.mark.parametrize("rule, goes_round", [("guided", True), ("scan", False)])
def test_after_a_cycle_with_nothing_the_search_goes_round(cases, rule, goes_round):
    """What serves the decision is asked in every cycle, and the rest of what is searched in several."""
    case, solves = cases["scenario_1"], 3
    watch = case.plan.hard.twin()
    watch.config = replace(watch.config, search=replace(watch.config.search, rule=rule))
    watch._backend = asked = Asked(watch._backend, -1.0)
    start = case.plan.scene.initial_state
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    traffic = Traffic(case.plan.scene.obstacles, case.plan.scene.n_steps)

    def cycle(refused=()):
        asked.places.clear()
        looked = watch.look(case.curve, traffic=traffic, ego=ego)
        looked.refused.update(refused)
        return watch.answer(looked, enough=0.2, solves=solves), list(asked.places)

    first, whole = cycle()
    assert first.curve is None
    assert first.complete
    assert len(whole) > solves + 2
    later, others = [cycle() for _ in range(2 * len(whole) if goes_round else 2)], []
    for found, places in later:
        assert found.curve is None
        if not goes_round:
            assert places == whole
            continue
        assert not found.complete
        assert list(dict.fromkeys(places))[:2] == [0.2, 0.0]
        assert len(places) < len(whole)
        others += [place for place in dict.fromkeys(places) if place not in (0.2, 0.0)]
    if not goes_round:
        return
    last, downwards = round(10.0 * whole[0]), []
    order = around(last, -1, last + 1)
    k = next(order)
    while k > 2:
        downwards.append(pytest.approx(0.1 * k))
        k = order.send(False)
    assert others[: 2 * len(downwards)] == 2 * downwards
    assert 0.0 not in cycle(refused=(0.0,))[1][:2]
    while watch._nothing.above < whole[0]:  # else the rest of the round is all that is looked at
        cycle()
    asked.shut = np.inf  # a repair that can be waited for is found first, and the round goes on
    found, places = cycle()
    assert found.f_ttr == pytest.approx(0.2)
    assert set(places) == {0.2}
    assert not found.complete
    while not found.complete:
        found, _ = cycle()
    looked = watch.look(case.curve, traffic=traffic, ego=ego)
    assert found.f_ttr == case.plan.hard.twin().answer(looked, enough=0.2).f_ttr


def test_where_nothing_to_wait_on_is_left_of_a_search_it_is_made_anew(cases):
    case = cases["scenario_1"]
    watch = case.plan.hard.twin()
    watch._backend = asked = Asked(watch._backend, 1.4 + 1e-9)
    start = case.plan.scene.initial_state
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    traffic = Traffic(case.plan.scene.obstacles, case.plan.scene.n_steps)
    for _ in range(9):
        found = watch.answer(watch.look(case.curve, traffic=traffic, ego=ego), enough=1.4, solves=1)
        assert found.f_ttr == pytest.approx(1.4)
        if watch._carried.above < 1.55:
            break
    assert not found.complete
    asked.shut = np.inf  # from now on there are repairs where nothing was found before
    found = watch.answer(watch.look(case.curve, traffic=traffic, ego=ego), enough=1.6, solves=1)
    assert found.f_ttr >= 1.6 - 1e-9


def test_nobody_is_asked_again_where_nothing_was_found_among_the_same(cases):
    case = cases["scenario_1"]
    start = case.plan.scene.initial_state
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    traffic = Traffic(case.plan.scene.obstacles, case.plan.scene.n_steps)
    watch, other = case.plan.hard.twin(), case.plan.hard.twin()
    watch._backend, other._backend = (Asked(watch._backend, -1.0) for _ in range(2))
    looked = watch.look(case.curve, traffic=traffic, ego=ego)
    assert watch.answer(looked, visits=(0.0,)).curve is None
    at_once = list(watch._backend.places)
    assert set(at_once) == {0.0}
    found, whole = watch.answer(looked), other.answer(other.look(case.curve, traffic=traffic, ego=ego))
    assert (found.curve, found.complete, found.solves) == (None, True, whole.solves)
    assert watch._backend.places[len(at_once) :] == [t for t in other._backend.places if t > 0.0]
    count = len(watch._backend.places)
    assert watch.answer(looked, visits=(0.0, *other._backend.places)).curve is None
    assert len(watch._backend.places) == count
    again = watch.look(case.curve, traffic=traffic, ego=ego)
    assert watch.answer(again, visits=(0.0,)).curve is None
    assert len(watch._backend.places) == count + len(at_once)


def test_what_one_member_refuses_another_may_have_found(cases):
    case = cases["scenario_1"]
    start = case.plan.scene.initial_state
    ego = InitialState(start.x, start.y, start.orientation, start.velocity, 0.0, 0.0)
    watch = case.plan.hard.twin()
    backend = watch._backend
    members = {"one": Asked(backend, -1.0), "other": Asked(backend, 0.0)}
    watch._backend = Asked(backend, -1.0)
    watch._backend.capabilities = replace(backend.capabilities, members=lambda: members)
    watch._nothing = Carried(0.0, np.inf, 0.1, False)
    traffic = Traffic(case.plan.scene.obstacles, case.plan.scene.n_steps)
    looked = watch.look(case.curve, traffic=traffic, ego=ego)
    assert watch.answer(looked, visits=(0.0,)).f_ttr == 0.0
    assert watch.answer(looked, enough=0.2, solves=1).f_ttr == 0.0


def test_each_drive_looks_for_itself(cases):
    """Its cycle times hold all that it uses: nobody finds boxes that another one has paid for."""
    case = cases["scenario_1"]
    first, second = (
        Eyes(case.grounds("recorded")).sight(case.curve, case.plan.scene.initial_state, 0) for _ in range(2)
    )
    assert first.cycle.f_ttr > 0.0
    assert first.looked.prepared.boxes.known
    assert not second.looked.prepared.boxes.known
    assert first.eyes.grounds.beliefs is not second.eyes.grounds.beliefs


def test_the_road_is_laid_out_once_for_all_drives(cases):
    plan = cases["scenario_1"].plan
    edges = {
        id(watch.twin().look(cases["scenario_1"].curve, traffic=Traffic((), 30), ego=plan.scene.initial_state)
           .prepared.checker.edge)
        for watch in (plan.hard, *plan.gentle)
    }  # fmt: skip
    assert edges == {id(plan.prepared.checker.edge)}


class Here:
    """Drives are made in this process, by the code that a process of their own would run."""

    name, most = "here", 1e9

    def __init__(self, count, work):
        assert work is run_drive

    def now(self):
        return [self]

    def close(self):
        pass

    def give(self, task):
        row, whole = drive_of(task)
        answer = Future()
        answer.set_result((row, whole))
        return answer

    def ready(self):
        return True


def told(capsys, *arguments: str) -> tuple[int, str]:
    status = main(list(arguments))
    return status, capsys.readouterr().err


def test_the_command_writes_rows_once_and_films_them(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("repair.study.engine.LocalLanes", Here)
    out = tmp_path / "out"
    given = ("simulate", "scenario_1_stops", "--reference", "planner", "--out", str(out))
    keys = ("--set", "simulate.period=0.5", "simulate.lookahead=3")
    assert main([*given, "--policy", "never", "f_ttr", "--shift", "8", "9.5", *keys]) == 0
    text = capsys.readouterr().out
    assert "| constant_velocity | f_ttr | 1 | 0 of 0 |" in text
    with (out / "simulation.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["driven", "driven", "not_driven", "not_driven"]
    assert {row["detail"] for row in rows[2:]} == {"there is less than 1 s to drive"}
    assert json.loads((out / "simulation.json").read_text())["constant_velocity, f_ttr"]["drives"] == 1
    assert "never" in (out / "report.html").read_text("utf-8")
    assert told(capsys, *given, "--policy", "never", *keys)[0] == 2
    monkeypatch.setattr("repair.simulate.many.task.case_at", lambda *_: pytest.fail("it is there"))
    assert main([*given, "--policy", "never", "--shift", "8", *keys, "--resume"]) == 0
    (out / "report.html").unlink()
    assert main(["report", str(out)]) == 0
    assert "never" in (out / "report.html").read_text("utf-8")
    filmed(out, capsys)


def filmed(out: Path, capsys) -> None:
    """The film of the only drive that is there, and what there is none of."""
    with (out / "simulation.csv").open(newline="") as file:
        name = next(csv.DictReader(file))["file"].removesuffix(".xml")
    assert main(["animate", str(out), "--policy", "never", "--file", name]) == 0
    assert "never: one of 1 that fit" in capsys.readouterr().out
    with Image.open(out / "animation.gif") as film:
        assert 15 < film.n_frames < 25
    status, error = told(capsys, "animate", str(out), "--policy", "f_ttr", "--shift", "3")
    assert status == 2
    assert "holds no drive with shift_s 3.0, policy f_ttr" in error


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["scenario_1", "--policy", "later"], "policy 'later' is unknown; there are f_ttr"),
        (["scenario_1", "--prediction", "later"], "prediction 'later' is unknown; there are recorded"),
        (["scenario_1", "--policy", "f_ttr", "f_ttr"], "names one of its policies twice"),
        (["scenario_1", "--reference", "later"], "reference 'later' is none of"),
        (["scenario_1", "--shift", "-1"], "the traffic begins -1 s later"),
        (["scenario_1", "--resume"], "name it with --out"),
        (["scenario_1", "--policy", "f_ttr", "--set", "simulate.ttc=1.0"], "simulate.ttc has no effect"),
        (["scenario_1", "--set", "simulate.trigger=smoke"], "it must be one of contact, margin"),
        (["scenario_1", "--set", "driver=at_ttr"], "driver=at_ttr has no effect in it"),
        (["scenario_1", "--set", "metrics=[ttb]"], "metrics has no effect in a simulation"),
        (["scenario_1", "--set", "repair.goal=true"], "repair.goal has no effect in a simulation"),
        (["nowhere.xml"], "nowhere.xml"),
    ],
)
def test_what_cannot_be_driven_is_said_in_a_sentence(arguments, words, capsys):
    status, error = told(capsys, "simulate", *arguments)
    assert status == 2
    assert words in error
    assert error.count("\n") == 1


def test_an_empty_folder_is_no_folder_of_scenarios(tmp_path: Path, capsys):
    assert told(capsys, "simulate", str(tmp_path)) == (
        2, f"repair: {tmp_path} is a folder without CommonRoad scenario files (*.xml)\n"
    )  # fmt: skip
