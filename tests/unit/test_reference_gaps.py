"""References that are not what they seem, until when one holds, and margins in which the ego starts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from tests import roads, toy

from repair.config.schema import Config
from repair.errors import ReferenceTrajectoryError
from repair.preparation import prepare
from repair.reference import consistency
from repair.scene.commonroad import load_scene
from repair.scene.reframe import reframe
from repair.world.boxes import Occupancy, shrink_to_start
from repair.world.occupancy import first_entry

FIELDS = ("x", "y", "steeringAngle", "velocity", "orientation")


def drive(count=71, v=10.0, dt=0.1):
    """States straight on at constant speed: step -> (x, y, steering, speed, heading)."""
    return {k: [20.0 + k * dt * v, 0.0, 0.0, v, 0.0] for k in range(count)}


def written(tmp_path, states, *, obstacles="", start=None, model="KS1", fields=FIELDS, kind="ks"):
    """A scenario and a solution file for it; ``states`` are pairs of a step and values."""
    rows = states.items() if isinstance(states, dict) else states
    body = "".join(
        f"<{kind}State>{''.join(f'<{n}>{x}</{n}>' for n, x in zip(fields, values, strict=True))}"
        f"<time>{step}</time></{kind}State>"
        for step, values in rows
    )
    solution = tmp_path / "reference.xml"
    solution.write_text(
        f'<CommonRoadSolution benchmark_id="{model}:JB1:ZAM_Test-1_1_T-1:2020a">'
        f'<{kind}Trajectory planningProblem="100">{body}</{kind}Trajectory></CommonRoadSolution>',
        encoding="utf-8",
    )
    scenario = tmp_path / "scenario.xml"
    far = roads.driving(31, 300.0, 0.0, 5.0, range(1, 71))  # predicted for 7 s
    problems = roads.problem(start=start)
    scenario.write_text(roads.scenario(obstacles=obstacles + far, problems=problems), encoding="utf-8")
    return scenario, solution


def prepared(tmp_path, states, **keys):
    scenario, solution = written(tmp_path, states, **keys)
    config = Config()
    config.reference.source, config.reference.file = "file", str(solution)
    return prepare(load_scene(scenario), config)


# -- what is refused -----------------------------------------------------------------------------------


def without(step):
    states = drive()
    del states[step]
    return states


def changed(step, place, value):
    states = drive()
    states[step][place] = value
    return states


def throughout(place, change):
    states = drive()
    for step, row in states.items():
        row[place] = change(row[place], step)
    return states


@pytest.mark.parametrize(
    "states, message",
    [
        (without(35), "goes from time step 34 to 36"),
        (without(0), "begins at time step 1, and not at the planning problem's initial time step 0"),
        ([*drive(40).items(), (39, drive()[39])], "has time step 39 twice"),
        ([*drive(40).items(), (12, drive()[41])], "has time step 12 twice"),  # a step back in time
        (changed(17, 0, "nan"), "at time step 17 position is not finite"),
        (changed(18, 3, "nan"), "at time step 18 velocity is not finite"),
        (changed(19, 4, "inf"), "at time step 19 orientation is not finite"),
        (changed(20, 3, 14.0), "at time step 20 the speed is 14 m/s, but the positions move at 10 m/s"),
        (throughout(3, lambda v, k: v if k < 30 else 1.3 * v), "at time step 30 the speed is 13 m/s"),
        (changed(21, 4, 0.3), "at time step 21 the heading has changed by 0.3 rad within 1 m"),
        (throughout(4, lambda psi, k: min(0.01 * k, 0.5)), "the heading is off the direction of motion"),
        (throughout(4, lambda psi, k: 3.1 * (k > 0)), "at time step 1 the heading has changed by 3.1"),
        (changed(40, 0, 62.0), "at time step 39 the speed is 10 m/s, but the positions move at 30 m/s"),
        (changed(40, 0, 7500.0), "at time step 40 it jumps by 7.44e+03 m"),
        (throughout(1, lambda y, k: y + 0.3), "starts 0.3 m from the ego's initial position"),
        (throughout(4, lambda psi, k: 0.2), "starts 0.2 rad off the ego's initial heading"),
        (throughout(3, lambda v, k: 12.5), "starts with 12.5 m/s, the ego with 10 m/s"),
        (dict(list(drive().items())[:3]), "known for 3 steps only"),
    ],
)  # fmt: skip
def test_what_cannot_have_been_driven_is_refused_and_the_first_place_named(tmp_path, states, message):
    with pytest.raises(ReferenceTrajectoryError, match=r"reference\.xml") as raised:
        prepared(tmp_path, states)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_inputs_are_no_states(tmp_path):
    rows = [(k, (0.0, 0.0)) for k in range(40)]
    names = ("steeringAngleSpeed", "acceleration")
    scenario, solution = written(tmp_path, rows, fields=names, kind="input")
    text = solution.read_text().replace("inputState>", "input>").replace("inputTrajectory", "inputVector")
    solution.write_text(text)
    config = Config()
    config.reference.source, config.reference.file = "file", str(solution)
    with pytest.raises(ReferenceTrajectoryError, match="holds inputs"):
        prepare(load_scene(scenario), config)


def test_states_in_another_order_are_the_same_drive(tmp_path):
    rows = list(drive().items())
    rows[10], rows[40] = rows[40], rows[10]  # commonroad-io sorts them, and so does CommonRoad's check
    assert prepared(tmp_path, rows).conflict.time == np.inf


def test_a_recorded_obstacle_that_is_not_there_yet_is_no_reference(tmp_path):
    scenario, _ = written(tmp_path, drive())
    scene = load_scene(scenario)
    late = scene.obstacles[0]
    states = late.states.copy()
    for gone, message in (
        (slice(0, 5), "is not there at time step 0"),
        (slice(8, 11), "from time step 8 to 10"),
    ):
        absent = states.copy()
        absent[gone] = np.nan
        config = Config()
        config.reference.source, config.reference.obstacle_id = "recorded", 31
        with pytest.raises(ReferenceTrajectoryError, match=message):
            prepare(replace(scene, obstacles=(replace(late, states=absent),)), config)


# -- what CommonRoad allows ----------------------------------------------------------------------------


@pytest.mark.thinned(3)
@pytest.mark.filterwarnings("ignore")  # of the checker, about NumPy and SciPy
@pytest.mark.parametrize("model", ["KS1", "KS3", "ST2", "PM1"])
@pytest.mark.parametrize("dt", [0.04, 0.1, 0.3])
def test_whatever_commonroads_own_dynamics_drive_is_accepted(model, dt):
    """Random inputs, to the limits and at once; each step disturbed by almost what the checker allows."""
    from commonroad.common.solution import VehicleModel, VehicleType
    from commonroad.scenario.state import InitialState, InputState, PMInputState
    from commonroad_dc.feasibility.feasibility_checker import state_transition_feasibility
    from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

    from repair.reference.recorded import states_of
    from repair.vehicle.parameters import load_vehicle

    number = int(model[2])
    dynamics = VehicleDynamics.from_model(VehicleModel[model[:2]], VehicleType(number))
    vehicle = load_vehicle(number)
    rng = np.random.default_rng(number)
    for speed in (0.0, 3.0, 12.0, 30.0):
        start = InitialState(
            time_step=0, position=np.array([500.0, -20.0]), orientation=1.0, velocity=speed, acceleration=0.0,
            yaw_rate=0.0, slip_angle=0.0,
        )  # fmt: skip
        states = [dynamics.convert_initial_state(start)]
        for k in range(25):
            for _ in range(60):
                strength = rng.uniform(-1.0, 1.0, 2).tolist()
                if model.startswith("PM"):
                    given_ = PMInputState(time_step=k, acceleration=8.0 * strength[0],
                                          acceleration_y=8.0 * strength[1])  # fmt: skip
                else:
                    given_ = InputState(time_step=k, acceleration=8.0 * strength[0],
                                        steering_angle_speed=0.4 * strength[1])  # fmt: skip
                made = dynamics.simulate_next_state(states[-1], given_, dt, throw=False)
                if made is not None:
                    break
            else:
                break
            off = made
            off.position = np.asarray(off.position) + rng.uniform(-0.012, 0.012, 2)
            if not model.startswith("PM"):
                off.orientation += rng.uniform(-0.02, 0.02)
            if model.startswith("ST") or state_transition_feasibility(states[-1], off, dynamics, dt)[0]:
                states.append(off)
            else:
                break
        if len(states) < 5:
            continue
        recording = states_of(states, "made", 0, vehicle)
        consistency.require_consistent(recording, dt, vehicle)


# -- until when it holds -------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [5, 12, 34, 38, 71])
def test_a_reference_ends_with_its_last_state(tmp_path, count):
    made = prepared(tmp_path, drive(count))
    last = 0.1 * (count - 1)
    assert made.reference.t_end <= last
    assert made.reference.t_end == pytest.approx(last)
    assert made.t_reference <= last
    said = [note for note in made.notes if note.startswith("the reference ends at")]
    assert bool(said) is (count < 71)
    assert all(f"{last:g} s" in note for note in said)
    times = np.arange(count) * 0.1
    np.testing.assert_allclose(made.scene.frame.to_cartesian(*made.reference.sample(times).position.T),
                               [[20.0 + 10.0 * t, 0.0] for t in times], atol=0.02)  # fmt: skip


def test_a_reference_that_ends_before_the_obstacle_is_free(tmp_path):
    wall = roads.car(12, roads.state(20.0 + 33.0 + 2.2 + 0.9 + 2.25 + 0.3, 0.0, v=0.0))
    assert prepared(tmp_path, drive(34), obstacles=wall).conflict.time == np.inf
    assert prepared(tmp_path, drive(71), obstacles=wall).conflict.time == pytest.approx(3.4, abs=0.11)


@pytest.mark.parametrize("v", [8.3, 10.0, 11.8])
def test_a_reference_may_start_slower_or_faster_as_commonroad_allows(tmp_path, v):
    made = prepared(tmp_path, drive(v=v))
    assert made.conflict.time == np.inf
    np.testing.assert_allclose(made.reference.sample(np.arange(0.0, 7.0, 0.05)).velocity[:, 0], v, atol=0.05)
    assert any(note.startswith("the reference starts with") for note in made.notes) is (v != 10.0)


def test_a_reference_that_brakes_from_the_first_step_on_is_followed(tmp_path):
    states = drive()
    for k, row in states.items():
        t = min(0.1 * k, 10.0 / 8.0)
        row[0], row[3] = 20.0 + 10.0 * t - 4.0 * t**2, 10.0 - 8.0 * t
    made = prepared(tmp_path, states)
    times = np.arange(71) * 0.1
    there = made.scene.frame.to_cartesian(*made.reference.sample(times).position.T)[:, 0]
    np.testing.assert_allclose(there, [row[0] for row in states.values()], atol=0.08)


# -- margins in which the ego starts -------------------------------------------------------------------

body = st.tuples(
    st.floats(-8.0, 12.0),  # middle along s, from the ego's start
    st.floats(0.2, 3.0),  # half length
    st.floats(-4.0, 4.0),
    st.floats(0.2, 1.5),
    st.floats(-6.0, 6.0),  # speed against the ego's
    st.floats(-1.5, 1.5),
    st.floats(-2.0, 2.0),  # acceleration
)


def situation(bodies, weave, s_offset, l_offset, *, whole=False):
    """Boxes around moving bodies, inflated, and a path that weaves; TTC by the boxes."""
    t = np.arange(41) * 0.1
    lower, upper = np.empty((len(bodies), 41, 2)), np.empty((len(bodies), 41, 2))
    for k, (s, length, l, width, v, u, a) in enumerate(bodies):  # noqa: E741
        middle = np.stack([10.0 * t + s + v * t + 0.5 * a * t**2, l + u * t], axis=1)
        half = np.array([length + s_offset, width + l_offset])
        lower[k], upper[k] = middle - half, middle + half
    made = Occupancy(t, np.arange(len(bodies)), lower, upper, np.zeros(len(bodies), dtype=bool))
    path = np.stack([10.0 * t + weave[0] * t**2, weave[1] * np.sin(t)], axis=1)
    reduced, notes = shrink_to_start(made, path, set(), (s_offset, l_offset))
    zero = np.zeros_like(path)
    entry = first_entry(reduced, toy.constant().sample(t).__class__(t, path, zero, zero, zero))
    if whole:
        return made, reduced, path
    return (np.inf if entry is None else entry[0]), reduced, notes


@given(
    st.lists(body, min_size=1, max_size=3),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)),
    st.lists(st.floats(0.0, 12.0), min_size=2, max_size=5),
    st.lists(st.floats(0.0, 5.0), min_size=2, max_size=5),
)
def test_ttc_never_rises_when_an_offset_grows(bodies, weave, along, across):
    ttc = {(a, b): situation(bodies, weave, a, b)[0] for a in along for b in across}
    for (a, b), here in ttc.items():
        for (c, d), there in ttc.items():
            # by a margin as thin as rounding, one start is inside and the other is not
            if c >= a and d >= b and (c - a > 1e-5 or c == a) and (d - b > 1e-5 or d == b):
                assert there <= here


@given(
    st.lists(body, min_size=1, max_size=3),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)),
    st.floats(0.0, 12.0),
    st.floats(0.0, 5.0),
)
def test_the_start_is_free_and_a_margin_that_was_left_is_whole_again(bodies, weave, s_offset, l_offset):
    ttc, reduced, notes = situation(bodies, weave, s_offset, l_offset)
    assert ttc > 0
    assume(notes)
    assert all("margin of obstacle" in note for note in notes)
    made, reduced, path = situation(bodies, weave, s_offset, l_offset, whole=True)
    for k, name in enumerate(made.ids):
        out = ((path <= made.lower[k]) | (path >= made.upper[k])).any(axis=1)
        if not out.any():
            continue
        since = int(np.argmax(out)) + 1
        rows = np.flatnonzero(reduced.ids == name)
        corners = np.abs(reduced.lower[rows, since:] - made.lower[k, since:]).max(axis=2)
        corners += np.abs(reduced.upper[rows, since:] - made.upper[k, since:]).max(axis=2)
        assert (np.nanmin(corners, axis=0) < 1e-5).all()


def test_an_obstacle_ahead_that_comes_closer_is_a_conflict_however_large_the_margin():
    # 8 m ahead and 1 m beside, closing at 2 m/s: from S_offset = 8 m on the ego starts inside
    bodies = [(10.0, 2.0, 2.0, 1.0, -2.0, 0.0, 0.0)]
    times = [situation(bodies, (0.0, 0.0), s, 1.5)[0] for s in np.arange(0.0, 20.0, 0.5)]
    assert times == sorted(times, reverse=True)
    assert times[0] == 41 or times[0] > 30
    assert max(times[17:]) == 1


def test_a_margin_that_was_left_counts_again():
    # starts 1 m behind an obstacle that pulls away and then brakes hard: the whole margin of 5 m counts again
    bodies = [(3.0, 2.0, 0.0, 1.0, 8.0, 0.0, -8.0)]
    first, reduced, notes = situation(bodies, (0.0, 0.0), 5.0, 1.0)
    gap = 1.0 + 8.0 * 0.1 * np.arange(41) - 4.0 * (0.1 * np.arange(41)) ** 2
    assert gap.max() == pytest.approx(5.0, abs=0.01)  # it never quite leaves
    turned = int(np.argmax(gap))
    assert turned < first <= turned + 2
    assert "obstacle 0" in notes[0]
    assert len(reduced) == 1


def test_who_drives_beside_an_obstacle_within_its_margin_may_go_on():
    bodies = [(0.0, 3.0, 2.5, 1.0, -2.0, 0.0, 0.0)]  # 1.5 m to the left, slower
    assert situation(bodies, (0.0, 0.0), 5.0, 2.0)[0] == np.inf
    closer = [(0.0, 3.0, 2.5, 1.0, -2.0, -0.2, 0.0)]
    assert situation(closer, (0.0, 0.0), 5.0, 2.0)[0] == 1


def test_an_obstacle_at_a_corner_has_a_box_for_each_axis():
    bodies = [(6.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0)]  # 4 m ahead, 2 m to the left, as fast as the ego
    first, reduced, notes = situation(bodies, (0.0, 0.0), 5.0, 3.0)
    assert first == np.inf
    assert reduced.ids.tolist() == [0, 0]
    assert "along s and l" in notes[0]
    assert situation([(6.0, 2.0, 3.0, 1.0, -0.5, 0.0, 0.0)], (0.0, 0.0), 5.0, 3.0)[0] == 1
    assert situation([(6.0, 2.0, 3.0, 1.0, 0.0, -0.1, 0.0)], (0.0, 0.0), 5.0, 3.0)[0] == 1


# -- frames along recordings ---------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.0, 0.6, np.pi / 2, np.pi])
def test_the_frame_along_a_recording_never_folds_back(tmp_path, turn):
    """Also where the recording ends across the route or against it."""
    scenario, _ = written(tmp_path, drive())
    scene = load_scene(scenario)
    steps = np.arange(71) * 0.8
    heading = np.clip(steps - 20.0, 0.0, 20.0) / 20.0 * turn
    positions = np.stack([20.0 + np.cumsum(0.8 * np.cos(heading)), np.cumsum(0.8 * np.sin(heading))], axis=1)
    frame = reframe(scene, positions).frame
    along, across = frame.to_frenet(positions).T
    np.testing.assert_allclose(np.diff(along), 0.8, atol=0.05)
    np.testing.assert_allclose(across, 0.0, atol=0.1)
