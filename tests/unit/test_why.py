"""Why there is no repair: what is said where the answer is known, and that it is so."""

from __future__ import annotations

import json
import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.roads import car, driving, lanelet, problem, scenario, state

import repair
from repair.api import find, make
from repair.certify.late.why import why_rows as certified
from repair.certify.recompute import certify
from repair.io.record_check import require_record
from repair.report.rows.why import why_rows
from repair.report.text import summary
from repair.search.result import SearchStatus
from repair.solvers.registry import BACKENDS, make_backend
from repair.why.kinds import KINDS, among, under
from repair.why.moved import delayed, only_between, translated
from repair.why.obstacles import minimal, shortest

GOAL = "<goalState><time><intervalStart>39</intervalStart><intervalEnd>40</intervalEnd></time></goalState>"
LONG = driving(39, 300.0, 0.0, 0.0, range(1, 81))  # only says how long the traffic is known


def written(tmp_path, obstacles, *, own=20.0, width=7.0, more=""):
    file = tmp_path / "scenario.xml"
    road = lanelet(1, range(-40, 401, 20), [0.0] * 23, width=width) + more
    start = problem(100, state(20.0, 0.0, v=own), GOAL)
    file.write_text(scenario(road=road, obstacles=obstacles + LONG, problems=start), encoding="utf-8")
    return file


FEW = "shooting.iterations=0"  # enough here, and a failure costs less


def prepared(file, *overrides, backend="ego"):
    config = repair.load_config(backend=backend, overrides=["reference.source=constant", FEW, *overrides])
    return repair.prepare(repair.load_scene(file, config), config)


def explained(situation):
    found = find(situation, make(situation.config))
    return found, repair.explain(situation, found)


def by_kind(explanation, obstacle=None):
    return {one.kind: one for one in explanation.relaxations if one.obstacle_id in (None, obstacle)}


def standing(name, x, y, length=1.0, width=60.0):
    shape = f"<rectangle><length>{length}</length><width>{width}</width></rectangle>"
    body = f"<type>roadBoundary</type><shape>{shape}</shape>{state(x, y, v=0.0)}"
    return f'<staticObstacle id="{name}">{body}</staticObstacle>'


def crossing(name, x, y, v, speed_sign, *, length=4.5, wide=1.8):
    """A car that drives across the road."""
    heading = speed_sign * math.pi / 2
    states = [
        state(
            x, y + speed_sign * v * 0.1 * k, k=k, heading=heading, v=v, tag="state" if k else "initialState"
        )
        for k in range(81)
    ]
    shape = f"<rectangle><length>{length}</length><width>{wide}</width></rectangle>"
    return car(name, states[0], f"<trajectory>{''.join(states[1:])}</trajectory>", shape=shape)


def require_shown(situation, explanation):
    """Each amount suffices, and half of it does not: asked again, for itself."""
    config = situation.config
    backends = [make_backend(name, config) for name in explanation.asked]
    for one in explanation.relaxations:
        if not one.sufficient:
            continue
        for amount, expected in ((one.amount or 0.0, True), (one.half, False)):
            if amount is None or (not expected and not amount):
                continue
            other = under(situation, one.kind, amount, one.index)
            free = other.conflict.time > other.t_end
            status = [find(other, b, visits=(explanation.t_rep,)).status for b in backends]
            assert (free or SearchStatus.FOUND in status) is expected, (one, amount)


def test_before_a_wall_it_says_how_much_brakes_room_and_speed_are_missing(tmp_path):
    situation = prepared(written(tmp_path, standing(30, 39.0, 0.0)))
    found, why = explained(situation)
    assert found.status is SearchStatus.NONE_FEASIBLE
    assert (why.t_rep, why.exists_by, why.proven, why.complete) == (0.0, None, True, True)
    assert [one.id for one in why.blocking.obstacles] == [30]
    assert why.blocking.proven
    assert why.blocking.minimal
    limits, vehicle = situation.limits, situation.scene.vehicle
    gap = 39.0 - 0.5 - vehicle.half_length - 20.0 - situation.config.checker.clearance
    kinds = by_kind(why, 30)
    needed = 20.0**2 / (2.0 * gap) + limits.a_min
    assert needed - 0.01 <= kinds["friction"].amount <= needed + 0.6
    assert 0.0 < kinds["friction"].proven < needed
    needed = 20.0**2 / (-2.0 * limits.a_min) - gap
    assert needed - 0.01 <= kinds["away"].amount <= needed + 0.8
    needed = 20.0 - math.sqrt(-2.0 * limits.a_min * gap)
    assert kinds["start"].proven < needed <= kinds["start"].amount + 0.01 <= needed + 0.4
    assert kinds["removed"].sufficient
    for name in ("later", "earlier", "engine", "steering"):
        assert kinds[name].status == "not_sufficient"
    assert set(why.decides) >= {"obstacle", "friction", "start"}
    assert "backend" not in why.decides
    require_shown(situation, why)


