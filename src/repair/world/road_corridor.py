"""Rectangles along a frame's axis that lie properly inside of the road: a fast yes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points
from repair.world.road import RoadBoundary

if TYPE_CHECKING:
    from repair.scene.frame import FrenetFrame
    from repair.vehicle.parameters import Vehicle

__all__ = ["RoadCorridor"]

# Cells of a corridor: one about every _CELL metres, for poses up to _ALONG before or behind its middle;
# edges farther than _ASIDE from the axis are not looked for.
_CELL = 1.0
_ALONG = 0.9
_ASIDE = 10.0
_ACROSS = 1e-6  # an edge that goes on by less than this along the axis is across it [m]
# As arrays, because NumPy takes long to convert a plain number.
_NONE, _AHEAD = np.array(0.0), np.array(_ALONG)


class RoadCorridor:
    """Rectangles along a frame's axis that lie properly inside of the road, found once per scene.

    A cell's rectangle is aligned with the axis at its middle. A pose is on the road if its own
    rectangle lies in that of a cell, which takes a few array operations; whether the best cell was
    looked at makes no difference to that.

    Parameters
    ----------
    road : RoadBoundary
    frame : FrenetFrame
        The axis.
    vehicle : Vehicle
        The ego.

    Attributes
    ----------
    clear : (float, float)
        A part of the axis [m] along which the ego is known to be on the road; kept for whoever finds one.
    """

    clear: tuple[float, float] = (np.inf, -np.inf)

    def __init__(self, road: RoadBoundary, frame: FrenetFrame, vehicle: Vehicle) -> None:
        self._half_length = np.array(vehicle.half_length)
        count = max(round(frame.length / _CELL), 1)
        s = np.linspace(0.0, frame.length, count + 1)
        self._inverse, self._last = np.array(count / frame.length), np.array(float(count))
        heading = frame.heading(s)
        axis = np.exp(1j * heading)
        middle = np.ascontiguousarray(frame.position(s)).view(np.complex128)[:, 0]
        right, left = _room(road.region, middle, axis, _ALONG + vehicle.radius + road.spare)
        # Seen from the band's middle, both sides are alike.
        self._place = np.array((middle + 0.5j * (left + right) * axis, axis.conj()))
        self._room = np.array((heading, 0.5 * (left - right) - vehicle.half_width - road.spare))

    def holds(self, s: Array, centre: Points, orientation: Array) -> npt.NDArray[np.bool_]:
        """Poses (K,) that are surely on the road; False says nothing.

        Parameters
        ----------
        s : (K,) array
            Arc length [m] along the frame, which chooses the cell.
        centre : (K,) complex array
            Positions x + iy [m].
        orientation : (K,) array
            Of the ego [rad], continuous with the frame's heading.
        """
        cell = np.rint(np.minimum(np.maximum(s * self._inverse, _NONE), self._last)).astype(np.intp)
        middle, turn = self._place.take(cell, axis=1)
        heading, reach = self._room.take(cell, axis=1)
        seen = (centre - middle) * turn
        # Turned by an angle t, the rectangle reaches at most half its length * |t| farther aside.
        aside = np.abs(orientation - heading)
        aside *= self._half_length
        aside += np.abs(seen.imag)
        held: npt.NDArray[np.bool_] = aside <= reach
        held &= np.abs(seen.real) <= _AHEAD
        return held


def _room(region: Any, middle: Points, axis: Points, along: float) -> tuple[Array, Array]:
    """How far a rectangle of half length ``along`` may reach to the right (<= 0) and left (>= 0).

    Within these bounds (K,) no edge of the region meets it; both are 0 where nothing is known.
    """
    import shapely

    left, right = np.full(len(middle), _ASIDE), np.full(len(middle), -_ASIDE)
    rings = shapely.get_rings(shapely.get_parts(region))
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    points = np.ascontiguousarray(xy).view(np.complex128)[:, 0]
    start = np.flatnonzero(ring[1:] == ring[:-1])
    edges = shapely.STRtree(shapely.linestrings(xy[start[:, None] + np.arange(2)]))
    corners = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])
    boxes = (along * corners.real + 1j * _ASIDE * corners.imag) * axis[:, None] + middle[:, None]
    cell, edge = edges.query(shapely.polygons(boxes.view(np.float64).reshape(-1, 4, 2)))
    seen = (points[start[edge] + np.arange(2)[:, None]] - middle[cell]) * axis[cell].conj()
    u, w = seen.real, seen.imag
    met = (u.min(axis=0) <= along) & (u.max(axis=0) >= -along)
    low, high = _reach(u, w, along)
    for bound, least, side, nearest in (
        (left, np.minimum, met & (high >= 0.0), np.maximum(low, 0.0)),
        (right, np.maximum, met & (low <= 0.0), np.minimum(high, 0.0)),
    ):
        least.at(bound, cell[side], nearest[side])
    outside = ~shapely.contains_properly(region, shapely.points(middle.real, middle.imag))
    left[outside] = right[outside] = 0.0
    return right, left


def _reach(u: Array, w: Array, along: float) -> tuple[Array, Array]:
    """Least and largest w (E,) of the part of each edge, from (u, w)[0] to (u, w)[1], with ``|u| <= along``.

    Of edges across the axis it is that of the whole edge, which is not less: where they cross ``along`` is a
    quotient of rounding errors.
    """
    run = u[1] - u[0]
    across = np.abs(run) < _ACROSS
    slope = (w[1] - w[0]) / np.where(across, 1.0, run)
    ends = np.where(across, w, w[0] + slope * (np.clip(u, -along, along) - u[0]))
    return ends.min(axis=0), ends.max(axis=0)
