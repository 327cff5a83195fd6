"""Files that break naive code: each gives the right scene, or one sentence that names the file."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.roads import ROAD, SLOW, car, driving, exact, lanelet, point, problem, scenario, state

from repair.api import RepairResult, repair, search
from repair.config import load_config
from repair.errors import ConfigError, OutputError, ReferenceTrajectoryError, RepairError, ScenarioError
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.scene.scene import Scene
from repair.search.result import SearchStatus
from repair.solvers.registry import make_backend

CONFIG = load_config()


def outcome(scene: Scene) -> RepairResult:
    return search(prepare(scene, CONFIG), make_backend("ego", CONFIG))


@pytest.fixture
def load(tmp_path: Path) -> Any:
    def load(text: str | bytes, **keys: Any) -> Scene:
        path = tmp_path / "trap.xml"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_scene(path, **keys)

    return load


@pytest.fixture
def refused(load: Any) -> Any:
    def refused(text: str | bytes, sentence: str) -> None:
        with pytest.raises(ScenarioError, match=sentence) as caught:
            load(text)
        assert "trap.xml" in str(caught.value)
        assert "\n" not in str(caught.value)

    return refused


# -- the files of TRAPS.tsv ------------------------------------------------------------------------


@pytest.fixture
def trap(scenarios: Path) -> Any:
    folder = scenarios.parent / "traps"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    return lambda name, **keys: load_scene(folder / name, **keys)


def roles(scene: Scene) -> list[tuple[int, str]]:
    return [(o.id, o.role) for o in scene.obstacles]


def starts_along(scene: Scene) -> None:
    """The driven path begins at the ego's pose (but for the slip angle in a bend)."""
    s0 = scene.start[0, 0]
    off = float(scene.frame.heading(s0)) - scene.initial_state.orientation
    assert abs((off + np.pi) % (2 * np.pi) - np.pi) < 0.3
    np.testing.assert_allclose(
        scene.frame.position(s0), [scene.initial_state.x, scene.initial_state.y], atol=0.01
    )


def test_set_based_pedestrian_and_a_copy_of_the_ego(trap: Any) -> None:
    scene = trap("OSC_PedestrianCollision-1_1_T-38.xml")
    assert roles(scene) == [(35, "set_based")]  # 34 has the planning problem's id: the ego itself
    assert any("34" in note for note in scene.notes)
    assert scene.horizon == pytest.approx(1.8)
    assert np.isfinite(scene.obstacles[0].vertices[:-1]).all()  # its own prediction ends a step earlier
    assert outcome(scene).status is SearchStatus.NO_CONFLICT


def test_set_based_obstacle_beside_a_copy_of_the_ego(trap: Any) -> None:
    scene = trap("ZAM_Urban-7_1_S-2.xml")
    assert scene.dt == 0.25
    assert scene.recorded_ego is not None
    assert scene.recorded_ego.id == 100
    assert roles(scene) == [(99, "set_based")]
    assert outcome(scene).ttc > 0.0


def test_sets_over_intervals(trap: Any) -> None:
    scene = trap("USA_US101-1_2_S-1.xml")
    assert [role for _, role in roles(scene)] == ["set_based", "set_based"]
    assert (scene.n_steps, scene.goal_s) == (10, None)
    assert all(np.isfinite(o.vertices).all() for o in scene.obstacles)
    assert outcome(scene).status is SearchStatus.NO_CONFLICT


def test_problem_with_the_id_of_a_static_obstacle(trap: Any) -> None:
    scene = trap("DEU_Crit-1_1_T-1.xml")
    assert scene.recorded_ego is not None
    assert (scene.recorded_ego.id, scene.planning_problem_id, scene.id) == (9, 8, "DEU_Test-1_1_T-1")
    assert roles(scene) == [(8, "static")]
    result = outcome(scene)
    assert result.status is SearchStatus.FOUND
    assert result.search.conflict.obstacle_id == 8


