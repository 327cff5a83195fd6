"""What is driven after a search: the reference, repaired where it has to be, and how that ends."""

from __future__ import annotations

from dataclasses import dataclass

from repair.check.peaks import Peaks
from repair.curves.base import Curve, SplicedCurve
from repair.preparation import Phases, Prepared
from repair.search.result import SearchResult
from repair.terminal.verdict import Terminal
from repair.vehicle.states import DrivenStates

__all__ = ["WhatIsDriven", "driven_curve", "what_is_driven"]


@dataclass(frozen=True)
class WhatIsDriven:
    """What is driven after a search.

    Attributes
    ----------
    states : DrivenStates
        At the scenario's steps: the reference, repaired from the F-TTR on.
    peaks : Peaks or None
        Extremes of the repaired part; None without a repair.
    terminal : Terminal or None
        How the repair ends; None without one, and where nobody asks.
    """

    states: DrivenStates
    peaks: Peaks | None = None
    terminal: Terminal | None = None


def driven_curve(prepared: Prepared, found: SearchResult) -> Curve:
    """What is driven, in the Frenet frame; the reference where there is no repair."""
    if found.curve is None:
        return prepared.reference
    return SplicedCurve(prepared.reference, found.curve, float(found.f_ttr or 0.0))


def what_is_driven(prepared: Prepared, found: SearchResult, phases: Phases | None = None) -> WhatIsDriven:
    """Drive what a search found.

    Parameters
    ----------
    prepared : Prepared
    found : SearchResult
    phases : Phases, optional
        Where the time that the end takes is noted.
    """
    checker, substeps = prepared.checker, prepared.config.checker.substeps
    curve = driven_curve(prepared, found)
    if found.curve is None:
        return WhatIsDriven(checker.drive(curve, prepared.t_reference).every(substeps))
    t_rep = float(found.f_ttr or 0.0)
    with (phases or Phases())("terminal"):
        terminal = prepared.ending(found.curve, t_rep)
    states = checker.drive(curve, prepared.t_end).every(substeps)
    return WhatIsDriven(states, checker.peaks(curve, prepared.t_end, t_rep), terminal)
