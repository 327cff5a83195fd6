"""Generated scenes: nothing but RepairErrors leaves the library, and what it calls feasible is.

The independent checks know nothing of ours: obstacles are placed here, collisions are shapely's, and
transitions are the drivability checker's.
"""

from __future__ import annotations

import random
import warnings
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.roads import bend

from repair.api import RepairResult, search
from repair.config import Config, load_config
from repair.errors import RepairError
from repair.preparation import prepare
from repair.scene.commonroad import scene_from_scenario
from repair.search.result import SearchStatus
from repair.solvers.registry import make_backend
from repair.vehicle.commonroad_ks import official_check

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # protobuf's deprecations, on import
    import commonroad.common.file_reader  # noqa: F401
    from commonroad.common.util import Interval
    from commonroad.geometry.shape import Circle, Rectangle
    from commonroad.planning.goal import GoalRegion
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.lanelet import Lanelet, LaneletNetwork
    from commonroad.scenario.obstacle import DynamicObstacle, ObstacleType, StaticObstacle
    from commonroad.scenario.scenario import Scenario, ScenarioID
    from commonroad.scenario.state import CustomState, InitialState
    from commonroad.scenario.trajectory import Trajectory

WIDTH = 3.5
GRAZE = 0.03  # the ego's rectangle, smaller by this on every side [m], must touch nothing
FINE = 20  # looks per time step; the library's own check takes 4


class Road:
    """Parallel lanes along a centre line; lane 1 is that line, 2 on its left, 3 comes the other way."""

    def __init__(self, line: np.ndarray) -> None:
        self.line = line
        self.s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])

    def offset(self, l: float) -> np.ndarray:  # noqa: E741
        step = np.gradient(self.line, axis=0)
        return self.line + l * np.stack([-step[:, 1], step[:, 0]], axis=1) / np.hypot(*step.T)[:, None]

    def at(self, s: Any, l: float) -> tuple[np.ndarray, np.ndarray]:  # noqa: E741
        """Points (..., 2) and headings; straight on beyond the ends."""
        side, s = self.offset(l), np.asarray(s, dtype=np.float64)
        heading = np.unwrap(np.arctan2(*np.gradient(self.line, axis=0).T[::-1]))
        angle = np.interp(s, self.s, heading)
        beyond = s - np.clip(s, 0.0, self.s[-1])
        xy = np.stack([np.interp(s, self.s, side[:, k]) for k in (0, 1)], axis=-1)
        return xy + beyond[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1), angle

    def network(self, lanes: int) -> LaneletNetwork:
        def lane(l: float, name: int, **keys: Any) -> Lanelet:  # noqa: E741
            return Lanelet(
                self.offset(l + WIDTH / 2), self.offset(l), self.offset(l - WIDTH / 2), name, **keys
            )

        beside = {"adjacent_left": 2, "adjacent_left_same_direction": True} if lanes > 1 else {}
        made = [lane(0.0, 1, **beside)]
        if lanes > 1:
            made.append(lane(WIDTH, 2, adjacent_right=1, adjacent_right_same_direction=True))
        if lanes > 2:
            back = lane(2 * WIDTH, 3)
            made.append(
                Lanelet(back.right_vertices[::-1], back.center_vertices[::-1], back.left_vertices[::-1], 3)
            )
        return LaneletNetwork.create_from_lanelet_list(made)


