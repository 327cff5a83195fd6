"""Outlines of the others at each step, from the few that are kept."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.outcome.data import Body
from repair.report.birdseye import placed

__all__ = ["Moving", "kept"]

_STANDS = 0.3  # below this speed a body keeps its heading [m/s]


class Moving:
    """One of the others over time.

    Parameters
    ----------
    body : Body
    last : int
        The last step.
    dt : float
        [s].
    """

    def __init__(self, body: Body, last: int, dt: float) -> None:
        self.body, self.last, self.dt = body, last, dt

    def outline(self, k: int) -> Array | None:
        """Corners (V, 2) [m] at a step; None where it is not there."""
        body = self.body
        if len(body.centres) < 2:  # it stands
            return next(iter(body.outlines.values()), None)
        if k >= len(body.centres) or not np.isfinite(body.centres[k]).all():
            return body.outlines.get(k)
        known = _known(body)
        if not known:
            return None
        if len({len(body.outlines[j]) for j in known}) > 1:  # a set: its nearest outline, moved
            near = min(known, key=lambda j: abs(j - k))
            return np.asarray(body.outlines[near] + (body.centres[k] - body.centres[near]))
        first = known[0]
        away, turned = body.outlines[first] - body.centres[first], self._headings
        x, y = body.centres[k].tolist()
        return placed(away, x, y, float(turned[k] - turned[first]))

    @cached_property
    def _headings(self) -> Array:
        return _turned(self.body, self.last, self.dt)


def kept(heading: Array, moving: Any) -> Array:
    """The last heading while moving; the first one before."""
    if not moving.any():
        return np.full_like(heading, heading[0])
    last = np.maximum.accumulate(np.where(moving, np.arange(len(heading)), -1))
    return np.asarray(heading[np.where(last < 0, int(np.argmax(moving)), last)])


def _turned(body: Body, last: int, dt: float) -> Array:
    """How far a body is turned at each step against its first outline [rad].

    Outlines are known at a few steps. Between them it turns as its motion does, but for what the outlines say
    is left over.
    """
    known = _known(body)
    count = min(last + 1, len(body.centres))
    if not known or count < 3 or len({len(body.outlines[k]) for k in known}) > 1:
        return np.zeros(last + 1)
    centres = body.centres[:count]
    there: Any = np.isfinite(centres).all(axis=1)
    rate = np.gradient(np.where(there[:, None], centres, 0.0), dt, axis=0)
    steady: Any = there & np.roll(there, 1) & np.roll(there, -1)
    moving = np.asarray(steady & (np.hypot(rate[:, 0], rate[:, 1]) > _STANDS))
    course = kept(np.unwrap(np.arctan2(rate[:, 1], rate[:, 0])), moving)
    edge = [body.outlines[k][1] - body.outlines[k][0] for k in known]
    shape = np.unwrap([np.arctan2(e[1], e[0]) for e in edge])
    at = [min(k, count - 1) for k in known]
    rest = np.unwrap(shape - shape[0] - (course[at] - course[at[0]]))
    turned = course - course[at[0]] + np.interp(np.arange(count), at, rest)
    return np.concatenate([turned, np.full(last + 1 - count, turned[-1])])


def _known(body: Body) -> list[int]:
    """The steps at which outline and middle are known."""
    there = [k for k in sorted(body.outlines) if k < len(body.centres)]
    return [k for k in there if np.isfinite(body.centres[k]).all()]
