"""What the direct check accepts, the drivability checker accepts: over random transitions of all kinds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from commonroad.common.solution import VehicleType
from commonroad_dc.feasibility.feasibility_checker import state_transition_feasibility
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

from repair.vehicle.commonroad_ks import official_check
from repair.vehicle.model import vehicle_model
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.single_track import drive
from repair.vehicle.states import DrivenStates
from repair.vehicle.transitions import direct_check

KINDS = (
    "typical", "low_speed", "standstill", "v_switch", "engine", "fast", "reverse", "steering_limit",
    "starts_at_limit", "input_bounds", "braking_to_a_stop", "friction", "steering_jump", "noise",
)  # fmt: skip


def choose(kind, vehicle, dt, rng):
    """Speed, steering angle and the two inputs of a random transition of a kind."""
    limit, rate, a_max = vehicle.steering_max, vehicle.steering_rate_max, vehicle.a_max
    v, delta, u, a = rng.uniform(0, 20), 0.1 * rng.normal(), 0.1 * rng.normal(), 2.0 * rng.normal()
    if kind == "low_speed":
        v = rng.uniform(0, 1) ** 2
    elif kind == "standstill":
        v, delta, a = (
            0.01 * rng.uniform() * rng.integers(2),
            rng.uniform(-limit, limit),
            abs(a) * rng.integers(2),
        )
    elif kind == "v_switch":
        v, a = vehicle.v_switch + 0.5 * rng.normal(), rng.uniform(-a_max, a_max)
    elif kind == "engine":
        v, u = rng.uniform(vehicle.v_switch - 1, 0.95 * vehicle.v_max), rng.uniform(-rate, rate)
        a = rng.uniform(0, a_max * min(1.0, vehicle.v_switch / v))
    elif kind == "fast":
        v = rng.uniform(20, vehicle.v_max)
    elif kind == "reverse":
        v = -rng.uniform(0, 3)
    elif kind == "steering_limit":
        v, delta, u = (
            rng.uniform(0, 6),
            rng.choice([-1, 1]) * limit * rng.uniform(0.85, 1.0),
            rng.uniform(-rate, rate),
        )
    elif kind == "starts_at_limit":
        v, delta = rng.uniform(0, 8), rng.choice([-1, 1]) * limit
        u = -np.sign(delta) * abs(rng.normal()) * 0.3
    elif kind == "input_bounds":
        v, u = rng.uniform(0, 25), rng.choice([-1, 1]) * rate * rng.uniform(0.8, 1.02)
        a = rng.choice([-1, 1]) * a_max * rng.uniform(0.8, 1.02)
    elif kind == "braking_to_a_stop":
        v, delta = rng.uniform(0, 1) * a_max * dt, rng.uniform(-limit, limit)
        a = -v / dt * rng.uniform(0.9, 1.0)
    elif kind == "friction":
        v, lateral = rng.uniform(3, 30), rng.uniform(-a_max, a_max)
        delta = np.arctan(lateral * vehicle.wheelbase / v**2)
        a = rng.choice([-1, 1]) * np.sqrt(a_max**2 - lateral**2) * rng.uniform(0.7, 1.0)
    elif rng.uniform() < 0.5:
        u, a = rng.uniform(-rate, rate), rng.uniform(-a_max, a_max)
    grip = np.arctan(0.99 * a_max * vehicle.wheelbase / max(v * v, 1.0))
    return v, float(np.clip(delta, -min(limit, grip), min(limit, grip))), u, a


def simulate(state, u, a, dt, vehicle, n=20):
    """The model with its constraints by small explicit midpoint steps; state is x, y, delta, v, psi."""
    h = dt / n

    def derivative(s):
        rate = np.clip(u, -vehicle.steering_rate_max, vehicle.steering_rate_max)
        if abs(s[2]) >= vehicle.steering_max and s[2] * rate >= 0:
            rate = 0.0
        top = vehicle.a_max * (vehicle.v_switch / s[3] if s[3] > vehicle.v_switch else 1.0)
        yaw_rate = s[3] * np.tan(s[2]) / vehicle.wheelbase
        return np.array(
            [s[3] * np.cos(s[4]), s[3] * np.sin(s[4]), rate, np.clip(a, -vehicle.a_max, top), yaw_rate]
        )

    for _ in range(n):
        state = state + h * derivative(state + 0.5 * h * derivative(state))
    return state


def transition(kind, vehicle, dt, rng):
    v, delta, u, a = choose(kind, vehicle, dt, rng)
    place = rng.uniform(-1000, 1000, 2) * rng.integers(2)
    start = np.array([*place, delta, v, rng.uniform(-np.pi, np.pi)])
    end = simulate(start, u, a, dt, vehicle)
    if kind == "steering_jump":
        end[2] = np.clip(end[2] + 2 * dt * vehicle.steering_rate_max * rng.normal(), -0.5, 0.5)
    if kind == "noise" or rng.uniform() < 0.2:
        end = end + rng.normal(size=5) * (1, 1, 0.5, 1, 1) * 10.0 ** rng.uniform(-4, -1)
    x, y, steering, speed, psi = np.array([start, end]).T
    return DrivenStates(
        np.array([0.0, dt]),
        x + vehicle.rear * np.cos(psi),
        y + vehicle.rear * np.sin(psi),
        steering,
        speed,
        psi,
    )


@pytest.mark.thinned(3)
@pytest.mark.parametrize("type_id", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", KINDS)
def test_a_direct_yes_is_an_official_yes(kind, type_id):
    rng = np.random.default_rng([KINDS.index(kind), type_id])
    vehicle = load_vehicle(type_id)
    for _ in range(4):
        for dt in (0.04, 0.1, 0.2, 0.25):
            states = transition(kind, vehicle, dt, rng)
            report = direct_check(states, dt, vehicle)
            if report.ok[0]:
                official = official_check(states, dt, vehicle)
                assert official.ok[0], (kind, type_id, dt, states, report, official)


def test_regression_optimiser_stuck_where_the_engine_cuts_off():
    # The drivability checker refuses this drivable transition (VW Vanagon accelerating at 29 m/s): its
    # optimiser overshoots onto the flat part of its cost. The direct check must leave it alone.
    vehicle = load_vehicle(3)
    start = np.array([0.0, 0.0, 0.01, 29.2, 0.0])
    end = simulate(start, -0.06, 2.1, 0.25, vehicle)
    x, y, steering, speed, psi = np.array([start, end]).T
    b = vehicle.rear
    states = DrivenStates(np.array([0, 0.25]), x + b * np.cos(psi), y + b * np.sin(psi), steering, speed, psi)
    report = direct_check(states, 0.25, vehicle)
    assert not report.ok[0]
    assert report.limit(0) == "acceleration"
    assert report.use[3, 0] < 1.0


@pytest.mark.parametrize("type_id", [1, 2, 3, 4])
@pytest.mark.parametrize("dt", [0.04, 0.1, 0.2])
def test_ordinary_driving_is_accepted_without_asking(type_id, dt):
    # a bend with clothoids, entered while braking and left while accelerating
    vehicle = load_vehicle(type_id)
    t = np.arange(201) * dt / 4
    span = t[-1]
    speed = 7.0 + 1.5 * np.cos(2 * np.pi * t / span) * min(1.0, span / 4)
    distance = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * dt / 4)))
    curvature = 0.08 * np.sin(np.pi * distance / distance[-1]) ** 2
    heading = np.concatenate(([0.0], np.cumsum(0.5 * (curvature[1:] + curvature[:-1]) * np.diff(distance))))
    middle = 0.5 * (heading[1:] + heading[:-1])
    moves = np.diff(distance)[:, None] * np.column_stack((np.cos(middle), np.sin(middle)))
    xy = np.concatenate((np.zeros((1, 2)), np.cumsum(moves, axis=0)))
    states = drive(t, xy, heading, speed, distance, vehicle).every(4)
    report = direct_check(states, dt, vehicle)
    assert report.ok.all(), report.margin.min()
    assert official_check(states, dt, vehicle, range(0, 50, 10)).ok.all()


@pytest.mark.thinned(2)
@pytest.mark.parametrize("kind", KINDS)
def test_a_transition_is_judged_alike_wherever_it_is(kind):
    rng = np.random.default_rng(KINDS.index(kind))
    vehicle = load_vehicle(2)
    for _ in range(2):
        here = transition(kind, vehicle, 0.1, rng)
        for far in (1e5, 5e6):
            there = replace(here, x=here.x + far, y=here.y - far)
            ours = [direct_check(states, 0.1, vehicle) for states in (here, there)]
            np.testing.assert_allclose(ours[1].use, ours[0].use, rtol=1e-5, atol=1e-6)
            clear = np.abs(ours[0].margin) > 1e-5
            assert (ours[0].ok == ours[1].ok)[clear].all()
            if not ours[0].ok.all():
                words = [official_check(states, 0.1, vehicle).ok.tolist() for states in (here, there)]
                assert words[0] == words[1]


@pytest.mark.filterwarnings("ignore")
def test_far_from_the_origin_the_checker_says_the_same_of_what_is_clear():
    """As it is asked about files, without moving what is in them."""
    vehicle, t = load_vehicle(1), np.arange(5) * 0.1
    states = DrivenStates(t, 3e6 + 10.0 * t, 5e6 + 0.0 * t, 0.0 * t, 10.0 + 0.0 * t, 0.0 * t)
    assert direct_check(states, 0.1, vehicle).ok.all()
    ks = vehicle_model(1).to_commonroad(states, 0)
    dynamics = VehicleDynamics.KS(VehicleType(1))
    assert all(state_transition_feasibility(a, b, dynamics, 0.1)[0] for a, b in pairwise(ks))
