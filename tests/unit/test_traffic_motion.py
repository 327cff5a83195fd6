"""Traffic that moves as it is stated: trailers, occupancies over intervals, off-centre bodies, pauses."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from tests import roads

from repair.config.schema import Config
from repair.errors import ScenarioError
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.scene.traffic.obstacles import obstacles_of
from repair.scene.traffic.shapes import enclosing, place, polygons_of
from repair.scene.traffic.stepwise import holds_over_intervals

EGO = roads.problem(start=roads.state(5.0, 0.0, v=10.0))


def scene_of(tmp_path, obstacles, **keys):
    path = tmp_path / "scenario.xml"
    path.write_text(roads.scenario(obstacles=obstacles, problems=EGO), encoding="utf-8")
    return load_scene(path, **keys)


def constant(scene):
    config = Config()
    config.reference.source = "constant"
    return prepare(scene, config)


def rectangle(length, width, x=None, y=None):
    centre = "" if x is None else f"<orientation>0.0</orientation><center><x>{x}</x><y>{y}</y></center>"
    return f"<rectangle><length>{length}</length><width>{width}</width>{centre}</rectangle>"


# -- trailers ----------------------------------------------------------------------------------------


def truck(poses, hitches, *, wheelbases=(4.0, 10.0), speed=0.0):
    """A tractor of 4 m and a trailer of 10 m; a pose and a hitch angle for each step from 0 on."""
    made = []
    for k, ((x, y, heading), hitch) in enumerate(zip(poses, hitches, strict=True)):
        text = roads.state(x, y, k=k, heading=heading, v=speed, tag="state", leave=("acceleration",))
        angle = "" if hitch is None else roads.exact("hitchAngle", hitch)
        made.append(text.replace("</state>", f"{roads.exact('steeringAngle', 0.0)}{angle}</state>"))
    lengths = "".join(f"<wheelbase>{value}</wheelbase>" for value in wheelbases)
    shape = rectangle(4.0, 2.0) + rectangle(10.0, 2.0)
    x, y, heading = poses[0]
    start = roads.state(x, y, heading=heading, v=speed)
    lengths = f"<wheelbase>{lengths}</wheelbase>" if wheelbases else ""
    text = roads.car(71, start, f"<trajectory>{''.join(made[1:])}</trajectory>", shape=shape)
    return text.replace("</shape>", f"</shape>{lengths}", 1)


def centres(obstacle, step):
    return [np.mean(part, axis=0) for part in obstacle.polygons[step]]


def test_a_trailer_across_the_road_is_a_conflict(tmp_path):
    poses = [(30.0, 9.5, 1.5707)] * 41  # the tractor has left the road, its trailer has not
    scene = scene_of(tmp_path, truck(poses, [0.0] * 41))
    assert any("trailer" in note for note in scene.notes)
    conflict = constant(scene).conflict
    assert conflict.contact_id == 71
    assert conflict.contact_time == pytest.approx(
        (30.0 - 1.0 - 0.5 * scene.vehicle.length - 5.0) / 10.0, abs=0.11
    )


def test_a_trailer_is_where_commonroads_own_function_puts_it(tmp_path):
    from commonroad.geometry.shape import shape_group_occupancy_shape_from_state

    poses = [(60.0 + k, 0.3 * k, 0.05 * k) for k in range(41)]
    scene = scene_of(tmp_path, truck(poses, [-0.02 * k for k in range(41)]))
    source = scene.obstacles[0].source
    for state in source.prediction.trajectory.state_list:
        theirs = shape_group_occupancy_shape_from_state(source.obstacle_shape.shapes, state, [4.0, 10.0])
        ours = shapely.union_all([shapely.Polygon(p) for p in scene.obstacles[0].polygons[state.time_step]])
        expected = shapely.union_all([part.shapely_object for part in theirs.shapes])
        assert ours.symmetric_difference(expected).area < 1e-6


@pytest.mark.parametrize(
    "known", [False, True]
)  # without: from the start on; with: back to the initial state
def test_a_trailer_without_hitch_angles_is_dragged(tmp_path, known):
    """Against the equation of CommonRoad's one-track model with trailer, integrated finely."""
    radius, speed, length, dt, fine = 15.0, 5.0, 10.0, 0.1, 200
    rear = np.zeros(3)  # of the tractor's rear axle, and the hitch angle
    alpha, poses, hitches = 0.0, [], []
    for k in range(41 * fine):
        if k % fine == 0:
            c, s = np.cos(rear[2]), np.sin(rear[2])
            poses.append((100.0 + rear[0] + 2.0 * c, 30.0 + rear[1] + 2.0 * s, rear[2]))
            hitches.append(alpha)
        rear += dt / fine * speed * np.array([np.cos(rear[2]), np.sin(rear[2]), 1.0 / radius])
        alpha -= dt / fine * speed * (np.sin(alpha) / length + 1.0 / radius)
    text = truck(poses, hitches if known else [None] * 41, speed=speed)
    made = scene_of(tmp_path, text).obstacles[0]
    for k, ((x, y, psi), hitch) in enumerate(zip(poses, hitches, strict=True)):
        turned = psi + hitch
        hitch_at = np.array([x, y]) - 2.0 * np.array([np.cos(psi), np.sin(psi)])
        expected = hitch_at - 5.0 * np.array([np.cos(turned), np.sin(turned)])
        np.testing.assert_allclose(centres(made, k)[1], expected, atol=0.1)
        assert len(made.polygons[k]) == 2