def test_a_wall_is_in_the_way_before_and_while_it_is_met(tmp_path):
    _, why = explained(prepared(written(tmp_path, standing(30, 39.0, 0.0)), "explain.kinds=[removed]"))
    (blocker,) = why.blocking.obstacles
    assert 0.0 < blocker.since <= blocker.until <= 5.0


def test_who_crosses_a_little_later_is_no_obstacle(tmp_path):
    """A long vehicle fills the road when the ego gets there, and has left it a little earlier."""
    x, v = 40.0, 8.0
    across = crossing(30, x, -v * 1.0, v, 1.0, length=18.0)
    keys = "explain.kinds=[removed,later,earlier]"
    situation = prepared(written(tmp_path, across, own=25.0), keys)
    found, why = explained(situation)
    assert found.status is SearchStatus.NONE_FEASIBLE
    kinds = by_kind(why, 30)
    assert kinds["removed"].sufficient
    assert kinds["earlier"].sufficient or kinds["later"].sufficient
    require_shown(situation, why)


@pytest.mark.exhaustive
def test_on_a_narrow_road_width_would_help(tmp_path):
    situation = prepared(
        written(tmp_path, standing(30, 44.0, 0.0, 4.0, 1.8), own=24.0, width=3.5), "explain.kinds=[road]"
    )
    found, why = explained(situation)
    assert found.status is SearchStatus.NONE_FEASIBLE
    wider = by_kind(why, 30)["road"]
    vehicle = situation.scene.vehicle
    least = 0.9 + vehicle.width + situation.config.checker.clearance - 1.75
    assert wider.sufficient
    assert wider.amount >= least - 0.05
    assert "road" in why.decides
    require_shown(situation, why)


def test_who_has_nothing_to_do_with_it_is_left_out(tmp_path):
    other = driving(31, 80.0, 30.0, 3.0, range(1, 81)) + driving(32, -15.0, 0.0, 2.0, range(1, 81))
    file = written(tmp_path, other + standing(30, 39.0, 0.0))
    _, why = explained(prepared(file, "explain.kinds=[removed]"))
    assert [one.id for one in why.blocking.obstacles] == [30]


def test_two_who_close_the_road_together_are_both_named(tmp_path):
    """Past either of them alone there is a way."""
    both = standing(30, 42.0, 1.6, 1.0, 3.0) + standing(31, 42.0, -1.6, 1.0, 3.0)
    situation = prepared(written(tmp_path, both, own=24.0, width=7.0), "explain.kinds=[removed]")
    found, why = explained(situation)
    assert found.status is SearchStatus.NONE_FEASIBLE
    assert sorted(one.id for one in why.blocking.obstacles) == [30, 31]
    gone = [one for one in why.relaxations if one.kind == "removed"]
    assert [one.sufficient for one in gone] == [True, True]


@given(st.integers(0, 30), st.integers(0, 30), st.integers(30, 40))
def test_the_shortest_while_is_the_one_that_is_needed(first, length, last):
    needed = first, min(first + length, last)
    found = shortest(lambda a, b: a <= needed[0] and b >= needed[1], last)
    assert found == needed


@pytest.mark.exhaustive
def test_without_a_proof_each_of_two_has_the_shortest_while_in_which_they_leave_nothing(tmp_path):
    both = standing(30, 42.0, 1.6, 1.0, 3.0) + standing(31, 42.0, -1.6, 1.0, 3.0)
    keys = "explain.kinds=[removed]", "bound.nodes=1", "fallback=[]", "explain.time_limit=60"
    situation = prepared(written(tmp_path, both, own=24.0, width=7.0), *keys)
    _, why = explained(situation)
    scene, backends = situation.scene, [make_backend(name, situation.config) for name in why.asked]
    blockers = why.blocking.obstacles
    assert not why.blocking.proven
    assert sorted(one.id for one in blockers) == [30, 31]
    steps = {one.index: (round(one.since / scene.dt), round(one.until / scene.dt)) for one in blockers}

    def free(changed):
        some = tuple(only_between(scene.obstacles[k], *span) for k, span in {**steps, **changed}.items())
        other = among(situation, some)
        beyond = other.conflict.time > other.t_end
        return beyond or any(
            find(other, backend, visits=(why.t_rep,)).status is SearchStatus.FOUND for backend in backends
        )

    assert not free({})
    for k, (first, last) in steps.items():
        assert free({k: (first + 1, last)})
        assert free({k: (first, last - 1)})


