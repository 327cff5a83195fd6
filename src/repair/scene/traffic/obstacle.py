"""One obstacle over time."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from repair.arrays import Array

__all__ = ["Obstacle", "Traffic", "later"]


@dataclass(frozen=True)
class Obstacle:
    """Where one obstacle is, for every step k = 0 .. T-1 after the planning problem's start.

    Rows of steps at which it is absent are NaN throughout (``polygons``: an empty tuple).

    Attributes
    ----------
    id : int
        CommonRoad id (not unique: some files give a static and a dynamic obstacle the same).
    kind : str
        CommonRoad obstacle type, such as ``car``.
    role : str
        ``static``, ``dynamic``, ``set_based``, ``phantom`` or ``environment``.
    vertices : (T, V, 2) array
        Outline points [m] for projection: no two neighbours more than 2 m apart, circles
        circumscribed. A row repeats its last point to fill V.
    rectangles : (T, 5) array or None
        ``x, y, heading, half length, half width`` where every occupancy is one rectangle.
    circles : (T, 3) array or None
        ``x, y, radius`` where every occupancy is one circle.
    polygons : tuple of tuple of (m, 2) arrays
        Convex polygons (not closed) whose union is the occupancy, per step, where it is neither of
        the above; otherwise empty.
    states : (T, 4) array
        ``x, y, heading, speed``; for an occupancy without a state its centre and NaN.
    late : int
        By how many steps the drivability checker is late for it (:mod:`repair.scene.traffic.late`).
    source
        The CommonRoad obstacle that it was made from; None where there is none.
    """

    id: int
    kind: str
    role: str
    vertices: Array
    rectangles: Array | None
    circles: Array | None
    polygons: tuple[tuple[Array, ...], ...]
    states: Array
    late: int = 0
    source: Any = field(default=None, repr=False, compare=False)

    @property
    def n_steps(self) -> int:
        """Index of the last step; ``vertices`` has one row more."""
        return len(self.vertices) - 1


@dataclass(frozen=True, eq=False)
class Traffic:
    """Everybody else, from now on.

    Attributes
    ----------
    obstacles : tuple of Obstacle
        Of ``n_steps + 1`` rows each.
    n_steps : int
        Until when something is known [steps].
    """

    obstacles: tuple[Obstacle, ...]
    n_steps: int


def later(obstacle: Obstacle, step: int) -> Obstacle | None:
    """The obstacle with time beginning at a later step; None where it is not there any more."""
    if step == 0:
        return obstacle
    if step > obstacle.n_steps or not np.isfinite(obstacle.vertices[step:]).any():
        return None
    return replace(
        obstacle,
        vertices=obstacle.vertices[step:],
        rectangles=None if obstacle.rectangles is None else obstacle.rectangles[step:],
        circles=None if obstacle.circles is None else obstacle.circles[step:],
        polygons=obstacle.polygons[step:],
        states=obstacle.states[step:],
    )
