"""What a prediction is given, what it answers, and obstacles moved as rigid bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from repair.arrays import Array, frozen
from repair.scene.road.lanes import Lane
from repair.scene.traffic.obstacle import Obstacle

__all__ = ["Known", "Predictor", "cut", "motion_of", "moved"]


@dataclass(frozen=True, eq=False)
class Known:
    """One obstacle at a cycle.

    Attributes
    ----------
    past : Obstacle
        Its rows until now; the last one is now.
    record : Obstacle
        All of its rows, row ``now`` is now, where the predictor says that it ``looks_ahead``; else ``past``.
    now : int
        [steps].
    dt : float
        [s].
    n_steps : int
        How far to predict [steps].
    lanes : mapping
        The lanelets, by id.
    """

    past: Obstacle
    record: Obstacle
    now: int
    dt: float
    n_steps: int
    lanes: Mapping[int, Lane]

    @property
    def times(self) -> Array:
        """From now on (n_steps + 1,) [s]."""
        return np.arange(self.n_steps + 1) * self.dt


class Predictor(Protocol):
    """As commonroad-prediction has it, ``predict(scenario, initial_time_step)``, on arrays and one by one.

    A class with ``looks_ahead = True`` is given the whole record, those to come included. All others are
    given the past alone. One with ``to_the_end = True`` is asked until the record's end where
    ``simulate.lookahead`` does not say how far.
    """

    def predict(self, known: Known) -> Obstacle | None:
        """The obstacle over ``n_steps + 1`` rows from now on; None where it is not believed to be there."""
        ...


def cut(obstacle: Obstacle, first: int, last: int) -> Obstacle:
    """Rows ``first`` to ``last``, both included."""
    rows = slice(first, last + 1)
    return replace(
        obstacle,
        vertices=obstacle.vertices[rows],
        rectangles=None if obstacle.rectangles is None else obstacle.rectangles[rows],
        circles=None if obstacle.circles is None else obstacle.circles[rows],
        polygons=obstacle.polygons[rows],
        states=obstacle.states[rows],
    )


def motion_of(past: Obstacle, dt: float) -> tuple[Array, float, float]:
    """Centre (2,) [m], heading [rad] and speed [m/s] now; what the states leave open is the last step."""
    x, y, heading, speed = past.states[-1].tolist()
    if len(past.states) > 1 and not (np.isfinite(heading) and np.isfinite(speed)):
        step = past.states[-1, :2] - past.states[-2, :2]
        if np.isfinite(step).all():
            along = float(np.arctan2(step[1], step[0]))
            heading = heading if np.isfinite(heading) else along
            speed = float(step @ (np.cos(heading), np.sin(heading))) / dt
    return np.array([x, y]), float(np.nan_to_num(heading)), float(np.nan_to_num(speed))


def moved(past: Obstacle, centres: Array, turned: Array, dt: float) -> Obstacle:
    """The obstacle as it is now, moved as a rigid body.

    Parameters
    ----------
    past : Obstacle
        Its last row is now.
    centres : (T, 2) array
        Where its centre goes [m]; the first one is where it is.
    turned : (T,) array
        By how much it has turned since now [rad].
    dt : float
        [s].
    """
    pivot = past.states[-1, :2]
    cos, sin = np.cos(turned), np.sin(turned)
    turns = bool(turned.any())

    def placed(points: Any) -> Array:
        """Points (V, 2) at all times (T, V, 2)."""
        local = np.asarray(points) - pivot
        if not turns:
            return np.asarray(local + centres[:, None])
        x, y = local.T
        at = np.stack([cos[:, None] * x - sin[:, None] * y, sin[:, None] * x + cos[:, None] * y], axis=-1)
        return np.asarray(at + centres[:, None])

    rectangles = circles = None
    if past.rectangles is not None:
        x, y, heading, length, width = past.rectangles[-1]
        rectangles = np.column_stack([
            placed([[x, y]])[:, 0], heading + turned, np.tile([length, width], (len(turned), 1))
        ])  # fmt: skip
    if past.circles is not None:
        x, y, radius = past.circles[-1]
        circles = np.column_stack([placed([[x, y]])[:, 0], np.full(len(turned), radius)])
    polygons: tuple[tuple[Array, ...], ...] = ()
    if past.polygons:
        parts = [placed(part) for part in past.polygons[-1]]
        polygons = tuple(tuple(frozen(part[k]) for part in parts) for k in range(len(turned)))
    steps = np.hypot(*np.diff(centres, axis=0).T) / dt if len(centres) > 1 else np.zeros(0)
    speed = np.append(steps, steps[-1:] if len(steps) else 0.0)
    states = np.column_stack([centres, np.nan_to_num(past.states[-1, 2]) + turned, speed])
    return replace(
        past, role="dynamic", late=0, vertices=frozen(placed(past.vertices[-1])),
        rectangles=None if rectangles is None else frozen(rectangles),
        circles=None if circles is None else frozen(circles), polygons=polygons, states=frozen(states),
    )  # fmt: skip
