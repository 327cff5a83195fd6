"""Visited times-to-repair, and the answer of Algorithm 1."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from repair.backend.base import SolveResult
from repair.check.verdict import Conflict, Verdict
from repair.curves.base import Curve
from repair.problem.problem import Maneuver

__all__ = ["Like", "Probe", "SearchResult", "SearchStatus"]


@dataclass(frozen=True)
class Probe:
    """One visited t_rep: what was solved, and what the checker said.

    Attributes
    ----------
    t_rep : float
        The time-to-repair [s].
    solve : SolveResult
        The backend's answer.
    verdict : Verdict
        The checker's.
    maneuver : Maneuver or None
        How the conflict is passed, where there is a curve.
    check_time : float
        Wall time of all checks [s].
    tried : tuple of str
        The manoeuvres that were tried, in words.
    margin : float or None
        Margin to the boxes that was asked for [m].
    by : str
        The backend that was asked, where there are several.
    jump : float
        By how much the acceleration was made to differ from that of the reference where the repair begins
        [m/s²].
    fallback : bool
        Whether ``by`` was asked because the search had ended without a repair.
    tightened : (3,) tuple of float
        By what the problem was tightened: room [m], road [m], limits (share).
    refused : Verdict or None
        The checker's on the curve that comes closest, where that is no repair either.
    blocked : bool
        Nobody was asked, as each curve that keeps to the path would be refused.
    """

    t_rep: float
    solve: SolveResult
    verdict: Verdict
    maneuver: Maneuver | None = None
    check_time: float = 0.0
    tried: tuple[str, ...] = ()
    margin: float | None = None
    by: str = ""
    jump: float = 0.0
    fallback: bool = False
    tightened: tuple[float, ...] = (0.0, 0.0, 0.0)
    refused: Verdict | None = None
    blocked: bool = False

    @property
    def feasible(self) -> bool:
        """Whether the repaired trajectory passed every check."""
        return self.solve.curve is not None and self.verdict.ok


class Like(NamedTuple):
    """What passed in a search that is much like another one.

    Attributes
    ----------
    probe : Probe
    until : float
        Before when [s] it is likely to pass there, too; from then on it is not.
    """

    probe: Probe
    until: float = math.inf


class SearchStatus(str, Enum):
    """How a search ended; ``.sentence`` says it for people.

    Attributes
    ----------
    FOUND
        A repaired trajectory passed every check.
    NO_CONFLICT
        The reference can be followed to its end.
    ALREADY_COLLIDING
        The ego is in conflict at the very start.
    NONE_FEASIBLE
        No tested time-to-repair has a feasible repair.
    BUDGET_EXHAUSTED
        Time limit or interrupt came before anything feasible was found.
    UNAVOIDABLE
        Nothing was found, and it is proven that nothing can be. No search says so, a proof does
        (:mod:`repair.mitigation.status`).
    """

    FOUND = "found"
    NO_CONFLICT = "no_conflict"
    ALREADY_COLLIDING = "already_colliding"
    NONE_FEASIBLE = "none_feasible"
    BUDGET_EXHAUSTED = "budget_exhausted"
    UNAVOIDABLE = "unavoidable"

    @property
    def sentence(self) -> str:
        """What the status means, in a sentence."""
        return {
            "found": "a repaired trajectory passed every check",
            "no_conflict": "the reference can be followed to its end",
            "already_colliding": "the ego is in conflict at the very start",
            "none_feasible": "no tested time-to-repair has a feasible repair",
            "budget_exhausted": "the search was cut short, by its time limit or an interrupt, before any "
            "feasible repair was found",
            "unavoidable": "it is proven that from the very start on every motion of the vehicle touches an "
            "obstacle or leaves the road",
        }[self.value]


@dataclass(frozen=True)
class SearchResult:
    """The answer of Algorithm 1.

    Attributes
    ----------
    status : SearchStatus
    conflict : Conflict
    f_ttr : float or None
        Last verified t_rep [s]; inf without a conflict; None where nothing was verified.
    curve : Curve or None
        The repaired part from ``f_ttr`` on; None without a repair.
    probes : tuple of Probe
        In the order of visiting.
    complete : bool
        Whether the rule ran to its end (False: interrupted or out of time).
    wall_time : float
        Wall time of the search [s].
    """

    status: SearchStatus
    conflict: Conflict
    f_ttr: float | None
    curve: Curve | None
    probes: tuple[Probe, ...] = ()
    complete: bool = True
    wall_time: float = 0.0

    @property
    def best(self) -> Probe | None:
        """The probe behind ``f_ttr``."""
        feasible = [p for p in self.probes if p.feasible]
        return max(feasible, key=lambda p: p.t_rep) if feasible else None

    def __iter__(self) -> Iterator[Probe]:
        return iter(self.probes)
