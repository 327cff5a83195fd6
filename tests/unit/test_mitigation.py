"""What hits least hard: never harder than full braking, as another judge sees it; what is called proven."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from tests.roads import lanelet, problem, scenario, state
from tests.unavoidable import KINDS, situation

import repair
from repair.certify.recompute import certify
from repair.cli import main
from repair.errors import RepairError
from repair.mitigation.settings import MitigationConfig
from repair.report.birdseye import birdseye_figure
from repair.search.result import SearchStatus

GIVEN = ["reference.source=constant"]
PATIENT = MitigationConfig(time_limit=600.0)  # on a busy machine too


def prepared(folder, text, *overrides):
    file = folder / "scenario.xml"
    file.write_text(text, encoding="utf-8")
    config = repair.load_config(overrides=[*GIVEN, *overrides])
    return repair.prepare(repair.load_scene(file, config), config)


def outlines(x, y, psi, half_length, half_width):
    """Rectangles at poses (K,)."""
    ahead, aside = half_length * np.array([1, -1, -1, 1]), half_width * np.array([1, 1, -1, -1])
    cos, sin = np.cos(psi)[:, None], np.sin(psi)[:, None]
    corners = (x[:, None] + cos * ahead - sin * aside, y[:, None] + sin * ahead + cos * aside)
    return shapely.polygons(np.stack(corners, axis=-1))


def integrated(states, vehicle, dt, h=1e-3):
    """The middle of the car every ``h`` seconds: its model, from state to state, by this file's own steps."""
    share = (np.arange(round(dt / h)) + 0.5) * h / dt
    rows = []
    for k in range(len(states) - 1):
        speed = states.speed[k] + share * (states.speed[k + 1] - states.speed[k])
        steer = states.steering[k] + share * (states.steering[k + 1] - states.steering[k])
        turn = h * speed * np.tan(steer) / vehicle.wheelbase
        psi = states.orientation[k] + np.cumsum(turn) - turn
        way = h * speed * np.exp(1j * (psi + 0.5 * turn))
        axle = complex(states.x[k], states.y[k]) - vehicle.rear * np.exp(1j * states.orientation[k])
        middle = axle + np.cumsum(way) - way + vehicle.rear * np.exp(1j * psi)
        rows.append(np.array([k * dt + h * np.arange(len(share)), middle.real, middle.imag, psi]))
    return np.concatenate(rows, axis=1)


def first_contact(states, scene):
    """Time, id and relative speed of the first contact, read off the CommonRoad objects; None without one."""
    vehicle, dt = scene.vehicle, scene.dt
    t, x, y, psi = integrated(states, vehicle, dt)
    ego = outlines(x, y, psi, vehicle.half_length, vehicle.half_width)
    met = []
    for obstacle in scene.scenario.obstacles:
        at, shape = places(obstacle, dt), obstacle.obstacle_shape
        hit = np.flatnonzero(shapely.intersects(ego, outlines(*at(t), 0.5 * shape.length, 0.5 * shape.width)))
        if len(hit):
            met.append((hit[0], obstacle.obstacle_id, at))
    if not met:
        return None
    i, name, at = min(met, key=lambda one: one[0])
    j, k = max(i, 1), math.floor(t[i] / dt + 1e-6)
    own = complex(x[j] - x[j - 1], y[j] - y[j - 1]) / (t[j] - t[j - 1])
    ends = at(np.array([k, k + 1]) * dt)
    theirs = complex(np.diff(ends[0])[0], np.diff(ends[1])[0]) / dt
    return t[i], name, abs(own - theirs), abs(own)


def places(obstacle, dt):
    """Where an obstacle is at times: x, y and orientation."""
    rows = [(*obstacle.initial_state.position, obstacle.initial_state.orientation)]
    if getattr(obstacle, "prediction", None) is not None:
        rows += [(*s.position, s.orientation) for s in obstacle.prediction.trajectory.state_list]
    columns = np.array(rows).T
    steps = dt * np.arange(columns.shape[1])
    return lambda t: tuple(np.interp(t, steps, column) for column in columns)