def test_problem_without_a_goal(trap: Any) -> None:
    scene = trap("ZAM_Zip-2_1_T-1.xml")
    assert scene.goal_s is None
    assert outcome(scene).search.conflict.obstacle_id == 1


@pytest.mark.parametrize("name", ["ZAM_Urban-3_3_Repair.xml", "ZAM_Zip-2_1_T-1.xml"])
def test_prediction_from_the_initial_step_on_is_not_late(trap: Any, name: str) -> None:
    scene = trap(name)
    moving = [o for o in (*scene.obstacles, scene.recorded_ego) if o is not None and o.role == "dynamic"]
    assert moving
    for obstacle in moving:
        assert obstacle.late == 1  # the drivability checker is, and is therefore asked as well
        recorded = scene.scenario.obstacle_by_id(obstacle.id)
        for k in (0, 1, 5, 20):
            np.testing.assert_allclose(obstacle.states[k, :2], recorded.state_at_time(k).position)


def test_recorded_ego_is_no_obstacle(trap: Any) -> None:
    scene = trap("ZAM_Urban-3_3_Repair.xml")
    assert scene.recorded_ego is not None
    assert scene.recorded_ego.id == 8
    result = outcome(scene)
    assert result.status is SearchStatus.FOUND
    assert result.ttc > 1.0


def test_start_off_all_lanelets(trap: Any) -> None:
    with pytest.raises(ScenarioError, match=r"DEU_TestIntersectionInteract-3_1_T-1\.xml.*nearest lanelet"):
        trap("DEU_TestIntersectionInteract-3_1_T-1.xml")


def test_unreachable_goal_goes_straight_on(trap: Any) -> None:
    scene = trap("DEU_Muc-2_1_T-1.xml")
    assert any("goal cannot be reached" in note for note in scene.notes)
    assert (200, "static") in roles(scene)
    assert scene.horizon == pytest.approx(3.0)
    starts_along(scene)
    assert outcome(scene).search.conflict.obstacle_id == 200


@pytest.mark.parametrize(
    "name", ["DEU_Lohmar-19_1_T-1.xml", "ARG_Carcarana-10_1_T-1.xml", "DEU_Backnang-3_3_T-1.xml"]
)
def test_route_leaves_in_the_direction_of_the_ego(trap: Any, name: str) -> None:
    scene = trap(name)
    starts_along(scene)
    lanelets = {v.lanelet_id: v for v in scene.scenario.lanelet_network.lanelets}
    center = lanelets[scene.route_lanelets[0]].center_vertices
    nearest = np.argmin(np.hypot(*(center - [scene.initial_state.x, scene.initial_state.y]).T))
    step = center[min(nearest + 1, len(center) - 1)] - center[min(nearest, len(center) - 2)]
    heading = np.array([np.cos(scene.initial_state.orientation), np.sin(scene.initial_state.orientation)])
    assert step @ heading / np.hypot(*step) > np.cos(np.deg2rad(60.0))
    assert np.isfinite(scene.frame.heading_table).all()


def test_touching_at_the_start(trap: Any) -> None:
    result = outcome(trap("ITA_CarpiCentro-1_1_T-1.xml"))
    assert result.status is SearchStatus.ALREADY_COLLIDING
    assert result.search.conflict.contact_id == 340


def test_two_planning_problems(trap: Any) -> None:
    scene = trap("C-DEU_B471-1_1_T-1.xml")
    assert (scene.planning_problem_id, scene.id) == (800, "C-DEU_B471-1_1_T-1")
    assert any("800 is used" in note for note in scene.notes)
    assert trap("C-DEU_B471-1_1_T-1.xml", planning_problem=801).planning_problem_id == 801
    with pytest.raises(ScenarioError, match=r"no planning problem 7; there is 800, 801"):
        trap("C-DEU_B471-1_1_T-1.xml", planning_problem=7)


