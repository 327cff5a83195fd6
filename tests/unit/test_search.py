"""Algorithm 1 on problems without content: what is visited, what is returned, how it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import pytest
from tests import toy

from repair.backend.base import Capabilities, Closest, SolveResult, SolveStatus
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.config import Config, load_config
from repair.errors import BackendError
from repair.problem.problem import Maneuver, Passing
from repair.search.result import SearchStatus
from repair.search.rules import probe_order
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig
from repair.solvers import registry
from repair.solvers.registry import BACKENDS


@dataclass
class FakeSource:
    """One problem for each manoeuvre at every t_rep."""

    maneuvers: tuple[Maneuver | None, ...] = (Maneuver.YIELD,)
    asked: list[float] = field(default_factory=list)
    open_until: float = float("inf")  # later guides only come closest
    notches: tuple[tuple[float, ...], ...] = ((), (), ())

    def at(self, t_rep):
        self.asked.append(t_rep)
        return tuple(
            toy.problem((), t_rep=t_rep, t_end=t_rep + 2.0, passing=self.passing(m, t_rep))
            for m in self.maneuvers
        )

    def widened(self, t_rep):
        return ()

    def relaxed(self, t_rep):
        return ()

    def passing(self, maneuver, t_rep):
        if maneuver is None:
            return None
        guide, side = toy.constant().sample(np.arange(3.0)), np.zeros((0, 3), dtype=np.int8)
        return Passing(maneuver, guide, side, 0.0, t_rep <= self.open_until + 1e-9)


@dataclass
class FakeBackend:
    """Answers with the reference; its objective may depend on the manoeuvre."""

    name: str = "fake"
    costs: dict[Maneuver, float] = field(default_factory=dict)
    status: SolveStatus = SolveStatus.SOLVED
    on_solve: object = None
    capabilities: Capabilities = field(default_factory=Capabilities)
    limits: list[float | None] = field(default_factory=list)
    warm: list[object] = field(default_factory=list)

    def solve(self, problem, *, warm_start=None, time_limit=None):
        self.limits.append(time_limit)
        self.warm.append(warm_start)
        if self.on_solve is not None:
            self.on_solve()
        if self.status is not SolveStatus.SOLVED:
            return SolveResult(self.status)
        maneuver = problem.passing.maneuver if problem.passing else None
        return SolveResult(self.status, curve=toy.constant(10.0), objective=self.costs.get(maneuver, 0.0))


@dataclass
class FakeChecker(toy.Judging):
    """Says yes where ``yes(problem)`` does."""

    yes: object

    def check(self, problem, curve):
        return (
            Verdict() if self.yes(problem) else Verdict((Violation(Reason.COLLISION, problem.t_rep + 0.3),))
        )


class BentClock:
    """Time that passes only where the test lets it."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def tick(self, seconds):
        self.now += seconds


def until(latest):
    return FakeChecker(lambda problem: problem.t_rep <= latest + 1e-9)


def search(
    checker, ttc=2.9, *, backend=None, source=None, on_probe=None, clock=None, conflict=None, visits=None,
    **settings,
):  # fmt: skip
    keys = {"on_probe": on_probe, "visits": visits} | ({"clock": clock} if clock else {})
    return search_f_ttr(
        source or FakeSource(),
        conflict or Conflict(ttc, "margin", 7, ttc + 0.05),
        backend or FakeBackend(),
        checker,
        SearchConfig(**settings),
        **keys,
    )


def visited(result):
    return [probe.t_rep for probe in result.probes]


# -- orders ------------------------------------------------------------------------------------------


def test_bisect_visits_the_papers_iterates_of_scenario_1():
    result = search(until(9.0), 2.9, rule="bisect", delta_t=0.4, upper=2.0)
    assert visited(result) == pytest.approx([0.0, 0.8, 1.2, 1.6])
    assert result.f_ttr == pytest.approx(1.6)


@pytest.mark.parametrize("rule", ["bisect", "guided", "as_printed"])
def test_an_unsafe_end_of_the_first_says_nothing_of_later_ones(rule):
    """Only ends between 0.4 and 1.2 s are safe, and until 1.6 s there is a repair."""

    class Ends(toy.Judging):
        def check(self, problem, curve):
            if problem.t_rep > 1.6 + 1e-9:
                return Verdict((Violation(Reason.COLLISION, problem.t_rep),))
            if 0.4 - 1e-9 <= problem.t_rep <= 1.2 + 1e-9:
                return Verdict()
            return Verdict((Violation(reason, problem.t_rep),))

    reason = Reason.UNSAFE_END
    result = search(Ends(), 2.9, rule=rule, delta_t=0.4)
    assert result.status is SearchStatus.FOUND
    assert 0.4 - 1e-9 <= result.f_ttr <= 1.2 + 1e-9
    reason = Reason.COLLISION  # who strikes something is not asked for later ones
    if rule == "bisect":
        assert search(Ends(), 2.9, rule=rule, delta_t=0.4).f_ttr is None


def test_bisect_visits_the_papers_iterates_of_scenario_2():
    result = search(until(0.8), 1.6, rule="bisect", delta_t=0.4)
    assert visited(result) == pytest.approx([0.0, 0.8, 1.2])
    assert result.f_ttr == pytest.approx(0.8)


def test_without_an_upper_end_scenario_1_has_the_same_answer():
    result = search(until(1.6), 2.9, rule="bisect", delta_t=0.4)
    assert result.f_ttr == pytest.approx(1.6)


def test_as_printed_visits_what_the_listing_would():
    yes_no = search(until(1.6), 2.9, rule="as_printed", delta_t=0.4)
    # 0 yes, 1.45 yes, 2.175 no, 1.8125 no: the interval 1.45 .. 1.8125 is then below 0.4
    assert visited(yes_no) == pytest.approx([0.0, 1.45, 2.175, 1.8125])
    assert yes_no.f_ttr == pytest.approx(1.45)  # not the midpoint 1.63, which nobody tested
    all_yes = search(until(9.0), 2.9, rule="as_printed", delta_t=0.4)
    assert visited(all_yes) == pytest.approx([0.0, 1.45, 2.175, 2.5375])


