"""From CommonRoad files and objects to scenes: routes, obstacles, bounds, and everything malformed."""

from __future__ import annotations

import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests import roads

from repair import load_result
from repair.api import repair
from repair.config import load_config
from repair.config.load import recorded_config
from repair.errors import ConfigError, RepairError, ScenarioError
from repair.preparation import prepare
from repair.scene.commonroad import load_scene, scene_from_scenario
from repair.scene.reading import read_file
from repair.scene.scene import Scene
from repair.scene.settings import LOADING, SceneConfig
from repair.scene.traffic.obstacles import last_predicted_step, obstacles_of
from repair.vehicle.parameters import load_vehicle

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # protobuf's deprecations, on import
    import commonroad.common.file_reader  # noqa: F401
    from commonroad.common.util import AngleInterval, Interval
    from commonroad.geometry.shape import Circle, Polygon, Rectangle, ShapeGroup
    from commonroad.planning.goal import GoalRegion
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.prediction.prediction import Occupancy, SetBasedPrediction, TrajectoryPrediction
    from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
    from commonroad.scenario.obstacle import (
        DynamicObstacle,
        EnvironmentObstacle,
        ObstacleType,
        PhantomObstacle,
        StaticObstacle,
    )
    from commonroad.scenario.scenario import Scenario, ScenarioID
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory

BODY = Rectangle(4.5, 1.8)


def lanelet(name: int, center: Any, width: float = 3.5, **kwargs: Any) -> Lanelet:
    line = np.asarray(center, dtype=np.float64)
    step = np.gradient(line, axis=0)
    normal = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
    half = width / 2.0 * normal
    return Lanelet(line + half, line, line - half, name, **kwargs)


def straight(x0: float, x1: float, y: float = 0.0) -> np.ndarray:
    return np.stack([np.linspace(x0, x1, 6), np.full(6, y)], axis=1)


def two_lanes() -> list[Lanelet]:
    """Two parallel lanes of 60 + 60 m: 1 -> 2 on the right, 3 -> 4 on the left; 5 comes the other way."""
    return [
        lanelet(1, straight(0, 60), successor=[2], adjacent_left=3, adjacent_left_same_direction=True),
        lanelet(2, straight(60, 120), predecessor=[1], adjacent_left=4, adjacent_left_same_direction=True),
        lanelet(3, straight(0, 60, 3.5), successor=[4], adjacent_right=1, adjacent_right_same_direction=True),
        lanelet(4, straight(60, 120, 3.5), predecessor=[3], adjacent_right=2,
                adjacent_right_same_direction=True),
        lanelet(5, straight(120, 0, 7.0)),
    ]  # fmt: skip


def state(x: float, y: float, *, k: int = 0, heading: Any = 0.0, v: float = 10.0) -> InitialState:
    return InitialState(
        time_step=k, position=np.array([x, y]), orientation=heading, velocity=v, acceleration=0.0,
        yaw_rate=0.0, slip_angle=0.0,
    )  # fmt: skip


def scenario_of(lanelets: list[Lanelet], obstacles: Any = (), dt: float = 0.1) -> Scenario:
    scenario = Scenario(dt, ScenarioID(country_id="ZAM", map_name="Test", map_id=1))
    scenario.add_objects(LaneletNetwork.create_from_lanelet_list(lanelets))
    for item in obstacles:
        scenario.add_objects(item)
    return scenario


def problem(
    start: InitialState, *, goal: Any = None, lanelets: Any = None, steps: int = 40
) -> PlanningProblem:
    fields = {"time_step": Interval(start.time_step + 1, start.time_step + steps)}
    if goal is not None:
        fields["position"] = goal
    return PlanningProblem(100, start, GoalRegion([CustomState(**fields)], lanelets))


