"""The closed loop: beliefs, curves, contacts and rows; each against something of the tests' own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from repair.arrays import wrap
from repair.config.simulate import SimulateConfig
from repair.errors import ConfigError, RepairError
from repair.reference.profile import SpeedProfile
from repair.report.loop.table import interval, summary, table_of
from repair.scene.road.lanes import Lane, locate
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.rows import rigid_outline
from repair.simulate.contact import first_struck, least_distance
from repair.simulate.curves import ahead_of, resumed
from repair.simulate.data import CycleRecord, Driven
from repair.simulate.many.case import simulation_config
from repair.simulate.many.run import Simulation, drives_in, tasks_of
from repair.simulate.measures import SIMULATION, row_of
from repair.simulate.near import ASIDE, anybody_near, within_reach
from repair.simulate.policies.registry import POLICIES, make_policy
from repair.simulate.predictions.network import Network
from repair.simulate.predictions.registry import PREDICTIONS, make_predictor
from repair.simulate.watch import Found
from repair.simulate.world import Beliefs, World, displaced, widened
from repair.study.rows import strict
from repair.study.store import Store
from repair.study.task import packed
from repair.vehicle.model import vehicle_model
from repair.world.collision import CollisionWorld

DT = 0.1
VEHICLE = vehicle_model(2).parameters
SIZE = 2.0 * VEHICLE.half_length, 2.0 * VEHICLE.half_width


def body(states: np.ndarray, half=(2.2, 0.9), name: int = 7) -> Obstacle:
    """A rectangle with states (T, 4)."""
    rectangles = np.column_stack([states[:, :3], np.tile(half, (len(states), 1))])
    rectangles[np.isnan(states[:, 0])] = np.nan
    return Obstacle(name, "car", "dynamic", rigid_outline(rectangles), rectangles, None, (), states)


def straight(x=0.0, y=0.0, heading=0.0, v=10.0, steps=60) -> np.ndarray:
    t = np.arange(steps + 1) * DT
    along = np.array([np.cos(heading), np.sin(heading)])
    places = np.array([x, y]) + v * t[:, None] * along
    return np.column_stack([places, np.full((len(t), 2), (heading, v))])


def circling(radius=30.0, v=8.0, steps=60) -> np.ndarray:
    angle = v / radius * np.arange(steps + 1) * DT
    places = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    return np.column_stack([places, angle, np.full(len(angle), v)])


def believed(name: str, states: np.ndarray, step: int, *, shift=0, lanes=None, **keys):
    world = World((body(states),), DT, len(states) - 1 - shift, shift, lanes or {})
    return Beliefs(world, make_predictor(name, SimulateConfig(**keys)), 30).at(step)


@pytest.mark.parametrize("name", PREDICTIONS.names())
def test_who_is_not_asked_about_does_not_come_near(name):
    rng = np.random.default_rng(3)
    crowd = []
    for k in range(60):
        x, y, heading, v = rng.uniform((-150, -150, -3, 0), (150, 150, 3, 20))
        states = (
            straight(x, y, heading, v) if k % 2 else circling(rng.uniform(20, 60), v) + np.array([x, y, 0, 0])
        )
        crowd.append(body(states, name=k))
    path = np.column_stack([np.linspace(0.0, 50.0, 14), np.zeros(14)])
    world = World(tuple(crowd), DT, 60)
    every, some = (Beliefs(world, make_predictor(name, SimulateConfig()), 30) for _ in range(2))
    asked = some.around(10, path.min(axis=0), path.max(axis=0), ASIDE)
    near = [one.id for one in within_reach(every.at(10), path)]
    assert 0 < len(near) < 60
    assert [one.id for one in within_reach(asked, path)] == near
    assert (len(asked) < 60) == getattr(every.predictor, "at_the_speed_of_now", False)
    assert [one.id for one in some.at(10)] == [one.id for one in every.at(10)]  # asked later, in order


@pytest.mark.parametrize(
    "name, states",
    [
        ("constant_velocity", straight(heading=0.7)), ("constant_turn", straight(heading=2.0)),
        ("constant_turn", circling()), ("recorded", circling()), ("delayed", circling()),
        ("delayed", straight()), ("lane", straight(y=3.0)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("shift", [0, 12])
def test_who_moves_as_it_is_believed_is_believed_rightly(name, states, shift):
    (found,) = believed(name, states, 10, shift=shift)
    rows = slice(10 + shift, 10 + shift + len(found.states))
    truth = body(states)
    assert len(found.states) == 31
    np.testing.assert_allclose(found.states[:, :2], states[rows, :2], atol=1e-6)
    np.testing.assert_allclose(found.vertices, truth.vertices[rows], atol=1e-6)
    np.testing.assert_allclose(found.rectangles, truth.rectangles[rows], atol=1e-6)


def lane(name: int, centre: np.ndarray, after=()) -> Lane:
    length = float(np.hypot(*np.diff(centre, axis=0).T).sum())
    return Lane(name, centre, centre, centre, length, tuple(after), (), (), True, None)


def test_lanelets_are_followed_and_the_straighter_one_of_two():
    turn = circling(20.0, 10.0, 20)[:, :2] + (20.0, 0.0)
    lanes = {
        1: lane(1, np.array([[-50.0, 0.0], [20.0, 0.0]]), [2, 3]),
        2: lane(2, turn),
        3: lane(3, turn * (1.0, -0.1)),
    }
    (found,) = believed("lane", straight(y=0.5), 0, lanes=lanes)
    assert found.states[-1, 1] == pytest.approx(0.5 - 0.1 * turn[10, 1], abs=0.3)
    del lanes[3]
    (found,) = believed("lane", straight(y=0.5), 0, lanes=lanes)
    assert np.hypot(*(found.states[-1, :2] - (20.0, 20.0))) == pytest.approx(19.5, abs=0.1)
    assert found.states[-1, 2] == pytest.approx(10.0 / 20.0, abs=0.1)
    speeds = np.hypot(*np.diff(found.states[:, :2], axis=0).T) / DT
    assert speeds.max() < 10.3


@given(seed=st.integers(0, 9999))
@settings(max_examples=40)
def test_the_lanelet_that_somebody_is_on_is_the_nearest_of_those_that_lead_there(seed):
    rng = np.random.default_rng(seed)
    lanes = {
        k: lane(k, np.cumsum(rng.normal((3.0, 0.0), 1.5, (rng.integers(2, 9), 2)), axis=0), [k + 1])
        for k in range(1, 9)
    }
    network, point, heading = Network(lanes), rng.uniform((0.0, -6.0), (20.0, 6.0)), rng.uniform(-2.0, 2.0)
    places = {k: locate(one.center, point) for k, one in lanes.items()}
    leads = {k: place for k, place in places.items() if abs(wrap(place[2] - heading)) < 0.9}
    nearest = min(leads, key=lambda k: abs(leads[k][1]), default=None)
    found = network.beside(point, heading, 3.0, 0.9)
    if nearest is None or abs(leads[nearest][1]) >= 3.0:
        assert found is None
    else:
        assert found == (lanes[nearest], *leads[nearest][:2])
    # Along three of them, however far was asked for before
    for until in rng.permutation([0.0, 10.0, 50.0, 12.0]):
        way = network.way(lanes[1], until)
        expected, last = lanes[1].center, 1
        while sum(lanes[k].length for k in range(1, last + 1)) < until and last < 8:
            last += 1
            expected = np.concatenate([expected, lanes[last].center])
        np.testing.assert_array_equal(way.line, expected)


@given(
    name=st.sampled_from(["constant_velocity", "constant_turn", "lane"]),
    step=st.integers(1, 40), seed=st.integers(0, 99),
)  # fmt: skip
@settings(max_examples=30)
def test_nothing_of_the_future_is_known(name, step, seed):
    states = circling()
    other = states.copy()
    other[step + 1 :] += np.random.default_rng(seed).normal(0.0, 5.0, (60 - step, 4))
    one, two = believed(name, states, step), believed(name, other, step)
    np.testing.assert_array_equal(one[0].vertices, two[0].vertices)
    late = states.copy()
    late[: step + 1] = np.nan
    assert believed(name, late, step) == ()
    assert len(believed("recorded", late, step)) == 1


def test_what_is_known_late_is_the_record_of_then_from_where_it_is_now():
    states = straight()
    states[20:, 0] = states[20, 0]  # stands from 2 s on, and the heading stays
    (seen,) = believed("delayed", states, 22, delay=0.5)
    assert seen.states[0, 0] == states[22, 0]
    assert seen.states[-1, 0] - states[22, 0] == pytest.approx(3.0)  # what 0.3 s of driving were left then
    (after,) = believed("delayed", states, 26, delay=0.5)
    assert after.states[-1, 0] == pytest.approx(states[26, 0])


@given(error=st.floats(0.1, 5.0), v=st.floats(0.0, 20.0))
@settings(max_examples=30)
def test_everybody_is_widened_along_the_way_and_nobody_backs_up(error, v):
    one = body(straight(heading=0.5, v=v))
    found = widened((one,), error, DT)
    if v * 6.0 < 0.5:
        assert found == (one,)
        return
    t, along = np.arange(61) * DT, np.array([np.cos(0.5), np.sin(0.5)])
    plain, ahead, behind = (each.states[:, :2] @ along for each in found)
    np.testing.assert_allclose(ahead - plain, 0.5 * error * t**2, atol=1e-9)
    assert (np.diff(behind) > -1e-9).all()
    assert (plain - behind <= 0.5 * error * t**2 + 1e-9).all()
    np.testing.assert_allclose(found[1].rectangles[:, :2], found[1].states[:, :2])


@given(seed=st.integers(0, 999))
def test_who_is_within_reach_comes_near_the_path(seed):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(1.0, 1.0, (30, 2)), axis=0)
    cars = [body(straight(*rng.uniform(-60.0, 90.0, 2), rng.uniform(0.0, 6.0), rng.uniform(0.0, 20.0)))
            for _ in range(6)]  # fmt: skip
    gaps = [np.hypot(*(one.states[:, None, :2] - path).T).min() for one in cars]
    expected = [one for one, gap in zip(cars, gaps, strict=True) if gap <= 12.0 + np.hypot(2.2, 0.9)]
    assert list(within_reach(cars, path)) == expected


def test_who_is_displaced_is_ahead_or_behind_and_who_stands_stays():
    moves, stands = body(straight(v=8.0)), body(straight(v=0.0), name=8)
    ahead, there = displaced((moves, stands), 1.0, DT)
    behind, _ = displaced((moves, stands), -1.0, DT)
    assert there is stands
    assert ahead.states[20, 0] == pytest.approx(16.0 + 2.0)
    assert behind.states[20, 0] == pytest.approx(16.0 - 2.0)
    assert ahead.states[0, 0] == behind.states[0, 0] == 0.0


@given(seed=st.integers(0, 9999))
@settings(max_examples=50)
def test_who_comes_near_is_seen_with_the_others_and_alone(seed):
    rng = np.random.default_rng(seed)
    cars = [
        body(straight(*rng.uniform(-60.0, 90.0, 2), rng.uniform(0.0, 6.0), rng.uniform(0.0, 20.0)), half)
        for half in ((2.2, 0.9), (6.0, 1.2), (2.2, 0.9))
    ]
    gone = body(np.where(np.arange(61)[:, None] < 30, straight(5.0, v=10.0), np.nan))
    ego = straight(rng.uniform(-5.0, 5.0), heading=rng.uniform(0.0, 6.0))[:50, :3]
    for some in (cars, [*cars, gone]):
        alone = [anybody_near([one], ego, VEHICLE, 0.5) for one in some]
        assert anybody_near(some, ego, VEHICLE, 0.5) == any(alone)


# -- curves -----------------------------------------------------------------------------------------


class Wave:
    """A curve that swings sideways."""

    t_start, t_end = 0.0, 2.0

    def __init__(self, v, rate):
        self.v, self.rate = v, rate

    def sample(self, t):
        from repair.curves.base import FrenetTrajectory

        t = np.atleast_1d(np.asarray(t, dtype=float))
        zero = np.zeros_like(t)
        return FrenetTrajectory(
            t, np.column_stack([5.0 + self.v * t, self.rate * t]),
            np.column_stack([zero + self.v, zero + self.rate]),
            np.zeros((len(t), 2)), np.zeros((len(t), 2)),
        )  # fmt: skip


@given(v=st.floats(0.0, 25.0), rate=st.floats(-1.0, 1.0), by=st.floats(0.0, 3.0))
@settings(max_examples=30)
def test_the_way_back_begins_as_it_is_driven_and_ends_on_the_plan(v, rate, by):
    rate = rate if v > 1.0 else 0.0
    driven = ahead_of(Wave(v, rate), by, 20.0)
    plan = SpeedProfile.from_accelerations(0.0, 12.0, [20.0], [0.0])
    way = resumed(driven, plan, 20.0, 1.5)
    here, there = driven.sample([0.0]), way.sample([0.0])
    np.testing.assert_allclose(there.position, here.position, atol=1e-9)
    np.testing.assert_allclose(there.velocity, here.velocity, atol=1e-9)
    t = np.linspace(0.0, 20.0, 400)
    along = way.sample(t)
    assert (np.abs(along.acceleration[:, 0]) <= 1.5 + 1e-9).all()
    assert along.velocity[-1, 0] == pytest.approx(12.0, abs=0.05)
    assert abs(along.position[-1, 1]) < 1e-6
    rates = np.gradient(along.position, t, axis=0)
    np.testing.assert_allclose(rates[2:-2], along.velocity[2:-2], atol=0.08)


def test_beyond_its_end_a_curve_goes_on_and_comes_to_the_side_no_more():
    seen = ahead_of(Wave(10.0, 0.8), 1.0, 9.0)
    found = seen.sample(np.linspace(0.0, 9.0, 181))
    assert seen.t_start == 0.0
    assert found.position[0].tolist() == [15.0, 0.8]
    assert np.abs(np.diff(found.position[:, 1])).max() < 0.05
    assert found.position[-1, 1] == pytest.approx(1.6 + 0.4, abs=1e-3)
    assert found.velocity[-1] == pytest.approx([10.0, 0.0], abs=1e-3)


# -- contact ----------------------------------------------------------------------------------------


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60)
def test_contacts_are_those_of_the_judge_who_shares_nothing_with_it(seed):
    rng = np.random.default_rng(seed)
    meets = rng.uniform(1.0, 3.0)
    angle, v = rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 15.0)
    place = np.array([10.0 * meets, 0.0]) + rng.uniform(-3.0, 3.0, 2)
    start = place - v * meets * np.array([np.cos(angle), np.sin(angle)])
    other = body(straight(*start, angle, v, 40))
    per = 20
    poses = straight(v=10.0, steps=40)
    t = np.arange(40 * per + 1) / per * DT
    fine = np.column_stack([10.0 * t, np.zeros_like(t), np.zeros_like(t), np.full_like(t, 10.0)])
    found = first_struck([other], fine, SIZE, DT)
    world = CollisionWorld([other], VEHICLE, DT, 40, 4)
    seen = world.contact(10.0 * t[::5], np.zeros(161), np.zeros(161))
    near = anybody_near([other], poses[:, :3], VEHICLE, 0.1)
    if seen is None:
        assert found is None or least_distance([other], fine, SIZE, 1.0) < 1e-3
    else:
        assert near
        moved = world.contact(10.0 * t[::5] + 1e-3, np.zeros(161), np.zeros(161))
        assert found is not None or moved is None  # a graze apart
        if found is not None:
            assert found.time == pytest.approx(seen.time, abs=DT / per + 0.002) or moved is None
            assert found.obstacle_id == 7
    if found is None and not near:
        assert least_distance([other], fine, SIZE, 1.0) > 0.1


def test_who_is_struck_and_how():
    ego = np.column_stack([np.linspace(0.0, 40.0, 201), np.zeros((201, 2)), np.full(201, 10.0)])
    behind = first_struck([body(straight(-20.0, v=20.0, steps=40))], ego, SIZE, DT, 1.5)
    assert behind.from_behind
    assert behind.speed == pytest.approx(10.0)
    assert behind.time == pytest.approx(1.5 + (20.0 - VEHICLE.half_length - 2.2) / 10.0, abs=0.03)
    ahead = first_struck([body(straight(20.0, v=4.0, steps=40))], ego, SIZE, DT)
    assert not ahead.from_behind
    assert (ahead.speed, ahead.ego_speed) == pytest.approx((6.0, 10.0))
    assert first_struck([body(straight(20.0, 4.0, v=4.0, steps=40))], ego, SIZE, DT) is None
    gone = straight(20.0, v=4.0, steps=40)
    gone[15:] = np.nan
    assert first_struck([body(gone)], ego, SIZE, DT) is None


# -- rows -------------------------------------------------------------------------------------------


def test_the_impact_is_that_of_the_step_that_leads_to_it():
    """Who brakes is met at the end of a step, and at the place where it is then."""
    ego = np.column_stack([np.linspace(0.0, 40.0, 201), np.zeros((201, 2)), np.full(201, 10.0)])
    states = straight(v=5.0, steps=40)
    length = VEHICLE.half_length + 2.2
    states[:, 0] = length + 9.99  # stands from 1 s on, and is touched then
    states[:10, 0] -= np.arange(10, 0, -1) * DT * 5.0
    found = first_struck([body(states)], ego, SIZE, DT)
    assert found.time == pytest.approx(1.0)
    assert found.speed == pytest.approx(5.0)
    # 40 m/s and 5 m/s aside: at the beginning of the step its middle was behind, at the contact it is beside
    t = np.arange(41) * DT
    aside = straight(v=40.0, steps=40)
    meets, sides = 0.98, VEHICLE.half_width + 0.9
    aside[:, 0], aside[:, 1] = 10.0 * meets + 40.0 * (t - meets), sides + 5.0 * (meets - t) - 1e-3
    found = first_struck([body(aside)], ego, SIZE, DT)
    assert found.time == pytest.approx(meets)
    assert not found.from_behind


def driven(speeds, cycles=(), struck=None, distance=1.0, offset=0.0) -> Driven:
    speeds = np.asarray(speeds, dtype=float)
    x = np.append(0.0, np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * DT))
    zero = np.zeros_like(x)
    plan = 10.0 * np.arange(len(x)) * DT
    states = {
        "t": np.arange(len(x)) * DT, "x": x, "y": zero + offset, "orientation": zero, "speed": speeds,
        "plan_x": plan, "plan_y": zero, "plan_orientation": zero, "plan_speed": zero + 10.0,
    }  # fmt: skip
    return Driven(DT, {k: v.tolist() for k, v in states.items()}, tuple(cycles), struck, distance)


def test_measures_by_hand():
    inf = float("inf")
    cycles = [
        CycleRecord(0.0, "plan", 2.0, 0.6, 0.01), CycleRecord(0.1, "plan", 1.9, 0.5, 0.02),  # as it should
        # jumps, dissolves, is lost
        CycleRecord(0.2, "plan", 1.8, 0.1, 0.02), CycleRecord(0.3, "plan", inf, inf, 0.01),
        CycleRecord(0.4, "plan", 1.5, 0.9, 0.01), CycleRecord(0.5, "brake", 1.4, None, 0.04, False),
        CycleRecord(0.6, "repair", 1.4, None, 0.01), CycleRecord(0.7, "plan", inf, inf, 0.01),
    ]  # fmt: skip
    cycles += [CycleRecord(0.8, "plan", 1.4, 0.5, 0.01, False), CycleRecord(0.9, "plan", 1.3, 0.8, 0.01)]
    cycles += [CycleRecord(1.0, "plan", 1.2, 0.9, 0.01, False)]  # carried on, which is no jump
    speeds = np.concatenate([np.full(5, 10.0), 10.0 - 0.6 * np.arange(1, 6), np.full(10, 7.0)])
    row = row_of(driven(speeds, cycles, offset=0.0), driven(np.full(20, 10.0), distance=0.05), 0.1, 0.1)
    assert row["plan_contact_s"] is None
    assert row["plan_margin"]
    assert (row["interventions"], row["first_intervention_s"], row["braked_cycles"]) == (1, 0.5, 1)
    assert row["peak_deceleration_mps2"] == pytest.approx(6.0)
    assert row["peak_jerk_mps3"] == pytest.approx(60.0)
    assert (row["pairs"], row["jumps"], row["dissolved"], row["lost"]) == (4, 1, 1, 1)
    assert (row["cycles"], row["cut_short"], row["cycle_max_ms"]) == (11, 3, 40.0)
    aside = row_of(driven(np.full(21, 10.0), offset=2.0), driven(np.full(21, 10.0)), 0.1, 0.1)
    assert aside["deviation_ms"] == pytest.approx(4.0)
    assert not aside["plan_margin"]
    assert aside["interventions"] == 0


def made_row(file, policy, *, hit=None, struck=None, acted=0, peak=0.0, margin=False):
    return {
        "file": file, "reference": "constant", "shift_s": 0.0, "prediction": "lane", "policy": policy,
        "status": "driven", "plan_contact_s": hit, "plan_contact_from_behind": False if hit else None,
        "plan_margin": margin or hit is not None, "contact_s": struck, "contact_from_behind": struck and True,
        "impact_speed_mps": struck and 3.0, "within_verified": False, "interventions": acted,
        "first_intervention_s": 1.0 if acted else None, "peak_deceleration_mps2": peak, "pairs": 0,
        "jumps": 0, "dissolved": 0, "lost": 0, "peak_jerk_mps3": 3.0 * peak, "deviation_ms": 2.0 * peak,
        "peak_lateral_acceleration_mps2": 0.5 * peak,
        "drive": {"cycles": [{"t": 0.0, "ms": 5.0}, {"t": 0.2, "ms": 5.0}]},
    }  # fmt: skip


def test_the_table_counts():
    rows = [
        made_row("a", "f_ttr", hit=3.0, acted=1, peak=8.0),
        made_row("a", "f_ttr", hit=2.0, struck=2.5, acted=1),
        made_row("b", "f_ttr", acted=2, peak=5.0), made_row("b", "f_ttr", margin=True, acted=1, peak=1.0),
        made_row("c", "f_ttr"),
    ]  # fmt: skip
    found = summary(rows)
    assert (found["contacts"], found["avoided"]) == (2, 1)
    assert (found["struck"], found["struck_not_from_behind"]) == (1, 0)
    assert (found["negatives"], found["for_nothing"], found["hard_for_nothing"]) == (3, 2, 1)
    assert (found["free"], found["for_nothing_margin"]) == (2, 1)
    assert found["precision"] == 0.5
    assert found["median_ahead_s"] == 1.5
    low, high = interval(rows, lambda some: summary(some)["for_nothing"])
    assert low == 0.0
    assert high >= 4.0  # of file b alone
    assert interval(rows, lambda some: 2 * len(some), len) == (2.0, 2.0)
    assert np.isnan(interval(rows, len, lambda some: 0)).all()
    others = [{**row, "policy": "at_once", "interventions": 1, "first_intervention_s": 0.0} for row in rows]
    text = table_of([*rows, *others, {**rows[0], "status": "not_driven", "file": "d"}])
    assert "5 cases" not in text  # two of a file and plan are one case here
    assert "| lane | f_ttr | 5 | 1 of 2 | 1 (0) | 4 | 2 of 3 [0, " in text
    assert "lane: f_ttr acts for nothing 0.67" in text
    assert (
        "lane, f_ttr: cycles p50 5.0, p95 5.0, p99 5.0, p99.9 5.0 ms of processor time, a period of 200 ms; "
        "who acts, in " in text
    )
    assert "jerk 9 m/s³, 1.5 m/s² aside, 6.0 m s off the plan; struck with 3.0 m/s in the median" in text
    faster = {**rows[0], "drive": {"cycles": [{"t": 0.1 * k, "ms": 5.0} for k in range(3)]}}
    assert "time, periods of 100 to 200 ms" in table_of([*rows, faster])


def simulation(tmp_path, **changed) -> Simulation:
    """Two predictions and two policies on one road; nothing is driven."""
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text("<commonRoad/>", encoding="utf-8")
    config = simulation_config(overrides=changed.pop("overrides", ()))
    given = {
        "files": (file,), "policies": ("f_ttr", "graded"), "predictions": ("recorded", "lane"),
        "plans": ("constant",), "shifts": (0.0, 1.0), "config": config,
    }  # fmt: skip
    return Simulation(**{**given, **changed})


def test_a_drive_is_made_again_where_what_it_reads_has_changed(tmp_path):
    tasks = tasks_of(simulation(tmp_path))
    keys = {tuple(task.varied.values()): task.key for task in tasks}
    assert len(set(keys.values())) == 8
    assert [task.varied["shift_s"] for task in tasks] == [0.0] * 4 + [1.0] * 4

    def changed(*overrides):
        there = tasks_of(simulation(tmp_path, overrides=overrides))
        return {task.varied["policy"] for task in there if keys[tuple(task.varied.values())] != task.key}

    assert changed("simulate.doubt=0") == {"graded"}
    assert changed("simulate.gentle=[3.0]") == {"graded"}
    assert changed("simulate.back=2.0") == {"graded", "f_ttr"}


def test_drives_are_stored_with_their_columns(tmp_path):
    tasks = tasks_of(simulation(tmp_path, policies=("f_ttr",), predictions=("lane",)))
    row = {**made_row("a", "f_ttr", hit=3.0, acted=1), "variation": "", "backend": "ego"}
    stored = strict({name: row.get(name) for name in SIMULATION.columns}, SIMULATION)
    cycles = {"cycles": [{"ms": 5.0}]}
    with Store(tmp_path, SIMULATION) as store:
        store.plan(tasks)
        store.add(tasks[0], stored, packed(cycles, None))
        store.add(tasks[1], {**stored, "status": "not_driven"}, None)
    with Store(tmp_path, SIMULATION, readonly=True) as store:
        one, two = drives_in(store)
    assert (one["policy"], one["shift_s"], one["plan_margin"], one["drive"]) == ("f_ttr", 0.0, True, cycles)
    assert (two["shift_s"], two["status"]) == (1.0, "not_driven")
    assert "drive" not in two
    with pytest.raises(RepairError, match=r"holds no study.sqlite; `repair study`"):
        Store(tmp_path, readonly=True)
    with pytest.raises(RepairError, match="column interventions holds"):
        strict({**stored, "interventions": "often"}, SIMULATION)


# -- when the plan is left --------------------------------------------------------------------------

SOON, LATER = 0.1, 0.9  # before the next cycle, and after it


class Seen:
    """A sight of the tests' own: what is found at each limit, and whether the contact is sure."""

    period = 0.2

    def __init__(self, gentle, hard=LATER, *, sure=True, mode="plan", now=0.0, first=None):
        self.eyes = SimpleNamespace(gentle=gentle)
        self.found, self.cycle, self.first = gentle, made(hard, "hard"), made(first, "first")
        self.mode, self.now = mode, now
        self.sure = lambda: sure

    def gently(self, level):
        return made(self.found[level], level)


