"""Obstacles as boxes in (s, l, t): where times lie among their steps, what counts of them at the start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, names
from repair.timegrid import STEP

__all__ = ["Boxes", "Occupancy", "nothing", "shrink_to_start"]

_OUTSIDE = 1e-6  # a reduced box ends this far from where the reference was [m]
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


class Boxes:
    """Obstacles as boxes, and what had to be assumed about them; a check of true shapes needs neither.

    Parameters
    ----------
    make : callable
        Gives both; called once.
    """

    def __init__(self, make: Callable[[], tuple[Occupancy, tuple[str, ...]]]) -> None:
        self._make = make

    @cached_property
    def _made(self) -> tuple[Occupancy, tuple[str, ...]]:
        return self._make()

    @property
    def known(self) -> bool:
        """Whether they have been made."""
        return "_made" in self.__dict__

    @property
    def occupancy(self) -> Occupancy:
        """The obstacles, inflated."""
        return self._made[0]

    def left_of(self, path: Array, touching: set[int], offsets: tuple[float, float]) -> Boxes:
        """The same without the margins that a path never had; see :func:`shrink_to_start`."""
        return Boxes(partial(_shrunk, self, path, touching, offsets))

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be assumed."""
        return self._made[1]


def _shrunk(
    whole: Boxes, path: Array, touching: set[int], offsets: Sequence[float]
) -> tuple[Occupancy, tuple[str, ...]]:
    occupancy, notes = shrink_to_start(whole.occupancy, path, touching, offsets)
    return occupancy, (*whole.notes, *notes)


def shrink_to_start(
    occupancy: Occupancy, followed: Array, touching: set[int], offsets: Sequence[float]
) -> tuple[Occupancy, tuple[str, ...]]:
    """Take back so much of the margin of an obstacle in which the ego starts as the reference never had.

    A start within the margin but without contact is not a collision yet; without this, nothing could ever be
    repaired from there. What counts of the margin along either axis, at a step, is the largest distance along
    that axis at which the reference has been from the obstacle until the step before; the whole margin again
    from where it has left it. So who starts in a margin may stay as near as that, and go away, and is in
    conflict where it comes closer than it was along one of the axes, inside of the margin along the other.

    Along an axis along which the reference has overlapped the bare obstacle all the while (it is beside or
    behind it) there is nothing to keep. An obstacle that has kept both, at a corner, gets a box for each.

    What counts never depends on the offsets, but for being cut off at them. So larger offsets never make a
    conflict later (``tests/unit/test_reference_gaps.py`` tries).

    Parameters
    ----------
    followed : (K, 2) array
        ``[s, l]`` of the reference at the occupancy's steps from t = 0 on [m]; where it is not known (later
        rows, NaN), what it has had until then counts on. A start alone, (2,), holds its margins throughout.
    touching : set of int
        Obstacles in true contact with the ego at the start, which keep their margin.
    offsets : (2,) sequence
        S_offset and L_offset, by which the boxes are inflated [m].

    Returns
    -------
    Occupancy
        One row for each obstacle in order, then the second ones of those with two.
    notes : tuple of str
        What was taken back.
    """
    path = np.atleast_2d(np.asarray(followed, dtype=np.float64))[: len(occupancy.t)]
    inside = (occupancy.lower[:, 0] < path[0]) & (path[0] < occupancy.upper[:, 0])
    violated = np.flatnonzero(inside.all(axis=1) & ~np.isin(occupancy.ids, list(touching)))
    if not len(violated):
        return occupancy, ()
    lower, upper, ids = occupancy.lower.copy(), occupancy.upper.copy(), list(occupancy.ids)
    static, more, notes = occupancy.static.copy(), [], []
    for k in violated:
        whole = occupancy.lower[k], occupancy.upper[k]
        cuts = _reduced(*whole, path, np.asarray(offsets, dtype=np.float64))
        (lower[k], upper[k]), rest = cuts[0][1:], cuts[1:]
        static[k] &= _constant(lower[k]) and _constant(upper[k])
        more += [(ids[k], low, high) for _, low, high in rest]
        depth = float(np.minimum(path[0] - whole[0][0], whole[1][0] - path[0]).min())
        notes.append(
            f"the ego starts {depth:.2f} m inside the margin of obstacle {ids[k]}; along "
            f"{' and '.join('sl'[axis] for axis, _, _ in cuts)} that margin counts as far as the reference "
            "has kept it, and whole again once it has left it"
        )
    if more:
        lower = np.concatenate([lower, [low for _, low, _ in more]])
        upper = np.concatenate([upper, [high for _, _, high in more]])
        ids += [name for name, _, _ in more]
        static = np.append(static, [_constant(low) and _constant(high) for _, low, high in more])
    made = Occupancy(occupancy.t, names(ids), frozen(lower), frozen(upper), static.astype(np.bool_))
    return made, tuple(notes)


def _reduced(lower: Array, upper: Array, path: Array, offsets: Array) -> list[tuple[int, Array, Array]]:
    """Boxes (T, 2) of one obstacle with the margin along one axis each reduced to what the path has had.

    Returns
    -------
    list of tuple
        The axis, and the box's corners; NaN while there is nothing of the margin to keep along the axis.
    """
    count = min(len(path), len(lower))
    below = lower[:count] + offsets - path[:count]  # how far the path is before the bare obstacle
    above = path[:count] - upper[:count] + offsets
    apart = np.fmax(below, above)
    apart = np.where(np.isfinite(apart), apart, -np.inf)
    had = np.maximum.accumulate(apart, axis=0)
    at = np.maximum.accumulate(np.where(apart >= had, np.arange(count)[:, None], 0), axis=0)
    steps = np.clip(np.arange(len(lower)) - 1, 0, count - 1)  # what there was until the step before
    had, at = had[steps], at[steps]
    kept = had >= 0.0
    if not kept[0].any():  # deep in a box that is larger than its obstacle: out by the nearest side
        kept[:, int(np.argmax(had[0]))] = True
    found = []
    for axis in (0, 1):
        if not kept[:, axis].any():
            continue
        cut = np.maximum(offsets[axis] - (had[:, axis] - _OUTSIDE), 0.0)
        before = below[at[:, axis], axis] >= above[at[:, axis], axis]
        low, high = lower.copy(), upper.copy()
        low[:, axis] += np.where(before, cut, 0.0)
        high[:, axis] -= np.where(before, 0.0, cut)
        gone = ~kept[:, axis] | (low[:, axis] >= high[:, axis])
        low[gone], high[gone] = np.nan, np.nan
        found.append((axis, low, high))
    return found


def _constant(corner: Array) -> bool:
    return bool((corner == corner[0]).all())
