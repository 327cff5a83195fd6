"""A way that the checker rejected is asked for again with more to spare of what it missed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from tests import toy
from tests.roads import lanelet, problem, scenario, state
from tests.unit.test_search import FakeBackend, FakeSource

import repair
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.problem.problem import Maneuver
from repair.search.again import Notches, other_ways, too_close
from repair.search.result import Like, Probe, SearchStatus
from repair.search.search import search_f_ttr
from repair.search.settings import SearchConfig

LISTS = ((0.3, 0.6), (0.1, 0.3, 0.6), (0.05, 0.1, 0.2))


@dataclass
class Tightening(FakeSource):
    """The problems of the fake search, with notches to take."""

    notches: tuple[tuple[float, ...], ...] = LISTS
    wider: tuple[tuple[Maneuver, ...], ...] = ()

    def widened(self, t_rep):
        for maneuvers in self.wider:
            yield replace(self, maneuvers=maneuvers).at(t_rep)


@dataclass
class Demanding(toy.Judging):
    """Misses a reason until what answers it has been tightened by enough."""

    needs: dict[Reason, float]
    seen: list[tuple[float, float, float]] = field(default_factory=list)

    def check(self, problem, curve):
        was = toy.problem(())
        room = round(problem.clearance - was.clearance, 9)
        edge = round(float((problem.bounds.right - was.bounds.right).max()), 9)
        unused = round(1.0 - problem.limits.a_total / was.limits.a_total, 9)
        assert problem.margin - was.margin == pytest.approx(room)
        self.seen.append((room, edge, unused))
        has = {
            Reason.MARGIN: room, Reason.COLLISION: room, Reason.OFF_ROAD: edge, Reason.LIMITS: unused,
            Reason.KINEMATICS: unused, Reason.CHECKER_ERROR: 0.0,
        }  # fmt: skip
        missed = [reason for reason, much in self.needs.items() if has[reason] < much - 1e-9]
        return Verdict(tuple(Violation(reason, problem.t_rep) for reason in missed))


def searched(checker, source=None, backend=None, like=None, **settings):
    keys = SearchConfig(upper=0.0, **settings)
    source = source or Tightening()
    like = Like(like) if isinstance(like, Probe) else like
    return search_f_ttr(source, Conflict(2.0, "margin"), backend or FakeBackend(), checker, keys, like=like)


@pytest.mark.parametrize(
    "needs, seen",
    [
        ({Reason.MARGIN: 0.6}, [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.6, 0.0, 0.0)]),
        ({Reason.OFF_ROAD: 0.2}, [(0.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.3, 0.0)]),
        ({Reason.LIMITS: 0.05}, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.05)]),
        ({Reason.KINEMATICS: 0.1}, [(0.0, 0.0, 0.0), (0.0, 0.0, 0.05), (0.0, 0.0, 0.1)]),
        ({Reason.OFF_ROAD: 0.1, Reason.LIMITS: 0.1}, [(0.0, 0.0, 0.0), (0.0, 0.1, 0.05), (0.0, 0.1, 0.1)]),
        ({Reason.COLLISION: 0.3, Reason.OFF_ROAD: 0.3}, [(0.0, 0.0, 0.0), (0.3, 0.1, 0.0), (0.3, 0.3, 0.0)]),
    ],
)
def test_what_was_missed_is_tightened_notch_by_notch(needs, seen):
    checker = Demanding(needs)
    result = searched(checker)
    assert result.status is SearchStatus.FOUND
    assert checker.seen == seen
    assert len(result.probes[0].tried) == len(seen)


@pytest.mark.parametrize(
    "needs, visits",
    [
        ({Reason.MARGIN: 9.0}, 3),
        ({Reason.OFF_ROAD: 9.0}, 4),
        ({Reason.CHECKER_ERROR: 1.0}, 1),
        # More room would cost more of the limits, which are exceeded already.
        ({Reason.MARGIN: 0.3, Reason.LIMITS: 0.05}, 1),
        ({Reason.COLLISION: 0.3, Reason.KINEMATICS: 0.05}, 1),
    ],
)
def test_it_ends_where_no_notch_is_left_or_none_would_help(needs, visits):
    checker = Demanding(needs)
    result = searched(checker)
    assert result.status is SearchStatus.NONE_FEASIBLE
    assert len(checker.seen) == visits


def test_nothing_is_asked_again_where_a_side_passes():
    checker = Demanding({})
    assert searched(checker, Tightening((Maneuver.YIELD, Maneuver.LEFT))).f_ttr == 0.0
    assert checker.seen == [(0.0, 0.0, 0.0)] * 2


def test_the_first_of_the_tightened_sides_that_passes_is_taken():
    """Without tightening it is the one of least cost, which may be the second."""
    source = Tightening((Maneuver.YIELD, Maneuver.LEFT))
    for missed, wanted in ((0.05, Maneuver.YIELD), (0.0, Maneuver.LEFT)):
        backend = FakeBackend(costs={Maneuver.YIELD: 2.0, Maneuver.LEFT: 1.0})
        result = searched(Demanding({Reason.LIMITS: missed}), source, backend, sides="best")
        assert result.probes[0].maneuver is wanted


def test_what_passed_before_is_asked_first_as_tight():
    before = searched(Demanding({Reason.MARGIN: 0.5})).probes[0]
    assert before.tightened == (0.6, 0.0, 0.0)
    checker = Demanding({Reason.MARGIN: 0.4})
    (probe,) = searched(checker, like=before).probes
    assert checker.seen == [(0.6, 0.0, 0.0)]
    assert (probe.tried, probe.tightened) == (("yield: feasible (margin +0.6 m)",), before.tightened)
    # not of another side
    checker = Demanding({})
    assert searched(checker, Tightening((Maneuver.LEFT,)), like=before).probes[0].tightened == (0.0, 0.0, 0.0)
    assert checker.seen == [(0.0, 0.0, 0.0)]


@pytest.mark.parametrize("needs", [{Reason.OFF_ROAD: 0.2}, {Reason.MARGIN: 0.6, Reason.OFF_ROAD: 0.1}])
def test_where_that_does_not_pass_the_answer_is_as_if_it_was_not_known(needs):
    before = searched(Demanding({Reason.MARGIN: 0.5})).probes[0]
    alone, checker = searched(Demanding(needs)).probes[0], Demanding(needs)
    (probe,) = searched(checker, like=before).probes
    assert (probe.verdict, probe.tried, probe.tightened) == (alone.verdict, alone.tried, alone.tightened)


@pytest.mark.parametrize("more", [{}, {Reason.OFF_ROAD: 0.1}])
def test_where_it_is_unlikely_to_pass_too_close_with_more_room_is_too_close_with_less(more):
    before = searched(Demanding({Reason.MARGIN: 0.2})).probes[0]
    assert before.tightened == (0.3, 0.0, 0.0)
    checker = Demanding({Reason.MARGIN: 0.6, **more})
    (probe,) = searched(checker, like=Like(before, 0.0)).probes
    assert probe.feasible
    assert checker.seen == [(0.3, 0.0, 0.0), (0.6, 0.1 if more else 0.0, 0.0)]
    # nor is it given up for what it misses with more room only
    checker = Demanding({Reason.OFF_ROAD: 0.1})
    assert searched(checker, like=Like(before, 0.0)).probes[0].tightened == (0.0, 0.1, 0.0)
    assert checker.seen == [(0.3, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.1, 0.0)]


def test_the_other_sides_are_asked_all_the_same():
    before = searched(Demanding({Reason.MARGIN: 0.2})).probes[0]
    checker, backend = Demanding({Reason.MARGIN: 9.0}), FakeBackend()
    source = Tightening((Maneuver.YIELD, Maneuver.LEFT))
    assert not searched(checker, source, backend, like=Like(before, 0.0)).probes[0].feasible
    assert checker.seen[:2] == [(0.3, 0.0, 0.0), (0.0, 0.0, 0.0)]
    assert sorted(checker.seen[2:]) == [(0.3, 0.0, 0.0), (0.6, 0.0, 0.0), (0.6, 0.0, 0.0)]


def test_nothing_is_asked_twice_for_it():
    before = searched(Demanding({Reason.MARGIN: 0.5})).probes[0]
    checker = Demanding({Reason.MARGIN: 9.0})
    assert searched(checker, like=before).status is SearchStatus.NONE_FEASIBLE
    assert checker.seen == [(0.6, 0.0, 0.0), (0.0, 0.0, 0.0), (0.3, 0.0, 0.0)]


def test_larger_margins_may_show_another_way():
    source = Tightening(
        (Maneuver.GO_AHEAD,),
        wider=((Maneuver.GO_AHEAD,), (Maneuver.YIELD, Maneuver.GO_AHEAD)),
        open_until=-1.0,
    )

    class OnlyYield(toy.Judging):
        def check(self, problem, curve):
            found = problem.passing.maneuver is Maneuver.YIELD
            return Verdict() if found else Verdict((Violation(Reason.MARGIN, 0.0),))

    assert searched(OnlyYield(), source).probes[0].maneuver is Maneuver.YIELD
    # Larger boxes open no way: where all that were asked for are open, no other one comes closest.
    shut = searched(OnlyYield(), replace(source, open_until=9.0))
    assert shut.status is SearchStatus.NONE_FEASIBLE
    (only,) = other_ways(source.at(0.0), source.widened(0.0))
    assert [p.passing.maneuver for p in only] == [Maneuver.YIELD]
    assert too_close(Verdict((Violation(Reason.MARGIN, 0.0),)))
    assert not too_close(Verdict((Violation(Reason.OFF_ROAD, 0.0),)))


def test_notches_beyond_a_list_are_none():
    assert Notches(2, 3, 3).amounts(LISTS) == (0.6, 0.6, 0.2)
    assert Notches(3, 0, 0).amounts(LISTS) is None
    assert Notches(0, 0, 0).amounts(((), (), ())) == (0.0, 0.0, 0.0)


def test_a_narrowed_road_keeps_the_path():
    narrowed = toy.NARROW.narrowed(0.6)
    np.testing.assert_array_equal(narrowed.right, [0.0, 0.0])
    np.testing.assert_array_equal(narrowed.left, [0.0, 0.0])
    np.testing.assert_allclose(toy.WIDE.narrowed(0.3).left, [5.7, 5.7])
    path_keeper = toy.problem((), lateral=False)
    assert path_keeper.tightened(0.0, 0.3, 0.0).bounds is path_keeper.bounds


@pytest.mark.thinned(2)
@pytest.mark.parametrize(
    "speed, without, said", [(16.0, "repair.narrow=[]", "m narrower"), (22.0, "repair.ease=[]", "unused")]
)
def test_the_soft_backend_swerves_later_than_at_the_first_try(speed, without, said, tmp_path: Path):
    """Corners leave the road where the ego stands at an angle to it; soft limits are exceeded a little."""
    path = swerve(speed, tmp_path)
    keys = ["reference.source=constant", "search.delta_t=0.1", "search.rule=scan", "limits.v_lat=3"]
    once = repair.repair(path, backend="ego", overrides=[*keys, without])
    again = repair.repair(path, backend="ego", overrides=keys)
    assert again.f_ttr > once.f_ttr + 0.05
    assert again.search.best.maneuver is Maneuver.LEFT
    assert any("left: feasible" in text and said in text for text in again.search.best.tried)


def swerve(speed: float, folder: Path) -> Path:
    """A car that stands 4 s ahead on the right one of two lanes."""
    x = range(-20, 381, 20)
    road = lanelet(1, x, [0.0] * 21, more='<adjacentLeft ref="2" drivingDir="same"/>')
    road += lanelet(2, x, [3.25] * 21, width=3.0, more='<adjacentRight ref="1" drivingDir="same"/>')
    shape = "<shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"
    place = state(4.0 * speed, 0.0, leave=("velocity", "acceleration"))
    parked = f'<staticObstacle id="30"><type>parkedVehicle</type>{shape}{place}</staticObstacle>'
    path = folder / "swerve.xml"
    time = "<time><intervalStart>79</intervalStart><intervalEnd>80</intervalEnd></time>"
    task = problem(100, state(0.0, 0.0, v=speed), f"<goalState>{time}</goalState>")
    text = scenario(road=road, obstacles=parked, problems=task)
    path.write_text(text, encoding="utf-8")
    return path