def test_road_that_ends(trap: Any) -> None:
    scene = trap("DEU_TestRIN1-3_1_T-1.xml")
    assert scene.route_end_s - scene.start[0, 0] == pytest.approx(40.0, abs=1.0)
    assert any("road ends" in note for note in scene.notes)
    assert outcome(scene).search.conflict.kind == "off_road"


def test_old_format(trap: Any) -> None:
    scene = trap("DEU_Gar-1_1_T-1.xml")
    assert len(scene.obstacles) == 4
    assert scene.horizon == pytest.approx(2.0)
    assert outcome(scene).status is SearchStatus.FOUND


def test_nothing_moves(trap: Any) -> None:
    scene = trap("ZAM_Over-1_1.xml")
    assert roles(scene) == [(1402, "static")]
    assert scene.horizon > 1.0
    assert outcome(scene).search.conflict.obstacle_id == 1402


# -- traps that no file has ------------------------------------------------------------------------


def test_the_file_that_the_others_are_made_of(load: Any) -> None:
    result = outcome(load(scenario()))
    assert result.status is SearchStatus.FOUND
    assert result.search.conflict.obstacle_id == 30


def test_large_file(tmp_path: Path) -> None:
    path = tmp_path / "large.xml"
    with path.open("wb") as file:
        file.truncate(200_000_001)  # sparse: nothing is written
    with pytest.raises(ScenarioError, match=r"large\.xml has 200 MB; at most 200 MB"):
        load_scene(path)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.999])
def test_truncated(refused: Any, share: float) -> None:
    text = scenario()
    refused(text[: int(len(text) * share)], "is not XML")


@pytest.mark.parametrize(
    "prolog",
    [
        '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE x SYSTEM "http://127.0.0.1:9/x.dtd">',
        '<!DOCTYPE x [<!ENTITY % p SYSTEM "file:///dev/zero"> %p;]>',
    ],
    ids=["bomb", "external", "external DTD", "parameter"],
)
def test_entities(refused: Any, prolog: str) -> None:
    refused(scenario(prolog=prolog), "DOCTYPE")


def test_encodings(load: Any, refused: Any) -> None:
    text = scenario()
    assert load(text.replace("UTF-8", "utf-16").encode("utf-16")).n_steps == 40
    refused(text.replace("UTF-8", "no-such-code"), "unknown encoding")
    refused(text.encode().replace(b"ZAM", b"\xff\xfe"), "is not XML")
    refused(b"\x00" * 100, "is not XML")


@pytest.mark.parametrize("dt", ["0", "-0.1", "nan", "inf", "1e-9", "1e9", "", "0,1", "1e-320"])
def test_time_step(refused: Any, dt: str) -> None:
    refused(scenario(dt=dt), "time step")


@pytest.mark.parametrize(
    "where, number",
    [
        (where, number)
        for where in ("lanelet", "ego", "heading", "speed", "obstacle", "prediction", "size")
        for number in ("nan", "inf", "-inf", "1e308", "1e30")
        if where != "heading" or not number.startswith("1e")  # any finite angle is one
    ],
)
def test_numbers_that_are_none(refused: Any, where: str, number: str) -> None:
    moved = f"<trajectory>{state(number, 0.0, k=1, tag='state')}</trajectory>"
    parts: dict[str, dict[str, str]] = {
        "lanelet": {"road": lanelet(1, [0, number, 400], [0.0] * 3)},
        "ego": {"problems": problem(start=state(number, 0.0))},
        "heading": {"problems": problem(start=state(20.0, 0.0, heading=number))},
        "speed": {"problems": problem(start=state(20.0, 0.0, v=number))},
        "obstacle": {"obstacles": car(30, state(number, 0.0))},
        "prediction": {"obstacles": SLOW + car(31, state(9.0, 0.0), moved)},
        "size": {"obstacles": car(30, state(45.0, 0.0), shape=f"<circle><radius>{number}</radius></circle>")},
    }  # fmt: skip
    refused(scenario(**parts[where]), ".")


