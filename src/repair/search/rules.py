"""Which times-to-repair are visited, and in which order."""

from __future__ import annotations

from collections.abc import Callable, Generator

from repair.errors import ConfigError
from repair.registry import Registry, called
from repair.timegrid import ROUNDING, intervals

__all__ = ["CONTIGUOUS", "RULES", "IsOpen", "Order", "Rule", "around", "from_the_end", "probe_order"]

#: Yields the next t_rep [s], is sent whether it was feasible.
Order = Generator[float, bool, None]
#: Whether a way past the obstacles seems to be open at a t_rep [s].
IsOpen = Callable[[float], bool]


def _grid_size(end: float, delta_t: float) -> int:
    """Number of grid points k * delta_t in [0, end)."""
    return max(0, intervals(end, delta_t))


def _bisect(end: float, delta_t: float, is_open: IsOpen) -> Order:
    feasible, infeasible = -1, _grid_size(end, delta_t)
    if infeasible == 0:
        return
    if (yield 0.0):
        feasible = 0
    else:
        return
    while infeasible - feasible > 1:
        middle = (feasible + infeasible) // 2
        if (yield middle * delta_t):
            feasible = middle
        else:
            infeasible = middle


def _guided(end: float, delta_t: float, is_open: IsOpen) -> Order:
    size = _grid_size(end, delta_t)
    order = around(_last_open(size, delta_t, is_open), -1, size)
    answer: bool | None = None
    while True:
        try:
            k = next(order) if answer is None else order.send(answer)
        except StopIteration:
            return
        answer = yield k * delta_t


def from_the_end(end: float, delta_t: float) -> Order:
    """The last point of the grid below ``end`` [s], and where that is not feasible bisection."""
    feasible, infeasible = -1, _grid_size(end, delta_t)
    k = infeasible - 1
    while infeasible - feasible > 1:
        if (yield k * delta_t):
            feasible = k
        else:
            infeasible = k
        k = (feasible + infeasible) // 2


def around(first: int, feasible: int, size: int, stride: int = 1) -> Generator[int, bool, None]:
    """From a point of the grid on to where feasible and infeasible meet.

    Parameters
    ----------
    first : int
        Where to begin.
    feasible : int
        The last point that is known to be feasible; -1 where none is.
    size : int
        Number of points.
    stride : int
        How much farther it looks after the first point; twice as far each time.

    Yields
    ------
    int
        The next point; sent is whether it was feasible.
    """
    infeasible, k = size, first
    while infeasible - feasible > 1:
        k = min(max(k, feasible + 1), infeasible - 1)
        if (yield k):
            feasible = k
        else:
            infeasible = k
        if feasible >= 0 and infeasible < size:
            k = (feasible + infeasible) // 2
        else:  # on in the same direction, twice as far each time, until there is an answer of each kind
            k += stride if feasible == k else -stride
            stride *= 2


def _last_open(size: int, delta_t: float, is_open: IsOpen) -> int:
    """Where on the grid the ways past the obstacles seem to shut, by bisection: the last open point, or 0."""
    found, shut = 0, size
    while shut - found > 1:
        middle = (found + shut) // 2
        if is_open(middle * delta_t):
            found = middle
        else:
            shut = middle
    return found


def _scan(end: float, delta_t: float, is_open: IsOpen) -> Order:
    for k in range(_grid_size(end, delta_t)):
        yield k * delta_t


def _as_printed(end: float, delta_t: float, is_open: IsOpen) -> Order:
    start, t_rep = 0.0, 0.0
    while abs(end - start) > delta_t + ROUNDING:
        if (yield t_rep):
            start = t_rep
        else:
            end = t_rep
        t_rep = 0.5 * (start + end)


#: A rule makes the order of visits from the upper end, Delta T, and the guess at what is open.
Rule = Callable[[float, float, IsOpen], Order]

#: The rules that take feasibility to be contiguous.
CONTIGUOUS = ("bisect", "guided")

RULES: Registry[Rule] = Registry(
    "search rule",
    {"bisect": _bisect, "guided": _guided, "scan": _scan, "as_printed": _as_printed},
    error=ConfigError,
    group="repair.rules",
    admit=called,
)


def probe_order(rule: str, end: float, delta_t: float, is_open: IsOpen = lambda t_rep: True) -> Order:
    """The times-to-repair that a rule visits below ``end`` [s].

    Parameters
    ----------
    rule : str
        ``guided``: from the last grid point at which a way past the obstacles is open on, to where
        feasible and infeasible meet; ``bisect``: t_rep = 0, then bisection on the grid; both assume
        that feasibility is contiguous. ``scan``: every grid point, which assumes nothing;
        ``as_printed``: Algorithm 1 to the letter.
    is_open : callable
        Whether a way past the obstacles is open at a t_rep [s]: a guess at feasibility that costs
        little. Only ``guided`` asks, and a wrong answer costs it probes, nothing else.
    """
    return RULES[rule](end, delta_t, is_open)
