"""The reference trajectory: planner, blind profiles, solution files, recorded obstacles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from tests import toy

from repair.arrays import frozen
from repair.errors import ReferenceTrajectoryError, RepairError
from repair.reference.profile import SpeedProfile
from repair.reference.registry import make_reference
from repair.reference.settings import ReferenceConfig
from repair.scene.commonroad import load_scene
from repair.vehicle.commonroad_ks import official_check
from repair.vehicle.single_track import drive
from repair.vehicle.transitions import direct_check
from repair.world.occupancy import first_entry

SCENARIO_1 = "DEU_Flensburg-6_1_T-1"
SOME = (SCENARIO_1, "ZAM_Tjunction-1_84_T-1", "DEU_Lohmar-21_1_T-1", "ZAM_Zip-1_19_T-1", "USA_Peach-3_4_T-1")
NOBODY = toy.occupancy(duration=10.0)


@cache
def loaded(path):
    return load_scene(path)


def scene_named(folder, name):
    path = folder / f"{name}.xml"
    if not path.exists():
        pytest.skip(f"{path.name} is not in COMMONROAD_SCENARIOS")
    return loaded(path)


@pytest.fixture
def scene(scenarios):
    """Scenario 1: a left turn behind a car."""
    return scene_named(scenarios, SCENARIO_1)


def driven(scene, reference):
    """States at the scenario's steps along the reference."""
    substeps = 4
    t = np.arange(scene.n_steps * substeps + 1) * scene.dt / substeps
    path = scene.frame.cartesian(reference.sample(t[t <= reference.t_end + 1e-9]))
    return drive(path.t, path.xy, path.heading, path.speed, path.distance, scene.vehicle).every(substeps)


# -- profiles ----------------------------------------------------------------------------------------


def test_profile_is_the_integral_of_its_accelerations():
    profile = SpeedProfile.from_accelerations(3.0, 8.0, [1.0, 2.5, 1.5], [-2.0, 0.5, 1.0])
    t = np.linspace(0.0, 5.0, 20_001)
    sampled = profile.sample(t)
    v = 8.0 + cumulative_trapezoid(sampled.acceleration[:, 0], t, initial=0.0)
    np.testing.assert_allclose(sampled.velocity[:, 0], v, atol=1e-3)
    np.testing.assert_allclose(
        sampled.position[:, 0], 3.0 + cumulative_trapezoid(v, t, initial=0.0), atol=2e-3
    )
    assert not sampled.position[:, 1].any()
    assert profile.t_end == 5.0


def test_profile_holds_its_speed_beyond_its_end():
    profile = SpeedProfile.from_accelerations(0.0, 10.0, [2.0], [-1.0])
    later = profile.sample([2.0, 3.0])
    np.testing.assert_allclose(later.velocity[:, 0], 8.0)
    np.testing.assert_allclose(np.diff(later.position[:, 0]), 8.0)
    assert later.acceleration[-1, 0] == 0.0


def test_constant_keeps_the_initial_speed(scene):
    reference = make_reference(scene, ReferenceConfig(source="constant"), NOBODY)
    sampled = reference.sample(scene.times)
    np.testing.assert_allclose(sampled.velocity, np.tile(scene.start[1], (len(scene.times), 1)), atol=1e-9)
    np.testing.assert_allclose(sampled.position[0], scene.start[0])
    assert reference.t_end == pytest.approx(scene.horizon)


def test_accelerate_stops_accelerating_at_its_target(scene):
    for speed in (3.0, 13.5, 20.0):
        fast = replace(scene, start=frozen([scene.start[0], [speed, 0.0], [0.0, 0.0]]), speed_limit=None)
        v = (
            make_reference(fast, ReferenceConfig(source="accelerate"), NOBODY)
            .sample(scene.times)
            .velocity[:, 0]
        )
        assert v[0] == pytest.approx(speed)
        assert v[-1] == pytest.approx(min(max(speed, 13.9), speed + scene.horizon))
        assert np.diff(v).max() <= scene.dt + 1e-9
        assert (np.diff(v) >= -1e-9).all()