@pytest.mark.parametrize("size", ["0", "-4.5"])
def test_size_that_is_none(refused: Any, size: str) -> None:
    shape = f"<rectangle><length>{size}</length><width>1.8</width></rectangle>"
    refused(scenario(obstacles=car(30, state(45.0, 0.0), shape=shape)), "obstacle 30: its size")


@pytest.mark.parametrize("missing", ["position", "orientation", "velocity", "time"])
def test_initial_states_that_lack_something(refused: Any, missing: str) -> None:
    """commonroad-io itself would go on with zeros: the ego at the origin, facing east, standing."""
    lacking = state(20.0, 0.0, leave=[missing])
    refused(scenario(problems=problem(start=lacking)), f"planningProblem 100 has no {missing}")
    if missing != "velocity":
        refused(scenario(obstacles=car(30, lacking)), f"dynamicObstacle 30 has no {missing}")


def test_an_obstacle_need_not_say_how_fast_it_starts(load: Any) -> None:
    """The XSD of 2020a has it optional for obstacles; where they are is what counts."""
    silent = SLOW.replace("<velocity><exact>2.0</exact></velocity>", "", 1)
    assert silent != SLOW
    told, untold = load(scenario()), load(scenario(obstacles=silent))
    np.testing.assert_array_equal(told.obstacles[0].rectangles, untold.obstacles[0].rectangles)


def test_missing_yaw_in_a_prediction_is_the_direction_of_motion(load: Any) -> None:
    across = "".join(
        state(60.0, -8.0 + k, k=k, tag="state", leave=["orientation", "acceleration"]) for k in range(1, 21)
    )
    scene = load(
        scenario(obstacles=car(30, state(60.0, -8.0, heading=1.5708), f"<trajectory>{across}</trajectory>"))
    )
    np.testing.assert_allclose(scene.obstacles[0].rectangles[:, 2], np.pi / 2, atol=1e-3)


def test_speed_of_a_state_across_the_axes(load: Any) -> None:
    """commonroad-io derives a lateral speed that is along the y axis, not across the body."""
    across = "".join(state(60.0, -8.0 + k, k=k, heading=1.5708, tag="state") for k in range(1, 9))
    start = state(60.0, -8.0, heading=1.5708)
    scene = load(scenario(obstacles=car(30, start, f"<trajectory>{across}</trajectory>")))
    np.testing.assert_allclose(scene.obstacles[0].states[:, 3], 10.0)


def test_uncertain_position_takes_the_larger_occupancy(load: Any) -> None:
    size = "<length>3</length><width>1</width><orientation>0</orientation>"
    area = f"<rectangle>{size}<center>{point(60, 0)[7:-8]}</center></rectangle>"
    states = "".join(state(0, 0, k=k, position=area, tag="state") for k in range(1, 11))
    scene = load(scenario(obstacles=car(30, state(60.0, 0.0), f"<trajectory>{states}</trajectory>")))
    np.testing.assert_allclose(scene.obstacles[0].rectangles[1:, 3:], [[2.25 + 1.5, 0.9 + 0.5]] * 10)


def test_uncertain_heading_and_speed(load: Any) -> None:
    def interval(tag: str, low: float, high: float) -> str:
        return f"<{tag}><intervalStart>{low}</intervalStart><intervalEnd>{high}</intervalEnd></{tag}>"

    text = scenario()
    text = text.replace(exact("velocity", 2.0), interval("velocity", 1.0, 3.0))
    text = text.replace(exact("orientation", 0.0), interval("orientation", -0.1, 0.1))
    scene = load(text)
    assert (scene.obstacles[0].rectangles[:, 4] > 0.95).all()
    np.testing.assert_allclose(scene.obstacles[0].states[:, 3], 2.0)
    assert outcome(scene).search.conflict.obstacle_id == 30


def test_obstacle_without_prediction_stands(load: Any) -> None:
    scene = load(scenario(obstacles=car(30, state(60.0, 0.0))))
    assert "obstacle 30 has no prediction and is taken to stand still" in scene.notes
    assert outcome(scene).search.conflict.obstacle_id == 30


