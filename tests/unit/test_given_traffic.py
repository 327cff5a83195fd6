"""Traffic from memory: arrays, sets, CommonRoad obstacles, and several predictions of one obstacle."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from commonroad.geometry.shape import ShapeGroup
from tests import roads

import repair
from repair.certify.certificate import format_certificate
from repair.certify.recompute import certify
from repair.errors import ConfigError, ScenarioError

CONSTANT = ["reference.source=constant", "search.rule=scan"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Return a straight road with a slower car ahead."""
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return repair.load_scene(file)


def of(scene, ahead, speed, *, braking=0.0, aside=0.0, late=0):
    """Poses (T, 3) of a car on the ego's lane, so far ahead [m]."""
    t = np.arange(scene.n_steps + 1) * scene.dt
    stops = speed / braking if braking else np.inf
    driven = np.where(t < stops, speed * t - 0.5 * braking * t**2, 0.5 * speed * np.minimum(stops, 1e6))
    ego = scene.initial_state
    axis = np.array([np.cos(ego.orientation), np.sin(ego.orientation)])
    across = np.array([-axis[1], axis[0]])
    place = np.array([ego.x, ego.y]) + (ahead + driven)[:, None] * axis + aside * across
    poses = np.column_stack([place, np.full(len(t), ego.orientation)])
    poses[:late] = np.nan
    return poses


def car(scene, name=7, **keys):
    own = {k: keys.pop(k) for k in ("mode", "probability") if k in keys}
    return repair.Prediction(name, of(scene, **keys), 4.5, 1.8, **own)


def answer(scene, traffic, step=0.2, **keys):
    return repair.repair(scene, traffic=traffic, overrides=[*CONSTANT, f"search.delta_t={step}"], **keys)


def test_the_traffic_of_the_file_is_left_out(scene):
    assert answer(scene, []).status == "no_conflict"
    assert repair.repair(scene, overrides=[*CONSTANT, "search.delta_t=0.2"]).status == "found"


def test_arrays_are_read_like_the_obstacles_of_a_file(scene):
    """Its own obstacles as poses and as CommonRoad objects: the same answer."""
    own = repair.repair(scene, overrides=[*CONSTANT, "search.delta_t=0.2"])
    objects = answer(scene, scene.scenario.obstacles)
    boxes = np.array([o.states[:, :3] for o in scene.obstacles])
    sizes = np.array([2.0 * o.rectangles[0, 3:] for o in scene.obstacles])
    arrays = answer(scene, repair.predictions_of(boxes, length=sizes[:, 0], width=sizes[:, 1]))
    wide = np.concatenate([boxes, np.broadcast_to(sizes[:, None], (*boxes.shape[:2], 2))], axis=2)
    with_sizes = answer(scene, repair.predictions_of(wide))
    for found in (objects, arrays, with_sizes):
        assert found.f_ttr == own.f_ttr
        assert found.search.conflict.contact_time == pytest.approx(own.search.conflict.contact_time, abs=2e-3)


def test_sets_are_kept_clear_of(scene):
    poses = of(scene, 30.0, 0.0)
    square = np.array([[-3.0, -1.0], [3.0, -1.0], [3.0, 1.0], [-3.0, 1.0]])
    sets = [row[:2] + square for row in poses]
    found = answer(scene, [repair.Prediction(3, occupancies=sets)])
    assert found.search.conflict.obstacle_id == 3
    assert found.status == "found"


def test_a_body_of_any_shape(scene):
    """A rectangle by its size, as CommonRoad's, and by its corners is the same; a circle is one."""
    from commonroad.geometry.shape import Circle, Rectangle

    poses = of(scene, 30.0, 0.0)
    corners = np.array([[2.25, 0.9], [-2.25, 0.9], [-2.25, -0.9], [2.25, -0.9]])
    alike = [{"length": 4.5, "width": 1.8}, {"shape": Rectangle(4.5, 1.8)}, {"shape": corners}]
    found = [answer(scene, [repair.Prediction(7, poses, **keys)]) for keys in alike]
    assert len({one.f_ttr for one in found}) == 1
    contacts = [one.search.conflict.contact_time for one in found]
    np.testing.assert_allclose(contacts, contacts[0], atol=2e-3)
    # A metre of the body more towards the ego, and none behind: it turns about its pose.
    longer = answer(scene, [repair.Prediction(7, poses, shape=corners - (1.0, 0.0) * (corners < 0.0))])
    sooner = contacts[0] - longer.search.conflict.contact_time
    assert sooner == pytest.approx(1.0 / scene.initial_state.velocity, abs=5e-3)
    pole = answer(scene, [repair.Prediction(7, poses, shape=Circle(0.9), kind="pillar")])
    later = pole.search.conflict.contact_time - contacts[0]
    assert later == pytest.approx((2.25 - 0.9) / scene.initial_state.velocity, abs=5e-3)