# -- planner -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SOME)
def test_planned_reference_starts_with_the_ego_and_is_drivable(scenarios, name):
    scene = scene_named(scenarios, name)
    reference = make_reference(scene, ReferenceConfig(), NOBODY)
    start = reference.sample(0.0)
    np.testing.assert_allclose(start.position[0], scene.start[0], atol=1e-6)
    np.testing.assert_allclose(start.velocity[0, 0], scene.start[1, 0], atol=1e-6)
    np.testing.assert_allclose(start.acceleration[0, 0], scene.start[2, 0], atol=1e-6)
    assert reference.t_end >= scene.horizon - 1e-9
    states = driven(scene, reference)
    left = np.flatnonzero(~direct_check(states, scene.dt, scene.vehicle).ok)
    assert official_check(states, scene.dt, scene.vehicle, left).ok.all()


@pytest.mark.thinned(4)
@pytest.mark.parametrize("name", SOME)
@pytest.mark.parametrize("a_lat", [0.6, 1.2, 2.0])
def test_planned_reference_respects_comfort(scenarios, name, a_lat):
    scene = scene_named(scenarios, name)
    config = ReferenceConfig(a_lat=a_lat)
    sampled = make_reference(scene, config, NOBODY).sample(np.arange(0.0, scene.horizon, 0.02))
    v, a = sampled.velocity[:, 0], sampled.acceleration[:, 0]
    assert v.min() >= -0.05
    # Smoothing the steps of the acceleration overshoots them by up to a half. How hard the ego
    # itself accelerates at the start is not the planner's doing.
    later = sampled.t > 1.0
    assert a[later].min() >= 1.6 * config.a_min
    assert a[later].max() <= 1.6 * config.a_max
    lateral = v**2 * np.abs(scene.frame.curvature(sampled.position[:, 0]))
    # Where the ego comes in too fast, it has to be given the time to slow down.
    needed = np.maximum(
        v[0] - np.sqrt(a_lat / np.abs(scene.frame.curvature(sampled.position[:, 0])).clip(1e-9)), 0.0
    )
    attainable = sampled.t > needed / -config.a_min + 1.0
    assert lateral[attainable].max() <= 1.25 * a_lat + 0.1


def test_planned_reference_keeps_to_the_speed_limit_and_makes_progress(scene):
    config = ReferenceConfig()
    v = make_reference(scene, config, NOBODY).sample(scene.times).velocity[:, 0]
    assert v.mean() > 2.0
    slow = (
        make_reference(scene, ReferenceConfig(desired_speed=2.0), NOBODY).sample(scene.times).velocity[:, 0]
    )
    assert slow[-1] < v.max()


def test_planner_is_deterministic(scene):
    first, second = (make_reference(scene, ReferenceConfig(), NOBODY) for _ in range(2))
    np.testing.assert_array_equal(first.points, second.points)


def test_planner_can_start_from_standstill(scene):
    standing = replace(scene, start=frozen([scene.start[0], [0.0, 0.0], [0.0, 0.0]]))
    sampled = make_reference(standing, ReferenceConfig(), NOBODY).sample(scene.times)
    assert sampled.velocity[:, 0].min() > -0.1
    assert sampled.position[-1, 0] > scene.start[0, 0] + 5.0


def slow_lead(scene, gap=15.0, speed=0.5):
    s0 = float(scene.start[0, 0])
    return toy.occupancy(
        toy.box((s0 + gap, s0 + gap + 6.0), (-1.5, 1.5), v=(speed, 0.0)), duration=scene.horizon, dt=scene.dt
    )


@pytest.mark.parametrize("v, a", [(0.0, 0.0), (0.0, -1.0), (0.3, -2.0), (0.05, -0.5)])
def test_who_stands_and_is_said_to_brake_does_not_roll_back(scene, v, a):
    braking = replace(scene, start=frozen([scene.start[0], [v, 0.0], [a, 0.0]]))
    curve = make_reference(braking, ReferenceConfig(), NOBODY)
    speeds = curve.sample(np.arange(0.0, scene.horizon, 1e-3)).velocity[:, 0]
    assert speeds.min() >= -1e-6
    assert speeds[-1] > 2.0  # and it goes on


