"""The bound on the time to react: what it says where the answer is known, and what it never may say."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.shooting import Shooting
from tests.crossings import crossing
from tests.roads import driving, lanelet, problem, scenario, state

import repair
from repair.api import find
from repair.bounds.latest import Quick, earliest
from repair.bounds.settings import KINDS, BoundConfig
from repair.solvers.registry import make_backend


def prepared(tmp_path, text, *overrides):
    file = tmp_path / "scenario.xml"
    file.write_text(text, encoding="utf-8")
    config = repair.load_config(overrides=["reference.source=constant", *overrides])
    return repair.prepare(repair.load_scene(file, config), config)


def wall(own=10.0, at=60.0, width=60.0):
    """A wall across the whole road, which stands."""
    steps = "<time><intervalStart>39</intervalStart><intervalEnd>40</intervalEnd></time>"
    shape = f"<rectangle><length>1.0</length><width>{width}</width></rectangle>"
    body = f"<type>roadBoundary</type><shape>{shape}</shape>{state(at, 0.0)}"
    block = f'<staticObstacle id="30">{body}</staticObstacle>'
    moving = driving(31, 300.0, 0.0, 0.0, range(1, 81))  # only says how long the traffic is known
    road = lanelet(1, range(-40, 401, 20), [0.0] * 23, width=7.0)
    wanted = problem(100, state(20.0, 0.0, v=own), f"<goalState>{steps}</goalState>")
    return scenario(road=road, obstacles=block + moving, problems=wanted)


def test_a_wall_is_too_late_from_the_braking_distance_on(tmp_path):
    situation = prepared(tmp_path, wall())
    found = repair.bound(situation)
    vehicle, checker = situation.scene.vehicle, situation.config.checker
    gap = 60.0 - 0.5 - vehicle.half_length - 20.0
    exact = (gap - 10.0**2 / (2 * vehicle.a_max)) / 10.0
    assert exact <= found["vehicle"].time <= exact + 0.1  # who turns is shorter
    brake = -1.01 * situation.limits.a_min
    exact = (gap - checker.clearance - 10.0**2 / (2 * brake)) / 10.0
    assert exact <= found["search"].time <= exact + 0.1
    assert all(b.proven and b.complete for b in found.values())


def test_a_finer_step_is_no_later_and_a_coarser_one_no_earlier(tmp_path):
    situation = prepared(tmp_path, wall(), "checker.substeps=8")
    times = [repair.bound(situation, BoundConfig(step=s))["vehicle"].time for s in (0.0125, 0.025, 0.1)]
    assert times == sorted(times)


def test_a_post_is_too_late_only_when_no_swerve_avoids_it_either(tmp_path):
    """At 20 m/s braking takes 0.87 s before contact, and a metre to the side 0.42 s."""
    situation = prepared(tmp_path, wall(own=20.0, at=120.0, width=0.2))
    late = repair.bound(situation, BoundConfig(kinds=["vehicle"]))["vehicle"]
    assert situation.conflict.contact_time - 0.5 < late.time < situation.conflict.contact_time - 0.2


def narrow_road(width):
    """A standing car that fills the lane but for a way past it, which is road or not."""
    steps = "<time><intervalStart>39</intervalStart><intervalEnd>40</intervalEnd></time>"
    road = lanelet(1, range(-40, 401, 20), [0.0] * 23, width=width)
    wanted = problem(100, state(20.0, 0.0, v=15.0), f"<goalState>{steps}</goalState>")
    return scenario(road=road, obstacles=driving(30, 70.0, 0.0, 0.0, range(1, 81)), problems=wanted)


def test_who_leaves_the_road_has_not_avoided_the_conflict(tmp_path):
    """Where there is road beside the car, a swerve is possible longer than braking."""
    late = {}
    for width in (3.5, 20.0):
        for counts in (True, False):
            settings = BoundConfig(kinds=["vehicle"], road=counts, nodes=1000)
            late[width, counts] = repair.bound(prepared(tmp_path, narrow_road(width)), settings)[
                "vehicle"
            ].time
    assert late[3.5, True] < late[3.5, False] - 0.05
    assert late[20.0, True] == late[20.0, False] == late[3.5, False]


def test_what_is_no_road_is_none_and_lanelets_drawn_askew_are_road(tmp_path):
    import shapely

    from repair.bounds.edges import no_road

    scene = prepared(tmp_path, narrow_road(4.0)).scene
    lane = scene.scenario.lanelet_network.lanelets[0]
    road = shapely.Polygon(np.concatenate((lane.right_vertices, lane.left_vertices[::-1])))
    for margin in (0.0, 0.5):
        pieces = no_road(road, (), np.array([40.0, 0.0]), 30.0, margin)
        polygons = shapely.polygons([shapely.linearrings(p) for p in pieces])
        assert shapely.distance(polygons, road).min() > margin
        assert shapely.area(polygons).sum() > 0.9 * (60.0**2 - 60.0 * (4.0 + 2 * margin))
        assert all(shapely.equals(p, p.convex_hull) for p in polygons)
    other = SimpleNamespace(
        left_vertices=lane.right_vertices - (0.0, 4.0), right_vertices=lane.right_vertices
    )
    pieces = no_road(road, [lane, other], np.array([40.0, 0.0]), 30.0, 0.0)
    beside = shapely.box(20.0, -5.9, 60.0, -2.1)
    assert not any(shapely.intersects(shapely.Polygon(piece), beside) for piece in pieces)


def test_without_a_conflict_there_is_nothing_to_prove(tmp_path):
    found = repair.bound(prepared(tmp_path, wall(at=300.0)))
    assert {b.status for b in found.values()} == {"no_conflict"}
    assert not any(b.proven for b in found.values())


def test_the_limits_of_the_search_say_nothing_where_they_are_off(tmp_path):
    situation = prepared(tmp_path, wall(), "checker.limits=false")
    found = repair.bound(situation)
    assert found["search"].status == "limits_off"
    assert found["vehicle"].proven


class Skidding:
    """A vehicle model of somebody's own, of which nothing is known."""

    def __init__(self, model):
        self.parameters, self.drive = model.parameters, model.drive


