"""What is called feasible is so, by a judge of its own; and what must not matter does not."""

from __future__ import annotations

import math
import random
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.crossings import crossing
from tests.judge import judged
from tests.roads import SLOW, car, driving, problem, scenario, state

import repair
from repair import SearchStatus
from repair.cli.command import main

BACKENDS = ("ego", "casadi", "qptr")
FOLLOWED = (SearchStatus.FOUND, SearchStatus.NO_CONFLICT)


def answer(file: Path, backend: str = "casadi", *keys: str) -> repair.RepairResult:
    return repair.repair(file, backend=backend, overrides=["reference.source=constant", *keys])


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    """Write a scenario into a file of its own."""

    def written(text: str) -> Path:
        file = tmp_path / f"{len(list(tmp_path.iterdir()))}.xml"
        file.write_text(text, encoding="utf-8")
        return file

    return written


@pytest.mark.parametrize(
    "seed",
    [*range(1000, 1014), *(pytest.param(k, marks=pytest.mark.exhaustive) for k in range(1014, 1036))],
)
def test_crossing_traffic_is_never_met(seed: int, write: Callable[[str], Path]) -> None:
    """``python -m tests.judge --crossings 2000`` does it at length."""
    case = crossing(seed)
    file = write(case.text)
    result = answer(file, BACKENDS[seed % 3])
    if result.status in FOLLOWED:
        assert judged(result, file) == math.inf, case.words


@pytest.mark.parametrize("name", ["DEU_Flensburg-6_1_T-1", "USA_US101-26_1_T-1", "ZAM_Tjunction-1_84_T-1"])
def test_recorded_traffic_is_never_met(name: str, scenarios: Path) -> None:
    """``python -m tests.judge --folder DIR`` does it for all files, backends and references."""
    file = scenarios / f"{name}.xml"
    result = answer(file, "ego")
    assert result.status in FOLLOWED
    assert judged(result, file) == math.inf


# ------------------------------------------------------------------ what a coarse look would miss