class Thing:
    """An obstacle at constant speed along or across the road, or standing; ``body`` at a fractional step."""

    def __init__(self, name: int, road: Road, drawn: tuple[Any, ...], dt: float, steps: int) -> None:
        s, l, kind, speed, body, last, turn = drawn  # noqa: E741
        self.name, self.dt, self.kind = name, dt, kind
        self.last = steps if kind == "standing" else max(1, min(last, steps))
        k = np.arange(self.last + 1)
        if kind == "crossing":
            start, heading = road.at(s, 0.0)
            across = heading + np.pi / 2 + turn
            direction = np.array([np.cos(across), np.sin(across)])
            self.xy = start + (l * 3.0 + np.sign(speed or 1.0) * -12.0 + speed * k * dt)[:, None] * direction
            self.heading = np.full(len(k), across if speed >= 0.0 else across + np.pi)
        else:
            moving = 0.0 if kind == "standing" else speed
            self.xy, self.heading = road.at(s + moving * k * dt, l)
            self.heading = self.heading + (turn if kind == "standing" else np.pi * (moving < 0.0))
        self.speed = 0.0 if kind == "standing" else abs(speed)
        self.shape = Circle(body[0] / 4.0) if body[2] else Rectangle(*body[:2])

    def body(self, where: float) -> Any:
        """Its outline as a shapely geometry at a fractional step, None where it is not."""
        low = int(np.floor(where + 1e-9))
        high = min(low + 1, self.last)
        if low > self.last or (where > self.last + 1e-9):
            return None
        weight = where - low
        x, y = (1 - weight) * self.xy[low] + weight * self.xy[high]
        if isinstance(self.shape, Circle):
            return shapely.Point(x, y).buffer(self.shape.radius, quad_segs=32)
        turn = (self.heading[high] - self.heading[low] + np.pi) % (2 * np.pi) - np.pi
        return rectangle(x, y, self.heading[low] + weight * turn, self.shape.length, self.shape.width)

    def obstacle(self) -> Any:
        def values(k: int) -> dict[str, Any]:
            angle = float((self.heading[k] + np.pi) % (2 * np.pi) - np.pi)
            return {"time_step": k, "position": self.xy[k], "orientation": angle, "velocity": self.speed}

        start = InitialState(**values(0), acceleration=0.0, yaw_rate=0.0, slip_angle=0.0)
        if self.kind == "standing":
            return StaticObstacle(self.name, ObstacleType.PARKED_VEHICLE, self.shape, start)
        states = [CustomState(**values(k)) for k in range(1, self.last + 1)]
        prediction = TrajectoryPrediction(Trajectory(1, states), self.shape)
        return DynamicObstacle(self.name, ObstacleType.CAR, self.shape, start, prediction)


def rectangle(x: float, y: float, heading: float, length: float, width: float) -> Any:
    c, s = np.cos(heading), np.sin(heading)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length / 2, width / 2)
    return shapely.Polygon(corners @ np.array([[c, s], [-s, c]]) + (x, y))


numbers = st.integers(0, 1000).map(lambda k: k / 1000.0)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return numbers.map(lambda u: round(low + u * (high - low), 3))


things = st.tuples(
    between(22.0, 90.0),
    st.sampled_from([0.0, 0.0, -0.4, 0.8, -1.6, 2.2, WIDTH, 2 * WIDTH]),
    st.sampled_from(["standing", "along", "along", "crossing", "crossing"]),
    between(-4.0, 9.0),
    st.tuples(between(0.5, 8.0), between(0.4, 2.4), st.booleans()),
    st.integers(10, 60),
    between(-1.6, 1.6),
)


