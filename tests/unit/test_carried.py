"""Searches that end after so many solves, and go on in the next cycle."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from repair.deadline import OutOfTime
from repair.search.rules import around
from repair.search.settings import SearchConfig
from repair.simulate.carried import Stint, carried_from
from repair.simulate.share import Share
from repair.timegrid import INSTANT

STEP = 0.1


def probe(k: int, feasible: bool, sides: int = 1):
    return SimpleNamespace(t_rep=k * STEP, feasible=feasible, tried=("left",) * sides)


@pytest.mark.parametrize(
    "probes, needed, ended",
    [
        ([probe(9, False), probe(8, False)], True, None),  # it is still to be found
        ([probe(9, False), probe(8, False)], False, 2),
        ([probe(9, False, sides=2)], False, 1),
        ([probe(9, False), probe(1, True), probe(5, True)], False, 3),  # what is found first cannot wait
        ([probe(5, True), probe(7, False)], True, 2),
    ],
)
def test_a_stint_ends_where_a_repair_can_be_waited_for(probes, needed, ended):
    stint = Stint(2, 0.2, needed)
    for count, one in enumerate(probes, start=1):
        if count == ended:
            with pytest.raises(OutOfTime):
                stint(one)
            break
        stint(one)
    assert stint.ended is (ended is not None)
    without = Stint(None, 0.2)
    for one in probes:
        without(one)
    assert not without.ended


def places_from(guess, known, above, stride, size):
    """As :func:`repair.cycle.searching.searched` visits them."""
    known = -1 if known is None else round(known / STEP)
    if above is not None:
        size = min(size, max(int(np.ceil(above / STEP - INSTANT)), known + 1))
    return around(int(np.floor(guess / STEP + INSTANT)), known, size, max(round(stride / STEP), 1))


def visited(order, stint, feasible):
    """What is visited of an order until its stint is over."""
    found, k = [], next(order, None)
    while k is not None:
        found.append(probe(k, feasible(k)))
        try:
            stint(found[-1])
            k = order.send(found[-1].feasible)
        except (OutOfTime, StopIteration):
            break
    return found


@given(last=st.integers(-1, 40), size=st.integers(1, 41), first=st.integers(0, 40), solves=st.integers(1, 4))
def test_what_is_carried_on_ends_at_the_last_place_with_a_repair(last, size, first, solves):
    """Cycle after cycle at the same time, by a rule that takes feasibility to be contiguous."""
    on, best, end = (None, min(first, size - 1) * STEP, None, STEP), None, size * STEP
    places = []
    for _ in range(13):
        known, guess, above, stride = on
        stint = Stint(solves, 0.0, best=-np.inf if known is None else known)
        found = visited(places_from(guess, known, above, stride, size), stint, lambda k: k <= last)
        places += [round(one.t_rep / STEP) for one in found]
        assert len(found) == solves or not stint.ended
        best = max((one.t_rep for one in found if one.feasible), default=known)
        carried = carried_from(found, 0.0, end, STEP, (known, above)) if stint.ended else None
        on = None if carried is None else carried.seen_from(0.0, best)
        if on is None:
            break
    assert on is None
    assert (-1 if best is None else round(best / STEP)) == min(last, size - 1)
    whole = visited(around(min(first, size - 1), -1, size), Stint(None, 0.0), lambda k: k <= last)
    assert places == [round(one.t_rep / STEP) for one in whole]  # none is left out, none asked twice


def test_what_is_kept_meanwhile_does_not_end_a_search_from_above():
    """Nothing at 0.9 and 0.8 s; the repair at 0.2 s is kept, and the next place is 0.6 s."""
    assert carried_from([], 1.0, 1.2, STEP).seen_from(1.2, 0.2) == (None, None, None, None)  # from the start
    carried = carried_from([probe(9, False), probe(8, False)], 1.0, 1.2, STEP)
    assert carried.seen_from(1.0, 0.2) == (None, *map(pytest.approx, (0.6, 0.8, 0.4)))
    assert carried.seen_from(1.2, 0.0) == (None, *map(pytest.approx, (0.4, 0.6, 0.4)))
    assert carried.seen_from(1.2, 0.6) is None
    found = carried_from([probe(6, False), probe(2, True)], 1.0, 1.2, STEP, (None, 0.8))
    assert found.seen_from(1.0, 0.2) == pytest.approx((0.2, 0.4, 0.6, 1.6))


@pytest.mark.parametrize("brief, places", [(False, [0.2, 0.4, 0.2]), (True, [0.2, 0.0])])
def test_briefly_only_a_repair_at_once_is_looked_for_where_none_can_be_waited_for(monkeypatch, brief, places):
    asked, nothing = [], SimpleNamespace(curve=None, probes=(probe(9, False), probe(8, False)))
    share = Share(
        SimpleNamespace(), SimpleNamespace(name="any", capabilities=None), SearchConfig(delta_t=STEP), 0.0
    )
    share.carried = carried_from(nothing.probes, 0.0, 1.2, STEP)

    def visit(_, *where):
        asked.extend(where)
        return nothing

    def search(_, rest, *unused, **keys):
        asked.extend((rest[1] - 0.2, 0.2))  # from below the last place on
        return nothing

    monkeypatch.setattr(Share, "visit", visit)
    monkeypatch.setattr(Share, "search", search)
    share.to_wait_on(nothing, 0.2, brief=brief)
    assert asked == pytest.approx(places)
    assert (share.carried is None) == brief


@pytest.mark.parametrize(
    "deadline, limit, most", [(None, 9.0, 4.0), (7.0, None, 2.0), (7.0, 9.0, 2.0), (7.0, 0.0, 0.001)]
)
def test_all_that_a_cycle_searches_has_one_limit(deadline, limit, most):
    backend = SimpleNamespace(name="any", capabilities=None)
    share = Share(SimpleNamespace(), backend, SearchConfig(time_limit=limit), 0.0, deadline)
    share._begin -= 5.0
    assert 0.0 < share.timely().time_limit <= most
