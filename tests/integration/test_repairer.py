"""The door for planners: a repair every cycle."""

from __future__ import annotations

import pickle
import re
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from tests import roads

import repair
from repair.api import find
from repair.backend.base import SolveResult, SolveStatus
from repair.cycle import paced
from repair.cycle.paced import Pace, Paced
from repair.cycle.scenery import fits
from repair.cycle.searching import searched
from repair.deadline import OutOfTime, until
from repair.errors import ConfigError, ReferenceTrajectoryError, RepairError, ScenarioError
from repair.scene.frame import FrenetFrame
from repair.search.result import Like, SearchStatus
from repair.solvers.registry import make_backend

STRAIGHT = FrenetFrame.from_points([[0.0, 0.0], [100.0, 0.0]])
DOCS = Path(__file__).parents[2] / "docs" / "planner.md"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Return a straight road with a slower car ahead."""
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return repair.load_scene(file)


def plan(scene, now=0.0, aside=0.0, duration=4.0):
    """Straight on at the initial speed, from where that leads to at ``now``; possibly beside it."""
    ego = scene.initial_state
    t = np.arange(0.0, duration + 1e-9, scene.dt)
    axis = np.array([np.cos(ego.orientation), np.sin(ego.orientation)])
    place = np.array([ego.x, ego.y]) + (ego.velocity * (now + t))[:, None] * axis
    place += aside * np.array([-axis[1], axis[0]])
    return np.column_stack([t, place, np.full(len(t), ego.orientation), np.full(len(t), ego.velocity)])


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_the_first_cycle_is_a_repair(scene, backend):
    whole = repair.repair(scene, reference=plan(scene), backend=backend)
    cycle = repair.Repairer(scene, backend=backend).update(plan(scene))
    assert cycle.f_ttr == whole.f_ttr
    assert cycle.ttc == whole.ttc
    assert cycle.complete
    assert not cycle.kept
    assert not cycle.rebuilt
    np.testing.assert_allclose(cycle.states.x, whole.states.x, atol=1e-9)


@pytest.mark.thinned(2)
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_the_time_left_runs_down_and_never_jumps_back(scene, backend):
    """The plan and the recording stay as they are: what was verified once is so until it is due."""
    watch = repair.Repairer(scene, backend=backend)
    until, kept = 0.0, 0
    for k in range(12):
        now = k * scene.dt
        cycle = watch.update(plan(scene, now), now=now)
        assert cycle.status == "found"
        assert not cycle.rebuilt
        assert now + cycle.f_ttr >= until - 1e-9
        until, kept = now + cycle.f_ttr, kept + cycle.kept
        assert until < now + cycle.ttc
    assert kept > 0


class Late:
    """A backend that finds nothing before some time-to-repair."""

    name = "late"

    def __init__(self, config, first):
        self.own, self.first = make_backend("ego", config), first
        self.capabilities = replace(self.own.capabilities, fallbacks=None)

    def solve(self, problem, *, warm_start=None, time_limit=None):
        if problem.t_rep < self.first:
            return SolveResult(SolveStatus.INFEASIBLE)
        return self.own.solve(problem, warm_start=warm_start, time_limit=time_limit)


@pytest.mark.parametrize("rule", ["bisect", "guided"])
@pytest.mark.parametrize("guess", [None, 0.0])
def test_nothing_is_said_to_be_feasible_only_where_all_has_been_tried(scene, guess, rule):
    prepared = (
        repair.Repairer(scene, overrides=["search.delta_t=0.1", "fallback=[]"]).update(plan(scene)).prepared
    )
    settings = replace(prepared.config.search, rule=rule)
    whole = find(prepared, Late(prepared.config, 0.5), settings=replace(settings, rule="scan"))
    assert whole.f_ttr is not None
    assert whole.f_ttr > 0.5
    late = Late(prepared.config, 0.5)
    if rule == "bisect":  # the other one may happen to begin where something is
        assert searched(prepared, late, settings, guess=guess).f_ttr is None
    thorough = searched(prepared, late, settings, guess=guess, thorough=True)
    assert (thorough.status, thorough.f_ttr) == (SearchStatus.FOUND, pytest.approx(whole.f_ttr))
    assert thorough.complete
    assert len({round(probe.t_rep, 6) for probe in thorough.probes}) == len(thorough.probes)
    never = searched(prepared, Late(prepared.config, 99.0), settings, guess=guess, thorough=True)
    assert (never.status, never.complete) == (SearchStatus.NONE_FEASIBLE, True)
    grid = np.arange(0.0, prepared.conflict.time - 1e-9, 0.1)
    assert sorted(probe.t_rep for probe in never.probes) == pytest.approx(grid)
    cut = searched(
        prepared, Late(prepared.config, 99.0), replace(settings, time_limit=1e-9), guess=guess, thorough=True
    )
    assert (cut.status, cut.complete) == (SearchStatus.BUDGET_EXHAUSTED, False)


def test_what_passed_a_cycle_ago_is_asked_first(scene):
    prepared = repair.Repairer(scene, overrides=["search.delta_t=0.1"]).update(plan(scene)).prepared
    own, asked = make_backend("ego", prepared.config), {}

    class Seen:
        name, capabilities = "ego", replace(own.capabilities, fallbacks=None)

        def solve(self, problem, **keys):
            asked.setdefault(round(problem.t_rep, 6), []).append(round(problem.margin - usual, 6))
            return own.solve(problem, **keys)

    usual, settings = prepared.settings.margin, replace(prepared.config.search, rule="bisect")
    alone = searched(prepared, Seen(), settings, guess=0.0)
    assert not alone.best.tightened[0]
    asked.clear()
    like = Like(replace(alone.best, tightened=(0.3, 0.0, 0.0)), 0.25)
    found = searched(prepared, Seen(), settings, guess=0.0, like=like)
    assert found.f_ttr == alone.f_ttr
    assert {margins[0] for margins in asked.values()} == {0.3}
    assert asked[0.0] == [0.3]  # and passes
    late = [margins for t, margins in asked.items() if t > 0.25]
    assert any(0.0 not in margins for margins in late), "too close with more room, and unlikely to pass"


def test_what_is_driven_touches_nothing(scene):
    """By shapely, against the recorded rectangles, at each step of each cycle."""
    watch = repair.Repairer(scene, backend="ego")
    vehicle = scene.vehicle
    for k in range(0, 12, 3):
        now = k * scene.dt
        states = watch.update(plan(scene, now), now=now).states
        for j in range(len(states)):
            ego = box(
                states.x[j], states.y[j], states.orientation[j], vehicle.half_length, vehicle.half_width
            )
            for other in scene.obstacles:
                if k + j <= other.n_steps:
                    assert not ego.intersects(box(*other.rectangles[k + j]))


def box(x, y, turn, half_length, half_width):
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (half_length, half_width)
    c, s = np.cos(turn), np.sin(turn)
    return shapely.Polygon(corners @ np.array([[c, s], [-s, c]]) + (x, y))


def test_recorded_traffic_and_predictions_of_it_are_the_same(scene):
    one, other = repair.Repairer(scene), repair.Repairer(scene)
    for k in range(0, 8, 2):
        now = k * scene.dt
        predictions = [
            repair.Prediction(o.id, o.states[k:, :3], *(2.0 * o.rectangles[0, 3:])) for o in scene.obstacles
        ]
        a = one.update(plan(scene, now), now=now)
        b = other.update(plan(scene, now), traffic=predictions, now=now)
        assert a.f_ttr == b.f_ttr
        assert a.conflict.contact_time == pytest.approx(b.conflict.contact_time, abs=2e-3)


def test_commonroad_obstacles_are_taken_by_their_time_steps(scene):
    one, other = repair.Repairer(scene), repair.Repairer(scene)
    a = one.update(plan(scene, 0.5), now=0.5)
    b = other.update(plan(scene, 0.5), traffic=scene.scenario.obstacles, now=0.5)
    assert a.f_ttr == b.f_ttr


@pytest.mark.parametrize("before, after", [(0, 0), (0, 20), (3, 20)])
def test_who_is_known_by_one_pose_stands_in_a_cycle_too(scene, before, after):
    poses = np.full((before + 1 + after, 3), np.nan)
    poses[before] = (*scene.frame.to_cartesian(scene.start[:1, 0] + 25.0, np.zeros(1))[0], 0.0)
    stands = [repair.Prediction(7, poses, 4.5, 1.8)]
    whole = repair.repair(scene, reference=plan(scene), traffic=stands)
    cycle = repair.Repairer(scene).update(plan(scene), traffic=stands)
    assert (cycle.ttc, cycle.f_ttr, cycle.conflict.obstacle_id) == (whole.ttc, whole.f_ttr, 7)
    assert any("taken to stand still" in note for note in cycle.prepared.scene.notes)


def test_a_kept_repair_is_given_up_when_the_traffic_changes(scene):
    watch = repair.Repairer(scene, backend="casadi")
    assert watch.update(plan(scene), now=0.0).status == "found"
    clear = watch.update(plan(scene, 0.1), traffic=[], now=0.1)
    assert clear.status == "no_conflict"
    assert clear.f_ttr == np.inf
    ego = scene.initial_state
    ahead = np.array([ego.x, ego.y]) + 9.0 * np.array([np.cos(ego.orientation), np.sin(ego.orientation)])
    wall = repair.Prediction(5, np.tile([*ahead, ego.orientation], (40, 1)), 2.0, 30.0)
    none = watch.update(plan(scene, 0.2), traffic=[wall], now=0.2)
    assert none.status == "none_feasible"
    assert none.f_ttr is None
    assert not none.kept


def test_a_plan_elsewhere_gets_a_frame_of_its_own(scene):
    watch = repair.Repairer(scene)
    watch.update(plan(scene))
    cycle = watch.update(plan(scene, 0.1, aside=1.0), now=0.1)
    assert any(word.startswith("frame") for word in cycle.rebuilt)
    assert not cycle.kept
    assert not watch.update(plan(scene, 0.2, aside=1.0), now=0.2).rebuilt


def test_who_sets_out_across_the_path_gets_a_frame_of_its_own():
    s = 30.0 + np.linspace(0.0, 0.4, 20)
    for slope, along in ((0.0, True), (0.1, True), (0.35, False), (-0.35, False)):
        assert fits(np.stack([s, slope * (s - 30.0)], axis=1), STRAIGHT, 20.0, 0.0) is along
    standing = np.full((20, 2), [30.0, 0.1])  # who stands sets out nowhere, and is where the body is
    for body, along in ((0.0, True), (0.1, True), (-0.3, False), (3.0, False), (None, True)):
        assert fits(standing, STRAIGHT, 20.0, body) is along


def test_who_stands_turned_is_laid_into_no_path_that_leads_elsewhere(scene):
    """A plan of three columns that moves by a millimetre, after one whose path lies across."""
    ego, watch = scene.initial_state, repair.Repairer(scene, backend="ego")
    t = np.arange(0.0, 3.0 + 1e-9, scene.dt)
    way, turned = 4.0 * t, ego.orientation + 0.35
    across = np.column_stack([t, ego.x + way * np.cos(turned), ego.y + way * np.sin(turned)])
    watch.update(across[:8], traffic=[])
    crept = np.minimum(0.02 * t, 0.001)
    still = np.column_stack(
        [t, ego.x + crept * np.cos(ego.orientation), ego.y + crept * np.sin(ego.orientation)]
    )
    cycle = watch.update(still, traffic=[], now=scene.dt)
    assert (cycle.status, bool(cycle.rebuilt)) == ("no_conflict", True)
    assert not watch.update(still, traffic=[], now=2.0 * scene.dt).rebuilt


def test_without_speeds_the_plan_says_them_by_its_places(scene):
    cycle = repair.Repairer(scene).update(plan(scene)[:, :3])
    assert cycle.prepared.scene.initial_state.velocity == pytest.approx(
        scene.initial_state.velocity, abs=1e-6
    )
    assert cycle.status == "found"


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_a_deadline_holds_and_what_was_kept_counts(scene, backend, monkeypatch):
    """By the processor's time: what else the machine does is not the library's."""
    monkeypatch.setattr(time, "perf_counter", time.process_time)
    watch = repair.Repairer(scene, backend=backend)
    assert watch.update(plan(scene)).complete
    late = []
    for k in range(1, 8):
        now, begin = k * scene.dt, time.process_time()
        cycle = watch.update(plan(scene, now), now=now, deadline=0.04)
        late.append(time.process_time() - begin - 0.04)
        assert cycle.status == "found"
    assert np.median(late) < 0.004


def test_a_deadline_that_is_over_at_once_answers_nothing_and_forgets_nothing(scene):
    watch = repair.Repairer(scene, backend="ego")
    first = watch.update(plan(scene))
    for k in (1, 2, 3):
        cycle = watch.update(plan(scene, k * scene.dt), now=k * scene.dt, deadline=1e-6)
        assert cycle.status == "budget_exhausted"
        assert not cycle.complete
        assert cycle.f_ttr is None
        assert np.isnan(cycle.ttc)
        assert cycle.states is None
        assert cycle.trajectory is None
        assert "budget_exhausted" in repr(cycle)
    again = watch.update(plan(scene, 4 * scene.dt), now=4 * scene.dt)
    assert 4 * scene.dt + again.f_ttr >= first.f_ttr - 1e-9
    with pytest.raises(ReferenceTrajectoryError, match="a plan is needed"):
        watch.update(cycle)


@pytest.mark.parametrize("deadline", [0.001, 0.002, 0.004, 0.008, 0.016])
def test_whatever_a_deadline_cuts_what_is_answered_was_checked(scene, deadline, monkeypatch):
    """A repair that is answered passes the checker of its own cycle once more."""
    monkeypatch.setattr(time, "perf_counter", time.process_time)
    watch = repair.Repairer(scene, backend="ego")
    for k in range(10):
        now = 0.1 * k
        limit = None if k in (0, 5) else deadline
        cycle = watch.update(plan(scene, now), now=now, deadline=limit)
        assert cycle.status in ("found", "budget_exhausted")
        assert (cycle.f_ttr is None) == (cycle.status == "budget_exhausted")
        if cycle.f_ttr is not None:
            problem = cycle.prepared.source.plain(cycle.f_ttr)
            assert cycle.prepared.checker.check(problem, cycle.curve.repaired).ok


def test_where_the_last_search_ended_the_next_one_begins(scene):
    """A kept repair that does not hold any more still says where to look."""
    watch = repair.Repairer(scene, backend="ego", overrides=["search.rule=bisect"])
    first = watch.update(plan(scene))
    assert len(first.search.probes) > 2
    nearer = [
        repair.Prediction(o.id, o.states[1:, :3] - [1.5, 0.0, 0.0], *(2.0 * o.rectangles[0, 3:]))
        for o in scene.obstacles
    ]
    cycle = watch.update(plan(scene, 0.1), traffic=nearer, now=0.1)
    assert not cycle.kept
    assert cycle.search.probes[0].t_rep > 0.0
    fresh = repair.Repairer(scene, backend="ego").update(plan(scene, 0.1), traffic=nearer, now=0.1)
    assert cycle.f_ttr == fresh.f_ttr


def test_who_is_warm_has_kept_nothing_and_knows_how_long_its_parts_take(scene):
    watch = repair.Repairer(scene, backend="ego", overrides=["fallback=[]"])
    watch.warm(plan(scene))
    assert watch._kept is None
    assert {"traffic", "checker", "conflict", "occupancy"} <= {
        name for name, pace in watch._paces.items() if pace.expected > 0.0
    }
    assert not watch.update(plan(scene, 0.1), now=0.1, deadline=1e-4).complete


def test_searches_that_are_cut_short_do_not_say_how_long_judging_takes(scene):
    class Late:
        name, capabilities = "ego", replace(make_backend("ego", repair.load_config()).capabilities)

        def solve(self, problem, **keys):
            return SolveResult(SolveStatus.TIME_LIMIT)

    watch = repair.Repairer(scene, backend="ego", overrides=["fallback=[]"])
    watch.warm(plan(scene))
    known = watch._paces["judging"].expected
    assert known > 0.0
    watch._backend = Late()
    for _ in range(20):
        assert watch.update(plan(scene), deadline=60.0).search.probes
    assert watch._paces["judging"].expected == known


def test_judging_that_once_took_too_long_is_tried_again(scene, monkeypatch):
    monkeypatch.setattr(paced, "_AGAIN", 4)
    watch = repair.Repairer(scene, backend="ego", overrides=["fallback=[]"])
    watch.warm(plan(scene))
    for _ in range(20):
        watch._paces["judging"].took(60.0)
    for found in (False, False, False, False, True, True):
        cycle = watch.update(plan(scene), deadline=10.0)
        assert (cycle.f_ttr is not None) is found
        watch.reset()


def test_a_part_is_not_begun_that_would_not_end_in_time():
    pace = Pace()
    assert pace.expected == 0.0
    for seconds in (0.5, 0.01, 0.01, 0.01, 0.012):  # the first one imports something
        pace.took(seconds)
    assert 0.012 < pace.expected < 0.02
    phases = Paced(paces={"a": pace})
    with until(time.perf_counter() + 0.005), pytest.raises(OutOfTime, match="a takes about"), phases("a"):
        pytest.fail("it was begun")
    with until(time.perf_counter() + 5.0), phases("a"):
        pass
    assert phases.seconds["a"] < 5.0


def test_threads_do_not_meet(scene):
    def drive(backend):
        watch = repair.Repairer(scene, backend=backend)
        return [watch.update(plan(scene, k * scene.dt), now=k * scene.dt).f_ttr for k in range(5)]

    alone = [drive("ego"), drive("qptr")]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(drive, ["ego", "qptr", "ego", "qptr"]))
    assert together == [*alone, *alone]


def test_pickled_on_the_way_it_goes_on_as_it_would_have(scene):
    """With the repair that it has found, too."""
    watch = repair.Repairer(scene)
    for k in range(2):
        watch.update(plan(scene, k * scene.dt), now=k * scene.dt)
    again = pickle.loads(pickle.dumps(watch))
    answers = [
        [one.update(plan(scene, k * scene.dt), now=k * scene.dt) for k in range(2, 6)]
        for one in (watch, again)
    ]
    assert any(cycle.kept for cycle in answers[0])
    for usual, other in zip(*answers, strict=True):
        assert (other.status, other.ttc, other.f_ttr, other.kept) == (
            usual.status, usual.ttc, usual.f_ttr, usual.kept,
        )  # fmt: skip
        assert not other.rebuilt


def test_what_each_mode_alone_would_allow(scene):
    """By a search for each, when asked; those below the threshold are nobody."""
    ego = scene.initial_state
    axis = np.array([np.cos(ego.orientation), np.sin(ego.orientation)])

    def stands(ahead, probability):
        place = [*(np.array([ego.x, ego.y]) + ahead * axis), ego.orientation]
        poses = np.tile(place, (scene.n_steps + 1, 1))
        return repair.Prediction(7, poses, 4.5, 1.8, probability=probability, mode=f"{ahead:g} m")

    modes = [stands(40.0, 0.9), stands(30.0, 0.1)]
    watch = repair.Repairer(scene, overrides=["search.rule=scan"])
    cycle = watch.update(plan(scene), traffic=modes)
    far, near = watch.modes(cycle)
    assert (far.name, far.probability, near.name) == ("40 m", 0.9, "30 m")
    assert near.ttc == cycle.ttc < far.ttc
    assert cycle.f_ttr <= near.f_ttr <= far.f_ttr
    likely = watch.update(plan(scene), traffic=modes, threshold=0.5)
    assert likely.ttc == far.ttc
    assert [mode.name for mode in watch.modes(likely)] == ["40 m"]
    assert watch.modes(watch.update(plan(scene))) == ()
    with pytest.raises(ConfigError, match="not of a int"):
        watch.modes(5)


def test_numbers_of_numpy_are_numbers(scene):
    watch = repair.Repairer(scene)
    cycle = watch.update(plan(scene), now=np.int64(0), deadline=np.float32(60.0))
    assert cycle.status == "found"
    with pytest.raises(ConfigError, match="the deadline is True"):
        watch.update(plan(scene), deadline=True)


WRONG = {
    "between steps": (lambda s: {"now": 0.05}, ConfigError, "multiple of the step"),
    "before": (lambda s: {"now": -0.1}, ConfigError, "now is -0.1"),
    "no time": (lambda s: {"now": "soon"}, ConfigError, "'soon'"),
    "too late": (lambda s: {"now": 50.0, "ego": None}, ScenarioError, "traffic ends at"),
    "no deadline": (lambda s: {"deadline": 0.0}, ConfigError, "the deadline is 0.0"),
    "no ego": (lambda s: {"ego": 5}, ScenarioError, "not a int"),
    "half an ego": (lambda s: {"ego": {"x": 0.0, "y": 0.0, "yaw": 0.0}}, ScenarioError, "lacks v"),
    "another ego": (
        lambda s: {"ego": {"x": 1e3, "y": 0.0, "yaw": 0.0, "v": 0.0}}, ReferenceTrajectoryError, "starts"
    ),
    "an ego that is none": (
        lambda s: {"ego": {"x": np.nan, "y": 0.0, "yaw": 0.0, "v": 0.0}}, ScenarioError, "not finite"
    ),
    "a letter": (lambda s: {"ego": {"x": "a", "y": 0.0, "yaw": 0.0, "v": 0.0}}, ScenarioError, "no number"),
    "a state with a letter": (
        lambda s: {"ego": replace(s.initial_state, x="a")}, ScenarioError, "the ego's x is 'a', which is no n"
    ),
    "a state without end": (
        lambda s: {"ego": replace(s.initial_state, acceleration=np.inf)}, ScenarioError,
        "the ego's acceleration is not finite",
    ),
    "too fast": (
        lambda s: {"ego": replace(s.initial_state, velocity=200.0)}, ScenarioError, "the ego's speed is 200"
    ),
    "a state of half an ego": (
        lambda s: {"ego": SimpleNamespace(position=np.zeros(2), velocity=1.0)}, ScenarioError,
        "the ego's state has no orientation",
    ),
    "a kind of car": (
        lambda s: {"traffic": [repair.Prediction(3, np.zeros((9, 3)), 4.0, 2.0, kind="spaceship")]},
        ScenarioError, "no kind 'spaceship'",
    ),
    "a chance": (
        lambda s: {"traffic": [repair.Prediction(3, np.zeros((9, 3)), 4.0, 2.0, probability=2.0)]},
        ScenarioError, "its probability is 2.0",
    ),
    "no chance at all": (  # which would not be above any threshold
        lambda s: {"traffic": [repair.Prediction(3, np.zeros((9, 3)), 4.0, 2.0, probability=np.nan)]},
        ScenarioError, "its probability is nan",
    ),
    "a giant": (  # whose outline would fill the memory
        lambda s: {"traffic": [repair.Prediction(3, np.zeros((9, 3)), 3e4, 3e4)]}, ScenarioError,
        "obstacle 3: its size is",
    ),
    "nowhere on Earth": (
        lambda s: {"traffic": [repair.Prediction(3, np.full((9, 3), 1e9), 4.0, 2.0)]}, ScenarioError,
        "obstacle 3: it is farther",
    ),
    "a threshold": (lambda s: {"traffic": [], "threshold": 2.0}, ScenarioError, "from 0 to below 1"),
    "a threshold of nobody": (lambda s: {"threshold": 0.2}, ConfigError, "none is given"),
    "no poses": (
        lambda s: {"traffic": [repair.Prediction(3, np.zeros((9, 2)), 4.0, 2.0)]}, ScenarioError, "of shape"
    ),
    "a hole": (
        lambda s: {"traffic": [repair.Prediction(3, [[0.0] * 3, [np.nan] * 3, [0.0] * 3], 4.0, 2.0)]},
        ScenarioError, "has a hole",
    ),
    "traffic": (lambda s: {"traffic": 5}, ScenarioError, "has to be a list"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_a_sentence_and_no_end(what, scene):
    keys, error, words = WRONG[what]
    watch = repair.Repairer(scene)
    with pytest.raises(error, match=words):
        watch.update(plan(scene), **keys(scene))
    assert watch.update(plan(scene)).status == "found"


@pytest.mark.parametrize(
    "road, keys, words",
    [
        (5, {}, "not a int"),
        ("nowhere.xml", {}, "no such file"),
        (None, {"backend": "foo"}, "foo"),
        (None, {"planning_problem": 3}, "belongs to a CommonRoad scenario"),
        (None, {"overrides": ["driver=at_ttr"]}, "driver=at_ttr"),
        (None, {"overrides": ["scene.vehicle=2"]}, "loaded with scene.vehicle=1"),
        (None, {"overrides": ["scene.after_prediction=hold"]}, "loaded with scene.after_prediction=remove"),
    ],
)
def test_what_no_repairer_is_made_of(road, keys, words, scene):
    with pytest.raises(RepairError, match=words):
        repair.Repairer(scene if road is None else road, **keys)


def test_what_belongs_to_no_cycle_is_said(scene):
    wanted = ["metrics=[ttb]", "bound.wanted=true", "repair.goal=true"]
    cycle = repair.Repairer(scene, overrides=wanted).update(plan(scene))
    told = [note.split()[0] for note in cycle.prepared.notes if "no effect in a Repairer" in note]
    assert told == [key.split("=")[0] for key in wanted]


def test_a_curve_is_no_plan(scene):
    planned = repair.repair(scene, overrides=["reference.source=planner"]).prepared.reference
    with pytest.raises(ReferenceTrajectoryError, match="places on the plane"):
        repair.Repairer(scene).update(planned)


def test_the_loop_of_the_page(scenarios, monkeypatch):
    """It drives the crossing of the paper with a planner of its own, and touches nothing."""
    code = re.search(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL).group(1)
    assert len(code.splitlines()) <= 40
    code = code.replace("scenarios/DEU_Flensburg-6_1_T-1.xml", str(scenarios / "DEU_Flensburg-6_1_T-1.xml"))
    names = {}
    exec(compile(code, str(DOCS), "exec"), names)
    assert names["evading"] is not None
    assert len(names["driven"]) == 45
    steps = np.hypot(*np.diff(np.array(names["driven"]), axis=0).T)
    assert steps.max() < 14.0 * names["dt"]
