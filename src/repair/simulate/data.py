"""What came of a drive: pure data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from repair.simulate.contact import Struck

__all__ = ["CycleRecord", "Driven"]


@dataclass(frozen=True)
class CycleRecord:
    """One cycle.

    Attributes
    ----------
    t : float
        [s] since the drive began.
    mode : str
        What is driven after it: ``plan``, ``repair`` or ``brake``.
    ttc : float
        Time to collision of what was driven before it [s]; inf where nothing is ahead.
    f_ttr : float or None
        Until when the policy can wait [s], where it asked; inf where nothing is ahead.
    spent : float
        Processor time [s].
    complete : bool
        Whether no search of it was cut short.
    """

    t: float
    mode: str
    ttc: float
    f_ttr: float | None
    spent: float
    complete: bool = True


@dataclass(frozen=True)
class Driven:
    """A drive.

    Attributes
    ----------
    dt : float
        Of the states [s].
    states : dict
        Columns ``t, x, y, orientation, speed`` of the ego at the scenario's steps, and ``plan_x, plan_y,
        plan_orientation, plan_speed`` of the plan.
    cycles : tuple of CycleRecord
    struck : Struck or None
        With whom it ended.
    distance : float
        Least distance to anybody [m]; looked for up to 1 m.
    broken : bool
        The contact came while a repair was driven, before the end of what had been verified of it.
    """

    dt: float
    states: dict[str, list[float]] = field(repr=False)
    cycles: tuple[CycleRecord, ...]
    struck: Struck | None
    distance: float
    broken: bool = False

    def plain(self) -> dict[str, Any]:
        """For JSON: infinities are None."""
        return {
            "dt": self.dt,
            "states": {name: [round(v, 4) for v in column] for name, column in self.states.items()},
            "cycles": [
                {"t": round(c.t, 6), "mode": c.mode, "ttc": _finite(c.ttc), "f_ttr": _finite(c.f_ttr),
                 "ms": round(1e3 * c.spent, 3), "complete": c.complete}
                for c in self.cycles
            ],
        }  # fmt: skip


def _finite(value: float | None) -> float | None:
    return None if value is None or value == float("inf") else round(value, 6)