def test_as_printed_ends_where_nothing_is_feasible():
    result = search(until(-1.0), 2.9, rule="as_printed", delta_t=0.4)
    assert visited(result) == [0.0]
    assert result.status is SearchStatus.NONE_FEASIBLE


@pytest.mark.parametrize("rule", ["guided", "bisect", "scan", "as_printed"])
@pytest.mark.parametrize("delta_t", [0.1, 0.3, 0.4, 0.7])
@pytest.mark.parametrize("ttc", [0.05, 0.4, 0.8, 1.2, 2.4, 2.8, 2.9, 2.9000000000000004, 6.000000000000001])
def test_no_rule_reaches_the_conflict_or_asks_twice(rule, delta_t, ttc):
    for latest in (-1.0, 0.0, 0.55 * ttc, 99.0):
        result = search(until(latest), ttc, rule=rule, delta_t=delta_t)
        times = visited(result)
        assert all(0.0 <= t < ttc - 1e-9 for t in times)
        assert len({round(t, 9) for t in times}) == len(times)
        if result.f_ttr is not None:
            assert any(abs(p.t_rep - result.f_ttr) < 1e-12 and p.feasible for p in result.probes)


@pytest.mark.parametrize("delta_t", [0.1, 0.2, 0.3, 0.4, 0.7])
@pytest.mark.parametrize("steps", [1, 2, 3, 4, 7, 12, 29])
def test_the_grid_does_not_depend_on_rounding(delta_t, steps):
    """k * delta_t is outside of [0, k * delta_t) however the product was rounded."""
    for ttc in (
        steps * delta_t,
        np.nextafter(steps * delta_t, 0.0),
        np.nextafter(steps * delta_t, 99.0),
        sum([delta_t] * steps),
    ):
        assert visited(search(until(99.0), ttc, rule="scan", delta_t=delta_t)) == pytest.approx(
            [k * delta_t for k in range(steps)]
        )
        best = search(until(99.0), ttc, rule="bisect", delta_t=delta_t)
        assert best.f_ttr == pytest.approx((steps - 1) * delta_t)


@pytest.mark.parametrize("delta_t", [0.1, 0.4])
@pytest.mark.parametrize("latest", [0.0, 0.3, 0.8, 1.25, 2.8])
def test_bisect_finds_what_scan_finds_where_feasibility_is_contiguous(delta_t, latest):
    bisect, scan = (search(until(latest), 2.9, rule=rule, delta_t=delta_t) for rule in ("bisect", "scan"))
    assert bisect.f_ttr == pytest.approx(scan.f_ttr)
    assert len(bisect.probes) <= np.ceil(np.log2(2.9 / delta_t)) + 2
    assert len(scan.probes) == np.ceil(2.9 / delta_t)


@pytest.mark.parametrize("delta_t", [0.1, 0.4])
@pytest.mark.parametrize("latest", [-1.0, 0.0, 0.3, 0.8, 1.25, 2.8])
@pytest.mark.parametrize("open_until", [-1.0, 0.0, 0.35, 1.2, 2.4, 9.0])
def test_guided_finds_what_scan_finds_whatever_the_guides_say(delta_t, latest, open_until):
    source = FakeSource(open_until=open_until)
    guided = search(until(latest), 2.9, source=source, rule="guided", delta_t=delta_t)
    scan = search(until(latest), 2.9, rule="scan", delta_t=delta_t)
    assert guided.f_ttr == (None if scan.f_ttr is None else pytest.approx(scan.f_ttr))
    assert guided.complete
    # twice as far each time, then halves: a logarithm for each
    assert len(guided.probes) <= 2 * np.ceil(np.log2(2.9 / delta_t)) + 2
    assert len({round(t, 9) for t in source.asked}) == len(source.asked)  # what was made is kept


@pytest.mark.parametrize(
    "latest, open_until, expected",
    [
        (1.2, 1.2, [1.2, 1.6]),
        (0.8, 1.2, [1.2, 0.8]),
        (2.8, 9.0, [2.8]),
        (1.6, 0.4, [0.4, 0.8, 1.6, 2.8, 2.0]),
        (0.4, 2.8, [2.8, 2.4, 1.6, 0.0, 0.8, 0.4]),
        (-1.0, -1.0, [0.0]),
        (-1.0, 0.8, [0.8, 0.4, 0.0]),
    ],
)
def test_guided_begins_where_the_ways_shut(latest, open_until, expected):
    source = FakeSource(open_until=open_until)
    result = search(until(latest), 2.9, source=source, rule="guided", delta_t=0.4)
    assert visited(result) == pytest.approx(expected)


def test_guided_goes_by_any_open_way():
    class Sides(FakeSource):
        def passing(self, maneuver, t_rep):
            self.open_until = 0.4 if maneuver is Maneuver.YIELD else 1.6
            return super().passing(maneuver, t_rep)

    source = Sides((Maneuver.YIELD, Maneuver.LEFT))
    assert visited(search(until(1.6), 2.9, source=source, rule="guided", delta_t=0.4)) == pytest.approx(
        [1.6, 2.0]
    )
    without = visited(search(until(2.8), 2.9, source=FakeSource((None,)), rule="guided", delta_t=0.4))
    assert without == pytest.approx([2.8])  # nothing is in the way


def test_probe_order_is_a_generator_that_is_told_the_answers():
    order = probe_order("bisect", 1.6, 0.4)
    assert next(order) == 0.0
    assert order.send(True) == pytest.approx(0.8)
    assert order.send(False) == pytest.approx(0.4)
    with pytest.raises(StopIteration):
        order.send(True)


# -- answers -----------------------------------------------------------------------------------------


