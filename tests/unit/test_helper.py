"""Where a hard backend finds nothing, a verified curve of another one is what it starts from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from tests import toy

from repair.backend.base import Capabilities, Closest, SolveResult, SolveStatus
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.config import load_config
from repair.curves.fitting import fit_to_curve
from repair.cycle.ready import configured, made_ready
from repair.deadline import OutOfTime
from repair.errors import RepairError
from repair.problem.problem import Maneuver
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig
from repair.solvers.casadi.backend import CasadiBackend
from repair.solvers.casadi.settings import CasadiConfig
from repair.solvers.registry import make_backend

# ------------------------------------------------------------------ the seam


@dataclass
class Source:
    """One problem at every t_rep; counts how often a curve was made the guide."""

    strict: bool = False
    along_asked: list = field(default_factory=list)
    notches = ((), (), ())

    def at(self, t_rep):
        return (replace(toy.problem((), t_rep=t_rep, t_end=t_rep + 2.0), strict=self.strict),)

    def relaxed(self, t_rep):
        return ()

    def widened(self, t_rep):
        return ()

    def without_guide(self, t_rep):
        return self.at(t_rep)

    def along(self, manoeuvre, kind, *, jumps=False):
        self.along_asked.append((manoeuvre, kind))
        return self.at(manoeuvre.t_start)[0]


@dataclass
class Hard:
    """Finds nothing, unless it is shown a curve that begins where the repair does."""

    capabilities: Capabilities
    near: bool = True
    name = "hard"

    def solve(self, problem, *, warm_start=None, time_limit=None):
        shown = warm_start is not None and warm_start.t_start == problem.t_rep
        closest = Closest(warm_start, 0.25, {"obstacles": 0.25}) if shown and self.near else None
        return SolveResult(SolveStatus.INFEASIBLE, detail="no gap", closest=closest)


class Soft:
    """Finds a curve of its own."""

    name, capabilities = "soft", Capabilities()

    def solve(self, problem, *, warm_start=None, time_limit=None):
        assert warm_start is None
        curve = fit_to_curve(toy.constant(10.0), problem.t_rep, 13, 3, 0.2)
        return SolveResult(SolveStatus.SOLVED, curve=curve, objective=1.0)


@dataclass
class Until(toy.Judging):
    latest: float

    def check(self, problem, curve):
        late = problem.t_rep > self.latest + 1e-9
        return Verdict((Violation(Reason.COLLISION, problem.t_rep + 0.3),) if late else ())


def search(backend, source=None, latest=1.2, **keys):
    conflict = Conflict(2.9, "margin", 7, 2.95)
    settings = SearchConfig(delta_t=0.4, rule="bisect", **keys)
    return search_f_ttr(source or Source(), conflict, backend, Until(latest), settings)


def test_what_the_helper_found_is_handed_over_and_the_answer_is_the_backends_own():
    source = Source()
    found = search(Hard(Capabilities(helpers={"soft": Soft})), source)
    assert found.f_ttr == pytest.approx(1.2)  # where the helper's curves end to be accepted
    best = found.best
    assert best.margin == pytest.approx(toy.problem(()).margin - 0.25)
    assert best.solve.residuals == {"obstacles": 0.25}
    assert best.tried == (
        "follow: not_solved",
        "follow: feasible (from a curve of soft that passes every check)",
    )
    assert all(curve.t_start in {probe.t_rep for probe in found.probes} for curve, _ in source.along_asked)
    assert {kind for _, kind in source.along_asked} == {Maneuver.YIELD}


def test_without_a_helper_or_with_a_strict_problem_nobody_is_asked():
    assert search(Hard(Capabilities())).f_ttr is None
    source = Source(strict=True)
    assert search(Hard(Capabilities(helpers={"soft": Soft})), source).f_ttr is None
    assert not source.along_asked


def test_a_helpers_curve_is_no_answer_by_itself_and_the_reason_is_said():
    found = search(Hard(Capabilities(helpers={"soft": Soft}), near=False))
    assert found.f_ttr is None
    assert "from a curve of soft that passes every check: no gap" in found.probes[0].solve.detail
    nothing = search(
        Hard(Capabilities(helpers={"soft": Soft})), latest=-1.0
    )  # the checker accepts none of its curves
    assert nothing.f_ttr is None
    assert all("soft" not in text for probe in nothing.probes for text in probe.tried)


class Laddered(Source):
    """Says which times other margins were asked for at."""

    def __init__(self):
        super().__init__()
        self.ladder = []

    def relaxed(self, t_rep):
        self.ladder.append(t_rep)
        return ()


class Blind(Soft):
    """Finds nothing, by its own way or by one that it is shown."""

    def __init__(self, own_way):
        self.capabilities = Capabilities(own_way=own_way)

    def solve(self, problem, *, warm_start=None, time_limit=None):
        return SolveResult(SolveStatus.INFEASIBLE)


class Free(Soft):
    """Finds a curve by its own way."""

    capabilities = Capabilities(own_way=True)


@pytest.mark.parametrize(
    "helper, latest, asked",
    [
        (lambda: Blind(own_way=True), 1.2, False),
        (lambda: Blind(own_way=False), 1.2, True),
        (Free, -1.0, True),  # smaller margins may do what just misses
        (Soft, 1.2, True),
        (None, 1.2, True),
    ],
    ids=["own way, nothing", "shown way, nothing", "own way, refused", "a curve", "nobody"],
)
def test_other_margins_are_not_asked_for_where_somebody_has_looked_everywhere(helper, latest, asked):
    source = Laddered()
    helpers = {} if helper is None else {"helper": helper}
    backend = Hard(Capabilities(relaxes=True, helpers=helpers), near=False)
    assert search(backend, source, latest=latest).f_ttr is None
    assert bool(source.ladder) is asked


def test_without_time_to_make_the_helper_the_search_goes_on_without():
    def late():
        raise OutOfTime("importing takes long")

    found, alone = (
        search(Hard(Capabilities(helpers={"late": late})), time_limit=100.0),
        search(Hard(Capabilities())),
    )
    assert found.complete
    assert [probe.t_rep for probe in found.probes] == [probe.t_rep for probe in alone.probes]
    assert found.probes[0].tried[-1] == "no other backend asked: importing takes long"


def test_the_registry_makes_the_helper_once_and_when_it_is_asked_for():
    backend = make_backend("casadi", load_config(backend="casadi", overrides=["shooting.seed=4"]))
    soft, helper = (make() for make in backend.capabilities.helpers.values())
    assert soft.name == "ego"
    assert helper.name == "shooting"
    assert helper.config.seed == 4
    assert backend.capabilities.helpers["shooting"]() is helper
    assert CasadiBackend.capabilities.helpers == {}
    assert make_backend("ego", load_config()).capabilities.helpers == {}


def test_in_cycles_nobody_helps_who_is_not_named():
    """One of them takes longer than a planner's cycle."""

    def helping(*overrides):
        keys = {"backend": "casadi", "overrides": [*overrides, "fallback=[]", "shooting.seed=4"]}
        config = configured(None, keys)
        assert load_config(**keys).casadi.helpers == (None if not overrides else config.casadi.helpers)
        return list(made_ready(config).capabilities.helpers), [key for key, *_ in config.without_effect()]

    assert helping() == ([], ["shooting.seed"])
    assert helping("casadi.helpers=[ego]") == (["ego"], ["shooting.seed"])
    assert helping("casadi.helpers=[shooting]") == (["shooting"], [])


