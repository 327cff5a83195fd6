"""What a cycle takes from the one before: where its search begins, and what is asked there first."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from tests import toy
from tests.unit.test_search import search, until

from repair.cycle.kept import KeptRepair, hints
from repair.scene.frame import FrenetFrame

STEP = 0.4
FRAME = FrenetFrame.from_points([[0.0, 0.0], [200.0, 0.0]])


def kept(latest: float, now: float = 0.0, last: KeptRepair | None = None) -> KeptRepair:
    """The repair of a search, on a grid of 0.4 s, where everything until ``latest`` passes."""
    found = search(until(latest), 2.9, delta_t=STEP, rule="scan")
    new = KeptRepair(toy.constant(), found.f_ttr, now, FRAME, found.best)
    return new.beside(found, now, last)


def test_the_next_search_begins_in_the_middle_of_what_is_not_known() -> None:
    first = kept(1.5)
    assert (first.f_ttr, first.failed) == (pytest.approx(1.2), pytest.approx(1.6))
    # feasible until 1.2 to 1.6 s, seen from 0.1 s: 1.1 to 1.5 s
    guess, like = hints(first, 0.1, STEP)
    assert guess == pytest.approx(1.3)
    assert like == (first.probe, pytest.approx(1.5))
    # a search of that moment finds 1.2 s, 1.3 s after the first: less is left open than it knows by itself
    second = kept(1.4, 0.1, first)
    assert (second.f_ttr, second.failed) == (pytest.approx(1.2), pytest.approx(1.5))
    assert hints(second, 0.3, STEP)[0] == pytest.approx(0.5 * (1.0 + 1.3))


def test_what_was_refuted_since_is_forgotten() -> None:
    first = kept(0.5)  # 0.4 s, not 0.8 s
    later = kept(2.1, 0.1, first)
    assert (later.f_ttr, later.failed) == (pytest.approx(2.0), pytest.approx(2.4))


def test_nothing_is_known_of_what_is_past_or_was_not_asked() -> None:
    assert hints(None, 0.1, STEP) == (None, None)
    last = kept(0.5)
    assert hints(last, 0.5, STEP)[0] is None
    bare = KeptRepair(toy.constant(), 0.4, 0.0, FRAME)
    assert hints(bare, 0.1, STEP) == (pytest.approx(0.5), None)
    assert bare.failed == math.inf


def test_a_search_that_was_cut_short_says_nothing_of_what_failed() -> None:
    found = search(until(0.5), 2.9, delta_t=STEP, rule="scan")
    bare = KeptRepair(toy.constant(), 0.4, 0.0, FRAME)
    assert bare.beside(found, 0.0).failed == pytest.approx(0.8)
    assert bare.beside(replace(found, complete=False), 0.0).failed == math.inf
