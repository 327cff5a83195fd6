"""Sampled trajectories as curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from repair.curves.base import FrenetTrajectory

__all__ = ["SampledCurve"]


@dataclass(frozen=True)
class SampledCurve:
    """A sampled trajectory as a :class:`repair.curves.base.Curve`: linear in between, at end speed beyond.

    Acceleration and jerk are zero: lines have none.
    """

    trajectory: FrenetTrajectory

    @property
    def t_start(self) -> float:
        """Time of the first sample [s]."""
        return float(self.trajectory.t[0])

    @property
    def t_end(self) -> float:
        """Time of the last sample [s]."""
        return float(self.trajectory.t[-1])

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate at the times ``t`` (K,); before the first sample its values are kept."""
        times, known = np.asarray(t, dtype=np.float64), self.trajectory
        position, velocity = np.empty((len(times), 2)), np.empty((len(times), 2))
        for k in (0, 1):
            position[:, k] = np.interp(times, known.t, known.position[:, k])
            velocity[:, k] = np.interp(times, known.t, known.velocity[:, k])
        position += np.maximum(times - known.t[-1], 0.0)[:, None] * velocity
        zero = np.zeros_like(position)
        return FrenetTrajectory(times, position, velocity, zero, zero)
