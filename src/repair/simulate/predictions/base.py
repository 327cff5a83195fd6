"""What a prediction is given, what it answers, and obstacles moved as rigid bodies."""

from __future__ import annotations

import math
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
    given the past alone. One with ``at_the_speed_of_now = True`` takes nobody farther from where he is than
    his speed of now does, so that who is far away is not asked about. One with ``to_the_end = True`` is asked
    until the record's end where ``simulate.lookahead`` does not say how far.
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
    return np.array([x, y]), _number(heading), _number(speed)


def _number(value: float) -> float:
    """As ``np.nan_to_num``, of one number."""
    return value if math.isfinite(value) else float(np.nan_to_num(value))


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
    cos, sin, turns = np.cos(turned)[:, None], np.sin(turned)[:, None], bool(turned.any())

    def placed(points: Any) -> Array:
        """Points (V, 2) at all times (T, V, 2)."""
        local = np.asarray(points) - pivot
        if not turns:
            return np.asarray(local + centres[:, None])
        (x, y), at = local.T, np.empty((len(turned), len(local), 2))
        at[..., 0], at[..., 1] = cos * x - sin * y, sin * x + cos * y
        at += centres[:, None]
        return at

    rectangles = circles = None
    if past.rectangles is not None:
        rectangles = np.empty((len(turned), 5))
        rectangles[:, :2] = placed(past.rectangles[-1:, :2])[:, 0]
        rectangles[:, 2] = past.rectangles[-1, 2] + turned
        rectangles[:, 3:] = past.rectangles[-1, 3:]
    if past.circles is not None:
        circles = np.empty((len(turned), 3))
        circles[:, :2] = placed(past.circles[-1:, :2])[:, 0]
        circles[:, 2] = past.circles[-1, 2]
    polygons: tuple[tuple[Array, ...], ...] = ()
    if past.polygons:
        parts = [placed(part) for part in past.polygons[-1]]
        polygons = tuple(tuple(frozen(part[k]) for part in parts) for k in range(len(turned)))
    states = np.empty((len(turned), 4))
    states[:, :2], states[:, 2] = centres, _number(past.states.item(-1, 2)) + turned
    steps = np.hypot(*(centres[1:] - centres[:-1]).T) / dt
    states[:-1, 3], states[-1, 3] = steps, steps[-1] if len(steps) else 0.0
    made = placed(past.vertices[-1])
    for table in (made, rectangles, circles, states):
        if table is not None:
            table.setflags(write=False)
    return replace(
        past, role="dynamic", late=0, vertices=made, rectangles=rectangles, circles=circles,
        polygons=polygons, states=states,
    )  # fmt: skip