def passing(shape: str, speed: float, dt: float, meet: float) -> str:
    """A body that crosses the way of the ego (10 m/s, from x = 20) to the left, and is on it at ``meet``."""
    states = [
        state(20.0 + 10.0 * meet, speed * (k * dt - meet), k=k, heading=math.pi / 2, v=speed,
              tag="state" if k else "initialState")
        for k in range(round(6.0 / dt) + 1)
    ]  # fmt: skip
    other = car(10, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>", shape=shape)
    end = round(6.0 / dt)
    time = f"<time><intervalStart>{end - 1}</intervalStart><intervalEnd>{end}</intervalEnd></time>"
    return scenario(obstacles=other, problems=problem(100, goal=f"<goalState>{time}</goalState>"), dt=dt)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_thin_box_between_two_steps(backend: str, write: Callable[[str], Path]) -> None:
    """30 m/s, half a metre wide, a step of half a second: no sample of either is near the other."""
    box = "<rectangle><length>0.5</length><width>0.5</width></rectangle>"
    result = answer(write(passing(box, 30.0, 0.5, 2.75)), backend)
    assert result.status is not SearchStatus.NO_CONFLICT
    conflict = result.search.conflict
    half = 0.5 * result.prepared.scene.vehicle.width
    assert conflict.contact_time == pytest.approx(2.75 - (half + 0.25) / 30.0, abs=2e-3)


def test_a_polygon_moves_between_two_steps(write: Callable[[str], Path]) -> None:
    points = "".join(
        f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((-0.4, -0.3), (0.4, -0.3), (0.0, 0.6))
    )
    result = answer(write(passing(f"<polygon>{points}</polygon>", 30.0, 0.1, 2.75)))
    assert result.status is not SearchStatus.NO_CONFLICT


def test_a_reference_beyond_the_speed_limit_is_no_free_drive(write: Callable[[str], Path]) -> None:
    file = write(scenario(obstacles="", problems=problem(100, state(20.0, 0.0, v=52.0))))
    conflict = answer(file).search.conflict
    assert (conflict.time, conflict.kind) == (0.0, "limits")


# ------------------------------------------------------------------ what must not matter


def mirrored(root: ElementTree.Element) -> None:
    """Left is right."""
    for y in root.iter("y"):
        y.text = repr(-float(y.text or 0.0))
    for turn in [*root.iter("orientation")]:
        for value in turn.iter("exact"):
            value.text = repr(-float(value.text or 0.0))
    for lane in root.iter("lanelet"):
        left, right = lane.find("leftBound"), lane.find("rightBound")
        assert left is not None
        assert right is not None
        left.tag, right.tag = "rightBound", "leftBound"
        lane.remove(right)
        lane.insert(0, right)


def moved(turn: float, x0: float, y0: float) -> Callable[[ElementTree.Element], None]:
    """Turned about the origin, then moved."""
    c, s = math.cos(turn), math.sin(turn)

    def move(root: ElementTree.Element) -> None:
        for at in [e for e in root.iter() if e.find("x") is not None and e.find("y") is not None]:
            x, y = at.find("x"), at.find("y")
            assert x is not None
            assert y is not None
            here = float(x.text or 0.0), float(y.text or 0.0)
            x.text, y.text = repr(c * here[0] - s * here[1] + x0), repr(s * here[0] + c * here[1] + y0)
        for value in (v for o in root.iter("orientation") for v in o.iter("exact")):
            value.text = repr(math.remainder(float(value.text or 0.0) + turn, 2 * math.pi))

    return move


def renamed(root: ElementTree.Element) -> None:
    for other in root.iter("dynamicObstacle"):
        other.set("id", str(int(other.get("id", "0")) + 4000))


def reordered(root: ElementTree.Element) -> None:
    parts = list(root)
    random.Random(5).shuffle(parts)
    root[:] = sorted(parts, key=lambda part: part.tag not in ("location", "scenarioTags"))


def with_a_far_one(root: ElementTree.Element) -> None:
    root.insert(len(root) - 1, ElementTree.fromstring(driving(77, 9000.0, 3000.0, 5.0)))


SAME = {
    "mirrored": mirrored,
    "turned": moved(1.1, 0.0, 0.0),
    "a million metres away": moved(0.0, 1e6, -1e6),
    "renamed": renamed,
    "reordered": reordered,
    "far obstacle": with_a_far_one,
}
BOTH = SLOW + driving(31, 0.0, 0.0, 14.0)  # and a faster one behind


@pytest.mark.thinned(5)
@pytest.mark.parametrize("change", SAME)
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("traffic", [SLOW, BOTH], ids=["ahead", "both"])
def test_what_makes_no_difference(
    traffic: str, backend: str, change: str, write: Callable[[str], Path]
) -> None:
    text = scenario(obstacles=traffic)
    root = ElementTree.fromstring(text)
    SAME[change](root)
    one, other = answer(write(text), backend), answer(write(ElementTree.tostring(root, "unicode")), backend)
    assert (one.status, one.ttc) == (other.status, other.ttc)
    assert one.search.conflict.contact_time == pytest.approx(other.search.conflict.contact_time, abs=1e-3)
    assert one.f_ttr == other.f_ttr
    if change != "mirrored":  # whoever passes on the left does so on the right
        assert [p.verdict.reasons for p in one.search.probes] == [
            p.verdict.reasons for p in other.search.probes
        ]


# ------------------------------------------------------------------ what goes one way only


@pytest.mark.exhaustive
def test_more_clearance_is_never_a_later_conflict(write: Callable[[str], Path]) -> None:
    for seed in range(2000, 2006):
        file = write(crossing(seed).text)
        times = [answer(file, "ego", f"checker.clearance={c}").ttc for c in (0.0, 0.1, 0.3, 1.0)]
        assert (np.diff([min(t, 99.0) for t in times]) <= 1e-9).all(), crossing(seed).words


def test_stronger_brakes_are_never_an_earlier_reaction(write: Callable[[str], Path]) -> None:
    file = write(scenario())
    found = [
        answer(file, "casadi", "repair.lateral=none", f"limits.a_total={a}").f_ttr for a in (4, 6, 8, 10)
    ]
    assert None not in found
    assert (np.diff([float(f or 0.0) for f in found]) >= -1e-9).all()


def test_a_delayed_obstacle_is_a_later_conflict(write: Callable[[str], Path]) -> None:
    times = [
        answer(write(scenario(obstacles=driving(30, x, 0.0, 2.0)))).ttc for x in (40.0, 45.0, 50.0, 55.0)
    ]
    assert (np.diff(times) > 0.0).all()


# ------------------------------------------------------------------ what an answer hangs on


def test_an_answer_that_hangs_on_the_end_of_a_prediction_says_so(
    write: Callable[[str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    far = driving(31, 200.0, 0.0, 10.0)  # whose prediction goes on
    file = write(scenario(obstacles=driving(30, 45.0, 0.0, 2.0, range(1, 11)) + far))
    gone = answer(file, "ego").to_dict()
    assert (gone["status"], gone["decided_by"]) == ("no_conflict", "prediction_end")
    stays = answer(file, "ego", "scene.after_prediction=constant_velocity")
    end = gone["prediction_end"]
    assert (end["obstacle_id"], end["ends_s"]) == (30, 1.0)
    assert stays.ttc <= end["constant_velocity_met_s"] < stays.ttc + 0.1 + 1e-9
    assert stays.to_dict()["decided_by"] is None
    assert main(["run", str(file), "--reference", "constant"]) == 0
    assert "Decided   by the end of a prediction: that of obstacle 30" in capsys.readouterr().out
