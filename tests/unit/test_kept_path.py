"""Who keeps the path of a reference that is not on the frame's axis keeps to it by place, not by time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import roads, toy

import repair
from repair.curves.bspline import UniformBSpline
from repair.preparation import among
from repair.problem.lateral import LastPath, aside_at, kept_path, path_of
from repair.reference.profile import SpeedProfile
from repair.solvers.casadi.backend import CasadiBackend
from repair.solvers.casadi.instance import lay_out
from repair.solvers.casadi.model import build_model
from repair.solvers.casadi.separation import separate


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Return a straight road, and nobody on it."""
    file = tmp_path_factory.mktemp("road") / "ZAM_Test-1_1_T-1.xml"
    file.write_text(roads.scenario(), encoding="utf-8")
    return repair.load_scene(file)


def winding(scene):
    """A plan that swings by a few centimetres about the middle of the road."""
    t = np.arange(0.0, 4.0 + 1e-9, scene.dt)
    x = scene.initial_state.x + scene.initial_state.velocity * t
    y = scene.initial_state.y + 0.05 * (1.0 - np.cos(2.0 * np.pi * (x - x[0]) / 9.0))
    return np.column_stack([t, x, y])


def wall(scene, ahead):
    """All across the road: there is nothing but to stop."""
    place = [scene.initial_state.x + ahead, scene.initial_state.y, 0.0]
    return repair.Prediction(7, np.tile(place, (41, 1)), 1.0, 3.4)


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_who_stands_does_not_slide(scene, backend):
    watch = repair.Repairer(scene, backend=backend, overrides=["repair.lateral=none"])
    cycle = watch.update(winding(scene), traffic=[wall(scene, 27.0)])
    assert cycle.status == "found"
    assert cycle.f_ttr > 0.0
    t = np.arange(cycle.f_ttr, cycle.prepared.t_end, 0.01)
    reference = cycle.prepared.reference.sample(np.arange(0.0, 4.0, 0.01)).position
    assert np.ptp(reference[:, 1]) > 0.02  # else nothing is seen here
    driven = cycle.curve.sample(t)
    path = np.interp(driven.position[:, 0], reference[:, 0], reference[:, 1])
    assert np.abs(driven.position[:, 1] - path).max() < 0.012
    standing = driven.velocity[:, 0] < 1e-4
    assert standing.any()
    assert np.abs(driven.velocity[standing, 1]).max() < 0.01  # a standstill to every check


def test_a_reference_on_the_axis_changes_nothing(scene):
    prepared = repair.repair(scene, overrides=["reference.source=constant"]).prepared
    problem = prepared.source.plain(0.4)
    points = np.column_stack([np.linspace(0.0, 20.0, 12), np.zeros(12)])
    assert aside_at(problem, points[:, 0]) is None
    assert kept_path(problem, points, 3, 0.4) is points


def test_what_was_asked_last_is_not_the_answer_to_something_else(scene):
    last = LastPath()
    first, second = (
        repair.repair(scene, reference=winding(scene), backend="qptr").prepared.reference for _ in "ab"
    )
    assert first is not second
    for reference, since in ((first, 0.0), (first, 0.0), (first, 0.3), (second, 0.3), (first, 0.3)):
        for known, fresh in zip(last(reference, since), path_of(reference, since), strict=True):
            np.testing.assert_array_equal(known, fresh)


