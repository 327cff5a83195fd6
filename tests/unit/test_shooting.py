"""Direct shooting: what it drives keeps the limits, it knows true shapes, it brakes at the last moment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import toy
from tests.crossings import crossing

import repair
from repair.api import find
from repair.arrays import frozen
from repair.backend.base import SolveStatus
from repair.certify.hull import seam_rows
from repair.certify.recompute import certify
from repair.check.limits import curve_excess, plane_excess
from repair.config import load_config
from repair.curves.base import FrenetTrajectory
from repair.curves.sampled import SampledCurve
from repair.paper.bundled import paper_scenario
from repair.preparation import prepare
from repair.problem.problem import Maneuver
from repair.problem.shapes import Shapes
from repair.problem.taken import begun, taken
from repair.reference.profile import SpeedProfile
from repair.scene.commonroad import load_scene
from repair.scene.frame import FrenetFrame
from repair.scene.traffic.obstacle import Obstacle
from repair.solvers.registry import make_backend
from repair.solvers.shooting.backend import ShootingBackend
from repair.solvers.shooting.curve import curve_along, curve_of
from repair.solvers.shooting.motion import Car, drive_along, drive_freely
from repair.solvers.shooting.plans import ALONG, FREE, Steps
from repair.solvers.shooting.settings import ShootingConfig
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.single_track import drive
from repair.vehicle.transitions import direct_check

VEHICLE = load_vehicle(1)
STEPS = Steps(40, toy.DT)


def bend(radius=60.0, length=200.0):
    """A frame that runs straight, then along an arc."""
    turned = np.linspace(0.0, length / radius, 400)
    arc = np.column_stack((20.0 + radius * np.sin(turned), radius * (1.0 - np.cos(turned))))
    straight = np.column_stack((np.linspace(0.0, 19.5, 40), np.zeros(40)))
    return FrenetFrame.from_points(np.concatenate((straight, arc)))


def standing(x, y, heading, half_length=2.0, half_width=1.0, role="static"):
    """An obstacle that stands, at every step of eight seconds."""
    rows = np.tile([x, y, heading, half_length, half_width], (81, 1))
    states = np.column_stack((rows[:, :3], np.zeros(81)))
    return Obstacle(7, "car", role, np.zeros((81, 4, 2)), rows, None, (), states)


def among(problem, frame, *obstacles, room=0.1):
    """The problem on a frame, with true shapes."""
    s = np.arange(0.0, frame.length, 0.5)
    shapes = Shapes(frame, obstacles, VEHICLE, toy.DT, room)
    return replace(problem, curvature_s=frozen(s), curvature=frozen(frame.curvature(s)), shapes=shapes)


def car_of(problem, slack=0.0):
    return Car(VEHICLE, problem.limits, problem.shapes.frame.curvature, problem.dt, slack, 2)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("v0", [0.5, 8.0, 14.0])
def test_whatever_is_drawn_keeps_the_limits(seed, v0):
    problem = among(toy.problem([], v0=v0), bend())
    rows = FREE.kept(np.random.default_rng(seed).normal(0.0, 1.0, (6, FREE.size)))
    wanted = FREE.accelerations(rows, STEPS, 0.0, -9.0, 9.0)
    start = np.array([0.0, 0.0, v0, 0.0, 0.0])
    tail = FREE.tail(rows, STEPS)
    driven = drive_freely(car_of(problem), start, wanted, FREE.steering(rows, STEPS), tail)
    times = np.arange(STEPS.count * 4 + 1) * toy.DT / 4
    limits = toy.LIMITS
    for k in range(len(rows)):
        if np.abs(driven.l[k]).max() > 6.0:
            continue  # nobody's road; there the splines of the axis tell
        curve = curve_of(problem, driven.take(np.array([k])), car_of(problem))
        assert not curve_excess(curve, 0.0, 4.0, limits, 0.0)
        # Runge-Kutta and quintics follow the bends of the axis to some thousandths.
        frame = problem.shapes.frame
        assert not plane_excess(curve, curve.sample(times), frame, limits, VEHICLE, 5e-3)


def test_what_is_driven_is_what_the_vehicle_drives():
    """The states along the curve are those of the KS model with the controls held over each step."""
    problem = among(toy.problem([]), bend())
    rows = FREE.kept(np.random.default_rng(1).normal(0.0, 0.6, (8, FREE.size)))
    start = np.array([0.0, 0.0, 10.0, 0.0, 0.0])
    wanted = FREE.accelerations(rows, STEPS, 0.0, -6.0, 4.0)
    driven = drive_freely(car_of(problem), start, wanted, FREE.steering(rows, STEPS), FREE.tail(rows, STEPS))
    for k in range(len(rows)):
        curve = curve_of(problem, driven.take(np.array([k])), car_of(problem))
        path = problem.shapes.frame.cartesian(curve.sample(np.arange(0.0, 4.0 - 1e-9, toy.DT / 20)))
        states = drive(path.t, path.xy, path.heading, path.speed, path.distance, VEHICLE, slip0=0.0)
        report = direct_check(states.every(20), toy.DT, VEHICLE)
        moving = states.every(20).speed[:-1] > 0.5
        assert report.use[5:, moving].max() <= 0.5  # position and orientation, of the tolerances


def test_along_the_path_it_stays_on_the_path():
    problem = among(toy.problem([], lateral=False), bend())
    wanted = ALONG.accelerations(np.full((1, ALONG.size), -0.5), STEPS, 0.0, -8.0, 4.0)
    driven = drive_along(car_of(problem), np.array([0.0, 0.0, 10.0, 0.0, 0.0]), wanted)
    curve = curve_along(problem, driven, car_of(problem))
    samples = curve.sample(np.linspace(0.0, 4.0, 81))
    assert np.abs(samples.position[:, 1]).max() == 0.0
    assert samples.acceleration[0, 0] == pytest.approx(-4.0)
    assert samples.velocity[-1, 0] == pytest.approx(0.0, abs=1e-9)


def test_full_braking_may_begin_at_the_last_moment():
    """10 m/s and 8 m/s²: 6.25 m, and no more than what a step and the last metre's rounding cost."""
    backend = ShootingBackend()

    def solved(distance):
        boxes = [toy.box((distance, distance + 10.0), (-2.0, 2.0))]
        problem = toy.problem(boxes, bounds=toy.NARROW, lateral=False, margin=0.0)
        return backend.solve(problem).status is SolveStatus.SOLVED

    assert not solved(6.2)
    assert solved(6.4)


