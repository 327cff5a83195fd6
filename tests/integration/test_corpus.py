"""The corpus test on a few generated files: it says yes where all is well, and notices what is not."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from tests import roads
from tests.corpus.__main__ import main
from tests.corpus.examine import examine
from tests.corpus.maps import KINDS, Map, NoMaps, situation, situations
from tests.corpus.moving import CHANGES, changed, moved
from tests.corpus.records import Examined, Settings
from tests.corpus.report import report, violated

import repair
from repair.check.conflict import detect_conflict

QUICK = Settings(("ego",), ("constant",))
ADJACENT = '<adjacentLeft ref="2" drivingDir="opposite"/>'
TURN = "<rectangle><length>8.0</length><width>2.0</width><orientation>0.3</orientation>{}</rectangle>"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "ZAM_Test-1_1_T-1.xml"
    path.write_text(roads.scenario(), encoding="utf-8")
    return path


def kinds(found: Examined) -> set[str]:
    return {d.kind for d in found.deviations}


# -- all is well -----------------------------------------------------------------------------------


@pytest.mark.exhaustive
def test_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """``python -m tests.corpus FOLDER`` with a file in a folder below, one that is refused, and protobuf."""
    (tmp_path / "below").mkdir()
    (tmp_path / "ahead.xml").write_text(roads.scenario(), encoding="utf-8")
    quicker = roads.scenario(obstacles=roads.driving(30, 45.0, 0.0, 5.0))
    (tmp_path / "below" / "quicker.xml").write_text(quicker, encoding="utf-8")
    (tmp_path / "broken.xml").write_text("<commonRoad", encoding="utf-8")
    (tmp_path / "other.pb").write_bytes(b"\x00")
    code = main([str(tmp_path), "--backends", "ego", "qptr", "--references", "constant"])
    said = capsys.readouterr()
    assert code == 0, said.out
    assert "Nothing is violated" in said.out
    assert "Files        3, of which 1 refused" in said.out
    assert "Refused      broken.xml is not XML" in said.out
    assert "1 protobuf files are left out" in said.err
    assert "3/3 " in said.err
    assert "2 contact times of references" in said.out


def test_all_backends_and_references(file: Path) -> None:
    found = examine(file, Settings(references=("constant", "planner")))
    assert found.deviations == []
    assert len(found.rows) == 6
    assert all(row.verified for row in found.rows if row.status == "found")
    assert found.counts["official checks"] == 6
    assert found.counts["compared after a change"] == 18


def test_an_empty_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as stop:
        main([str(tmp_path)])
    assert stop.value.code == 2


# -- what is not well is noticed -------------------------------------------------------------------


def told(monkeypatch: pytest.MonkeyPatch, **changes: object) -> None:
    """Make every reference's conflict another one."""

    def other(*arguments: object):
        conflict, verdict = detect_conflict(*arguments)  # type: ignore[arg-type]
        return replace(conflict, **changes), verdict

    monkeypatch.setattr("repair.preparation.detect_conflict", other)