def test_non_monotone_feasibility_is_seen_by_scan():
    island = FakeChecker(lambda problem: problem.t_rep < 0.5 or 1.9 < problem.t_rep < 2.1)
    assert search(island, 2.9, rule="bisect", delta_t=0.4).f_ttr == pytest.approx(0.4)
    scan = search(island, 2.9, rule="scan", delta_t=0.4)
    assert scan.f_ttr == pytest.approx(2.0)
    feasible = [p.feasible for p in scan.probes]
    assert sum(a != b for a, b in pairwise(feasible)) == 3


def test_scan_goes_on_where_now_is_infeasible():
    later = FakeChecker(lambda problem: problem.t_rep > 0.9)
    assert search(later, 2.9, rule="bisect", delta_t=0.4).status is SearchStatus.NONE_FEASIBLE
    assert search(later, 2.9, rule="scan", delta_t=0.4).f_ttr == pytest.approx(2.8)


def test_result_is_the_last_verified_probe_with_its_curve():
    result = search(until(1.3), 2.9, rule="bisect", delta_t=0.4)
    assert result.status is SearchStatus.FOUND
    assert result.best is not None
    assert result.best.t_rep == result.f_ttr == pytest.approx(1.2)
    assert result.curve is result.best.solve.curve
    assert result.complete
    assert list(result) == list(result.probes)


def test_no_conflict_asks_nobody():
    source = FakeSource()
    result = search(until(9.0), source=source, conflict=Conflict(float("inf")))
    assert result.status is SearchStatus.NO_CONFLICT
    assert result.f_ttr == float("inf")
    assert result.curve is None
    assert source.asked == []


def test_contact_at_the_start_is_its_own_answer():
    source = FakeSource()
    result = search(until(9.0), source=source, conflict=Conflict(0.0, "collision", 3, 0.0, 3))
    assert result.status is SearchStatus.ALREADY_COLLIDING
    assert result.f_ttr is None  # no reaction is verified, not even one at once
    assert source.asked == []


def test_a_margin_violated_at_the_start_leaves_zero_as_the_only_candidate():
    result = search(until(9.0), conflict=Conflict(0.0, "margin", 3, float("inf")), rule="bisect", delta_t=0.4)
    assert visited(result) == [0.0]
    assert result.f_ttr == 0.0
    assert result.status is SearchStatus.FOUND


@pytest.mark.parametrize("rule", ["guided", "bisect", "scan", "as_printed"])
def test_nothing_feasible_is_none_and_not_zero(rule):
    result = search(until(-1.0), 2.9, rule=rule)
    assert result.status is SearchStatus.NONE_FEASIBLE
    assert result.f_ttr is None
    assert result.curve is None
    assert result.complete
    assert result.probes


def test_upper_end_zero_tests_now_only():
    assert visited(search(until(9.0), 2.9, upper=0.0)) == [0.0]


def test_no_open_manoeuvre_is_a_verdict():
    result = search(until(9.0), source=FakeSource(()))
    assert result.status is SearchStatus.NONE_FEASIBLE
    assert result.probes[0].verdict.reasons == (Reason.NO_PASSAGE.value,)


@pytest.mark.parametrize(
    "status, reason",
    [
        (SolveStatus.INFEASIBLE, Reason.NOT_SOLVED),
        (SolveStatus.NO_CORRIDOR, Reason.NO_CORRIDOR),
        (SolveStatus.NUMERICAL_ERROR, Reason.NOT_SOLVED),
    ],
)
def test_what_the_solver_could_not_do_is_not_the_checkers_no(status, reason):
    result = search(until(9.0), backend=FakeBackend(status=status))
    probe = result.probes[0]
    assert not probe.feasible
    assert probe.verdict.reasons == (reason.value,)
    assert probe.verdict.violations[0].detail


# -- sides -------------------------------------------------------------------------------------------

BOTH = (Maneuver.YIELD, Maneuver.LEFT, Maneuver.GO_AHEAD)


def test_best_keeps_the_cheapest_feasible_side():
    backend = FakeBackend(costs={Maneuver.YIELD: 5.0, Maneuver.LEFT: 2.0, Maneuver.GO_AHEAD: 1.0})
    checker = FakeChecker(lambda problem: problem.passing.maneuver is not Maneuver.GO_AHEAD)
    result = search(checker, source=FakeSource(BOTH), backend=backend, upper=0.0, sides="best")
    probe = result.probes[0]
    assert probe.maneuver is Maneuver.LEFT
    assert probe.solve.objective == 2.0
    assert probe.tried == ("yield: feasible", "left: feasible", "go_ahead: collision")


def test_first_stops_at_the_first_feasible_side():
    backend = FakeBackend(costs={Maneuver.YIELD: 5.0, Maneuver.LEFT: 2.0})
    result = search(until(9.0), source=FakeSource(BOTH), backend=backend, upper=0.0, sides="first")
    assert result.probes[0].maneuver is Maneuver.YIELD
    assert len(backend.limits) == 1


def test_sides_are_compared_at_the_last_feasible_time_alone():
    """Elsewhere one that passes is enough; what is found is what asking all of them everywhere finds."""
    costs = {Maneuver.YIELD: 5.0, Maneuver.LEFT: 2.0, Maneuver.GO_AHEAD: 1.0}
    backend, reported = FakeBackend(costs=costs), []
    result = search(
        until(1.0), source=FakeSource(BOTH), backend=backend, rule="scan", on_probe=reported.append
    )
    assert [len(probe.tried) for probe in result.probes if probe.feasible] == [1, 1, 3]
    assert result.best.maneuver is Maneuver.GO_AHEAD
    assert result.best.t_rep == result.f_ttr == pytest.approx(0.8)
    assert result.curve is result.best.solve.curve
    assert [probe.t_rep for probe in reported] == [probe.t_rep for probe in result.probes]
    # Times that are given are looked at whole.
    given = search(until(9.0), source=FakeSource(BOTH), backend=backend, visits=[0.0, 0.4])
    assert [len(probe.tried) for probe in given.probes] == [3, 3]


