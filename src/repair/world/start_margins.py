"""Margins in which the ego starts: what counts of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from repair.arrays import Array, frozen, names
from repair.world.boxes import Occupancy

__all__ = ["shrink_to_start"]

_OUTSIDE = 1e-6  # a reduced box ends this far from where the reference was [m]


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
