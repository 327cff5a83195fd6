"""Own references where the scenario's steps are long: the vehicle has one input for each of them."""

from __future__ import annotations

import numpy as np
import pytest
from commonroad.common.solution import CommonRoadSolutionWriter
from tests import driven, roads
from tests.driven import Case

from repair.api import repair
from repair.check.conflict import detect_conflict
from repair.config.load import load_config
from repair.preparation import prepare
from repair.scene.commonroad import load_scene

SOURCES = ("constant", "accelerate", "planner")


def verdict_of(scenario, source: str) -> set[str]:
    config = load_config(overrides=[f"reference.source={source}"])
    made = prepare(load_scene(scenario, config), config)
    _, verdict = detect_conflict(made.reference, made.boxes, made.checker, made.t_reference)
    return set(verdict.reasons)


def scenario_of(folder, road: str, dt: float, speed: float, beside: float = 0.0):
    line = driven.centre_line(road)
    heading = float(np.arctan2(*(line[41] - line[39])[::-1]))
    place = line[40] + beside * np.array([-np.sin(heading), np.cos(heading)])
    path = folder / "scenario.xml"
    path.write_text(driven.scenario_text(Case(road, dt=dt), (*place, heading, speed), 8.0), encoding="utf-8")
    return path


@pytest.mark.thinned(3)
@pytest.mark.parametrize("dt", [0.5, 1.0])
@pytest.mark.parametrize("road", driven.ROADS)
def test_own_references_are_drivable(tmp_path, road, dt):
    for speed in (0.0, 3.0, 12.0):
        scenario = scenario_of(tmp_path, road, dt, speed)
        for source in SOURCES:
            assert verdict_of(scenario, source) == set(), (speed, source)


@pytest.mark.thinned(3)
@pytest.mark.parametrize("dt", [0.5, 1.0])
def test_the_way_onto_the_route_takes_steps_too(tmp_path, dt):
    for speed in (3.0, 8.0, 15.0):
        scenario = scenario_of(tmp_path, "straight", dt, speed, beside=0.5)
        for source in SOURCES:
            assert verdict_of(scenario, source) == set(), (speed, source)


@pytest.mark.filterwarnings("ignore")  # of the checker, about NumPy and SciPy
@pytest.mark.parametrize("source", SOURCES)
def test_what_is_written_is_accepted(tmp_path, source):
    scenario = scenario_of(tmp_path, "curved", 1.0, 8.0)
    result = repair(scenario, overrides=[f"reference.source={source}"])
    file = tmp_path / "solution.xml"
    file.write_text(CommonRoadSolutionWriter(result.to_solution()).dump(), encoding="utf-8")
    assert driven.official(scenario, file)


def test_contact_of_a_ramp_that_ends_within_a_step(tmp_path):
    """12 m/s, 1 m/s² until 13.9 m/s, towards a car at 3 m/s: against the closed form of the ramp."""
    states = "".join(roads.state(60.0 + 3.0 * k, 0.0, k=k, v=3.0, tag="state") for k in range(1, 9))
    car = roads.car(30, roads.state(60.0, 0.0, v=3.0), f"<trajectory>{states}</trajectory>")
    scenario = tmp_path / "scenario.xml"
    problem = roads.problem(start=roads.state(20.0, 0.0, v=12.0))
    scenario.write_text(roads.scenario(obstacles=car, problems=problem, dt=1.0), encoding="utf-8")
    result = repair(scenario, overrides=["reference.source=accelerate"])
    vehicle = result.prepared.scene.vehicle
    room = 40.0 - 2.25 - vehicle.half_length
    ramp = 12.0 * 1.9 + 0.5 * 1.9**2
    exact = 1.9 + (room + 3.0 * 1.9 - ramp) / (13.9 - 3.0)
    assert result.prepared.conflict.kind == "margin"
    assert result.prepared.conflict.contact_time == pytest.approx(exact, abs=0.01)
    assert result.ttc == np.floor(exact)  # the scenario's step before