def driving(name: int, x: float, y: float, v: float, *, first: int = 0, last: int = 20, shape: Any = BODY,
            gap: int = 1) -> DynamicObstacle:  # fmt: skip
    """Along x at constant speed; its trajectory starts ``gap`` steps after its initial state."""
    steps = range(first + gap, last + 1)
    states = [
        CustomState(
            time_step=k, position=np.array([x + v * 0.1 * (k - first), y]), orientation=0.0, velocity=v
        )
        for k in steps
    ]
    prediction = TrajectoryPrediction(Trajectory(first + gap, states), shape)
    return DynamicObstacle(name, ObstacleType.CAR, shape, state(x, y, k=first, v=v), prediction)


def scene(
    network: list[Lanelet],
    start: InitialState,
    obstacles: Any = (),
    *,
    goal: Any = None,
    lanelets: Any = None,
    steps: int = 40,
    **kwargs: Any,
) -> Scene:
    task = problem(start, goal=goal, lanelets=lanelets, steps=steps)
    return scene_from_scenario(scenario_of(network, obstacles), task, **kwargs)


# ---------------------------------------------------------------------- routes and the driven path


def test_path_starts_at_the_pose_and_joins_the_centre_line() -> None:
    made = scene(two_lanes(), state(10.0, 0.6, heading=0.05))
    s0 = made.start[0, 0]
    np.testing.assert_allclose(made.frame.position(s0), [10.0, 0.6], atol=1e-4)
    assert float(made.frame.heading(s0)) == pytest.approx(0.05, abs=2e-3)
    assert made.frame.position(s0 + 40.0)[1] == pytest.approx(0.0, abs=0.02)
    np.testing.assert_allclose(made.start, [[s0, 0.0], [10.0, 0.0], [0.0, 0.0]])
    assert s0 == pytest.approx(30.0, abs=0.5)
    assert np.max(np.abs(made.frame.curvature_table)) * 10.0**2 < 1.6


def test_lane_bounds_take_half_the_width_off() -> None:
    made = scene(two_lanes(), state(10.0, 0.0))
    s, half = made.start[0, 0] + 30.0, made.vehicle.width / 2.0
    for bounds, right, left in (
        (made.lane, -1.75, 1.75),
        (made.same_direction, -1.75, 5.25),
        (made.road, -1.75, 8.75),
    ):
        low, high = bounds.at(s)
        assert float(low) == pytest.approx(right + half, abs=0.02)
        assert float(high) == pytest.approx(left - half, abs=0.02)


def test_route_changes_lanes_to_the_goal() -> None:
    made = scene(two_lanes(), state(5.0, 0.0), goal=Rectangle(10.0, 3.0, np.array([100.0, 3.5]), 0.0))
    assert made.route_lanelets[0] == 1
    assert made.route_lanelets[-1] == 4
    assert made.goal_s == pytest.approx(made.start[0, 0] + 90.0, abs=1.0)
    assert made.frame.position(made.goal_s)[1] == pytest.approx(3.5, abs=0.05)
    assert any("lane change" in note for note in made.notes)


def test_goal_given_as_lanelets() -> None:
    lanes = two_lanes()
    made = scene(lanes, state(5.0, 0.0), goal=ShapeGroup([lanes[1].polygon]), lanelets={0: [2]})
    assert made.route_lanelets == (1, 2)
    assert made.goal_s == pytest.approx(made.start[0, 0] + 55.0, abs=0.5)


def test_unreachable_goal_goes_straight_on_and_says_so() -> None:
    made = scene(two_lanes(), state(90.0, 0.0), goal=Rectangle(4.0, 2.0, np.array([20.0, 7.0]), 0.0))
    assert any("cannot be reached" in note for note in made.notes)
    assert made.route_lanelets == (2,)
    assert any("road ends" in note for note in made.notes)
    assert made.route_end_s == pytest.approx(made.start[0, 0] + 30.0, abs=0.1)


def test_overlapping_start_lanelets_are_told_apart_by_heading() -> None:
    crossing = lanelet(9, np.stack([np.full(5, 10.0), np.linspace(-20, 20, 5)], axis=1))
    assert scene([*two_lanes(), crossing], state(10.0, 0.0)).route_lanelets[0] == 1
    assert scene([*two_lanes(), crossing], state(10.0, 0.0, heading=1.5)).route_lanelets == (9,)


