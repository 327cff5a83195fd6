"""The quick KS dynamics hold CommonRoad's own numbers, bit for bit."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from commonroad.common.solution import VehicleType
from commonroad_dc.feasibility.feasibility_checker import state_transition_feasibility
from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

from repair.vehicle.commonroad_ks import at_origin, to_ks_states
from repair.vehicle.ks_dynamics import quick_dynamics
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.states import DrivenStates
from repair.vehicle.transitions import POSITION_TOLERANCE, direct_check, engine_share

TYPES = pytest.mark.parametrize("type_id", [1, 2, 3, 4])


def state_and_input(vehicle, rng):
    """Half of them at or near a limit of steering, speed, engine or input."""
    near = rng.integers(2, size=4) == 1
    delta = rng.choice([-1, 1]) * vehicle.steering_max * rng.choice([1.0, 0.999, 1.001])
    v = rng.choice([vehicle.v_min, vehicle.v_max, vehicle.v_switch, 0.0]) + rng.choice([0.0, 1e-9, -0.1, 0.1])
    rate = rng.choice([-1, 1]) * (vehicle.steering_rate_max + rng.choice([0.0, 4e-5, -4e-5, 6e-5, 0.1]))
    push = rng.choice([-1, 1]) * (vehicle.a_max + rng.choice([0.0, 4e-5, -4e-5, 6e-5, 0.1]))
    x = [
        *rng.uniform(-9, 9, 2), delta if near[0] else 0.1 * rng.normal(),
        v if near[1] else rng.uniform(0, 40), rng.uniform(-3, 3),
    ]  # fmt: skip
    u = [rate if near[2] else 0.2 * rng.normal(), push if near[3] else 3.0 * rng.normal()]
    return np.array(x), np.array(u)


@TYPES
@pytest.mark.filterwarnings("ignore::scipy.integrate.ODEintWarning")
def test_every_answer_is_that_of_the_drivability_checker(type_id):
    rng, vehicle = np.random.default_rng(type_id), load_vehicle(type_id)
    quick, official = quick_dynamics(type_id), VehicleDynamics.KS(VehicleType(type_id))
    moved = 0
    for _ in range(300):
        x, u = state_and_input(vehicle, rng)
        dt = float(rng.choice([0.04, 0.1, 0.25]))
        assert quick.dynamics(0.0, x, u) == official.dynamics(0.0, x, u)
        assert quick.input_within_bounds(u) == official.input_within_bounds(u)
        assert quick.violates_friction_circle(x, u) == official.violates_friction_circle(x, u)
        ours, theirs = (d.forward_simulation(x, u, dt, throw=False) for d in (quick, official))
        assert (ours is None) == (theirs is None)
        if theirs is not None:
            moved += 1
            assert ours.tolist() == theirs.tolist()
    assert moved > 50


@TYPES
def test_so_is_the_word_on_a_transition(type_id):
    rng = np.random.default_rng(10 + type_id)
    quick, official = quick_dynamics(type_id), VehicleDynamics.KS(VehicleType(type_id))
    said = []
    for _ in range(12):
        v, delta = rng.uniform(0, 30), 0.05 * rng.normal()
        start = np.array([0.0, 0.0, delta, v, rng.uniform(-3, 3)])
        end = start + 0.1 * np.array(official.dynamics(0.0, start, rng.normal(size=2) * (0.3, 6.0)))
        end[:2] += rng.normal(size=2) * 0.012
        x, y, steering, speed, psi = np.array([start, end]).T
        pair = at_origin(to_ks_states(DrivenStates(np.array([0, 0.1]), x, y, steering, speed, psi), 0))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ours, theirs = (state_transition_feasibility(*pair, d, 0.1) for d in (quick, official))
        assert ours[0] == theirs[0]
        assert ours[1].acceleration == theirs[1].acceleration
        assert ours[1].steering_angle_speed == theirs[1].steering_angle_speed
        said.append(ours[0])
    assert {True, False} == set(said)


@TYPES
@pytest.mark.filterwarnings("ignore::scipy.integrate.ODEintWarning")
def test_where_the_engine_limits_a_step_from_standing_still_is_a_yes(type_id):
    """Between the share that its optimiser always finds and the one that a start at zero allows."""
    rng, vehicle = np.random.default_rng(20 + type_id), load_vehicle(type_id)
    dynamics, official, dt = quick_dynamics(type_id), VehicleDynamics.KS(VehicleType(type_id)), 0.1
    asked = 0
    while asked < 8:
        v = rng.uniform(vehicle.v_switch + 0.5, 0.9 * vehicle.v_max)
        engine = vehicle.a_max * vehicle.v_switch / v
        share = float(engine_share(np.array(engine), dt))
        if share < 0.5:
            continue
        a = engine * rng.uniform(0.46, share - 0.02)
        assert 0.5 * a * dt**2 < POSITION_TOLERANCE
        start = np.array([0.0, 0.0, 0.002 * rng.normal(), v, rng.uniform(-3, 3)])
        end = dynamics.forward_simulation(start, np.array([0.01 * rng.normal(), a]), dt, throw=False)
        if end is None:
            continue
        x, y, steering, speed, psi = np.array([start, end]).T
        b = vehicle.rear
        states = DrivenStates(
            np.array([0, dt]), x + b * np.cos(psi), y + b * np.sin(psi), steering, speed, psi
        )
        if not direct_check(states, dt, vehicle).ok[0]:
            continue
        asked += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pair = at_origin(to_ks_states(states, 0))
            assert state_transition_feasibility(*pair, official, dt)[0], (v, a)
