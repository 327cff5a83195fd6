"""Several backends as one: who is asked, for what, and whose repair is the answer."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from tests import toy
from tests.contract import problems

import repair
from repair.backend.base import Capabilities, SolveResult, SolveStatus
from repair.certify.recompute import certify
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.config import load_config
from repair.errors import BackendError, ConfigError
from repair.paper.bundled import paper_scenario
from repair.search.result import SearchStatus
from repair.search.settings import SearchConfig
from repair.search.several import capabilities_of, search_with
from repair.solvers.registry import make_backend

STEP = 0.1


class Member:
    """Finds a repair up to a time, and notes what it is asked."""

    def __init__(self, name, latest, **can):
        self.name, self.latest, self.capabilities = name, latest, Capabilities(**can)
        self.asked, self.started = [], []

    def solve(self, problem, *, warm_start=None, time_limit=None):
        self.asked.append(round(problem.t_rep, 6))
        self.started.append(warm_start)
        if problem.t_rep > self.latest + 1e-9:
            return SolveResult(SolveStatus.INFEASIBLE, detail="too late")
        return SolveResult(SolveStatus.SOLVED, problem.reference, objective=0.0)


class Source:
    """A free road, at any time."""

    notches = ((), (), ())

    def at(self, t_rep):
        return (problems.forced(problems.toy.problem([], t_rep=t_rep, lateral=False)),)

    def relaxed(self, t_rep):
        return ()

    def widened(self, t_rep):
        return ()


class Checker(toy.Judging):
    def check(self, problem, curve):
        return Verdict()


class TooLate:
    """Proves it from a time on, and says where it was asked."""

    def __init__(self, first):
        self.first, self.asked = first, []

    def __call__(self, t_rep):
        self.asked.append(round(t_rep, 6))
        return t_rep >= self.first

    def since(self, times):
        return min((t for t in times if self(t)), default=float("inf"))


def asked(*members, rule="bisect", ttc=2.0, too_late=None, hopeless=None, visits=None, **keys):
    """The search with these members among a conflict at ``ttc``."""
    source = Source()
    situation = SimpleNamespace(
        source=source, unguided=source, judge=Checker(), conflict=Conflict(ttc, "margin", contact_time=ttc)
    )
    named = {member.name: member for member in members}
    whole = SimpleNamespace(capabilities=Capabilities(members=lambda: named))
    settings = SearchConfig(rule=rule, delta_t=STEP, **keys)
    found = search_with(
        whole, "portfolio", situation, settings, too_late=too_late, hopeless=hopeless, visits=visits
    )
    return found, capabilities_of(whole, found)


@pytest.mark.parametrize("rule", ["bisect", "guided", "scan"])
def test_the_latest_repair_wins_and_names_whose_it_is(rule):
    cheap, other, last = Member("cheap", 0.8), Member("other", 1.3, jumps=True), Member("last", 1.1)
    found, can = asked(cheap, other, last, rule=rule)
    assert found.status is SearchStatus.FOUND
    assert found.f_ttr == pytest.approx(1.3)
    assert found.best.by == "other"
    assert can.jumps
    assert min(other.asked) > 0.85, "it was asked for what was found already"
    assert min(last.asked) > 1.35
    assert {probe.by for probe in found.probes} == {"cheap", "other", "last"}
    assert all(abs(t / STEP - round(t / STEP)) < 1e-9 for t in other.asked + last.asked)


def test_a_member_is_asked_from_the_start_where_nothing_was_found():
    found, _ = asked(Member("none", -1.0), Member("some", 0.5))
    assert found.f_ttr == pytest.approx(0.5)
    assert found.best.by == "some"


def test_where_nobody_finds_anything_there_is_none():
    found, can = asked(Member("a", -1.0), Member("b", -1.0, jumps=True))
    assert found.status is SearchStatus.NONE_FEASIBLE
    assert found.complete
    assert not can.jumps


def test_nobody_is_asked_where_nothing_is_open():
    last = Member("last", 9.0)
    found, _ = asked(Member("cheap", 9.0), last)
    assert found.f_ttr == pytest.approx(1.9)
    assert last.asked == []


def test_nobody_is_asked_for_what_is_proven_too_late():
    calls = []

    def late():
        calls.append(1)
        return 1.0

    second, third = Member("second", 9.0), Member("third", 9.0)
    found, _ = asked(Member("first", 0.5), second, third, too_late=late)
    assert found.f_ttr == pytest.approx(0.9)
    assert max(second.asked) < 1.0
    assert third.asked == []
    assert len(calls) == 1


def test_nobody_is_asked_where_a_quick_proof_says_too_late():
    proof, second = TooLate(1.0), Member("second", 9.0, own_way=True)
    third = Member("third", 9.0, own_way=True)
    found, _ = asked(Member("first", 0.5), second, third, hopeless=proof)
    assert found.f_ttr == pytest.approx(0.9)
    assert max(second.asked) < 1.0
    assert third.asked == []
    assert min(proof.asked) > 0.55, "a proof was looked for where a repair is known"
    second.asked.clear()
    asked(Member("first", 0.5), second, hopeless=proof, proofs=False)
    assert max(second.asked) > 1.0


def test_a_helper_that_found_nothing_at_all_is_asked_at_later_times():
    """Bisection ends at its first visit where that is not feasible, which says nothing of the others."""
    helper = Member("cheap", -1.0)
    hard = Member("hard", 1.1, helpers={"cheap": lambda: helper})
    found, _ = asked(Member("cheap", -1.0, own_way=True), hard)
    assert found.f_ttr == pytest.approx(1.1)
    assert helper.asked
    assert 0.0 not in helper.asked


@pytest.mark.parametrize("latest, times", [(1.7, [1.9, 1.8]), (1.6, None)])
def test_one_or_two_times_are_looked_at_without_a_proof(latest, times):
    proof, second = TooLate(1.85), Member("second", -1.0, own_way=True)
    asked(Member("first", latest), second, hopeless=proof)
    assert proof.asked == ([] if times else pytest.approx([1.7, 1.8, 1.9]))
    assert times is None or second.asked == pytest.approx(times)


def test_given_visits_that_are_proven_too_late_are_left_out():
    proof, second = TooLate(0.9), Member("second", 1.1, own_way=True)
    asked(Member("first", 0.4), second, hopeless=proof, visits=(0.2, 0.4, 0.6, 1.0))
    assert second.asked == [0.6]
    assert proof.asked == [0.6, 1.0]


@pytest.mark.parametrize("rule, visits", [("bisect", [1.9, 1.2, 1.5, 1.3, 1.4]), ("scan", [0.6, 0.7, 0.8])])
def test_who_finds_its_own_way_begins_with_the_latest(rule, visits):
    own = Member("own", 1.4, own_way=True)
    found, _ = asked(Member("first", 0.5), own, rule=rule)
    assert found.f_ttr == pytest.approx(1.4)
    assert own.asked[: len(visits)] == visits
    none = Member("none", -1.0, own_way=True)
    asked(Member("first", 0.5), none, ttc=1.0)
    assert none.asked == [0.9, 0.7, 0.6]


def test_who_can_starts_from_the_repair_before():
    warm, cold = Member("warm", 9.0, uses_warm_start=True), Member("cold", 1.9)
    asked(Member("first", 0.5), warm, ttc=1.0)
    asked(Member("first", 0.5), cold, ttc=1.0)
    assert warm.started[0] is not None
    assert cold.started[0] is None


def test_given_visits_are_left_to_the_next_where_they_are_later():
    first, second = Member("first", 0.4), Member("second", 1.1)
    found, _ = asked(first, second, visits=(0.2, 0.4, 0.6, 1.0))
    assert first.asked == [0.2, 0.4, 0.6, 1.0]
    assert second.asked == [0.6, 1.0]
    assert found.f_ttr == pytest.approx(1.0)


def test_the_time_limit_is_that_of_all_together():
    late = Member("late", 9.0)
    found, _ = asked(Member("first", 0.5), late, time_limit=0.0)
    assert not found.complete
    assert found.status is SearchStatus.BUDGET_EXHAUSTED
    assert late.asked == []


def test_ctrl_c_ends_the_search_with_what_was_found():
    class Interrupted(Member):
        def solve(self, problem, **keys):
            raise KeyboardInterrupt

    last = Member("last", 9.0)
    found, _ = asked(Member("first", 0.5), Interrupted("stop", 0.0), last)
    assert found.status is SearchStatus.FOUND
    assert found.f_ttr == pytest.approx(0.5)
    assert not found.complete
    assert last.asked == []


def test_ctrl_c_while_a_proof_is_looked_for_keeps_what_was_found():
    class Stopped(TooLate):
        def __call__(self, t_rep):
            raise KeyboardInterrupt

    last = Member("last", 9.0, own_way=True)
    found, _ = asked(Member("first", 0.5), last, hopeless=Stopped(1.0))
    assert found.f_ttr == pytest.approx(0.5)
    assert not found.complete
    assert last.asked == []


def test_a_portfolio_of_itself_or_of_nobody_is_refused():
    for members in ("[portfolio]", "[]"):
        with pytest.raises(BackendError, match="at least one, and none of itself"):
            make_backend("portfolio", load_config(overrides=[f"portfolio.members={members}"]))
    with pytest.raises(ConfigError, match="nobody"):
        load_config(overrides=["portfolio.members=[nobody]"])


def test_results_name_the_backend_and_are_certified(tmp_path):
    config = load_config(
        backend="portfolio", overrides=["search.delta_t=0.2", "portfolio.members=[ego, shooting]"]
    )
    with paper_scenario("scenario_1") as path:
        result = repair.repair(path, config)
        single = [
            repair.repair(path, backend=name, overrides=["search.delta_t=0.2"])
            for name in ("ego", "shooting")
        ]
        content = result.to_dict()
        assert content["backend"] == "portfolio"
        assert content["repaired_by"] in ("ego", "shooting")
        assert content["f_ttr_s"] == pytest.approx(max(one.f_ttr for one in single))
        assert {probe["backend"] for probe in content["probes"]} == {"ego", "shooting"}
        result.save(tmp_path, figure=False)
        certificate = certify(tmp_path)
    assert [row.name for row in certificate.rows if row.claim and not row.ok] == []


@pytest.mark.parametrize("rule", ["bisect", "scan"])
def test_a_helper_is_not_asked_again_where_it_found_nothing_as_a_member(rule):
    """Who was no member, or was not asked for this time, still helps."""
    helpers = {name: Member(name, -1.0) for name in ("cheap", "other")}
    hard = Member("hard", -1.0, helpers={name: lambda one=one: one for name, one in helpers.items()})
    cheap = Member("cheap", 0.5)
    found, _ = asked(cheap, hard, rule=rule)
    assert found.f_ttr == pytest.approx(0.5)
    refused = {t for t in cheap.asked if t > 0.55}
    assert refused & set(hard.asked)
    assert set(helpers["other"].asked) == set(hard.asked)
    assert set(helpers["cheap"].asked) == set(hard.asked) - refused


@pytest.mark.parametrize("rule", ["bisect", "scan"])
def test_where_feasibility_is_contiguous_a_helper_is_not_asked_after_it_found_nothing(rule):
    helper = Member("cheap", -1.0)
    hard = Member("hard", 1.1, helpers={"cheap": lambda: helper})
    cheap, better = Member("cheap", 0.5), Member("better", 0.9)
    found, _ = asked(cheap, better, hard, rule=rule)
    assert found.f_ttr == pytest.approx(1.1)
    assert max(hard.asked) > 1.15
    assert helper.asked == []  # by bisection it was asked at 0.6 s and not later, by a scan everywhere


def test_no_proof_is_looked_for_where_a_visit_costs_less():
    """A member without helpers, or whose helpers have all found nothing, begins with the next time left."""
    for rule, cheap in (("bisect", True), ("scan", False)):
        for members in ((), (Member("helper", 0.5),)):
            proof = TooLate(0.9)
            hard = Member("hard", -1.0, helpers={one.name: lambda one=one: one for one in members})
            asked(*(members or (Member("first", 0.5),)), hard, rule=rule, hopeless=proof)
            assert (proof.asked == []) is cheap
            assert hard.asked[0] == pytest.approx(0.6)


def alone(first, *others, **keys):
    """The search by one backend that has fallbacks."""
    source = Source()
    situation = SimpleNamespace(
        source=source, unguided=source, judge=Checker(), conflict=Conflict(2.0, "margin", contact_time=2.0)
    )
    named = {other.name: other for other in others}
    first.capabilities = replace(first.capabilities, fallbacks=lambda: named)
    told = []
    settings = SearchConfig(rule="scan", delta_t=STEP)
    found = search_with(first, first.name, situation, settings, on_probe=told.append, **keys)
    assert [probe.t_rep for probe in told] == [probe.t_rep for probe in found.probes]
    return found, capabilities_of(first, found)


def test_a_fallback_is_asked_where_nothing_is_found_and_says_so():
    second, third = Member("second", 0.7, jumps=True), Member("third", 1.5)
    found, can = alone(Member("first", -1.0), Member("none", -1.0), second, third)
    assert found.f_ttr == pytest.approx(0.7)
    assert (found.best.by, found.best.fallback) == ("second", True)
    assert can.jumps
    assert can.fallbacks is None
    assert third.asked == []
    assert [probe.by for probe in found.probes[:1]] == [""]


def test_no_fallback_is_asked_where_something_is_found_or_the_times_are_given():
    second = Member("second", 1.9)
    found, _ = alone(Member("first", 0.1), second)
    assert found.f_ttr == pytest.approx(0.1)
    assert not found.best.fallback
    missed, can = alone(Member("first", -1.0), second, visits=[0.5])
    assert missed.status is SearchStatus.NONE_FEASIBLE
    assert not can.jumps
    assert second.asked == []


def test_no_fallback_finds_anything():
    found, _ = alone(Member("first", -1.0), Member("first", 1.9), Member("second", -1.0))
    assert found.status is SearchStatus.NONE_FEASIBLE
    assert {probe.by for probe in found.probes} == {"", "second"}


def test_settings_of_those_who_may_be_asked_have_an_effect():
    def idle(*overrides, backend="qptr"):
        return {key for key, *_ in load_config(backend=backend, overrides=list(overrides)).without_effect()}

    assert idle("shooting.seed=1", "casadi.solver=sqpmethod") == set()
    assert idle("shooting.seed=1", "casadi.solver=sqpmethod", "fallback=[shooting]") == {"casadi.solver"}
    assert idle("shooting.seed=1", "fallback=[]") == {"shooting.seed"}
    assert idle("casadi.solver=sqpmethod", "fallback=[portfolio]") == set()
    assert idle("qptr.solver=osqp", "shooting.seed=1", "fallback=[]", backend="portfolio") == set()
    assert idle("shooting.seed=1", "fallback=[]", backend="casadi") == set()


def test_a_violation_of_one_member_does_not_end_the_search():
    class Strict(Checker):
        def check(self, problem, curve):
            late = problem.t_rep > 0.3 + 1e-9
            return Verdict((Violation(Reason.LIMITS, problem.t_rep),) if late else ())

    source = Source()
    situation = SimpleNamespace(
        source=source, unguided=source, judge=Strict(), conflict=Conflict(1.0, "margin", contact_time=1.0)
    )
    one, two = Member("one", 9.0), Member("two", 9.0)
    whole = SimpleNamespace(capabilities=Capabilities(members=lambda: {"one": one, "two": two}))
    found = search_with(whole, "portfolio", situation, SearchConfig(delta_t=STEP, rule="bisect"))
    assert found.f_ttr == pytest.approx(0.3)
    assert two.asked == [pytest.approx(0.4)]
