"""The times at which a corridor is sampled, and the straight lines that may cut a piece of it off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.problem.problem import RepairProblem
from repair.timegrid import INSTANT

__all__ = ["TimeGrid", "time_grid"]

_FEW = 20  # times of a piece up to which all pairs of them are tried at once


@dataclass(frozen=True)
class TimeGrid:
    """The times at which a corridor of M pieces is sampled: the edges and the steps of the occupancy.

    Attributes
    ----------
    edges : (M + 1,) array
        Times at which the pieces meet [s].
    times : (U,) array
        All times [s].
    index : (M, L) int array
        Which of them belong to each piece, from edge to edge; a shorter row repeats its last one.
    base, second : (C,) int array
        The two points of each candidate line of :func:`repair.baselines.qptr.walls.line_below`, among
        those of a piece and the same again a piece later. No lines where a piece has many times: there are
        half as many pairs as their square, and each line is looked at at all of them.
    ratio : (L, M, C) array
        How far each time is on the way from one to the other; NaN where both are one. Empty without pairs.
    """

    edges: Array
    times: Array
    index: npt.NDArray[np.intp]
    base: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]
    ratio: Array


@lru_cache(maxsize=32)
def _candidates(count: int) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    first, second = np.triu_indices(count, k=1)
    every = np.arange(count)
    return np.concatenate([first, every]), np.concatenate([second, count + every])


@lru_cache(maxsize=128)
def _time_grid(t_start: float, t_end: float, pieces: int, occupied: bytes) -> TimeGrid:
    edges = np.asarray(t_start + (t_end - t_start) / pieces * np.arange(pieces + 1))
    steps = np.frombuffer(occupied)
    times = np.union1d(edges, steps[(steps > edges[0] + INSTANT) & (steps < edges[-1] - INSTANT)])
    times = times[np.concatenate([[True], np.diff(times) > INSTANT])]
    first = np.searchsorted(times, edges[:-1] - INSTANT)
    last = np.searchsorted(times, edges[1:] + INSTANT, side="right") - 1
    index = np.minimum(first[:, None] + np.arange((last - first).max() + 1), last[:, None])
    many = index.shape[1] > _FEW
    base, second = _candidates(0 if many else index.shape[1])
    t = times[index]
    start = t.take(base, axis=1)
    span = np.hstack([t, t + t[:, -1:] - t[:, :1]]).take(second, axis=1) - start
    span[span <= 0.0] = np.nan
    # Times first in memory too: products and reductions are several times as fast as in that of t.T.
    ratio = (np.ascontiguousarray(t.T)[:, :, None] - start) / span
    return TimeGrid(edges, frozen(times), index, base, second, frozen(ratio))


def time_grid(problem: RepairProblem, pieces: int) -> TimeGrid:
    """The grid of a problem whose repair is cut into ``pieces`` of the same duration."""
    return _time_grid(problem.t_rep, problem.t_end, pieces, problem.occupancy.t.tobytes())
