"""After the evasive part: back to the reference, on to the goal; and what is said if not."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from commonroad.common.solution import CommonRoadSolutionWriter
from commonroad.planning.planning_problem import PlanningProblemSet
from tests.judge import judged
from tests.roads import car, driving, problem, scenario, state

import repair
from repair.cli.command import main
from repair.io.official import check_solution_file
from repair.onward.goal import GoalState, misses
from repair.onward.leg import leg_from_dict, leg_to_dict


def crosses(until: int, there: float = 60.0, meet: float = 2.5) -> str:
    """A car that crosses the ego's lane at ``meet``, predicted until a step."""
    states = [state(there, 3.0 * (0.1 * k - meet), k=k, heading=np.pi / 2, v=3.0,
                    tag="state" if k else "initialState") for k in range(until + 1)]  # fmt: skip
    return car(40, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>")


def goal(first: int, last: int, *, x: float | None = None, speed: tuple[float, float] | None = None) -> str:
    """A goal state: steps, a rectangle on the lane around x, an interval of speeds."""
    text = ""
    if x is not None:
        shape = f"<length>20</length><width>3</width><center><x>{x}</x><y>0.0</y></center>"
        text += f"<position><rectangle>{shape}</rectangle></position>"
    text += f"<time><intervalStart>{first}</intervalStart><intervalEnd>{last}</intervalEnd></time>"
    if speed is not None:
        low, high = speed
        text += f"<velocity><intervalStart>{low}</intervalStart><intervalEnd>{high}</intervalEnd></velocity>"
    return f"<goalState>{text}</goalState>"


@pytest.fixture
def write(tmp_path: Path):
    """Write a situation into a file: an ego at 12 m/s, somebody who crosses, a goal."""

    def written(wanted: str, obstacles: str | None = None, steps: int = 95) -> Path:
        file = tmp_path / f"{len(list(tmp_path.iterdir()))}.xml"
        others = crosses(steps) if obstacles is None else obstacles
        wanted = problem(100, state(20.0, 0.0, v=12.0), wanted)
        file.write_text(scenario(obstacles=others, problems=wanted), encoding="utf-8")
        return file

    return written


def answer(file: Path, backend: str = "qptr", *keys: str) -> repair.RepairResult:
    return repair.repair(file, backend=backend, overrides=["reference.source=constant", *keys])


def official(result: repair.RepairResult, folder: Path):
    file = folder / "solution.xml"
    file.write_bytes(CommonRoadSolutionWriter(result.to_solution()).dump().encode())
    scene = result.prepared.scene
    return check_solution_file(file, scene.official(), PlanningProblemSet([scene.planning_problem]))


@pytest.mark.thinned(3)
@pytest.mark.parametrize("backend", ["casadi", "qptr"])
@pytest.mark.parametrize(
    "wanted",
    [
        goal(85, 95, x=85.0),
        goal(80, 90, x=80.0, speed=(3.0, 5.0)),
        goal(75, 75, speed=(0.0, 1.0)),
        goal(110, 120, x=130.0),  # beyond what is predicted
    ],
)
def test_the_goal_is_reached_and_all_of_it_is_valid(write, tmp_path, backend: str, wanted: str) -> None:
    file = write(wanted)
    plain, result = answer(file, backend), answer(file, backend, "repair.goal=true")
    assert result.f_ttr == plain.f_ttr
    assert not official(plain, tmp_path).goal
    assert official(result, tmp_path).valid
    assert judged(result, file) == math.inf
    onward = result.to_dict()["onward"]
    assert onward["reached"]
    assert onward["from_s"] >= result.f_ttr
    assert result.states.t[-1] == pytest.approx(onward["until_s"])
    assert len(result.to_dict()["trajectory"]["t_s"]) == len(result.states)


def test_who_reaches_it_anyway_drives_nothing_more(write) -> None:
    plain = answer(write(goal(10, 90, x=45.0)))
    result = answer(write(goal(10, 90, x=45.0)), "qptr", "repair.goal=true")
    assert result.onward.reached
    assert result.onward.leg is None
    assert np.array_equal(result.states.x, plain.states.x)


def test_without_a_conflict_the_reference_goes_on(write, tmp_path) -> None:
    file = write(goal(55, 60, x=60.0), driving(41, 200.0, 0.0, 12.0, range(1, 41)))
    plain, result = answer(file), answer(file, "qptr", "repair.goal=true")
    assert result.status is repair.SearchStatus.NO_CONFLICT
    assert not official(plain, tmp_path).goal
    assert official(result, tmp_path).valid


def test_what_is_missed_is_said(write) -> None:
    """The goal is 200 m ahead, and there are four seconds."""
    result = answer(write(goal(35, 40, x=250.0), steps=60), "qptr", "repair.goal=true")
    onward = result.to_dict()["onward"]
    assert not onward["reached"]
    assert [one["condition"] for one in onward["missed"]] == ["position"]
    k = round(onward["missed"][0]["t_s"] / 0.1)
    assert 35 <= k <= 40
    assert onward["missed"][0]["by_m"] == pytest.approx(240.0 - result.states.x[k], abs=0.01)
    assert "the goal is not reached: missed are position by" in onward["sentence"]


def test_misses_are_those_of_the_step_that_comes_closest() -> None:
    import shapely

    wanted = GoalState(2, 3, shapely.box(10.0, -1.0, 20.0, 1.0), (0.0, 5.0), (-0.2, 0.2))
    places = np.column_stack([np.arange(5) * 3.0, np.zeros(5)])
    found = misses(wanted, places, np.full(5, 7.0), np.full(5, 0.5), 0.1)
    assert {m.condition: (round(m.by, 6), m.unit, round(m.time, 6)) for m in found} == {
        "position": (1.0, "m", 0.3),
        "velocity": (2.0, "m/s", 0.3),
        "orientation": (0.3, "rad", 0.3),
    }
    assert misses(wanted, np.add(places, (6.0, 0.0)), np.full(5, 4.0), np.full(5, 2 * np.pi), 0.1) == ()


@pytest.mark.parametrize("backend", ["casadi", "qptr"])
def test_back_to_the_reference(write, backend: str) -> None:
    file = write(goal(94, 95))
    plain, result = answer(file, backend), answer(file, backend, "repair.rejoin=true")
    assert result.f_ttr == plain.f_ttr
    assert result.onward.kind == "rejoin"
    assert result.onward.reached
    leg = result.onward.leg
    assert leg.t_start == pytest.approx(result.prepared.t_end)
    assert len(result.states) > len(plain.states)
    assert np.allclose(result.states.x[: len(plain.states)], plain.states.x)
    end, there = (c.sample([leg.t_end]) for c in (result.curve, result.prepared.reference))
    assert end.position[0, 1] == pytest.approx(there.position[0, 1], abs=1e-6)
    if result.onward.how != "path":
        assert end.velocity[0, 0] == pytest.approx(there.velocity[0, 0], abs=1e-6)
    assert np.abs(leg.sample(np.linspace(leg.t_start, leg.t_end, 50)).acceleration[5:]).max() <= 2.5 + 1e-6
    assert judged(result, file) == math.inf


def test_no_room_is_said(write) -> None:
    result = answer(write(goal(30, 40), steps=45), "qptr", "repair.rejoin=true")
    assert not result.onward.reached
    assert "no room" in result.to_dict()["onward"]["sentence"]


def test_a_leg_can_be_read_back(write) -> None:
    leg = answer(write(goal(85, 95, x=85.0)), "qptr", "repair.goal=true").onward.leg
    times = np.linspace(leg.t_start, leg.t_end + 1.0, 30)
    again = leg_from_dict(json.loads(json.dumps(leg_to_dict(leg))))
    assert np.allclose(again.sample(times).position, leg.sample(times).position, atol=1e-9)


def test_the_command_writes_what_certify_confirms(write, tmp_path: Path, capsys) -> None:
    file, out = write(goal(85, 95, x=85.0)), tmp_path / "out"
    assert (
        main(
            ["run", str(file), "--reference", "constant", "--backend", "qptr", "--to-goal", "--out", str(out)]
        )
        == 0
    )
    assert "reaches the goal at" in capsys.readouterr().out
    assert main(["certify", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "goal_reached" in shown
    content = json.loads((out / "result.json").read_text(encoding="utf-8"))
    content["onward"]["leg"]["speed_mps"] += 0.1
    (out / "result.json").write_text(json.dumps(content), encoding="utf-8")
    assert main(["certify", str(out)]) == 1