def judged(motion, scene):
    """What is claimed of a motion, held against the judge of this file."""
    met, impact = first_contact(motion.states, scene), motion.impact
    if impact.kind != "contact":
        assert met is None or (impact.kind == "off_road" and met[0] >= impact.time - 2e-3)
        return
    assert met is not None
    assert met[0] == pytest.approx(impact.time, abs=4e-3)
    assert met[1] == impact.obstacle_id
    assert met[2] == pytest.approx(impact.speed, abs=0.12)
    assert met[3] == pytest.approx(impact.own_speed, abs=0.12)


def on_the_road_until(motion, scene, width):
    """The road of these situations is straight, along x."""
    t, *poses = integrated(motion.states, scene.vehicle, scene.dt)
    bodies = outlines(*poses, scene.vehicle.half_length, scene.vehicle.half_width)
    before = bodies[t < motion.impact.time - 0.02]
    assert np.abs(shapely.get_coordinates(before)[:, 1]).max(initial=0.0) <= 0.5 * width + 1e-3


@settings(max_examples=10, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    kind=st.sampled_from(KINDS),
    own=st.floats(6.0, 30.0),
    share=st.floats(0.1, 0.95),
    speed=st.floats(2.0, 15.0),
    width=st.sampled_from([3.5, 5.0, 8.0]),
)
def test_no_harder_than_full_braking_and_so_says_another_judge(
    tmp_path_factory, kind, own, share, speed, width
):
    gap = share * own**2 / 20.7
    folder = tmp_path_factory.mktemp("generated")
    case = prepared(folder, situation(kind, own, gap, speed, width))
    if math.isinf(case.conflict.time) or case.conflict.contact_time <= 0.0:
        return
    found = repair.mitigate(case, PATIENT)
    assert found.complete
    assert found.best is not None
    assert found.braking is not None
    best, full = found.best.impact, found.braking.impact
    assert best.speed <= full.speed
    assert best.worst <= full.worst
    assert best.kind != "off_road" or full.kind == "off_road"
    for motion in (found.best, found.braking):
        judged(motion, case.scene)
        on_the_road_until(motion, case.scene, width)


def test_full_braking_into_a_wall_is_what_the_formula_says(tmp_path):
    case = prepared(tmp_path, situation("wall", 20.0, 12.0))
    found = repair.mitigate(case)
    brake = -case.limits.a_min
    # the planning problem's speed, the limits of repairs, and half a body from the middle to the front
    gap = 12.0 + 2.16 - case.scene.vehicle.half_length
    speed = math.sqrt(20.0**2 - 2.0 * brake * gap)
    assert found.braking.impact.speed == pytest.approx(speed, abs=0.05)
    assert found.best is found.braking  # straight into a wall nothing is better
    assert found.braking.impact.time == pytest.approx((20.0 - speed) / brake, abs=5e-3)
    assert found.braking.impact.place == pytest.approx((20.0 + 2.16 + 12.0, 0.0), abs=0.05)


@pytest.mark.parametrize(
    "kind, own, gap, speed, width", [("crossing", 15.0, 5.4, 10.0, 5.0), ("cut_in", 15.0, 3.0, 4.0, 3.5)]
)
def test_less_than_full_braking_where_there_is_something_better(tmp_path, kind, own, gap, speed, width):
    found = repair.mitigate(prepared(tmp_path, situation(kind, own, gap, speed, width)), PATIENT)
    assert found.best.impact.speed < found.braking.impact.speed - 0.1


def test_who_is_touched_gently_from_behind_does_not_save_one_from_the_wall(tmp_path):
    """To brake less would let the follower strike at 1 m/s, and the wall then at 20."""
    found = repair.mitigate(prepared(tmp_path, situation("rear", 25.0, 24.0, width=3.5)), PATIENT)
    assert found.best.impact.obstacle_id == 31
    assert found.best.impact.from_behind
    assert found.best.impact.speed == pytest.approx(found.braking.impact.speed, abs=0.2)


def test_no_time_leaves_full_braking(tmp_path):
    case = prepared(tmp_path, situation("crossing", 15.0, 5.4, 10.0))
    found = repair.mitigate(case, MitigationConfig(time_limit=0.0))
    assert not found.complete
    assert found.best is found.braking is not None


