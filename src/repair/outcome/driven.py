"""What is driven after a search: the reference, repaired where it has to be, and how that ends."""

from __future__ import annotations

from dataclasses import dataclass

from repair.check.peaks import Peaks
from repair.curves.base import Curve, SplicedCurve
from repair.onward.plan import Onward
from repair.preparation import Phases, Prepared
from repair.search.result import SearchResult, SearchStatus
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
    onward : Onward or None
        What is driven after the evasive part, whose states are in ``states``; None where nobody asks.
    """

    states: DrivenStates
    peaks: Peaks | None = None
    terminal: Terminal | None = None
    onward: Onward | None = None


def driven_curve(prepared: Prepared, found: SearchResult, onward: Onward | None = None) -> Curve:
    """What is driven, in the Frenet frame; the reference where there is no repair."""
    curve = prepared.reference
    if found.curve is not None:
        curve = SplicedCurve(curve, found.curve, float(found.f_ttr or 0.0))
    if onward is not None and onward.leg is not None:
        curve = SplicedCurve(curve, onward.leg, onward.leg.t_start)
    return curve


def what_is_driven(prepared: Prepared, found: SearchResult, phases: Phases | None = None) -> WhatIsDriven:
    """Drive what a search found.

    Parameters
    ----------
    prepared : Prepared
    found : SearchResult
    phases : Phases, optional
        Where the time that the end takes is noted.
    """
    checker, substeps = prepared.checker, prepared.checker.config.substeps
    curve = driven_curve(prepared, found)
    t_rep = 0.0 if found.curve is None else float(found.f_ttr or 0.0)
    t_end = prepared.t_reference if found.curve is None else prepared.t_end
    followed = found.status in (SearchStatus.FOUND, SearchStatus.NO_CONFLICT)
    timed = phases or Phases()
    onward = None
    if followed and (prepared.settings.goal or prepared.settings.rejoin):
        with timed("onward"):
            onward = prepared.onward(found.curve, t_rep)
    states = checker.drive(curve, t_end).every(substeps) if onward is None else onward.states
    if found.curve is None:
        return WhatIsDriven(states, onward=onward)
    with timed("terminal"):
        terminal = prepared.ending(found.curve, t_rep)
    return WhatIsDriven(states, checker.peaks(curve, t_end, t_rep), terminal, onward)
