"""The kinematic states against independent integration, and the checks' reports."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp

from repair.vehicle.commonroad_ks import official_check, to_ks_states
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.single_track import drive
from repair.vehicle.states import DrivenStates
from repair.vehicle.transitions import LIMITS, direct_check

ESCORT = load_vehicle(1)
VEHICLES = pytest.mark.parametrize("vehicle", [load_vehicle(i) for i in (1, 2, 3, 4)], ids=lambda v: v.name)


def along(curvature, speed, t, breaks=()):
    """Centre path of piecewise constant curvature(s), driven at speed(t): arguments of drive()."""
    step = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))))

    def heading(s):
        knots = np.concatenate(([0.0], [b for b in breaks if b < s], [s]))
        return float(sum(curvature(0.5 * (a + b)) * (b - a) for a, b in pairwise(knots)))

    theta = np.array([heading(s) for s in step])
    xy = np.zeros((len(t), 2))
    for k in range(1, len(t)):
        move, _ = quad_vec(lambda s: np.array([np.cos(heading(s)), np.sin(heading(s))]), step[k - 1], step[k])
        xy[k] = xy[k - 1] + move
    return t, xy, theta, speed, step


def test_steady_circle_is_the_closed_form():
    kappa = 0.14
    t = np.linspace(0.0, 4.0, 161)
    states = drive(*along(lambda s: kappa, np.full(161, 4.0), t), ESCORT)
    slip = np.arcsin(kappa * ESCORT.rear)
    assert states.orientation == pytest.approx(kappa * 4.0 * t - slip, abs=1e-5)
    assert states.steering == pytest.approx(
        np.arctan(ESCORT.wheelbase / ESCORT.rear * np.tan(slip)), abs=1e-5
    )
    assert states.speed == pytest.approx(4.0 * np.cos(slip), abs=1e-5)


@pytest.mark.thinned(3)
@VEHICLES
def test_slip_follows_its_differential_equation_across_curvature_jumps(vehicle):
    def curvature(s):
        return 0.0 if s < 8 else (0.14 if s < 20 else -0.1)

    t = np.arange(161) * 0.025
    path = along(curvature, 8.0 - t, t, breaks=(8.0, 20.0))
    states = drive(*path, vehicle)
    exact = solve_ivp(
        lambda s, beta: [curvature(s) - np.sin(beta[0]) / vehicle.rear],
        (0.0, path[4][-1]), [0.0], t_eval=path[4], max_step=0.01, rtol=1e-9,
    )  # fmt: skip
    assert path[2] - states.orientation == pytest.approx(exact.y[0], abs=2e-3)
    assert official_check(states.every(4), 0.1, vehicle).ok.all()


def test_initial_slip_is_taken_and_dies_out():
    t = np.arange(161) * 0.025
    path = along(lambda s: 0.0, np.full(161, 5.0), t)
    states = drive(*path, ESCORT, slip0=0.2)
    assert states.orientation[0] == pytest.approx(-0.2)
    # a straight centre path: the rear axle draws a tractrix
    assert np.tan(-0.5 * states.orientation) == pytest.approx(
        np.tan(0.1) * np.exp(-path[4] / ESCORT.rear), abs=1e-12
    )
    assert direct_check(states.every(4), 0.1, ESCORT).ok.all()


def test_standstill_holds_everything():
    t = np.arange(101) * 0.025
    speed = np.maximum(2.0 - 2.0 * t, 0.0)
    path = list(along(lambda s: 0.1, speed, t))
    path[2][np.argmax(speed == 0.0) + 1 :] += 0.5  # a heading that means nothing at rest
    states = drive(*path, ESCORT)
    rest = speed == 0.0
    assert np.ptp(states.orientation[rest]) == 0.0
    assert np.ptp(states.steering[rest]) == 0.0
    assert (states.speed[rest] == 0.0).all()
    assert direct_check(states.every(4), 0.1, ESCORT).ok[11:].all()


def test_a_vehicle_that_never_moves():
    t = np.arange(5) * 0.1
    states = drive(t, np.ones((5, 2)), np.full(5, 0.3), np.zeros(5), np.zeros(5), ESCORT)
    assert (states.orientation == 0.3).all()
    assert (states.steering == 0.0).all()
    assert direct_check(states, 0.1, ESCORT).ok.all()


def test_a_single_sample():
    states = drive(np.zeros(1), np.ones((1, 2)), np.full(1, 0.3), np.ones(1), np.zeros(1), ESCORT, slip0=0.1)
    assert len(states) == 1
    assert states.orientation[0] == pytest.approx(0.2)
    assert direct_check(states, 0.1, ESCORT).ok.shape == (0,)
    assert official_check(states, 0.1, ESCORT).ok.shape == (0,)


def test_very_long_paths_do_not_overflow():
    s = np.linspace(0.0, 6000.0, 2001)
    xy = 1e3 * np.column_stack((np.sin(s / 1e3), 1.0 - np.cos(s / 1e3)))
    states = drive(s / 30.0, xy, s / 1e3, np.full(2001, 30.0), s, ESCORT)
    assert states.orientation[-1] == pytest.approx(6.0 - np.arcsin(0.001 * ESCORT.rear), abs=1e-6)


def test_every_thins_out():
    t = np.arange(9) * 0.1
    states = drive(*along(lambda s: 0.0, np.full(9, 5.0), t), ESCORT).every(4)
    assert len(states) == 3
    assert states.t == pytest.approx([0.0, 0.4, 0.8])
    assert states.x == pytest.approx([0.0, 2.0, 4.0])


# -------------------------------------------------------- what the parameters say


@VEHICLES
def test_the_body_lies_around_its_reference_point(vehicle):
    assert np.ptp(vehicle.corners, axis=0) == pytest.approx([vehicle.length, vehicle.width])
    assert vehicle.corners.sum(axis=0).tolist() == [0.0, 0.0]
    assert np.hypot(*vehicle.corners.T) == pytest.approx(vehicle.radius)
    assert vehicle.corners[0].tolist() == [vehicle.half_length, vehicle.half_width]
    following = np.roll(vehicle.corners, -1, axis=0)
    assert (vehicle.corners[:, 0] * following[:, 1] > vehicle.corners[:, 1] * following[:, 0]).all()


@VEHICLES
@pytest.mark.parametrize("share", [0.5, 0.95])
def test_the_sharpest_circle_takes_all_of_the_steering(vehicle, share):
    t = np.arange(41) * 0.1
    kappa = vehicle.largest_curvature(share)
    assert vehicle.largest_curvature() > kappa
    states = drive(*along(lambda s: kappa, np.full(41, 2.0), t), vehicle, slip0=vehicle.steady_slip(kappa))
    assert states.steering == pytest.approx(share * vehicle.steering_max, rel=1e-3)
    turning = np.diff(states.orientation) / 0.1
    lateral = vehicle.lateral_acceleration(states.speed[:-1], states.steering[:-1])
    assert lateral == pytest.approx(states.speed[:-1] * turning, rel=1e-3)


@VEHICLES
def test_the_engine_limits_the_acceleration_from_its_speed_on(vehicle):
    speeds = vehicle.v_switch * np.array([-1.0, 0.0, 0.5, 1.0, 2.0, 4.0])
    expected = vehicle.a_max * np.array([1.0, 1.0, 1.0, 1.0, 0.5, 0.25])
    assert vehicle.engine_acceleration(speeds) == pytest.approx(expected)
    assert vehicle.engine_acceleration(speeds, 0.9) == pytest.approx(0.9 * expected)
    assert replace(vehicle, v_switch=np.inf).engine_acceleration(30.0) == vehicle.a_max


def test_the_sideways_jerk_is_that_of_turning_the_wheel():
    step = 1e-6
    after = ESCORT.lateral_acceleration(12.0, step * ESCORT.steering_rate_max)
    assert ESCORT.lateral_jerk(12.0) == pytest.approx(float(after) / step)


# ---------------------------------------------------------------- direct_check


def straight(n=5, speed=10.0, dt=0.1, acceleration=0.0):
    t = np.arange(n) * dt
    v = speed + acceleration * t
    return DrivenStates(t, speed * t + 0.5 * acceleration * t**2, np.zeros(n), np.zeros(n), v, np.zeros(n))


@pytest.mark.parametrize(
    "states, limit",
    [
        (straight(acceleration=-12.0, speed=20.0), "acceleration"),
        (straight(acceleration=8.0, speed=20.0), "acceleration"),  # the engine's limit, not the tyres'
        (straight(speed=50.0), "speed"),
        (replace(straight(), x=np.array([0.0, 1.0, 2.05, 3.05, 4.05])), "position"),
        (replace(straight(speed=0.0), orientation=np.array([0.0, 0.0, 0.1, 0.1, 0.1])), "orientation"),
        (replace(straight(), steering=np.full(5, 0.95)), "steering_angle"),
        (
            replace(straight(), steering=0.2 * (np.arange(5) > 1), orientation=0.04 * (np.arange(5) > 1)),
            "steering_rate",
        ),
        (replace(straight(speed=15.0), steering=np.full(5, 0.13)), "friction"),
    ],
)
def test_the_broken_limit_is_named(states, limit):
    report = direct_check(states, 0.1, ESCORT)
    assert not report.ok[1]
    assert report.use[LIMITS.index(limit), 1] > 0.9
    if limit not in ("steering_angle", "friction", "orientation"):  # these displace the vehicle as well
        assert report.limit(1) == limit


def test_undrivable_transitions_are_refused_by_both():
    states = replace(straight(), x=np.array([0.0, 1.0, 2.0, 3.5, 4.5]))
    assert direct_check(states, 0.1, ESCORT).ok.tolist() == [True, True, False, True]
    assert official_check(states, 0.1, ESCORT).ok.tolist() == [True, True, False, True]


def test_not_a_number_is_never_accepted():
    for name in ("x", "y", "steering", "speed", "orientation"):
        values = getattr(straight(), name).copy()
        values[2] = np.nan
        states = replace(straight(), **{name: values})
        assert direct_check(states, 0.1, ESCORT).ok.tolist() == [True, False, False, True], name
        official = official_check(states, 0.1, ESCORT)
        assert official.ok.tolist() == [True, False, False, True], name
        assert "not finite" in official.reasons[1]


def test_integration_agrees_with_the_official_model():
    from commonroad.common.solution import VehicleType
    from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

    rng = np.random.default_rng(5)
    dynamics = VehicleDynamics.KS(VehicleType.FORD_ESCORT)
    for _ in range(30):
        dt = float(rng.choice([0.04, 0.1, 0.25]))
        start = np.array(
            [*rng.uniform(-9, 9, 2), rng.uniform(-0.1, 0.1), rng.uniform(0, 9), rng.uniform(-3, 3)]
        )
        end = dynamics.forward_simulation(start, rng.uniform(-1, 1, 2) * (0.3, 2.0), dt)
        rows = np.array([start, end])
        states = DrivenStates(
            np.array([0.0, dt]),
            rows[:, 0] + ESCORT.rear * np.cos(rows[:, 4]),
            rows[:, 1] + ESCORT.rear * np.sin(rows[:, 4]),
            rows[:, 2], rows[:, 3], rows[:, 4],
        )  # fmt: skip
        assert direct_check(states, dt, ESCORT).use[5:, 0] == pytest.approx(0.0, abs=5e-3)


# -------------------------------------------------------------- official_check


def test_official_check_takes_a_selection():
    states = replace(straight(), x=np.array([0.0, 1.0, 2.0, 3.5, 4.5]))
    report = official_check(states, 0.1, ESCORT, [1, 2])
    assert report.transitions.tolist() == [1, 2]
    assert report.ok.tolist() == [True, False]
    assert set(report.reasons) == {2}


def test_an_exception_in_the_checker_is_a_no_with_its_message(monkeypatch):
    from commonroad_dc.feasibility import feasibility_checker

    def fail(*args, **kwargs):
        raise Exception("wrapped") from ValueError("inner trouble")

    monkeypatch.setattr(feasibility_checker, "state_transition_feasibility", fail)
    report = official_check(straight(3), 0.1, ESCORT)
    assert not report.ok.any()
    assert "inner trouble" in report.reasons[0]


def test_the_solution_file_gives_back_the_very_states():
    from commonroad.common.solution import (
        CommonRoadSolutionReader,
        CommonRoadSolutionWriter,
        CostFunction,
        PlanningProblemSolution,
        Solution,
        VehicleModel,
        VehicleType,
    )
    from commonroad.scenario.scenario import ScenarioID
    from commonroad.scenario.trajectory import Trajectory

    rng = np.random.default_rng(2)
    states = DrivenStates(np.arange(6) * 0.1, *rng.normal(size=(2, 6)) * 1e3, *rng.normal(size=(3, 6)) * 5)
    written = to_ks_states(states, 7)
    solution = Solution(
        ScenarioID.from_benchmark_id("DEU_Test-1_1_T-1", "2020a"),
        [
            PlanningProblemSolution(
                1, VehicleModel.KS, VehicleType.FORD_ESCORT, CostFunction.WX1, Trajectory(7, written)
            )
        ],
    )
    text = CommonRoadSolutionWriter(solution).dump()
    read = CommonRoadSolutionReader.fromstring(text).planning_problem_solutions[0].trajectory.state_list
    for before, after in zip(written, read, strict=True):
        assert after.time_step == before.time_step
        assert (after.position == before.position).all()
        assert (after.steering_angle, after.velocity, after.orientation) == (
            before.steering_angle, before.velocity, before.orientation,
        )  # fmt: skip
    assert all(abs(s.orientation) <= np.pi for s in written)
    assert np.cos([s.orientation for s in written]) == pytest.approx(np.cos(states.orientation))


def test_reversing_retraces_the_forward_drive():
    t = np.arange(121) * 0.025
    forward = drive(*along(lambda s: 0.05, np.full(121, 2.0), t), ESCORT, slip0=0.0)
    path = along(lambda s: 0.05, np.full(121, 2.0), t)
    slip = path[2][-1] - forward.orientation[-1]
    back = drive(t, path[1][::-1], path[2][::-1], -path[3], path[4], ESCORT, slip0=slip)
    assert back.orientation == pytest.approx(forward.orientation[::-1], abs=1e-9)
    assert back.speed == pytest.approx(-forward.speed[::-1], abs=1e-9)
    assert official_check(back.every(4), 0.1, ESCORT).ok.all()