def test_negative_time_steps(load: Any, refused: Any) -> None:
    refused(scenario(problems=problem(start=state(20.0, 0.0, k=-2))), "time step -2")
    refused(scenario(obstacles=driving(30, 45.0, 0.0, 2.0, range(-3, 9))), ".")
    shape = "<shape><circle><radius>1</radius><center><x>60</x><y>0</y></center></circle></shape>"
    past = "".join(f"<occupancy>{shape}{exact('time', k)}</occupancy>" for k in range(-3, 6))
    scene = load(scenario(obstacles=car(30, state(60.0, 0.0, k=-4), f"<occupancySet>{past}</occupancySet>")))
    assert np.isfinite(scene.obstacles[0].vertices).all()


def test_occupancy_over_an_endless_interval(load: Any) -> None:
    time = "<time><intervalStart>1</intervalStart><intervalEnd>1000000000</intervalEnd></time>"
    shape = "<shape><circle><radius>1</radius><center><x>60</x><y>0</y></center></circle></shape>"
    forever = f"<occupancySet><occupancy>{shape}{time}</occupancy></occupancySet>"
    for after in ("remove", "hold", "constant_velocity"):
        scene = load(scenario(obstacles=car(30, state(60.0, 0.0), forever)), after_prediction=after)
        assert scene.horizon == 10.0
        assert np.isfinite(scene.obstacles[0].vertices).all()


def test_time_steps_without_end(load: Any, refused: Any) -> None:
    endless = "9" * 400  # an integer for Python, and none for any float
    refused(
        scenario(
            obstacles=car(
                30, state(60.0, 0.0, k=endless), f"<trajectory>{state(60, 0, k=1, tag='state')}</trajectory>"
            )
        ),
        "time step",
    )
    refused(scenario(problems=problem(start=state(20.0, 0.0, k=endless))), "time step")
    time = f"<time><intervalStart>1</intervalStart><intervalEnd>{endless}</intervalEnd></time>"
    scene = load(scenario(obstacles="", problems=problem(goal=f"<goalState>{time}</goalState>")))
    assert scene.horizon == 10.0


def test_uncertain_initial_time_step(refused: Any) -> None:
    uncertain = SLOW.replace(
        exact("time", 0), "<time><intervalStart>0</intervalStart><intervalEnd>2</intervalEnd></time>"
    )
    refused(scenario(obstacles=uncertain), "obstacle 30: the time step of its initial state")


@pytest.mark.parametrize("size", ["nan", "1e200"])
def test_goal_region_that_is_none(refused: Any, size: str) -> None:
    area = f"<rectangle><length>{size}</length><width>4</width><center><x>90</x><y>0</y></center></rectangle>"
    time = "<time><intervalStart>1</intervalStart><intervalEnd>40</intervalEnd></time>"
    goal = f"<goalState><position>{area}</position>{time}</goalState>"
    refused(scenario(problems=problem(goal=goal)), "goal region|cannot read")


def test_long_time_step(load: Any) -> None:
    assert load(scenario(obstacles="", dt=10, problems=problem(goal=""))).n_steps == 1


@pytest.mark.parametrize("steps", [[1, 2, 5, 6], [3, 4, 5], [1, 2, 2, 3], [3, 2, 1]])
def test_holes_in_a_prediction(refused: Any, steps: list[int]) -> None:
    refused(scenario(obstacles=driving(30, 45.0, 0.0, 2.0, steps)), "obstacle 30: its prediction|cannot read")


def test_prediction_that_ended_long_ago(load: Any) -> None:
    late = problem(start=state(20.0, 0.0, k=10**8))
    for after in ("remove", "hold", "constant_velocity"):
        scene = load(scenario(obstacles=driving(30, 45.0, 0.0, 0.0), problems=late), after_prediction=after)
        assert len(scene.obstacles) == (after != "remove")
        assert after != "remove" or any("never there" in note for note in scene.notes)