def test_a_trailer_without_wheelbases_is_as_long_as_its_body(tmp_path):
    poses = [(60.0, 0.0, 0.0)] * 41
    with_, without = (
        scene_of(tmp_path, truck(poses, [0.1] * 41, wheelbases=w)).obstacles[0] for w in ((4.0, 10.0), ())
    )
    np.testing.assert_allclose(centres(with_, 5), centres(without, 5))


def test_wheelbases_of_another_number_of_bodies_are_refused(tmp_path):
    with pytest.raises(ScenarioError, match="obstacle 71: it has 3 wheelbases for 2 bodies"):
        scene_of(tmp_path, truck([(60.0, 0.0, 0.0)] * 41, [0.0] * 41, wheelbases=(4.0, 10.0, 2.0)))


# -- occupancies over intervals ----------------------------------------------------------------------


def sets(*rows, name=70):
    """A set-based prediction of boxes of 1 m: rows (first step, last step, x, y)."""
    parts = "".join(
        f"<occupancy><shape>{rectangle(1, 1, x, y)}</shape><time><intervalStart>{low}</intervalStart>"
        f"<intervalEnd>{high}</intervalEnd></time></occupancy>"
        for low, high, x, y in rows
    )
    start = roads.state(*rows[0][2:], v=0.0)
    return roads.car(name, start, f"<occupancySet>{parts}</occupancySet>", shape=rectangle(1, 1))


def collides(scene, prepared):
    """CommonRoad's own collision check of the reference, in a scenario."""
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import TrajectoryPrediction
    from commonroad.scenario.trajectory import Trajectory
    from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import (
        create_collision_checker,
        create_collision_object,
    )

    from repair.vehicle.commonroad_ks import to_ks_states

    checker = prepared.checker
    driven = checker.drive(prepared.reference, prepared.t_reference)
    states = to_ks_states(driven.every(round(len(driven) / (prepared.t_reference / scene.dt))), 0)
    shape = Rectangle(scene.vehicle.length, scene.vehicle.width)
    ego = create_collision_object(TrajectoryPrediction(Trajectory(0, states), shape))
    return [bool(create_collision_checker(s).collide(ego)) for s in (scene.scenario, scene.official())]


def test_intervals_hold_at_every_step_of_theirs_and_the_official_check_is_asked_so(tmp_path):
    scene = scene_of(tmp_path, sets((1, 10, 150.0, 4.0), (11, 30, 8.0, 0.0)))
    assert sum("occupancies over intervals" in note for note in scene.notes) == 1
    assert "obstacle 70" in " ".join(scene.notes)
    prepared = constant(scene)
    assert prepared.conflict.time == np.inf  # the ego has passed 8 m when the set comes there
    # As it stands it counts the second set at step 2; asked step by step it agrees.
    assert collides(scene, prepared) == [True, False]
    assert any(holds_over_intervals(o) for o in scene.scenario.dynamic_obstacles)  # a copy was asked about
    assert not any(holds_over_intervals(o) for o in scene.official().dynamic_obstacles)


def test_an_interval_that_the_ego_drives_into_late_is_a_conflict(tmp_path):
    scene = scene_of(tmp_path, sets((1, 30, 30.0, 0.0)))
    prepared = constant(scene)
    assert prepared.conflict.contact_id == 70
    assert prepared.conflict.contact_time == pytest.approx(2.0, abs=0.3)
    assert collides(scene, prepared) == [False, True]


