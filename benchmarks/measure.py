"""Timing, figures and the shapes in which they travel: samples, rows, targets."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

Call = Callable[[], Any]


@dataclass(frozen=True)
class Spread:
    """Median, quartiles and extremes."""

    median: float
    q1: float
    q3: float
    low: float
    high: float
    count: int

    @classmethod
    def of(cls, values: Any) -> Spread:
        x = np.asarray(values, dtype=np.float64)
        q1, median, q3 = np.percentile(x, [25, 50, 75])
        return cls(float(median), float(q1), float(q3), float(x.min()), float(x.max()), len(x))

    def scaled(self, factor: float) -> Spread:
        numbers = (self.median, self.q1, self.q3, self.low, self.high)
        return Spread(*(factor * x for x in numbers), self.count)


@dataclass(frozen=True)
class Times:
    """CPU and wall time of one call [s], round by round."""

    cpu: tuple[float, ...]
    wall: tuple[float, ...]


@dataclass(frozen=True)
class Row:
    """One figure. ``ratio``: how many times less than ``against`` (measured alternately with it)."""

    group: str
    name: str
    unit: str
    cpu: Spread
    wall: Spread | None = None
    ratio: Spread | None = None
    against: str = ""
    note: str = ""


@dataclass(frozen=True)
class Target:
    """What is wanted, what was measured, and whether that is enough."""

    name: str
    wanted: str
    measured: str
    holds: bool


@dataclass
class Report:
    """Everything one run found."""

    rows: list[Row] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def add(self, other: Report) -> None:
        self.rows += other.rows
        self.targets += other.targets
        self.remarks += other.remarks

    def to_dict(self) -> dict[str, Any]:
        return {
            "rows": [asdict(r) for r in self.rows],
            "targets": [asdict(t) for t in self.targets],
            "remarks": self.remarks,
        }


@contextmanager
def _no_collection() -> Iterator[None]:
    """As :mod:`timeit`: the collector does not run inside a sample."""
    was = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


def together(
    calls: Mapping[str, Call], rounds: int, *, warm_up: int = 2, shortest: float = 2e-3
) -> dict[str, Times]:
    """Times of several calls, taken in turns: whatever else the machine does, it does to all of them.

    Parameters
    ----------
    calls : mapping
        By name.
    rounds : int
        Samples of each.
    warm_up : int
        Calls of each that are not counted.
    shortest : float
        A call that takes less is repeated within a sample until it lasts that long [s], after one more that
        is not counted: what ran before it has emptied the processor's caches.
    """
    number = {}
    for name, call in calls.items():
        lasted = np.inf
        for _ in range(max(warm_up, 1)):
            begin = time.perf_counter()
            call()
            lasted = min(lasted, time.perf_counter() - begin)
        number[name] = max(1, int(np.ceil(shortest / max(lasted, 1e-9))))
    cpu: dict[str, list[float]] = {name: [] for name in calls}
    wall: dict[str, list[float]] = {name: [] for name in calls}
    with _no_collection():
        for _ in range(rounds):
            for name, call in calls.items():
                repeats = range(number[name])
                if number[name] > 1:
                    call()
                begin_wall, begin = time.perf_counter(), time.process_time()
                for _ in repeats:
                    call()
                spent, passed = time.process_time() - begin, time.perf_counter() - begin_wall
                cpu[name].append(spent / number[name])
                wall[name].append(passed / number[name])
            gc.collect()
    return {name: Times(tuple(cpu[name]), tuple(wall[name])) for name in calls}


def rounds_within(call: Call, budget: float, fewest: int, most: int) -> int:
    """How many rounds of ``call`` fit into ``budget`` [s]; one call is made to find out."""
    begin = time.perf_counter()
    call()
    return int(np.clip(budget / max(time.perf_counter() - begin, 1e-6), fewest, most))


def ratio(slow: Times, fast: Times) -> Spread:
    """Spread of slow / fast over the rounds, by CPU time."""
    return Spread.of(np.asarray(slow.cpu) / np.maximum(fast.cpu, 1e-9))


def row(
    group: str,
    name: str,
    times: Times,
    against: Times | None = None,
    label: str = "",
    note: str = "",
    unit: str = "ms",
) -> Row:
    """A row of times, in milliseconds unless ``unit`` says microseconds."""
    factor = {"ms": 1e3, "us": 1e6, "s": 1.0}[unit]
    compared = None if against is None else ratio(against, times)
    cpu, wall = (Spread.of(x).scaled(factor) for x in (times.cpu, times.wall))
    return Row(group, name, unit, cpu, wall, compared, label if compared else "", note)


def exponent(x: Any, y: Any) -> float:
    """Slope of log y over log x."""
    return float(
        np.polyfit(np.log(np.asarray(x, dtype=np.float64)), np.log(np.asarray(y, dtype=np.float64)), 1)[0]
    )