def test_aware_planner_avoids_a_slow_lead_and_the_blind_one_does_not(scene):
    boxes = slow_lead(scene)
    blind = make_reference(scene, ReferenceConfig(), boxes)
    aware = make_reference(scene, ReferenceConfig(awareness="constant_velocity"), boxes)
    assert first_entry(boxes, blind.sample(scene.times)) is not None
    assert first_entry(boxes, aware.sample(scene.times)) is None
    assert aware.sample(scene.times).position[-1, 0] > scene.start[0, 0] + 8.0  # it does not just stand


def test_aware_planner_looks_at_the_start_only(scene):
    boxes = slow_lead(scene)
    stopping = boxes.lower.copy(), boxes.upper.copy()
    for corner in stopping:
        corner[:, 5:] = corner[:, 5:6]  # stops half a second later, which nobody can know at t = 0
    later = replace(boxes, lower=frozen(stopping[0]), upper=frozen(stopping[1]))
    config = ReferenceConfig(awareness="constant_velocity")
    np.testing.assert_array_equal(
        make_reference(scene, config, boxes).points, make_reference(scene, config, later).points
    )


def test_no_way_at_all_is_a_sentence(scene):
    s0 = float(scene.start[0, 0])
    wall = toy.occupancy(toy.box((s0 + 0.5, s0 + 50.0), (-5.0, 5.0)), duration=scene.horizon)
    with pytest.raises(ReferenceTrajectoryError, match=r"DEU_Flensburg-6_1_T-1.*awareness"):
        make_reference(scene, ReferenceConfig(awareness="constant_velocity"), wall)


# -- solution files ----------------------------------------------------------------------------------


def write_solution(folder, scene, states, *, first=None, scenario_id=None, problem=None):
    """A KS solution with these driven states, written by commonroad-io."""
    from commonroad.common.solution import (
        CommonRoadSolutionWriter,
        CostFunction,
        PlanningProblemSolution,
        Solution,
        VehicleModel,
        VehicleType,
    )
    from commonroad.scenario.scenario import ScenarioID
    from commonroad.scenario.trajectory import Trajectory

    from repair.vehicle.commonroad_ks import to_ks_states

    first = scene.initial_time_step if first is None else first
    solution = PlanningProblemSolution(
        problem or scene.planning_problem_id,
        VehicleModel.KS,
        VehicleType(scene.vehicle.type_id),
        CostFunction.JB1,
        Trajectory(first, to_ks_states(states, first)),
    )
    named = (
        scene.scenario.scenario_id
        if scenario_id is None
        else ScenarioID.from_benchmark_id(scenario_id, "2020a")
    )
    path = folder / "solution.xml"
    path.write_text(CommonRoadSolutionWriter(Solution(named, [solution])).dump(), encoding="utf-8")
    return path


def test_solution_file_round_trip(scene, tmp_path):
    planned = make_reference(scene, ReferenceConfig(), NOBODY)
    path = write_solution(tmp_path, scene, driven(scene, planned))
    read = make_reference(scene, ReferenceConfig(source="file", file=str(path)), NOBODY)
    assert read.t_end >= scene.horizon - 1e-9
    a, b = planned.sample(scene.times), read.sample(scene.times)
    np.testing.assert_allclose(a.position, b.position, atol=0.05)
    np.testing.assert_allclose(a.velocity, b.velocity, atol=0.1)
    assert direct_check(driven(scene, read), scene.dt, scene.vehicle).ok.mean() > 0.95


def test_short_solution_is_a_short_reference(scene, tmp_path):
    states = driven(scene, make_reference(scene, ReferenceConfig(), NOBODY))
    short = replace(
        states, **{f: getattr(states, f)[:21] for f in ("t", "x", "y", "steering", "speed", "orientation")}
    )
    path = write_solution(tmp_path, scene, short)
    read = make_reference(scene, ReferenceConfig(source="file", file=str(path)), NOBODY)
    assert 20 * scene.dt - 1e-9 <= read.t_end <= 20 * scene.dt + 0.4