def test_boxes_that_grow_are_sets(scene):
    """An uncertainty that grows: as boxes with their sizes, and as the polygons that these are."""
    poses = of(scene, 40.0, 0.0)
    sizes = np.column_stack([4.5 + 0.5 * np.arange(len(poses)), np.full(len(poses), 1.8)])
    (grows,) = repair.predictions_of(np.concatenate([poses, sizes], axis=1)[None], ids=[5])
    assert grows.occupancies is not None
    found = answer(scene, [grows])
    stays = answer(scene, [repair.Prediction(5, poses, 4.5, 1.8)])
    assert found.search.conflict.obstacle_id == 5
    assert found.ttc < stays.ttc


def test_sets_may_be_one_array(scene):
    square = SQUARE + scene.frame.to_cartesian(scene.start[:1, 0] + 30.0, np.zeros(1))[0]
    sets = np.array([square] * (scene.n_steps + 1))
    alike = [answer(scene, [repair.Prediction(7, occupancies=form)]) for form in (sets, list(sets))]
    assert alike[0].ttc == alike[1].ttc < np.inf


def test_sets_of_several_parts_that_come_later(scene):
    from commonroad.geometry.shape import Circle

    poses = of(scene, 30.0, 0.0)
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    parts = [[row[:2] + square, row[:2] + square + (200.0, 0.0)] for row in poses]
    whole = answer(scene, [repair.Prediction(3, occupancies=parts)])
    alone = answer(scene, [repair.Prediction(3, occupancies=[first for first, _ in parts])])
    assert whole.ttc == alone.ttc
    late = answer(scene, [repair.Prediction(3, occupancies=[None] * 30 + parts[30:])])
    assert late.ttc == pytest.approx(3.0, abs=0.11)
    circles = [Circle(1.0, row[:2]) for row in poses]
    assert answer(scene, [repair.Prediction(3, occupancies=circles)]).ttc == pytest.approx(alone.ttc, abs=0.1)


def test_a_chance_that_is_no_number_hides_nobody(scene):
    """NaN is above no threshold: the obstacle would be left out."""
    with pytest.raises(ScenarioError, match="its probability is nan"):
        answer(scene, [car(scene, ahead=30.0, speed=0.0, probability=np.nan)])


def test_who_comes_later_is_not_there_before(scene):
    early, late = (answer(scene, [car(scene, ahead=30.0, speed=0.0, late=k)]) for k in (0, 30))
    assert early.ttc < late.ttc
    assert late.ttc == pytest.approx(3.0, abs=0.11)


def brakes(scene, **keys):
    return car(scene, ahead=15.0, speed=scene.initial_state.velocity, braking=8.0, mode="brakes", **keys)


def goes_on(scene, **keys):
    return car(scene, ahead=15.0, speed=scene.initial_state.velocity, braking=2.0, mode="goes on", **keys)


@pytest.mark.thinned(2)
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_a_repair_is_clear_of_every_mode(scene, backend):
    """The F-TTR of all modes is never above that of a single one, and the result says each."""
    modes = [brakes(scene, probability=0.3), goes_on(scene, probability=0.7)]
    both = answer(scene, modes, backend=backend)
    singles = [answer(scene, [mode], backend=backend) for mode in modes]
    assert [m.name for m in both.modes] == ["brakes", "goes on"]
    assert [m.obstacle_id for m in both.modes] == [7, 7]
    assert both.ttc == min(m.ttc for m in both.modes)
    for mode, single in zip(both.modes, singles, strict=True):
        assert mode.ttc == pytest.approx(single.ttc)
        assert mode.f_ttr >= single.f_ttr
        assert both.f_ttr <= mode.f_ttr
    record = both.to_dict()["modes"]
    assert [m["probability"] for m in record] == [0.3, 0.7]
    assert any("stands as obstacle" in note for note in both.to_dict()["notes"])


def test_two_modes_leave_less_time_than_either(scene):
    """Ahead of one and behind the other: what passes one mode is struck by the other.

    The crossing car comes early or late. Alone, either is let pass, or passed, at the last moment; who has
    to be clear of both can do neither of these, and has to brake for both earlier.
    """
    ego = scene.initial_state
    axis = np.array([np.cos(ego.orientation), np.sin(ego.orientation)])
    across = np.array([-axis[1], axis[0]])
    t = np.arange(scene.n_steps + 1) * scene.dt

    def crossing(at, mode):
        place = np.array([ego.x, ego.y]) + 30.0 * axis + (8.0 * (t - at))[:, None] * across
        turn = np.full(len(t), ego.orientation + 0.5 * np.pi)
        return repair.Prediction(4, np.column_stack([place, turn]), 4.5, 1.8, probability=0.5, mode=mode)

    early, late = crossing(2.6, "early"), crossing(3.6, "late")
    both = answer(scene, [early, late], step=0.1, backend="casadi")
    singles = [answer(scene, [mode], step=0.1, backend="casadi") for mode in (early, late)]
    assert both.f_ttr is not None
    assert both.f_ttr < min(single.f_ttr for single in singles)
    assert both.f_ttr <= min(mode.f_ttr for mode in both.modes)


