"""Boxes of everybody, and ahead of and behind him: what a gentle repair keeps clear of is projected once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen, wrap
from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.world import displacement
from repair.world.boxes import Occupancy
from repair.world.occupancy import Within, build_occupancy

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame

__all__ = ["boxes_around"]

_LEAST = 0.2  # of 1 - kappa l: beyond, a place is next to the centre of the bend


def boxes_around(
    believed: tuple[Obstacle, ...],
    error: float,
    frame: FrenetFrame,
    dt: float,
    s_offset: float,
    l_offset: float,
    within: Within | None = None,
) -> tuple[Occupancy, tuple[str, ...]]:
    """The boxes of those whom :func:`repair.simulate.world.widened` makes of everybody.

    The box of who is believed is moved along his heading, and not projected again. In a bend it is off by
    about half of the curvature times the square of the distance; a check looks at the true shapes. One box
    around all three was tried: past it fewer gentle repairs are found.

    Parameters
    ----------
    believed : tuple of Obstacle
    error : float
        The distance is half of it times t² [m/s²].
    frame, dt, s_offset, l_offset, within
        As in :func:`repair.world.occupancy.build_occupancy`.
    """
    moved = {one.id: ways for one in believed if (ways := _ways(one, error, dt)) is not None}
    if within is not None and moved:
        farthest = np.array([np.abs(by).max(axis=0) for by, _ in moved.values()]).max(axis=0)
        most, steps = float(farthest.max()), len(within.ways)
        within = Within(
            within.start, within.low - most, within.high + most, within.aside + most,
            within.ways + np.maximum.accumulate(farthest)[:steps],
        )  # fmt: skip
    plain, notes = build_occupancy(believed, frame, dt, s_offset, l_offset, within)
    rows, shifts = list(range(len(plain))), [np.zeros(plain.lower.shape[1:])] * len(plain)
    along: dict[int, Array] = {}
    for row, name in enumerate(plain.ids):
        if name not in moved or not np.isfinite(plain.lower[row]).any():
            continue
        heading = moved[name][1]
        s, l = np.nan_to_num(0.5 * (plain.lower[row] + plain.upper[row])).T  # noqa: E741
        s = np.clip(s, 0.0, frame.length)
        turned = wrap(heading - frame.heading(s))
        rate = np.maximum(1.0 - frame.curvature(s) * l, _LEAST)
        along[row] = np.column_stack([np.cos(turned) / rate, np.sin(turned)])
    for side in (0, 1):  # all of them ahead, and then behind
        rows += list(along)
        shifts += [moved[plain.ids[row]][0][side][:, None] * way for row, way in along.items()]
    if len(rows) == len(plain):
        return plain, notes
    lower, upper = (frozen(table[rows] + np.array(shifts)) for table in (plain.lower, plain.upper))
    return Occupancy(plain.t, plain.ids[rows], lower, upper, plain.static[rows]), notes


def _ways(one: Obstacle, error: float, dt: float) -> tuple[Array, Array] | None:
    """How far ahead and behind he may be (2, T) [m], and his headings; None where he stays."""
    found = [by for sign in (1.0, -1.0) if (by := displacement(one, sign * error, dt)) is not None]
    return (np.array(found), np.nan_to_num(one.states[:, 2])) if found else None