def made(f_ttr, name) -> Found:
    return Found(f_ttr, None if f_ttr is None else name, 3.0, False, True)


def test_a_gentle_repair_is_waited_on_and_driven_where_the_contact_is_sure():
    policy = make_policy("graded", SimulateConfig())
    assert policy.decide(Seen((LATER, LATER))).f_ttr == LATER
    assert policy.decide(Seen((SOON, LATER))).curve == 0
    assert policy.decide(Seen((SOON, LATER), sure=False)).kind == "keep"
    assert policy.decide(Seen((SOON, LATER), SOON, sure=False)).curve == "hard"
    assert policy.decide(Seen((None, SOON))).curve == 1  # the first limit is passed over
    assert policy.decide(Seen((LATER, SOON), now=0.2)).curve == 1  # and not gone back to
    assert policy.decide(Seen((LATER, SOON), now=0.8)).f_ttr == LATER  # before the conflict is over
    assert policy.decide(Seen((None, None), now=1.0)).f_ttr == LATER


def test_off_the_plan_nothing_is_waited_for():
    policy = make_policy("graded", SimulateConfig())
    assert policy.decide(Seen((LATER,), mode="repair", first=0.0)).curve == "first"
    assert policy.decide(Seen((LATER,), LATER, mode="repair")).f_ttr == LATER
    assert policy.decide(Seen((LATER,), SOON, mode="repair")).curve == "hard"