def test_true_shapes_are_passed_where_their_boxes_are_shut():
    """A lorry across the road at an angle: its box in (s, l) fills the road, its shape leaves a lane."""
    frame = FrenetFrame.from_points(np.column_stack((np.linspace(0.0, 300.0, 301), np.zeros(301))))
    lorry = standing(30.0, -4.5, 0.5, 6.0, 1.0)
    shut = toy.problem([toy.box((20.0, 40.0), (-9.0, 4.0))], v0=20.0)
    free = among(shut, frame, lorry)
    assert ShootingBackend().solve(shut).status is SolveStatus.INFEASIBLE
    found = ShootingBackend().solve(free)
    assert found.status is SolveStatus.SOLVED, found.detail
    assert found.curve.sample([4.0]).position[0, 0] > 25.0


@pytest.mark.parametrize(
    "t_rep, dt, lead, each, straight",
    [
        (0.3, 0.1, 0, 1, 0),
        (0.3, 0.25, 4, 5, 4),
        (0.1, 0.04, 1, 2, 1),
        (0.0, 0.25, 0, 1, 1),
        (0.1, 0.3, 2, 3, 2),
        (0.3, 0.01, 0, 1, 0),
        (0.0, 0.03, 0, 1, 1),
    ],
)
def test_controls_change_at_the_scenarios_steps_only(t_rep, dt, lead, each, straight):
    """A transition with two accelerations is none that the drivability checker knows."""
    steps = Steps.between(t_rep, 3.0, dt)
    assert (steps.lead, steps.each, steps.straight) == (lead, each, straight)
    rows = FREE.kept(np.random.default_rng(0).normal(0.0, 1.0, (5, FREE.size)))
    wanted = FREE.accelerations(rows, steps, 0.7, -9.0, 9.0)
    assert (wanted[:, :lead] == 0.7).all()
    begins = t_rep + steps.dt * np.arange(1, steps.count)
    changes = (np.diff(wanted, axis=1) != 0.0).any(axis=0)
    assert changes.any()
    place = begins[changes] / dt
    np.testing.assert_allclose(place, np.rint(place), atol=1e-6)
    assert (FREE.steering(rows, steps)[:, :straight] == 0.0).all()
    assert (FREE.tail(rows, steps).step >= straight).all()


