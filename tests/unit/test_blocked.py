"""Times-to-repair that are nearly too late: where no speed is of use, and where brakes at once still are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import roads, toy

import repair
from repair.api import find
from repair.backend.base import Capabilities, SolveResult, SolveStatus
from repair.certify.recompute import certify
from repair.check.checker import Checker
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.config import load_config
from repair.preparation import prepare
from repair.problem.problem import Maneuver, Passing
from repair.scene.commonroad import load_scene
from repair.search.result import Like, Probe
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig
from repair.solvers.registry import make_backend

BEND = roads.bend(40.0, 160.0)
KEYS = ("reference.source=constant", "repair.lateral=none", "fallback=[]", "checker.official=never")


def standing(x, y, heading):
    states = "".join(
        roads.state(x, y, heading=heading, v=0.0, k=k, tag="state") for k in range(1, 41)
    )  # fmt: skip
    start = roads.state(x, y, heading=heading, v=0.0)
    return roads.car(30, start, f"<trajectory>{states}</trajectory>")


def crossing(x, y, v):
    states = "".join(
        roads.state(x, y + 0.1 * k * v, heading=np.pi / 2, v=v, k=k, tag="state") for k in range(1, 41)
    )  # fmt: skip
    start = roads.state(x, y, heading=np.pi / 2, v=v)
    return roads.car(30, start, f"<trajectory>{states}</trajectory>")


SITUATIONS = {
    "slower ahead": {},
    "standing in a bend": {
        "road": roads.strip(1, BEND),
        "obstacles": standing(30.0 + 40.0 * np.sin(0.5), 40.0 - 40.0 * np.cos(0.5), 0.5),
    },
    "crossing": {"obstacles": crossing(46.0, -9.0, 4.0)},
    "grazed": {"obstacles": roads.driving(30, 45.0, 1.75, 2.0)},  # within the margin by centimetres
}


def laid_out(tmp_path_factory, name, *keys):
    path = tmp_path_factory.mktemp("blocked") / "scenario.xml"
    path.write_text(roads.scenario(**SITUATIONS[name]), encoding="utf-8")
    config = load_config(backend="casadi", overrides=[*KEYS, "casadi.helpers=[]", *keys])
    return prepare(load_scene(path, config), config)


def times(prepared):
    return 0.1 * np.arange(1 + round(prepared.conflict.time / 0.1))


def speeds(rng, limits, speed, t):
    """Speeds (K,) at times after t_rep that keep the limits: full brakes, full throttle, and in between."""
    switches = np.sort(rng.uniform(0.0, 2.5, 2))
    share = rng.choice([0.0, 0.0, rng.uniform(), 1.0, 1.0], 3)
    braking = limits.a_min + share * (limits.a_max - limits.a_min)
    acceleration = braking[np.searchsorted(switches, t)]
    return np.maximum(speed + np.append(0.0, np.cumsum(acceleration[:-1] * np.diff(t))), 0.0)


@pytest.mark.parametrize("name", list(SITUATIONS))
def test_where_the_path_is_blocked_whoever_keeps_to_it_meets_somebody(tmp_path_factory, name):
    """By motions along the path that are drawn at random, held against all obstacles at all samples."""
    prepared = laid_out(tmp_path_factory, name)
    checker, reference, t_end = prepared.checker, prepared.reference, prepared.t_end
    states, rng = checker.drive(reference, t_end), np.random.default_rng(8)
    way = np.append(0.0, np.cumsum(np.hypot(np.diff(states.x), np.diff(states.y))))
    rate = way[1] / states.t[1]
    said = {}
    for t_rep in times(prepared):
        problem = prepared.judged_at(float(t_rep))
        found = said[float(t_rep)] = checker.blocked(problem)
        if found is None:
            continue
        assert (found.reason, found.obstacle_id) == (Reason.COLLISION, 30)
        assert t_rep < found.time <= t_end + 1e-9
        first = round(t_rep / 0.1) * checker.config.substeps
        until = round(found.time / 0.1) * checker.config.substeps + 1
        t = states.t[first:until] - states.t[first]
        for _ in range(60):
            v = speeds(rng, checker.limits, rate, t)
            at = way[first] + np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)))
            assert at[-1] < way[-1]
            x, y, turned = (np.interp(at, way, c) for c in (states.x, states.y, states.orientation))
            met = checker.world.contact_along(
                x + 1j * y, turned, first, margin=checker.config.clearance, all_pairs=True
            )
            assert met is not None, (t_rep, found)
    blocked = [t for t, found in said.items() if found is not None]
    assert blocked if name != "grazed" else not blocked
    assert said[0.0] is None


def test_who_may_exceed_the_limits_is_never_blocked(tmp_path_factory):
    prepared = laid_out(tmp_path_factory, "slower ahead")
    late = prepared.judged_at(float(times(prepared)[-2]))
    assert prepared.checker.blocked(late) is not None
    without = Checker(
        prepared.scene, prepared.checker.limits, replace(prepared.checker.config, limits=False)
    )  # fmt: skip
    assert without.blocked(late) is None


@pytest.mark.parametrize("backend", ["ego", "casadi"])
@pytest.mark.parametrize("name", list(SITUATIONS))
def test_not_to_ask_changes_no_answer(tmp_path_factory, monkeypatch, name, backend):
    config = load_config(
        backend=backend, overrides=[*KEYS, "search.delta_t=0.1", "search.rule=scan", "fallback=[]"]
    )
    prepared = laid_out(tmp_path_factory, name)
    like = Like(Probe(0.0, SolveResult(SolveStatus.INFEASIBLE), Verdict()))

    def answer():
        found = find(prepared, make_backend(backend, config), settings=config.search, like=like)
        return found, [(p.t_rep, p.feasible) for p in found.probes]

    found, each = answer()
    assert any(probe.solve.detail.startswith("not asked") for probe in found.probes) == (name != "grazed")
    monkeypatch.setattr(Checker, "blocked", lambda self, problem: None)
    without, every = answer()
    assert not any(probe.solve.detail.startswith("not asked") for probe in without.probes)
    assert each == every
    assert (found.status, found.f_ttr) == (without.status, without.f_ttr)


# -- who is asked ----------------------------------------------------------------------------------------


class Asked:
    """Finds nothing, and counts how often it is asked."""

    name = "asked"

    def __init__(self, **can):
        self.capabilities, self.margins = Capabilities(**can), []

    def solve(self, problem, *, warm_start=None, time_limit=None):
        self.margins.append(problem.margin)
        return SolveResult(SolveStatus.INFEASIBLE)


class Source:
    """A way that is kept and not open, as it is and with smaller margins, for which it is."""

    notches = ((0.3,), (), ())

    def __init__(self, **keys):
        self.keys = {"misses": 20.0, "strict": False, "lateral": False, **keys}

    def at(self, t_rep, margin=0.1):
        guide = toy.constant().sample(np.arange(3.0))
        passing = Passing(
            Maneuver.YIELD, guide, np.zeros((0, 3), dtype=np.int8), 0.0, margin < 0.0, self.keys["misses"]
        )  # fmt: skip
        made = toy.problem((), t_rep=t_rep, t_end=t_rep + 2.0, passing=passing, margin=margin)
        return (replace(made, strict=self.keys["strict"], lateral=self.keys["lateral"]),)

    def relaxed(self, t_rep):
        return [self.at(t_rep, -0.5)]

    def widened(self, t_rep):
        return ()


class Blocking(toy.Judging):
    """A checker that counts how often it is asked whether the path is blocked."""

    times = 0

    def check(self, problem, curve):
        return Verdict()

    def blocked(self, problem):
        self.times += 1
        return Violation(Reason.COLLISION, 1.0, "obstacle 7, wherever it is by then", 7)


def asked(source=None, *, like=None, **can):
    backend, checker = Asked(**{"relaxes": True, "keeps_path": True, **can}), Blocking()
    found = search_f_ttr(
        source or Source(), Conflict(0.05, "margin", 7, 0.1), backend, checker, SearchConfig(), like=like
    )
    return found.probes[0], backend.margins, checker.times


def test_one_that_is_blocked_is_asked_with_no_margin():
    probe, margins, times = asked()
    assert (margins, times) == ([], 1)
    assert not probe.feasible
    assert probe.solve.detail == "not asked: obstacle 7, wherever it is by then"
    assert probe.tried == ("yield: collision",)


@pytest.mark.parametrize(
    "source, can",
    [
        (Source(lateral=True), {}),  # it may go aside
        (Source(strict=True), {}),  # as the paper asks
        (Source(misses=0.5), {}),  # hardly ever blocked
        (None, {"keeps_path": False}),
        (None, {"relaxes": False}),  # its curves show what comes of it
    ],
)
def test_others_are_asked(source, can):
    probe, margins, times = asked(source, **can)
    assert times == 0
    assert margins
    assert not probe.solve.detail.startswith("not asked")


def test_what_a_helper_has_found_is_asked_all_the_same():
    """It may go aside whatever it is called: who is shown it is asked, though the path is blocked."""
    curve = toy.constant(10.0)

    class Shows:
        name, capabilities = "shows", Capabilities(own_way=True)

        def solve(self, problem, *, warm_start=None, time_limit=None):
            return SolveResult(SolveStatus.SOLVED, curve=curve, objective=1.0)

    class Helped(Source):
        def without_guide(self, t_rep):
            return [replace(self.at(t_rep)[0], passing=None)]

        def along(self, manoeuvre, kind, *, jumps=False):
            return self.at(manoeuvre.t_start)[0]

    probe, margins, _ = asked(Helped(), helpers={"shows": Shows})
    assert margins == [0.1]
    assert probe.tried[0] == "yield: collision"


def test_in_cycles_soft_ones_are_not_asked_either():
    like = Like(Probe(0.0, SolveResult(SolveStatus.INFEASIBLE), Verdict()))
    assert asked(relaxes=False, like=like)[1:] == ([], 1)


# -- begun at once -----------------------------------------------------------------------------------------


def test_who_brakes_at_once_is_later_and_certified(tmp_path, monkeypatch):
    file, folder = tmp_path / "scenario.xml", tmp_path / "out"
    file.write_text(roads.scenario(), encoding="utf-8")
    keys = [*KEYS, "casadi.helpers=[]", "casadi.solver=sqpmethod", "search.delta_t=0.1"]

    def answer():
        return repair.repair(file, backend="casadi", overrides=keys)

    found = answer()
    assert found.search.best.jump > 5.0
    found.save(folder, figure=False)
    certificate = certify(folder)
    assert certificate.ok
    assert [row.name for row in certificate.rows if row.claim and not row.ok] == []
    monkeypatch.setattr("repair.search.visit.probe_begun", lambda probe, *others: probe)
    without = answer()
    assert without.search.best.jump == 0.0
    assert found.f_ttr > without.f_ttr
