"""Obstacles as tracks of shapes over the samples; the ego's samples in blocks, and what lies between them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points, largest, wrap

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle

__all__ = [
    "AFTER",
    "BEFORE",
    "CIRCLE",
    "INSTANT",
    "MOVING",
    "POLYGON",
    "RECTANGLE",
    "Index",
    "Track",
    "all_tracks",
    "as_complex",
    "block_samples",
    "ego_room",
    "shape_rows",
    "tracks_of",
]

Index = npt.NDArray[np.intp]
"""Places in an array."""

RECTANGLE, CIRCLE, POLYGON = range(3)
#: Between the steps a track moves, or is held from the step before or after, or is there at the steps alone.
MOVING, BEFORE, AFTER, INSTANT = range(4)
_RIGID = 1e-3  # polygons whose corners keep their places this well [m] move as one body
# A straight line between two samples a time h apart is off by an eighth of h**2 times the acceleration, and
# that is at most twice what the second differences around the interval say.
_BULGE = 2.0 / 8.0

_Parts = tuple[Array, ...]


class Track(NamedTuple):
    """One way in which an obstacle is there.

    Attributes
    ----------
    kind, mode : int
        ``RECTANGLE``, ``CIRCLE`` or ``POLYGON``; ``MOVING``, ``BEFORE``, ``AFTER`` or ``INSTANT``.
    rows : (S, 5) array
        ``x, y, heading, half length, half width`` at the samples; circles, and the circumcircles of polygons,
        have their radius as both halves. NaN where it is not there.
    steps : (S,) int array
        Scenario step whose polygons hold at a sample.
    polygons : tuple
        For each step the convex parts, seen from the row's pose.
    """

    kind: int
    mode: int
    rows: Array
    steps: Index
    polygons: tuple[_Parts, ...] = ()


def all_tracks(obstacles: Sequence[Obstacle], n_samples: int, substeps: int) -> list[tuple[int, Track]]:
    """The tracks of all obstacles, each with its obstacle's index.

    Rectangles that move, which most are, are laid out all at once.
    """
    plain = [k for k, o in enumerate(obstacles) if _moves_as_a_rectangle(o)]
    moved: dict[int, Track] = {}
    if plain:
        before, after = _steps(n_samples, substeps)
        rows = np.array([obstacles[k].rectangles for k in plain])
        made = _interpolated(rows, before, after, substeps)
        moved = {k: Track(RECTANGLE, MOVING, row, before) for k, row in zip(plain, made, strict=True)}
    return [
        (k, track)
        for k, one in enumerate(obstacles)
        for track in ([moved[k]] if k in moved else tracks_of(one, n_samples, substeps))
    ]


def _moves_as_a_rectangle(obstacle: Obstacle) -> bool:
    return obstacle.rectangles is not None and obstacle.role != "set_based" and not obstacle.late


def _steps(n_samples: int, substeps: int) -> tuple[Index, Index]:
    """The steps at or before samples, and at or after them."""
    sample = np.arange(n_samples)
    return sample // substeps, -(-sample // substeps)


def tracks_of(obstacle: Obstacle, n_samples: int, substeps: int) -> list[Track]:
    """The tracks of an obstacle.

    A set holds from its step to the next and from the step before: what is stated there is their union.
    Polygons that do not move as one body are held likewise, with the hull of both for what lies between.
    """
    before, after = _steps(n_samples, substeps)
    kind, rows, polygons = shape_rows(obstacle)
    held = obstacle.role == "set_based"
    rigid = _as_one_body(obstacle, rows) if kind == POLYGON and not held else None
    made: list[Track] = []
    if rigid is not None:
        rows, polygons = rigid
    if held or (kind == POLYGON and rigid is None):
        made.append(Track(kind, BEFORE, rows[before], before, polygons))
        made.append(Track(kind, AFTER, rows[after], after, polygons))
        if not held:
            cover_rows, cover = _covers(obstacle)
            made.append(Track(kind, BEFORE, cover_rows[before], before, cover))
    else:
        made.append(Track(kind, MOVING, _interpolated(rows, before, after, substeps), before, polygons))
    if obstacle.late:
        late = before - obstacle.late
        place = np.clip(late, 0, len(rows) - 1)
        track = rows[place]
        track[(late < 0) | (late >= len(rows)) | (before != after)] = np.nan
        made.append(Track(kind, INSTANT, track, place, polygons))
    return made


def shape_rows(obstacle: Obstacle) -> tuple[int, Array, tuple[_Parts, ...]]:
    """What an obstacle is made of, and its size and place at the steps: kind, rows (T, 5), polygons."""
    if obstacle.rectangles is not None:
        return RECTANGLE, np.asarray(obstacle.rectangles), ()
    rows = np.full((obstacle.n_steps + 1, 5), np.nan)
    if obstacle.circles is not None:
        rows[:, :2] = obstacle.circles[:, :2]
        rows[:, 3] = rows[:, 4] = obstacle.circles[:, 2]
        rows[:, 2] = 0.0
        rows[np.isnan(rows[:, 0]), 2] = np.nan
        return CIRCLE, rows, ()
    return POLYGON, *_around(list(obstacle.polygons[: len(rows)]), len(rows))


def _around(parts: list[_Parts], count: int) -> tuple[Array, tuple[_Parts, ...]]:
    """Circumcircles of polygons as rows (T, 5), and the polygons seen from their middles."""
    rows, local = np.full((count, 5), np.nan), []
    for step, polygons in enumerate(parts):
        if not polygons:
            local.append(())
            continue
        points = np.concatenate(polygons)
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        radius = np.hypot(*(points - centre).T).max()
        rows[step] = (*centre, 0.0, radius, radius)
        local.append(tuple(polygon - centre for polygon in polygons))
    return rows, tuple(local)


def _as_one_body(obstacle: Obstacle, rows: Array) -> tuple[Array, tuple[_Parts, ...]] | None:
    """Rows by the states' poses, and the polygons seen from them; None if they do not move as one body."""
    there = np.flatnonzero(np.isfinite(rows[:, 0]))
    poses = obstacle.states[: len(rows), :3]
    if not len(there) or not np.isfinite(poses[there]).all():
        return None
    local: list[_Parts] = [()] * len(rows)
    for step in there.tolist():
        x, y, heading = poses[step]
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        local[step] = tuple((polygon - (x, y)) @ turn for polygon in obstacle.polygons[step])
    first = local[there[0]]
    for step in there[1:].tolist():
        same = len(local[step]) == len(first) and all(
            a.shape == b.shape and np.abs(a - b).max() <= _RIGID
            for a, b in zip(local[step], first, strict=True)
        )
        if not same:
            return None
    made = np.full_like(rows, np.nan)
    made[there, :3] = poses[there]
    made[there, 3:] = max(float(np.hypot(*part.T).max()) for step in there.tolist() for part in local[step])
    return made, tuple(local)


