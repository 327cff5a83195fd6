"""What a policy can ask in a cycle; nothing is computed that is not asked for."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from repair.arrays import Array
from repair.baselines.evasive.times import brakes_free
from repair.check.verdict import Conflict
from repair.config.schema import Config
from repair.curves.base import Curve
from repair.scene.scene import InitialState, Scene
from repair.scene.traffic.obstacle import Obstacle, Traffic
from repair.simulate.curves import driven_along
from repair.simulate.near import ASIDE, anybody_near, within_reach
from repair.simulate.watch import Found, Looked, Watch
from repair.simulate.world import Beliefs, displaced, widened

__all__ = ["Eyes", "Grounds", "Sight"]

T = TypeVar("T")
_TRAFFIC = ("margin", "collision")
_BEFORE, _AFTER = 15.0, 40.0  # who follows, and who is met by speeding up [m]
NONE = Conflict(float("inf"))


@dataclass(eq=False)
class Grounds:
    """What a drive is made on: road, beliefs, and those who look.

    Attributes
    ----------
    scene : Scene
        In whose frame plan and repairs are.
    config : Config
    beliefs : Beliefs
    hard : Watch
    gentle : tuple of Watch
        With the friction limits of ``simulate.gentle``.
    """

    scene: Scene
    config: Config
    beliefs: Beliefs
    hard: Watch
    gentle: tuple[Watch, ...]

    @property
    def period(self) -> float:
        """From cycle to cycle [s]."""
        asked = self.config.simulate.period
        return self.scene.dt if asked is None else max(round(asked / self.scene.dt), 1) * self.scene.dt


@dataclass(eq=False)
class Eyes:
    """One policy's own: its repairers keep what they have found.

    Attributes
    ----------
    grounds : Grounds
    spent : float
        Processor time of what was asked since it was last set to zero [s].
    complete : bool
        Whether no search was cut short since it was last set.
    solves : int
        How many there were since they were last set to zero.
    """

    grounds: Grounds
    spent: float = 0.0
    complete: bool = True
    solves: int = 0

    @cached_property
    def hard(self) -> Watch:
        """With the configured limits."""
        return self.grounds.hard.twin()

    @cached_property
    def gentle(self) -> tuple[Watch, ...]:
        """With smaller friction limits, in the order of ``simulate.gentle``."""
        return tuple(one.twin() for one in self.grounds.gentle)

    def timed(self, work: Callable[[], T]) -> T:
        """Do something on the clock of the cycle."""
        begin = time.process_time()
        try:
            return work()
        finally:
            self.spent += time.process_time() - begin

    def sight(self, curve: Curve, ego: InitialState, step: int, mode: str = "plan") -> Sight:
        """What is ahead of a curve that begins now."""
        return Sight(self, curve, ego, step, mode)


@dataclass(eq=False)
class Sight:
    """A curve among what is believed of the others.

    Attributes
    ----------
    eyes : Eyes
    curve : Curve
        Its time 0 is now.
    ego : InitialState
    step : int
        Of the drive.
    mode : str
        What is driven: ``plan``, ``repair`` or ``brake``.
    """

    eyes: Eyes
    curve: Curve
    ego: InitialState
    step: int
    mode: str

    @property
    def period(self) -> float:
        """From cycle to cycle [s]."""
        return self.eyes.grounds.period

    @property
    def now(self) -> float:
        """[s]."""
        return self.step * self.eyes.grounds.scene.dt

    @cached_property
    def looked(self) -> Looked | None:
        """The look with the configured limits; None where nobody comes near."""
        return self.eyes.timed(self._look)

    def _look(self) -> Looked | None:
        traffic = self._traffic()
        grounds = self.eyes.grounds
        times = np.arange(traffic.n_steps + 1) * grounds.scene.dt
        states = driven_along(grounds.scene, self.curve, times, self.ego.orientation)
        poses = np.column_stack([states.x, states.y, states.orientation])
        margin = grounds.config.checker.clearance + 0.1
        if not anybody_near(traffic.obstacles, poses, grounds.scene.vehicle, margin):
            return None
        watch: Watch = self.eyes.hard
        return watch.look(self.curve, traffic=traffic, ego=self.ego, now=self.now)

    def _traffic(self, error: float = 0.0) -> Traffic:
        grounds = self.eyes.grounds
        return Traffic(widened(self._near, error, grounds.scene.dt), grounds.beliefs.ahead(self.step))

    @cached_property
    def _near(self) -> tuple[Obstacle, ...]:
        """Who is believed to come near the way."""
        low, high = self._path.min(axis=0), self._path.max(axis=0)
        believed = self.eyes.grounds.beliefs.around(self.step, low, high, ASIDE)
        return within_reach(believed, self._path)

    @cached_property
    def _path(self) -> Array:
        """Places along the way, and some before and after it (P, 2) [m]."""
        grounds = self.eyes.grounds
        lookahead = grounds.beliefs.ahead(self.step) * grounds.scene.dt
        first, last = self.curve.sample(np.array([0.0, lookahead])).position[:, 0].tolist()
        s = np.linspace(first - _BEFORE, last + _AFTER, max(int((last - first + _BEFORE + _AFTER) / 4.0), 2))
        return grounds.scene.frame.to_cartesian(s, np.zeros(len(s)))

    @property
    def conflict(self) -> Conflict:
        """Of the curve."""
        return NONE if self.looked is None else self.looked.conflict

    def alarming(self, trigger: str) -> bool:
        """Whether a conflict with the traffic is ahead: contact, or with ``margin`` a margin entered."""
        conflict = self.conflict
        met = conflict.contact_time < float("inf")
        return met or (trigger == "margin" and conflict.kind in _TRAFFIC)

    @cached_property
    def cycle(self) -> Found:
        """The F-TTR with the configured limits, as far as the decision to wait needs it."""
        return self._search(self.eyes.hard, self.looked, None)

    @cached_property
    def first(self) -> Found:
        """A repair that begins at once."""
        return self._search(self.eyes.hard, self.looked, (0.0,))

    def gently(self, level: int) -> Found | None:
        """The F-TTR with a smaller friction limit, among everybody widened; None without a conflict."""
        grounds = self.eyes.grounds
        watch = self.eyes.gentle[level]

        def look() -> Looked:
            error = grounds.config.simulate.error
            return watch.look(self.curve, traffic=self._traffic(error), ego=self.ego, now=self.now)

        looked = self.eyes.timed(look)
        if looked.conflict.time == float("inf"):
            return None
        return self._search(watch, looked, None, brief=True)

    def sure(self) -> bool:
        """Whether the contact is there with everybody ahead of what is believed, and with everybody behind.

        By how much, ``simulate.doubt`` says: that one of the two leaves the way free is reason to wait.
        """
        doubt = self.eyes.grounds.config.simulate.doubt
        return doubt <= 0.0 or all(self._meets(error) for error in (doubt, -doubt))

    def _meets(self, error: float) -> bool:
        grounds, watch = self.eyes.grounds, self.eyes.hard

        def meets() -> bool:
            traffic = Traffic(
                displaced(self._near, error, grounds.scene.dt), grounds.beliefs.ahead(self.step)
            )
            return watch.meets(self.curve, traffic=traffic, ego=self.ego)

        return self.eyes.timed(meets)

    def brakes(self, t: float) -> bool:
        """Whether full braking along the path helps that begins so much later [s]."""
        looked = self.looked
        if looked is None:
            return True
        config = self.eyes.grounds.config
        return self.eyes.timed(lambda: brakes_free(looked.prepared, config.evasive, t))

    def _search(
        self,
        watch: Watch,
        looked: Looked | None,
        visits: tuple[float, ...] | None,
        brief: bool = False,
    ) -> Found:
        assert looked is not None
        config = self.eyes.grounds.config.simulate
        left = None if config.solves is None else max(config.solves - self.eyes.solves, 1)
        found = self.eyes.timed(
            lambda: watch.answer(
                looked, limit=config.deadline, visits=visits, enough=self.period, solves=left, brief=brief
            )
        )
        self.eyes.complete &= found.complete
        self.eyes.solves += found.solves
        return found