def test_cyclic_graph_ends() -> None:
    phi = np.linspace(0.0, np.pi, 30)
    half = 10.0 * np.stack([np.cos(phi), np.sin(phi)], axis=1)
    ring = [
        lanelet(1, half, successor=[2], predecessor=[2]),
        lanelet(2, -half, successor=[1], predecessor=[1]),
    ]
    made = scene(ring, state(10.0, 0.0, v=3.0, heading=np.pi / 2))
    assert made.route_lanelets == (1, 2, 1)  # as often as the road that is wanted takes
    assert not any("ends" in note for note in made.notes)


def test_start_beside_the_road() -> None:
    made = scene(two_lanes(), state(20.0, -4.0))
    assert any("outside of every lanelet" in note for note in made.notes)
    with pytest.raises(ScenarioError, match="from the nearest lanelet"):
        scene(two_lanes(), state(20.0, -40.0))
    with pytest.raises(ScenarioError, match="degrees away"):
        scene(two_lanes()[:2], state(20.0, 0.0, heading=2.0))


@pytest.mark.parametrize("degrees", [-95.0, -60.0, -20.0, 20.0, 60.0, 95.0])
def test_start_across_the_lane_gives_a_drivable_path(degrees: float) -> None:
    made = scene(two_lanes()[:2], state(30.0, 0.3, heading=np.deg2rad(degrees), v=3.0))
    s0 = made.start[0, 0]
    np.testing.assert_allclose(made.frame.position(s0), [30.0, 0.3], atol=1e-3)
    assert float(made.frame.heading(s0)) == pytest.approx(np.deg2rad(degrees), abs=0.1)
    assert np.max(np.abs(made.frame.curvature_table)) < load_vehicle(1).largest_curvature()
    assert made.frame.position(made.frame.length)[1] == pytest.approx(0.0, abs=0.05)


def test_zero_length_lanelets_are_ignored_with_a_note() -> None:
    dead = Lanelet(np.array([[5.0, 1.0]] * 2), np.array([[5.0, 0.0]] * 2), np.array([[5.0, -1.0]] * 2), 77)
    made = scene([*two_lanes(), dead], state(10.0, 0.0))
    assert any("77" in note and "ignored" in note for note in made.notes)


# ---------------------------------------------------------------------- obstacles


def one(obstacle: Any, **kwargs: Any) -> Any:
    settings = {"first_step": 0, "n_steps": 10, **kwargs}
    made, _, _ = obstacles_of(scenario_of(two_lanes(), [obstacle]), **settings)
    return made[0]


@pytest.mark.parametrize("gap", [0, 1])
def test_trajectory_is_not_late_when_it_starts_with_the_initial_state(gap: int) -> None:
    made = one(driving(7, 20.0, 0.0, 5.0, gap=gap))
    np.testing.assert_allclose(made.rectangles[:, 0], 20.0 + 0.5 * np.arange(11))
    np.testing.assert_allclose(made.rectangles[:, 3:], [[2.25, 0.9]] * 11)
    np.testing.assert_allclose(made.states[:, 3], 5.0)
    assert (made.role, made.kind) == ("dynamic", "car")


def test_planning_may_start_later_or_before_zero() -> None:
    made = one(driving(7, 20.0, 0.0, 5.0, first=0), first_step=4)
    np.testing.assert_allclose(made.rectangles[:, 0], 22.0 + 0.5 * np.arange(11))
    made = one(driving(7, 20.0, 0.0, 5.0, first=3), first_step=-2)
    assert np.isnan(made.vertices[:5]).all()
    np.testing.assert_allclose(made.rectangles[5:, 0], 20.0 + 0.5 * np.arange(6))


@pytest.mark.parametrize(
    "after, expected",
    [("remove", [np.nan, np.nan]), ("hold", [23.0, 23.0]), ("constant_velocity", [23.5, 25.0])],
)
def test_after_the_prediction(after: str, expected: list[float]) -> None:
    made = one(driving(7, 20.0, 0.0, 5.0, last=6), after_prediction=after)
    np.testing.assert_allclose(made.rectangles[[7, 10], 0], expected)
    with pytest.raises(ConfigError, match="after_prediction"):
        one(driving(7, 20.0, 0.0, 5.0), after_prediction="vanish")