# -- bodies --------------------------------------------------------------------------------------------


@given(
    st.tuples(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0)),
    st.floats(-4.0, 4.0),
    st.floats(0.0, 3.5),
    st.sampled_from(["rectangle", "polygon", "circle", "group"]),
    st.integers(0, 1000),
)
def test_an_uncertain_body_is_enclosed_wherever_it_is(centre, heading, spread, kind, seed):
    from commonroad.geometry.shape import Circle, Polygon, Rectangle, ShapeGroup

    rng = np.random.default_rng(seed)
    middle = np.array(centre)
    corners = np.array([[2.0, 0.5], [2.5, -0.4], [-1.0, -0.9], [-2.0, 0.8]])
    shape = {
        "rectangle": Rectangle(4.6, 1.8, middle, 0.2),
        "polygon": Polygon(corners + middle),
        "circle": Circle(0.8, middle),
        "group": ShapeGroup([Rectangle(2.0, 1.0, middle), Circle(0.5, -middle)]),
    }[kind]
    area = Rectangle(2.0, 1.0, np.array([20.0, 5.0]), 0.4)
    made = enclosing(shape, area, heading - spread, heading + spread, 5.0)
    x, y, turned, half_length, half_width = made.rectangle
    c, s = np.cos(turned), np.sin(turned)
    for _ in range(20):
        local = rng.uniform(-1.0, 1.0, 2) * [1.0, 0.5]
        turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
        where = np.array([20.0, 5.0]) + local @ turn
        angle = heading + rng.uniform(-spread, spread)
        points = np.concatenate(polygons_of(place(shape, where, angle, 5.0)))
        inner = (points - [x, y]) @ np.array([[c, -s], [s, c]])
        assert (np.abs(inner) <= np.array([half_length, half_width]) + 1e-9).all()


def test_an_enclosing_rectangle_is_tight():
    from commonroad.geometry.shape import Rectangle

    body = Rectangle(4.6, 1.8, np.array([1.4, 0.0]))
    made = enclosing(body, np.array([0.0, 0.0]), np.pi / 2, np.pi / 2, 5.0)
    # about its own centre from x = 0.5 to 2.3, y = -2.3 to 2.3; as a whole x = -0.9 to 0.9, y = -0.9 to 3.7
    np.testing.assert_allclose(made.rectangle, [0.7, 0.7, np.pi / 2, 3.0, 1.6], atol=1e-12)


@pytest.mark.parametrize("heading, noted", [(1.5, True), (0.0, False)])
def test_a_body_off_its_centre_is_noted_where_it_turns(tmp_path, heading, noted):
    states = "".join(roads.state(60.0, 0.3 * k, k=k, heading=heading, tag="state") for k in range(1, 41))
    car = roads.car(
        9,
        roads.state(60.0, 0.0, heading=heading),
        f"<trajectory>{states}</trajectory>",
        shape=rectangle(4.6, 1.8, 1.4, 0.0),
    )
    scene = scene_of(tmp_path, car)
    assert any("counts twice" in note for note in scene.notes) is noted


# -- what else moves -----------------------------------------------------------------------------------


def test_a_phantom_may_pause():
    from commonroad.geometry.shape import Rectangle
    from commonroad.prediction.prediction import Occupancy, SetBasedPrediction
    from commonroad.scenario.obstacle import PhantomObstacle

    shape = Rectangle(2.0, 2.0, np.array([40.0, 0.0]))
    phantom = PhantomObstacle(8, SetBasedPrediction(1, [Occupancy(k, shape) for k in (1, 2, 5, 6)]))
    source = SimpleNamespace(static_obstacles=[], dynamic_obstacles=[], phantom_obstacle=[phantom], dt=0.1)
    made = obstacles_of(source, first_step=0, n_steps=7)[0][0]
    there = np.isfinite(made.vertices).all(axis=(1, 2))
    np.testing.assert_array_equal(np.flatnonzero(there), [1, 2, 5, 6])


def test_an_obstacle_without_prediction_moves_on_where_that_is_asked_for(tmp_path):
    text = roads.car(10, roads.state(30.0, 0.0, v=12.0))
    assert constant(scene_of(tmp_path, text)).conflict.contact_id == 10
    moving = scene_of(tmp_path, text, after_prediction="constant_velocity")
    np.testing.assert_allclose(moving.obstacles[0].rectangles[10, 0], 42.0)
    assert constant(moving).conflict.time == np.inf
    assert not any("stand still" in note for note in moving.notes)
