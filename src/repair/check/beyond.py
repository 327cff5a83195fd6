"""Whether an answer hangs on a prediction's end: what moved on at constant velocity would be met."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repair.arrays import Array, frozen
from repair.world.collision import CollisionWorld

if TYPE_CHECKING:
    from repair.scene.scene import Scene
    from repair.scene.traffic.obstacle import Obstacle
    from repair.vehicle.states import DrivenStates

__all__ = ["Beyond", "met_beyond"]


class Beyond(NamedTuple):
    """What would be met: the obstacle, when its prediction ends, and when the margin is entered [s]."""

    obstacle_id: int
    end: float
    time: float


def met_beyond(scene: Scene, states: DrivenStates, margin: float) -> Beyond | None:
    """The first obstacle that is met after its prediction has ended, if it keeps its last velocity.

    Parameters
    ----------
    scene : Scene
    states : DrivenStates
        What is driven, at the scenario's steps from 0 on.
    margin : float
        By how much the ego is enlarged on every side [m].
    """
    last_step = len(states.x) - 1
    ends = [_last(obstacle) for obstacle in scene.obstacles]
    moved = [
        _moved_on(obstacle, last, scene.dt)
        for obstacle, last in zip(scene.obstacles, ends, strict=True)
        if last is not None and last < last_step
    ]
    if not moved:
        return None
    world = CollisionWorld(moved, scene.vehicle, scene.dt, scene.n_steps, 1)
    contact = world.contact_along(states.x + 1j * states.y, states.orientation, margin=margin)
    if contact is None:
        return None
    end = min(
        last
        for obstacle, last in zip(scene.obstacles, ends, strict=True)
        if last is not None and last < last_step and obstacle.id == contact.obstacle_id
    )
    return Beyond(contact.obstacle_id, end * scene.dt, contact.time)


def _last(obstacle: Obstacle) -> int | None:
    """The last step at which an obstacle is there; None where it is there to the end, or never."""
    there = np.flatnonzero(np.isfinite(obstacle.states[:, :2]).all(axis=1))
    return int(there[-1]) if len(there) and there[-1] < obstacle.n_steps else None


def _moved_on(obstacle: Obstacle, last: int, dt: float) -> Obstacle:
    """The obstacle from the end of its prediction on alone, moved on as it moved last."""
    heading, speed = obstacle.states[last, 2:]
    shift = np.zeros(2)
    if np.isfinite(heading) and np.isfinite(speed):
        shift = speed * dt * np.array([np.cos(heading), np.sin(heading)])
    elif last > 0 and np.isfinite(obstacle.states[last - 1, :2]).all():
        shift = obstacle.states[last, :2] - obstacle.states[last - 1, :2]
    ahead = (np.arange(obstacle.n_steps + 1) - last)[:, None] * shift

    def rows(known: Array) -> Array:
        made = np.repeat(known[last : last + 1], len(known), axis=0)
        made[:, :2] += ahead
        made[:last] = np.nan
        return frozen(made)

    shapes = obstacle.polygons[last] if obstacle.polygons else ()
    return replace(
        obstacle,
        rectangles=None if obstacle.rectangles is None else rows(obstacle.rectangles),
        circles=None if obstacle.circles is None else rows(obstacle.circles),
        polygons=tuple(
            () if k < last else tuple(part + way for part in shapes) for k, way in enumerate(ahead)
        )
        if obstacle.polygons
        else (),
        states=rows(obstacle.states),
        late=0,
    )
