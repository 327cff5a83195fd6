"""The checker on a straight road: what it keeps and skips changes no verdict."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from tests import roads

from repair import check
from repair.arrays import frozen
from repair.check.checker import Checker
from repair.check.limits import as_violation, curve_excess, plane_excess
from repair.check.settings import CheckerConfig, sampled
from repair.check.verdict import Reason, Violation
from repair.config import load_config
from repair.curves.base import SplicedCurve
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.curves.sampling import finer
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.world.occupancy import first_entry


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A slower car ahead on one lane."""
    path = tmp_path_factory.mktemp("road") / "scenario.xml"
    path.write_text(roads.scenario(), encoding="utf-8")
    overrides = ["reference.source=constant", "checker.official=never", "checker.margin=true"]
    return prepare(load_scene(path), load_config(overrides=overrides))


def curves(prepared, problem, n, seed):
    """Curves from ``problem.start`` on that brake and swerve, gently or not."""
    rng = np.random.default_rng(seed)
    count = max(int(np.ceil((problem.t_end - problem.t_rep) / 0.4 - 1e-9)), 1) + 3
    along = fit_to_curve(prepared.reference, problem.t_rep, count, 3, 0.4)
    for _ in range(n):
        points = np.array(along.points)
        past = np.arange(1, count - 2)
        points[3:, 0] -= 0.08 * rng.choice([2.5, 8.0]) * rng.uniform(0.7, 1) * past**2
        points[3:, 1] += rng.choice([0.0, 0.05, 0.5]) * rng.normal() * past
        yield UniformBSpline(problem.t_rep, 0.4, 3, frozen(points))


def judged_in_full(checker, problem, curve):
    """The verdict's words by the full tests alone, on the curve spliced as everybody else does."""
    spliced = SplicedCurve(problem.reference, curve, problem.t_rep)
    times = checker.times(problem.t_end)
    first = max(int(problem.t_rep / checker.scene.dt + 1e-6) - 1, 0) * checker.config.substeps
    states = checker.drive(spliced, problem.t_end)
    late = slice(first, None)
    words = []
    scene, after = checker.scene, curve.sample(times[times >= problem.t_rep - 1e-9])
    broken = curve_excess(curve, problem.t_rep, problem.t_end, checker.limits, 0.0)
    if broken or plane_excess(curve, after, scene.frame, checker.limits, scene.vehicle, 0.0):
        words.append("limits")
    steps = times[:: checker.config.substeps]
    if first_entry(problem.occupancy, curve.sample(steps[steps >= problem.t_rep - 1e-9])) is not None:
        words.append("margin")
    poses = states.x[late], states.y[late], states.orientation[late]
    here, turn = poses[0] + 1j * poses[1], poses[2]
    since = len(times) - len(after) - first
    contact = checker.world.contact_along(here, turn, first, all_pairs=True)
    near = checker.world.contact_along(
        here, turn, first, margin=checker.config.clearance, since=since, all_pairs=True
    )
    if contact is not None and (near is None or contact.time <= near.time):
        words.append("collision")
    elif near is not None:
        words.append("margin")
    if not checker.road.inside(checker.road.outline(*poses)).all():
        words.append("off_road")
    return tuple(words)


@pytest.mark.parametrize("t_rep", [0.0, 0.1, 0.25, 1.6])
def test_short_cuts_change_no_verdict(prepared, t_rep):
    problem = replace(prepared.source.at(0.0)[0], t_rep=t_rep)
    seen = set()
    for curve in curves(prepared, problem, 40, 3):
        found = prepared.checker.check(problem, curve).reasons
        assert tuple(word for word in found if word != "kinematics") == judged_in_full(
            prepared.checker, problem, curve
        )
        seen.update(found or ("ok",))
    assert {"limits", "off_road"} <= seen
    assert ("ok" in seen) == (t_rep < 1.0)  # later it is too late


@pytest.mark.parametrize("t_rep", [0.0, 0.25, 1.6])
def test_asked_for_the_traffic_alone_it_says_the_same_of_it(prepared, t_rep):
    problem, seen = replace(prepared.source.at(0.0)[0], t_rep=t_rep), set()
    checker = Checker(
        prepared.scene, prepared.checker.limits, replace(prepared.checker.config, margin=False),
        prepared.checker.reference_limits,
    )  # fmt: skip
    for curve in curves(prepared, problem, 40, 5):
        of_traffic = [
            found
            for found in checker.check(problem, curve).violations
            if found.reason in (Reason.COLLISION, Reason.MARGIN)
        ]
        assert next(iter(of_traffic), None) == checker.refuses_traffic(problem, curve)
        seen.add(bool(of_traffic))
    assert True in seen


def test_which_limits_are_broken_most_is_worked_out_for_who_reads_it(prepared, monkeypatch):
    problem, scene, looked = prepared.source.at(0.0)[0], prepared.scene, []
    monkeypatch.setattr(check.limits, "finer", lambda *asked: looked.append(1) or finer(*asked))
    verdicts = [(curve, prepared.checker.check(problem, curve)) for curve in curves(prepared, problem, 40, 3)]
    broken = [(c, v) for c, verdict in verdicts for v in verdict.violations if v.reason is Reason.LIMITS]
    assert len(broken) > 5
    before, times = len(looked), prepared.checker.times(problem.t_end)
    for curve, found in broken:
        limits = prepared.checker.limits
        words = curve_excess(curve, 0.0, problem.t_end, limits, prepared.checker.config.tolerance)
        words += plane_excess(
            curve, curve.sample(times), scene.frame, limits, scene.vehicle, prepared.checker.config.tolerance
        )
        assert [found] == as_violation(words)
    assert len(looked) > before


