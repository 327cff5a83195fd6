"""A planner's cycles on a scenario's road: a new plan and new predictions each time, from a seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.scene.scene import Scene

EPISODE = 20  # cycles of a drive; the next one begins at the start again
_PLANNED, _PREDICTED = 5.0, 6.0  # how far the plan and the predictions look ahead [s]
_SPREAD = 0.05  # predictions are off by so much for each second ahead [m]


@dataclass(frozen=True)
class Cycle:
    """What a planner hands over.

    Attributes
    ----------
    now : float
        [s] since the start of the drive; 0 where a new one begins.
    plan : (K, 5) array
        ``t, x, y, yaw, v``.
    traffic : list of tuple
        Id, kind, length, width and poses (T, 3) of each obstacle.
    """

    now: float
    plan: Array
    traffic: list[tuple[int, str, float, float, Array]]

    @property
    def ego(self) -> dict[str, float]:
        """Where the plan begins."""
        return {k: float(v) for k, v in zip(("x", "y", "yaw", "v"), self.plan[0, 1:], strict=True)}


def cycles(scene: Scene, seed: int = 0, episode: int = EPISODE) -> Iterator[Cycle]:
    """Drives without end: the planner speeds up along the scene's path, differently each cycle.

    The obstacles go where the recording has them; what is predicted is off by a drift that is drawn anew for
    each obstacle and cycle.
    """
    random, dt, frame = np.random.default_rng(seed), scene.dt, scene.frame
    t, ahead = (np.arange(0.0, until + 1e-9, dt) for until in (_PLANNED, _PREDICTED))
    there = [o for o in scene.obstacles if o.rectangles is not None]
    while True:
        s, v = float(scene.start[0, 0]), float(scene.start[1, 0])
        for k in range(episode):
            faster, most = random.uniform(0.4, 0.6), max(random.uniform(12.0, 14.0), v)
            u = np.minimum(v + faster * t, most)
            way = s + np.concatenate([[0.0], np.cumsum(0.5 * dt * (u[1:] + u[:-1]))])
            place = frame.to_cartesian(way, np.zeros(len(way)))
            traffic: list[tuple[int, str, float, float, Array]] = []
            for o in there:
                rows: Any = o.rectangles
                poses = rows[k : k + len(ahead), :3].copy()
                if not np.isfinite(poses).any():
                    continue
                drift = _SPREAD * random.standard_normal(2)
                poses[:, :2] += ahead[: len(poses), None] * drift
                length, width = 2.0 * np.nanmax(rows[:, 3:], axis=0)
                traffic.append((o.id, o.kind, float(length), float(width), poses))
            yield Cycle(k * dt, np.column_stack([t, place, frame.heading(way), u]), traffic)
            s, v = float(way[1]), float(u[1])
