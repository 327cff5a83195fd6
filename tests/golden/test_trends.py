"""No number is tuned into the code: TTC and F-TTR of Scenario 1 move the way they must."""

from __future__ import annotations

import copy
import warnings
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from repair.api import RepairResult, repair
from repair.config import load_config
from repair.scene.commonroad import load_scene, scene_from_scenario
from repair.scene.scene import Scene


@pytest.fixture(scope="module", params=["official", "reconstruction"])
def scene(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    if request.param == "official":
        return load_scene(request.getfixturevalue("scenarios") / "DEU_Flensburg-6_1_T-1.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # protobuf's deprecations, on import
        from repair.paper.synthetic import write_scenario
    file: Path = write_scenario("scenario_1", tmp_path_factory.mktemp("scenario"))
    return load_scene(file)


def repaired(scene: Scene, backend: str = "ego", **keys: Any) -> RepairResult:
    """The search over the whole [0, TTC), on a grid of 0.1 s unless said otherwise."""
    overrides = {
        "search.upper": None,
        "search.delta_t": 0.1,
        **{k.replace("__", "."): v for k, v in keys.items()},
    }
    return repair(scene, load_config(preset="scenario_1", backend=backend, overrides=overrides))


def falling(values: list[float | None]) -> bool:
    """Never rising, and lower at the end; None (nothing feasible at all) is the lowest."""
    numbers = [-1.0 if v is None else v for v in values]
    return all(b <= a + 1e-9 for a, b in pairwise(numbers)) and numbers[-1] < numbers[0]


def with_speed(scene: Scene, speed: float) -> Scene:
    problem = copy.deepcopy(scene.planning_problem)
    problem.initial_state.velocity = speed
    return scene_from_scenario(scene.scenario, problem)


@pytest.mark.thinned(3)
@pytest.mark.parametrize(
    "backend, offsets",
    [
        # Both from half the vehicle's length on: the preset has the margin judged, soft backend or hard.
        ("casadi", (2.25, 3.0, 4.0, 5.0)),
        ("ego", (2.25, 3.0, 4.0, 5.0)),
    ],
)
def test_a_larger_s_offset_lowers_both(scene: Scene, backend: str, offsets: tuple[float, ...]) -> None:
    results = [repaired(scene, backend, scene__s_offset=offset) for offset in offsets]
    assert falling([r.ttc for r in results])
    assert falling([r.f_ttr for r in results])


@pytest.mark.thinned(3)
@pytest.mark.parametrize("reference", ["planner", "constant"])
def test_a_higher_initial_speed_lowers_both(scene: Scene, reference: str) -> None:
    results = [repaired(with_speed(scene, v), reference__source=reference) for v in (3.6, 4.2, 5.0, 6.0)]
    assert falling([r.ttc for r in results])
    assert falling([r.f_ttr for r in results])


@pytest.mark.parametrize("fine", [0.2, 0.1, 0.05])
def test_a_finer_grid_finds_no_less_and_less_than_one_step_more(scene: Scene, fine: float) -> None:
    coarse = 0.4
    low, high = (repaired(scene, search__delta_t=step).f_ttr for step in (coarse, fine))
    assert low is not None
    assert high is not None
    assert low - 1e-9 <= high < low + coarse - 1e-9


def test_stronger_brakes_never_lower_the_f_ttr(scene: Scene) -> None:
    found = []
    for limit in (2.0, 3.0, 8.0):
        keys = {
            "limits__a_min": -limit,
            "limits__a_max": limit,
            "limits__a_lat": limit,
            "limits__a_total": limit,
        }
        found.append(repaired(scene, "casadi", **keys).f_ttr)
    assert falling(found[::-1])
