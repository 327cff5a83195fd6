"""The collision tests against pycrcc, and what the world does between and beside the steps."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from repair.scene.traffic.late import steps_late
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.obstacles import obstacles_of
from repair.vehicle.parameters import load_vehicle
from repair.world.advance import polygons_left
from repair.world.collision import CollisionWorld
from repair.world.road import RoadBoundary
from repair.world.touching import rectangles_touch

EGO = load_vehicle(1)
HALF = (0.5 * EGO.length, 0.5 * EGO.width)


def obstacle(rows, id=1, role="dynamic", kind="rectangle", polygons=()):
    """An obstacle from rows ``x, y, heading, half length, half width``."""
    rows = np.asarray(rows, dtype=float)
    states = np.column_stack((rows[:, :3], np.full(len(rows), np.nan)))
    return Obstacle(
        id=id, kind="car", role=role, vertices=np.zeros((len(rows), 4, 2)),
        rectangles=rows if kind == "rectangle" else None,
        circles=rows[:, [0, 1, 3]] if kind == "circle" else None,
        polygons=polygons, states=states,
    )  # fmt: skip


def moving(x0, y0, vx, vy, heading, n=10, dt=0.1, size=(2.0, 1.0)):
    t = np.arange(n + 1) * dt
    return np.column_stack((x0 + vx * t, y0 + vy * t, np.full(n + 1, heading), np.tile(size, (n + 1, 1))))


def first_collision(world, *poses, start=0):
    """Time and obstacle of the first contact."""
    contact = world.contact(*poses, start)
    return None if contact is None else (contact.time, contact.obstacle_id)


def off_road(boundary, x, y, orientation):
    """Whether the ego is off the road at a pose."""
    return boundary.first_off_road(np.array([x]), np.array([y]), np.array([orientation])) is not None


def at_rest(n=41):
    return np.zeros(n), np.zeros(n), np.zeros(n)


# ------------------------------------------------------------- pairs of shapes


def test_rectangles_as_in_pycrcc():
    from commonroad_dc.pycrcc import RectOBB

    rng = np.random.default_rng(0)
    n = 4000
    ego = np.column_stack((rng.uniform(-5, 5, (n, 2)), rng.uniform(-4, 4, n)))
    other = np.column_stack((rng.uniform(-5, 5, (n, 2)), rng.uniform(-4, 4, n), rng.uniform(0.1, 4, (n, 2))))
    offset = (other[:, :2] - ego[:, :2]) @ [1.0, 1j] * np.exp(-1j * ego[:, 2])
    turn = np.exp(1j * (other[:, 2] - ego[:, 2]))
    diagonal = other[:, 3:] @ [1.0, 1j]
    shapes = np.array((offset, turn * diagonal, turn * diagonal.conj()))
    ours = rectangles_touch(shapes, turn, np.array(complex(*HALF)), diagonal)
    theirs = [
        RectOBB(*HALF, e[2], e[0], e[1]).collide(RectOBB(o[3], o[4], o[2], o[0], o[1]))
        for e, o in zip(ego, other, strict=True)
    ]
    assert 0.2 < np.mean(theirs) < 0.8
    assert (ours == theirs).all()


def left_of(parts, x, y, heading, moved=0j):
    """What is left of the gap between polygons and the ego at a pose."""
    left, reach = polygons_left(parts)
    assert reach == pytest.approx(max(np.hypot(*part.T).max() for part in parts))
    own = complex(np.cos(heading), -np.sin(heading))
    return left(-complex(x, y) * own, moved, own, 0j, complex(*HALF))


def test_polygons_as_in_shapely():
    import shapely

    rng = np.random.default_rng(1)
    answers = []
    for _ in range(500):
        points = rng.uniform(-4, 4, (6, 2)) + rng.uniform(-5, 5, 2)
        polygon = np.array(shapely.MultiPoint(points).convex_hull.exterior.coords)
        x, y, heading = rng.uniform(-3, 3, 3)
        c, s = np.cos(heading), np.sin(heading)
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * HALF @ np.array([[c, s], [-s, c]]) + (x, y)
        answers.append(shapely.Polygon(corners).intersects(shapely.Polygon(polygon)))
        for ring in (polygon[:-1], polygon[:-1][::-1]):
            gap = left_of((ring,), x, y, heading)
            assert (gap <= 0.0) == answers[-1]
            far = ring + np.array([40.0, 0.0])
            assert left_of((far, ring, np.vstack([far, far[-1:]])), x, y, heading) == pytest.approx(gap)
            assert left_of((ring,), x, y, heading, moved=0.5 + 0.0j) <= gap
    assert 0.2 < np.mean(answers) < 0.8


# ------------------------------------------------------------------ the world


def test_nothing_there():
    world = CollisionWorld([], EGO, 0.1, 10)
    assert world.n_samples == 41
    assert first_collision(world, *at_rest()) is None
    assert world.contact(*at_rest()) is None


def test_first_contact_in_time_and_who():
    far = obstacle(moving(30.0, 0.0, -20.0, 0.0, np.pi), id=7)
    near = obstacle(moving(20.0, 0.0, -20.0, 0.0, np.pi), id=8)
    world = CollisionWorld([far, near], EGO, 0.1, 10)
    time, who = first_collision(world, *at_rest())
    gap = 20.0 - 2.0 - HALF[0]
    assert who == 8
    assert gap / 20.0 - 1e-3 <= time <= gap / 20.0
    assert world.contact(*at_rest())[:3] == (time, 8, False)


def test_a_contact_between_two_steps_is_seen():
    # crosses 2.5 m in front of and behind the ego at the steps, through it in between
    rows = moving(0.0, -5.0, 0.0, 50.0, np.pi / 2, n=2, dt=0.2, size=(0.3, 0.3))
    world = CollisionWorld([obstacle(rows)], EGO, 0.2, 2)
    touched = (5.0 - 0.3 - HALF[1]) / 50.0
    assert first_collision(world, *at_rest(9)) == (pytest.approx(touched, abs=1e-3), 1)
    coarse = CollisionWorld([obstacle(rows)], EGO, 0.2, 2, substeps=1)
    assert first_collision(coarse, *at_rest(3)) == (pytest.approx(touched, abs=1e-3), 1)


def test_heading_is_interpolated_the_short_way():
    rows = np.array([[0.0, 3.2, np.pi - 0.1, 2.0, 0.1], [0.0, 3.2, -np.pi + 0.1, 2.0, 0.1]])
    world = CollisionWorld([obstacle(rows)], EGO, 0.1, 1)
    assert first_collision(world, *at_rest(5)) is None  # through pi; through zero it would stand upright


def test_absent_means_absent():
    rows = np.tile([0.0, 0.0, 0.0, 2.0, 1.0], (11, 1))
    rows[:3] = rows[6:] = np.nan
    world = CollisionWorld([obstacle(rows)], EGO, 0.1, 10)
    assert first_collision(world, *at_rest()) == (pytest.approx(0.3), 1)
    poses = tuple(a[21:] for a in at_rest())
    assert first_collision(world, *poses, start=21) is None
    assert first_collision(world, *poses, start=20) == (pytest.approx(0.5), 1)


def test_circles():
    rows = moving(10.0, 0.0, -10.0, 0.0, 0.0, size=(0.5, 0.5))
    world = CollisionWorld([obstacle(rows, kind="circle")], EGO, 0.1, 10)
    time, _ = first_collision(world, *at_rest())
    assert time == pytest.approx((10.0 - 0.5 - HALF[0]) / 10.0, abs=1e-3)
    corner = np.tile([HALF[0] + 0.4, HALF[1] + 0.4, 0.0, 0.5, 0.5], (11, 1))
    assert (
        first_collision(CollisionWorld([obstacle(corner, kind="circle")], EGO, 0.1, 10), *at_rest()) is None
    )


def test_polygons_and_sets_hold_over_both_intervals():
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    rows = np.full((11, 5), np.nan)
    polygons = tuple((square + 50.0, square) if k == 5 else (square + 50.0,) for k in range(11))
    shape = obstacle(rows, role="set_based", kind="polygon", polygons=polygons)
    world = CollisionWorld([shape], EGO, 0.1, 10)
    assert first_collision(world, *at_rest()) == (pytest.approx(0.4), 1)
    later = tuple(a[24:] for a in at_rest())
    assert first_collision(world, *later, start=24) is None
    rows[5] = (0.0, 0.0, 0.0, 1.0, 1.0)
    world = CollisionWorld([obstacle(rows, role="set_based")], EGO, 0.1, 10)
    assert first_collision(world, *at_rest()) == (pytest.approx(0.4), 1)


def test_a_polygon_far_inside_its_circle_is_no_contact():
    sliver = np.array([[-20.0, 5.0], [20.0, 5.0], [20.0, 5.1]])
    shape = obstacle(np.full((11, 5), np.nan), kind="polygon", polygons=((sliver,),) * 11)
    assert first_collision(CollisionWorld([shape], EGO, 0.1, 10), *at_rest()) is None


def test_late_copies_for_the_drivability_checker():
    rows = np.tile([0.0, 0.0, 0.0, 2.0, 1.0], (11, 1))
    rows[3:, 0] = 60.0  # gone from step 3 on; the checker still has it at step 3
    gone = obstacle(rows)
    poses = tuple(a[9:] for a in at_rest())
    on_time = CollisionWorld([gone], EGO, 0.1, 10)
    assert first_collision(on_time, *poses, start=9) is None
    late = CollisionWorld([replace(gone, late=1)], EGO, 0.1, 10)
    assert first_collision(late, *poses, start=9) == (pytest.approx(0.3), 1)
    static = CollisionWorld([replace(gone, role="static")], EGO, 0.1, 10)  # of the same id, but on time
    assert first_collision(static, *poses, start=9) is None


def test_shifts_are_read_from_the_predictions():
    def with_first(step, occupied):
        return SimpleNamespace(
            obstacle_id=step, initial_state=SimpleNamespace(time_step=0),
            prediction=SimpleNamespace(occupancy_set=[SimpleNamespace(time_step=occupied)]),
        )  # fmt: skip

    interval = SimpleNamespace(start=0, end=1)
    bare = SimpleNamespace(obstacle_id=9, prediction=None, initial_state=SimpleNamespace(time_step=0))
    obstacles = [with_first(0, 0), with_first(1, 1), with_first(3, 3), with_first(4, interval), bare]
    # The one that starts late is handed to the drivability checker step by step.
    assert [steps_late(obstacle) for obstacle in obstacles] == [1, 0, 0, 0, 0]


@pytest.mark.parametrize(
    "row, behind",
    [
        ((-10.0, 0.0, 15.0, 0.0, 0.0), True),  # runs into the rear
        ((10.0, 0.0, 5.0, 0.0, 0.0), False),  # the ego runs into it
        ((0.0, 8.0, 10.0, -10.0, -np.pi / 2), False),  # from the side
        ((20.0, 0.0, -10.0, 0.0, np.pi), False),  # head on
    ],
)
def test_who_strikes_from_behind(row, behind):
    x0, y0, vx, vy, heading = row
    world = CollisionWorld([obstacle(moving(x0, y0, vx, vy, heading, n=30))], EGO, 0.1, 30)
    t = np.arange(121) * 0.025
    contact = world.contact(10.0 * t, 0.0 * t, 0.0 * t)
    assert contact is not None
    assert contact.from_behind is behind


@pytest.mark.parametrize("role", ["static", "set_based"])
@pytest.mark.parametrize("v", [1.0, 5.0, 9.0, 13.0, 25.0])
def test_who_leaves_a_margin_that_it_starts_in_does_not_enter_it(role, v):
    """Wherever between two samples it is left; and not only by the looks that mostly settle it."""
    behind = np.tile([-HALF[0] - 0.3 - 2.0, 0.0, 0.0, 2.0, 1.0], (11, 1))
    world = CollisionWorld([obstacle(behind, role=role)], EGO, 0.1, 10)
    here, turn = v * np.arange(41) * 0.025 + 0j, np.zeros(41)
    beside = world.met_at(0, 0j, 0.0, 0.5)
    assert beside == {0}
    for keys in ({}, {"all_pairs": True}):
        assert world.contact_along(here, turn, margin=0.5, beside=beside, **keys) is None
    back = np.concatenate((here[:21], here[19::-1]))  # and it comes back
    entered = world.contact_along(back, turn, margin=0.5, beside=beside)
    assert entered is not None
    assert entered.time == pytest.approx(1.0 - 0.2 / v, abs=2e-3)


def test_of_those_touched_at_the_same_instant_the_first_is_named():
    there = np.tile([0.0, 0.0, 0.0, 2.0, 1.0], (11, 1))
    rows = there.copy()
    rows[3:, 0] = 60.0  # gone from step 3 on; the checker still has it at step 3
    world = CollisionWorld([obstacle(there), replace(obstacle(rows, id=2), late=1)], EGO, 0.1, 10)
    assert first_collision(world, *(a[12:] for a in at_rest()), start=12) == (pytest.approx(0.3), 1)


def test_malformed_queries_raise():
    world = CollisionWorld([], EGO, 0.1, 10)
    with pytest.raises(ValueError, match="samples 1 to 42"):
        world.contact(*at_rest(), start=1)
    with pytest.raises(ValueError, match="not finite"):
        world.contact(np.full(3, np.nan), np.zeros(3), np.zeros(3))


# ------------------------------------------------------------------- the road


def lanelet(name, left, right, **neighbours):
    names = ("adj_left", "adj_left_same_direction", "adj_right", "adj_right_same_direction")
    fields = dict.fromkeys(names)
    return SimpleNamespace(
        lanelet_id=name, left_vertices=np.array(left, float), right_vertices=np.array(right, float),
        **(fields | neighbours),
    )  # fmt: skip


def road(*lanelets):
    return RoadBoundary(SimpleNamespace(lanelet_network=SimpleNamespace(lanelets=list(lanelets))), EGO)


def two_way():
    """Two lanes of opposite directions, 40 m, y from -3 to 3, with a sliver of 1 cm between them."""
    east = lanelet(1, [(0, 0), (40, 0)], [(0, -3), (40, -3)], adj_left=2, adj_left_same_direction=False)
    west = lanelet(2, [(40, 0.01), (0, 0.01)], [(40, 3), (0, 3)], adj_left=1, adj_left_same_direction=False)
    return road(east, west)


def test_on_and_off_the_road():
    boundary = two_way()
    x = np.linspace(5.0, 35.0, 7)
    assert boundary.first_off_road(x, 0.0 * x, 0.0 * x) is None  # over the sliver between the lanes
    assert boundary.first_off_road(x, np.linspace(0.0, 3.0, 7), 0.0 * x) == 5
    assert boundary.first_off_road(np.array([10.0, 38.0]), np.zeros(2), np.zeros(2)) == 1
    assert boundary.first_off_road(np.array([100.0]), np.zeros(1), np.zeros(1)) == 0
    assert boundary.first_off_road(np.array([np.nan]), np.zeros(1), np.zeros(1)) == 0


def test_touching_the_edge_is_off_the_road():
    boundary = two_way()
    edge = 3.0 - HALF[1]
    assert off_road(boundary, 20.0, edge, 0.0)
    assert not off_road(boundary, 20.0, edge - 1e-6, 0.0)


def test_neighbours_that_do_not_agree():
    """A neighbour that is not in the file, or two lanelets each left of the other, do no harm."""
    missing = lanelet(1, [(0, 0), (40, 0)], [(0, -3), (40, -3)], adj_left=99, adj_left_same_direction=True)
    assert not off_road(road(missing), 20.0, -1.5, 0.0)
    one = lanelet(1, [(0, 0), (40, 0)], [(0, -3), (40, -3)], adj_left=2, adj_left_same_direction=True)
    two = lanelet(2, [(0, 3), (40, 3)], [(0, 0), (40, 0)], adj_left=1, adj_left_same_direction=True)
    assert off_road(road(one, two), 20.0, -4.5, 0.0)


# ------------------------------------------------- against the drivability checker


def samples_of(scenarios, count):
    files = sorted(scenarios.glob("*.xml"))
    traps = scenarios.parent / "traps"
    late = [
        traps / name for name in ("ZAM_Urban-3_3_Repair.xml", "ZAM_Zip-2_1_T-1.xml", "USA_US101-1_2_S-1.xml")
    ]
    return files[:: max(1, len(files) // count)][:count] + [f for f in late if f.exists()]


def read(path):
    from commonroad.common.file_reader import CommonRoadFileReader

    scenario, problems = CommonRoadFileReader(str(path)).open()
    return scenario, next(iter(problems.planning_problem_dict.values())).initial_state


def test_no_collision_of_the_drivability_checker_is_missed(scenarios):
    from commonroad_dc.collision.collision_detection.pycrcc_collision_dispatch import create_collision_checker
    from commonroad_dc.pycrcc import RectOBB, TimeVariantCollisionObject

    rng = np.random.default_rng(3)
    seen = 0
    for path in samples_of(scenarios, 5):
        scenario, start = read(path)
        obstacles, _, _ = obstacles_of(scenario, first_step=start.time_step, n_steps=40)
        world = CollisionWorld(obstacles, EGO, scenario.dt, 40, 4)
        checker = create_collision_checker(scenario)
        centres = np.concatenate([o.states[:, :2] for o in obstacles])
        centres = centres[np.isfinite(centres).all(axis=1)]
        t = np.linspace(0.0, 1.0, 161)
        for _ in range(60):
            x, y = (rng.choice(centres) + 3 * rng.normal(size=2))[:, None] + rng.uniform(-30, 30, (2, 1)) * (
                t - 0.5
            )
            heading = rng.uniform(-3, 3) + 0.1 * np.sin(5 * t)
            ego = TimeVariantCollisionObject(start.time_step)
            for k in range(0, 161, 4):
                ego.append_obstacle(RectOBB(*HALF, heading[k], x[k], y[k]))
            official = checker.collide(ego)
            seen += official
            assert not official or world.contact(x, y, heading) is not None, path.name
    assert seen > 50


def test_no_pose_is_laxer_than_the_triangulated_boundary(scenarios):
    pytest.importorskip(
        "triangle", reason="the drivability checker's triangulation needs the package triangle"
    )
    rng = np.random.default_rng(4)
    for path in samples_of(scenarios, 6):
        scenario, _ = read(path)
        boundary = RoadBoundary(scenario, EGO)
        ids_before = sorted(o.lanelet_id for o in scenario.lanelet_network.lanelets), len(scenario.obstacles)
        for one in scenario.lanelet_network.lanelets[:20]:
            centre = one.center_vertices[:, :2]
            x, y = centre.T + rng.uniform(-2, 2, (2, 1))
            heading = np.arctan2(np.gradient(centre[:, 1]), np.gradient(centre[:, 0])) + 0.1 * rng.normal()
            ours, official = boundary.first_off_road(x, y, heading), boundary.official_off_road(x, y, heading)
            assert official is None or (ours is not None and ours <= official), path.name
        assert ids_before == (
            sorted(o.lanelet_id for o in scenario.lanelet_network.lanelets), len(scenario.obstacles),
        )  # fmt: skip


def test_the_start_is_on_the_road(scenarios):
    for path in samples_of(scenarios, 6)[:6]:
        scenario, start = read(path)
        assert not off_road(RoadBoundary(scenario, EGO), *start.position, start.orientation), path.name
