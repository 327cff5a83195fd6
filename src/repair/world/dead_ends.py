"""Where the path leaves the road, as boxes in (s, l, t): the end of a lane is something to stop before.

To a backend the end of the drivable route is a standing obstacle like any other: it yields to it, or passes
it on a side where the road goes on. Where that is, is asked of the road itself, so that lanes that end or
narrow, closed lanes and the end of the map are the same thing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points, frozen, names
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame
    from repair.scene.road.bounds import LateralBounds
    from repair.vehicle.parameters import Vehicle
    from repair.world.road import RoadBoundary
    from repair.world.road_corridor import RoadCorridor

__all__ = ["ROAD_END", "dead_ends", "with_boxes"]

#: Instead of an obstacle's id.
ROAD_END = -2

_COARSE, _FINE = 0.5, 0.02  # steps along the path [m]
_SIDEWAYS = 0.2  # steps across it [m]
_SPARE = 0.1  # kept to the last place that is on the road [m]
_BEFORE = 6.0  # the last place that is on the road is looked for so far before the first that is not [m]
_OVER = 0.05  # who is over the edge by less is not stopped: how the body is turned there is not known yet [m]
_FAR = 1e4  # where the road never goes on [m]
_SEEN = 60.0  # how much of a part off the road is looked at sideways [m]
_SOME = 50  # of the fine places at a time
_MORE = 40.0  # looked at beyond what is asked for, where a path is asked about again [m]

_Inside = Callable[..., npt.NDArray[np.bool_]]


def dead_ends(
    road: RoadBoundary, frame: FrenetFrame, vehicle: Vehicle, room: LateralBounds, start: float, ahead: float,
    corridor: RoadCorridor | None = None,
) -> list[tuple[Array, Array]]:  # fmt: skip
    """The parts of the path on which the ego would be off the road.

    Parameters
    ----------
    road : RoadBoundary
    frame : FrenetFrame
        Along the path.
    vehicle : Vehicle
        The ego.
    room : LateralBounds
        How far aside the ego may go.
    start, ahead : float
        From where on the path is looked at, and how far [m]. A part in which it starts is none.
    corridor : RoadCorridor, optional
        Of this road and frame: most places are on the road by that alone.

    Returns
    -------
    list of (lower, upper)
        Corners ``[s, l]`` (2,) of a box for the ego's reference point each; from the last place at which the
        ego, along the path, is on the road, and as wide as the road is missing around the path.
    """

    def poses(s: Array, l: Array) -> tuple[Points, Array]:  # noqa: E741
        slip = np.arcsin(np.clip(vehicle.rear * frame.curvature(s), -0.9, 0.9))
        centre = np.ascontiguousarray(frame.to_cartesian(s, l)).view(np.complex128)[:, 0]
        return centre, frame.heading(s) - slip

    def inside(s: Array, l: Array, over: float = 0.0) -> npt.NDArray[np.bool_]:  # noqa: E741
        body = vehicle.corners - over * np.sign(vehicle.corners)
        centre, orientation = poses(s, l)
        # Beyond all of the road nobody is on it.
        x, y = centre.real, centre.imag
        found: npt.NDArray[np.bool_] = (x >= low_x) & (x <= high_x)
        found &= (y >= low_y) & (y <= high_y)
        near = np.flatnonzero(found)
        if len(near):
            turn = np.exp(1j * orientation[near])
            corners = centre[near, None] + turn[:, None] * (body[:, 0] + 1j * body[:, 1])
            found[near] = road.inside(np.stack([corners.real, corners.imag], axis=2))
        return found

    since, until = (np.inf, -np.inf) if corridor is None else corridor.clear
    if since <= start and start + ahead + _COARSE <= until:
        return []
    more = _MORE if since <= start <= until else 0.0  # who asks again does so again and again
    low_x, low_y, high_x, high_y = road.region.bounds
    s = start + np.arange(0.0, ahead + more + _COARSE, _COARSE)
    axis = np.zeros(len(s))
    on = np.zeros(len(s), dtype=np.bool_) if corridor is None else corridor.holds(s, *poses(s, axis))
    if not on.all():
        on[~on] = inside(s[~on], axis[~on], _OVER)
    if corridor is not None and on[0]:
        corridor.clear = start, float(s[-1] if on.all() else s[np.argmin(on) - 1])
    within = s < start + ahead + _COARSE
    s, on = s[within], on[within]
    if on.all():
        return []
    change = np.flatnonzero(np.diff(on.astype(np.int8)))
    found = []
    for k in change[on[change]]:
        again = np.flatnonzero(on[k + 1 :])
        last = k + 1 + int(again[0]) if len(again) else len(s) - 1
        fine = np.arange(max(s[k] - _BEFORE, start), s[k + 1], _FINE)
        wall = _last_inside(inside, fine)
        wall = float(s[k]) if wall is None else wall
        left = _open_side(inside, wall, float(s[last]), room, 1.0)
        right = _open_side(inside, wall, float(s[last]), room, -1.0)
        beyond = float(s[last]) + _SPARE if len(again) else _FAR
        found.append((np.array([wall - _SPARE, right]), np.array([beyond, left])))
    return found


def _last_inside(inside: _Inside, s: Array) -> float | None:
    """The last of some places of the path at which the ego is on the road; mostly it is one of the last."""
    for end in range(len(s), 0, -_SOME):
        part = s[max(end - _SOME, 0) : end]
        whole = np.flatnonzero(inside(part, np.zeros(len(part))))
        if len(whole):
            return float(part[whole[-1]])
    return None


def _open_side(inside: _Inside, first: float, last: float, room: LateralBounds, sign: float) -> float:
    """The offset from which on the ego is on the road all along a part of the path; far out if none is."""
    s = np.arange(first + _COARSE, min(last, first + _SEEN) + _COARSE, 1.0)
    bounds = np.abs(room.at(s)[0 if sign < 0.0 else 1])
    aside = np.arange(_SIDEWAYS, float(bounds.max(initial=0.0)) + _SIDEWAYS, _SIDEWAYS)
    if not len(aside):
        return sign * _FAR
    # Most offsets fail at one of a few places, and of those that are left the first mostly is free.
    open_ = np.arange(len(aside))
    for at in (s[-1], s[0], s[len(s) // 2]):
        open_ = open_[inside(np.full(len(open_), at), sign * aside[open_])]
        if not len(open_):
            return sign * _FAR
    for some in (open_[:1], open_[1:5], open_[5:]):
        places = np.meshgrid(s, sign * aside[some], indexing="ij")
        free = inside(*(column.ravel() for column in places)).reshape(len(s), len(some)).all(axis=0)
        if free.any():
            return sign * float(aside[some[np.argmax(free)]])
    return sign * _FAR


def with_boxes(occupancy: Occupancy, boxes: list[tuple[Array, Array]]) -> Occupancy:
    """The obstacles and standing boxes beside them, with the id :data:`ROAD_END`."""
    if not boxes:
        return occupancy
    steps = len(occupancy.t)
    lower, upper = (np.array([pair[k] for pair in boxes]) for k in (0, 1))
    more = [np.repeat(corners[:, None], steps, axis=1) for corners in (lower, upper)]
    return Occupancy(
        occupancy.t,
        names([*occupancy.ids.tolist(), *[ROAD_END] * len(boxes)]),
        frozen(np.concatenate([occupancy.lower, more[0]])),
        frozen(np.concatenate([occupancy.upper, more[1]])),
        np.append(occupancy.static, np.ones(len(boxes), dtype=np.bool_)),
    )
