"""Is it feasible? Limits, collision, road, kinematics; the same judge for every backend.

The vehicle is driven along the curve (kinematic single-track states that are consistent with the
centre's path), and what is judged are those states: exactly what a solution file will hold.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, Points, frozen
from repair.check.boxes import boxes_entered
from repair.check.edge import RoadEdge, off_road, road_edge
from repair.check.followed import Followed, angles_along, is_finite, met_anyhow, motion_of
from repair.check.limits import (
    as_violation,
    broken_limits,
    plane_excess,
    speed_excess,
    vehicle_excess,
)
from repair.check.peaks import Peaks, peaks
from repair.check.registry import CHECKS, Driven, violations_of
from repair.check.settings import CheckerConfig
from repair.check.verdict import Reason, Verdict, Violation, entered, met
from repair.curves.base import Curve, FrenetTrajectory
from repair.deadline import in_time
from repair.problem.limits import Limits
from repair.problem.problem import RepairProblem
from repair.scene.start import slip_at_start
from repair.timegrid import INSTANT, steps_until
from repair.vehicle.states import DrivenStates
from repair.world.collision import CollisionWorld
from repair.world.contact import Contact

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.scene.scene import Scene

__all__ = ["Checker"]


class Checker:
    """Judges curves in one scene.

    Parameters
    ----------
    scene : Scene
    limits : Limits
    config : CheckerConfig
    reference_limits : Limits, optional
        Those of references; by default the same.
    like : Checker, optional
        Another one, whose edge of the road is taken over where road, vehicle and gap are the same.
    """

    def __init__(
        self,
        scene: Scene,
        limits: Limits,
        config: CheckerConfig,
        reference_limits: Limits | None = None,
        like: Checker | None = None,
    ) -> None:
        self.scene, self.limits, self.config = scene, limits, config
        self.reference_limits = reference_limits or limits
        self._refused: float | None = None
        self.world = CollisionWorld(scene.obstacles, scene.vehicle, scene.dt, scene.n_steps, config.substeps)
        before = None if like is None else like.edge
        self.edge: RoadEdge | None = road_edge(scene, config.road_gap, before) if config.road else None
        self.road = None if self.edge is None else self.edge.boundary
        self._times = frozen(np.arange(scene.n_steps * config.substeps + 1) * (scene.dt / config.substeps))
        self._followed: Followed | None = None
        self._crossing: tuple[Followed, bool] | None = None
        self._touched: tuple[Curve, float, Contact | None] | None = None  # what the last reference touches
        self._checks = {name: CHECKS[name] for name in config.extra}
        self._beside = self._met_at_start(config.clearance) if config.clearance else frozenset()

    def times(self, t_end: float) -> Array:
        """Dense sample times over [0, t_end]: ``substeps`` to a scenario step, whole steps only."""
        steps = min(steps_until(t_end, self.scene.dt), self.scene.n_steps)
        return self._times[: max(steps * self.config.substeps + 1, 0)]

    def path(self, curve: Curve, t_end: float) -> CartesianPath:
        """The curve in the plane, densely sampled over [0, t_end]."""
        return self.scene.frame.cartesian(curve.sample(self.times(t_end)))

    def drive(self, curve: Curve, t_end: float) -> DrivenStates:
        """Consistent vehicle states along the curve, densely sampled."""
        path = self.path(curve, t_end)
        return self.scene.model.drive(path, slip_at_start(self.scene, path))

    def peaks(self, curve: Curve, t_end: float, t_from: float = 0.0) -> Peaks:
        """Extremes over [t_from, t_end]."""
        path = self.path(curve, t_end)
        return peaks(path, path.t >= t_from - INSTANT)

    def contact(self, curve: Curve, t_end: float) -> Contact | None:
        """First contact of the true rectangles along the curve."""
        if (known := self._touched) is not None and known[0] is curve and known[1] == t_end:
            return known[2]
        states = self.drive(curve, t_end)
        return self.world.contact(states.x, states.y, states.orientation)

    def touching_at_start(self) -> set[int]:
        """Obstacles that the ego's rectangle touches at t = 0."""
        return {self.scene.obstacles[k].id for k in self._met_at_start(0.0)}

    def _met_at_start(self, margin: float) -> frozenset[int]:
        """Obstacles (by index) that the ego, enlarged by a margin, meets at t = 0."""
        start = self.scene.initial_state
        return self.world.met_at(0, complex(start.x, start.y), start.orientation, margin)

    def check(self, problem: RepairProblem, curve: Curve) -> Verdict:
        """Verdict on ``curve`` after the reference until ``problem.t_rep``.

        Judged from one step before ``t_rep`` on: until the conflict, the reference has been checked. Where
        the vehicle stands there, from the last step on at which it does not.
        """
        first, after, path, s, slip0 = self._spliced(problem.reference, problem.t_rep, problem.t_end, curve)
        if (angles := angles_along(self.scene.model, path, slip0)) is None:
            return Verdict((Violation(Reason.KINEMATICS, 0.0, "the trajectory is not finite"),))
        slip, orientation = angles
        found = self._limits(curve, after, problem, path)
        if self.config.margin:
            found += boxes_entered(problem, curve, after, self.times(problem.t_end), self.config.substeps)
        in_time()
        found += self._clear(path, s, orientation, first, problem.t_rep)[0]
        in_time()
        found += self._extra(problem, path, slip, orientation, len(path.t) - len(after))
        if self.config.limits and not found:
            at = slice(None, None, self.config.substeps)
            found += as_violation(vehicle_excess(path.t[at], path.speed[at], slip[at], self.scene.vehicle))
        if not found and self.config.gaps == "as_reference":
            found += self._over_a_gap(problem, path, orientation)
        if not first and not found and problem.t_rep < INSTANT:
            kept = self._kept(problem.reference, problem.t_end)
            if words := kept.begun_otherwise(after, problem.start, float(orientation[0])):
                found.append(Violation(Reason.KINEMATICS, 0.0, words))
        # What is rejected already is not worth the drivability checker's time.
        return Verdict(tuple(found or self._kinematics(path, slip, orientation)))

    def refuses_traffic(self, problem: RepairProblem, curve: Curve) -> Violation | None:
        """What :meth:`check` would say of the traffic alone; a curve that is not finite meets nobody."""
        first, _, path, _, slip0 = self._spliced(problem.reference, problem.t_rep, problem.t_end, curve)
        if (angles := angles_along(self.scene.model, path, slip0)) is None:
            return None
        orientation, centre = angles[1], path.xy.view(np.complex128)[:, 0]
        return self._met(centre, orientation, first, path.longest, problem.t_rep)[0]

    def blocked(self, problem: RepairProblem) -> Violation | None:
        """Whom each repair meets that keeps to the path of the reference, whatever its speed; if anybody."""
        if not self.config.limits:  # which bound where it may be
            return None
        kept = self._kept(problem.reference, problem.t_end)
        margin = 0.0 if self._beside else self.config.clearance  # else it counts once it has been left
        limits = self.limits.reserving(-self.config.tolerance)
        return met_anyhow(kept, self.world, limits, margin, problem.t_rep, problem.t_end)

    def is_free(self, reference: Curve, curve: Curve, t_end: float, *, road: bool) -> bool:
        """Whether a curve after the reference touches nobody, nor leaves the road where that is asked.

        The true rectangles, without a margin; the reference is free until the curve begins.
        """
        first, after, path, s, slip0 = self._spliced(reference, curve.t_start, t_end, curve)
        _, orientation = self.scene.model.angles(path, slip0)
        centre = path.xy.view(np.complex128)[:, 0]
        if self.world.contact_along(centre, orientation, first, path.longest) is not None:
            return False
        late = slice(len(path.t) - len(after), None)
        if self.edge is None or not road:
            return True
        return self.edge.left_at(s[late], centre[late], orientation[late]) is None

    def _over_a_gap(self, problem: RepairProblem, path: CartesianPath, orientation: Array) -> list[Violation]:
        """A gap of the map that is no road for CommonRoad's own check, where the reference crosses none."""
        crossed = self._gap_under(path, orientation)
        if crossed is None or self._crosses(self._kept(problem.reference, problem.t_end)):
            return []
        index, words, place = crossed
        return [Violation(Reason.OFF_ROAD, float(path.t[index]), words, place=place)]

    def _crosses(self, followed: Followed) -> bool:
        """Whether the reference crosses a gap; asked only where a repair does."""
        if (known := self._crossing) is None or known[0] is not followed:
            known = self._crossing = followed, self._gap_under(followed.path, followed.turned) is not None
        return known[1]

    def _gap_under(
        self, path: CartesianPath, orientation: Array
    ) -> tuple[int, str, tuple[float, float]] | None:
        return None if self.road is None else self.road.over_a_gap(path.xy[:, 0], path.xy[:, 1], orientation)

    def take_word(self, refused: float, limits: Limits) -> None:
        """Leave the kinematics of references to CommonRoad's drivability checker, which was asked.

        Parameters
        ----------
        refused : float
            When it refuses the states as they were given [s]; inf if never.
        limits : Limits
            What it does not judge.
        """
        self._refused = refused
        if refused == np.inf:
            self.reference_limits = limits

    def check_reference(self, reference: Curve, t_end: float) -> Verdict:
        """Verdict on a reference trajectory: by the same measure as a repair's, jerks apart."""
        kept = self._follow(reference, t_end)
        if not is_finite(path := kept.path):
            return Verdict((Violation(Reason.KINEMATICS, 0.0, "the trajectory is not finite"),))
        found, contact = self._clear(path, kept.motion[0], kept.turned, 0, 0.0, fully=True)
        self._touched = reference, t_end, contact
        if self.config.limits:
            found += self._reference_limits(reference, t_end)
        until = min((violation.time for violation in found), default=float("inf"))
        if self._refused is None:
            found += self._kinematics(path, kept.slip, kept.turned, until)
        elif self._refused < t_end - INSTANT:
            found.append(Violation(Reason.KINEMATICS, self._refused, "refused as it was given"))
        return Verdict(tuple(found))

    def _follow(self, reference: Curve, t_end: float) -> Followed:
        """The reference, and what is known along it; kept for the repairs."""
        times = self.times(t_end)
        motion = motion_of(reference.sample(times), len(times))
        path = self.scene.frame.carry(times, motion)
        slip, turned = self.scene.model.angles(path, slip_at_start(self.scene, path))
        kept = self._followed = Followed(reference, t_end, motion, path, slip, turned)
        return kept

    def _kept(self, reference: Curve, t_end: float) -> Followed:
        """What was kept of the reference, at least until ``t_end``."""
        kept = self._followed  # another thread may put its own reference there
        if kept is None or kept.reference is not reference or kept.t_end < t_end:
            return self._follow(reference, t_end)
        return kept

    def _spliced(
        self, reference: Curve, t_rep: float, t_end: float, curve: Curve
    ) -> tuple[int, FrenetTrajectory, CartesianPath, Array, float | None]:
        """The reference from dense sample ``first`` on, then the curve's samples ``after`` it.

        Also the path of both, the arc lengths, and the slip angle to begin with; at the start there is no
        history and no slip angle (None).
        """
        n, step = self.config.substeps, steps_until(t_rep, self.scene.dt) - 1
        first = self._kept(reference, t_end).moving(step, n) if step > 0 else 0
        times = self.times(t_end)
        after = curve.sample(times[times.searchsorted(t_rep - INSTANT) :])
        late, slip0 = len(times) - len(after), None
        motion = motion_of(after, len(times) - first)
        if late:
            kept = self._kept(reference, t_end)
            motion[:, : late - first] = kept.motion[:, first:late]
            slip0 = None if first == 0 else float(kept.slip[first])
        path = self.scene.frame.carry(times[first:], motion)
        return first, after, path, motion[0], slip_at_start(self.scene, path) if first == 0 else slip0

    def _clear(
        self, path: CartesianPath, s: Array, orientation: Array, first: int, since: float, fully: bool = False
    ) -> tuple[list[Violation], Contact | None]:
        """What :meth:`_met` finds, and the first departure from the road; and the contact."""
        found = []
        centre = path.xy.view(np.complex128)[:, 0]
        obstacle, contact = self._met(centre, orientation, first, path.longest, since, fully)
        if obstacle is not None:
            found.append(obstacle)
        index = None if self.edge is None else self.edge.left_at(s, centre, orientation)
        if self.edge is not None and index is not None:
            pose = centre.item(index), orientation.item(index)
            found.append(off_road(self.scene, self.edge.boundary, path.t.item(index), *pose))
        return found, contact

    def _met(
        self, centre: Points, orientation: Array, first: int, step: float, t_from: float, fully: bool = False
    ) -> tuple[Violation | None, Contact | None]:
        """The first obstacle that is touched, or whose margin is entered from ``t_from`` on; and the contact.

        A margin that the ego starts in counts once it has been left. A contact that comes after the margin
        is entered is looked for ``fully``, or else when somebody reads of it.
        """
        margin, driven = self.config.clearance, (centre, orientation, first, step)
        since = max(round(t_from / self.scene.dt * self.config.substeps) - first, 0)
        if not margin:
            contact = self.world.contact_along(*driven, since=since)
            return met(contact, contact, margin), contact
        near, contact = self.world.met_along(
            *driven, margin=margin, beside=self._beside, since=since, fully=fully
        )
        if near is None or contact is not None or fully:
            return met(near, contact, margin), contact
        return entered(near, margin, partial(self.world.contact_along, *driven)), None

    def _limits(
        self, curve: Curve, after: FrenetTrajectory, problem: RepairProblem, path: CartesianPath
    ) -> list[Violation]:
        """Limits that the repaired part breaks."""
        if not self.config.limits:
            return []
        scene, span = self.scene, (problem.t_rep, problem.t_end)
        return broken_limits(
            curve, span, after, path, scene.frame, self.limits, scene.vehicle, self.config.tolerance
        )

    def _reference_limits(self, reference: Curve, t_end: float) -> list[Violation]:
        """Limits of speed and acceleration that the reference breaks; its jerk is nobody's claim."""
        samples, scene = reference.sample(self.times(t_end)), self.scene
        limits, slack = self.reference_limits, self.config.tolerance
        broken = plane_excess(reference, samples, scene.frame, limits, scene.vehicle, slack)
        return as_violation(broken + speed_excess(samples, limits, slack))

    def _kinematics(
        self, path: CartesianPath, slip: Array, orientation: Array, until: float = float("inf")
    ) -> list[Violation]:
        """What the vehicle cannot drive before ``until``.

        Judged are the scenario's steps of a path that begins at one.
        """
        n = self.config.substeps
        columns = path.t[::n], path.xy[::n], path.speed[::n], slip[::n], orientation[::n]
        if len(columns[0]) < 2:
            return []
        found = self.scene.model.first_undrivable(*columns, self.scene.dt, self.config.official, until)
        return [] if found is None else [Violation(Reason.KINEMATICS, *found)]

    def _extra(
        self, problem: RepairProblem, path: CartesianPath, slip: Array, orientation: Array, late: int
    ) -> list[Violation]:
        """What the registered checks that are asked for say."""
        if not self._checks:
            return []
        states = self.scene.model.states(path.t, path.xy, path.speed, slip, orientation)
        return violations_of(self._checks, Driven(problem, path, states, late))