def test_sides_that_are_compared_are_not_shown_the_answer():
    """A hard backend that is shown a curve of this very time makes one on the same side of it."""
    backend = FakeBackend(capabilities=Capabilities(uses_warm_start=True))
    found = search(until(0.4), source=FakeSource(BOTH), backend=backend, rule="scan")
    assert len(found.best.tried) == 3
    assert backend.warm[-2:] == [None, None]
    assert any(curve is not None for curve in backend.warm)


def test_a_side_that_is_compared_keeps_to_the_time_limit():
    clock = BentClock()
    backend = FakeBackend(on_solve=lambda: clock.tick(1.0))
    result = search(
        until(9.0), source=FakeSource(BOTH), backend=backend, clock=clock, time_limit=1.5, upper=0.0
    )
    assert result.complete
    assert len(result.probes[0].tried) == 2


def test_of_failures_the_first_is_kept():
    result = search(until(-1.0), source=FakeSource(BOTH), sides="best")
    assert result.probes[0].maneuver is Maneuver.YIELD
    assert len(result.probes[0].tried) == 3


def test_a_nan_objective_does_not_beat_a_number():
    backend = FakeBackend(costs={Maneuver.YIELD: 5.0, Maneuver.LEFT: float("nan")})
    result = search(until(9.0), source=FakeSource(BOTH[:2]), backend=backend, upper=0.0)
    assert result.probes[0].maneuver is Maneuver.YIELD


# -- anytime -----------------------------------------------------------------------------------------


def test_time_limit_keeps_what_was_verified():
    clock = BentClock()
    backend = FakeBackend(on_solve=lambda: clock.tick(1.0))
    result = search(until(9.0), 2.9, backend=backend, clock=clock, rule="scan", delta_t=0.1, time_limit=3.5)
    assert visited(result) == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert result.status is SearchStatus.FOUND
    assert result.f_ttr == pytest.approx(0.3)
    assert not result.complete
    assert result.wall_time == pytest.approx(4.0)
    assert backend.limits == pytest.approx([3.5, 2.5, 1.5, 0.5])


def test_time_limit_before_anything_was_verified_is_its_own_status():
    clock = BentClock()
    backend = FakeBackend(on_solve=lambda: clock.tick(1.0))
    late = FakeChecker(lambda problem: problem.t_rep > 1.0)
    result = search(late, 2.9, backend=backend, clock=clock, rule="scan", delta_t=0.1, time_limit=2.0)
    assert result.status is SearchStatus.BUDGET_EXHAUSTED
    assert result.f_ttr is None
    assert len(result.probes) == 2


def test_time_limit_zero_asks_nobody():
    source = FakeSource()
    result = search(until(9.0), source=source, clock=BentClock(), time_limit=0.0)
    assert result.status is SearchStatus.BUDGET_EXHAUSTED
    assert source.asked == []


def test_time_limit_cuts_the_sides_of_a_probe():
    clock = BentClock()
    backend = FakeBackend(on_solve=lambda: clock.tick(1.0))
    result = search(
        until(9.0), source=FakeSource(BOTH), backend=backend, clock=clock, time_limit=0.5, rule="bisect"
    )
    assert len(result.probes) == 1
    assert len(result.probes[0].tried) == 1
    assert result.f_ttr == 0.0


@dataclass
class LimitedBackend(FakeBackend):
    """Gives up at its time limit at some t_rep."""

    at: tuple[float, ...] = (0.0,)

    def solve(self, problem, *, warm_start=None, time_limit=None):
        self.limits.append(time_limit)
        if any(abs(problem.t_rep - t) < 1e-9 for t in self.at):
            return SolveResult(SolveStatus.TIME_LIMIT, detail="no time left")
        return SolveResult(SolveStatus.SOLVED, curve=toy.constant(10.0), objective=0.0)


@pytest.mark.parametrize("rule", ["guided", "bisect", "scan", "as_printed"])
def test_a_solve_that_ran_out_of_time_is_no_verdict(rule):
    backend = LimitedBackend(at=(0.0, 2.8, 2.4, 2.0, 1.6, 1.2, 0.8, 0.4))
    result = search(until(9.0), backend=backend, clock=BentClock(), rule=rule, time_limit=1.0)
    assert result.status is SearchStatus.BUDGET_EXHAUSTED
    assert not result.complete
    assert len(result.probes) == 1  # it is listed all the same


def test_what_was_found_before_a_solve_ran_out_of_time_is_no_complete_answer():
    backend = LimitedBackend(at=(1.6,))
    result = search(
        until(9.0), backend=backend, clock=BentClock(), rule="bisect", delta_t=0.4, time_limit=1.0
    )
    assert result.status is SearchStatus.FOUND
    assert result.f_ttr == 0.0
    assert visited(result) == pytest.approx([0.0, 1.6])
    assert not result.complete


def test_a_time_limit_of_the_backend_alone_is_an_answer():
    result = search(until(9.0), 1.2, backend=LimitedBackend(), rule="bisect")
    assert result.status is SearchStatus.NONE_FEASIBLE
    assert result.complete


def test_margins_that_there_was_no_time_for_are_no_verdict():
    clock = BentClock()

    class Relaxing(FakeSource):
        def relaxed(self, t_rep):
            return (self.at(t_rep),)

    backend = FakeBackend(on_solve=lambda: clock.tick(1.0), capabilities=Capabilities(relaxes=True))
    keys = {"source": Relaxing(), "backend": backend, "clock": clock, "rule": "bisect"}
    result = search(until(-1.0), time_limit=0.5, **keys)
    assert (result.status, result.complete) == (SearchStatus.BUDGET_EXHAUSTED, False)
    result = search(until(-1.0), time_limit=9.0, **keys)
    assert (result.status, result.complete) == (SearchStatus.NONE_FEASIBLE, True)


def test_no_backend_is_told_of_less_than_no_time():
    clock = BentClock()

    class Slow(FakeSource):
        def at(self, t_rep):
            clock.tick(1.0)
            return super().at(t_rep)

    backend = FakeBackend()
    search(until(9.0), source=Slow(), backend=backend, clock=clock, rule="bisect", time_limit=0.5)
    assert backend.limits == [0.0]