@pytest.mark.parametrize("dt, expected", [(0.1, 0.1), (0.04, 0.04), (0.03, 0.03), (0.01, 0.04), (1e-3, 0.04)])
def test_short_steps_of_a_scenario_are_driven_together(dt, expected):
    """What a search costs does not grow with the scenario's resolution, where t_rep is one of its steps."""
    steps = Steps.between(1.2, 3.9, dt)
    assert steps.dt == pytest.approx(expected)
    assert steps.count == np.ceil(2.7 / expected - 1e-6)


def test_short_steps_are_not_joined_to_such_as_lose_what_there_is(tmp_path):
    """Steps of 0.1 s find nothing here, whatever the seed: the gap is a matter of hundredths of a second."""
    file = tmp_path / "ZAM_Test-1_1_T-1.xml"
    file.write_text(crossing(198).text, encoding="utf-8")
    keys = ["repair.lateral=road", "checker.clearance=0.3"]
    config = load_config(overrides=keys, backend="shooting")
    found = find(prepare(load_scene(file, config), config), make_backend("shooting", config), visits=(0.0,))
    assert found.f_ttr == 0.0


def test_what_comes_closest_is_handed_over():
    problem = toy.problem([toy.box((5.0, 15.0), (-2.0, 2.0))], bounds=toy.NARROW, lateral=False, margin=0.0)
    found = ShootingBackend().solve(problem)
    assert found.status is SolveStatus.INFEASIBLE
    assert found.closest.miss == pytest.approx(1.25, abs=0.1)


def test_the_seed_decides_and_nothing_else():
    problem = toy.problem([toy.box((12.0, 18.0), (-9.0, 1.7))], t_end=3.0, v0=16.0)
    config = ShootingConfig(population=32, iterations=8)
    first, again = (ShootingBackend(config).solve(problem) for _ in range(2))
    other = ShootingBackend(replace(config, seed=1)).solve(problem)
    points = [x.curve.points if x.curve else x.closest.curve.points for x in (first, again, other)]
    np.testing.assert_array_equal(points[0], points[1])
    assert first.iterations > 2, "nothing was drawn"
    assert not np.array_equal(points[0], points[2])


@pytest.mark.thinned(3)
@pytest.mark.parametrize("seed", range(20))
def test_a_start_with_another_acceleration_keeps_the_limits(seed):
    random, limits = np.random.default_rng(seed), toy.LIMITS
    start = np.array([[5.0, 0.0], [12.0, 0.1], [0.3, -0.2]])
    wanted, kappa = random.normal(0.0, 10.0, 2), float(random.uniform(-0.02, 0.02))
    made = begun(start, wanted, kappa, limits, True)
    np.testing.assert_array_equal(made[:2], start[:2])
    along, across = made[2, 0], made[2, 1] + kappa * 144.0
    assert limits.a_min <= along <= limits.a_max
    assert abs(across) <= limits.a_lat
    assert np.hypot(along, across) <= limits.a_total
    kept = begun(start, np.array([-1.0, 0.5]), 0.0, limits, True)
    np.testing.assert_allclose(kept[2], [-1.0, 0.5])
    assert begun(start, wanted, kappa, limits, False)[2, 1] == -0.2


