"""What one cycle answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from repair.arrays import in_seconds
from repair.check.verdict import Conflict
from repair.curves.base import Curve
from repair.io.commonroad import to_trajectory
from repair.preparation import Prepared
from repair.search.result import SearchResult, SearchStatus
from repair.vehicle.states import DrivenStates

__all__ = ["Cycle"]


@dataclass(frozen=True, repr=False)
class Cycle:
    """The answer of one cycle. Times count from ``now``.

    Attributes
    ----------
    now : float
        When the cycle begins [s].
    prepared : Prepared or None
        Scene, reference, conflict and limits of the cycle; None where the deadline came before.
    search : SearchResult
        What was searched in this cycle: where an earlier repair holds, only later ones.
    f_ttr : float or None
        Until when the plan can be followed [s]: the later one of what was found and of what was kept; inf
        without a conflict, None where nothing is verified.
    curve : Curve or None
        What is driven, in the frame of ``prepared.scene``: the plan, repaired from ``f_ttr`` on. None without
        ``prepared``.
    kept : bool
        The repair is that of an earlier cycle, shifted and checked again.
    complete : bool
        The search ran to its end; False where the deadline cut it short.
    rebuilt : tuple of str
        What of the road was laid out anew, and why.
    elapsed : float
        Wall time of the cycle [s].
    """

    now: float
    prepared: Prepared | None
    search: SearchResult
    f_ttr: float | None
    curve: Curve | None
    kept: bool
    complete: bool
    rebuilt: tuple[str, ...]
    elapsed: float

    def __repr__(self) -> str:
        how = ", kept" if self.kept else "" if self.complete else ", cut short"
        begin = f"<Cycle at {self.now:g} s: {self.status.value}{how}"
        if self.prepared is None:
            return f"{begin}, nobody had the time to look at the plan>"
        return f"{begin}, TTC {in_seconds(self.ttc)}, F-TTR {in_seconds(self.f_ttr)}>"

    @property
    def status(self) -> SearchStatus:
        """As that of a search; ``found`` too where only an earlier repair is left."""
        return SearchStatus.FOUND if self.kept else self.search.status

    @property
    def conflict(self) -> Conflict:
        """Where the plan stops being drivable."""
        return self.search.conflict

    @property
    def ttc(self) -> float:
        """Time-To-Collision [s], inf without a conflict; NaN where the deadline came before it was known."""
        return self.search.conflict.time

    @property
    def states(self) -> DrivenStates | None:
        """What is driven, at the scenario's steps; None where nobody had the time to look at the plan."""
        if self.prepared is None or self.curve is None:
            return None
        repaired = self.f_ttr is not None and np.isfinite(self.f_ttr)
        t_end = self.prepared.t_end if repaired else self.prepared.t_reference
        driven = self.prepared.checker.drive(self.curve, t_end)
        return driven.every(self.prepared.checker.config.substeps)

    @property
    def trajectory(self) -> Any:
        """The same as a ``commonroad.scenario.trajectory.Trajectory`` of KS states."""
        states = self.states
        if self.prepared is None or states is None:
            return None
        return to_trajectory(self.prepared.scene, states)
