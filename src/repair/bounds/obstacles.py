"""What is occupied at instants, as convex polygons: the traffic in its continuous motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repair.arrays import Array
from repair.scene.traffic.shapes import off_centre
from repair.world.tracks import BEFORE, INSTANT, MOVING, POLYGON, RECTANGLE, Index, Track, tracks_of

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["NO_ROAD", "Occupied", "occupied", "with_standing"]

#: The owner of a piece of what is no road.
NO_ROAD = -1

_AROUND = np.exp(2j * np.pi * np.arange(16) / 16).view(np.float64).reshape(-1, 2)
_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
_INWARDS = 1e-5  # by how much of their size polygons are smaller than what they stand for


class Occupied(NamedTuple):
    """Convex polygons at instants.

    Attributes
    ----------
    vertices : (I, M, K, 2) array
        Anticlockwise [m]; the last is repeated to fill K, NaN where there is nothing.
    owner : (M,) int array
        Index of the obstacle; ``NO_ROAD`` for what is none.
    """

    vertices: Array
    owner: Index


def occupied(obstacles: Sequence[Obstacle], n_samples: int, substeps: int) -> Occupied:
    """Where the obstacles are at samples, ``substeps`` to a scenario's step.

    Rectangles, circles and rigid polygons move and turn linearly in time between the steps, sets hold on
    both sides of theirs: as :class:`repair.world.collision.CollisionWorld` has it. Polygons that do not
    move as one body count at the steps alone, and who is there in two readings counts in none.
    """
    columns: list[Array | None] = []  # None of a rectangle: all of them are laid out at once
    rectangles: list[Array] = []
    owner: list[int] = []
    for index, obstacle in enumerate(obstacles):
        if not _one_reading(obstacle):
            continue
        held = obstacle.role == "set_based"
        tracks = [t for t in tracks_of(obstacle, n_samples, substeps) if t.mode != INSTANT]
        if not held and tracks[0].mode != MOVING:
            tracks = tracks[:1]
        for track in tracks:
            if track.kind == RECTANGLE:
                rectangles.append(track.rows)
                columns.append(None)
                owner.append(index)
                continue
            steps_alone = not held and track.mode == BEFORE
            for part in _parts(track, n_samples, substeps if steps_alone else 1):
                inside = part.mean(axis=1, keepdims=True)
                columns.append(inside + (part - inside) * (1.0 - _INWARDS))
                owner.append(index)
    size = max((4 if part is None else part.shape[1] for part in columns), default=3)
    vertices = np.full((n_samples, len(columns), size, 2), np.nan)
    if rectangles:
        drawn = [m for m, part in enumerate(columns) if part is None]
        corners = _corners(np.array(rectangles))
        vertices[:, drawn, :4], vertices[:, drawn, 4:] = corners, corners[:, :, -1:]
    for m, shape in enumerate(columns):
        if shape is not None:
            vertices[:, m, : shape.shape[1]] = shape
            vertices[:, m, shape.shape[1] :] = shape[:, -1:]
    return Occupied(vertices, np.array(owner, dtype=np.intp))


def with_standing(traffic: Occupied, pieces: Sequence[Array]) -> Occupied:
    """The traffic, and convex pieces (K, 2) of what is no road, which stand."""
    if not pieces:
        return traffic
    size = max(traffic.vertices.shape[2], *(len(piece) for piece in pieces))
    count = len(traffic.owner)
    vertices = np.empty((len(traffic.vertices), count + len(pieces), size, 2))
    vertices[:, :count, : traffic.vertices.shape[2]] = traffic.vertices
    vertices[:, :count, traffic.vertices.shape[2] :] = traffic.vertices[:, :, -1:]
    for m, piece in enumerate(pieces, count):
        vertices[:, m, : len(piece)], vertices[:, m, len(piece) :] = piece, piece[-1]
    owner = np.concatenate((traffic.owner, np.full(len(pieces), NO_ROAD, dtype=np.intp)))
    return Occupied(vertices, owner)


def _one_reading(obstacle: Obstacle) -> bool:
    """Whether there is one reading of where it is.

    Bodies that are not centred on their position are in the scene twice, so that who keeps clear of both is
    right either way; who meets one of both has met nothing for certain.
    """
    shapes = (
        getattr(obstacle.source, "obstacle_shape", None),
        getattr(getattr(obstacle.source, "prediction", None), "shape", None),
    )
    return not any(shape is not None and off_centre(shape) for shape in shapes)


def _corners(rows: Array) -> Array:
    """Corners (I, M, 4, 2) of rectangles (M, I, 5), which are a little smaller."""
    x, y, heading, a, b = rows.transpose(2, 1, 0)[..., None]
    u, w = _CORNERS[:, 0] * (1.0 - _INWARDS) * a, _CORNERS[:, 1] * (1.0 - _INWARDS) * b
    c, s = np.cos(heading), np.sin(heading)
    return np.stack((x + c * u - s * w, y + s * u + c * w), axis=-1)


def _parts(track: Track, n_samples: int, every: int) -> list[Array]:
    """Each convex part of a track of circles or polygons over samples (I, K, 2); NaN where there is none."""
    if track.kind != POLYGON:
        x, y, _, radius, _ = track.rows.T
        return [np.stack((x, y), axis=1)[:, None] + _AROUND * radius[:, None, None]]
    count = max((len(p) for p in track.polygons), default=0)
    size = max((len(v) for p in track.polygons for v in p), default=3)
    made = [np.full((n_samples, size, 2), np.nan) for _ in range(count)]
    for i in range(0, n_samples, every):
        x, y, heading = track.rows[i, :3]
        if not np.isfinite(x):
            continue
        c, s = np.cos(heading), np.sin(heading)
        for part, shape in zip(made, track.polygons[track.steps[i]], strict=False):
            placed = shape @ np.array([[c, s], [-s, c]]) + (x, y)
            placed = placed if _area(placed) > 0.0 else placed[::-1]
            part[i, : len(placed)], part[i, len(placed) :] = placed, placed[-1]
    return made


def _area(p: Array) -> float:
    q = np.roll(p, -1, axis=0)
    return float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]))
