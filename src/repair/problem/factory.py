"""From a scene and its reference to repair problems: limits, room, culling, sides of passing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.base import Curve, FrenetTrajectory
from repair.problem.limits import Limits, room_of
from repair.problem.passing import open_passings
from repair.problem.problem import Afterwards, Maneuver, Passing, RepairProblem
from repair.problem.settings import RepairConfig
from repair.problem.shapes import Shapes
from repair.problem.speeds import Bends, speed_profiles
from repair.problem.surroundings import Surroundings, sides_of, surroundings
from repair.problem.tables import Grid
from repair.problem.taken import begun
from repair.scene.road.bounds import LateralBounds
from repair.timegrid import INSTANT, intervals
from repair.world.boxes import Occupancy
from repair.world.occupancy import near, relevant
from repair.world.road import RoadBoundary

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["ProblemFactory", "Unguided"]
# Where the lateral room is looked up, from the hindmost to the foremost place within reach.
_SHARES = frozen(np.linspace(0.0, 1.0, 50))


@dataclass(frozen=True)
class _Here:
    """What is about at a t_rep, whatever the margin: the reference from there on, the state, who is in reach.

    ``among`` says what the boxes with a margin are to the reference.
    """

    t_rep: float
    reference: FrenetTrajectory
    start: Array
    occupancy: Occupancy
    among: Callable[[float], Surroundings]
    limits: Limits
    axis: tuple[Array, Array]

    @cached_property
    def bends(self) -> Bends:
        """How the speed may go on."""
        tau = self.reference.t - self.reference.t[0]
        return Bends(speed_profiles(self.start, tau, self.limits), self.limits, self.axis)


@dataclass(frozen=True)
class ProblemFactory:
    """Makes the repair problems of one scene and reference (a :class:`repair.search.probe.ProblemSource`).

    Attributes
    ----------
    scene : Scene
    settings : RepairConfig
    limits : Limits
    occupancy : Occupancy
        All obstacles, inflated.
    reference : Curve
    t_end : float
        End of every repair [s].
    room : float
        What the checker wants around the ego's rectangle [m].
    boundary : RoadBoundary or None
        What it wants that rectangle to lie in.
    afterwards : Afterwards or None
        What is about after the repairs; None where nobody asks how they end.
    """

    scene: Scene
    settings: RepairConfig
    limits: Limits
    occupancy: Occupancy
    reference: Curve
    t_end: float
    room: float = 0.0
    boundary: RoadBoundary | None = None
    afterwards: Afterwards | None = None

    @cached_property
    def bounds(self) -> LateralBounds:
        """Lateral room of the reference point, as ``repair.lateral`` says."""
        return room_of(self.scene, self.settings)

    @cached_property
    def _shapes(self) -> Shapes:
        scene = self.scene
        return Shapes(scene.frame, scene.obstacles, scene.vehicle, scene.dt, self.room, self.boundary)

    @cached_property
    def _grid(self) -> Grid | None:
        return Grid.over(self.occupancy, self.reference, self.t_end, self.scene.dt)

    @cached_property
    def _last(self) -> dict[str, _Here]:
        return {}

    @cached_property
    def _axis(self) -> tuple[Array, Array]:
        s0 = float(self.scene.start[0, 0])
        s = s0 + np.arange(-20.0, 20.0 + self.limits.v_max * self.t_end, 0.5)
        return frozen(s), frozen(self.scene.frame.curvature(s))

    def relaxed(self, t_rep: float) -> Iterator[tuple[RepairProblem, ...]]:
        """The problems again with smaller and smaller margins, as ``repair.relax`` lists them."""
        for margin in self.settings.relax:
            problems = self.at(t_rep, margin)
            if problems:
                yield problems

    def widened(self, t_rep: float) -> Iterator[tuple[RepairProblem, ...]]:
        """The problems again with larger and larger margins, as ``repair.widen`` lists them.

        Their guides keep the larger margins, so that other ways may be the ones to take.
        """
        for more in self.settings.widen:
            yield self.at(t_rep, self.settings.margin + more, self.settings.clearance + more)

    @property
    def notches(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """By what a problem is tightened: ``repair.widen``, ``narrow`` and ``ease``."""
        return self.settings.widen, self.settings.narrow, self.settings.ease

    def at(
        self, t_rep: float, margin: float | None = None, clearance: float | None = None
    ) -> tuple[RepairProblem, ...]:
        """One problem for each open side of passing, the gentlest guide first.

        Parameters
        ----------
        margin : float, optional
            Distance to the inflated boxes [m]; negative values allow into them. By default
            ``repair.margin``.
        clearance : float, optional
            What soft backends want beyond them [m]; by default ``repair.clearance``.
        """
        settings = self.settings
        margin = settings.margin if margin is None else margin
        lateral = settings.lateral != "none"
        if t_rep > self.t_end - self.scene.dt + INSTANT:
            return ()  # the repair would end before it begins (repair.horizon is shorter than the TTC)
        here = self._here(t_rep)
        passings = open_passings(
            here.reference, here.start, here.occupancy, self.bounds, self.limits, margin, lateral, self._axis,
            here.among(margin), here.bends,
        )  # fmt: skip
        # Who keeps the path needs no sideways freedom, and without it the vehicle can be brought to a stop
        # on any path that it can drive at all.
        return tuple(
            self._problem(
                t_rep, here.start, here.occupancy, margin, passing,
                lateral and passing.maneuver in (Maneuver.LEFT, Maneuver.RIGHT), clearance,
            )
            for passing in passings
        )  # fmt: skip

    def without_guide(self, t_rep: float) -> tuple[RepairProblem, ...]:
        """One problem with all the room there is, and no way past the obstacles chosen."""
        settings = self.settings
        if t_rep > self.t_end - self.scene.dt + INSTANT:
            return ()
        here, lateral = self._here(t_rep), settings.lateral != "none"
        return (self._problem(t_rep, here.start, here.occupancy, settings.margin, None, lateral),)

    def along(self, manoeuvre: Curve, kind: Maneuver, *, jumps: bool = False) -> RepairProblem:
        """The problem at the start of a manoeuvre, with the manoeuvre as the guide, open or not.

        Parameters
        ----------
        manoeuvre : Curve
            From its time-to-repair on: a fixed manoeuvre, or what a backend found.
        kind : Maneuver
            What it does about the conflict.
        jumps : bool
            The repair begins with the acceleration of the manoeuvre, and not with that of the reference.
        """
        settings, step, t_rep = self.settings, self.scene.dt, manoeuvre.t_start
        times = t_rep + step * np.arange(intervals(self.t_end - t_rep, step) + 1)
        reference, guide = self.reference.sample(times), manoeuvre.sample(times)
        start = frozen([reference.position[0], reference.velocity[0], reference.acceleration[0]])
        lateral = settings.lateral != "none" and kind in (Maneuver.LEFT, Maneuver.RIGHT)
        if jumps:
            kappa = float(self.scene.frame.curvature(start[0, 0]))
            start = begun(start, guide.acceleration[0], kappa, self.limits, lateral)
        occupancy = self._within_reach(start, t_rep, reference.position, lateral)
        lower, upper = occupancy.at(times)
        columns = (guide.t, guide.position, guide.velocity, guide.acceleration, guide.jerk)
        path = FrenetTrajectory(*(frozen(column) for column in columns))
        passing = Passing(kind, path, sides_of(guide.position, lower, upper), 0.0)
        return self._problem(t_rep, start, occupancy, settings.margin, passing, lateral)

    def plain(self, t_rep: float) -> RepairProblem:
        """The problem at a t_rep without a way past the obstacles: to judge a curve by, not to solve."""
        state = self.reference.sample([t_rep])
        start = frozen([state.position[0], state.velocity[0], state.acceleration[0]])
        return self._problem(t_rep, start, self.occupancy, self.settings.margin, None, True)

    def _problem(
        self, t_rep: float, start: Array, occupancy: Occupancy, margin: float, passing: Passing | None,
        lateral: bool, clearance: float | None = None,
    ) -> RepairProblem:  # fmt: skip
        s, curvature = self._axis
        return RepairProblem(
            reference=self.reference,
            t_rep=t_rep,
            t_end=self.t_end,
            start=start,
            occupancy=occupancy,
            bounds=self.bounds,
            limits=self.limits,
            clearance=self.settings.clearance if clearance is None else clearance,
            margin=margin,
            passing=passing,
            curvature_s=s,
            curvature=curvature,
            dt=self.scene.dt,
            half_length=self.scene.vehicle.half_length,
            strict=not self.settings.relax,
            lateral=lateral,
            shapes=self._shapes,
            afterwards=self.afterwards,
        )

    def _here(self, t_rep: float) -> _Here:
        """What is about at t_rep; the last answer is kept, as margins are asked for one after the other."""
        known = self._last.get("here")
        if known is None or known.t_rep != t_rep:
            known = self._last["here"] = self._scenery(t_rep)
        return known

    def _scenery(self, t_rep: float) -> _Here:
        grid, lateral, step = self._grid, self.settings.lateral != "none", self.scene.dt
        times = t_rep + step * np.arange(intervals(self.t_end - t_rep, step) + 1)
        first = None if grid is None else grid.index(t_rep)
        if grid is None or first is None:
            reference = self.reference.sample(times)
            start = frozen([reference.position[0], reference.velocity[0], reference.acceleration[0]])
            occupancy = self._within_reach(start, t_rep, reference.position, lateral)
            among = partial(surroundings, reference, occupancy)
        else:
            reference, start = grid.trajectory(first, times), grid.states[first]
            reach, room = self._reach(start, t_rep, grid.rightmost[first], grid.leftmost[first], lateral)
            rows = near(grid.swept[..., first:], reach, room).nonzero()[0]
            occupancy = grid.occupancy.select(rows) if len(rows) < len(grid.occupancy) else grid.occupancy
            among = partial(grid.surroundings, first, rows, occupancy)
        return _Here(t_rep, reference, start, occupancy, among, self.limits, self._axis)

    def _within_reach(self, start: Array, t_rep: float, reference: Array, lateral: bool) -> Occupancy:
        sideways = reference[:, 1]
        reach, room = self._reach(start, t_rep, float(sideways.min()), float(sideways.max()), lateral)
        return relevant(self.occupancy, t_rep, self.t_end, np.array(reach), np.array(room))

    def _reach(
        self, start: Array, t_rep: float, rightmost: float, leftmost: float, lateral: bool
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Smallest and largest s, and l, that the ego can be at from a state on.

        Parameters
        ----------
        rightmost, leftmost : float
            Smallest and largest l of the reference from there on [m]: who may not move sideways keeps it.
        """
        duration = self.t_end - t_rep
        s0, v0 = float(start[0, 0]), max(float(start[1, 0]), 0.0)
        behind, ahead = s0 - 1.0, s0 + v0 * duration + 0.5 * self.limits.a_max * duration**2 + 1.0
        if lateral:
            right, left = self.bounds.at(behind + (ahead - behind) * _SHARES)
            rightmost, leftmost = float(right.min()), float(left.max())
        margin = self.settings.margin + self.settings.clearance
        return (behind, ahead), (rightmost - margin, leftmost + margin)


@dataclass(frozen=True)
class Unguided:
    """Makes one problem for each t_rep (a :class:`repair.search.probe.ProblemSource`)."""

    factory: ProblemFactory

    def at(self, t_rep: float) -> tuple[RepairProblem, ...]:
        """See :meth:`ProblemFactory.without_guide`."""
        return self.factory.without_guide(t_rep)

    def relaxed(self, t_rep: float) -> tuple[tuple[RepairProblem, ...], ...]:
        """None: who looks at true shapes has no boxes to give up."""
        return ()

    def widened(self, t_rep: float) -> tuple[tuple[RepairProblem, ...], ...]:
        """None, for the same reason."""
        return ()

    @property
    def notches(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """The road and the limits, as for the others; nobody wants more room than the checker."""
        _, edge, ease = self.factory.notches
        return (), edge, ease

    def along(self, manoeuvre: Curve, kind: Maneuver, *, jumps: bool = False) -> RepairProblem:
        """See :meth:`ProblemFactory.along`."""
        return self.factory.along(manoeuvre, kind, jumps=jumps)

    def without_guide(self, t_rep: float) -> tuple[RepairProblem, ...]:
        """As :meth:`at`."""
        return self.at(t_rep)
