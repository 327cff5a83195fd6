"""Maps as they are drawn: gaps, holes, overlaps, steps aside and lanes against the traffic."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import repair
import roads
from repair.cli.command import main
from repair.errors import ScenarioError

AWAY = roads.car(11, roads.state(900.0, 900.0, v=0.0))
SLOW = roads.driving(30, 40.0, 0.0, 3.0, range(1, 71))
FAR = 250.0


def more(*values: float) -> list[object]:
    return [pytest.param(value, marks=pytest.mark.exhaustive) for value in values]


def straight(first: float, last: float, y: float = 0.0, spacing: float = 5.0) -> np.ndarray:
    x = np.append(np.arange(first, last, spacing), last)
    return np.stack([x, np.full(len(x), y)], axis=1)


def two(end: float, begin: float, y: float = 0.0, *, width: float = 4.0) -> str:
    return roads.strip(1, straight(-50.0, end), after=[2], width=width) + roads.strip(
        2, straight(begin, FAR, y), before=[1], width=width
    )


def loaded(folder: Path, road: str, obstacles: str = SLOW, start: str | None = None, last: int = 60):
    file = folder / "seam.xml"
    time = f"<time><intervalStart>1</intervalStart><intervalEnd>{last}</intervalEnd></time>"
    problem = roads.problem(
        start=start or roads.state(0.0, 0.0, v=12.0), goal=f"<goalState>{time}</goalState>"
    )
    file.write_text(roads.scenario(road=road, obstacles=obstacles, problems=problem))
    return repair.load_scene(file)


def answer(scene, backend: str = "casadi", *more: str):
    return repair.repair(scene, backend=backend, overrides=["reference.source=constant", *more])


@pytest.fixture(scope="module")
def seamless(tmp_path_factory) -> dict[str, object]:
    """What each backend answers on the same road without a fault."""
    scene = loaded(tmp_path_factory.mktemp("seam"), two(20.0, 20.0))
    return {name: answer(scene, name) for name in ("ego", "casadi", "qptr")}


def same(found, wanted) -> None:
    assert found.status is wanted.status
    assert found.ttc == pytest.approx(wanted.ttc, abs=1e-9)
    assert found.f_ttr == pytest.approx(wanted.f_ttr, abs=1e-9)


@pytest.mark.parametrize("gap", [0.001, 0.2, 0.35, *more(0.03, 0.1, 0.3)])
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_a_gap_to_the_successor_is_road(tmp_path: Path, seamless, backend: str, gap: float) -> None:
    scene = loaded(tmp_path, two(20.0, 20.0 + gap))
    found = answer(scene, backend)
    same(found, seamless[backend])
    said = [
        note for note in found.prepared.notes if "(20.0, " in note or "(20.1, " in note or "(20.2, " in note
    ]
    assert any("begins" in note and f"{gap:.2f}"[:4] in note for note in said) or gap < 0.1
    assert any("counts as road" in note for note in said)


@pytest.mark.parametrize("gap", [0.4, 0.6, 2.0])
def test_a_missing_strip_stays_missing(tmp_path: Path, gap: float) -> None:
    found = answer(loaded(tmp_path, two(20.0, 20.0 + gap), AWAY))
    assert found.search.conflict.kind == "off_road"
    assert found.ttc == pytest.approx((20.0 - 2.149) / 12.0, abs=0.11)


def test_the_size_of_a_gap_that_is_road_is_a_setting(tmp_path: Path) -> None:
    scene = loaded(tmp_path, two(20.0, 20.05), AWAY)
    assert answer(scene, "ego").status.value == "no_conflict"
    assert answer(scene, "ego", "checker.road_gap=0").search.conflict.kind == "off_road"


@pytest.mark.thinned(4)
@pytest.mark.parametrize("gap", [0.001, 0.1, 0.35])
@pytest.mark.parametrize("declared", [True, False])
def test_a_gap_to_the_neighbour_is_road(tmp_path: Path, gap: float, declared: bool) -> None:
    """The ego goes around a standing car by way of the lane beside it; CommonRoad's own boundary check has no
    road between lanes that do not know of each other, so that has to be asked for."""
    more = [] if declared else ["checker.gaps=always"]
    left = '<adjacentLeft ref="2" drivingDir="same"/>' if declared else ""
    right = '<adjacentRight ref="1" drivingDir="same"/>' if declared else ""
    road = roads.strip(1, straight(-50.0, FAR), more=left)
    road += roads.strip(2, straight(-50.0, FAR, 4.0 + gap), more=right)
    standing = roads.car(30, roads.state(90.0, 0.0, v=0.0))
    fast = roads.state(0.0, 0.0, v=25.0)
    found = answer(loaded(tmp_path, road, standing, fast), "casadi", *more)
    apart = answer(loaded(tmp_path, roads.strip(1, straight(-50.0, FAR)), standing, fast))
    assert found.status.value == "found"
    assert found.f_ttr > apart.f_ttr
    assert found.search.best.maneuver.value == "left"


def holed(side: float, length: float) -> str:
    """A lane with a hole on its axis: drawn around it by the lanelets' own bounds."""
    half = 0.5 * length
    upper = "".join(
        roads.point(x, y)
        for x, y in [(-50, 0), (30 - half, 0), (30 - half, side), (30 + half, side), (30 + half, 0), (FAR, 0)]
    )
    outer = "".join(roads.point(x, 2.0) for x in (-50, 20, 28, 32, 40, FAR))
    lower = "".join(roads.point(x, 0.0) for x in (-50, 20, 28, 32, 40, FAR))
    under = "".join(roads.point(x, -2.0) for x in (-50, 20, 28, 32, 40, FAR))
    return (
        f'<lanelet id="1"><leftBound>{lower}</leftBound><rightBound>{under}</rightBound></lanelet>'
        f'<lanelet id="2"><leftBound>{outer}</leftBound><rightBound>{upper}</rightBound></lanelet>'
    )