def test_running_to_the_end_exactly_in_time_is_complete():
    clock = BentClock()
    backend = FakeBackend(on_solve=lambda: clock.tick(1.0))
    result = search(until(9.0), 1.6, backend=backend, clock=clock, time_limit=10.0)
    assert result.complete


def test_interrupt_keeps_what_was_found():
    seen = []

    def on_probe(probe):
        seen.append(probe)
        if len(seen) == 3:
            raise KeyboardInterrupt

    result = search(until(9.0), 2.9, on_probe=on_probe, rule="scan", delta_t=0.4)
    assert len(seen) == len(result.probes) == 3
    assert result.status is SearchStatus.FOUND
    assert result.f_ttr == pytest.approx(0.8)
    assert not result.complete


def test_interrupt_in_the_backend_keeps_the_probes_before():
    count = []

    def on_solve():
        count.append(1)
        if len(count) == 3:
            raise KeyboardInterrupt

    result = search(until(9.0), 2.9, backend=FakeBackend(on_solve=on_solve), rule="scan", delta_t=0.4)
    assert visited(result) == pytest.approx([0.0, 0.4])
    assert result.f_ttr == pytest.approx(0.4)
    assert not result.complete


def test_a_bug_in_a_backend_is_not_swallowed():
    def on_solve():
        raise KeyError("bug")

    with pytest.raises(KeyError):
        search(until(9.0), backend=FakeBackend(on_solve=on_solve))


def test_a_timeout_raised_inside_a_backend_is_not_the_search_running_out_of_time():
    def on_solve():
        raise TimeoutError("solver process")

    with pytest.raises(TimeoutError):
        search(until(9.0), backend=FakeBackend(on_solve=on_solve))


def test_a_stop_iteration_inside_a_backend_does_not_end_the_search_as_complete():
    def on_solve():
        next(iter(()))

    with pytest.raises((StopIteration, RuntimeError)):
        search(until(9.0), backend=FakeBackend(on_solve=on_solve))


def test_the_last_feasible_curve_is_offered_as_a_warm_start_where_it_is_of_use():
    backend = FakeBackend(capabilities=Capabilities(uses_warm_start=True))
    result = search(until(0.8), 1.6, backend=backend, delta_t=0.4, rule="bisect")
    assert backend.warm[0] is None
    assert backend.warm[1] is result.probes[0].solve.curve
    assert backend.warm[2] is result.probes[1].solve.curve
    backend = FakeBackend()
    search(until(0.8), 1.6, backend=backend, delta_t=0.4, rule="bisect")
    assert backend.warm == [None] * 3


# -- what a backend is able to do ----------------------------------------------------------------------


class Relaxing(FakeSource):
    """The problems with smaller margins; some manoeuvres open with a smaller one only."""

    def __init__(self, *margins, opens=None, strict=False, slower=5.0, sides=None):
        super().__init__()
        self.margins, self.opens, self.strict = margins, opens or {}, strict
        self.guide = toy.constant(10.0 - slower).sample(np.arange(3.0))
        self.sides = sides or {}  # of each box, from a margin on down

    def at(self, t_rep, margin=0.1):
        sides = [0, 0, 0]
        for least, others in self.sides.items():
            sides = others if margin <= least else sides
        sides = np.atleast_2d(np.array(sides, dtype=np.int8))
        boxes = toy.occupancy(*[toy.box((50, 55), (-1, 1))] * len(sides))
        return tuple(
            replace(
                problem, margin=margin, strict=self.strict, occupancy=boxes,
                passing=replace(problem.passing, guide=self.guide, sides=sides),
            )
            for problem in super().at(t_rep)
            if margin <= self.opens.get(problem.passing.maneuver, math.inf)
        )  # fmt: skip

    def relaxed(self, t_rep):
        return [self.at(t_rep, margin) for margin in self.margins]


class Narrow(FakeBackend):
    """Has a curve past a side up to some margin; of some sides it says what is missing."""

    def __init__(self, widest, says=(), **keys):
        super().__init__(**keys)
        self.widest, self.says = widest, set(says)

    def solve(self, problem, *, warm_start=None, time_limit=None):
        maneuver = problem.passing.maneuver
        missing = problem.margin - self.widest[maneuver]
        if missing <= 1e-9:
            return super().solve(problem, warm_start=warm_start, time_limit=time_limit)
        self.limits.append(time_limit)
        closest = Closest(toy.constant(10.0), missing) if maneuver in self.says else None
        return SolveResult(SolveStatus.INFEASIBLE, closest=closest)


@pytest.mark.parametrize("relaxes", [False, True])
def test_smaller_margins_are_asked_for_where_the_backend_keeps_its_own(relaxes):
    backend = Narrow({Maneuver.YIELD: 0.0}, capabilities=Capabilities(relaxes=relaxes))
    result = search(until(9.0), source=Relaxing(0.05, 0.0), backend=backend, upper=0.0)
    (probe,) = result.probes
    if relaxes:
        assert (result.status, probe.margin) == (SearchStatus.FOUND, 0.0)
        assert probe.tried == (
            "yield: not_solved", "yield: not_solved (margin 0.05 m)", "yield: feasible (margin 0 m)",
        )  # fmt: skip
    else:
        assert (result.status, probe.tried) == (SearchStatus.NONE_FEASIBLE, ("yield: not_solved",))
        assert len(backend.limits) == 1


