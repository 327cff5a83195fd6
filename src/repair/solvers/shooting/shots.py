"""The best trajectories so far, and whether it is worth drawing others around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from repair.arrays import Array
from repair.solvers.shooting.motion import Driven

__all__ = ["First", "Looked", "Shot", "apart", "effort_of", "far"]

_LATELY, _FASTER = 3, 3.0  # iterations by which the pace is told, and how many times as fast may come


@dataclass(frozen=True)
class Shot:
    """The best trajectory so far.

    Attributes
    ----------
    row : (1, D) array
    cost, miss : float
        What was minimised, and by how much an obstacle or the road's edge is missed at most [m].
    """

    row: Array
    cost: float
    miss: float


class Looked(NamedTuple):
    """Trajectories that were driven: what is minimised, the deepest place, what they ask (N,)."""

    cost: Array
    deep: Array
    effort: Array
    driven: Driven


class First(NamedTuple):
    """The manoeuvres that a search begins with: rows (N, D), their costs (N,), and the best of them."""

    rows: Array
    cost: Array
    best: Shot


def effort_of(driven: Driven) -> Array:
    """How much is asked of the vehicle (N,): mean squares of both accelerations."""
    across = driven.v[:, :-1] * driven.rate
    return np.asarray((driven.a**2).mean(axis=1) + (across**2).mean(axis=1))


def far(least: Sequence[Array], left: int) -> bool:
    """Whether more is left than who goes on several times as fast as lately comes to."""
    if len(least) <= _LATELY:
        return False
    pace = (least[-1 - _LATELY] - least[-1]) / _LATELY
    return bool((least[-1] > _FASTER * left * pace).all())


def apart(rows: Array, cost: Array, count: int) -> Array:
    """The cheapest rows (count, D) of which no two are much alike."""
    chosen: list[int] = []
    for k in cost.argsort(kind="stable").tolist():
        if all(np.abs(rows[k] - rows[other]).max() > 0.9 for other in chosen):
            chosen.append(k)
        if len(chosen) == count:
            break
    return np.asarray(rows[chosen])