def test_outlines_are_dense_and_on_the_shape() -> None:
    made = one(driving(7, 20.0, 0.0, 5.0, shape=Rectangle(12.0, 2.5)))
    outline = made.vertices[0]
    gaps = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T)
    assert np.max(gaps) <= 2.0 + 1e-9
    np.testing.assert_allclose(np.ptp(outline, axis=0), [12.0, 2.5])


def test_shape_offsets_agree_with_commonroad() -> None:
    shapes = [
        Rectangle(4.0, 2.0, np.array([0.5, 0.2]), 0.3),
        Polygon(np.array([[-2.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-2.0, 1.0]])),
        Polygon(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [3.0, 4.0], [3.0, 1.0], [0.0, 1.0]])),
    ]
    for shape in shapes:
        where = state(20.0, 0.0, heading=0.7)
        obstacle = StaticObstacle(7, ObstacleType.UNKNOWN, shape, where)
        made, theirs = one(obstacle), obstacle.occupancy_at_time(0).shape.shapely_object
        import shapely
        from shapely import affinity

        parts = made.polygons[0] if made.polygons else (made.vertices[0],)
        ours = shapely.union_all([shapely.Polygon(p) for p in parts])
        turned = affinity.rotate(shape.shapely_object, 0.7, (0.0, 0.0), use_radians=True)
        meant = affinity.translate(turned, 20.0, 0.0)  # with the body; io turns it about its own centre
        assert ours.symmetric_difference(shapely.union(theirs, meant)).area < 1e-6
        assert made.role == "static"
        assert len(made.vertices) == 11


def test_circles_and_groups() -> None:
    made = one(driving(7, 20.0, 0.0, 5.0, shape=Circle(0.4)))
    np.testing.assert_allclose(made.circles[0], [20.0, 0.0, 0.4])
    middle = (made.vertices[0] + np.roll(made.vertices[0], -1, axis=0)) / 2.0
    assert np.min(np.hypot(*(middle - [20.0, 0.0]).T)) >= 0.4 - 1e-9
    group = ShapeGroup([Circle(0.5, np.array([30.0, 1.0])), Rectangle(2.0, 1.0, np.array([32.0, 1.0]))])
    occupied = SetBasedPrediction(0, [Occupancy(Interval(k, k + 1), group) for k in range(4)])
    made = one(DynamicObstacle(8, ObstacleType.PEDESTRIAN, Circle(0.6), state(30.0, 1.0), occupied))
    assert made.role == "set_based"
    assert [len(p) for p in made.polygons[:6]] == [2 if k else 3 for k in range(5)] + [0]
    assert np.isnan(made.vertices[5:]).all()


def test_uncertain_states_take_the_enclosing_rectangle() -> None:
    area = Rectangle(2.0, 1.0, np.array([20.0, 0.0]), 0.0)
    where = InitialState(
        time_step=0, position=area, orientation=AngleInterval(-0.1, 0.1), velocity=Interval(4.0, 6.0),
        acceleration=0.0, yaw_rate=0.0, slip_angle=0.0,
    )  # fmt: skip
    made = one(StaticObstacle(7, ObstacleType.CAR, BODY, where))
    rng = np.random.default_rng(0)
    body = np.array([[2.25, 0.9], [-2.25, 0.9], [-2.25, -0.9], [2.25, -0.9]])
    x, y, heading, length, width = made.rectangles[0]
    for _ in range(300):
        turn = rng.uniform(-0.1, 0.1)
        place = np.array([20.0, 0.0]) + rng.uniform(-1.0, 1.0, 2) * [1.0, 0.5]
        c, s = np.cos(turn), np.sin(turn)
        corners = body @ np.array([[c, s], [-s, c]]) + place - [x, y]
        assert heading == pytest.approx(0.0)
        assert np.all(np.abs(corners) <= np.array([length, width]) + 1e-9)
    assert width < 2.0