@pytest.mark.thinned(3)
@pytest.mark.parametrize(
    "changes, kind",
    [
        ({"contact_time": 2.45}, "contact"),
        ({"contact_time": math.inf}, "contact"),
        ({"time": 2.9}, "ttc"),
        ({"time": 2.0}, "ttc"),
        ({"time": 1.5, "kind": "off_road"}, "off_road"),
    ],
)
def test_a_wrong_conflict(
    changes: dict[str, object], kind: str, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told(monkeypatch, **changes)
    assert kind in kinds(examine(file, replace(QUICK, invariance=False)))


def test_a_reference_off_the_road_that_nobody_told(tmp_path: Path) -> None:
    """Without our own check of the road, on a road that ends."""
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    short = roads.lanelet(1, range(0, 41, 20), [0.0] * 3)
    file.write_text(
        roads.scenario(road=short, obstacles=roads.driving(30, 300.0, 0.0, 2.0)), encoding="utf-8"
    )
    found = examine(file, replace(QUICK, invariance=False, overrides=("checker.road=false",)))
    assert "off_road" in kinds(found)


def test_a_start_beside_the_road_is_rightly_off_it(tmp_path: Path) -> None:
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    beside = roads.problem(start=roads.state(20.0, 1.4))
    file.write_text(roads.scenario(obstacles="", problems=beside), encoding="utf-8")
    found = examine(file, replace(QUICK, invariance=False))
    assert (found.rows[0].ttc, kinds(found)) == (0.0, set())


def test_a_traceback(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("repair.preparation.detect_conflict", lambda *_: 1 / 0)
    found = examine(file, replace(QUICK, invariance=False))
    assert kinds(found) == {"traceback"}
    assert "ZeroDivisionError" in found.deviations[0].reason


def test_a_refusal_that_is_no_sentence(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise repair.RepairError("two\nlines")

    monkeypatch.setattr(repair, "load_scene", refuse)
    assert kinds(examine(file, QUICK)) == {"refusal"}


def test_what_commonroad_does_not_accept(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    no = SimpleNamespace(feasible=False, collision_free=True, on_road=True, road_method="none")
    monkeypatch.setattr("repair.io.official.check_solution_file", lambda *_: no)
    found = examine(file, replace(QUICK, invariance=False))
    assert kinds(found) == {"official"}
    assert not any(row.verified for row in found.rows)


def test_a_trajectory_into_an_obstacle(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reference handed out as if it had no conflict."""
    told(monkeypatch, time=math.inf, kind="none")
    assert {"trajectory", "official"} <= kinds(examine(file, replace(QUICK, invariance=False)))


@pytest.mark.exhaustive
def test_backends_that_do_not_agree(file: Path) -> None:
    """One that finds nothing; where others may be asked instead, they agree."""
    found = examine(file, Settings(("ego", "casadi"), ("constant",), invariance=False))
    assert violated([found]) == []
    alone = Settings(("casadi", "worthless"), ("constant",), invariance=False, overrides=("fallback=[]",))
    few = examine(file, alone)
    assert violated([few]) == ["agreement"]
    assert "worthless 1" in report([few])
    assert "not solved on purpose" in report([few])
    helped = examine(file, replace(alone, overrides=("fallback=[ego]",)))
    assert violated([helped]) == []
    assert "1 of these by a fallback of worthless: 1" in report([helped])


@pytest.fixture(autouse=True, scope="module")
def worthless():
    """A backend that solves nothing; taken back afterwards, as the names of all backends are documented."""
    from repair.backend.base import Capabilities, SolveResult, SolveStatus
    from repair.solvers.registry import BACKENDS

    class Worthless:
        name, capabilities = "worthless", Capabilities()

        def solve(self, problem, *, warm_start=None, time_limit=None):
            return SolveResult(SolveStatus.INFEASIBLE, None, detail="not solved on purpose")

    repair.register_backend("worthless", lambda config: Worthless())
    yield
    BACKENDS.unregister("worthless")


def test_an_answer_that_hangs_on_the_place(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A change that is none of place alone: the obstacles are moved, the ego is not."""

    def shifted(root: ElementTree.Element) -> None:
        for other in root.iter("dynamicObstacle"):
            for x in other.iter("x"):
                x.text = repr(float(x.text or 0.0) + 7.0)

    monkeypatch.setattr("tests.corpus.examine.CHANGES", {"moved": shifted})
    found = examine(file, QUICK)
    assert kinds(found) == {"moved"}
    assert violated([found]) == ["invariance"]


# -- moving, turning, mirroring --------------------------------------------------------------------


def everything() -> bytes:
    """A bend, a sign, a set in the plane, a body with a shape of its own, a goal with place and heading."""
    line = roads.bend(60.0, 120.0)
    road = roads.lanelet(
        1, line[:, 0], list(line[:, 1]), more='<adjacentLeft ref="2" drivingDir="opposite"/>'
    )
    road += roads.lanelet(2, line[::-1, 0], list(line[::-1, 1] + 3.5), more="")
    body = roads.car(30, roads.state(40.0, 0.5, heading=0.1, v=2.0), shape=TURN.format(""))
    sets = f"<occupancy><shape>{TURN.format('<center><x>50.0</x><y>1.0</y></center>')}</shape>"
    sets += "<time><intervalStart>1</intervalStart><intervalEnd>9</intervalEnd></time></occupancy>"
    body += roads.car(31, roads.state(50.0, 1.0, v=1.0), f"<occupancySet>{sets}</occupancySet>")
    place = "<circle><radius>3.0</radius><center><x>60.0</x><y>8.0</y></center></circle>"
    goal = f"<goalState><position>{place}</position>"
    goal += "<orientation><intervalStart>0.2</intervalStart><intervalEnd>0.9</intervalEnd></orientation>"
    goal += "<time><intervalStart>30</intervalStart><intervalEnd>40</intervalEnd></time></goalState>"
    return roads.scenario(road=road, obstacles=body, problems=roads.problem(goal=goal)).encode()


def read(data: bytes):
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.common.util import FileFormat

    scenario, problems = CommonRoadFileReader(data, FileFormat.XML).open()
    return scenario, problems.planning_problem_dict[100]


def numbers(data: bytes) -> list[float]:
    """Everything with a place or a heading, by commonroad-io."""
    scenario, problem = read(data)
    found = [np.ravel(lane.left_vertices) for lane in scenario.lanelet_network.lanelets]
    for other in scenario.dynamic_obstacles:
        found += [other.initial_state.position, [other.initial_state.orientation]]
        for shape in [o.shape for o in getattr(other.prediction, "occupancy_set", [])]:
            found += [shape.center, [shape.orientation]]
    goal = problem.goal.state_list[0]
    found += [problem.initial_state.position, goal.position.center]
    found += [[problem.initial_state.orientation, goal.orientation.start, goal.orientation.end]]
    return [float(v) for v in np.concatenate([np.ravel(f) for f in found])]


def test_moving_is_what_commonroad_does() -> None:
    """For what its own ``translate_rotate`` moves: first moved, then turned."""
    data = everything()
    scenario, problem = read(data)
    shift, turn = [12.0, -7.0], 0.7
    scenario.translate_rotate(np.array(shift), turn)
    problem.translate_rotate(np.array(shift), turn)
    ours, its = read(changed(changed(data, moved(0.0, *shift)), moved(turn, 0.0, 0.0)))
    for a, b in zip(ours.lanelet_network.lanelets, scenario.lanelet_network.lanelets, strict=True):
        np.testing.assert_allclose(a.left_vertices, b.left_vertices, atol=1e-9)
    for a, b in zip(ours.dynamic_obstacles, scenario.dynamic_obstacles, strict=True):
        np.testing.assert_allclose(a.initial_state.position, b.initial_state.position, atol=1e-9)
        assert a.initial_state.orientation == pytest.approx(b.initial_state.orientation)
        assert a.obstacle_shape == b.obstacle_shape
    a, b = (
        o[1].prediction.occupancy_set[0].shape for o in (ours.dynamic_obstacles, scenario.dynamic_obstacles)
    )
    np.testing.assert_allclose(a.vertices, b.vertices, atol=1e-9)
    a, b = its.goal.state_list[0], problem.goal.state_list[0]
    np.testing.assert_allclose(a.position.center, b.position.center, atol=1e-9)
    assert (a.orientation.start, a.orientation.end) == pytest.approx((b.orientation.start, b.orientation.end))


@pytest.mark.parametrize("name", CHANGES)
def test_there_and_back(name: str) -> None:
    data = everything()
    back = {"moved": moved(0.0, -1234.5, 678.25), "turned": moved(-2.0, 0.0, 0.0)}.get(name, CHANGES[name])
    once = changed(data, CHANGES[name])
    np.testing.assert_allclose(numbers(changed(once, back)), numbers(data), atol=1e-9)
    assert np.abs(np.subtract(numbers(once), numbers(data))).max() > 0.1


def test_mirrored_lanes_have_their_neighbours_on_the_other_side() -> None:
    lane = read(changed(everything(), CHANGES["mirrored"]))[0].lanelet_network.find_lanelet_by_id(1)
    assert (lane.adj_left, lane.adj_right) == (None, 2)
    inward = lane.left_vertices[0] - lane.right_vertices[0]
    assert inward[1] > 0.0


def test_a_body_off_its_centre_is_not_turned() -> None:
    for body, turns in (
        (TURN.format("<center><x>1.0</x><y>0.0</y></center>"), False),
        (f"<polygon>{roads.point(0, 0)}{roads.point(2, 0)}{roads.point(0, 1)}</polygon>", False),
        (f"<polygon>{roads.point(-1, -1)}{roads.point(1, -1)}{roads.point(0, 2)}</polygon>", True),
        ("<circle><radius>1.0</radius></circle>", True),
    ):
        data = roads.scenario(obstacles=roads.car(9, roads.state(40.0, 0.0), shape=body)).encode()
        assert (changed(data, CHANGES["turned"]) is not None) is turns
        assert changed(data, CHANGES["mirrored"]) is not None


def test_velocities_by_component_are_left_alone() -> None:
    text = roads.scenario().replace("<velocity>", "<velocityY><exact>0.0</exact></velocityY><velocity>", 1)
    assert changed(text.encode(), CHANGES["turned"]) is None


# -- maps ------------------------------------------------------------------------------------------


@pytest.fixture
def road(tmp_path: Path) -> Map:
    """Three lanes one after the other, as a map without traffic."""
    parts = [
        roads.lanelet(k, range(100 * k, 100 * k + 101, 10), [0.0] * 11, width=4.0,
                      more=f'<successor ref="{k + 1}"/>' * (k < 3))
        for k in (1, 2, 3)
    ]  # fmt: skip
    path = tmp_path / "map.xml"
    path.write_text(roads.scenario(road="".join(parts), obstacles="", problems=""), encoding="utf-8")
    return Map(path)


def test_situations_on_a_map(road: Map, tmp_path: Path) -> None:
    """The same seed makes the same file; each kind of traffic can be read and is met by somebody."""
    met: set[str] = set()
    for seed in range(12):
        data = situation(road, random.Random(seed))
        assert data == situation(road, random.Random(seed))
        file = tmp_path / f"{seed}.xml"
        file.write_bytes(data)
        scene = repair.load_scene(file)
        assert not any("never there" in note for note in scene.notes)
        met |= {o.role for o in scene.obstacles}
    assert met == {"static", "dynamic", "set_based"}
    assert len(KINDS) == 8


def answer_of(file: Path) -> set[str]:
    return kinds(examine(file, replace(QUICK, invariance=False)))


@pytest.mark.exhaustive
def test_a_few_situations_are_judged(road: Map, tmp_path: Path) -> None:
    for seed in range(3):
        file = tmp_path / f"{seed}.xml"
        file.write_bytes(situation(road, random.Random(seed)))
        assert answer_of(file) == set()


@pytest.mark.exhaustive
@pytest.mark.network
def test_real_maps(tmp_path: Path) -> None:
    """No traceback and no false ``off_road`` on 41 real maps; ``python -m tests.corpus --maps`` says more."""
    try:
        files = situations(tmp_path, 200)
    except NoMaps as reason:
        pytest.skip(str(reason))
    wrong = [d for f in files for d in examine(f, replace(QUICK, invariance=False)).deviations if not d.told]
    assert not wrong, "\n".join(f"{d.file}: {d.kind}: {d.reason}" for d in wrong)