def test_zero_length_and_duplicate_points(load: Any) -> None:
    plain = load(scenario())
    dot = lanelet(7, [80] * 5, [30.0] * 5)
    doubled = lanelet(1, [x for x in range(0, 401, 20) for _ in range(3)], [0.0] * 63)
    scene = load(scenario(road=doubled + dot))
    assert "lanelet 7 has no length and is ignored" in scene.notes
    np.testing.assert_allclose(scene.start, plain.start)
    np.testing.assert_allclose(scene.obstacles[0].vertices, plain.obstacles[0].vertices)
    assert outcome(scene).f_ttr == outcome(plain).f_ttr


def test_exchanged_bounds_are_named(load: Any) -> None:
    along, there, back = range(0, 401, 20), [3.5] * 21, [7.0] * 21
    proper = lanelet(1, along, [0.0] * 21) + lanelet(2, along[::-1], back, width=-3.5)
    said = "lanelet {} is drawn with left and right bound exchanged; the checker may see no road there"
    notes = load(scenario(road=proper + lanelet(3, along, there))).notes
    assert not any("exchanged" in note for note in notes)
    assert said.format(3) in load(scenario(road=proper + lanelet(3, along, there, width=-3.5))).notes


def test_no_usable_lanelet(refused: Any) -> None:
    refused(scenario(road=lanelet(7, [80] * 5, [0.0] * 5)), "no lanelet that could be driven on")
    refused(scenario(road=""), "no lanelet|cannot read")


def test_goal_out_of_reach(load: Any) -> None:
    beside = lanelet(2, [0, 50], [90.0, 90.0])
    time = "<time><intervalStart>1</intervalStart><intervalEnd>40</intervalEnd></time>"
    goal = f'<goalState><position><lanelet ref="2"/></position>{time}</goalState>'
    scene = load(scenario(road=ROAD + beside, problems=problem(goal=goal)))
    assert any("goal cannot be reached" in note for note in scene.notes)
    assert outcome(scene).status is SearchStatus.FOUND


def test_problems_none_one_and_two(load: Any, refused: Any) -> None:
    refused(scenario(problems=""), "no planning problem")
    twins = problem(100) + problem(7, state(10.0, 0.5))
    assert load(scenario(problems=twins)).planning_problem_id == 7
    assert load(scenario(problems=twins), planning_problem=100).initial_state.x == 20.0
    refused(scenario(problems=problem(100) * 2), "cannot read")


@pytest.mark.parametrize("speed", [-3.0, 101.0, 1e5])
def test_speed_that_cannot_be(refused: Any, speed: float) -> None:
    refused(scenario(problems=problem(start=state(20.0, 0.0, v=speed))), "initial speed")


def test_unknown_elements_are_noted(load: Any) -> None:
    scene = load(
        scenario(obstacles=SLOW + SLOW.replace("dynamicObstacle", "movingObstacle").replace("30", "31"))
    )
    assert "elements that are not CommonRoad's are ignored: movingObstacle" in scene.notes


# -- other input -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> RepairResult:
    path = tmp_path_factory.mktemp("road") / "road.xml"
    path.write_text(scenario(), encoding="utf-8")
    return repair(path, CONFIG)