@pytest.mark.parametrize("side, length", [(0.2, 0.2), (0.2, 0.8), (0.3, 0.3)])
def test_a_small_hole_is_road(tmp_path: Path, side: float, length: float) -> None:
    start = roads.state(0.0, 0.2, v=12.0)
    found = answer(loaded(tmp_path, holed(side, length), AWAY, start), "ego")
    assert found.status.value == "no_conflict", found.search.conflict
    assert any("counts as road" in note for note in found.prepared.notes)


def test_a_large_hole_is_none(tmp_path: Path) -> None:
    found = answer(loaded(tmp_path, holed(1.0, 1.0), AWAY, roads.state(0.0, 0.2, v=12.0)), "ego")
    assert found.search.conflict.kind == "off_road"


@pytest.mark.parametrize("overlap", [1.0, 4.0, 8.0, *more(0.3, 2.0, 6.0)])
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_a_successor_may_begin_before_its_predecessor_ends(
    tmp_path: Path, seamless, backend: str, overlap: float
) -> None:
    scene = loaded(tmp_path, two(20.0, 20.0 - overlap))
    np.testing.assert_allclose(scene.frame.heading_table, 0.0, atol=1e-6)
    found = answer(scene, backend)
    same(found, seamless[backend])
    assert any(f"begins {overlap:.2f} m before" in note for note in scene.notes)


@pytest.mark.parametrize("overlap", [0.0, 4.0])
@pytest.mark.parametrize("step", [-0.5, 0.1, 0.3, 0.6])
def test_a_step_aside_at_a_joint_can_be_driven(tmp_path: Path, step: float, overlap: float) -> None:
    scene = loaded(tmp_path, two(40.0, 40.0 - overlap, step), AWAY)
    found = answer(scene, "ego")
    assert found.status.value == "no_conflict", found.search.conflict
    assert np.abs(scene.frame.curvature_table).max() * 12.0**2 < 2.5
    assert float(scene.frame.position(scene.start[0, 0] + 100.0)[1]) == pytest.approx(step, abs=0.05)
    assert any(f"begins {abs(step):.2f} m beside" in note for note in scene.notes)