def test_of_a_vehicle_model_of_ones_own_nothing_is_known(tmp_path):
    situation = prepared(tmp_path, wall())
    scene = replace(situation.scene, model=Skidding(situation.scene.model))
    found = repair.bound(replace(situation, scene=scene))
    assert {b.status for b in found.values()} == {"model"}


def test_no_time_is_no_proof(tmp_path):
    found = repair.bound(prepared(tmp_path, wall()), BoundConfig(time_limit=0.0, kinds=["vehicle"]))
    assert found["vehicle"].status == "time"
    assert not found["vehicle"].complete
    assert math.isinf(found["vehicle"].time)


def test_fewer_nodes_prove_no_more(tmp_path):
    situation = prepared(tmp_path, wall())
    one, many = (
        repair.bound(situation, BoundConfig(nodes=n, kinds=["vehicle"]))["vehicle"] for n in (1, 200)
    )
    assert one.time > many.time


@pytest.mark.parametrize("last", [-1, 0, 1, 7, 30])
def test_the_earliest_is_found_whatever_it_is(last):
    for first in range(last + 2):
        asked = []

        def proves(k, first=first, asked=asked):
            asked.append(k)
            return k >= first

        assert earliest(last, proves) == (first if first <= last else None)
        assert len(set(asked)) == len(asked)


@pytest.mark.parametrize(
    "seed", [4, 11, *(pytest.param(s, marks=pytest.mark.exhaustive) for s in range(12, 40))]
)
def test_no_motion_is_found_at_or_after_a_bound(tmp_path, seed):
    """Traffic of any shape, speed and step; direct shooting knows nothing of the proof."""
    situation = prepared(tmp_path, crossing(seed).text)
    if not math.isfinite(situation.conflict.time):
        pytest.skip("no conflict")
    end = min(
        situation.t_end, max(situation.conflict.time, min(situation.conflict.contact_time, 100.0)) + 0.5
    )
    for kind, found in repair.bound(situation).items():
        if not found.proven:
            continue
        shooting = Shooting(situation, kind, end)
        for t_rep in {found.time, 0.5 * (found.time + situation.conflict.time)}:
            assert not shooting.best(t_rep, tries=64, rounds=4, seed=seed).free