def test_a_later_repair_is_explained_where_there_is_one(tmp_path):
    keys = "search.delta_t=0.1", "explain.kinds=[friction]"
    situation = prepared(written(tmp_path, standing(30, 90.0, 0.0)), *keys)
    found, why = explained(situation)
    assert found.status is SearchStatus.FOUND
    assert why.t_rep == pytest.approx(found.f_ttr + 0.1)
    assert by_kind(why, 30)["friction"].amount <= 3.0
    require_shown(situation, why)


def test_where_another_backend_finds_a_repair_the_backend_decides(tmp_path, nothing):
    keys = "explain.kinds=[removed,road]", "fallback=[]"
    situation = prepared(written(tmp_path, standing(30, 90.0, 0.0)), *keys, backend=nothing)
    found, why = explained(situation)
    assert found.status is SearchStatus.NONE_FEASIBLE
    assert (why.asked, why.exists_by, why.proven) == (("nothing",), "shooting", False)
    assert why.decides[0] == "backend"
    assert "the backend decides" in " ".join(text for _, text in why_rows(record(situation, found, why)))


@pytest.fixture
def nothing():
    """The name of a backend."""

    class Nothing:
        """Finds nothing, ever."""

        name, capabilities = "nothing", repair.Capabilities()

        def solve(self, problem, *, warm_start=None, time_limit=None):
            return repair.SolveResult(repair.SolveStatus.INFEASIBLE)

    repair.register_backend("nothing", lambda config: Nothing())
    yield "nothing"
    BACKENDS.unregister("nothing")


def record(situation, found, why):
    from repair.outcome.build import outcome_of
    from repair.outcome.driven import what_is_driven
    from repair.preparation import Phases

    driven = what_is_driven(situation, found, Phases())
    made = outcome_of(situation, found, driven.states, None, {}, {}, repair.Capabilities(), explanation=why)
    return made.record


def test_without_a_conflict_there_is_nothing_to_explain(tmp_path):
    situation = prepared(written(tmp_path, standing(30, 300.0, 0.0)), "explain.wanted=true")
    found, why = explained(situation)
    assert why is None
    assert "nothing to explain" in dict(why_rows(record(situation, found, why)))["Why"]


def test_without_time_it_says_what_was_not_tried(tmp_path):
    situation = prepared(written(tmp_path, standing(30, 39.0, 0.0)), "explain.time_limit=0")
    _, why = explained(situation)
    assert not why.complete
    assert why.not_tried == tuple(KINDS)
    assert not why.relaxations


def test_kinds_can_be_chosen_and_a_road_that_is_not_looked_at_is_none(tmp_path):
    keys = "explain.kinds=[road,friction]", "checker.road=false"
    situation = prepared(written(tmp_path, standing(30, 39.0, 0.0)), *keys)
    _, why = explained(situation)
    kinds = by_kind(why, 30)
    assert sorted(kinds) == ["friction", "road"]
    assert kinds["road"].status == "impossible"
    assert "checker.road" in kinds["road"].detail


def test_a_result_says_it_in_its_file_and_in_words(tmp_path):
    keys = "reference.source=constant", "explain.wanted=true", "explain.kinds=[friction,removed]", FEW
    config = repair.load_config(overrides=keys)
    result = repair.repair(written(tmp_path, standing(30, 39.0, 0.0)), config)
    result.save(tmp_path / "out", figure=False)
    read = repair.load_result(tmp_path / "out").record
    assert read["explanation"] == json.loads(json.dumps(result.to_dict()["explanation"]))
    assert certify(tmp_path / "out").ok
    text = summary(read, None)
    assert "in the way: obstacle 30" in text
    assert "more friction" in text


@pytest.mark.parametrize(
    "key, value",
    [
        ("proven", 1), ("relaxations", [{"kind": "road"}]), ("obstacles", [{"obstacle_id": 3}]),
        ("t_rep_s", None), ("asked", "ego"), ("not_tried", None),
    ],
)  # fmt: skip
def test_an_edited_explanation_is_noticed(tmp_path, key, value):
    situation = prepared(written(tmp_path, standing(30, 39.0, 0.0)), "explain.time_limit=0")
    content = record(situation, *explained(situation))
    require_record(content)
    content["explanation"][key] = value
    with pytest.raises(ValueError, match="explanation"):
        require_record(content)


