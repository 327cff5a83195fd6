"""The trajectories that a search looked at, driven by the vehicle, to be shown beside what is driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from repair.curves.base import SplicedCurve
from repair.mitigation.mitigate import Mitigation
from repair.preparation import Prepared
from repair.search.result import SearchResult, SearchStatus
from repair.terminal.verdict import Ending, Terminal
from repair.timegrid import INSTANT, on_grid
from repair.vehicle.states import DrivenStates

__all__ = ["Considered", "considered"]


@dataclass(frozen=True)
class Considered:
    """A trajectory that was looked at.

    Attributes
    ----------
    kind : str
        ``reference``; ``repair``, of a visited time-to-repair; ``stop``, what shows how safe a repair ends;
        ``mitigation``, what hits least hard where nothing was found.
    states : DrivenStates
        At the scenario's steps. A repair has them from the last step on at which the reference is followed.
    feasible : bool
        Whether it passed every check.
    reasons : tuple of str
        The words of :class:`repair.check.verdict.Reason` otherwise.
    probe : int or None
        Of a repair, its place among the visited times-to-repair.
    """

    kind: str
    states: DrivenStates
    feasible: bool
    reasons: tuple[str, ...] = ()
    probe: int | None = None


def considered(
    prepared: Prepared,
    found: SearchResult,
    terminal: Terminal | None = None,
    mitigation: Mitigation | None = None,
) -> tuple[Considered, ...]:
    """The reference, then every repair that was tried and has a curve, then the stop and the mitigation.

    Parameters
    ----------
    prepared : Prepared
    found : SearchResult
    terminal : Terminal or None
        How the repair ends.
    mitigation : Mitigation or None
        The motion that hits least hard, where nothing was found.

    Returns
    -------
    tuple of Considered
        The reference first. A curve that no vehicle can be put on (it is not finite) is left out.
    """
    checker, n, dt = prepared.checker, prepared.checker.config.substeps, prepared.scene.dt
    kind = found.conflict.kind
    clear = found.status is SearchStatus.NO_CONFLICT
    reference = checker.drive(prepared.reference, prepared.t_reference).every(n)
    made = [Considered("reference", reference, clear, () if clear else (kind,))]
    for index, probe in enumerate(found.probes):
        if probe.solve.curve is None:
            continue
        whole = SplicedCurve(prepared.reference, probe.solve.curve, probe.t_rep)
        states = checker.drive(whole, prepared.t_end).every(n).since(on_grid(probe.t_rep, dt) - INSTANT)
        made.append(Considered("repair", states, probe.feasible, probe.verdict.reasons, index))
    if terminal is not None and (shown := terminal.continuation) is not None:
        safe = terminal.ending is not Ending.UNSAFE
        words = tuple(violation.reason.value for violation in terminal.violations)
        made.append(Considered("stop", shown.states, safe, () if safe else words))
    if mitigation is not None and (best := mitigation.best) is not None:
        hit = best.impact.kind
        made.append(Considered("mitigation", best.states, hit == "none", () if hit == "none" else (hit,)))
    return tuple(_finite(made))


def _finite(made: Sequence[Considered]) -> list[Considered]:
    return [
        one
        for one in made
        if len(one.states)
        and all(
            np.isfinite(c).all()
            for c in (one.states.x, one.states.y, one.states.orientation, one.states.speed)
        )
    ]
