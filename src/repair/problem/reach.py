"""Where the ego may be: how far along its path, and how far aside of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.problem.limits import Limits
from repair.problem.settings import RepairConfig
from repair.scene.road.bounds import LateralBounds
from repair.world.occupancy import Within

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["part_in_reach", "room_of"]

# What counts as out of reach is farther away along the path, and beside it, than the ego may be by this [m].
_SLACK, _BESIDE = 5.0, 1.0


def room_of(scene: Scene, settings: RepairConfig) -> LateralBounds:
    """Lateral room of the reference point in a scene, as ``repair.lateral`` says."""
    wide = {"lane": scene.lane, "same_direction": scene.same_direction, "road": scene.road}
    return wide.get(settings.lateral, scene.lane)


def part_in_reach(
    scene: Scene, settings: RepairConfig, limits: Limits, positions: Array, until: float = np.inf,
    coordinates: Array | None = None,
) -> Within:  # fmt: skip
    """The part of the road where the ego may be until its reference ends.

    Parameters
    ----------
    positions : (K, 2) array
        The reference at the scenario's steps [m].
    until : float
        Later than this nobody asks where it is [s].
    coordinates : (K, 2) array, optional
        The same in the scene's frame [m], where that is known.
    """
    positions = positions[: int(min(until / scene.dt + 2.0, len(positions)))]
    (s, aside), (speed, _) = scene.start[:2].tolist()
    last_one = slice(len(positions) - 1, len(positions))
    end = scene.frame.to_frenet(positions[last_one]) if coordinates is None else coordinates[last_one]
    # Until the end of each step; the last of them ends where the reference does.
    t = scene.dt * np.minimum(np.arange(1, len(positions) + 1), len(positions) - 1)
    ways = np.minimum(max(speed, 0.0) + 0.5 * limits.a_max * t, max(limits.v_max, speed)) * t
    followed = np.hypot(*(positions - positions[0]).T)
    ways = np.fmax(ways, np.maximum.accumulate(np.append(followed[1:], followed[-1])))
    first, last = s - _SLACK, float(np.fmax(s + ways[-1], end[0, 0])) + _SLACK
    bound = room_of(scene, settings)
    part = slice(*np.searchsorted(bound.s, (first - _SLACK, last + _SLACK)))
    room = max(float(np.abs(side[part]).max(initial=0.0)) for side in (bound.right, bound.left))
    more = settings.margin + settings.clearance + max(settings.widen, default=0.0)
    return Within(s, first, last, room + more + abs(aside) + _BESIDE, ways + _SLACK)
