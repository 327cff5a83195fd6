"""Whether an answer hangs on a prediction's end: what moved on at constant velocity would be met."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repair.scene.traffic.rows import continued_from
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
    count = min(len(states.x), scene.n_steps + 1)  # what is driven may go on beyond the scene's horizon
    last_step = count - 1
    ends = [_last(obstacle) for obstacle in scene.obstacles]
    moved = [
        _moved_on(obstacle, last, scene.dt)
        for obstacle, last in zip(scene.obstacles, ends, strict=True)
        if last is not None and last < last_step
    ]
    if not moved:
        return None
    world = CollisionWorld(moved, scene.vehicle, scene.dt, scene.n_steps, 1)
    contact = world.contact_along(
        (states.x + 1j * states.y)[:count], states.orientation[:count], margin=margin
    )
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
    made = continued_from(obstacle, last, obstacle.n_steps, "constant_velocity", dt, alone=True)
    return replace(made, late=0)
