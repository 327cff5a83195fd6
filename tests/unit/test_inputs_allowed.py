"""What the format allows and few files have: each kind in several variants, as a file and as objects."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests import roads

import repair
from repair.certify.recompute import certify
from repair.config import load_config
from repair.preparation import prepare

BACKENDS = ("ego", "casadi", "qptr")
Load = Callable[..., repair.Scene]


def objects(file: Path):
    from commonroad.common.file_reader import CommonRoadFileReader

    scenario, problems = CommonRoadFileReader(str(file)).open()
    return scenario, next(iter(problems.planning_problem_dict.values()))


@pytest.fixture(params=["file", "objects"])
def load(request: pytest.FixtureRequest, tmp_path: Path) -> Load:
    """A scene of a text, read from a file or through CommonRoad's objects."""

    def loaded(text: str, **keys: object) -> repair.Scene:
        file = tmp_path / "ZAM_Test-1_1_T-1.xml"
        file.write_text(text, encoding="utf-8")
        if request.param == "file":
            return repair.load_scene(file, **keys)
        return repair.scene_from_scenario(*objects(file), **keys)

    return loaded


def answer(scene: repair.Scene, backend: str = "casadi", *keys: str) -> repair.RepairResult:
    return repair.repair(scene, backend=backend, overrides=["reference.source=constant", *keys])


def conflict(scene: repair.Scene):
    return prepare(scene, load_config(overrides=["reference.source=constant"])).conflict


def accepted(result: repair.RepairResult, file: Path, folder: Path) -> None:
    """By the certificate, and by CommonRoad's own checks on the file that is written."""
    from commonroad.common.solution import CommonRoadSolutionReader
    from commonroad.planning.planning_problem import PlanningProblemSet
    from commonroad_dc.feasibility import solution_checker

    written = [f for f in result.save(folder, figure=False) if f.name.startswith("solution_")]
    assert [row for row in certify(folder).rows if row.claim and not row.ok] == []
    problems = PlanningProblemSet([objects(file)[1]])
    assert solution_checker.starts_at_correct_state(CommonRoadSolutionReader.open(str(written[0])), problems)


# -- ids are names -------------------------------------------------------------------------------------


@pytest.mark.thinned(5)
@pytest.mark.parametrize("huge", [2**63 - 1, 2**63, 2**64 + 5, 10**20])
@pytest.mark.parametrize("backend", BACKENDS)
def test_ids_of_any_size(huge: int, backend: str, load: Load) -> None:
    usual, far = (
        answer(
            load(
                roads.scenario(
                    road=roads.lanelet(1 + n, range(0, 401, 20), [0.0] * 21),
                    obstacles=roads.driving(30 + n, 45.0, 0.0, 2.0),
                    problems=roads.problem(100 + n),
                )
            ),
            backend,
        )
        for n in (0, huge)
    )
    assert (far.status, far.ttc, far.f_ttr) == (usual.status, usual.ttc, usual.f_ttr)
    assert usual.status is repair.SearchStatus.FOUND
    assert far.to_dict()["conflict"]["obstacle_id"] == 30 + huge
    assert far.prepared.scene.route_lanelets == (1 + huge,)


def test_an_id_of_any_size_in_the_files(tmp_path: Path) -> None:
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(obstacles=roads.driving(2**70, 45.0, 0.0, 2.0)), encoding="utf-8")
    accepted(answer(file), file, tmp_path / "out")
    assert repair.load_result(tmp_path / "out").record["conflict"]["obstacle_id"] == 2**70
    followed = repair.repair(file, overrides=["reference.source=recorded", f"reference.obstacle_id={2**70}"])
    assert followed.status is repair.SearchStatus.NO_CONFLICT


# -- a start without velocity --------------------------------------------------------------------------


