"""Motion along the path with piecewise constant acceleration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.base import FrenetTrajectory

if TYPE_CHECKING:
    pass

__all__ = ["SpeedProfile"]


@dataclass(frozen=True)
class SpeedProfile:
    """Motion along l = 0 with piecewise constant acceleration; implements :class:`repair.curves.base.Curve`.

    Attributes
    ----------
    knots : (M,) array
        Times at which the acceleration changes [s]; the last one ends the span.
    s, v : (M,) array
        Position [m] and speed [m/s] at the knots.
    a : (M,) array
        Acceleration from each knot on [m/s²].
    """

    knots: Array
    s: Array
    v: Array
    a: Array

    along_axis = True  #: l = 0 at all times: who keeps its path keeps the axis

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        return float(self.knots[0])

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return float(self.knots[-1])

    @classmethod
    def from_accelerations(
        cls, s0: float, v0: float, durations: Sequence[float], a: Sequence[float]
    ) -> SpeedProfile:
        """Chain pieces of constant acceleration from t = 0; after the last one the speed is held."""
        knots, s, v = [0.0], [s0], [v0]
        for duration, rate in zip(durations, a, strict=True):
            knots.append(knots[-1] + duration)
            s.append(s[-1] + v[-1] * duration + 0.5 * rate * duration**2)
            v.append(v[-1] + rate * duration)
        return cls(frozen(knots), frozen(s), frozen(v), frozen([*a, 0.0]))

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate; jerk is zero inside of the pieces, which is all a piecewise constant can say."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        k = np.maximum(self.knots.searchsorted(times + 1e-9, side="right") - 1, 0)
        tau, v, a = times - self.knots.take(k), self.v.take(k), self.a.take(k)
        columns = np.zeros((4, len(times), 2))
        columns[0, :, 0] = self.s.take(k) + v * tau + 0.5 * a * tau**2
        columns[1, :, 0] = v + a * tau
        columns[2, :, 0] = a
        return FrenetTrajectory(times, *columns)
