"""A search that ends after so many solves, and goes on where it stood in the next cycle.

It counts solves and not seconds: the same drive is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from repair.deadline import OutOfTime
from repair.search.result import Probe
from repair.timegrid import INSTANT

__all__ = ["Carried", "Stint", "carried_from"]


@dataclass
class Stint:
    """What one cycle may spend on a search; called after every probe, it ends the search by raising.

    It is not ended between a repair that cannot be waited for and a later one that can.

    Attributes
    ----------
    solves : int or None
        After so many it ends; None: never.
    enough : float
        How long a repair has to wait [s].
    needed : bool
        Nor before there is a repair that can be waited for.
    best : float
        The latest time-to-repair with a verified one [s].
    spent : int
        Solves so far.
    ended : bool
        It has ended the search.
    """

    solves: int | None
    enough: float
    needed: bool = False
    best: float = -np.inf
    spent: int = 0
    ended: bool = field(default=False, init=False)

    def __call__(self, probe: Probe) -> None:
        """Count a probe.

        Raises
        ------
        OutOfTime
            If that was the last one.
        """
        self.spent += max(len(probe.tried), 1)
        if probe.feasible:
            self.best = max(self.best, probe.t_rep)
        waits = not self.needed if self.best == -np.inf else self.best >= self.enough - INSTANT
        if self.solves is not None and self.spent >= self.solves and waits:
            self.ended = True
            raise OutOfTime("the rest of the search is the next cycle's")


@dataclass(frozen=True)
class Carried:
    """Where a search stood when its cycle ended.

    Attributes
    ----------
    now : float
        When that cycle began [s].
    above : float
        From where on nothing was found [s] after ``now``; inf where nothing was visited there.
    stride : float
        How much farther it looks next, where it knows one side only [s].
    bracketed : bool
        It has found a repair, so that what is left lies between that and ``above``. Else it goes on from
        ``above`` down, whatever is kept to be waited on meanwhile: feasibility may have gaps.
    """

    now: float
    above: float
    stride: float
    bracketed: bool

    def seen_from(
        self, now: float, kept: float | None
    ) -> tuple[float | None, float | None, float | None, float | None] | None:
        """Where a later cycle goes on.

        Parameters
        ----------
        now : float
            When it begins [s].
        kept : float or None
            Its latest time-to-repair with a verified repair [s].

        Returns
        -------
        kept, guess, above, stride : float or None
            See :func:`repair.cycle.searching.searched`; None where nothing is left of the search.
        """
        above = self.above - (now - self.now)
        if above <= max(kept or 0.0, 0.0) + INSTANT:
            return None
        if not self.bracketed and np.isinf(above):
            return None, None, None, None  # where the search's rule begins
        if kept is None or not self.bracketed:
            return None, max(above - self.stride, 0.0), above, 2.0 * self.stride
        if np.isfinite(above):
            return kept, 0.5 * (kept + above), above, 2.0 * self.stride
        return kept, kept + self.stride, None, 2.0 * self.stride


def carried_from(
    probes: Sequence[Probe],
    now: float,
    end: float,
    step: float,
    before: tuple[float | None, float | None] = (None, None),
) -> Carried | None:
    """What is left of a search that was ended.

    Parameters
    ----------
    probes : sequence of Probe
        In the order of visiting.
    now : float
        When the cycle begins [s].
    end : float
        Where the grid ends [s], excluded.
    step : float
        Of the grid [s].
    before : (float or None, float or None)
        Until where a repair had been found before, and from where on nothing [s].

    Returns
    -------
    Carried or None
        None where nothing is left: the neighbours on the grid are visited.
    """
    known, above = (() if one is None else (one,) for one in before)
    best = max([*known, *(p.t_rep for p in probes if p.feasible)], default=-step)
    shut = min([*above, *(p.t_rep for p in probes if not p.feasible and p.t_rep > best)], default=np.inf)
    if min(shut, end) <= best + step + INSTANT:
        return None
    places = [*known, *above, *(probe.t_rep for probe in probes)][-2:]
    stride = 2.0 * abs(places[-1] - places[0]) if len(places) > 1 else step
    return Carried(now, shut, max(stride, step), best >= 0.0)
