"""Roads that come back to themselves: rings of more than a lap, rings with an exit, figure-eights."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import roads
from repair.scene.commonroad import load_scene
from repair.scene.frame import FrenetFrame
from repair.scene.road.passes import along, every_pass, passes
from repair.world.occupancy import build_occupancy

TAU = 2.0 * np.pi
AWAY = roads.car(11, roads.state(900.0, 900.0, v=0.0))


def circle(radius: float, first: float = 0.0, last: float = TAU, count: int = 65) -> np.ndarray:
    angle = np.linspace(first, last, count)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def ring(radius: float, parts: int) -> str:
    """A ring of this many lanelets; of one that succeeds itself."""
    cuts = np.linspace(0.0, TAU, parts + 1)
    return "".join(
        roads.strip(
            k + 1,
            circle(radius, first, last, 96 // parts + 1),
            after=[(k + 1) % parts + 1],
            before=[(k - 1) % parts + 1],
        )
        for k, (first, last) in enumerate(pairwise(cuts))
    )


def on_ring(radius: float, angle: float, v: float) -> str:
    place = radius * np.array([np.cos(angle), np.sin(angle)])
    return roads.state(*place, heading=wrapped(angle + 0.5 * np.pi), v=v)


def wrapped(angle: float) -> float:
    return float((angle + np.pi) % TAU - np.pi)


def standing(radius: float, angle: float, name: int = 30) -> str:
    return roads.car(name, on_ring(radius, angle, 0.0))


def goal(last: int) -> str:
    time = f"<time><intervalStart>1</intervalStart><intervalEnd>{last}</intervalEnd></time>"
    return f"<goalState>{time}</goalState>"


def made(folder: Path, road: str, obstacles: str, start: str, duration: float):
    file = folder / "loop.xml"
    last = round(10.0 * duration)
    file.write_text(
        roads.scenario(road=road, obstacles=obstacles, problems=roads.problem(start=start, goal=goal(last)))
    )
    return load_scene(file, horizon=duration)


def answer(scene, backend: str):
    import repair

    return repair.repair(scene, backend=backend, overrides=["reference.source=constant"])


@pytest.mark.parametrize("radius, parts", [(10.0, 1), (12.0, 4), (20.0, 1), (25.0, 5), (40.0, 3)])
def test_a_ring_is_driven_as_often_as_the_horizon_needs(tmp_path: Path, radius: float, parts: int) -> None:
    v = 0.55 * float(np.sqrt(8.0 * radius))
    duration = 2.4 * TAU * radius / v
    scene = made(tmp_path, ring(radius, parts), AWAY, on_ring(radius, 0.3, v), duration)
    assert scene.frame.length - scene.start[0, 0] > 2.4 * TAU * radius
    assert not any("ends" in note or "second time" in note for note in scene.notes)
    found = answer(scene, "ego")
    assert found.status.value == "no_conflict", found.search.conflict
    assert found.prepared.t_reference == pytest.approx(duration, abs=0.11)


@pytest.mark.thinned(2)
@pytest.mark.parametrize("laps", [0.4, 1.0])
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_who_stands_on_a_ring_is_met_on_every_lap(tmp_path: Path, backend: str, laps: float) -> None:
    """A car that enters behind the ego on its first lap is met on the second."""
    radius, v = 15.0, 7.0
    where = 0.3 + TAU * (laps % 1.0) + (0.0 if laps < 1.0 else -0.9)
    steps = range(0 if laps < 1.0 else 60, 200)
    place = radius * np.array([np.cos(where), np.sin(where)])
    heading = wrapped(where + 0.5 * np.pi)
    away = roads.state(300.0, 0.0, v=0.0, heading=heading)
    start = roads.state(*place, v=0.0, heading=heading) if laps < 1.0 else away
    states = "".join(
        roads.state(*(place if k in steps else (300.0, 0.0)), k=k, v=0.0, heading=heading, tag="state")
        for k in range(1, 200)
    )
    obstacle = roads.car(30, start, f"<trajectory>{states}</trajectory>")
    scene = made(tmp_path, ring(radius, 4), obstacle, on_ring(radius, 0.3, v), 19.0)
    found = answer(scene, backend)
    expected = (TAU * laps - (0.9 if laps >= 1.0 else 0.0)) * radius / v
    assert found.search.conflict.obstacle_id == 30
    assert expected - 1.2 < found.ttc < expected
    assert found.status.value == "found", found.search.probes[0]


def test_an_exit_that_the_goal_lies_beyond_is_taken(tmp_path: Path) -> None:
    radius = 20.0
    bend = np.stack([radius + np.zeros(12), np.linspace(0.0, 44.0, 12)], axis=1)
    road = "".join(
        [
            roads.strip(1, circle(radius, -np.pi, 0.0), after=[2, 3], before=[2]),
            roads.strip(2, circle(radius, 0.0, np.pi), after=[1], before=[1]),
            roads.strip(3, bend, before=[1]),
        ]
    )
    where = '<position><lanelet ref="3"/></position>'
    time = "<time><intervalStart>1</intervalStart><intervalEnd>80</intervalEnd></time>"
    file = tmp_path / "exit.xml"
    for aim, expected in ((f"<goalState>{where}{time}</goalState>", 3), (goal(80), 3)):
        problem = roads.problem(start=on_ring(radius, -2.0, 8.0), goal=aim)
        file.write_text(roads.scenario(road=road, obstacles=AWAY, problems=problem))
        assert load_scene(file).route_lanelets[:2] == (1, expected)
    where = '<position><lanelet ref="2"/></position>'
    problem = roads.problem(start=on_ring(radius, -2.0, 8.0), goal=f"<goalState>{where}{time}</goalState>")
    file.write_text(roads.scenario(road=road, obstacles=AWAY, problems=problem))
    assert load_scene(file).route_lanelets[:2] == (1, 2)


def eight(size: float) -> np.ndarray:
    """A figure-eight (a lemniscate of Gerono) that crosses itself at the origin."""
    u = np.linspace(0.0, TAU, 161) + 0.5 * np.pi
    return size * np.stack([np.cos(u), np.sin(u) * np.cos(u) * 1.3], axis=1)


@pytest.mark.parametrize("size", [25.0, 40.0])
def test_a_figure_eight_is_driven_through_its_crossing(tmp_path: Path, size: float) -> None:
    line = eight(size)
    road = roads.strip(1, line[:81], after=[2], before=[2]) + roads.strip(2, line[80:], after=[1], before=[1])
    step = line[11] - line[10]
    start = roads.state(*line[10], heading=float(np.arctan2(step[1], step[0])), v=4.0)
    length = float(np.hypot(*np.diff(line, axis=0).T).sum())
    scene = made(tmp_path, road, AWAY, start, 1.3 * length / 4.0)
    assert scene.frame.length - scene.start[0, 0] > 1.3 * length
    assert answer(scene, "ego").status.value == "no_conflict"
    standing = roads.car(30, roads.state(0.0, 0.0, v=0.0))
    scene = made(tmp_path, road, standing, start, 1.3 * length / 4.0)
    boxes, _ = build_occupancy(scene.obstacles, scene.frame, scene.dt, 2.0, 1.0)
    middles = np.sort(boxes.lower[:, 0, 0] + boxes.upper[:, 0, 0]) / 2.0
    ahead = middles[middles > scene.start[0, 0]] - scene.start[0, 0]
    assert len(ahead) >= 2  # the same car, wherever the path passes it
    assert np.diff(ahead)[0] == pytest.approx(0.5 * length, rel=0.05)


@pytest.mark.parametrize("radius", [6.0, 15.0, 40.0])
def test_every_place_of_a_ring_has_its_coordinates_on_every_lap(radius: float) -> None:
    frame = FrenetFrame.from_points(circle(radius, 0.0, 3.2 * TAU, int(80 * radius)), smoothing=0.0)
    stretches = passes(frame)
    assert stretches[0][0] == -np.inf
    assert stretches[-1][1] == np.inf
    assert all(later[0] < earlier[1] for earlier, later in pairwise(stretches))
    for s in np.linspace(0.3, TAU * radius - 0.3, 29):
        found = np.array([one[0] for one in every_pass(frame, frame.to_cartesian([s], [1.0]))])
        laps = np.unique(np.round(found[np.isfinite(found[:, 0]), 0], 1))
        expected = np.arange(s, frame.length, TAU * radius)
        missing = [want for want in expected if np.abs(laps - want).min() > 0.2]
        assert not missing, (s, laps)
        within = np.abs(found[:, 0] - 0.5 * frame.length) < 0.5 * frame.length - 2.0  # beyond, it is straight
        np.testing.assert_allclose(found[within, 1], 1.0, atol=0.01)
    driven = np.linspace(1.0, frame.length - 1.0, 90)
    np.testing.assert_allclose(along(frame, frame.position(driven), 0.0)[:, 0], driven, atol=1e-6)


def test_a_road_that_does_not_come_back_has_one_pass() -> None:
    frame = FrenetFrame.from_points(roads.bend(12.0, 60.0))
    assert passes(frame) == [(-np.inf, np.inf)]
    points = frame.to_cartesian(np.array([3.0, 20.0, 50.0]), 1.5)
    np.testing.assert_array_equal(every_pass(frame, points)[0], frame.to_frenet(points))


def test_a_reference_around_a_ring_keeps_its_own_lap(tmp_path: Path) -> None:
    radius, v = 15.0, 7.0
    scene = made(tmp_path, ring(radius, 4), AWAY, on_ring(radius, 0.3, v), 18.0)
    t = np.arange(0.0, 18.01, 0.1)
    angle = 0.3 + v * t / radius
    import repair

    given = np.stack([t, radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    found = repair.repair(scene, reference=given)
    assert found.status.value == "no_conflict", found.search.conflict
    assert np.diff(found.prepared.reference.sample(t[:-1]).position[:, 0]).min() > 0.0
