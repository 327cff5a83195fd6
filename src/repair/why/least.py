"""The smallest amount that suffices, by bisection, and what shows it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from repair.preparation import Prepared
from repair.why.asked import Asked, Cut, Found
from repair.why.kinds import KINDS, Kind, under

__all__ = ["Relaxation", "bisected", "smallest"]

_FINE = 0.08  # share of an amount to which it is found, where that is more than a step


@dataclass(frozen=True)
class Relaxation:
    """What came of assuming something else.

    Attributes
    ----------
    kind : str
        One of :data:`repair.why.kinds.KINDS`.
    obstacle_id, index : int or None
        Of the obstacle that is changed, and which one of the scene's it is.
    status : str
        ``sufficient``; ``not_sufficient``, up to ``most``; ``impossible``, where it cannot be assumed
        (``detail`` says why); ``cut``, where the time was up.
    amount : float or None
        The smallest that was found to suffice; None without one, and where there is no amount.
    half : float or None
        Half of it (in whole steps), with which nobody finds a repair; None where the time was up before that
        was looked at, so that less may suffice.
    proven : float or None
        With this much of it there is none: proven. None where nothing was proven, or where more of the kind
        may allow less.
    most : float or None
        How much was tried.
    by : str
        Whose the repair is; ``reference`` where nothing has to be repaired any more.
    detail : str
    """

    kind: str
    status: str
    obstacle_id: int | None = None
    index: int | None = None
    amount: float | None = None
    half: float | None = None
    proven: float | None = None
    most: float | None = None
    by: str = ""
    detail: str = ""

    @property
    def sufficient(self) -> bool:
        """Whether there is an amount that suffices."""
        return self.status == "sufficient"


class _Trial:
    """One kind, by whole steps of its amount; each is looked at once."""

    def __init__(self, prepared: Prepared, asked: Asked, kind: Kind, index: int | None) -> None:
        self.prepared, self.asked, self.kind, self.index = prepared, asked, kind, index
        dt = prepared.scene.dt
        # who moves obstacles in time moves them by whole steps of the scenario
        self.step = max(round(kind.step / dt), 1) * dt if kind.unit == "s" else kind.step
        most = kind.most
        if math.isinf(most):
            most = max(0.5 * float(prepared.scene.start[1, 0]), 0.0)
        self.count = int(most / self.step + 1e-6) if self.step else 0
        self.known: dict[int, Found | None] = {0: None}
        self.proven = 0

    def amount(self, n: int) -> float:
        return round(n * self.step, 9)

    def enough(self, n: int) -> bool:
        """Whether so many steps suffice."""
        if n <= self.proven:
            return False
        if n not in self.known:
            self.known[n] = self.asked.repair(self.under(n), proofs=not self.kind.monotone)
        return self.known[n] is not None

    def under(self, n: int) -> Prepared:
        """The situation with so many steps."""
        return under(self.prepared, self.kind.name, self.amount(n), self.index)

    def smallest(self) -> int | None:
        """The smallest number of steps that suffices, of which half do not; None where none does.

        Where the time is up before, the smallest of those that are known to suffice.

        Raises
        ------
        Cut
            If the time is up and none is known.
        """
        try:
            self._prove()
            low, high = self._enclosed()
            if high is None:
                return None
            while True:
                high = bisected(low, high, self.enough, _FINE)
                if not self.enough(high // 2):
                    return high
                low, high = self.proven, high // 2
        except Cut:
            good = [n for n, found in self.known.items() if found is not None]
            if not good:
                raise
            return min(good)

    def half(self, n: int) -> float | None:
        """Half of a number of steps as an amount; None where nobody has looked."""
        return self.amount(n // 2) if n // 2 in self.known or n // 2 <= self.proven else None

    def _prove(self) -> None:
        """Find the largest number of steps that is proven to be too few: a proof takes less than a search."""
        if not self.kind.monotone or not self.count or self.asked.proof(self.prepared) is None:
            return

        def open_(n: int) -> bool:
            return self.asked.proof(self.under(n)) is None

        high = 1
        while high <= self.count and not open_(high):
            self.proven, high = high, 2 * high
        self.proven = bisected(self.proven, min(high, self.count + 1), open_) - 1

    def _enclosed(self) -> tuple[int, int | None]:
        """Numbers of steps of which the first does not suffice and the second does."""
        if self.kind.monotone:
            return self.proven, self.count if self.count and self.enough(self.count) else None
        low, high = 0, 1
        while high <= self.count:
            if self.enough(high):
                return low, high
            low, high = high, 2 * high
        return 0, None


def bisected(low: int, high: int, enough: Callable[[int], bool], share: float = 0.0) -> int:
    """The first number that is enough; the gap to one that is not is 1, or at most a share of it.

    Parameters
    ----------
    low, high : int
        Not enough, and enough.
    """
    while high - low > max(1.0, share * high):
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def smallest(prepared: Prepared, asked: Asked, name: str, index: int | None = None) -> Relaxation:
    """The smallest amount of a kind with which there is a repair.

    Parameters
    ----------
    prepared : Prepared
        Of which there is no repair.
    asked : Asked
    name : str
        Of the kind.
    index : int, optional
        Of the obstacle in the scene, where the kind changes one.
    """
    kind = KINDS[name]
    who = None if index is None else prepared.scene.obstacles[index].id
    trial = _Trial(prepared, asked, kind, index)
    try:
        if not kind.step:
            found = asked.repair(under(prepared, name, 0.0, index))
            status = "sufficient" if found is not None else "not_sufficient"
            return Relaxation(name, status, who, index, by="" if found is None else found.by)
        n = trial.smallest()
    except Cut:
        return Relaxation(name, "cut", who, index)
    except ValueError as why:
        return Relaxation(name, "impossible", who, index, detail=str(why))
    proven = trial.amount(trial.proven) if kind.monotone and trial.proven else None
    most = trial.amount(trial.count)
    if n is None:
        return Relaxation(name, "not_sufficient", who, index, proven=proven, most=most)
    found = trial.known[n]
    assert found is not None
    return Relaxation(name, "sufficient", who, index, trial.amount(n), trial.half(n), proven, most, found.by)
