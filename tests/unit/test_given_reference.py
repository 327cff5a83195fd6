"""References from memory: what is taken, what is refused and where, and that a result is certified."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tests import roads

import repair
from repair.certify.certificate import format_certificate
from repair.certify.recompute import certify
from repair.errors import ConfigError, ReferenceTrajectoryError, RepairError
from repair.reference.given import given_reference


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return a straight road with a slower car ahead."""
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def scene(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return repair.load_scene(path)


@pytest.fixture(scope="module")
def usual(scene):
    return repair.repair(scene, overrides=["reference.source=constant"])


@pytest.fixture(scope="module")
def planned(scene):
    """Return a reference that is a spline."""
    return repair.repair(scene, overrides=["reference.source=planner"]).prepared.reference


@pytest.fixture(scope="module")
def drive(usual):
    """Return the constant reference as it is driven, four samples to a step."""
    return usual.prepared.checker.drive(usual.prepared.reference, usual.prepared.t_reference)


def table(drive):
    return np.column_stack([drive.t, drive.x, drive.y, drive.orientation, drive.speed])


def trajectory(drive, scene):
    """Return the same as a CommonRoad trajectory."""
    from commonroad.scenario.state import KSState
    from commonroad.scenario.trajectory import Trajectory

    first, at = scene.initial_time_step, drive.every(4)
    states = [
        KSState(
            time_step=first + k, position=np.array([at.x[k], at.y[k]]), orientation=float(at.orientation[k]),
            velocity=float(at.speed[k]), steering_angle=float(at.steering[k]),
        )
        for k in range(len(at))
    ]  # fmt: skip
    return Trajectory(first, states)


def uneven(drive, scene):
    """Return samples at times that jitter; the speed is constant, so that they lie on straight lines."""
    values = table(drive)
    t = values[:, 0].copy()
    t[1:-1] += 0.2 * 0.025 * np.random.default_rng(3).uniform(-1.0, 1.0, len(t) - 2)
    return np.column_stack([t, *(np.interp(t, values[:, 0], column) for column in values.T[1:])])


def saying(*names):
    """Return a form: a CommonRoad trajectory whose states say their position, and these."""

    def form(drive, scene):
        from commonroad.scenario.state import CustomState
        from commonroad.scenario.trajectory import Trajectory

        first, at = scene.initial_time_step, drive.every(4)
        said = {"orientation": at.orientation, "velocity": at.speed}
        states = [
            CustomState(
                time_step=first + k, position=np.array([at.x[k], at.y[k]]),
                **{name: float(said[name][k]) for name in names},
            )
            for k in range(len(at))
        ]  # fmt: skip
        return Trajectory(first, states)

    return form


FORMS = {
    "t, x, y": lambda d, s: table(d)[:, :3],
    "t, x, y, yaw": lambda d, s: table(d)[:, :4],
    "t, x, y, yaw, v": lambda d, s: table(d),
    "a list": lambda d, s: table(d).tolist(),
    "at other times": lambda d, s: table(d)[::3],
    "unevenly": uneven,
    "a mapping": lambda d, s: {"t": d.t, "x": d.x, "y": d.y, "v": d.speed},
    "driven states": lambda d, s: d,
    "a trajectory": trajectory,
    "states of places": saying(),
    "states of places and speeds": saying("velocity"),
    "states of places and headings": saying("orientation"),
    "a structured array": lambda d, s: np.rec.fromarrays(table(d).T, names="t,x,y,yaw,v"),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_answer(form, drive, scene, usual):
    found = repair.repair(scene, reference=FORMS[form](drive, scene))
    assert found.f_ttr == usual.f_ttr
    assert found.search.conflict.kind == usual.search.conflict.kind
    assert found.search.conflict.time == pytest.approx(usual.search.conflict.time, abs=1e-9)
    assert found.search.conflict.contact_time == pytest.approx(usual.search.conflict.contact_time, abs=2e-3)
    assert found.prepared.config.reference.source == "given"


def test_a_curve_is_taken_as_it_is(scene, planned, usual):
    found = repair.repair(scene, reference=planned)
    assert found.prepared.reference is planned
    assert found.f_ttr == repair.repair(scene, overrides=["reference.source=planner"]).f_ttr
    # One that no spline is: its result can be had, and says why it is not certified.
    assert repair.repair(scene, reference=usual.prepared.reference).f_ttr == usual.f_ttr


def test_an_earlier_result_is_followed(scene, usual, tmp_path):
    """And it runs into nothing, being a repair; from a folder as well."""
    again = repair.repair(scene, reference=usual)
    assert again.search.conflict.contact_time == np.inf
    usual.save(tmp_path, figure=False)
    read = repair.load_result(tmp_path)
    assert repair.repair(scene, reference=read).search.conflict == again.search.conflict
    for result in (usual, read):
        prepared = repair.prepare(scene, repair.load_config(), reference=result)
        assert prepared.conflict == again.search.conflict


@pytest.mark.parametrize("thing", ["result", "scene", None])
@pytest.mark.parametrize(
    "ask",
    [repair.bound, repair.mitigate, partial(repair.explain, found=None)],
    ids=["bound", "mitigate", "explain"],
)
def test_what_was_not_prepared_is_a_sentence(ask, thing, scene, usual):
    with pytest.raises(RepairError, match=r"repair\.prepare\(scene, config\) returns is expected"):
        ask({"result": usual, "scene": scene}.get(thing))


def test_what_no_search_found_is_a_sentence(scene, usual):
    with pytest.raises(RepairError, match="what a search of it found is expected"):
        repair.explain(usual.prepared, scene)


def shifted(column, by, rows=slice(None)):
    def change(values):
        values[rows, column] += by
        return values

    return change


WRONG = {
    "none": (lambda v: b"nothing", "cannot be read as numbers"),
    "flat": (lambda v: v[:, 0], "of shape"),
    "two columns": (lambda v: v[:, :2], "of shape"),
    "three samples": (lambda v: v[:3], "at least 4"),
    "a hole in time": (lambda v: np.delete(v, slice(20, 26), axis=0), "gap: from t = 0.475"),
    "far apart": (lambda v: v[::28], "mostly one sample every 0.7 s"),
    "backwards": (lambda v: v[[0, 1, 2, 2, 4, 5]], "do not go on"),
    "later": (lambda v: v[8:], "begins at t = 0.2"),
    "no number": (shifted(1, np.nan, slice(12, 13)), "x of sample 12 is not finite"),
    "elsewhere": (shifted(1, 3.0), "3 m from the ego's initial position"),
    "turned": (shifted(3, 0.2), "rad"),
    "faster": (shifted(4, 5.0), "m/s"),
    "a jump": (shifted(1, 2.0, slice(40, None)), "at time step 3"),
    "a masked number": (lambda v: np.ma.masked_array(v, v == v[12, 1]), "x of sample 12 is not finite"),
    "complex": (lambda v: v.astype(complex), "no real number"),
    "one heading": (shifted(3, 0.5, slice(61, 62)), "at time step 6"),
    "a speed of its own": (shifted(4, 30.0, slice(60, 70)), "speed"),
}


def test_who_turns_back_is_told_so(scene):
    ego = scene.initial_state
    t = np.arange(0.0, 6.01, 0.1)
    way = ego.velocity * t - 2.0 * t**2  # forwards until 2.5 s
    x, y = ego.x + way * np.cos(ego.orientation), ego.y + way * np.sin(ego.orientation)
    with pytest.raises(ReferenceTrajectoryError, match=r"turns back at time step (2[5-9]|3[0-5])"):
        repair.repair(scene, reference=np.column_stack([t, x, y]))


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_named_with_its_place(what, drive, scene):
    change, words = WRONG[what]
    with pytest.raises(ReferenceTrajectoryError, match="the given reference") as caught:
        repair.repair(scene, reference=change(table(drive)))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def changed(name, value, at=7):
    def change(states):
        setattr(states[at], name, value)

    return change


def uncertain():
    from commonroad.common.util import Interval

    return Interval(1.0, 2.0)


@pytest.mark.parametrize(
    "change, words",
    [
        (changed("velocity", None), "at time step 7 velocity is missing"),
        (changed("velocity", np.nan), "at time step 7 velocity is not finite"),
        (changed("velocity", uncertain()), "at time step 7 velocity is a Interval"),
        (changed("position", np.array([1.0, 2.0, 3.0])), r"at time step 7 the position is of shape \(3,\)"),
        (lambda states: states.pop(7), "goes from time step 6 to 8"),
    ],
)
def test_states_that_are_no_exact_numbers_are_named(change, words, drive, scene):
    thing = trajectory(drive, scene)
    change(thing.state_list)
    with pytest.raises(ReferenceTrajectoryError, match=words):
        given_reference(thing, scene)


def test_headings_of_who_stands_may_be_any(scene):
    """A yaw that is taken from differences of positions jumps to 0 where the car stands."""
    ego, t = scene.initial_state, np.arange(41) * 0.1
    brake = 5.0
    s = np.where(
        t < ego.velocity / brake, ego.velocity * t - 0.5 * brake * t**2, 0.5 * ego.velocity**2 / brake
    )
    yaw = np.where(np.gradient(s) > 0.0, ego.orientation, 1.5)
    x, y = ego.x + s * np.cos(ego.orientation), ego.y + s * np.sin(ego.orientation)
    assert given_reference(np.column_stack([t, x, y, yaw]), scene).recording is not None


@pytest.mark.parametrize(
    "columns, words",
    [
        ({"t": [0, 1], "x": [0, 1]}, "no column y"),
        ({"t": [0, 1], "x": [0, 1], "y": [0, 1], "speed": [1, 1]}, "'speed'"),
        ({"t": [0, 1, 2], "x": [0, 1], "y": [0, 1, 2]}, "shape"),
        ({"t": 0.0, "x": 0.0, "y": 0.0}, "shape"),
    ],
)
def test_a_mapping_with_other_columns(columns, words, scene):
    with pytest.raises(ReferenceTrajectoryError, match=words):
        given_reference(columns, scene)


def test_speeds_without_headings_are_held_against_the_positions(drive, scene):
    columns = {"t": drive.t, "x": drive.x, "y": drive.y, "v": drive.speed.copy()}
    columns["v"][50:60] += 4.0
    with pytest.raises(ReferenceTrajectoryError, match=r"from t = 1\.2"):
        given_reference(columns, scene)


@pytest.mark.parametrize("change", [{"start": 0.5}, {"shift": (5.0, 0.0)}, {"shift": (np.nan, 0.0)}])
def test_a_curve_that_starts_elsewhere(change, scene, planned):
    curve = planned
    if "start" in change:
        curve = replace(curve, t_start=0.5)
    else:
        curve = replace(curve, points=curve.points + np.array(change["shift"]))
    with pytest.raises(ReferenceTrajectoryError, match="the given reference"):
        repair.repair(scene, reference=curve)


def test_two_references_are_one_too_many(drive, scene):
    with pytest.raises(ConfigError, match="leave one out"):
        repair.repair(scene, reference=table(drive), overrides=["reference.source=constant"])
    found = repair.repair(scene, reference=table(drive), overrides=["reference.source=given"])
    assert found.status == "found"


def test_a_reference_may_be_asked_for_by_its_name(scene, usual, path):
    found = repair.repair(scene, reference="constant")
    assert found.prepared.config.reference.source == "constant"
    assert found.to_dict()["f_ttr_s"] == usual.to_dict()["f_ttr_s"]
    with pytest.raises(ConfigError, match=r"neither one of planner.* nor a file"):
        repair.repair(scene, reference="constnat")
    with pytest.raises(ConfigError, match="leave one out"):
        repair.repair(scene, reference="constant", overrides=["reference.source=planner"])
    with pytest.raises(ReferenceTrajectoryError, match="solution"):
        repair.repair(scene, reference=path)  # a scenario, and no solution


def test_given_from_the_command_line_is_a_sentence(path, capsys):
    from repair.cli.command import main

    assert main(["run", str(path), "--reference", "given"]) == 2
    assert "the argument reference=" in capsys.readouterr().err


@pytest.mark.thinned(3)
@pytest.mark.parametrize("form", ["t, x, y", "at other times", "a trajectory", "a curve"])
def test_a_result_with_a_given_reference_is_certified(form, drive, scene, planned, tmp_path):
    thing = planned if form == "a curve" else FORMS[form](drive, scene)
    repair.repair(scene, reference=thing, overrides=["backend=casadi"]).save(tmp_path, figure=False)
    certificate = certify(tmp_path)
    assert certificate.ok, format_certificate(certificate)


def test_a_short_reference_holds_until_its_end(drive, scene):
    found = repair.repair(scene, reference=table(drive)[:41])
    assert found.prepared.t_reference == pytest.approx(1.0)
    assert found.to_dict()["checked_until_s"] == pytest.approx(1.0)
    assert any("ends at 1 s" in note for note in found.to_dict()["notes"])


@pytest.mark.parametrize("backend", ["ego", "casadi"])
def test_a_repair_that_brakes_late_is_followed_as_it_is(backend, tmp_path):
    """A smoothing spline swings around the jump of its acceleration, by more than the tyres hold."""
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    wall, start = (
        roads.driving(30, 62.0, 0.0, 0.0, range(1, 61)),
        roads.problem(100, roads.state(20.0, 0.0, v=9.0)),
    )
    file.write_text(roads.scenario(obstacles=wall, problems=start), encoding="utf-8")
    scene = repair.load_scene(file)
    keys = ["reference.source=constant", "repair.lateral=none", "fallback=[]", "search.delta_t=0.2"]
    found = repair.repair(scene, backend=backend, overrides=keys)
    assert found.peaks.min_acceleration < -10.0
    again = repair.prepare(scene, repair.load_config(), reference=found.states)
    assert again.conflict.kind == "none"


@pytest.mark.parametrize(
    "samples, turns_from, brakes_from",
    [(41, 99, 5), (41, 99, 15), (40, 7, 12)],
    ids=["soon", "late", "out of a swerve"],
)
def test_a_plan_near_the_grip_is_followed_as_it_is(samples, turns_from, brakes_from, tmp_path):
    """Braking with 10 m/s² begins at once, and so does each turn of the steering wheel, at 0.3 rad/s."""
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(
        roads.scenario(
            road=roads.lanelet(1, range(0, 401, 20), [0.0] * 21, width=30.0),
            obstacles=roads.driving(30, 300.0, 0.0, 1.0),
            problems=roads.problem(100, roads.state(20.0, 0.0, v=12.0)),
        ),
        encoding="utf-8",
    )
    scene = repair.load_scene(file)
    rear, wheelbase, h = scene.vehicle.rear, scene.vehicle.wheelbase, scene.dt / 50
    x, y, psi, delta, v, plan = 20.0 - rear, 0.0, 0.0, 0.0, 12.0, []
    for k in range(samples):
        plan.append((k * scene.dt, x + rear * np.cos(psi), y + rear * np.sin(psi), psi, v))
        part = (k - turns_from) // 3
        for _ in range(50):
            delta += h * 0.3 * ({0: 1.0, 1: -1.0, 2: -1.0, 3: 1.0}.get(part, 0.0))
            psi += h * v / wheelbase * np.tan(delta)
            before, v = v, max(v - h * 10.0 * (k >= brakes_from), 0.0)
            way = h * 0.5 * (before + v)
            x, y = x + way * np.cos(psi), y + way * np.sin(psi)
    assert repair.prepare(scene, repair.load_config(), reference=plan).conflict.kind == "none"


@pytest.mark.parametrize("speed", [0.012, 0.1, 0.4])
def test_who_crawls_stands_as_the_plan_says(speed, tmp_path):
    """The bends of a path of centimetres would turn the body by more than a radian."""
    line = roads.bend(40.0, 80.0)
    x, y = line[5]
    start = roads.state(x, y + 0.2, v=speed, heading=0.22)
    road, far = roads.strip(1, line), roads.driving(30, 900.0, 300.0, 1.0)
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(
        roads.scenario(road=road, obstacles=far, problems=roads.problem(100, start)), encoding="utf-8"
    )
    scene = repair.load_scene(file)
    planned = repair.prepare(scene, repair.load_config(overrides=["reference.source=accelerate"]))
    plan = table(planned.checker.drive(planned.reference, planned.t_reference))
    given = repair.prepare(scene, repair.load_config(), reference=plan)
    driven = given.checker.drive(given.reference, given.t_reference)
    assert given.conflict.kind == "none"
    assert driven.orientation[0] == pytest.approx(0.22, abs=1e-9)


@pytest.fixture(scope="module")
def askew(tmp_path_factory):
    """Return a scene whose ego is beside the line of a bend and turned, and what is driven from there."""
    line = roads.bend(40.0, 80.0)
    (x, y), heading = line[5], float(np.arctan2(*(line[6] - line[4])[::-1]))
    start = roads.state(x, y + 0.3, v=6.0, heading=heading + 0.05)
    road, far = roads.strip(1, line), roads.driving(30, 900.0, 300.0, 1.0)
    file = tmp_path_factory.mktemp("askew") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(
        roads.scenario(road=road, obstacles=far, problems=roads.problem(100, start)), encoding="utf-8"
    )
    scene = repair.load_scene(file)
    planned = repair.prepare(scene, repair.load_config(overrides=["reference.source=constant"]))
    return scene, planned.checker.drive(planned.reference, planned.t_reference)


@pytest.mark.parametrize(
    "form", ["t, x, y, yaw", "t, x, y, yaw, v", "at other times", "driven states", "a trajectory"]
)
def test_a_body_begins_as_it_is_said(form, askew):
    scene, drive = askew
    given = repair.prepare(scene, repair.load_config(), reference=FORMS[form](drive, scene))
    driven = given.checker.drive(given.reference, given.t_reference)
    assert given.conflict.kind == "none"
    assert driven.orientation[0] == pytest.approx(scene.initial_state.orientation, abs=1e-9)
    off = driven.orientation - drive.orientation[: len(driven)]
    assert np.abs(off).max() < 0.02


def test_a_cycle_begins_with_the_body_too(askew):
    scene, drive = askew
    watch = repair.Repairer(scene, backend="ego")
    for _ in range(2):  # in a frame of its own, and in the kept one
        cycle = watch.update(table(drive))
        assert cycle.states.orientation[0] == pytest.approx(scene.initial_state.orientation, abs=1e-9)


def test_headings_of_the_path_say_nothing_about_the_body(askew):
    scene, drive = askew
    plan = table(drive.every(4))
    plan[:, 3] = np.unwrap(np.arctan2(*np.gradient(plan[:, 1:3], axis=0).T[::-1]))
    assert given_reference(plan, scene).heading is None
    assert given_reference(drive, scene).heading == pytest.approx(scene.initial_state.orientation, abs=1e-9)


@pytest.mark.parametrize("speed", [0.0, 0.3])
def test_who_is_said_to_brake_at_rest_does_not_roll_back(speed, tmp_path):
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    start = roads.problem(100, roads.state(20.0, 0.0, v=speed, acceleration=-1.5))
    file.write_text(roads.scenario(problems=start), encoding="utf-8")
    scene = repair.load_scene(file)
    t = np.arange(0.0, 3.01, 0.1)
    plan = np.column_stack([t, 20.0 + speed * t, 0.0 * t, 0.0 * t, speed + 0.0 * t])
    given = repair.prepare(scene, repair.load_config(), reference=plan)
    driven = given.checker.drive(given.reference, given.t_reference)
    assert driven.speed.min() >= speed - 1e-3
