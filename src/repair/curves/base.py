"""Trajectories in the Frenet frame: samples, what a curve is, and two curves joined."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeGuard, runtime_checkable

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.timegrid import INSTANT

__all__ = ["Curve", "FrenetTrajectory", "Hulled", "SplicedCurve", "is_curve", "joined"]


@dataclass(frozen=True)
class FrenetTrajectory:
    """A trajectory sampled in the Frenet frame.

    Attributes
    ----------
    t : (K,) array
        Time since the start of the scenario [s].
    position, velocity, acceleration, jerk : (K, 2) array
        ``[s, l]`` and its first three time derivatives [m, m/s, m/s², m/s³].
    """

    t: Array
    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array

    def __len__(self) -> int:
        return len(self.t)

    def window(self, start: float, end: float) -> FrenetTrajectory:
        """The samples from ``start`` to ``end`` [s], both included to 1e-9 s."""
        keep = (self.t >= start - INSTANT) & (self.t <= end + INSTANT)
        return FrenetTrajectory(
            self.t[keep], self.position[keep], self.velocity[keep],
            self.acceleration[keep], self.jerk[keep],
        )  # fmt: skip


def joined(first: FrenetTrajectory, second: FrenetTrajectory) -> FrenetTrajectory:
    """The samples of one after those of the other."""
    names = ("t", "position", "velocity", "acceleration", "jerk")
    return FrenetTrajectory(*(np.concatenate([getattr(first, n), getattr(second, n)]) for n in names))


@runtime_checkable
class Curve(Protocol):
    """A trajectory that can be evaluated at any time of its span (a spline, a Bernstein chain)."""

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        ...

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        ...

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate at the times ``t`` (K,); outside the span the curve is extended from its end state."""
        ...


def is_curve(thing: Any) -> TypeGuard[Curve]:
    """The same as ``isinstance(thing, Curve)``, without the time that a protocol takes to be asked.

    What does not let its attributes be read is none.
    """
    try:
        return (
            hasattr(thing, "t_start")
            and hasattr(thing, "t_end")
            and getattr(thing, "sample", None) is not None
        )
    except Exception:  # of a foreign thing
        return False


@runtime_checkable
class Hulled(Protocol):
    """A curve whose speed is bounded at all times by the hull of its control points."""

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        ...

    def speed_hulls(self, cuts: int = 1) -> tuple[Array, Array, Array]:
        """Bounds of s' over parts of the curve, each polynomial piece cut into ``cuts``.

        Returns
        -------
        times : (M,) array
            When each part begins [s].
        low, high : (M,) array
            Bounds of s' over the part [m/s].
        """
        ...


@dataclass(frozen=True)
class SplicedCurve:
    """The reference until ``t_rep``, the repaired curve after it."""

    reference: Curve
    repaired: Curve
    t_rep: float

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        return self.reference.t_start

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return self.repaired.t_end

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate either part."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        late = times >= self.t_rep - INSTANT
        parts = [c.sample(times[m]) for c, m in ((self.reference, ~late), (self.repaired, late)) if m.any()]
        if len(parts) == 1:
            return parts[0]
        columns = []
        for name in ("position", "velocity", "acceleration", "jerk"):
            column = np.empty((len(times), 2))
            column[~late], column[late] = getattr(parts[0], name), getattr(parts[1], name)
            columns.append(column)
        return FrenetTrajectory(times, *columns)
