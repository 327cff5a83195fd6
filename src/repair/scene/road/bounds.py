"""The room to the left and right of a path: where its normals cross lanelets, and which of these count."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen, names
from repair.scene.frame import FrenetFrame
from repair.scene.road.lanes import Lane

__all__ = ["LaneletCrossings", "LateralBounds", "crossings", "lateral_bounds"]

_REACH = 20.0  # half length of the normals [m]
_GAP = 0.36  # lanelets this close count as connected [m]; a little more than gaps are closed to
_ALONG = 0.5  # cos of the largest angle between lanes of the same direction


@dataclass(frozen=True)
class LateralBounds:
    """Where the ego's *reference point* may be sideways, tabulated over s.

    ``right[k] <= l <= left[k]`` at ``s[k]``; half the ego's width is already taken off.

    Attributes
    ----------
    s : (M,) array
        Arc lengths of the table [m], increasing.
    right, left : (M,) array
        Smallest (<= 0) and largest (>= 0) offset [m].
    """

    s: Array
    right: Array
    left: Array

    def at(self, s: npt.ArrayLike) -> tuple[Array, Array]:
        """Right and left bound at ``s`` (any shape), linear in between, constant beyond the ends."""
        both = np.interp(np.asarray(s, dtype=np.float64), self.s, self._both)
        return both.real, both.imag

    @cached_property
    def _both(self) -> npt.NDArray[np.complex128]:
        """Both sides at once, as the parts of complex numbers."""
        both = np.empty(len(self.s), dtype=np.complex128)
        both.real, both.imag = self.right, self.left
        return both

    def narrowed(self, by: float) -> LateralBounds:
        """The same with ``by`` [m] less on both sides; the path (l = 0) stays allowed."""
        right, left = np.minimum(self.right + by, 0.0), np.maximum(self.left - by, 0.0)
        return LateralBounds(self.s, frozen(right), frozen(left))


@dataclass(frozen=True)
class LaneletCrossings:
    """Where the frame's normals cross lanelets.

    Attributes
    ----------
    s : (M,) array
        Arc lengths at which the normals stand [m].
    row : (C,) int array
        Which of them is the normal of a crossing.
    lanelet : (C,) int array
        The lanelet that it crosses,
    low, high : (C,) array
        and from which offset to which [m].
    along : (C,) bool array
        Whether the lanelet runs in the frame's direction there.
    """

    s: Array
    row: npt.NDArray[np.intp]
    lanelet: npt.NDArray[Any]
    low: Array
    high: Array
    along: npt.NDArray[np.bool_]


def crossings(frame: FrenetFrame, lanes: Mapping[int, Lane], *, spacing: float = 1.0) -> LaneletCrossings:
    """Cut every drivable lanelet with the frame's normals (shapely, all at once).

    Parameters
    ----------
    frame : FrenetFrame
    lanes : mapping
        The map's lanes by id.
    spacing : float
        Distance of the normals, at most [m].
    """
    import shapely

    s = np.linspace(0.0, frame.length, max(int(np.ceil(frame.length / spacing)), 1) + 1)
    inside = np.clip(s, 0.05, frame.length - 0.05)  # at the very end a normal may lie on a lanelet's edge
    base = frame.position(inside)
    heading = frame.heading(inside)
    tangent = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    # on the inner side of a curve the normals end where they would meet
    curvature = frame.curvature(s)
    inner = 0.95 / np.maximum(np.abs(curvature), 0.95 / _REACH)
    left = np.where(curvature > 0, inner, _REACH)
    right = np.where(curvature < 0, inner, _REACH)
    normals = shapely.linestrings(
        np.stack([base - right[:, None] * normal, base + left[:, None] * normal], axis=1)
    )
    ids = [i for i, lane in lanes.items() if lane.drivable]
    polygons = np.array([lanes[i].polygon for i in ids])
    which, row = shapely.STRtree(normals).query(polygons, predicate="intersects")
    parts, source = shapely.get_parts(shapely.intersection(normals[row], polygons[which]), return_index=True)
    lines = shapely.get_type_id(parts) == 1
    parts, source = parts[lines], source[lines]
    ends = np.stack([shapely.get_coordinates(shapely.get_point(parts, k)) for k in (0, -1)], axis=1)
    row, which = row[source], which[source]
    lateral = np.einsum("kij,kj->ki", ends - base[row][:, None], normal[row])
    middle = np.mean(ends, axis=1)
    along = np.zeros(len(row), dtype=bool)
    for number in np.unique(which):
        member = which == number
        along[member] = _runs_along(lanes[ids[number]].center, middle[member], tangent[row[member]])
    return LaneletCrossings(
        s, row, names(ids)[which], lateral.min(axis=1), lateral.max(axis=1), along
    )  # fmt: skip


def _runs_along(center: Array, points: Array, tangent: Array) -> npt.NDArray[np.bool_]:
    """Whether a centre line runs along the tangents (K, 2), each seen from the point (K, 2) next to it."""
    step = np.diff(center, axis=0)
    length = np.hypot(step[:, 0], step[:, 1])
    step, start = step[length > 1e-6], center[:-1][length > 1e-6]
    middle = start + step / 2.0
    nearest = np.argmin(np.sum((points[:, None] - middle) ** 2, axis=-1), axis=1)
    direction = step[nearest] / np.hypot(step[nearest, 0], step[nearest, 1])[:, None]
    return np.asarray(np.sum(direction * tangent, axis=1) > _ALONG)


def lateral_bounds(
    found: LaneletCrossings,
    half_width: float,
    *,
    lanelets: Collection[int] | None = None,
    same_direction: bool = False,
) -> LateralBounds:
    """Room of the reference point around l = 0 on connected lanelets.

    Parameters
    ----------
    found : LaneletCrossings
    half_width : float
        Taken off on both sides [m]. The path itself (l = 0) always stays allowed.
    lanelets : collection of int, optional
        Count these only.
    same_direction : bool
        Count only lanelets that run along the frame, besides those of ``lanelets``.
    """
    use = np.ones(len(found.row), dtype=bool)
    if same_direction:
        use &= found.along
    if lanelets is not None:
        named = np.isin(found.lanelet, names(lanelets))
        use = (use | named) if same_direction else named
    row, low, high = found.row[use], found.low[use], found.high[use]
    count = len(found.s)
    right, left = np.zeros(count), np.zeros(count)
    for _ in range(32):
        touch = (low <= left[row] + _GAP) & (high >= right[row] - _GAP)
        wider_right, wider_left = right.copy(), left.copy()
        np.minimum.at(wider_right, row[touch], low[touch])
        np.maximum.at(wider_left, row[touch], high[touch])
        if np.array_equal(wider_right, right) and np.array_equal(wider_left, left):
            break
        right, left = wider_right, wider_left
    known = left - right > 2.0 * half_width
    if known.any() and not known.all():  # before the first and after the last lanelet: as at its edge
        nearest = np.interp(np.arange(count), np.flatnonzero(known), np.flatnonzero(known))
        index = np.rint(nearest).astype(np.intp)
        right, left = right[index], left[index]
    return LateralBounds(
        frozen(found.s),
        frozen(np.minimum(right + half_width, 0.0)),
        frozen(np.maximum(left - half_width, 0.0)),
    )