def test_smaller_margins_are_asked_for_where_they_may_help():
    # left misses 4.1 m, and says so; right has a curve from the first one on, which comes too close
    backend = Narrow(
        {Maneuver.LEFT: -4.0, Maneuver.RIGHT: -0.1, Maneuver.YIELD: -9.0}, says={Maneuver.LEFT},
        capabilities=Capabilities(relaxes=True),
    )  # fmt: skip
    source = Relaxing(-0.1, -0.3, -1.3, -4.0)
    source.maneuvers = (Maneuver.LEFT, Maneuver.RIGHT, Maneuver.YIELD)

    class Judge(toy.Judging):
        def check(self, problem, curve):
            if problem.passing.maneuver is not Maneuver.LEFT:
                return Verdict((Violation(Reason.COLLISION, problem.t_rep),))
            return Verdict() if problem.margin < -2.0 else Verdict((Violation(Reason.LIMITS, problem.t_rep),))

    (probe,) = search(Judge(), source=source, backend=backend, upper=0.0).probes
    margins = {name: [] for name in ("left", "right", "yield")}
    for text in (text for text in probe.tried[3:] if "jumps" not in text):
        name, _, rest = text.partition(": ")
        margins[name].append(rest)
    assert probe.feasible
    assert margins["left"] == ["feasible (margin -4 m)"]
    assert margins["right"] == ["collision (margin -0.1 m)"]
    # nobody knows by how much it misses
    assert margins["yield"] == [f"not_solved (margin {m:g} m)" for m in (-0.1, -0.3, -1.3, -4.0)]


def asked_margins(maneuver, reasons, sides=None, slower=5.0, contact=2.95):
    """The margins that a side is asked for that misses 0.4 m, its closest curve being refused for reasons."""
    backend = Narrow({maneuver: -0.3}, says={maneuver}, capabilities=Capabilities(relaxes=True))
    source = Relaxing(-0.1, -0.22, -0.3, sides=sides, slower=slower)
    source.maneuvers = (maneuver,)

    class Refusing(toy.Judging):
        def check(self, problem, curve):
            missed = reasons if problem.margin > -0.25 else (Reason.OFF_ROAD,)
            return Verdict(tuple(Violation(reason, problem.t_rep, "", 100) for reason in missed))

    conflict = Conflict(2.9, "margin", 7, contact)
    (probe,) = search(Refusing(), source=source, backend=backend, upper=0.0, conflict=conflict).probes
    texts = (text for text in probe.tried[1:] if "jumps" not in text)
    return [float(text.rpartition("margin ")[2].removesuffix(" m)")) for text in texts]


ALL = [-0.1, -0.22, -0.3]


@pytest.mark.parametrize(
    "maneuver, reasons, margins",
    [
        (Maneuver.YIELD, (Reason.COLLISION,), []),  # nothing is less close than what comes closest
        (Maneuver.GO_AHEAD, (Reason.MARGIN, Reason.LIMITS), []),
        (Maneuver.LEFT, (Reason.MARGIN,), []),
        (Maneuver.LEFT, (Reason.MARGIN, Reason.LIMITS), [-0.22, -0.3]),  # 0.3 m less, within 0.1 m
        (Maneuver.LEFT, (Reason.LIMITS,), ALL),
        (Maneuver.YIELD, (Reason.OFF_ROAD,), ALL),
    ],
)
def test_a_way_on_which_what_comes_closest_is_too_close_is_not_asked_in_vain(maneuver, reasons, margins):
    assert asked_margins(maneuver, reasons) == margins


def test_another_way_past_the_same_obstacles_is_asked():
    too_close = (Reason.COLLISION,)
    assert asked_margins(Maneuver.YIELD, too_close, {-0.2: [0, 2, 1]}) == [-0.22]
    assert asked_margins(Maneuver.YIELD, too_close, {-0.2: [0, 2, 1], -0.3: [2, 2, 1]}) == [-0.22, -0.3]
    assert asked_margins(Maneuver.YIELD, too_close, {-0.2: [0, 2, 1], -0.3: [0, 0, 0]}) == [-0.22]
    assert asked_margins(Maneuver.YIELD, too_close, {-0.2: [0, 0, 0]}) == []
    assert asked_margins(Maneuver.LEFT, (Reason.MARGIN, Reason.LIMITS), {-0.1: [2, 2, 2]}) == ALL
    # The sides taken of others do not keep it from the one that it came too close to.
    first = {0.1: [[0, 0, 2], [0, 0, 0]]}
    assert asked_margins(Maneuver.YIELD, too_close, first | {-0.2: [[0, 2, 2], [0, 3, 3]]}) == []
    assert asked_margins(Maneuver.YIELD, too_close, first | {-0.2: [[0, 2, 1], [0, 0, 0]]}) == [-0.22]


def test_a_guide_that_follows_the_reference_into_what_it_meets_is_not_asked():
    assert asked_margins(Maneuver.YIELD, (Reason.LIMITS,), slower=0.1) == []
    assert asked_margins(Maneuver.YIELD, (Reason.LIMITS,), slower=0.2) == ALL
    # of a reference that exceeds a limit it may be what helps
    assert asked_margins(Maneuver.YIELD, (Reason.LIMITS,), slower=0.1, contact=math.inf) == ALL


class Braked(FakeBackend):
    """Has a curve only where it may begin with brakes or with a lateral acceleration."""

    def __init__(self, miss=0.4, **can):
        super().__init__(capabilities=Capabilities(**{"relaxes": True, **can}))
        self.miss, self.begun = miss, []

    def solve(self, problem, *, warm_start=None, time_limit=None):
        self.begun.append(problem.start[2].tolist())
        if np.abs(problem.start[2]).max() > 3.0:
            return super().solve(problem, warm_start=warm_start, time_limit=time_limit)
        closest = None if self.miss is None else Closest(toy.constant(10.0), self.miss)
        return SolveResult(SolveStatus.INFEASIBLE, closest=closest)


def begun(maneuver, backend=None, *, harsh=-6.0, opened=True, strict=False):
    """The probe at t_rep = 0, and the accelerations that the backend was asked to begin with."""

    class Harsh(FakeSource):
        def at(self, t_rep):
            guide = self.passing(maneuver, t_rep).guide
            guide = replace(guide, acceleration=np.full((3, 2), (harsh, 0.0)))
            return tuple(
                replace(p, strict=strict, passing=replace(p.passing, guide=guide, open=opened))
                for p in super().at(t_rep)
            )

    class Judge(toy.Judging):
        def check(self, problem, curve):
            asked = np.abs(problem.start[2]).max() > 3.0
            return Verdict() if asked else Verdict((Violation(Reason.OFF_ROAD, problem.t_rep),))

    backend = backend or Braked()
    (probe,) = search(Judge(), source=Harsh((maneuver,)), backend=backend, upper=0.0).probes
    return probe, backend.begun