# -- names and settings -----------------------------------------------------------------------------


def test_names_and_settings_that_cannot_be():
    with pytest.raises(ConfigError, match="prediction 'crystal_ball' is unknown"):
        make_predictor("crystal_ball", SimulateConfig())
    with pytest.raises(ConfigError, match="policy 'later' is unknown"):
        make_policy("later", SimulateConfig())
    with pytest.raises(ConfigError, match=r"simulate.gentle holds -1 m/s²"):
        simulation_config(overrides=["simulate.gentle=[-1.0]"])
    config = simulation_config(overrides=["search.rule=scan"])
    assert (config.search.rule, config.search.delta_t, config.fallback) == ("scan", 0.1, [])


def test_a_registered_part_is_made_by_its_name():
    class Standing:
        def predict(self, known):
            return replace(known.past, vertices=np.repeat(known.past.vertices[-1:], known.n_steps + 1, 0))

    PREDICTIONS.register("standing", lambda config: Standing())
    POLICIES.register("sleeping", lambda config: make_policy("never", config))
    try:
        (found,) = believed("standing", straight(), 5)
        assert np.ptp(found.vertices, axis=0).max() == 0.0
        assert make_policy("sleeping", SimulateConfig()).decide(None).kind == "keep"
    finally:
        PREDICTIONS.unregister("standing")
        POLICIES.unregister("sleeping")
