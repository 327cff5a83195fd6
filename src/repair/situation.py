"""What a search needs to know about a scene, made once and searched many times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from repair.arrays import Array, in_seconds
from repair.check.checker import Checker
from repair.check.verdict import Conflict
from repair.curves.base import Curve, SplicedCurve
from repair.errors import ScenarioError, kind_of
from repair.onward.plan import Onward, back_to_reference, to_the_goal
from repair.problem.factory import ProblemFactory, Unguided
from repair.problem.limits import Limits
from repair.problem.problem import RepairProblem
from repair.problem.settings import RepairConfig
from repair.terminal.judge import EndJudge
from repair.terminal.required import SafeEnds
from repair.terminal.room import RoomToStop, room_to_stop
from repair.terminal.verdict import Terminal
from repair.timegrid import on_grid
from repair.world.boxes import Boxes, Occupancy, nothing
from repair.world.dead_ends import dead_ends, with_boxes

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["Situation", "require_situation"]


@dataclass(frozen=True, repr=False)
class Situation:
    """Everything that is the same for every backend: made once, searched many times.

    Attributes
    ----------
    scene : Scene
        Road, traffic and ego.
    settings : RepairConfig
        What a repair problem is.
    limits : Limits
    boxes : Boxes
        Makes ``occupancy``.
    reference : Curve
    checker : Checker
    conflict : Conflict
        Where the reference stops being drivable.
    t_reference : float
        Until when the reference is followed and judged [s].
    t_end : float
        End of the repairs [s].
    said : callable
        Makes ``notes``.
    """

    scene: Scene
    settings: RepairConfig
    limits: Limits
    boxes: Boxes
    reference: Curve
    checker: Checker
    conflict: Conflict
    t_reference: float
    t_end: float
    said: Callable[[], tuple[str, ...]]

    def __repr__(self) -> str:
        ttc, name = in_seconds(self.conflict.time), type(self).__name__
        return f"<{name} of {self.scene!r}: TTC {ttc} ({self.conflict.kind}), repairs until {self.t_end:g} s>"

    @property
    def occupancy(self) -> Occupancy:
        """The traffic as inflated boxes along the scene's frame."""
        return self.boxes.occupancy

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What had to be assumed."""
        return self.said()

    @cached_property
    def source(self) -> ProblemFactory:
        """The repair problems of any t_rep."""
        return self._factory(self.limits.reserving(self.settings.reserve))

    @cached_property
    def unguided(self) -> Unguided:
        """Those for backends that find their own way: no guide, and the limits to the full."""
        return Unguided(self._factory(self.limits))

    def _factory(self, limits: Limits, occupancy: Occupancy | None = None) -> ProblemFactory:
        checker = self.checker
        if occupancy is None:
            occupancy = with_boxes(self.occupancy, self.dead_ends)
        return ProblemFactory(
            self.scene, self.settings, limits, occupancy, self.reference, self.t_end,
            checker.config.clearance, checker.road, self._afterwards(limits),
        )  # fmt: skip

    def judged_at(self, t_rep: float) -> RepairProblem:
        """The problem at ``t_rep`` [s] that judges a curve, without the boxes that nobody would look at."""
        config = self.checker.config
        if config.margin or config.extra or config.terminal == "require":
            return self.source.plain(t_rep)
        limits = self.limits.reserving(self.settings.reserve)
        return self._factory(limits, nothing(self.scene.times)).plain(t_rep)

    def _afterwards(self, limits: Limits) -> RoomToStop | None:
        config = self.checker.config
        if config.terminal != "require":
            return None
        return room_to_stop(
            self.scene, limits, self.t_end, config.clearance, config.terminal_wait, self._dead_ends
        )

    @cached_property
    def dead_ends(self) -> list[tuple[Array, Array]]:
        """Where the path leaves the road within reach, as boxes in (s, l); see ``repair.road_ends``."""
        v, duration = max(float(self.scene.start[1, 0]), 0.0), self.t_end
        return self._dead_ends(v * duration + 0.5 * self.limits.a_max * duration**2)

    def _dead_ends(self, ahead: float) -> list[tuple[Array, Array]]:
        """Those up to a distance [m] after the start."""
        road, scene = self.checker.road, self.scene
        if road is None or not self.settings.road_ends:
            return []
        start = float(scene.start[0, 0])
        corridor = None if self.checker.edge is None else self.checker.edge.corridor
        return dead_ends(road, scene.frame, scene.vehicle, scene.road, start, ahead, corridor)

    @cached_property
    def ends(self) -> EndJudge:
        """Who judges how a repair ends."""
        return EndJudge(self.checker, self.source)

    @property
    def judge(self) -> Checker | SafeEnds:
        """Who judges a repair: the checker, with ``checker.terminal: require`` its end as well."""
        if self.checker.config.terminal == "require":
            return SafeEnds(self.checker, self.ends)
        return self.checker

    def onward(self, found: Curve | None, t_rep: float) -> Onward | None:
        """What is driven after the evasive part, or the reference; None where nobody asks.

        Parameters
        ----------
        found : Curve or None
            The repair.
        t_rep : float
            From when on it is driven [s].

        Returns
        -------
        Onward or None
        """
        driven = self.reference if found is None else SplicedCurve(self.reference, found, t_rep)
        t_end = self.t_reference if found is None else self.t_end
        if self.settings.goal:
            made = to_the_goal(self.ends, driven, t_rep, on_grid(t_end, self.scene.dt))
            if made.reached or not self.settings.rejoin or found is None:
                return made
        if self.settings.rejoin and found is not None:
            return back_to_reference(self.ends, driven, self.reference, self.t_end, self.t_reference)
        return None

    def ending(self, repaired: Curve, t_rep: float) -> Terminal | None:
        """How the repair ``repaired`` from ``t_rep`` [s] on ends; None with ``checker.terminal: off``."""
        if self.checker.config.terminal == "off":
            return None
        return self.ends(SplicedCurve(self.reference, repaired, t_rep), self.t_end)


def require_situation(thing: object) -> None:
    """Refuse what is no situation.

    Raises
    ------
    ScenarioError
        It says where one comes from.
    """
    if not isinstance(thing, Situation):
        raise ScenarioError(
            "what repair.prepare(scene, config) returns is expected (of a result, result.prepared), "
            f"not {kind_of(thing)}"
        )