def test_boxes_are_those_of_the_whole_as_long_as_somebody_asks(scene):
    """A cycle makes those within reach until its repairs end; each problem is the same among all of them."""
    watch = repair.Repairer(scene, backend="ego", overrides=["repair.after_conflict=1.0"])
    walker = np.column_stack([np.linspace(25.0, 5.0, 41), np.full(41, 0.3), np.full(41, np.pi)])
    walker[:, :2] += scene.initial_state.x, scene.initial_state.y
    traffic = [wall(scene, 27.0), repair.Prediction(8, walker, 0.8, 0.6)]
    prepared = watch.update(winding(scene), traffic=traffic).prepared
    whole, made = among(prepared, prepared.scene.obstacles).occupancy, prepared.occupancy
    asked = whole.t <= prepared.t_end + 0.2
    assert asked.sum() < len(asked) - 5  # else nothing is left out
    known = np.isfinite(made.lower).all(axis=-1)
    for some, all_of_them in ((made.lower, whole.lower), (made.upper, whole.upper)):
        # Outlines are projected in blocks, and sums over blocks of another length are rounded differently.
        np.testing.assert_allclose(some[known], all_of_them[known], rtol=0.0, atol=1e-12)
    assert known[:, asked][:, -1].all()
    assert not known[:, -1].any()


def test_a_plan_that_is_projected_already_is_the_same_reference(scene):
    watch = repair.Repairer(scene, backend="ego")
    for _ in range(2):  # the second one is in the frame of the first
        prepared = watch.update(winding(scene), traffic=[wall(scene, 27.0)]).prepared
    given = prepared.given
    assert given.places is not None
    made, fresh = (one.curve(prepared.scene) for one in (given, replace(given, places=None)))
    np.testing.assert_array_equal(made.points, fresh.points)
    elsewhere = replace(given, places=(None, given.places[1] + 5.0))  # of another frame
    np.testing.assert_array_equal(elsewhere.curve(prepared.scene).points, fresh.points)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("fast", [1.0, 80.0], ids=["slow", "across it from one step to the next"])
def test_who_keeps_the_path_leaves_out_whom_it_never_meets(monkeypatch, seed, fast):
    rng = np.random.default_rng(seed)
    s = np.arange(40) * 2.0 * (1.0 - 0.01 * np.arange(40))
    reference = UniformBSpline(0.0, 0.2, 3, np.column_stack([s, 0.6 * np.sin(s / rng.uniform(3.0, 9.0))]))
    boxes = [toy.box((30.0, 35.0), (-1.0, 1.0))]
    for a, b in rng.uniform((12.0, -9.0), (50.0, 7.0), (12, 2)):
        v, w = rng.uniform(-2.0, 2.0, 2) * (1.0, fast)
        b -= w * 2.0 * (fast > 1.0)  # at b after 2 s
        boxes.append(toy.box((a, a + 5.0), (b, b + 2.0), (v, w), sorted(rng.uniform(-2.0, 6.0, 2))))
    problem = toy.problem(boxes, t_rep=0.4, t_end=4.4, reference=reference, lateral=False)
    model = build_model(CasadiBackend().structure(problem))
    near, points = lay_out(problem, model)
    monkeypatch.setattr("repair.solvers.casadi.instance.meeting", lambda problem, *_: problem)
    every, _ = lay_out(problem, model)
    assert len(near.problem.occupancy) < len(every.problem.occupancy) == len(boxes)
    for share in (1.0, 0.6, 0.2):  # whatever the speed
        slower = points.copy()
        slower[3:, 0] = points[2, 0] + share * (points[3:, 0] - points[2, 0])
        shape = every.shape(every.on_path(slower))
        found, same = (
            separate(one.problem, one.windows, len(model.obstacle), shape, None, boxes=one.boxes)
            for one in (near, every)
        )
        assert found.why or np.isfinite((found.lower, found.upper)).any()
        assert found.why == same.why
        assert np.array_equal(found.lower, same.lower)
        assert np.array_equal(found.upper, same.upper)


def test_a_profile_along_the_axis_says_so_itself(monkeypatch):
    profile = SpeedProfile.from_accelerations(3.0, 8.0, [1.0, 2.5], [-2.0, 1.0])
    assert not profile.sample(np.linspace(-1.0, 5.0, 61)).position[:, 1].any()
    monkeypatch.setattr(SpeedProfile, "sample", None)
    assert path_of(profile, 0.5) is None