def test_solution_files(found: RepairResult, tmp_path: Path) -> None:
    written = found.save(tmp_path / "out", figure=False)
    good = next(p for p in written if p.suffix == ".xml").read_text(encoding="utf-8")
    bomb = good.replace("<CommonRoadSolution", '<!DOCTYPE x [<!ENTITY a "b">]><CommonRoadSolution', 1)
    holes = re.sub(r"<x>[\d.]+</x>", "<x>nan</x>", good, count=3)
    bad = {
        "other.xml": (good.replace("ZAM_Test-1_1_T-1", "ZAM_Test-2_1_T-1"), "ZAM_Test-2_1_T-1, not for"),
        "task.xml": (good.replace('planningProblem="100"', 'planningProblem="7"'), "planning problem 100"),
        "cut.xml": (good[: len(good) // 2], "not a CommonRoad solution file"),
        "road.xml": (scenario(), "not a CommonRoad solution file"),
        "bomb.xml": (bomb, "DOCTYPE"),
        "nothing.xml": ("", "is empty"),
        "far.xml": (re.sub(r"<x>[\d.]+</x>", "<x>5000</x>", good), "4980 m from the ego"),
        "nan.xml": (holes, "at time step 0 position is not finite"),
    }  # fmt: skip
    for name, (text, sentence) in bad.items():
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        config = load_config(overrides={"reference.source": "file", "reference.file": str(path)})
        with pytest.raises(ReferenceTrajectoryError, match=sentence):
            prepare(found.prepared.scene, config)
    large = tmp_path / "large.xml"
    with large.open("wb") as file:
        file.truncate(200_000_001)
    for path in (large, tmp_path, tmp_path / "not there.xml"):
        config = load_config(overrides={"reference.source": "file", "reference.file": str(path)})
        with pytest.raises(ReferenceTrajectoryError, match=path.name):
            prepare(found.prepared.scene, config)


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("search: 3", "'search'"),
        ("search: {delta_t: [1]}", "'search.delta_t'"),
        ("- 1", "mapping"),
        ("search: {delt: 1}", "'search.delt'"),
        ("scene: {vehicle: [1]}", "'scene.vehicle'"),
        ("scene: {vehicle: {car: 1}}", "'scene.vehicle'"),
        ("scene: {vehicle: }", "'scene.vehicle'"),
        ("search: {delta_t: .nan}", "'search.delta_t'"),
        ("a: ${", "."),
        ("repair: {relax: [[1]]}", "'repair.relax'"),
        ("repair: {relax: [.nan]}", "'repair.relax'"),
        ("reference: {source: 7}", "'reference.source'"),
        ("\x00", "cannot be read"),
        ("[" * 3000, "cannot be read"),
    ],
)
def test_configuration_of_the_wrong_type(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "settings.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=sentence):
        load_config(file=path)


@pytest.mark.parametrize("vehicle", ["car", "FORD", "0", "9", "-1", "''"])
def test_a_vehicle_that_nobody_knows(load: Any, vehicle: str) -> None:
    """Any word may be the name of a vehicle that is registered; this one is not."""
    config = load_config(overrides=[f"scene.vehicle={vehicle}"])
    with pytest.raises(ConfigError, match=r"vehicle.*FORD_ESCORT"):
        load(scenario(), config=config)


def test_settings_that_do_not_fit_the_scenario(found: RepairResult) -> None:
    with pytest.raises(ConfigError, match=r"repair\.horizon is 0\.5 s, but the conflict is at"):
        prepare(found.prepared.scene, load_config(overrides=["repair.horizon=0.5"]))
    with pytest.raises(ConfigError, match=r"reference\.speed_step"):
        prepare(
            found.prepared.scene,
            load_config(overrides=["reference.speed_step=0.02", "reference.time_step=0.1"]),
        )


def test_output_folder_below_a_file(found: RepairResult, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    for folder in (tmp_path / "file", tmp_path / "file" / "deep" / "er"):
        with pytest.raises(OutputError, match="file"):
            found.save(folder, figure=False)
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize("survivors", [0, 1])
def test_full_disk(
    found: RepairResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, survivors: int
) -> None:
    folder = tmp_path / "out"
    before = {p.name: p.read_bytes() for p in found.save(folder, figure=False)}
    left = survivors

    def fsync(_: int) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fsync)
    for where in (folder, tmp_path / "new" / "folder"):
        left = survivors
        with pytest.raises(OutputError, match="No space left"):
            found.save(where, figure=False)
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
    assert not (tmp_path / "new").exists()


def test_every_refusal_is_a_repair_error() -> None:
    for kind in (ScenarioError, ConfigError, OutputError, ReferenceTrajectoryError):
        assert issubclass(kind, RepairError)
