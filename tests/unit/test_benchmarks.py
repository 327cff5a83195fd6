"""The benchmark's own arithmetic, and that it measures what exists."""

from __future__ import annotations

import time

import numpy as np
import pytest
from benchmarks import graded, machine, measure, phases, table


@pytest.mark.parametrize("group", [phases.CHECKS, phases.LITERAL, *phases.SOLVING.values()])
def test_every_phase_exists(group: dict[str, str]) -> None:
    assert [target for target in group.values() if phases.resolve(target) is None] == []


def test_time_inside_a_phase_belongs_to_the_inner_one(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter(np.arange(0.0, 10.0, 1.0))
    monkeypatch.setattr(time, "process_time", lambda: next(clock))
    watch = phases.Stopwatch({})
    inner = watch.timed("inner", lambda: None)
    outer = watch.timed("outer", lambda: (inner(), inner()))
    outer()
    assert watch.spent == {"inner": 2.0, "outer": 3.0}


def test_stopwatch_leaves_everything_as_it_was() -> None:
    targets = {name: target for group in phases.SOLVING.values() for name, target in group.items()}
    owners = [phases.resolve(target) for target in targets.values()]
    before = [getattr(*found) for found in owners if found]
    with phases.Stopwatch(targets).running():
        assert [getattr(*found) for found in owners if found] != before
    assert [getattr(*found) for found in owners if found] == before


def test_ratio_is_taken_round_by_round() -> None:
    slow = measure.Times((2.0, 20.0, 4.0), (0.0,) * 3)
    fast = measure.Times((1.0, 10.0, 1.0), (0.0,) * 3)
    assert measure.ratio(slow, fast).median == 2.0


def test_calls_take_turns() -> None:
    order: list[str] = []
    calls = {name: (lambda name=name: order.append(name)) for name in "ab"}
    found = measure.together(calls, 3, warm_up=1, shortest=0.0)
    assert order == list("ab" * 4)
    assert all(len(times.cpu) == 3 for times in found.values())


def test_exponent() -> None:
    x = np.array([20.0, 40.0, 80.0, 160.0, 320.0])
    assert measure.exponent(x, 3.0 * x**1.5) == pytest.approx(1.5)


def test_columns_are_aligned_and_empty_ones_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [
        measure.Row("g", name, "ms", measure.Spread.of([x])) for name, x in (("a", 1.0), ("longer", 123.4))
    ]
    table.print_report(measure.Report(rows), {**machine.describe(), "duration_s": 1.0})
    *_, group, head, first, second = capsys.readouterr().out.splitlines()
    assert (group, head.split()) == ("g", ["median"])
    assert [first, second] == ["  a         1.00  ms", "  longer     123  ms"]


def test_no_place_is_on_both_sides() -> None:
    files = [
        f"{place}-{k}_1.xml" for place, many in (("A", 1), ("B", 4), ("C", 2), ("D", 2)) for k in range(many)
    ]
    one, two = graded.halves(reversed(files))
    assert one | two == set(files)
    assert not {file[0] for file in one} & {file[0] for file in two}
    assert {file[0] for file in one} == {"A", "C", "D"}  # dealt to the side with fewer
    assert graded.halves(files) == (one, two)
