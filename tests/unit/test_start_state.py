"""What is written starts where the planning problem says, by CommonRoad's own word."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.scenario.state import KSState, PMState
from commonroad_dc.feasibility.solution_checker import starts_at_correct_state
from tests import driven

from repair.api import repair
from repair.errors import ScenarioError
from repair.scene.start import initial_state_of

FULL = 2.0 * np.pi


@pytest.mark.thinned(3)
@pytest.mark.filterwarnings("ignore")  # of the checker, about NumPy
@pytest.mark.parametrize("speed", [0.0, 0.005, 0.3, 8.0])
@pytest.mark.parametrize("heading", [0.0, 1.6, 3.1, np.pi, -np.pi, -3.1, 6.28, -6.28, 4.0, -5.0])
def test_the_first_state_is_the_planning_problems(tmp_path, heading, speed):
    line = driven.centre_line("ring")
    at = round(heading / FULL * (len(line) - 1)) % (len(line) - 1)  # where the ring goes that way
    at = min(max(at, 5), len(line) - 20)  # away from the seam of the lanelets
    tangent = np.arctan2(*(line[at + 1] - line[at - 1])[::-1])
    given = heading + (tangent - heading + np.pi) % FULL - np.pi
    given = float(np.clip(given, -FULL, FULL))
    scenario = tmp_path / "scenario.xml"
    case = driven.Case("ring")
    scenario.write_text(driven.scenario_text(case, (*line[at], given, speed)), encoding="utf-8")
    result = repair(scenario, overrides=["reference.source=constant"])
    _, problems = CommonRoadFileReader(str(scenario)).open()
    solution = result.to_solution()
    assert starts_at_correct_state(solution, problems)
    states = solution.planning_problem_solutions[0].trajectory.state_list
    assert abs(states[0].orientation - given) < 0.02
    turned = [abs(b.orientation - a.orientation) for a, b in pairwise(states)]
    assert all(abs(state.orientation) <= FULL for state in states)
    assert sum(turn > 3.0 for turn in turned) <= 1  # a whole turn where the range that is allowed ends


@pytest.mark.parametrize("heading, speed", [(0.0, 5.0), (1.5, 8.0), (-2.8, 0.3)])
def test_a_point_mass_says_its_speed_along_both_axes(heading, speed):
    along, across = speed * np.cos(heading), speed * np.sin(heading)
    read = initial_state_of(
        PMState(time_step=0, position=np.array([1.0, 2.0]), velocity=along, velocity_y=across)
    )
    assert (read.velocity, read.orientation) == pytest.approx((speed, heading))


PLACE = np.array([1.0, 2.0])


@pytest.mark.parametrize(
    "state, words",
    [
        (PMState(time_step=0, position=PLACE, velocity=0.0, velocity_y=0.0), "no orientation"),
        (KSState(time_step=0, position=np.zeros(1), orientation=0.0, velocity=1.0), "it is x, y"),
        (KSState(time_step=0, position=PLACE, orientation="north", velocity=1.0), "'north', which is no"),
        (KSState(time_step=0, position=PLACE, orientation=0.0, velocity=np.ones(2)), "which is no number"),
    ],
    ids=["standing point mass", "one number", "word", "two speeds"],
)
def test_a_start_that_cannot_be_read_is_a_sentence(state, words):
    with pytest.raises(ScenarioError, match=words):
        initial_state_of(state)
