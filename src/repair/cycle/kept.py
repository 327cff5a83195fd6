"""The last cycle's repair, seen from this one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from repair.check.verdict import Verdict
from repair.curves.base import Curve, FrenetTrajectory
from repair.curves.bernstein import BernsteinCurve
from repair.curves.bspline import UniformBSpline
from repair.preparation import Prepared
from repair.scene.frame import FrenetFrame
from repair.search.result import Like, Probe, SearchResult
from repair.timegrid import INSTANT, on_grid

__all__ = ["KeptRepair", "Later", "hints", "verified_again"]

_PLACE_OFF, _SPEED_OFF = (
    0.02,
    0.1,
)  # at the seam: further off the new reference [m], [m/s] it is another drive


@dataclass(frozen=True)
class Later:
    """A curve seen from a later zero of time.

    Attributes
    ----------
    curve : Curve
    by : float
        So much later [s].
    """

    curve: Curve
    by: float

    @property
    def t_start(self) -> float:
        """Start of the span [s]; may be negative."""
        return self.curve.t_start - self.by

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return self.curve.t_end - self.by

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate; outside of the span the curve is extended from its end state."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        return replace(self.curve.sample(times + self.by), t=times)


@dataclass(frozen=True)
class KeptRepair:
    """A verified repair, with the time at which it was found.

    Attributes
    ----------
    curve : Curve
        From ``f_ttr`` on, in ``frame``.
    f_ttr : float
        [s] after ``now``.
    now : float
        [s].
    frame : FrenetFrame
    probe : Probe or None
        What came of the search at ``f_ttr``.
    failed : float
        From when on nothing was found [s], after ``now``.
    """

    curve: Curve
    f_ttr: float
    now: float
    frame: FrenetFrame
    probe: Probe | None = None
    failed: float = math.inf

    def seen_from(self, now: float) -> Curve:
        """The curve with its times counted from a later cycle."""
        by, curve = now - self.now, self.curve
        if isinstance(curve, BernsteinCurve | UniformBSpline):  # which keep what is known of their hulls
            return replace(curve, t_start=curve.t_start - by)
        return Later(curve, by)

    def due(self, now: float) -> float:
        """What is left of its time-to-repair [s]; negative once it is past."""
        return self.f_ttr - (now - self.now)

    def beside(self, found: SearchResult, now: float, last: KeptRepair | None = None) -> KeptRepair:
        """The same with what a search, and the repair that was kept before, know of later t_rep."""
        failed = [p.t_rep + now for p in found.probes if found.complete and not p.feasible]
        failed += [one.failed + one.now for one in (self, last) if one is not None]
        own = self.f_ttr + self.now
        return replace(self, failed=min(at for at in (*failed, math.inf) if at > own) - self.now)


def hints(last: KeptRepair | None, now: float, step: float) -> tuple[float | None, Like | None]:
    """Where a search begins that follows another one, and what is asked there first.

    Parameters
    ----------
    last : KeptRepair or None
    now : float
        When the cycle begins [s].
    step : float
        Of the times-to-repair [s].

    Returns
    -------
    guess : float or None
        In the middle between what was feasible and what was not [s]; None where all of that is past.
    like : Like or None
        What passed.
    """
    if last is None:
        return None, None
    late = min(last.failed, last.f_ttr + step) - (now - last.now)
    due = last.due(now)
    return None if due < 0.0 else 0.5 * (due + late), None if last.probe is None else Like(last.probe, late)


def verified_again(kept: KeptRepair, prepared: Prepared, now: float) -> tuple[float, Curve] | None:
    """The kept repair among the traffic as it is now: until when it can be waited, and what is driven then.

    Parameters
    ----------
    kept : KeptRepair
    prepared : Prepared
        The cycle.
    now : float
        When the cycle begins [s].

    Returns
    -------
    (f_ttr, curve) or None
        None where the frame is another one, the reference does not lead to it any more, or the checker
        rejects it.
    """
    if kept.frame is not prepared.scene.frame:
        return None
    curve = kept.seen_from(now)
    t_rep = on_grid(max(kept.due(now), 0.0), prepared.scene.dt)
    if t_rep >= min(prepared.conflict.time, curve.t_end) - INSTANT:
        return None
    here, there = (c.sample([t_rep]) for c in (prepared.reference, curve))
    apart = np.abs(here.position - there.position).max()
    if apart > _PLACE_OFF or np.abs(here.velocity - there.velocity).max() > _SPEED_OFF:
        return None
    if t_rep > prepared.t_end - prepared.scene.dt + INSTANT:
        return None  # nothing would be left of it
    verdict: Verdict = prepared.judge.check(prepared.judged_at(t_rep), curve)
    return (t_rep, curve) if verdict.ok else None