def test_what_a_curve_does_is_told_by_where_it_leads():
    def shifted(along, aside):
        ends = frozen([[0.0, 0.0], [40.0 + along, aside]])
        speed = frozen([[10.0, 0.0], [10.0, 0.0]])
        still = frozen(np.zeros((2, 2)))
        return SampledCurve(FrenetTrajectory(frozen([0.0, 4.0]), ends, speed, still, still))

    problem = toy.problem([])
    assert taken(problem, shifted(0.0, 1.0)) is Maneuver.LEFT
    assert taken(problem, shifted(3.0, -1.0)) is Maneuver.RIGHT
    assert taken(problem, shifted(3.0, 0.1)) is Maneuver.GO_AHEAD
    assert taken(problem, shifted(-3.0, 0.1)) is Maneuver.YIELD


def test_a_jump_at_the_seam_is_a_claim_up_to_what_the_result_says():
    reference, stop = toy.constant(10.0), SpeedProfile.from_accelerations(0.0, 10.0, [1.0, 20.0], [-8.0, 0.0])
    said = {row.name: row for row in seam_rows(reference, stop, 0.0, jumps=False, jump=8.0)}
    assert all(row.ok and row.claim for row in said.values())
    unsaid = {row.name: row for row in seam_rows(reference, stop, 0.0, jumps=False)}
    assert not unsaid["jump in acceleration at the seam"].ok
    told = {row.name: row for row in seam_rows(reference, stop, 0.0, jumps=True)}
    assert not told["jump in acceleration at the seam"].claim


def test_sets_hold_on_both_sides_of_their_step():
    rows = np.tile([0.0, 0.0, 0.0, 1.0, 1.0], (5, 1))
    rows[:, 0] = np.arange(5.0)
    rows[3:] = np.nan
    obstacle = replace(standing(0.0, 0.0, 0.0), rectangles=rows, vertices=np.zeros((5, 4, 2)))
    frame = bend()
    moving = Shapes(frame, [obstacle], VEHICLE, 1.0).at(np.array([0.0, 0.5, 2.0, 2.5, 9.0]))
    assert np.nanmax(moving[:, 1, 0]) == np.nanmin(moving[:, 1, 0]) == 0.5
    assert np.nanmax(moving[:, 2, 0]) == 2.0
    assert np.isnan(moving[:, 3:, 0]).all()
    held = Shapes(frame, [replace(obstacle, role="set_based")], VEHICLE, 1.0).at(np.array([0.5, 2.5]))
    assert set(held[np.isfinite(held[:, 0, 0]), 0, 0]) == {0.0, 1.0}
    assert set(held[np.isfinite(held[:, 1, 0]), 1, 0]) == {2.0}


@pytest.mark.thinned(2)
def test_it_is_asked_once_for_each_t_rep_and_its_results_are_certified(tmp_path, scenario_1):
    result = scenario_1
    assert result.f_ttr is not None
    assert result.capabilities.own_way
    assert all(len(probe.tried) == 1 for probe in result.search.probes)
    result.save(tmp_path, figure=False)
    certificate = certify(tmp_path)
    assert [row.name for row in certificate.rows if row.claim and not row.ok] == []
    again = find(result.prepared, ShootingBackend())
    assert again.f_ttr == result.f_ttr


@pytest.fixture(scope="module")
def scenario_1():
    config = load_config(backend="shooting", overrides=["search.delta_t=0.2"])
    with paper_scenario("scenario_1") as path:
        return repair.repair(path, config)


def test_a_search_that_comes_no_closer_ends():
    """A wall that is too close: braking fully is the best there is, from the first iteration on."""
    frame = FrenetFrame.from_points(np.column_stack((np.linspace(-20.0, 200.0, 400), np.zeros(400))))
    blocked = among(toy.problem((), t_rep=0.0, t_end=4.0), frame, standing(-12.5, 0.0, 0.0, half_width=30.0))
    counts = {}
    for patience in (1, 3, 14):
        solve = ShootingBackend(ShootingConfig(patience=patience)).solve(blocked)
        assert solve.status is SolveStatus.INFEASIBLE
        counts[patience] = solve.iterations
    assert counts[1] <= counts[3] <= counts[14] < 0.5 * ShootingConfig().iterations


def test_more_elites_than_trajectories_are_refused():
    with pytest.raises(repair.RepairError, match=r"elite 12 are the best of shooting\.population 8"):
        make_backend("shooting", load_config(backend="shooting", overrides=["shooting.population=8"]))
