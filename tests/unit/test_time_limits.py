"""Time limits bind: nothing that cannot be interrupted begins where there is no time for it."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from tests import toy
from tests.contract import problems
from tests.unit.test_casadi import bend
from tests.unit.test_search import FakeBackend, FakeChecker, FakeSource, search

from repair.backend.base import SolveStatus
from repair.check.verdict import Verdict
from repair.deadline import Estimate, OutOfTime, held, in_time, limited, time_left, until
from repair.search.result import SearchStatus
from repair.solvers.casadi import model as models
from repair.solvers.casadi.backend import WINDOW, CasadiBackend
from repair.solvers.casadi.settings import CasadiConfig
from repair.vehicle import commonroad_ks
from repair.vehicle.commonroad_ks import load_official, official_check
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.states import DrivenStates

# -- the deadline ------------------------------------------------------------------------------------


def test_without_a_deadline_there_is_always_time():
    assert not limited()
    assert time_left() == np.inf
    in_time(1e9)


def test_the_earlier_deadline_holds_and_goes_with_its_block():
    now = time.perf_counter()
    with until(now + 100.0):
        with until(None):
            assert 99.0 < time_left() <= 100.0
        with until(now + 200.0):
            assert time_left() <= 100.0
        with until(now - 1.0):
            assert time_left() == 0.0
            with pytest.raises(OutOfTime):
                in_time()
        in_time(50.0)
        with pytest.raises(OutOfTime, match=r"the NLP takes about 150\.00 s"):
            in_time(150.0, "the NLP")
    assert not limited()


def test_a_deadline_is_its_threads_own():
    seen = []
    with until(time.perf_counter() + 1.0):
        thread = threading.Thread(target=lambda: seen.append(limited()))
        thread.start()
        thread.join()
    assert seen == [False]


def test_a_lock_is_waited_for_until_the_deadline():
    lock = threading.Lock()
    with held(lock), until(time.perf_counter() + 0.02), pytest.raises(OutOfTime), held(lock):
        pass
    assert not lock.locked()
    with until(time.perf_counter() - 1.0), held(lock):  # it is free
        pass


def test_an_estimate_follows_what_was_seen():
    estimate = Estimate(1.0)
    assert estimate.of(2.0) == pytest.approx(2.5)
    with estimate.watch(1e-3):
        end = time.thread_time() + 0.01
        while time.thread_time() < end:
            pass
    first = estimate.rate
    assert first >= 10.0
    with estimate.watch(1e9):
        pass
    assert estimate.rate == pytest.approx(0.8 * first)


# -- the search --------------------------------------------------------------------------------------


def test_a_check_that_is_out_of_time_is_no_verdict():
    class Late(FakeChecker):
        def check(self, problem, curve):
            in_time(100.0)
            return Verdict()

    result = search(Late(None), time_limit=5.0, rule="bisect")
    assert result.status is SearchStatus.BUDGET_EXHAUSTED
    assert not result.complete
    (probe,) = result.probes
    assert not probe.feasible
    assert probe.solve.status is SolveStatus.TIME_LIMIT
    assert probe.solve.curve is None
    assert "no time was left to judge it" in probe.verdict.violations[0].detail


def test_a_feasible_side_stays_where_the_next_one_is_out_of_time():
    asked = []

    class Late(FakeChecker):
        def check(self, problem, curve):
            asked.append(problem)
            in_time(100.0 if len(asked) == 2 else 0.0)
            return Verdict()

    both = FakeSource((problems.Maneuver.YIELD, problems.Maneuver.LEFT))
    result = search(Late(None), 0.3, source=both, time_limit=5.0, rule="scan", delta_t=0.4)
    assert (result.status, result.f_ttr) == (SearchStatus.FOUND, 0.0)


def test_problems_that_are_not_made_in_time_end_the_search():
    class Slow(FakeSource):
        def at(self, t_rep):
            in_time(100.0 if t_rep > 0.0 else 0.0)
            return super().at(t_rep)

    yes = FakeChecker(lambda problem: True)
    result = search(yes, source=Slow(), time_limit=5.0, rule="bisect")
    assert (result.status, result.f_ttr, result.complete) == (SearchStatus.FOUND, 0.0, False)
    guided = search(yes, source=Slow(), time_limit=5.0, rule="guided")
    assert not guided.complete or guided.f_ttr == 0.0


def test_a_backend_that_lets_it_through_was_out_of_time():
    def late():
        raise OutOfTime("something in it")

    result = search(FakeChecker(lambda problem: True), backend=FakeBackend(on_solve=late), time_limit=5.0)
    assert result.status is SearchStatus.BUDGET_EXHAUSTED
    assert result.probes[0].solve.status is SolveStatus.TIME_LIMIT


def test_nobody_sees_the_deadline_between_two_probes():
    seen = []
    yes = FakeChecker(lambda problem: True)
    search(yes, time_limit=5.0, on_probe=lambda probe: seen.append(limited()))
    assert seen
    assert not any(seen)


# -- casadi ------------------------------------------------------------------------------------------


@pytest.fixture
def fresh(monkeypatch):
    """No models are kept, and none was ever made."""
    pytest.importorskip("casadi")
    models.build_model.cache_clear()
    monkeypatch.setattr(models, "_LAID_OUT", Estimate(models._LAID_OUT.rate))
    monkeypatch.setattr(models, "_MADE", {key: Estimate(value.rate) for key, value in models._MADE.items()})


@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("solver", ["ipopt", "sqpmethod"])
def test_an_nlp_is_not_made_where_there_is_no_time_for_it(solver, monkeypatch):
    made = []
    make = models.make_nlp
    monkeypatch.setattr(models, "make_nlp", lambda *a: made.append(a) or make(*a))
    for estimate in models._MADE.values():
        estimate.rate = 1.0
    problem = bend()  # one that the linear rows do not answer
    backend = CasadiBackend(CasadiConfig(solver=solver))
    begin = time.perf_counter()
    result = backend.solve(problem, time_limit=1.0)
    assert time.perf_counter() - begin < 1.0
    assert made == []
    assert result.status is SolveStatus.TIME_LIMIT
    assert "making the NLP takes about" in result.detail
    assert backend.solve(problem).status is SolveStatus.SOLVED  # and without a limit it is


@pytest.mark.usefixtures("fresh")
def test_a_model_is_not_laid_out_where_there_is_no_time_for_it():
    models._LAID_OUT.rate = 1.0
    result = CasadiBackend().solve(problems.static_block(), time_limit=0.5)
    assert result.status is SolveStatus.TIME_LIMIT
    assert "the model takes about" in result.detail
    assert models.build_model.cache_info().currsize == 0


@pytest.mark.usefixtures("fresh")
def test_a_model_that_another_thread_uses_is_not_waited_for():
    problem = problems.static_block()
    backend = CasadiBackend()
    model = models.build_model(backend.structure(problem, timed=True))
    with model._lock:
        result = backend.solve(problem, time_limit=0.05)
    assert result.status is SolveStatus.TIME_LIMIT


def test_windows_do_not_multiply_with_the_scenarios_steps():
    backend = CasadiBackend(spacing=0.2)
    problem = toy.problem(())
    for dt, count in ((0.25, 1), (0.2, 1), (0.1, 2), (0.05, 2), (0.04, 2), (0.01, 2)):
        assert backend.structure(replace(problem, dt=dt)).windows == count
    assert CasadiBackend(spacing=0.4).structure(replace(problem, dt=0.1)).windows == 4
    assert WINDOW == 0.1


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.04, 0.1])
def test_fine_steps_cost_no_room(dt):
    """Behind a box that brakes: a covering line over 0.1 s is a hair wider than those over 0.01 s."""
    pytest.importorskip("casadi")
    t = np.arange(round(4.0 / dt) + 1) * dt
    rear = 15.0 + 10.0 * np.minimum(t, 2.0) - 2.5 * np.minimum(t, 2.0) ** 2
    lower = np.stack((rear, np.full_like(t, -1.0)), axis=-1)[None]
    boxes = toy.Occupancy(
        toy.frozen(t),
        np.array([7]),
        toy.frozen(lower),
        toy.frozen(lower + np.array([5.0, 2.0])),
        np.array([False]),
    )
    reference = toy.SpeedProfile.from_accelerations(0.0, 14.0, [2.8, 10.0], [-5.0, 0.0])
    problem = replace(toy.problem(boxes, reference=reference, lateral=False), dt=dt)
    start = problem.start * [[1.0, 1.0], [1.0, 1.0], [0.0, 0.0]]
    result = CasadiBackend(CasadiConfig(w_reference=1e-4)).solve(replace(problem, start=start))
    assert result.status is SolveStatus.SOLVED
    fine = np.arange(4001) * 1e-3
    gap = np.interp(fine, t, rear) - result.curve.sample(fine).position[:, 0]
    assert problem.margin - 1e-6 <= gap.min() <= problem.margin + 0.05


# -- the drivability checker -------------------------------------------------------------------------


def states() -> DrivenStates:
    """Three transitions, none of which can be driven."""
    zeros = np.zeros(4)
    return DrivenStates(
        t=np.arange(4) * 0.1, x=np.arange(4) * 1.0, y=np.arange(4) * 0.4, steering=zeros,
        speed=np.full(4, 10.0), orientation=zeros,
    )  # fmt: skip


def test_the_drivability_checker_is_stopped_within_a_transition(monkeypatch):
    load_official()
    vehicle = load_vehicle(1)
    assert not official_check(states(), 0.1, vehicle).ok.any()
    calls = []

    def counted(needed=0.0, what=""):
        calls.append(what)
        if len(calls) == 6:
            raise OutOfTime

    monkeypatch.setattr(commonroad_ks, "in_time", counted)
    with until(time.perf_counter() + 100.0), pytest.raises(OutOfTime):
        official_check(states(), 0.1, vehicle)
    assert len(calls) == 6  # one before the transition, five inside of its optimiser


def test_the_drivability_checker_says_the_same_with_time_enough():
    vehicle = load_vehicle(1)
    free = official_check(states(), 0.1, vehicle)
    with until(time.perf_counter() + 100.0):
        timed = official_check(states(), 0.1, vehicle)
    assert timed.reasons == free.reasons


def test_it_is_not_imported_where_there_is_no_time_for_it(monkeypatch):
    monkeypatch.setattr(commonroad_ks, "_OFFICIAL", "nowhere.to.be.found")
    with until(time.perf_counter() + 0.1), pytest.raises(OutOfTime, match="importing"):
        official_check(states(), 0.1, load_vehicle(1))


# -- whole searches ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def situations():
    """The bundled scenario for each backend."""
    from repair.config import load_config
    from repair.paper.bundled import paper_scenario
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene
    from repair.solvers.registry import make_backend

    made = {}
    with paper_scenario("scenario_1") as path:
        for name in ("ego", "casadi", "qptr"):
            config = load_config(preset="scenario_1", backend=name)
            made[name] = prepare(load_scene(path, config), config), make_backend(name, config)
    return made


@pytest.mark.parametrize("limit", [0.0, 0.001, 0.01, 0.1])
@pytest.mark.parametrize("name", ["ego", "casadi", "qptr"])
def test_a_search_ends_in_time(name, limit, situations):
    """The machine may be busy: the best of a few tries, each with nothing made beforehand, by CPU time."""
    pytest.importorskip("casadi" if name == "casadi" else "numpy")
    from repair.api import find
    from repair.search.settings import SearchConfig

    prepared, backend = situations[name]
    settings = SearchConfig(time_limit=limit)
    find(prepared, backend, settings=replace(settings, time_limit=0.0))
    late = []
    for _ in range(5):
        models.build_model.cache_clear()
        begin = time.process_time()
        result = find(prepared, backend, settings=settings)
        late.append(time.process_time() - begin - limit)
        assert result.complete or result.status in (SearchStatus.BUDGET_EXHAUSTED, SearchStatus.FOUND)
        for probe in result.probes:
            assert probe.feasible == (probe.solve.curve is not None and probe.verdict.ok)
    assert min(late) < 0.02


def test_the_ttr_is_part_of_the_search(situations):
    from repair.api import find
    from repair.config import load_config
    from repair.preparation import prepare
    from repair.search.settings import SearchConfig

    prepared, backend = situations["ego"]
    config = load_config(preset="scenario_1", backend="ego", overrides=["driver=at_ttr"])
    asked = prepare(prepared.scene, config)
    find(asked, backend, settings=SearchConfig(time_limit=0.0))
    begin = time.process_time()
    result = find(asked, backend, settings=SearchConfig(time_limit=0.001))
    assert time.process_time() - begin < 0.05
    assert result.status is SearchStatus.BUDGET_EXHAUSTED
    assert find(asked, backend).complete