def test_a_side_that_fails_is_begun_as_its_guide_begins():
    probe, asked = begun(Maneuver.YIELD)
    assert asked == [[0.0, 0.0], [-6.0, 0.0]]
    assert probe.feasible
    assert probe.jump == 6.0
    assert probe.tried == (
        "yield: not_solved", "yield: feasible (its acceleration jumps by 6.0 m/s² at t_rep)",
    )  # fmt: skip
    assert begun(Maneuver.LEFT)[1][1] == [-6.0, 0.0]  # the steering is not there at once


@pytest.mark.parametrize(
    "keys",
    [
        {"strict": True},  # as the paper asks
        {"harsh": -0.3},  # hardly another start
        {"backend": Braked(1.6)},  # more than a jump gains
        {"backend": Braked(relaxes=False)},
        {"maneuver": Maneuver.LEFT, "opened": False},
    ],
)
def test_it_is_not_where_that_is_of_no_use(keys):
    probe, asked = begun(**{"maneuver": Maneuver.YIELD, **keys})
    assert asked == [[0.0, 0.0]]
    assert not probe.feasible


def test_it_is_where_nobody_knows_by_how_much_it_misses():
    assert begun(Maneuver.YIELD, Braked(None), opened=False)[0].feasible


def test_a_side_that_opens_with_a_smaller_margin_is_asked():
    backend = Narrow({Maneuver.YIELD: -9.0, Maneuver.LEFT: -0.3}, capabilities=Capabilities(relaxes=True))
    source = Relaxing(-0.1, -0.3, opens={Maneuver.LEFT: -0.3})
    source.maneuvers = (Maneuver.YIELD, Maneuver.LEFT)
    (probe,) = search(until(9.0), source=source, backend=backend, upper=0.0).probes
    assert (probe.feasible, probe.maneuver, probe.margin) == (True, Maneuver.LEFT, -0.3)


def test_no_proof_is_asked_for_where_little_would_follow():
    asked = []

    class Proven:
        def __call__(self, t_rep):
            asked.append(t_rep)
            return True

    def tried(helpers, strict=False):
        backend = Narrow({Maneuver.YIELD: -9.0}, capabilities=Capabilities(relaxes=True, helpers=helpers))
        source = Relaxing(-0.1, strict=strict)
        keys = {"hopeless": Proven()}
        found = search_f_ttr(
            source, Conflict(0.3, "margin", 7, 0.35), backend, until(9.0), SearchConfig(upper=0.0), **keys
        )
        return found.probes[0].tried

    assert tried({"helper": FakeBackend})[-1] == "no further: it is proven to be too late"
    assert len(asked) == 1
    assert tried({})[-1] == "yield: not_solved (margin -0.1 m)"
    assert tried({"helper": FakeBackend}, strict=True)[-1] == "yield: not_solved (margin -0.1 m)"
    assert len(asked) == 1


@pytest.mark.parametrize("strict", [False, True])
def test_the_curve_that_comes_closest_may_pass_the_checks(strict):
    class Near(FakeBackend):
        def solve(self, problem, *, warm_start=None, time_limit=None):
            closest = Closest(toy.constant(10.0), 0.3)
            return SolveResult(SolveStatus.INFEASIBLE, detail="0.30 m are missing", closest=closest)

    class Strict(FakeSource):
        def at(self, t_rep):
            return tuple(replace(problem, strict=strict) for problem in super().at(t_rep))

    result = search(until(9.0), source=Strict(), backend=Near(), upper=0.0)
    (probe,) = result.probes
    assert probe.solve.status is SolveStatus.INFEASIBLE  # that word stays the backend's
    assert probe.feasible != strict
    if not strict:
        assert probe.margin == pytest.approx(toy.problem(()).margin - 0.3)
        assert "passes every check" in probe.solve.detail


@pytest.mark.parametrize("maneuver", [Maneuver.YIELD, Maneuver.GO_AHEAD, Maneuver.LEFT])
@pytest.mark.parametrize("refuses", [False, True])
def test_of_a_closest_curve_that_keeps_the_path_the_traffic_is_asked_first(maneuver, refuses):
    class Near(FakeBackend):
        def solve(self, problem, *, warm_start=None, time_limit=None):
            return SolveResult(SolveStatus.INFEASIBLE, closest=Closest(toy.constant(10.0), 0.3))

    class Judge:
        asked = ()

        def refuses_traffic(self, problem, curve):
            self.asked += ("traffic",)
            return Violation(Reason.MARGIN, 1.0, "", 7) if refuses else None

        def check(self, problem, curve):
            self.asked += ("all",)
            return Verdict()

    judge = Judge()
    (probe,) = search(judge, source=FakeSource((maneuver,)), backend=Near(), upper=0.0).probes
    along = maneuver is not Maneuver.LEFT
    assert probe.feasible == (not (along and refuses))
    assert judge.asked == (("traffic",) if along and refuses else ("traffic", "all") if along else ("all",))


# -- given visits --------------------------------------------------------------------------------------


def given(checker, visits, **keys):
    """The search over times-to-repair that are given, as the paper's baseline does with one."""
    conflict = keys.pop("conflict", Conflict(2.9, "margin", 7, 2.95))
    source, backend = keys.pop("source", None) or FakeSource(), keys.pop("backend", None) or FakeBackend()
    hooks = {name: keys.pop(name) for name in ("on_probe", "clock") if name in keys}
    return search_f_ttr(source, conflict, backend, checker, SearchConfig(**keys), visits=visits, **hooks)