@pytest.mark.parametrize(
    "edit",
    [
        lambda told, friction: told.update(t_rep_s=0.2),
        lambda told, friction: told.update(decides=["friction"]),
        lambda told, friction: told["obstacles"][0].update(obstacle_id=7),
        lambda told, friction: friction.update(amount=0.5, not_with=0.2, proven_too_little=0.1),
        lambda told, friction: friction.update(amount=9.0, not_with=4.5),
        lambda told, friction: friction.update(not_with=friction["amount"]),
    ],
)
def test_a_certificate_looks_at_an_explanation_and_finds_what_is_not_so(explained_wall, edit):
    situation, content = explained_wall
    told = deepcopy(content)
    assert all(row.ok for row in certified(told, situation, ""))
    edit(told["explanation"], next(r for r in told["explanation"]["relaxations"] if r["kind"] == "friction"))
    assert not all(row.ok for row in certified(told, situation, ""))


@pytest.fixture(scope="module")
def explained_wall(tmp_path_factory):
    """A situation and its record."""
    file = written(tmp_path_factory.mktemp("wall"), standing(30, 39.0, 0.0))
    situation = prepared(file, "explain.kinds=[removed,friction]", "fallback=[shooting]")
    return situation, record(situation, *explained(situation))


def test_settings_of_an_explanation_that_nobody_asked_for_are_told(tmp_path):
    notes = prepared(written(tmp_path, standing(30, 39.0, 0.0)), "explain.time_limit=3").notes
    assert any("explain.time_limit has no effect" in note for note in notes)


def test_the_same_again_gives_the_same(tmp_path):
    situation = prepared(written(tmp_path, standing(30, 39.0, 0.0)), "explain.kinds=[start,removed]")
    first, second = (explained(situation)[1] for _ in range(2))
    assert first.relaxations == second.relaxations
    assert first.blocking == second.blocking


def test_an_obstacle_is_moved_in_time_and_place(tmp_path):
    (one, _) = prepared(written(tmp_path, driving(30, 60.0, 1.0, 5.0, range(1, 81)))).scene.obstacles
    for steps in (3, -4):
        x = delayed(one, steps).states[:, 0]
        assert x == pytest.approx(one.states[:, 0] - 0.5 * steps)
        assert delayed(one, steps).vertices[:, 0, 0] == pytest.approx(one.vertices[:, 0, 0] - 0.5 * steps)
    moved = translated(one, np.array([1.0, -2.0]))
    assert moved.rectangles[:, :2] - one.rectangles[:, :2] == pytest.approx(np.tile([1.0, -2.0], (81, 1)))
    there = np.isfinite(only_between(one, 5, 9).rectangles[:, 0])
    assert np.flatnonzero(there).tolist() == [5, 6, 7, 8, 9]


def test_a_stronger_vehicle_drives_what_the_usual_one_drives(tmp_path):
    """With next to nothing more, an accepted repair stays one."""
    situation = prepared(written(tmp_path, standing(30, 90.0, 0.0)))
    found = find(situation, make(situation.config))
    for kind in ("friction", "steering", "road", "engine"):
        other = under(situation, kind, 1e-6)
        verdict = other.checker.check(other.source.plain(found.f_ttr), found.curve)
        assert verdict.ok, (kind, verdict)


@given(st.sets(st.integers(0, 15), max_size=4), st.integers(1, 16))
def test_a_minimal_set_is_found_wherever_it_is(needed, count):
    needed = {k for k in needed if k < count}
    asked = []

    def blocked(some):
        asked.append(some)
        return needed <= set(some)

    assert set(minimal(blocked, range(count))) == needed


def test_limits_that_were_configured_are_moved_by_the_amount(tmp_path):
    situation = prepared(written(tmp_path, standing(30, 39.0, 0.0)), "limits.a_total=6", "limits.a_min=-5")
    other = under(situation, "friction", 1.5)
    assert (other.limits.a_total, other.limits.a_min) == (7.5, -6.5)
    usual = prepared(written(tmp_path, standing(30, 39.0, 0.0)))
    assert under(usual, "friction", 2.0).limits.a_min == pytest.approx(usual.limits.a_min - 2.0)
    assert replace(usual.limits) == usual.limits


def test_what_a_bound_proves_an_explanation_does_not_leave_open(tmp_path):
    # It drives off the road at once: the conflict is at 0 s, before which an explanation looks for no proof.
    file = written(tmp_path, "", own=20.0)
    start = state(20.0, 4.0, v=20.0, heading=1.2)
    file.write_text(file.read_text().replace(state(20.0, 0.0, v=20.0), start), encoding="utf-8")
    wanted = ["mitigation.wanted=true", "explain.wanted=true", "explain.kinds=[removed]", "fallback=[]", FEW]
    result = repair.repair(file, overrides=["reference.source=constant", *wanted])
    assert (result.status, result.ttc) == (SearchStatus.UNAVOIDABLE, 0.0)
    assert result.explanation is not None
    assert result.explanation.proven
