"""What the boxes of a problem stand for: the true shapes in the plane, as the checker sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repair.arrays import Array, frozen, wrap
from repair.scene.frame import FrenetFrame
from repair.scene.traffic.obstacle import Obstacle
from repair.timegrid import STEP
from repair.vehicle.parameters import Vehicle
from repair.world.road import RoadBoundary
from repair.world.tracks import INSTANT, MOVING, POLYGON, Track, tracks_of

__all__ = ["Shapes"]


@dataclass(frozen=True)
class Shapes:
    """The traffic as rectangles in the plane, the ego's body, and the room to keep between them.

    Attributes
    ----------
    frame : FrenetFrame
    obstacles : sequence of Obstacle
    vehicle : Vehicle
        The ego.
    dt : float
        Scenario time step [s].
    room : float
        By how much the ego's rectangle is enlarged on every side [m]: ``checker.clearance``.
    road : RoadBoundary or None
        What the ego's rectangle has to lie in; None where nobody asks.
    """

    frame: FrenetFrame
    obstacles: Sequence[Obstacle]
    vehicle: Vehicle
    dt: float
    room: float = 0.0
    road: RoadBoundary | None = None

    @cached_property
    def _tracks(self) -> tuple[Array, Array]:
        """Rectangles (M, T, 5) at the scenario's steps, and how each is there between them (M,)."""
        tracks = [t for o in self.obstacles for t in tracks_of(o, o.n_steps + 1, 1)]
        if not tracks:
            return np.empty((0, 1, 5)), np.empty(0)
        rows = [_boxed(track) if track.kind == POLYGON else track.rows for track in tracks]
        return frozen(np.array(rows)), np.array([track.mode for track in tracks])

    def at(self, times: Array) -> Array:
        """Rectangles ``x, y, heading, half length, half width`` (M, K, 5) at times (K,); NaN where absent.

        Circles count as the squares around them, polygons as the least rectangles around them. A set that
        holds between steps counts with those on both sides.
        """
        rows, mode = self._tracks
        if not len(mode):
            return np.empty((0, len(times), 5))
        place = times / self.dt
        nearest = np.rint(place)
        place = np.where(np.abs(place - nearest) < STEP, nearest, place)
        low, last = np.floor(place).astype(np.intp), rows.shape[1] - 1
        outside, weight = (place < 0) | (place > last), (place - low)[:, None]
        below, above = rows[:, np.clip(low, 0, last)], rows[:, np.clip(low + 1, 0, last)]
        between = weight[:, 0] > 0.0
        change = above - below
        change[..., 2] = wrap(change[..., 2])
        found = np.where(weight > 0.0, below + weight * change, below)
        held = (mode != MOVING) & (mode != INSTANT)
        found[held] = below[held]
        after = above[held]
        after[:, ~between] = np.nan
        found[np.ix_(mode == INSTANT, between)] = np.nan
        found = np.concatenate((found, after))
        found[:, outside] = np.nan
        return found


def _boxed(track: Track) -> Array:
    """The least rectangles (T, 5) around the polygons of a track."""
    import shapely

    rows = np.full_like(track.rows, np.nan)
    for k, step in enumerate(track.steps.tolist()):
        parts = track.polygons[step] if step < len(track.polygons) else ()
        if not parts or not np.isfinite(track.rows[k, :3]).all():
            continue
        x, y, heading = track.rows[k, :3]
        around = shapely.minimum_rotated_rectangle(shapely.multipoints(np.concatenate(parts)))
        if around.geom_type != "Polygon":
            rows[k] = track.rows[k]
            continue
        corners = np.asarray(around.exterior.coords)[:4]
        middle, side, other = corners.mean(axis=0), corners[1] - corners[0], corners[2] - corners[1]
        cos, sin = np.cos(heading), np.sin(heading)
        rows[k] = (
            x + cos * middle[0] - sin * middle[1],
            y + sin * middle[0] + cos * middle[1],
            heading + np.arctan2(side[1], side[0]),
            0.5 * float(np.hypot(*side)),
            0.5 * float(np.hypot(*other)),
        )
    return rows
