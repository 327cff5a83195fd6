"""What a t_rep on the scenario's own steps has in common with every other one, tabulated once.

A search asks for the problems of many t_rep of the same scene and reference, nearly always on the
scenario's steps. There the reference's samples, the boxes, and where the two meet are pieces of the
same tables; only what depends on the state at t_rep is left to be computed.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.base import FrenetTrajectory
from repair.problem.surroundings import Surroundings, inside, overlapping, widened
from repair.timegrid import ROUNDING

if TYPE_CHECKING:
    from repair.curves.base import Curve
    from repair.world.boxes import Occupancy

__all__ = ["Grid"]

# A time [s] this near to a step is on it; multiples of a step differ from it by rounding errors only.
_ON_STEP = ROUNDING


@dataclass(frozen=True)
class Grid:
    """Reference and boxes at the steps 0, 1, .., K of the scenario.

    Attributes
    ----------
    occupancy : Occupancy
        The obstacles; its first steps are those of the grid.
    swept : (4, N, K) array
        What the boxes span from each step to the next.
    step : float
        Time between two steps [s].
    last : int
        The step K at which the repairs end.
    states : (K + 1, 3, 2) array
        Position, velocity and acceleration ``[s, l]`` of the reference.
    columns : (4, K + 1, 2) array
        The same by derivative, with the jerk.
    hits : list of (k, j)
        Steps and obstacles at which the reference is inside of a box, in this order.
    rightmost, leftmost : list of float
        Smallest and largest l of the reference from a step on [m].
    """

    occupancy: Occupancy
    swept: Array
    step: float
    last: int
    states: Array
    columns: Array
    hits: list[tuple[int, int]]
    rightmost: list[float]
    leftmost: list[float]
    _wide: dict[float, tuple[Array, npt.NDArray[np.bool_]]] = field(default_factory=dict)

    @classmethod
    def over(cls, occupancy: Occupancy, reference: Curve, t_end: float, step: float) -> Grid | None:
        """The tables until ``t_end``; None where that, or the boxes' own steps, are not the scenario's."""
        last = round(t_end / step)
        times = step * np.arange(last + 1)
        if abs(t_end - times[-1]) > _ON_STEP or last >= len(occupancy.t):
            return None
        if np.abs(occupancy.t[: last + 1] - times).max() > _ON_STEP:
            return None
        samples = reference.sample(times)
        columns = frozen([samples.position, samples.velocity, samples.acceleration, samples.jerk])
        lower, upper = occupancy.lower[:, : last + 1], occupancy.upper[:, : last + 1]
        hits = inside(lower, upper, columns[0]).T.nonzero()
        sideways = columns[0, ::-1, 1]
        return cls(
            occupancy,
            occupancy.swept[:, :, :last],
            step,
            last,
            frozen(columns[:3].transpose(1, 0, 2)),
            columns,
            list(zip(hits[0].tolist(), hits[1].tolist(), strict=True)),
            np.minimum.accumulate(sideways)[::-1].tolist(),
            np.maximum.accumulate(sideways)[::-1].tolist(),
        )

    def index(self, t: float) -> int | None:
        """The step at the time ``t`` [s]; None between two steps."""
        k = round(t / self.step)
        return k if abs(t - k * self.step) <= _ON_STEP else None

    def trajectory(self, first: int, times: Array) -> FrenetTrajectory:
        """The reference from a step on."""
        position, velocity, acceleration, jerk = self.columns[:, first:]
        return FrenetTrajectory(times, position, velocity, acceleration, jerk)

    def surroundings(
        self, first: int, rows: npt.NDArray[np.intp], near: Occupancy, margin: float
    ) -> Surroundings:
        """The same as :func:`repair.problem.surroundings.surroundings` of the reference from a step on.

        Parameters
        ----------
        rows, near
            Which obstacles are within reach, and their boxes.
        """
        steps = slice(first, self.last + 1)
        among = rows.tolist()
        # The hits are in the order of their steps.
        ahead = self.hits[bisect_left(self.hits, (first, 0)) :]
        conflict = next(((k - first, among.index(j)) for k, j in ahead if j in among), None)
        ends, overlap = self._widened(margin)
        return Surroundings(
            near.lower[:, steps],
            near.upper[:, steps],
            conflict,
            ends.take(rows, axis=1)[..., first:],
            overlap.take(rows, axis=0)[:, first:],
        )

    def _widened(self, margin: float) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Ends (2, N, K + 1) of all boxes along s, and which of them the reference overlaps sideways."""
        if margin not in self._wide:
            steps = slice(self.last + 1)
            ends, edges = widened(self.occupancy.lower[:, steps], self.occupancy.upper[:, steps], margin)
            self._wide[margin] = frozen(ends), overlapping(edges, self.columns[0, :, 1])
        return self._wide[margin]