@st.composite
def cases(draw: st.DrawFn) -> tuple[Any, list[Thing], Config]:
    radius = draw(st.sampled_from([np.inf, np.inf, 200.0, -100.0, 60.0, -60.0, 30.0]))
    straight = np.stack([np.arange(0.0, 302.0, 2.0), np.zeros(151)], axis=1)
    line = straight if np.isinf(radius) else bend(radius, 30.0 + min(2.5 * abs(radius), 270.0))
    road, dt = Road(line), draw(st.sampled_from([0.1, 0.1, 0.2, 0.25, 0.04]))
    steps = draw(st.integers(1, 60) | st.integers(40, 60))
    made = [
        Thing(30 + i, road, t, dt, steps)
        for i, t in enumerate(draw(st.lists(things, min_size=1, max_size=4)))
    ]
    scenario = Scenario(dt, ScenarioID(country_id="ZAM", map_name="Test", map_id=1))
    scenario.add_objects(road.network(draw(st.sampled_from([1, 2, 3, 3]))))
    for thing in made:
        scenario.add_objects(thing.obstacle())
    xy, heading = road.at(draw(between(6.0, 30.0)), draw(between(-0.3, 0.3)))
    start = InitialState(
        time_step=0, position=xy, orientation=float(heading) + draw(between(-0.05, 0.05)),
        velocity=draw(between(0.0, 17.0)), acceleration=draw(between(-2.0, 2.0)),
        yaw_rate=0.0, slip_angle=0.0,
    )  # fmt: skip
    goal = GoalRegion([CustomState(time_step=Interval(max(steps - 1, 0), steps))])
    config = load_config(
        overrides=[
            f"reference.source={draw(st.sampled_from(['planner', 'constant', 'accelerate']))}",
            f"scene.vehicle={draw(st.sampled_from([1, 1, 2, 3, 4]))}",
            f"repair.lateral={draw(st.sampled_from(['road', 'road', 'lane', 'none', 'same_direction']))}",
        ]
    )
    task = PlanningProblem(100, start, goal)
    return scene_or_none(scenario, task, config), made, config


def scene_or_none(scenario: Any, task: Any, config: Config) -> Any:
    try:
        return scene_from_scenario(scenario, task, config)
    except RepairError:
        return None


def run(scene: Any, config: Config) -> RepairResult | None:
    try:
        return search(prepare(scene, config), make_backend("ego", config))
    except RepairError:
        return None


def first_touch(result: RepairResult, made: list[Thing]) -> str | None:
    """When the ego's rectangle meets an obstacle that is not its own recording, in words."""
    scene, checker = result.prepared.scene, result.prepared.checker
    there = {o.id for o in scene.obstacles}
    t_end = result.prepared.t_end if result.search.curve is not None else result.prepared.t_reference
    steps = int(np.floor(t_end / scene.dt + 1e-6))
    fine = type(checker)(scene, checker.limits, load_config(overrides={"checker.substeps": FINE}).checker)
    states = fine.drive(result.curve, steps * scene.dt)
    size = scene.vehicle.length - 2 * GRAZE, scene.vehicle.width - 2 * GRAZE
    for i in range(len(states)):
        ego = None
        for thing in made:
            # Between its last step and the next one an obstacle is neither there nor not there.
            body = thing.body(i / FINE) if thing.name in there else None
            if (
                body is None
                or np.hypot(*(np.array(body.centroid.coords[0]) - (states.x[i], states.y[i]))) > 15.0
            ):
                continue
            ego = ego or rectangle(states.x[i], states.y[i], states.orientation[i], *size)
            if ego.intersects(body):
                return f"obstacle {thing.name} at t = {states.t[i]:.3f} s, t_rep = {result.f_ttr}"
    return None


@given(cases())
@settings(max_examples=25)
def test_what_is_called_feasible_is(case: tuple[Any, list[Thing], Config]) -> None:
    scene, made, config = case
    if scene is None:
        return
    result = run(scene, config)
    if result is None or result.status not in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT):
        return
    assert first_touch(result, made) is None
    states, start = result.states, scene.initial_state
    np.testing.assert_allclose([states.x[0], states.y[0]], [start.x, start.y], atol=0.02)
    transitions = range(len(states) - 1)
    chosen = random.Random(len(states)).sample(transitions, min(3, len(transitions)))
    report = official_check(states, scene.dt, scene.vehicle, chosen)
    assert report.ok.all(), report.reasons


@pytest.mark.slow
@given(cases())
@settings(max_examples=25)
def test_solutions_are_officially_feasible(case: tuple[Any, list[Thing], Config]) -> None:
    """Every transition of what a repair writes."""
    scene, _, config = case
    result = run(scene, config) if scene is not None else None
    if result is not None and result.status is SearchStatus.FOUND:
        report = official_check(result.states, scene.dt, scene.vehicle)
        assert report.ok.all(), report.reasons