def without_velocity(kind: str) -> str:
    leave = ("velocity", "acceleration")
    start = roads.state(45.0, 0.0, leave=leave)
    if kind == "trajectory":
        states = "".join(roads.state(45.0 + 0.2 * k, 0.0, k=k, v=2.0, tag="state") for k in range(1, 41))
        return roads.car(30, start, f"<trajectory>{states}</trajectory>")
    if kind == "nowhere a velocity":
        states = "".join(
            roads.state(45.0 + 0.2 * k, 0.0, k=k, leave=leave, tag="state") for k in range(1, 41)
        )
        return roads.car(30, start, f"<trajectory>{states}</trajectory>")
    if kind == "sets":
        return roads.car(30, start, stated({k: 45.0 + 0.2 * k for k in range(1, 41)}))
    return roads.car(30, start)


@pytest.mark.thinned(3)
@pytest.mark.parametrize("kind", ["trajectory", "nowhere a velocity", "sets", "no prediction"])
@pytest.mark.parametrize("after", ["remove", "constant_velocity"])
def test_a_start_without_velocity(kind: str, after: str, load: Load) -> None:
    scene = load(roads.scenario(obstacles=without_velocity(kind)), after_prediction=after)
    found = conflict(scene)
    gap = 45.0 - 20.0 - 2.25 - scene.vehicle.half_length
    closing = 10.0 if kind == "no prediction" else 8.0
    assert found.contact_time == pytest.approx(gap / closing, abs=0.1 if kind == "sets" else 5e-3)
    if kind == "no prediction":
        assert any("stand still" in note for note in scene.notes)


@pytest.mark.thinned(3)
@pytest.mark.parametrize("kind", ["trajectory", "nowhere a velocity", "sets", "no prediction"])
def test_a_start_without_velocity_is_certified(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(obstacles=without_velocity(kind)), encoding="utf-8")
    result = answer(file)
    assert result.status is repair.SearchStatus.FOUND
    accepted(result, file, tmp_path / "out")


# -- sets that start late or pause ---------------------------------------------------------------------


def stated(places: dict[object, float], size: tuple[float, float] = (4.5, 1.8)) -> str:
    """Sets around x at the steps, or over the intervals of steps."""
    made = ""
    for step, x in places.items():
        shape = (
            f"<rectangle><length>{size[0]}</length><width>{size[1]}</width>"
            f"<center><x>{x}</x><y>0.0</y></center></rectangle>"
        )
        time = (
            roads.exact("time", step)
            if isinstance(step, int)
            else f"<time><intervalStart>{step[0]}</intervalStart><intervalEnd>{step[1]}</intervalEnd></time>"  # type: ignore[index]
        )
        made += f"<occupancy><shape>{shape}</shape>{time}</occupancy>"
    return f"<occupancySet>{made}</occupancySet>"


#: Steps at which a set stands 40 m ahead (the ego is there from step 36 to 44), and the steps about
#: which the sets say nothing.
THERE = {
    "late": (range(20, 61), [(1, 19)], True),
    "late interval": ([(20, 60)], [(1, 19)], True),
    "pauses before": ([*range(1, 10), *range(20, 61)], [(10, 19)], True),
    "pauses between intervals": ([(1, 9), (20, 25), (30, 60)], [(10, 19), (26, 29)], True),
    "pauses while the ego passes": ([*range(1, 15), *range(55, 61)], [(15, 54)], False),
    "late, after the ego has passed": (range(55, 61), [(1, 54)], False),
}


def pausing(which: str) -> str:
    steps = THERE[which][0]
    far = roads.state(300.0, 0.0, v=0.0)  # where it starts, out of the way
    return roads.scenario(
        obstacles=roads.car(30, far, stated(dict.fromkeys(steps, 60.0))),
        problems=roads.problem(
            goal="<goalState><time><intervalStart>59</intervalStart><intervalEnd>60</intervalEnd></time>"
            "</goalState>"
        ),
    )


