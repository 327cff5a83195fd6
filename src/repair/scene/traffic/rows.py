"""Placed occupancies as the arrays of an obstacle."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from repair.arrays import Array, frozen
from repair.errors import ScenarioError
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.shapes import FAR, Placed, polygons_of, subdivided

__all__ = [
    "continued_from",
    "obstacle_of_rows",
    "outline_of",
    "repeated",
    "require_sane",
    "require_sane_poses",
    "rigid_outline",
]

_LARGEST = 1e4  # half size of an obstacle beyond which it is an error in the file [m]


def outline_of(half_length: float, half_width: float) -> Array:
    """Outline (V, 2) of a rectangle, seen from its middle."""
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    return subdivided(corners * (half_length, half_width))


def rigid_outline(rectangles: Array) -> Array | None:
    """Outlines of one rectangle on its way, all at once; None where its size changes."""
    half = rectangles[np.isfinite(rectangles[:, 0]), 3:]
    if np.ptp(half, axis=0).any():
        return None
    local = outline_of(*half[0])
    c, s = np.cos(rectangles[:, 2, None]), np.sin(rectangles[:, 2, None])
    x = c * local[:, 0] - s * local[:, 1] + rectangles[:, 0, None]
    y = s * local[:, 0] + c * local[:, 1] + rectangles[:, 1, None]
    return np.stack([x, y], axis=-1)


def _outline_rows(rows: Sequence[Placed | None]) -> Array:
    """Outlines of whatever shape, padded with their last point to the same length."""
    shells = [np.concatenate([subdivided(p) for p in polygons_of(row)]) if row else None for row in rows]
    vertices = np.full((len(rows), max(len(o) for o in shells if o is not None), 2), np.nan)
    for k, outline in enumerate(shells):
        if outline is not None:
            vertices[k, : len(outline)] = outline
            vertices[k, len(outline) :] = outline[-1]
    return vertices


def obstacle_of_rows(
    name: int, kind: str, role: str, rows: Sequence[Placed | None], static_rows: int = 0
) -> Obstacle:
    """Stack placed occupancies into an obstacle.

    Parameters
    ----------
    name, kind, role
        Id, type and role of the obstacle.
    rows : sequence of Placed or None
        One per step; None where it is absent, but not everywhere.
    static_rows : int
        So often a single row is repeated, without copying it; 0 for what moves.
    """
    present = [row for row in rows if row is not None]
    rectangles = circles = None
    polygons: tuple[tuple[Array, ...], ...] = ()
    if all(row.rectangle for row in present):
        rectangles = np.array([row.rectangle if row else (np.nan,) * 5 for row in rows], dtype=np.float64)
    elif all(row.circle for row in present):
        circles = np.array([row.circle if row else (np.nan,) * 3 for row in rows], dtype=np.float64)
    else:
        polygons = tuple(tuple(frozen(p) for p in polygons_of(row)) if row else () for row in rows)
    vertices = rigid_outline(rectangles) if rectangles is not None else None
    if vertices is None:
        vertices = _outline_rows(rows)
    states = np.array([row.state if row else (np.nan,) * 4 for row in rows], dtype=np.float64)
    made = Obstacle(
        name, kind, role, frozen(vertices), None if rectangles is None else frozen(rectangles),
        None if circles is None else frozen(circles), polygons, frozen(states),
    )  # fmt: skip
    return repeated(made, static_rows) if static_rows else made


def repeated(obstacle: Obstacle, count: int) -> Obstacle:
    """The obstacle with its first row ``count`` times; the rows share one memory."""

    def wide(array: Array) -> Array:
        return np.broadcast_to(array[0], (count, *array.shape[1:]))

    return replace(
        obstacle,
        vertices=wide(obstacle.vertices),
        rectangles=None if obstacle.rectangles is None else wide(obstacle.rectangles),
        circles=None if obstacle.circles is None else wide(obstacle.circles),
        polygons=obstacle.polygons * count,
        states=wide(obstacle.states),
    )


def continued_from(
    obstacle: Obstacle, last: int, n_steps: int, how: str, dt: float, *, alone: bool = False
) -> Obstacle:
    """The obstacle with ``n_steps + 1`` rows, after row ``last`` as ``how`` says.

    Parameters
    ----------
    obstacle : Obstacle
    last : int
        The last row that is known.
    n_steps : int
    how : str
        ``remove``, ``hold`` or ``constant_velocity``: at its last velocity, which without one is its last
        step.
    dt : float
        Time step [s].
    alone : bool
        Leave out what comes before ``last``.
    """
    shift = np.zeros(2)
    if how == "constant_velocity":
        heading, speed = obstacle.states[last, 2:]
        if np.isfinite(heading) and np.isfinite(speed):
            shift = speed * dt * np.array([np.cos(heading), np.sin(heading)])
        elif last > 0 and np.isfinite(obstacle.states[last - 1, :2]).all():
            shift = obstacle.states[last, :2] - obstacle.states[last - 1, :2]
    ahead = (np.arange(last + 1, n_steps + 1) - last)[:, None] * shift

    def rows(known: Array) -> Array:
        made = np.empty((n_steps + 1, *known.shape[1:]))
        made[: last + 1] = known[: last + 1]
        if alone:
            made[:last] = np.nan
        made[last + 1 :] = np.nan if how == "remove" else known[last]
        if how != "remove" and ahead.any():
            made[last + 1 :, ..., :2] += ahead.reshape(-1, *(1,) * (known.ndim - 2), 2)
        return frozen(made)

    shapes = obstacle.polygons[last] if obstacle.polygons else ()
    before = ((),) * last if alone else obstacle.polygons[:last]
    more = tuple(() if how == "remove" else tuple(part + way for part in shapes) for way in ahead)
    return replace(
        obstacle,
        vertices=rows(obstacle.vertices),
        rectangles=None if obstacle.rectangles is None else rows(obstacle.rectangles),
        circles=None if obstacle.circles is None else rows(obstacle.circles),
        polygons=(*before, shapes, *more) if obstacle.polygons else (),
        states=rows(obstacle.states),
    )


def require_sane(placed: Iterable[Placed]) -> None:
    """Refuse occupancies that no obstacle can have.

    Raises
    ------
    ScenarioError
        If a number is not finite, or a size or place is beyond all reason; the obstacle is not named.
    """
    for item in placed:
        places = [np.asarray(item.state[:2]), *(item.polygons or ())]
        places += [np.asarray(shape[:2]) for shape in (item.rectangle, item.circle) if shape]
        sizes = [*(item.rectangle or ())[3:], *(item.circle or ())[2:]]
        sizes += [float(np.max(np.ptp(p, axis=0))) / 2.0 for p in item.polygons or ()]
        angle = item.rectangle[2] if item.rectangle else 0.0
        if not (np.isfinite([*sizes, angle]).all() and all(np.isfinite(p).all() for p in places)):
            raise ScenarioError("a state or shape of it is not finite")
        if not 0.0 < min(sizes) <= max(sizes) <= _LARGEST:
            raise ScenarioError(f"its size is {2.0 * min(sizes):g} to {2.0 * max(sizes):g} m")
        if max(float(np.max(np.abs(p))) for p in places) > FAR:
            raise ScenarioError(f"it is farther than {FAR:g} m out")


def require_sane_poses(
    names: Sequence[int], tables: Sequence[Array], sizes: Sequence[tuple[float, float]]
) -> None:
    """The same of many rectangles on their way, all at once.

    Parameters
    ----------
    names : sequence of int
        Ids, for the sentence.
    tables : sequence of (T, 3) array
        Poses; NaN where one is not there.
    sizes : sequence of (length, width)
        [m].

    Raises
    ------
    ScenarioError
        The sentence names the first obstacle.
    """
    if not names:
        return
    far = np.nanmax(np.abs(np.concatenate(tables)[:, :2])) > FAR
    if far or np.max(sizes) > 2.0 * _LARGEST:
        for name, table, (length, width) in zip(names, tables, sizes, strict=True):
            known = table[np.isfinite(table[:, 0])]
            try:
                require_sane(
                    Placed((*pose, 0.5 * length, 0.5 * width), None, None, (*pose, 0.0))
                    for pose in known.tolist()
                )
            except ScenarioError as error:
                raise ScenarioError(f"obstacle {name}: {error}") from error