def test_improbable_modes_are_left_out_and_said(scene):
    modes = [brakes(scene, probability=0.02), goes_on(scene, probability=0.98)]
    other = repair.with_traffic(scene, modes, threshold=0.05)
    assert len(other.obstacles) == 1
    assert any("brakes (0.02)" in note for note in other.notes)
    assert answer(scene, modes, threshold=0.05).f_ttr == answer(scene, modes[1:]).f_ttr
    with pytest.raises(ConfigError, match="none is given"):
        repair.repair(scene, threshold=0.05)


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def hole(poses):
    poses[5] = np.nan
    return poses


WRONG = {
    "no list": (lambda s: 5, "has to be a list"),
    "a number": (lambda s: [5], "holds a int"),
    "no size": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0))], "both have to be positive"),
    "nothing": (lambda s: [repair.Prediction(1)], "either poses or occupancies"),
    "both": (lambda s: [repair.Prediction(1, [[0, 0, 0]], 1, 1, occupancies=[])], "either poses"),
    "flat": (lambda s: [repair.Prediction(1, [0, 0, 0], 4, 2)], "of shape"),
    "hole": (lambda s: [repair.Prediction(1, hole(of(s, 20.0, 0.0)), 4, 2)], "at step 5"),
    "never": (lambda s: [repair.Prediction(1, np.full((5, 3), np.nan), 4, 2)], "no pose of it"),
    "kind": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0), 4, 2, kind="tank")], "no kind 'tank'"),
    "unknown": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0), 4, 2, probability="a")], "is 'a'"),
    "a letter": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0), "a", 2)], "'a' and 2"),
    "two shapes": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0), 4, 2, shape=[[0, 0]] * 3)], "either a"),
    "no shape": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0), shape="round")], "neither one of"),
    "sets of nobody": (lambda s: [repair.Prediction(1, occupancies=[None] * 20)], "0 of its 20 occupancies"),
    "away": (lambda s: [repair.Prediction(1, occupancies=[SQUARE, None, SQUARE])], "at step 1 it is nowhere"),
    "a group of none": (
        lambda s: [repair.Prediction(77, of(s, 20.0, 0.0), shape=ShapeGroup([]))], "obstacle 77: .* of none"
    ),
    "sets of none": (
        lambda s: [repair.Prediction(1, occupancies=[SQUARE, ShapeGroup([])])], "obstacle 1: .* step 1 is no"
    ),
    "a size of sets": (lambda s: [repair.Prediction(1, length=4, occupancies=[SQUARE] * 3)], "leave shape"),
    "likely": (lambda s: [repair.Prediction(1, of(s, 20.0, 0.0), 4, 2, probability=2)], "probability"),
    "twice": (lambda s: [*s.scenario.obstacles, *s.scenario.obstacles], "obstacle"),
    "a line": (lambda s: [repair.Prediction(1, occupancies=[[[0, 0], [1, 1]]] * 3)], "no polygon"),
    "id": (lambda s: [repair.Prediction("a", of(s, 20.0, 0.0), 4, 2)], "obstacle"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_is_no_traffic_is_a_sentence(what, scene):
    make, words = WRONG[what]
    with pytest.raises(ScenarioError, match=words) as caught:
        repair.with_traffic(scene, make(scene))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "boxes, keys, words",
    [
        (np.zeros((2, 3)), {}, "of shape"),
        (np.zeros((2, 4, 3)), {}, "takes length and width"),
        (np.zeros((2, 4, 3)), {"length": [1, 2, 3], "width": 1}, "do not fit"),
        (np.zeros((2, 4, 5)), {"length": 1}, "leave length"),
        (np.zeros((2, 4, 3)), {"length": 1, "width": 1, "ids": [1]}, "1 ids"),
        (np.arange(40.0).reshape(2, 4, 5) - 13.0, {}, "obstacle 1 has no size at step 0"),
        (np.zeros((1, 4, 3)), {"length": "a", "width": 1}, "do not fit"),
        (np.zeros((1, 4, 3)), {"length": 1, "width": 1, "ids": 5}, "the ids of"),
    ],
)
def test_boxes_that_are_none(boxes, keys, words):
    with pytest.raises(ScenarioError, match=words):
        repair.predictions_of(boxes, **keys)


def test_a_result_with_traffic_from_memory_is_certified(scene, tmp_path):
    """The scenario is written beside it, as nobody else has it."""
    modes = [brakes(scene, probability=0.3), goes_on(scene, probability=0.7)]
    found = answer(scene, [*modes, car(scene, 9, ahead=-30.0, speed=3.0)], backend="casadi")
    found.save(tmp_path, figure=False)
    assert (tmp_path / f"{scene.id}.xml").is_file()
    certificate = certify(tmp_path)
    assert certificate.ok, format_certificate(certificate)


def test_what_is_handed_over_stays_as_it_is(scene):
    """Headings are brought into the range that CommonRoad takes in a copy."""
    poses = np.tile([scene.initial_state.x + 40.0, scene.initial_state.y, 7.0], (20, 1))
    answer(scene, [repair.Prediction(7, poses, 4.0, 1.8)])
    assert (poses[:, 2] == 7.0).all()