@pytest.mark.thinned(2)
@pytest.mark.parametrize("which", THERE)
def test_sets_that_start_late_or_pause(which: str, load: Load) -> None:
    scene = load(pausing(which))
    _, gaps, meets = THERE[which]
    said = [n for n in scene.notes if "absent" in n]
    assert said == [
        f"obstacle 30 is absent from time step {a} to {b}, for which its occupancies say nothing"
        for a, b in gaps
    ]
    absent = np.isnan(scene.obstacles[0].vertices[:, 0, 0])
    assert np.flatnonzero(absent).tolist() == [k for a, b in gaps for k in range(a, b + 1)]
    found = conflict(scene)
    if meets:
        gap = 60.0 - 2.25 - 20.0 - scene.vehicle.half_length
        assert found.contact_time == pytest.approx(gap / 10.0, abs=5e-3)
    else:
        assert found.kind == "none"


@pytest.mark.thinned(3)
@pytest.mark.parametrize("which", ["late interval", "pauses before", "pauses while the ego passes"])
def test_sets_that_start_late_or_pause_in_the_files(which: str, tmp_path: Path) -> None:
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(pausing(which), encoding="utf-8")
    result = answer(file)
    assert result.status.value == ("found" if THERE[which][2] else "no_conflict")
    accepted(result, file, tmp_path / "out")


@pytest.mark.thinned(2)
@pytest.mark.parametrize("which", THERE)
def test_commonroads_own_check_reads_the_same_sets(which: str, load: Load) -> None:
    """The straight drive meets them or not, by the drivability checker on what it is handed."""
    from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_checker
    from commonroad_dc.pycrcc import RectOBB, TimeVariantCollisionObject

    scene = load(pausing(which))
    ego = TimeVariantCollisionObject(0)
    for k in range(scene.n_steps + 1):
        half = scene.vehicle.half_length, scene.vehicle.half_width
        ego.append_obstacle(RectOBB(*half, 0.0, 20.0 + 1.0 * k, 0.0))
    assert create_collision_checker(scene.official()).collide(ego) is THERE[which][2]


def test_an_obstacle_that_appears_late(load: Load) -> None:
    """Its initial state itself is at a later step."""
    states = "".join(roads.state(60.0, 0.0, k=k, v=0.0, tag="state") for k in range(21, 61))
    late = roads.car(30, roads.state(60.0, 0.0, k=20, v=0.0), f"<trajectory>{states}</trajectory>")
    scene = load(roads.scenario(obstacles=late))
    assert np.flatnonzero(np.isfinite(scene.obstacles[0].rectangles[:, 0]))[0] == 20
    assert conflict(scene).contact_time == pytest.approx((37.75 - scene.vehicle.half_length) / 10.0, abs=5e-3)


# -- no prediction -------------------------------------------------------------------------------------


@pytest.mark.thinned(3)
@pytest.mark.parametrize("heading", [0.0, math.pi / 2, 2 * math.pi, -1.5 * math.pi])
@pytest.mark.parametrize("speed", [12.0, 3.0])
def test_without_a_prediction(heading: float, speed: float, load: Load) -> None:
    """It stands, which is noted; or moves on along its heading, where that is asked for."""
    place = (45.0, 0.0) if math.cos(heading) > 0.5 else (45.0, -7.0)
    text = roads.scenario(obstacles=roads.car(30, roads.state(*place, heading=heading, v=speed)))
    standing = load(text)
    assert any("has no prediction and is taken to stand still" in n for n in standing.notes)
    np.testing.assert_allclose(standing.obstacles[0].rectangles[-1, :2], place)
    moving = load(text, after_prediction="constant_velocity")
    time = moving.times[10]
    there = place + speed * time * np.array([math.cos(heading), math.sin(heading)])
    np.testing.assert_allclose(moving.obstacles[0].rectangles[10, :2], there, atol=1e-9)
    assert not any("stand still" in n for n in moving.notes)
    held = load(text, after_prediction="hold")
    np.testing.assert_allclose(held.obstacles[0].rectangles[-1, :2], place)


