"""The curve that shows the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from repair.curves.base import Curve, FrenetTrajectory
from repair.problem.problem import RepairProblem

__all__ = ["guide_of"]


@dataclass(frozen=True)
class _Sampled:
    """A sampled guide as a :class:`repair.curves.base.Curve`, linear in between, at end speed beyond."""

    trajectory: FrenetTrajectory

    @property
    def t_start(self) -> float:
        return float(self.trajectory.t[0])

    @property
    def t_end(self) -> float:
        return float(self.trajectory.t[-1])

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        times, known = np.asarray(t, dtype=np.float64), self.trajectory
        position, velocity = np.empty((len(times), 2)), np.empty((len(times), 2))
        for k in (0, 1):
            position[:, k] = np.interp(times, known.t, known.position[:, k])
            velocity[:, k] = np.interp(times, known.t, known.velocity[:, k])
        position += np.maximum(times - known.t[-1], 0.0)[:, None] * velocity
        zero = np.zeros_like(position)
        return FrenetTrajectory(times, position, velocity, zero, zero)


def guide_of(problem: RepairProblem) -> Curve:
    """The curve that shows the way."""
    return problem.reference if problem.passing is None else _Sampled(problem.passing.guide)
