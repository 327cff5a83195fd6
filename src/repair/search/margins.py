"""Smaller margins, for a backend that keeps them: each side is asked again where that may help.

A side whose rows contradict each other says by how much it misses the margin, and one whose curve the checker
finds too close needs more room, not less. So most of the margins that ``repair.relax`` lists are not asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import chain, groupby

import numpy as np

from repair.check.verdict import Reason, Verdict
from repair.problem.problem import Maneuver, RepairProblem
from repair.search.again import too_close
from repair.search.probe import Budget, Rejected
from repair.search.result import Probe

__all__ = ["probe_smaller", "with_margin"]

#: Ways past and windows change with the margin, and what is missed with them [m]. With this no answer of 111
#: searches at 0.1 s and 99 at 0.4 s was another one than with all margins; with 1 m one was, a step earlier.
_OFF = 1.5
#: Where the guide passes the same obstacles on the same sides, what is missed changes by less [m].
_NEAR = 0.1

#: A guide that is no farther from the reference [m] leads into what the reference meets.
_PLANNED = 0.3

_Way = tuple[object, ...]


def probe_smaller(
    probe: Probe,
    rejected: Rejected,
    relaxed: Iterable[Sequence[RepairProblem]],
    ask: Callable[[Sequence[RepairProblem]], tuple[Probe, Rejected]],
    budget: Budget,
) -> Probe:
    """Ask the sides again with smaller and smaller margins, until one passes.

    Parameters
    ----------
    probe : Probe
        With the usual margin; the answer where none is of use.
    rejected : sequence of (RepairProblem, Probe)
        What came of its sides.
    relaxed : iterable of sequence of RepairProblem
        The problems with smaller and smaller margins.
    ask : callable
        Solves and checks problems of one margin: the best of them, and those that failed.
    budget : Budget
    """
    enough: dict[_Way, float] = {}  # from which margin on a side, or a way past an obstacle, may do [m]
    near: set[int] = set()  # the obstacles that curves came too close to

    def learn(failed: Rejected) -> None:
        for problem, one in failed:
            side = _side(problem)
            enough[side] = min(enough.get(side, math.inf), _enough(problem, one, _OFF))
            if one.refused is None:
                continue
            known = -math.inf if _in_vain(problem, one.refused) else _enough(problem, one, _NEAR)
            for obstacle in _met(problem, one.refused):
                near.add(obstacle)
                way = _way(problem, obstacle)
                enough[way] = min(enough.get(way, math.inf), known)

    blocked = any(one.blocked for _, one in rejected)

    def may_pass(problem: RepairProblem) -> bool:
        if blocked and not problem.lateral:
            return False
        ways = (_way(problem, obstacle) for obstacle in near)
        return all(problem.margin <= enough.get(way, math.inf) for way in chain((_side(problem),), ways))

    def evades(problem: RepairProblem) -> bool:
        return not (budget.collides and _as_planned(problem))

    learn(rejected)
    for problems in relaxed:
        if budget.spent:
            budget.cut = True
            break
        wanted = [problem for problem in problems if may_pass(problem) and evades(problem)]
        if not wanted:
            continue
        again, failed = ask(wanted)
        probe = with_margin(probe, again, wanted[0].margin)
        if probe.feasible:
            break
        learn(failed)
    return probe


def _enough(problem: RepairProblem, failed: Probe, off: float) -> float:
    """The largest margin with which a side that failed may pass, where what it misses may be off [m]."""
    if failed.solve.curve is not None and too_close(failed.verdict):
        return -math.inf
    closest = failed.solve.closest
    return math.inf if closest is None or closest.miss <= 0.0 else problem.margin - closest.miss + off


def _in_vain(problem: RepairProblem, refused: Verdict) -> bool:
    """Whether no margin is of use where the curve that keeps the most of it is too close for the checker.

    One that has to keep less comes closer yet. Where it moves sideways it may also be another one, unless
    too close is all that it was.
    """
    along = problem.passing is not None and problem.passing.maneuver in (Maneuver.YIELD, Maneuver.GO_AHEAD)
    return along or {v.reason for v in refused.violations} <= {Reason.COLLISION, Reason.MARGIN}


def _as_planned(problem: RepairProblem) -> bool:
    """Whether a guide follows the reference: so much of the boxes is gone that nothing is in its way."""
    if problem.passing is None:
        return False
    guide = problem.passing.guide
    return bool(np.abs(guide.position - problem.reference.sample(guide.t).position).max() <= _PLANNED)


def _side(problem: RepairProblem) -> _Way:
    return () if problem.passing is None else (problem.passing.maneuver,)


def _met(problem: RepairProblem, refused: Verdict) -> set[int]:
    """Which of a problem's obstacles a curve that was refused came too close to."""
    close = {v.obstacle_id for v in refused.violations if v.reason in (Reason.COLLISION, Reason.MARGIN)}
    return set(problem.occupancy.ids.tolist()) & close


def _way(problem: RepairProblem, obstacle: int) -> _Way:
    """On which sides a problem's guide passes an obstacle, one after the other; sideways also when."""
    if problem.passing is None:
        return (obstacle,)
    maneuver, rows = problem.passing.maneuver, problem.passing.side[problem.occupancy.ids == obstacle]
    if maneuver in (Maneuver.LEFT, Maneuver.RIGHT):
        return (maneuver, obstacle, rows.tobytes())
    return (maneuver, obstacle, *(tuple(side for side, _ in groupby(row)) for row in rows.tolist()))


def with_margin(probe: Probe, again: Probe, margin: float) -> Probe:
    """A probe after another one with some margin [m], which is the answer if it is feasible."""
    tried = (*probe.tried, *(f"{text} (margin {margin:g} m)" for text in again.tried))
    return replace(again if again.feasible else probe, tried=tried)