def test_solution_that_ends_at_once_is_refused(scene, tmp_path):
    states = driven(scene, make_reference(scene, ReferenceConfig(), NOBODY))
    short = replace(
        states, **{f: getattr(states, f)[:3] for f in ("t", "x", "y", "steering", "speed", "orientation")}
    )
    path = write_solution(tmp_path, scene, short)
    with pytest.raises(ReferenceTrajectoryError, match="3 steps"):
        make_reference(scene, ReferenceConfig(source="file", file=str(path)), NOBODY)


@pytest.mark.parametrize(
    "keys, message",
    [
        ({"scenario_id": "ZAM_Zip-1_19_T-1"}, "ZAM_Zip"),
        ({"problem": 987654}, "planning problem"),
        ({"first": 3}, "initial time step"),
    ],
)
def test_solution_of_something_else_is_refused(scene, tmp_path, keys, message):
    path = write_solution(
        tmp_path, scene, driven(scene, make_reference(scene, ReferenceConfig(), NOBODY)), **keys
    )
    with pytest.raises(ReferenceTrajectoryError, match=message):
        make_reference(scene, ReferenceConfig(source="file", file=str(path)), NOBODY)


def test_solution_elsewhere_is_refused(scene, tmp_path):
    states = driven(scene, make_reference(scene, ReferenceConfig(), NOBODY))
    path = write_solution(tmp_path, scene, replace(states, x=states.x + 5000.0))
    with pytest.raises(ReferenceTrajectoryError, match="5000 m from the ego's initial position"):
        make_reference(scene, ReferenceConfig(source="file", file=str(path)), NOBODY)


@pytest.mark.parametrize(
    "content, message",
    [
        ("", "solution file other.xml is empty"),
        ("no xml", "solution file other.xml is not XML: "),
        ("<commonRoad/>", "not a CommonRoad solution"),
        ("<CommonRoadSolution benchmark_id='x'/>", "not a CommonRoad solution"),
    ],
)
def test_what_is_no_solution_file_is_refused(scene, tmp_path, content, message):
    path = tmp_path / "other.xml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(ReferenceTrajectoryError, match=message) as raised:
        make_reference(scene, ReferenceConfig(source="file", file=str(path)), NOBODY)
    assert isinstance(raised.value, RepairError)
    assert "\n" not in str(raised.value)


def test_missing_files_are_named(scene, tmp_path):
    with pytest.raises(ReferenceTrajectoryError, match=r"solution file .*no\.xml: no such file"):
        make_reference(scene, ReferenceConfig(source="file", file=str(tmp_path / "no.xml")), NOBODY)
    with pytest.raises(ReferenceTrajectoryError, match=r"reference\.file"):
        make_reference(scene, ReferenceConfig(source="file"), NOBODY)


# -- recorded ----------------------------------------------------------------------------------------


def test_unknown_recorded_obstacle_is_named(scene):
    with pytest.raises(ReferenceTrajectoryError, match="424242"):
        make_reference(scene, ReferenceConfig(source="recorded", obstacle_id=424242), NOBODY)


def test_those_that_could_be_meant_are_listed(scene):
    """By their distance at the start; every one of them can be taken."""
    with pytest.raises(ReferenceTrajectoryError, match=r"from near to far: 36, 337, ") as caught:
        make_reference(scene, ReferenceConfig(source="recorded", obstacle_id=424242), NOBODY)
    listed = str(caught.value).partition("near to far: ")[2].partition(" and ")[0].rstrip(")").split(", ")
    at = [next(o for o in scene.obstacles if o.id == int(name)).states[0, :2] for name in listed]
    ego = scene.initial_state
    apart = [float(np.hypot(x - ego.x, y - ego.y)) for x, y in at]
    assert apart == sorted(apart)


def test_without_a_recorded_ego_the_key_is_named(scene):
    with pytest.raises(ReferenceTrajectoryError, match=r"reference\.obstacle_id"):
        make_reference(replace(scene, recorded_ego=None), ReferenceConfig(source="recorded"), NOBODY)