@pytest.mark.parametrize("rule", ["guided", "bisect", "scan", "as_printed"])
@pytest.mark.parametrize("visits", [(), (2.6,), (0.7, 0.3, 2.0), [1.3]])
def test_given_times_are_visited_whatever_comes_out(rule, visits):
    for latest in (-1.0, 0.5, 9.0):
        source = FakeSource()
        result = given(until(latest), visits, source=source, rule=rule, upper=0.1)
        assert visited(result) == list(visits) == source.asked
        assert result.complete
        feasible = [t for t in visits if t <= latest]
        assert result.f_ttr == max(feasible, default=None)
        assert (result.status is SearchStatus.FOUND) == bool(feasible)


def test_no_conflict_leaves_given_times_alone():
    source = FakeSource()
    result = given(until(9.0), (1.0,), source=source, conflict=Conflict(float("inf")))
    assert (result.status, source.asked) == (SearchStatus.NO_CONFLICT, [])


def test_given_times_keep_the_time_limit():
    source = FakeSource()
    result = given(until(9.0), (1.0,), source=source, clock=BentClock(), time_limit=0.0)
    assert (result.status, result.complete) == (SearchStatus.BUDGET_EXHAUSTED, False)
    assert source.asked == []
    backend = FakeBackend()
    given(until(9.0), (1.0,), backend=backend, clock=BentClock(), time_limit=3.0)
    assert backend.limits == [3.0]


def test_an_interrupt_at_given_times_keeps_what_was_found():
    def pressed(*_):
        raise KeyboardInterrupt

    result = given(until(9.0), (1.0,), on_probe=pressed)
    assert (result.status, result.f_ttr, result.complete) == (SearchStatus.FOUND, 1.0, False)
    result = given(until(9.0), (1.0,), backend=FakeBackend(on_solve=pressed))
    assert (result.status, result.probes, result.complete) == (SearchStatus.BUDGET_EXHAUSTED, (), False)


# -- a backend of one's own --------------------------------------------------------------------------


@pytest.fixture
def registered():
    """Registers backends, and takes them back."""
    names = []

    def register(name, factory, **keys):
        registry.register(name, factory, **keys)
        names.append(name)

    yield register
    for name in names:
        BACKENDS.unregister(name)


def test_a_new_backend_needs_one_registration(registered):
    registered("toy", lambda config: FakeBackend(name="toy"))
    assert "toy" in registry.backend_names()
    assert registry.available()["toy"] is None
    backend = registry.make_backend("toy", Config(backend="toy"))
    result = search(until(1.2), 2.9, backend=backend, delta_t=0.4)
    assert result.f_ttr == pytest.approx(1.2)
    BACKENDS.unregister("toy")
    assert "toy" not in registry.backend_names()
    with pytest.raises(BackendError, match="'toy' is unknown"):
        registry.make_backend("toy", Config(backend="toy"))


def test_a_name_is_registered_once(registered):
    registered("toy", lambda config: FakeBackend(name="first"))
    for name in ("toy", "ego"):
        with pytest.raises(BackendError, match=f"there is a backend '{name}' already"):
            registry.register(name, lambda config: FakeBackend(name="second"))
    assert registry.make_backend("toy", Config()).name == "first"
    assert registry.make_backend("ego", Config()).name == "ego"
    BACKENDS.unregister("ego")  # was not registered, and stays
    assert "ego" in registry.backend_names()


@pytest.mark.parametrize("name", ["ctrl-c", "two words", "", None])
def test_a_name_is_an_identifier(name):
    """It is the name of a section of the configuration."""
    with pytest.raises(BackendError, match="identifier"):
        registry.register(name, lambda config: FakeBackend())


class Mute:
    name = "mute"
    capabilities = Capabilities()


class Undeclared:
    name = "undeclared"
    relaxes = True  # what an earlier version looked at

    def solve(self, problem, *, warm_start=None, time_limit=None):
        return SolveResult(SolveStatus.INFEASIBLE)


class Declared(Undeclared):
    capabilities = {"relaxes": True}  # noqa: RUF012


@pytest.mark.parametrize(
    "made, words",
    [
        (None, "gave NoneType"),
        (Mute(), "gave Mute"),
        (Undeclared(), "declares no capabilities"),
        (Declared(), "declares no capabilities"),
    ],
)
def test_what_is_no_backend_is_refused_before_anything_is_loaded(registered, tmp_path, made, words):
    from repair.api import repair

    registered("toy", lambda config: made)
    config = load_config(backend="toy")
    with pytest.raises(BackendError, match=f"'toy'.*{words}"):
        registry.make_backend("toy", config)
    with pytest.raises(BackendError, match=f"'toy'.*{words}"):
        repair(tmp_path / "nowhere.xml", config)


def test_a_new_backend_runs_through_the_whole_house(registered, scenarios):
    from repair.api import repair

    path = scenarios / "DEU_Flensburg-6_1_T-1.xml"
    if not path.exists():
        pytest.skip(f"{path.name} is not in COMMONROAD_SCENARIOS")

    class FullBrake:
        name = "brake"
        capabilities = Capabilities()

        def solve(self, problem, *, warm_start=None, time_limit=None):
            from repair.reference.profile import SpeedProfile

            s, v = problem.start[0, 0], problem.start[1, 0]
            profile = SpeedProfile.from_accelerations(s, v, [v / 2.8], [-2.8])
            return SolveResult(SolveStatus.SOLVED, curve=Shifted(profile, problem.t_rep), objective=0.0)

    registered("brake", lambda config: FullBrake())
    result = repair(path, load_config(preset="scenario_1", backend="brake"))
    assert result.status is SearchStatus.FOUND
    assert 1.6 <= result.f_ttr <= 2.6


@dataclass
class Shifted:
    """A profile that starts later."""

    profile: object
    t_start: float

    @property
    def t_end(self):
        return self.t_start + 20.0

    def sample(self, t):
        times = np.atleast_1d(np.asarray(t, dtype=float))
        return replace(self.profile.sample(times - self.t_start), t=times)


def test_unknown_backends_are_named():
    with pytest.raises(BackendError, match=r"'egoo'.*ego, casadi, qptr"):
        registry.make_backend("egoo", Config())