def test_no_backend_repairs_at_or_after_a_bound(tmp_path):
    config = repair.load_config(
        overrides=[
            "reference.source=constant",
            "search.delta_t=0.25",
            "search.rule=scan",
            "bound.wanted=true",
        ]
    )
    file = tmp_path / "scenario.xml"
    file.write_text(wall(), encoding="utf-8")
    for backend in ("ego", "casadi", "qptr"):
        config.backend = backend
        result = repair.repair(file, config)
        assert set(result.bounds) == set(KINDS)
        latest = max((p.t_rep for p in result.search.probes if p.feasible), default=-1.0)
        assert latest < min(b.time for b in result.bounds.values())
        said = result.to_dict()["bound"]
        assert said["t_bound_s"] == pytest.approx(min(b.time for b in result.bounds.values()))
        assert said["gap_s"] == pytest.approx(said["t_bound_s"] - result.f_ttr)
        assert said["proven_optimal"] is (said["gap_s"] <= 0.25 + 1e-9)


def test_the_same_proof_each_time(tmp_path):
    situation = prepared(tmp_path, crossing(4).text)
    one, two = (repair.bound(situation) for _ in range(2))
    for kind in KINDS:
        assert one[kind].time == two[kind].time
        assert one[kind].nodes == two[kind].nodes
        if one[kind].proof:
            assert one[kind].proof.attempt.tree == two[kind].proof.attempt.tree


def test_the_bound_is_in_the_console(tmp_path, capsys):
    from repair.cli import main

    file = tmp_path / "scenario.xml"
    file.write_text(wall(), encoding="utf-8")
    assert main(["run", str(file), "--reference", "constant", "--bound", "--set", "search.delta_t=0.1"]) == 0
    text = capsys.readouterr().out
    assert "proven too late from" in text
    assert "Gap" in text
    assert not np.isnan(float(text.split("Gap")[1].split()[0]))


# ------------------------------------------------------------------ asked in passing, by a search


def test_a_quick_answer_is_never_earlier_than_the_bound_and_stays(tmp_path):
    situation = prepared(tmp_path, wall())
    late, quick = repair.bound(situation)["search"].time, Quick(situation)
    said = [quick(t) for t in np.arange(0.0, situation.conflict.time, 0.1)]
    assert said == sorted(said)
    assert any(said)
    assert not any(quick(t) for t in np.arange(0.0, late - 0.1, 0.1))
    assert quick(late + 0.05)


def test_the_quick_answers_of_a_grid_are_no_earlier_than_the_bound_and_those_of_one_time(tmp_path):
    situation = prepared(tmp_path, wall())
    late, times = repair.bound(situation)["search"].time, np.arange(0.1, situation.conflict.time, 0.1)
    quick = Quick(situation)
    since = quick.since(times)
    assert late - 0.1 < since < situation.conflict.time
    assert since in times
    assert all(quick(t) for t in times[times >= since])
    assert Quick(situation).since([]) == Quick(situation).since(times[:2]) == np.inf


def test_a_quick_answer_is_no_where_no_limit_is_claimed_and_after_the_conflict(tmp_path):
    situation = prepared(tmp_path, wall())
    assert Quick(situation)(situation.conflict.time - 0.1)
    assert not Quick(situation)(situation.conflict.time + 0.1)
    situation = prepared(tmp_path, wall(), "checker.limits=false")
    assert not Quick(situation)(situation.conflict.time - 0.1)


@pytest.mark.parametrize("rule", ["scan", "bisect"])
def test_proofs_leave_out_what_finds_nothing_and_change_no_answer(tmp_path, rule):
    keys = ["backend=casadi", "fallback=[]", "search.delta_t=0.2", f"search.rule={rule}"]
    found = {}
    for proofs in (True, False):
        situation = prepared(tmp_path, wall(), *keys, f"search.proofs={proofs}")
        found[proofs] = find(situation, make_backend("casadi", situation.config))
    assert found[True].f_ttr == found[False].f_ttr > 0.0
    assert [(p.t_rep, p.feasible) for p in found[True].probes] == [
        (p.t_rep, p.feasible) for p in found[False].probes
    ]
    left_out = [[any("proven" in text for text in p.tried) for p in found[k].probes] for k in (True, False)]
    assert any(left_out[0])
    assert not any(left_out[1])


def test_a_search_does_not_hang_on_what_was_searched_before(tmp_path):
    keys = ["backend=casadi", "fallback=[]", "search.delta_t=0.2", "search.rule=scan"]
    situation = prepared(tmp_path, wall(), *keys)
    backend = make_backend("casadi", situation.config)
    once, again = (find(situation, backend) for _ in range(2))
    coarse = find(situation, backend, settings=replace(situation.config.search, delta_t=0.4))
    assert [p.tried for p in once.probes] == [p.tried for p in again.probes]
    assert [p.tried for p in once.probes][::2] == [p.tried for p in coarse.probes]