def test_missing_orientation_is_the_direction_of_motion() -> None:
    states = [
        SimpleNamespace(time_step=k, position=np.array([20.0, 1.0 * k]), velocity=10.0) for k in range(1, 11)
    ]
    obstacle = SimpleNamespace(
        obstacle_id=7, obstacle_type=None, obstacle_role="dynamic", obstacle_shape=BODY,
        initial_state=SimpleNamespace(time_step=0, position=np.array([20.0, 0.0])),
        prediction=SimpleNamespace(trajectory=SimpleNamespace(state_list=states), shape=BODY),
    )  # fmt: skip
    source = SimpleNamespace(static_obstacles=[], dynamic_obstacles=[obstacle], dt=0.1)
    made = obstacles_of(source, first_step=0, n_steps=10)[0][0]
    np.testing.assert_allclose(made.rectangles[:, 2], np.pi / 2)


def test_other_roles() -> None:
    parked = DynamicObstacle(7, ObstacleType.CAR, BODY, state(20.0, 0.0))
    phantom = PhantomObstacle(
        8, SetBasedPrediction(2, [Occupancy(2, Rectangle(2.0, 2.0, np.array([40.0, 0.0])))])
    )
    house = EnvironmentObstacle(
        9, ObstacleType.BUILDING, Polygon(np.array([[50.0, 5], [60, 5], [60, 9], [50, 9]]))
    )
    source = SimpleNamespace(
        static_obstacles=[],
        dynamic_obstacles=[parked],
        phantom_obstacle=[phantom],
        environment_obstacle=[house],
        dt=0.1,
    )
    made, _, notes = obstacles_of(source, first_step=0, n_steps=5)
    assert [o.role for o in made] == ["dynamic", "phantom", "environment"]
    assert "obstacle 7 has no prediction" in notes[0]
    assert np.isfinite(made[1].vertices).all(axis=(1, 2)).tolist() == [
        False,
        False,
        True,
        False,
        False,
        False,
    ]
    assert last_predicted_step(source) == 2


def test_the_recorded_ego_is_left_out() -> None:
    ego = driving(7, 10.2, 0.0, 10.0, gap=0)
    other = driving(8, 40.0, 0.0, 10.0)
    made = scene(two_lanes(), state(10.0, 0.0), [ego, other])
    assert [o.id for o in made.obstacles] == [8]
    assert made.recorded_ego is not None
    assert made.recorded_ego.id == 7
    assert made.horizon == pytest.approx(2.0)
    assert made.n_steps == 20


def test_horizon() -> None:
    assert scene(two_lanes(), state(10.0, 0.0), steps=33).horizon == pytest.approx(3.3)
    assert scene(two_lanes(), state(10.0, 0.0), horizon=1.0).n_steps == 10
    assert scene(
        two_lanes(), state(10.0, 0.0), [driving(8, 40.0, 0.0, 5.0, last=300)]
    ).horizon == pytest.approx(10.0)
    with pytest.raises(ConfigError, match="horizon"):
        scene(two_lanes(), state(10.0, 0.0), horizon=-1.0)


def test_obstacle_with_nan_is_named() -> None:
    bad = driving(8, 40.0, 0.0, 5.0)
    bad.prediction.trajectory.state_list[3].position = np.array([np.nan, 0.0])
    with pytest.raises(ScenarioError, match="obstacle 8"):
        scene(two_lanes(), state(10.0, 0.0), [bad])


# ---------------------------------------------------------------------- settings