def test_an_overlap_in_a_bend(tmp_path: Path) -> None:
    line = roads.bend(30.0, 120.0, 1.0)
    road = roads.strip(1, line[:51], after=[2]) + roads.strip(2, line[46:], before=[1])
    scene = loaded(tmp_path, road, AWAY, roads.state(5.0, 0.0, v=8.0))
    assert answer(scene, "ego").status.value == "no_conflict"
    whole = loaded(tmp_path, roads.strip(1, line), AWAY, roads.state(5.0, 0.0, v=8.0))
    assert scene.frame.length == pytest.approx(whole.frame.length, abs=0.3)


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_a_lane_that_is_drawn_against_its_links(tmp_path: Path, seamless, backend: str) -> None:
    road = roads.strip(1, straight(-50.0, 20.0), after=[2])
    road += roads.strip(2, straight(20.0, 80.0)[::-1], before=[1], after=[3])
    road += roads.strip(3, straight(80.0, FAR), before=[2])
    scene = loaded(tmp_path, road)
    assert scene.route_lanelets == (1, 2, 3)
    same(answer(scene, backend), seamless[backend])
    assert any("lanelet 2 is drawn against" in note for note in scene.notes)


def test_a_road_that_is_drawn_against_the_traffic(tmp_path: Path, seamless) -> None:
    road = roads.strip(1, straight(-50.0, 20.0)[::-1], before=[2])
    road += roads.strip(2, straight(20.0, FAR)[::-1], after=[1])
    scene = loaded(tmp_path, road)
    assert scene.route_lanelets == (1, 2)
    same(answer(scene), seamless["casadi"])
    assert any("run against" in note for note in scene.notes)
    with pytest.raises(ScenarioError, match="degrees away"):
        loaded(tmp_path, road, start=roads.state(0.0, 0.0, heading=1.2, v=12.0))


def test_who_starts_on_the_oncoming_lane_belongs_on_the_other(tmp_path: Path) -> None:
    road = roads.strip(1, straight(-50.0, FAR), width=3.5)
    road += roads.strip(2, straight(-50.0, FAR, 3.5)[::-1], width=3.5)
    scene = loaded(tmp_path, road, AWAY, roads.state(0.0, 2.5, v=12.0))
    assert scene.route_lanelets == (1,)
    assert not any("run against" in note for note in scene.notes)


def test_scenarios_lists_what_was_bridged(tmp_path: Path, capsys) -> None:
    road = roads.strip(1, straight(-50.0, 20.0), after=[2]) + roads.strip(
        2, straight(20.2, 90.0), before=[1], after=[3]
    )
    road += roads.strip(3, straight(86.0, FAR, 0.3), before=[2])
    loaded(tmp_path, road)
    assert main(["scenarios", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    for words in (
        "lanelet 2 begins 0.20 m beyond the end of lanelet 1 at (20.0, 0.0)",
        "lanelet 3 begins 4.00 m before the end of lanelet 2 at (90.0, 0.0)",
        "lanelet 3 begins 0.30 m beside the end of lanelet 2",
        "0.20 m wide, counts as road",
        "1 dynamic",
    ):
        assert words in text
    (tmp_path / "no.xml").write_text("<x/>")
    assert main(["scenarios", str(tmp_path)]) == 0
    assert "Error" in capsys.readouterr().out
    assert main(["scenarios", str(tmp_path / "no.xml")]) == 2


def test_a_repair_crosses_gaps_of_the_map_only_where_its_reference_does(tmp_path: Path) -> None:
    """Two lanes, 0.2 m apart and not drawn as neighbours: no way to the side for CommonRoad's check."""
    road = roads.strip(1, straight(-50.0, FAR)) + roads.strip(2, straight(-50.0, FAR, 4.2))
    standing = roads.car(30, roads.state(90.0, 0.0, v=0.0))
    scene = loaded(tmp_path, road, standing, roads.state(0.0, 0.0, v=25.0))
    kept, crossed = (answer(scene, "shooting", f"checker.gaps={gaps}") for gaps in ("as_reference", "always"))
    assert kept.search.best.maneuver.value == "yield"
    assert crossed.search.best.maneuver.value == "left"
    assert crossed.f_ttr > kept.f_ttr
    assert any("crosses a gap of the map" in note for note in crossed.to_dict()["notes"])
    assert not any("crosses a gap of the map" in note for note in kept.to_dict()["notes"])
    refused = [p for p in kept.search.probes if p.t_rep > kept.f_ttr]
    assert any("crosses a gap of the map" in v.detail for p in refused for v in p.verdict.violations)
