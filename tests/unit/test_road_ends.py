"""The end of the road, lanes that end or narrow, closed lanes: reasons to brake or to go around."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import repair
import roads
from repair.world.dead_ends import ROAD_END, dead_ends

AWAY = roads.car(11, roads.state(900.0, 900.0, v=0.0))
NOSE = 2.149  # half the ego's length


def straight(first: float, last: float, y: float = 0.0) -> np.ndarray:
    x = np.append(np.arange(first, last, 5.0), last)
    return np.stack([x, np.full(len(x), y)], axis=1)


def loaded(folder: Path, road: str, v: float, duration: float, goal: str = "", obstacles: str = AWAY):
    file = folder / "end.xml"
    time = f"<time><intervalStart>1</intervalStart><intervalEnd>{round(10 * duration)}</intervalEnd></time>"
    problem = roads.problem(start=roads.state(0.0, 0.0, v=v), goal=f"<goalState>{goal}{time}</goalState>")
    file.write_text(roads.scenario(road=road, obstacles=obstacles, problems=problem))
    return repair.load_scene(file)


def answer(scene, backend: str, *more: str):
    return repair.repair(scene, backend=backend, overrides=["reference.source=constant", *more])


@pytest.mark.thinned(4)
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
@pytest.mark.parametrize("left, v", [(20.0, 5.0), (20.0, 12.0), (50.0, 12.0), (50.0, 20.0), (80.0, 20.0)])
def test_the_end_of_the_road_is_yielded_to(tmp_path: Path, backend: str, left: float, v: float) -> None:
    scene = loaded(tmp_path, roads.strip(1, straight(-50.0, left)), v, left / v + 4.0)
    found = answer(scene, backend)
    ttc = (left - NOSE) / v
    assert found.search.conflict.kind == "off_road"
    assert ttc - 0.11 <= found.ttc <= ttc + 0.05
    # full braking at 10.35 m/s² from the last time on; a grid of 0.4 s, and a jerk that is limited
    latest = (left - NOSE - v**2 / 2.0 / 10.35) / v
    assert found.status.value == "found", found.search.probes[0]
    assert latest - 0.9 < found.f_ttr <= latest
    end = found.search.best.solve.curve.sample([found.prepared.t_end - 1e-6])
    assert float(end.position[0, 0]) + NOSE < scene.start[0, 0] + left


def test_without_the_setting_nobody_brakes(tmp_path: Path) -> None:
    scene = loaded(tmp_path, roads.strip(1, straight(-50.0, 50.0)), 12.0, 8.0)
    assert answer(scene, "ego", "repair.road_ends=false", "fallback=[]").status.value == "none_feasible"
    other = answer(scene, "ego", "repair.road_ends=false")  # shooting sees the road itself
    assert other.status.value == "found"
    assert other.search.best.by == "shooting"
    noted = answer(scene, "ego", "checker.road=false", "repair.road_ends=true")
    assert any("repair.road_ends has no effect" in note for note in noted.prepared.notes)
    assert noted.status.value == "no_conflict"


@pytest.mark.thinned(4)
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
@pytest.mark.parametrize("closed", [False, True])
def test_a_lane_that_ends_beside_one_that_goes_on(tmp_path: Path, backend: str, closed: bool) -> None:
    """Whoever is too fast to stop changes lanes; where a car stands there, nothing is found that late."""
    road = roads.strip(1, straight(-50.0, 60.0), more='<adjacentLeft ref="2" drivingDir="same"/>')
    road += roads.strip(2, straight(-50.0, 60.0, 4.0), after=[3],
                        more='<adjacentRight ref="1" drivingDir="same"/>')  # fmt: skip
    road += roads.strip(3, straight(60.0, 300.0, 4.0), before=[2])
    car = roads.car(30, roads.state(60.0, 4.0, v=0.0)) if closed else AWAY
    found = answer(loaded(tmp_path, road, 22.0, 6.0, obstacles=car), backend, "search.rule=scan")
    assert found.status.value == "found"
    kinds = {p.maneuver.value for p in found.search.probes if p.feasible}
    if backend != "qptr":  # the baseline drives up to the far edge of the road, and touches it
        assert ("left" in kinds) is not closed
    assert any("lanelet 1 ends there within the map" in note for note in found.prepared.notes)


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_a_lane_that_narrows(tmp_path: Path, backend: str) -> None:
    x = np.array([-50.0, 40.0, 60.0, 250.0])
    left = "".join(roads.point(a, b) for a, b in zip(x, [2.0, 2.0, 0.5, 0.5], strict=True))
    right = "".join(roads.point(a, b) for a, b in zip(x, [-2.0, -2.0, -0.5, -0.5], strict=True))
    road = f'<lanelet id="1"><leftBound>{left}</leftBound><rightBound>{right}</rightBound></lanelet>'
    found = answer(loaded(tmp_path, road, 12.0, 8.0), backend)
    assert found.search.conflict.kind == "off_road"
    assert found.status.value == "found"
    assert found.search.best.maneuver.value == "yield"


def test_the_end_of_the_map_is_told_from_that_of_a_road(tmp_path: Path) -> None:
    road = roads.strip(1, straight(-50.0, 50.0))
    found = answer(loaded(tmp_path, road, 12.0, 8.0), "ego")
    assert "the map ends there" in found.search.conflict.detail
    assert any("the road ends 50 m ahead" in note and "the map ends" in note for note in found.prepared.notes)
    across = np.stack([np.full(11, 62.0), np.linspace(-50.0, 50.0, 11)], axis=1)
    found = answer(loaded(tmp_path, road + roads.strip(2, across), 12.0, 8.0), "ego")
    assert "lanelet 1 ends there within the map" in found.search.conflict.detail
    assert found.status.value == "found"


def test_a_goal_at_the_end_of_the_map_is_named(tmp_path: Path) -> None:
    goal = (
        "<position><rectangle><length>8</length><width>4</width><orientation>0</orientation>"
        "<center><x>46</x><y>0</y></center></rectangle></position>"
    )
    found = answer(loaded(tmp_path, roads.strip(1, straight(-50.0, 50.0)), 12.0, 8.0, goal), "ego")
    assert any("the goal begins 8 m before it" in note for note in found.prepared.notes)
    assert found.status.value == "found"


def test_where_the_road_goes_on_there_is_no_end(tmp_path: Path) -> None:
    scene = loaded(tmp_path, roads.strip(1, straight(-50.0, 300.0)), 12.0, 4.0,
                   obstacles=roads.driving(30, 40.0, 0.0, 3.0))  # fmt: skip
    found = answer(scene, "ego")
    assert found.prepared.dead_ends == []
    assert ROAD_END not in found.prepared.source.occupancy.ids
    assert scene.road_end is None


def test_the_corridor_settles_places_and_changes_no_end(tmp_path: Path) -> None:
    scene = loaded(tmp_path, roads.strip(1, straight(-50.0, 50.0)), 12.0, 8.0)
    checker = answer(scene, "ego").prepared.checker
    asked = checker.road, scene.frame, scene.vehicle, scene.road, float(scene.start[0, 0]), 80.0
    plain, quick = dead_ends(*asked), dead_ends(*asked, checker.edge.corridor)
    assert len(plain) == 1
    np.testing.assert_array_equal(quick, plain)


def test_a_part_that_is_known_to_be_clear_is_not_looked_at_again(tmp_path: Path) -> None:
    scene = loaded(tmp_path, roads.strip(1, straight(-50.0, 150.0)), 12.0, 8.0)
    checker = answer(scene, "ego").prepared.checker
    corridor, begin = checker.edge.corridor, float(scene.start[0, 0])
    asked = []

    class Seen:
        def __init__(self) -> None:
            self.clear = (np.inf, -np.inf)

        def holds(self, s, *pose):
            asked.append((float(s[0]), float(s[-1])))
            return corridor.holds(s, *pose)

    seen = Seen()
    for k in range(150):  # a metre each, up to the end of the road and past it
        start = begin + k
        ends = [
            dead_ends(checker.road, scene.frame, scene.vehicle, scene.road, start, 40.0, how)
            for how in (None, seen)
        ]
        np.testing.assert_allclose(ends[1], ends[0])
        assert seen.clear[0] <= start
    assert len(ends[0]) == 0
    far = [last for _, last in asked]
    assert len([last for last in far if last < begin + 100.0]) <= 3
    # and back again
    assert dead_ends(checker.road, scene.frame, scene.vehicle, scene.road, begin - 3.0, 40.0, seen) == []
    assert seen.clear[0] == begin - 3.0


def test_the_way_around_an_end_is_the_nearest_that_is_free_all_along(tmp_path: Path) -> None:
    road = roads.strip(1, straight(-50.0, 50.0), more='<adjacentLeft ref="2" drivingDir="same"/>')
    road += roads.strip(2, straight(-50.0, 50.0, 4.0), after=[3],
                        more='<adjacentRight ref="1" drivingDir="same"/>')  # fmt: skip
    road += roads.strip(3, straight(50.0, 300.0, 4.0), before=[2])
    scene = loaded(tmp_path, road, 12.0, 8.0)
    edge = answer(scene, "ego").prepared.checker.road
    start = float(scene.start[0, 0])
    room = SimpleNamespace(at=lambda s: np.stack([np.full(len(s), -7.0), np.full(len(s), 7.0)]))
    ((lower, upper),) = dead_ends(edge, scene.frame, scene.vehicle, room, start, 80.0)
    s = np.arange(lower[0] + 0.6, start + 80.0, 0.25)

    def free(aside: float) -> bool:
        places = scene.frame.to_cartesian(s, np.full(len(s), aside))
        return bool(edge.inside(edge.outline(*places.T, scene.frame.heading(s))).all())

    assert free(upper[1])
    assert not free(upper[1] - 0.2)
    assert lower[1] == -1e4
    assert not any(free(-aside) for aside in np.arange(0.2, 3.0, 0.2))