def _covers(obstacle: Obstacle) -> tuple[Array, tuple[_Parts, ...]]:
    """For each step the hull of the polygons then and at the next one."""
    import shapely

    parts = list(obstacle.polygons[: obstacle.n_steps + 1])
    hulls: list[_Parts] = []
    for here, following in zip(parts, [*parts[1:], ()], strict=True):
        if not here or not following:
            hulls.append(())
            continue
        hull = shapely.convex_hull(shapely.multipoints(np.concatenate([*here, *following])))
        hulls.append((np.asarray(hull.exterior.coords)[:-1],) if hull.geom_type == "Polygon" else ())
    return _around(hulls, len(parts))


def _interpolated(rows: Array, before: Index, after: Index, substeps: int) -> Array:
    """Rows (..., T, 5) at samples (..., S, 5); NaN between a step and one where the obstacle is absent."""
    weight = (np.arange(len(before)) % substeps / substeps)[:, None]
    left = rows.take(before, axis=-2)
    if substeps == 1:
        return left
    change = rows.take(after, axis=-2)
    change -= left
    change[..., 2] = wrap(change[..., 2])
    change *= weight
    change += left
    change[..., ::substeps, :] = left[..., ::substeps, :]  # a step counts alone: the next one may be NaN
    return change


@lru_cache(maxsize=256)
def block_samples(start: int, stop: int, size: int, tracks: int) -> tuple[Index, Index, Index]:
    """Blocks of ``size`` samples that meet [start, stop).

    Returns
    -------
    middle : (n, 1) array
        The sample in the middle of each, counted from ``start`` on.
    samples : (n, size) array
        All of them, counted likewise; the first and the last of [start, stop) stand for those outside.
    rows : (n, size) array
        Where the samples' rows begin, of ``tracks`` shapes each.
    """
    samples = np.arange(start // size * size, -(-stop // size) * size).reshape(-1, size) - start
    samples = np.minimum(np.maximum(samples, 0), max(stop - start - 1, 0))
    made = samples[:, size // 2, None].copy(), samples, (samples + start) * tracks
    for indices in made:
        indices.setflags(write=False)
    return made


def ego_room(here: Points, orientation: Array, radius: float) -> tuple[Array, Array]:
    """What the ego's motion between its samples may add.

    Returns
    -------
    spare : (K,) array
        By how much it may be off the straight way to the next sample [m], turning included; the last is 0.
    reach : (K,) array
        How far any of its points moves until the sample before or after [m].
    """
    count = len(here)
    spare, reach = np.zeros((2, count))
    if count > 1:
        steps, turns = here[1:] - here[:-1], orientation[1:] - orientation[:-1]
        size = np.abs(turns)
        if not largest(size) < np.pi:
            turns = wrap(turns)
            size = np.abs(turns)
        ways = np.abs(steps) + radius * size
        if count > 2:
            bend = np.abs(steps[1:] - steps[:-1]) + radius * np.abs(turns[1:] - turns[:-1])
            bend *= _BULGE
            spare[0], spare[1:-1] = bend[0], bend
            np.maximum(spare[1:-2], bend[1:], out=spare[1:-2])
            ways += spare[:-1]
        reach[:-1] = ways
        np.maximum(reach[1:], ways, out=reach[1:])
    return spare, reach


def as_complex(x: Array, y: Array) -> Points:
    """Points (or directions) of the plane as x + iy."""
    made = np.empty(x.shape, dtype=np.complex128)
    made.real = x
    made.imag = y
    return made
