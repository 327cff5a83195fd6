"""The oracle, and one that comes late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from repair.arrays import wrap
from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.predictions.base import Known, cut, moved
from repair.simulate.predictions.constant_velocity import ConstantVelocity

__all__ = ["Delayed", "Recorded"]


@dataclass(frozen=True)
class Recorded:
    """Everybody does what was recorded: nothing is left to believe."""

    looks_ahead: ClassVar[bool] = True
    to_the_end: ClassVar[bool] = True

    def predict(self, known: Known) -> Obstacle | None:
        """The record from now on; also of those that are to come."""
        return cut(known.record, known.now, known.now + known.n_steps)


@dataclass(frozen=True)
class Delayed:
    """Everybody goes on as the record went on ``delay`` seconds ago: what somebody does is known late.

    From where the obstacle is now it makes the motion that the record makes from ``now - delay`` on, turned
    with it. Until ``delay`` ahead that is the past; beyond, the record's future, as an oracle would have it
    that sees everything so much later. Who was not there then goes on at constant velocity.

    Attributes
    ----------
    delay : float
        [s].
    """

    delay: float
    looks_ahead: ClassVar[bool] = True

    def predict(self, known: Known) -> Obstacle | None:
        """That motion from where the obstacle is."""
        if not np.isfinite(known.past.vertices[-1]).any():
            return None
        late = round(self.delay / known.dt)
        record, now = known.record.states, known.now
        if now < late or not np.isfinite(record[now - late, :3]).all():
            return ConstantVelocity().predict(known)
        rows = record[now - late : now - late + known.n_steps + 1, :3]
        there = np.isfinite(rows).all(axis=1)
        last = len(rows) if there.all() else int(np.argmin(there))
        rows = rows[np.minimum(np.arange(known.n_steps + 1), last - 1)]
        by = float(wrap(record[now, 2] - rows[0, 2]))
        turn = np.array([[np.cos(by), -np.sin(by)], [np.sin(by), np.cos(by)]])
        centres = record[now, :2] + (rows[:, :2] - rows[0, :2]) @ turn.T
        return moved(known.past, centres, np.asarray(wrap(rows[:, 2] - rows[0, 2])), known.dt)