def test_nothing_to_mitigate_is_said(tmp_path):
    with pytest.raises(RepairError, match="followed to its end"):
        repair.mitigate(prepared(tmp_path, situation("wall", 8.0, 300.0)))
    inside = prepared(tmp_path, situation("wall", 8.0, -1.0))
    with pytest.raises(RepairError, match="at the very start"):
        repair.mitigate(inside)


def result_of(tmp_path, text, *overrides):
    file = tmp_path / "scenario.xml"
    file.write_text(text, encoding="utf-8")
    return repair.repair(file, overrides=[*GIVEN, *overrides])


def test_proven_is_told_from_not_found(tmp_path):
    """The same wall: too near for any motion; only the margin; and where nobody asked for the proof."""
    near = situation("wall", 15.0, 5.0)
    asked = result_of(tmp_path, near, "mitigation.wanted=true")
    assert asked.status is SearchStatus.UNAVOIDABLE
    assert asked.bounds["vehicle"].time == 0.0
    assert asked.to_dict()["mitigation"]["proven"] == "contact"
    assert result_of(tmp_path, near, "bound.wanted=true").status is SearchStatus.UNAVOIDABLE
    silent = result_of(tmp_path, near)
    assert silent.status is SearchStatus.NONE_FEASIBLE
    assert silent.mitigation is None
    assert silent.to_dict()["mitigation"] is None
    # proven for the search, whose limits and margin are more; the vehicle itself stops in time
    gap = 15.0**2 / (2 * 11.5) + 0.17
    margin = result_of(tmp_path, situation("wall", 15.0, gap), "mitigation.wanted=true", "bound.wanted=true")
    assert margin.status is SearchStatus.NONE_FEASIBLE
    assert margin.bounds["search"].time == 0.0
    assert margin.bounds["vehicle"].time > 0.0
    assert margin.to_dict()["mitigation"]["proven"] is None


def test_who_has_a_conflict_at_once_may_be_lost_as_well(tmp_path):
    """The margin is entered within the first step, so that the TTC is 0."""
    found = result_of(tmp_path, situation("wall", 15.0, 0.8), "mitigation.wanted=true")
    assert found.ttc == 0.0
    assert found.status is SearchStatus.UNAVOIDABLE


def test_who_leaves_the_road_at_once_has_no_way_to_draw(tmp_path):
    road, beside = lanelet(1, range(0, 301, 10), [0.0] * 31), problem(100, state(20.0, 1.0, v=14.0))
    situated = prepared(
        tmp_path, scenario(road=road, obstacles="", problems=beside), "mitigation.wanted=true"
    )
    result = repair.repair(situated.scene, situated.config)
    assert result.mitigation is not None
    assert (result.mitigation.best.impact.kind, result.mitigation.best.impact.time) == ("off_road", 0.0)
    drawing = result.outcome.drawing
    assert "mitigation" not in [line.kind for line in drawing.lines]
    assert all(np.isfinite(line.acceleration).all() for line in drawing.lines)
    birdseye_figure(result.outcome)


