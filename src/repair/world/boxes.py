"""Obstacles as boxes in (s, l, t), and where times lie among their steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, names
from repair.timegrid import STEP

__all__ = ["Occupancy", "nothing"]

_KEPT = 1000  # times of a query whose places among the steps are kept


@lru_cache(maxsize=64)
def _steps_at(
    times: bytes, start: float, step: float, count: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array | None, npt.NDArray[np.bool_] | None]:
    """Where times lie among equally spaced steps: the steps below and above, and the weight of the upper one.

    None for the weights where all times are on a step, and for which are outside where none is. Searches
    ask for the same times over and over.
    """
    where = (np.frombuffer(times) - start) / step
    nearest = np.rint(where)
    off_step = np.abs(where - nearest) >= STEP
    where = np.where(off_step, where, nearest)
    below = np.floor(where)
    low = below.astype(np.intp)
    # On a step its own row counts alone: the next one may be NaN.
    high = np.where(off_step, low + 1, low)
    weight, outside = (where - below)[:, None], (where < 0) | (where > count - 1)
    for kept in (low, high, weight, outside):
        kept.setflags(write=False)
    return low, high, weight if off_step.any() else None, outside if outside.any() else None


@dataclass(frozen=True)
class Occupancy:
    """Obstacles as boxes in (s, l, t), inflated so that the ego is a point.

    Between two steps the box is the linear interpolation of its neighbours. An obstacle that is
    not there at a step has NaN in its row.

    Attributes
    ----------
    t : (T,) array
        Times of the steps [s], starting at 0, equally spaced.
    ids : (N,) int array
        CommonRoad obstacle ids; objects where one has more than 64 bits.
    lower, upper : (N, T, 2) array
        Corners ``[s, l]`` of the boxes [m], S_offset and L_offset included.
    static : (N,) bool array
        The box never moves.
    """

    t: Array
    ids: npt.NDArray[Any]
    lower: Array
    upper: Array
    static: npt.NDArray[np.bool_]

    def at(self, times: npt.ArrayLike) -> tuple[Array, Array]:
        """Boxes (N, K, 2) at ``times`` (K,); NaN where an obstacle is absent or the time is outside."""
        query = np.asarray(times, dtype=np.float64)
        step = self.t.item(1) - self.t.item(0) if len(self.t) > 1 else 1.0
        look_up = _steps_at if query.size <= _KEPT else _steps_at.__wrapped__
        low, high, weight, outside = look_up(query.tobytes(), self.t.item(0), step, len(self.t))
        lower, upper = self.lower.take(low, axis=1, mode="clip"), self.upper.take(low, axis=1, mode="clip")
        if weight is not None:
            lower += weight * (self.lower.take(high, axis=1, mode="clip") - lower)
            upper += weight * (self.upper.take(high, axis=1, mode="clip") - upper)
        if outside is not None:
            lower[:, outside] = np.nan
            upper[:, outside] = np.nan
        return lower, upper

    @cached_property
    def swept(self) -> Array:
        """What each box spans between two steps, ``[s_max, -s_min, l_max, -l_min]`` (4, N, T - 1).

        NaN where the box is at neither step; where there is one step only, the box itself (4, N, 1).
        The signs let one comparison tell what is near.
        """
        first, second = (slice(-1), slice(1, None)) if len(self.t) > 1 else (slice(None), slice(None))
        lower = np.fmin(self.lower[:, first], self.lower[:, second])
        upper = np.fmax(self.upper[:, first], self.upper[:, second])
        return frozen([upper[..., 0], -lower[..., 0], upper[..., 1], -lower[..., 1]])

    def select(self, keep: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Occupancy:
        """The obstacles that ``keep`` names."""
        rows = keep.nonzero()[0] if keep.dtype == np.bool_ else keep
        lower, upper = self.lower.take(rows, axis=0), self.upper.take(rows, axis=0)
        return Occupancy(self.t, self.ids.take(rows), lower, upper, self.static.take(rows))

    def __len__(self) -> int:
        return len(self.ids)


def nothing(t: Array) -> Occupancy:
    """No obstacles, at times (T,) [s]."""
    none = frozen(np.empty((0, len(t), 2)))
    return Occupancy(frozen(t), names([]), none, none, np.empty(0, dtype=np.bool_))
