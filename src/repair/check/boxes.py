"""The paper's measure: an inflated box in (s, l) that is entered at one of the scenario's steps."""

from __future__ import annotations

import numpy as np

from repair.arrays import Array
from repair.check.verdict import Reason, Violation
from repair.curves.base import Curve, FrenetTrajectory
from repair.problem.problem import RepairProblem
from repair.timegrid import INSTANT
from repair.world.boxes import Occupancy
from repair.world.dead_ends import ROAD_END
from repair.world.occupancy import first_entry

__all__ = ["boxes_entered"]


def boxes_entered(
    problem: RepairProblem, curve: Curve, after: FrenetTrajectory, times: Array, substeps: int
) -> list[Violation]:
    """The paper's detectCollision on the repaired part, at the scenario's steps.

    Parameters
    ----------
    problem : RepairProblem
    curve : Curve
        The repair.
    after : FrenetTrajectory
        Its samples from ``t_rep`` on.
    times : (K,) array
        Of the samples from t = 0 on, ``substeps`` to a step [s].
    substeps : int
    """
    if not _enters(problem, after, substeps):
        return []
    samples = times[::substeps]
    samples = samples[samples >= problem.t_rep - INSTANT]
    entry = first_entry(problem.occupancy, curve.sample(samples))
    if entry is None:
        return []
    time = float(samples[entry[0]])
    who = problem.occupancy.ids[entry[1]]
    return [Violation(Reason.MARGIN, time, "end of the road" if who == ROAD_END else f"obstacle {who}")]


def _enters(problem: RepairProblem, dense: FrenetTrajectory, n: int) -> bool:
    """Whether a box may be entered at a scenario's step; False is certain.

    Where the boxes are tabulated at these very steps there is nothing to interpolate.
    """
    occupancy: Occupancy = problem.occupancy
    count = len(dense)
    first = round(float(dense.t[0]) / problem.dt * n) if count else 0
    skip = -first % n
    if not len(occupancy) or count <= skip:
        return False
    rows = slice((first + skip) // n, (first + count - 1) // n + 1)
    t = occupancy.t[rows]
    inner = dense.t[skip::n]
    if len(t) != len(inner) or max(abs(t[0] - inner[0]), abs(t[-1] - inner[-1])) > 1e-9:
        return True
    lower, upper = occupancy.lower[:, rows], occupancy.upper[:, rows]
    s, l = dense.position[skip::n].T  # noqa: E741
    inside = (lower[..., 0] < s) & (s < upper[..., 0])
    if not np.count_nonzero(inside):
        return False
    inside &= lower[..., 1] < l
    inside &= l < upper[..., 1]
    return bool(np.count_nonzero(inside))