def test_what_is_written_and_printed(tmp_path, capsys):
    file, out = tmp_path / "scenario.xml", tmp_path / "out"
    file.write_text(situation("crossing", 15.0, 5.4, 10.0), encoding="utf-8")
    arguments = ["run", str(file), "--reference", "constant", "--mitigate", "--out", str(out), "--no-figure"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert "unavoidable: it is proven" in printed
    assert "Mitigate" in printed
    assert "plain full braking: hits obstacle 30" in printed
    told = json.loads((out / "result.json").read_text(encoding="utf-8"))
    one = told["mitigation"]
    assert told["solution_file"] is None
    assert (out / one["solution_file"]).is_file()
    assert one["solution_file"].startswith("mitigation_")
    assert one["impact_speed_mps"] <= one["full_braking"]["impact_speed_mps"]
    assert one["gained_mps"] == pytest.approx(
        one["full_braking"]["impact_speed_mps"] - one["impact_speed_mps"], abs=1e-5
    )
    steps = one["trajectory"]["t_s"]
    assert steps[-2] < one["contact_t_s"] <= steps[-1]
    again = repair.load_result(out)
    assert again.record == told
    assert main([*arguments[:-1], "--set", "mitigation.wanted=false"]) == 0
    capsys.readouterr()


def test_the_same_each_time(tmp_path):
    text = situation("crossing", 15.0, 5.4, 10.0)
    both = [repair.mitigate(prepared(tmp_path, text), PATIENT).best.impact for _ in range(2)]
    assert both[0] == both[1]


def test_several_backends_at_one_time_are_drawn(tmp_path):
    """Of two that were asked at the same time only one leaves a curve."""
    found = result_of(tmp_path, situation("crossing", 15.0, 5.4, 10.0))
    assert len(found.search.probes) > 1
    assert len({p.t_rep for p in found.search.probes}) == 1
    assert any(p.solve.curve is None for p in found.search.probes)
    assert any(path.name == "birdseye.png" for path in found.save(tmp_path / "out"))


def tampered(told, what):
    one = told["mitigation"]
    column = one["trajectory"]
    if what == "impact speed":
        one["impact_speed_mps"] -= 0.5
    elif what == "full braking":
        one["full_braking"]["impact_speed_mps"] += 0.5
    elif what == "contact":
        one["contact_t_s"] += 0.02
    elif what == "obstacle":
        one["obstacle_id"] = 30
    elif what == "place":
        column["x_m"] = [x - 0.3 for x in column["x_m"]]
    elif what == "grip":
        column["speed_mps"] = [v - 3.0 * t for v, t in zip(column["speed_mps"], column["t_s"], strict=True)]
    elif what == "ends":
        one.update(ends="none", contact_t_s=None)
    elif what == "ends alone":
        one["ends"] = "none"
    elif what == "nothing is hit until then":
        one.update(ends="none", contact_t_s=None, looked_until_s=column["t_s"][-1])
    elif what == "from behind":
        one["from_behind"] = not one["from_behind"]
    elif what == "needs":
        one["proven"] = "contact_or_off_road" if one["proven"] == "contact" else "contact"
    elif what == "no full braking":
        one["full_braking"] = None
    elif what == "status":
        told["status"] = "none_feasible"
    elif what == "proof":
        told["bound"]["kinds"]["vehicle"]["t_bound_s"] = 0.1
        told["bound"]["t_bound_s"] = 0.1
    return told


@pytest.mark.parametrize("substeps", [1, 4])
def test_who_leaves_the_road_between_two_samples_is_certified(tmp_path, substeps):
    road, ahead = lanelet(1, range(0, 41, 10), [0.0] * 5), problem(100, state(27.0, 0.0, v=20.0))
    keys = "mitigation.wanted=true", "fallback=[]", "scene.horizon=2", f"checker.substeps={substeps}"
    situated = prepared(tmp_path, scenario(road=road, obstacles="", problems=ahead), *keys)
    result = repair.repair(situated.scene, situated.config)
    assert result.mitigation is not None
    assert result.mitigation.best.impact.kind == "off_road"
    assert result.mitigation.best.impact.time > 0.0
    result.save(tmp_path / "out", figure=False)
    certificate = certify(tmp_path / "out")
    assert any(row.name.endswith("the road is left") for row in certificate.rows)
    assert certificate.ok


def test_certified_and_not_when_tampered_with(tmp_path):
    found = result_of(
        tmp_path,
        situation("rear", 15.0, 8.7, width=3.5),
        "mitigation.wanted=true",
        "backend=qptr",
        "fallback=[]",
    )
    out = tmp_path / "out"
    found.save(out, figure=False)
    certificate = certify(out)
    assert certificate.ok, certificate.broken
    assert certificate.status == "unavoidable"
    names = {row.name for row in certificate.rows}
    assert {"status unavoidable", "mitigation: contact", "mitigation: impact speed off by"} <= names
    assert "full braking: contact" in names
    file = out / "result.json"
    told = file.read_text(encoding="utf-8")
    for what in (
        "impact speed", "full braking", "contact", "obstacle", "place", "grip", "ends", "status", "proof",
        "ends alone", "nothing is hit until then", "from behind", "needs", "no full braking",
    ):  # fmt: skip
        file.write_text(json.dumps(tampered(json.loads(told), what)), encoding="utf-8")
        assert not certify(out).ok, what