def test_who_helps_is_a_key():
    def helpers(*overrides):
        config = load_config(backend="casadi", overrides=overrides)
        return list(make_backend("casadi", config).capabilities.helpers), config

    assert helpers()[0] == ["ego", "shooting"]
    assert helpers("casadi.helpers=[]")[0] == []
    names, config = helpers("casadi.helpers=[qptr,qptr]", "qptr.solver=daqp", "fallback=[]")
    assert names == ["qptr"]
    assert not list(config.without_effect())
    # strict problems are shown to nobody
    (said,) = helpers("casadi.helpers=[ego]", "repair.relax=[]")[1].without_effect()
    assert said == ("casadi.helpers", "repair.relax", "[]")


@pytest.mark.parametrize(
    "named, says",
    [
        ("casadi", "casadi.helpers names 'casadi': it cannot help itself"),
        ("portfolio", "casadi.helpers names 'portfolio': it is made of several backends"),
        ("egg", "egg"),
    ],
)
def test_helpers_that_cannot_be(named, says):
    with pytest.raises(RepairError, match=says):
        make_backend("casadi", load_config(backend="casadi", overrides=[f"casadi.helpers=[{named}]"]))


# ------------------------------------------------------------------ what casadi makes of a verified curve


def excess(curve, problem):
    """By how much the derivatives exceed their limits at any millisecond."""
    c, inside = problem.limits, curve.sample(np.arange(problem.t_rep, problem.t_end, 1e-3))
    rows = (
        (inside.velocity[:, 0], 0.0, c.v_max), (inside.acceleration[:, 0], c.a_min, c.a_max),
        (inside.jerk[:, 0], -c.j_lon, c.j_lon),
    )  # fmt: skip
    return max(float(np.maximum(low - value, value - high).max()) for value, low, high in rows)