#: What a scene may be loaded with, each another value than by default.
OTHERS = {
    "vehicle": 2, "planning_problem": 7, "horizon": 1.5, "after_prediction": "hold", "smoothing": 0.3,
}  # fmt: skip
FIXED = {"reference.source": "constant", "repair.lateral": "none"}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A straight road with a slower car ahead, and two planning problems."""
    path = tmp_path / "ZAM_Test-1_1_T-1.xml"
    problems = roads.problem(100) + roads.problem(7, roads.state(10.0, 0.0))
    path.write_text(roads.scenario(problems=problems), encoding="utf-8")
    return path


def test_every_key_of_the_loading_is_tried_here() -> None:
    assert set(OTHERS) == set(LOADING)


@pytest.mark.parametrize("name", LOADING)
def test_a_scene_that_was_loaded_otherwise_is_refused(name: str, file: Path) -> None:
    other = OTHERS[name]
    if name == "planning_problem":
        other = 100  # 7 is the smallest: by default it is that one
    made = load_scene(file)
    config = load_config(overrides={f"scene.{name}": other})
    for ask in (prepare, repair):
        with pytest.raises(ConfigError, match=rf"scene\.{name}=.* asks for {other}; load it with the config"):
            ask(made, config)
    assert prepare(load_scene(file, config), config).config == config
    loaded = load_scene(file, **{name: other})
    usual = getattr(SceneConfig(), name)
    with pytest.raises(ConfigError, match=rf"scene\.{name}={other}, and .* asks for {usual}"):
        prepare(loaded, load_config(overrides={f"scene.{name}": usual}))  # the default, but on purpose


@pytest.mark.parametrize("name", LOADING)
def test_the_same_value_on_purpose_is_fine(name: str, file: Path) -> None:
    made = load_scene(file, **{name: OTHERS[name]})
    config = load_config(overrides={f"scene.{name}": OTHERS[name]})
    assert prepare(made, config).config == config
    usual = getattr(SceneConfig(), name)
    assert prepare(load_scene(file), load_config(overrides={f"scene.{name}": usual})).config == load_config()


def test_the_problem_that_is_taken_by_default_may_be_named(file: Path) -> None:
    config = load_config(overrides=["scene.planning_problem=7"])
    prepared = prepare(load_scene(file), config)
    assert prepared.scene.planning_problem_id == 7
    with pytest.raises(ConfigError, match="asks for 100"):
        prepare(load_scene(file), load_config(overrides=["scene.planning_problem=100"]))


def test_a_value_from_a_file_of_settings_is_asked_for_too(file: Path, tmp_path: Path) -> None:
    settings = tmp_path / "settings.yaml"
    settings.write_text("scene: {horizon: 1.5}\n", encoding="utf-8")
    config = load_config(file=settings)
    with pytest.raises(ConfigError, match=r"scene\.horizon=None, and .* asks for 1\.5"):
        prepare(load_scene(file), config)
    assert prepare(load_scene(file, config), config).scene.horizon == pytest.approx(1.5)


def test_a_default_configuration_takes_what_the_scene_has(file: Path, tmp_path: Path) -> None:
    keys = {**OTHERS, "planning_problem": 100}
    made = load_scene(file, **keys)
    assert {name: getattr(made.settings, name) for name in LOADING} == keys
    config = load_config(overrides={**FIXED, "scene.s_offset": 3.0})
    result = repair(made, config)
    taken = result.prepared.config
    assert {name: getattr(taken.scene, name) for name in LOADING} == keys
    assert taken.scene.s_offset == 3.0
    assert taken.given == config.given
    assert config.scene.vehicle == 1  # the one that was handed in is left alone
    recorded = result.to_dict()["config"]["scene"]
    assert recorded == {**keys, "s_offset": 3.0, "l_offset": None}
    result.save(tmp_path / "out", figure=False)
    assert load_result(tmp_path / "out").record["config"]["scene"] == recorded
    # What is recorded makes the same result of the file again.
    again = repair(file, recorded_config(result.to_dict()))
    assert again.f_ttr == result.f_ttr
    assert again.prepared.scene.settings == taken.scene


def test_offsets_are_no_matter_of_the_loading(file: Path) -> None:
    made = load_scene(file, load_config(overrides=["scene.s_offset=1.0"]))
    keys = {**FIXED, "checker.conflict": "boxes"}
    wide = prepare(made, load_config(overrides={**keys, "scene.s_offset": 6.0}))
    assert wide.config.scene.s_offset == 6.0
    assert wide.conflict.time < prepare(made, load_config(overrides=keys)).conflict.time


def test_a_scene_from_memory_has_its_settings_too() -> None:
    task = problem(state(10.0, 0.0))
    world = scenario_of(two_lanes(), [driving(7, 40.0, 0.0, 2.0)])
    made = scene_from_scenario(world, task, SceneConfig(horizon=1.0), vehicle=3)
    assert (made.settings.horizon, made.settings.vehicle, made.n_steps) == (1.0, 3, 10)
    assert made.vehicle is made.model.parameters
    assert made.vehicle.type_id == 3
    assert prepare(made, load_config()).config.scene.vehicle == 3
    with pytest.raises(ConfigError, match=r"scene\.vehicle=3, and .* asks for 2"):
        prepare(made, load_config(overrides=["scene.vehicle=2"]))


def test_single_keys_lie_over_the_configuration(file: Path) -> None:
    config = load_config(overrides=["scene.horizon=1.0", "scene.vehicle=2"])
    for given in (config, config.scene):
        made = load_scene(file, given, horizon=2.0)
        assert (made.settings.horizon, made.settings.vehicle) == (2.0, 2)
        assert made.horizon == pytest.approx(2.0)
    assert config.scene.horizon == 1.0
    with pytest.raises(ConfigError, match="not with dict"):
        load_scene(file, {"horizon": 1.0})


def test_smoothing_moves_the_path(file: Path) -> None:
    """A kink of the centre line is taken along as far as the key allows."""
    x = np.arange(0.0, 121.0, 5.0)
    zigzag = lanelet(1, np.stack([x, 0.2 * (np.arange(len(x)) % 2)], axis=1))
    fine, coarse = (scene([zigzag], state(10.0, 0.1), smoothing=smoothing) for smoothing in (0.01, 0.15))
    bend = [np.abs(made.frame.curvature(np.linspace(60.0, 90.0, 200))).max() for made in (fine, coarse)]
    assert bend[1] < 0.5 * bend[0]
    for smoothing in (0.0, -1.0, float("nan")):
        with pytest.raises(ConfigError, match="smoothing"):
            load_scene(file, smoothing=smoothing)


# ---------------------------------------------------------------------- files


def test_malformed_files(tmp_path: Path) -> None:
    bomb = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "y">]><commonRoad timeStepSize="0.1"/>'
    cases = {
        "empty.xml": ("", "is empty"),
        "text.xml": ("no xml at all", "is not XML"),
        "cut.xml": ("<commonRoad timeStepSize='0.1'><lanelet id='1'>", "is not XML"),
        "binary.pb": ("\x08\x01 of protobuf", "is not XML: .*; write it as XML with commonroad-io"),
        "other.xml": ("<html/>", "not a CommonRoad file"),
        "bomb.xml": (bomb, "DOCTYPE"),
        "dt.xml": ("<commonRoad timeStepSize='0'/>", "time step"),
        "nan.xml": ("<commonRoad timeStepSize='nan'/>", "time step"),
        "version.xml": ("<commonRoad timeStepSize='0.1' commonRoadVersion='1999'/>", "cannot read it"),
    }
    for name, (text, sentence) in cases.items():
        (tmp_path / name).write_text(text)
        with pytest.raises(ScenarioError, match=sentence) as caught:
            load_scene(tmp_path / name)
        assert name in str(caught.value)
    (tmp_path / "wide.xml").write_text(bomb, encoding="utf-16")
    with pytest.raises(ScenarioError):
        load_scene(tmp_path / "wide.xml")
    with pytest.raises(ScenarioError, match="no such file"):
        load_scene(tmp_path / "missing.xml")
    with pytest.raises(ScenarioError, match="directory"):
        load_scene(tmp_path)
    with pytest.raises(ScenarioError, match="at most"):
        read_file(tmp_path / "bomb.xml", size_limit=10)


MUTATIONS = [
    ("<planningProblem", "<ignored", "</planningProblem>", "</ignored>", "planning problem"),
    ("<lanelet id", "<ignored id", "</lanelet>", "</ignored>", "."),
    ("<x>", "<x>nan", "</x>", "</x>", "."),
]


@pytest.mark.parametrize("old, new, old_end, new_end, sentence", MUTATIONS)
def test_mutilated_scenario_files(
    scenarios: Path, tmp_path: Path, old: str, new: str, old_end: str, new_end: str, sentence: str
) -> None:
    text = (scenarios / "ZAM_Urban-3_1.xml").read_text()
    broken = tmp_path / "broken.xml"
    broken.write_text(text.replace(old, new).replace(old_end, new_end))
    assert broken.read_text() != text
    with pytest.raises(ScenarioError, match=sentence):
        load_scene(broken)
    broken.write_text(text[: len(text) // 2])
    with pytest.raises(ScenarioError, match=r"broken\.xml"):
        load_scene(broken)


def check(made: Scene) -> None:
    """What holds for every scene."""
    s0 = made.start[0, 0]
    ego = made.initial_state
    np.testing.assert_allclose(made.frame.position(s0), [ego.x, ego.y], atol=1e-3)
    ahead = made.frame.curvature(np.linspace(s0, made.frame.length, 400))
    assert np.max(np.abs(ahead)) < 0.3
    assert made.horizon == pytest.approx(made.n_steps * made.dt)
    assert all(len(o.vertices) == made.n_steps + 1 for o in made.obstacles)
    for bounds in (made.lane, made.same_direction, made.road):
        assert np.all(bounds.right <= 0.0)
        assert np.all(bounds.left >= 0.0)
    from_ego = made.lane.s >= s0
    assert np.all((made.lane.left <= made.same_direction.left + 1e-9)[from_ego])
    assert np.all((made.same_direction.left <= made.road.left + 1e-9)[from_ego])


def test_files_give_a_scene_or_a_sentence(scenarios: Path) -> None:
    # tests/integration/test_all_files.py loads them all; here a fifth of them is looked at closely.
    files = sorted(scenarios.glob("*.xml")) + sorted((scenarios.parent / "traps").glob("*.xml"))
    refused = {}
    for file in files[::5]:
        try:
            check(load_scene(file))
        except RepairError as error:
            refused[file.name] = str(error)
    assert set(refused) <= {"DEU_TestIntersectionInteract-3_1_T-1.xml"}
    assert all(name in sentence for name, sentence in refused.items())


def test_scenario_1(scenarios: Path) -> None:
    made = load_scene(scenarios / "DEU_Flensburg-6_1_T-1.xml")
    assert made.id == "DEU_Flensburg-6_1_T-1"
    assert len(made.sha256) == 64
    assert made.route_lanelets[:3] == (133, 1330, 201)
    s = made.start[0, 0] + np.arange(0.0, 30.0, 0.1)
    assert 0.13 < np.max(made.frame.curvature(s)) < 0.19
    assert {333, 36, 337} <= {o.id for o in made.obstacles}


def test_planning_problem_can_be_chosen(scenarios: Path) -> None:
    file = scenarios / "C-DEU_B471-1_1_T-1.xml"
    if not file.exists():
        pytest.skip(f"{file.name} is not there")
    made = load_scene(file)
    assert made.planning_problem_id == 800
    assert any("smallest id" in note for note in made.notes)
    assert load_scene(file, planning_problem=801).planning_problem_id == 801
    with pytest.raises(ScenarioError, match="800, 801"):
        load_scene(file, planning_problem=5)


def test_traps(scenarios: Path) -> None:
    traps = scenarios.parent / "traps"
    if not traps.is_dir():
        pytest.skip("no traps folder beside the scenarios")
    egos = {"ZAM_Urban-7_1_S-2": 100, "DEU_Crit-1_1_T-1": 9, "ZAM_Urban-3_3_Repair": 8}
    for name, ego in egos.items():
        made = load_scene(traps / f"{name}.xml")
        assert made.recorded_ego is not None
        assert made.recorded_ego.id == ego
    assert load_scene(traps / "DEU_Crit-1_1_T-1.xml").id == "DEU_Test-1_1_T-1"
    turned = load_scene(traps / "ARG_Carcarana-10_1_T-1.xml")
    off = float(turned.frame.heading(turned.start[0, 0])) - turned.initial_state.orientation
    assert abs((off + np.pi) % (2 * np.pi) - np.pi) < 0.3
    assert load_scene(traps / "ZAM_Urban-7_1_S-2.xml").dt == 0.25