def test_where_the_road_is_left_is_worked_out_for_who_reads_it(prepared, monkeypatch):
    problem, asked = prepared.source.at(0.0)[0], []
    road, words = prepared.checker.road, type(prepared.checker.road).departure
    monkeypatch.setattr(type(road), "departure", lambda *pose: asked.append(pose[1:]) or words(*pose))
    verdicts = [prepared.checker.check(problem, curve) for curve in curves(prepared, problem, 40, 3)]
    left = [v for verdict in verdicts for v in verdict.violations if v.reason is Reason.OFF_ROAD]
    assert len(left) > 3
    assert not asked
    for found in left:
        plain = Violation(found.reason, found.time, found.detail, None, found.place)
        assert found.detail.startswith("the ego ")
        assert (plain, hash(plain)) == (found, hash(found))
        assert found != Violation(found.reason, found.time)
        sent = pickle.loads(pickle.dumps(found))
        assert type(sent) is Violation
        assert sent == found
    assert len(asked) == len(left)


@pytest.mark.parametrize("share", [0.1, 0.9])
def test_what_is_looked_at_every_millisecond_is_looked_at_once(share):
    times = 0.4 + 0.025 * np.arange(60)
    chosen = np.random.default_rng(1).random(59) < share
    each = [np.linspace(begin, begin + 0.025, 26) for begin in times[:-1][chosen]]
    wanted = np.unique(np.round(each, 6))
    found = finer(times, chosen, 1e-3)
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() < 1e-9


def test_what_is_kept_of_one_reference_is_not_used_for_another(prepared):
    checker = Checker(prepared.scene, prepared.limits, prepared.checker.config)
    problem = prepared.source.at(0.8)[0]
    curve = next(curves(prepared, problem, 1, 0))
    other = replace(problem, reference=fit_to_curve(prepared.reference, 0.0, 20, 3, 0.5))
    for asked in (problem, other, replace(problem, t_end=problem.t_end - 1.0), problem):
        fresh = Checker(prepared.scene, prepared.limits, prepared.checker.config)
        assert checker.check(asked, curve) == fresh.check(asked, curve)


def test_a_reference_is_followed_once(prepared):
    """What is kept of it serves every repair that leaves it, until another one is asked about."""

    class Counted:
        def __init__(self, curve):
            self.curve, self.asked = curve, 0
            self.t_start, self.t_end = curve.t_start, curve.t_end

        def sample(self, t):
            self.asked += 1
            return self.curve.sample(t)

    checker = Checker(prepared.scene, prepared.limits, prepared.checker.config)
    first, second = Counted(prepared.reference), Counted(fit_to_curve(prepared.reference, 0.0, 20, 3, 0.5))
    problem = prepared.source.at(0.8)[0]
    curve = next(curves(prepared, problem, 1, 0))
    shorter = replace(problem, t_end=problem.t_end - 1.0)
    counts = []
    for asked, reference in (
        (problem, first), (problem, first), (shorter, first), (problem, second), (problem, second),
        (problem, first),
    ):  # fmt: skip
        checker.check(replace(asked, reference=reference), curve)
        counts.append((first.asked, second.asked))
    assert counts == [(1, 0), (1, 0), (1, 0), (1, 1), (1, 1), (2, 1)]
    # From the start on nothing of it is looked at.
    checker.check(replace(problem, t_rep=0.0, reference=second), next(curves(prepared, problem, 1, 0)))
    assert second.asked == 1


def test_times_are_the_scenario_steps_and_what_lies_between(prepared):
    times = prepared.checker.times(0.25)
    assert times == pytest.approx(np.arange(9) * 0.025)
    assert len(prepared.checker.times(1e9)) == prepared.scene.n_steps * 4 + 1
    with pytest.raises(ValueError, match="read-only"):
        times[0] = 1.0


@pytest.mark.parametrize(
    "dt, substeps, expected",
    [
        (0.1, 4, 4),
        (0.04, 4, 4),
        (0.04, 10, 10),
        (0.02, 4, 2),
        (0.01, 4, 1),
        (0.01, 10, 3),
        (1e-3, 4, 1),
        (0.5, 4, 8),
    ],
)
def test_a_short_step_is_no_reason_to_look_more_often(dt, substeps, expected):
    """Each step is looked at; in between as often as a step of 0.04 s has it, and longer ones more often."""
    assert sampled(CheckerConfig(substeps=substeps), dt).substeps == expected


def test_a_curve_that_is_not_finite_is_no_trajectory(prepared):
    problem = prepared.source.at(0.4)[0]
    curve = next(curves(prepared, problem, 1, 0))
    for bad in (np.nan, np.inf):
        points = np.array(curve.points)
        points[5, 0] = bad
        with np.errstate(invalid="ignore"):
            verdict = prepared.checker.check(problem, replace(curve, points=points))
        assert verdict.reasons == ("kinematics",)
        assert "not finite" in verdict.violations[0].detail


def test_a_speed_that_is_not_a_number_is_no_trajectory(prepared):
    """At one sample between two steps, where only the limits look."""
    problem = prepared.source.at(0.0)[0]
    good = next(curves(prepared, problem, 1, 0))

    class Holed:
        t_start, t_end = good.t_start, good.t_end

        def sample(self, t):
            found = good.sample(t)
            velocity = np.array(found.velocity)
            velocity[(np.abs(found.t - 0.525) < 1e-9)] = np.nan
            return replace(found, velocity=velocity)

    assert prepared.checker.check(problem, Holed()).reasons == ("kinematics",)