@pytest.mark.parametrize("solver", ["ipopt", "sqpmethod"])
@pytest.mark.parametrize("shake", [0.0, 0.005, 0.02])
def test_near_a_verified_curve_all_rows_are_kept_and_the_margin_as_it_does(solver, shake):
    """A standing car that cannot be stopped for in time; the curve stops half a metre too late, shaken."""
    problem = toy.problem([toy.box((7.0, 60.0), (-1.0, 1.0))], lateral=False, t_end=3.0)
    backend = CasadiBackend(CasadiConfig(solver=solver), spacing=0.2)
    assert backend.solve(problem).status is SolveStatus.INFEASIBLE
    smooth = backend.solve(replace(problem, margin=-0.5)).curve
    points = smooth.points.copy()
    points[3:, 0] += shake * np.cos(np.pi * np.arange(len(points) - 3))
    verified = replace(smooth, points=points)
    assert (excess(verified, problem) > 1e-3) == (shake > 0.0)  # it asks for more than the limits allow
    shown = backend.solve(problem, warm_start=verified)
    assert shown.curve is None
    curve, miss = shown.closest.curve, shown.closest.miss
    assert excess(curve, problem) <= 1e-5
    assert np.abs(curve.points - smooth.points).max() <= 0.3
    times = np.arange(0.0, 3.0, 1e-3)
    deepest, given_up = (float(c.sample(times).position[:, 0].max()) - 7.0 + 0.1 for c in (curve, verified))
    assert deepest - 1e-6 <= miss <= given_up + 2 * shake + 2e-3
    assert shown.closest.residuals["obstacles"] == pytest.approx(miss)
    assert ("of the verified curve" in shown.detail) == (shake > 0.0)


def test_a_verified_curve_that_keeps_all_rows_is_kept_as_it_is():
    problem = toy.problem([toy.box((30.0, 60.0), (-1.0, 1.0))], lateral=False, t_end=2.0)
    backend = CasadiBackend(CasadiConfig(), spacing=0.2)
    verified = backend.solve(problem).curve
    shown = backend.solve(problem, warm_start=verified)
    np.testing.assert_allclose(shown.closest.curve.points, verified.points, atol=1e-9)
    assert shown.closest.miss == pytest.approx(0.0, abs=1e-6)
    earlier = fit_to_curve(verified, 0.4, len(verified.points), 3, 0.2)
    assert (
        backend.solve(problem, warm_start=earlier).closest is None
    )  # of another t_rep: a neighbour, no more


# ------------------------------------------------------------------ what is proven to be too late


@dataclass
class Slow:
    """Finds its own way, and says what it was asked."""

    asked: list = field(default_factory=list)
    capabilities = Capabilities(own_way=True)
    name = "slow"

    def solve(self, problem, *, warm_start=None, time_limit=None):
        self.asked.append(round(problem.t_rep, 6))
        curve = fit_to_curve(toy.constant(10.0), problem.t_rep, 13, 3, 0.2)
        return SolveResult(SolveStatus.SOLVED, curve=curve, objective=1.0)


class TooLate:
    """Proves it from a time on, and says where it was asked."""

    def __init__(self, since):
        self.first, self.asked = since, []

    def __call__(self, t_rep):
        self.asked.append(round(t_rep, 6))
        return t_rep > self.first

    def since(self, times):
        return min((t for t in times if self(t)), default=np.inf)


def searched(backend, **keys):
    settings = SearchConfig(delta_t=0.4, rule="scan", **keys)
    conflict = Conflict(2.9, "margin", 7, 2.95)
    return search_f_ttr(Source(), conflict, backend, Until(1.6), settings, hopeless=TooLate(1.9))


def test_a_hard_backend_asks_no_helper_at_a_time_that_is_proven_to_be_too_late():
    source = Slow()
    hard = Hard(Capabilities(helpers={"slow": lambda: source}))
    found = searched(hard)
    assert source.asked == [0.0, 0.4, 0.8, 1.2, 1.6]
    assert all("no further: it is proven to be too late" in p.tried for p in found.probes if p.t_rep > 1.9)