@pytest.mark.parametrize("speed, kind", [(12.0, "none"), (3.0, "margin")])
def test_without_a_prediction_in_the_files(speed: float, kind: str, tmp_path: Path) -> None:
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(
        roads.scenario(obstacles=roads.car(30, roads.state(45.0, 0.0, v=speed))), encoding="utf-8"
    )
    result = answer(file, "casadi", "scene.after_prediction=constant_velocity")
    assert result.search.conflict.kind == kind
    accepted(result, file, tmp_path / "out")


# -- headings in [-2 pi, 2 pi] -------------------------------------------------------------------------

TURN = 2 * math.pi
HEADINGS = [-TURN, -1.999 * math.pi, -math.pi, math.pi, 1.999 * math.pi, TURN]


def turned(ego: float, other: float) -> str:
    """A road along the ego's heading, whichever number that is, with a slower car ahead."""
    back = math.cos(ego) < 0.0
    x = range(400, -1, -20) if back else range(0, 401, 20)
    road = roads.lanelet(1, x, [0.0] * 21, width=-3.5 if back else 3.5)
    sign = -1.0 if back else 1.0
    begin, place = (380.0, 355.0) if back else (20.0, 45.0)
    states = "".join(
        roads.state(place + 0.2 * sign * k, 0.0, k=k, heading=other, v=2.0, tag="state") for k in range(1, 41)
    )
    ahead = roads.car(30, roads.state(place, 0.0, heading=other, v=2.0), f"<trajectory>{states}</trajectory>")
    return roads.scenario(
        road=road, obstacles=ahead, problems=roads.problem(start=roads.state(begin, 0.0, heading=ego))
    )


@pytest.mark.thinned(2)
@pytest.mark.parametrize("heading", HEADINGS)
def test_headings_of_more_than_half_a_turn(heading: float, load: Load) -> None:
    usual = 0.0 if math.cos(heading) > 0.0 else math.pi
    small = math.remainder(heading - usual, TURN)
    found = conflict(load(turned(heading, heading)))
    plain = conflict(load(turned(usual + small if not usual else heading, usual)))
    assert (found.kind, found.time) == (plain.kind, plain.time)
    assert found.contact_time == pytest.approx(plain.contact_time, abs=2e-3)


@pytest.mark.thinned(5)
@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize("backend", ["ego", "casadi"])
def test_the_written_heading_is_in_the_same_turn(heading: float, backend: str, tmp_path: Path) -> None:
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(turned(heading, math.remainder(heading, TURN)), encoding="utf-8")
    result = answer(file, backend)
    assert result.status is repair.SearchStatus.FOUND
    written = [state.orientation for state in result.trajectory.state_list]
    assert written[0] == pytest.approx(heading, abs=1e-3)
    assert max(abs(h) for h in written) <= TURN
    accepted(result, file, tmp_path / "out")


# -- neighbours whose common outline crosses itself ----------------------------------------------------


@pytest.mark.parametrize("begin", [20.0, 110.0, 200.0, 300.0])
def test_a_lane_is_road_whatever_its_neighbours_enclose(begin: float, load: Load) -> None:
    """The neighbour to the left ends on the right, so that the ring around both crosses itself."""
    x = list(range(0, 401, 20))
    other = [4.0 - 12.0 * a / 400.0 for a in x]
    road = roads.lanelet(1, x, [0.0] * 21, width=4.0, more='<adjacentLeft ref="2" drivingDir="same"/>')
    road += roads.lanelet(2, x, other, width=4.0, more='<adjacentRight ref="1" drivingDir="same"/>')
    scene = load(
        roads.scenario(road=road, obstacles="", problems=roads.problem(start=roads.state(begin, 0.0))),
        horizon=5.0,
    )
    assert conflict(scene).kind == "none"
