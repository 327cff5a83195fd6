"""Distances along the path as figures show them: from the start, or from the reference that moves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.outcome.data import Drawing, Line, Outcome
from repair.report.lines import drawing_in
from repair.timegrid import INSTANT, STEP

__all__ = ["Along", "driven_line", "overlapped"]

_FAR = 50.0  # of more than that, the few metres that decide are nothing to be seen [m]


@dataclass(frozen=True)
class Along:
    """How a place along the path is shown.

    Attributes
    ----------
    reference : Line
    start : float
        s of the ego at t = 0 [m].
    half : float
        Half of the ego's length [m].
    moving : bool
        Whether places are shown as seen from the reference.
    """

    reference: Line
    start: float
    half: float
    moving: bool

    @classmethod
    def of(cls, drawing: Drawing) -> Along:
        """That of a drawing: as seen from the reference where that goes far, and something else is driven."""
        reference = drawing.lines[0]
        half = 0.5 * float(np.ptp(np.asarray(drawing.body)[:, 0]))
        far = bool(np.ptp(reference.s) > _FAR) and len(drawing.lines) > 1
        return cls(reference, drawing.start_s, half, far)

    @property
    def label(self) -> str:
        """What stands beside the axis."""
        return "ahead of the reference [m]" if self.moving else "distance driven s [m]"

    def __call__(self, t: Array, s: Array) -> Array:
        """Places (K,) at times (K,) as they are shown [m]; after its end the reference keeps its speed."""
        if not self.moving:
            return np.asarray(s - self.start)
        own = self.reference
        after = np.maximum(t - own.t[-1], 0.0) * own.speed[-1]
        return np.asarray(s - np.interp(t, own.t, own.s) - after)


def driven_line(outcome: Outcome) -> tuple[Line, bool]:
    """The reference, from the F-TTR on the repair; and whether what is driven was found free of contact."""
    lines = drawing_in(outcome).lines
    reference, best = lines[0], outcome.f_ttr
    if outcome.status == "no_conflict":
        return reference, True
    probes = [p for p in outcome.probes if p["feasible"]]
    repairs = [x for x in lines if x.kind == "repair" and best is not None]
    found = [x for x in repairs if abs((x.t_rep or 0.0) - (best or 0.0)) < STEP]
    if not found or not probes:
        return reference, False
    repair = found[-1]  # the later of those of several backends is the one that was kept
    keep = reference.t < repair.t[0] - INSTANT
    columns = ("t", "s", "l", "x", "y", "speed", "acceleration")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(reference, name)[keep], getattr(repair, name)]) for name in columns
    }
    return replace(repair, **joined), True


def overlapped(drawing: Drawing, line: Line, half: float) -> npt.NDArray[np.bool_]:
    """At which samples (K,) of a line the ego's length lies over that of somebody in the reference's way."""
    found = np.zeros(len(line.t), dtype=bool)
    for box in drawing.boxes:
        low, high = (np.interp(line.t, box.t, ends, np.nan, np.nan) for ends in (box.low, box.high))
        with np.errstate(invalid="ignore"):  # who is not there is nowhere
            found |= (line.s + half > low + drawing.s_offset) & (line.s - half < high - drawing.s_offset)
    return found
