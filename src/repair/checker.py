"""Is it feasible? Limits, collision, road, kinematics; the same judge for every backend.

The vehicle is driven along the curve (kinematic single-track states that are consistent with the
centre's path), and what is judged are those states: exactly what a solution file will hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.collision import CollisionWorld, Contact, RoadBoundary, official_shifts
from repair.config import CheckerConfig
from repair.kinematics import DrivenStates, direct_check, drive, official_check
from repair.metrics import Peaks, peaks
from repair.occupancy import first_entry
from repair.types import (
    Array,
    Curve,
    FrenetTrajectory,
    Limits,
    Reason,
    RepairProblem,
    Verdict,
    Violation,
)

if TYPE_CHECKING:
    from repair.scene.commonroad import Scene
    from repair.scene.frame import CartesianPath

__all__ = ["Checker", "SplicedCurve"]

# Speeds this far below zero [m/s] still count as standing, and limits are met up to this share:
# a soft backend ends near its limits, not on them.
STANDSTILL = 0.05
SLACK = 0.01


@dataclass(frozen=True)
class SplicedCurve:
    """The reference until ``t_rep``, the repaired curve after it."""

    reference: Curve
    repaired: Curve
    t_rep: float

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        return self.reference.t_start

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        return self.repaired.t_end

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate either part."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        late = times >= self.t_rep - 1e-9
        parts = [c.sample(times[m]) for c, m in ((self.reference, ~late), (self.repaired, late)) if m.any()]
        if len(parts) == 1:
            return parts[0]
        columns = []
        for name in ("position", "velocity", "acceleration", "jerk"):
            column = np.empty((len(times), 2))
            column[~late], column[late] = getattr(parts[0], name), getattr(parts[1], name)
            columns.append(column)
        return FrenetTrajectory(times, *columns)


class Checker:
    """Judges curves in one scene.

    Parameters
    ----------
    scene : Scene
    limits : Limits
    config : CheckerConfig
    """

    def __init__(self, scene: Scene, limits: Limits, config: CheckerConfig) -> None:
        self.scene, self.limits, self.config = scene, limits, config
        self.world = CollisionWorld(
            scene.obstacles, scene.vehicle, scene.dt, scene.n_steps, config.substeps,
            official_shifts(scene.scenario),
        )  # fmt: skip
        self.road = RoadBoundary(scene.scenario, scene.vehicle) if config.road else None
        self._followed: tuple[Curve, float, Array] | None = None

    def times(self, t_end: float) -> Array:
        """Dense sample times over [0, t_end]: ``substeps`` to a scenario step, whole steps only."""
        steps = min(int(np.floor(t_end / self.scene.dt + 1e-6)), self.scene.n_steps)
        k = np.arange(steps * self.config.substeps + 1)
        return np.asarray(k * (self.scene.dt / self.config.substeps))

    def _path(self, curve: Curve, t_end: float) -> CartesianPath:
        return self.scene.frame.cartesian(curve.sample(self.times(t_end)))

    def _drive(self, path: CartesianPath, slip: float | None = None) -> DrivenStates:
        vehicle = self.scene.vehicle
        return drive(path.t, path.xy, path.heading, path.speed, path.distance, vehicle, slip0=slip)

    def drive(self, curve: Curve, t_end: float) -> DrivenStates:
        """Consistent vehicle states along the curve, densely sampled."""
        return self._drive(self._path(curve, t_end))

    def peaks(self, curve: Curve, t_end: float, t_from: float = 0.0) -> Peaks:
        """Extremes over [t_from, t_end]."""
        path = self._path(curve, t_end)
        return peaks(path, path.t >= t_from - 1e-9)

    def contact(self, curve: Curve, t_end: float) -> Contact | None:
        """First contact of the true rectangles along the curve."""
        states = self.drive(curve, t_end)
        return self.world.contact(states.x, states.y, states.orientation)

    def touching_at_start(self) -> set[int]:
        """Obstacles that the ego's rectangle touches at t = 0."""
        start = self.scene.initial_state
        pose = (np.array([start.x]), np.array([start.y]), np.array([start.orientation]))
        contact = self.world.contact(*pose)
        return set() if contact is None else {contact.obstacle_id}

    def check(self, problem: RepairProblem, curve: Curve) -> Verdict:
        """Verdict on ``curve`` after the reference until ``problem.t_rep``.

        Judged from one step before ``t_rep`` on: until the conflict, the reference has been checked.
        """
        spliced = SplicedCurve(problem.reference, curve, problem.t_rep)
        first = max(int(np.floor(problem.t_rep / self.scene.dt + 1e-6)) - 1, 0)
        first_sample = first * self.config.substeps
        path = self.scene.frame.cartesian(spliced.sample(self.times(problem.t_end)[first_sample:]))
        if not _finite(path):
            return _NOT_FINITE
        states = self._drive(path, self._slip(problem.reference, problem.t_end, first_sample))
        found = self._limits(path, problem.t_rep) if self.config.limits else []
        if self.config.margin:
            found += self._margin(problem, curve)
        found += self._clear(states, first_sample)
        # What is rejected already is not worth the drivability checker's time.
        return Verdict(tuple(found or self._kinematics(states)))

    def check_reference(self, reference: Curve, t_end: float) -> Verdict:
        """Verdict on a reference trajectory: everything but the limits, which are the repair's."""
        path = self._path(reference, t_end)
        if not _finite(path):
            return _NOT_FINITE
        states = self._drive(path)
        found = self._clear(states, 0)
        until = min((violation.time for violation in found), default=float("inf"))
        return Verdict(tuple(found + self._kinematics(states, until)))

    def _slip(self, reference: Curve, t_end: float, sample: int) -> float | None:
        """Slip angle on the reference at a dense sample; None at the start, where there is no history."""
        if sample == 0:
            return None
        if self._followed is None or self._followed[0] is not reference or self._followed[1] < t_end:
            states = self.drive(reference, t_end)
            slip = np.arctan(self.scene.vehicle.rear / self.scene.vehicle.wheelbase * np.tan(states.steering))
            self._followed = (reference, t_end, slip)
        return float(self._followed[2][sample])

    def _clear(self, states: DrivenStates, first_sample: int) -> list[Violation]:
        """First contact with an obstacle and first departure from the road."""
        found = []
        contact = self.world.contact(states.x, states.y, states.orientation, first_sample)
        if contact is not None:
            behind = " from behind" if contact.from_behind else ""
            detail = f"obstacle {contact.obstacle_id}{behind}"
            found.append(Violation(Reason.COLLISION, contact.time, detail))
        if self.road is not None:
            index = self.road.first_off_road(states.x, states.y, states.orientation)
            if index is not None:
                found.append(Violation(Reason.OFF_ROAD, float(states.t[index]), "the ego leaves the road"))
        return found

    def _margin(self, problem: RepairProblem, curve: Curve) -> list[Violation]:
        """The paper's detectCollision on the repaired part, at the scenario's steps."""
        samples = self.times(problem.t_end)[:: self.config.substeps]
        entry = first_entry(problem.occupancy, curve.sample(samples[samples >= problem.t_rep - 1e-9]))
        if entry is None:
            return []
        time = float(samples[samples >= problem.t_rep - 1e-9][entry[0]])
        return [Violation(Reason.MARGIN, time, f"obstacle {problem.occupancy.ids[entry[1]]}")]

    def _limits(self, path: CartesianPath, t_rep: float) -> list[Violation]:
        limits, late = self.limits, path.t >= t_rep - 1e-9
        reached = peaks(path, late)
        checks = (
            (reached.min_speed < -STANDSTILL, f"reverses at {-reached.min_speed:.2f} m/s"),
            (reached.max_speed > limits.v_max * (1 + SLACK) + 0.1, f"speed {reached.max_speed:.1f} m/s"),
            (
                reached.min_acceleration < limits.a_min * (1 + SLACK),
                f"brakes at {reached.min_acceleration:.2f} m/s²",
            ),
            (
                reached.max_acceleration > limits.a_max * (1 + SLACK),
                f"accelerates at {reached.max_acceleration:.2f}",
            ),
            (
                reached.max_lateral_acceleration > limits.a_lat * (1 + SLACK),
                f"lateral acceleration {reached.max_lateral_acceleration:.2f} m/s²",
            ),
            (
                reached.max_total_acceleration > limits.a_total * (1 + SLACK),
                f"total acceleration {reached.max_total_acceleration:.2f} m/s²",
            ),
        )
        broken = [text for bad, text in checks if bad]
        return [Violation(Reason.LIMITS, t_rep, "; ".join(broken))] if broken else []

    def _kinematics(self, dense: DrivenStates, until: float = float("inf")) -> list[Violation]:
        """Direct check first; the drivability checker decides what is left before ``until``."""
        states = dense.every(self.config.substeps)
        if len(states) < 2:
            return []
        scene, official = self.scene, self.config.official
        report = direct_check(states, scene.dt, scene.vehicle)
        open_ = np.arange(len(report.ok)) if official == "always" else np.flatnonzero(~report.ok)
        open_ = open_[states.t[open_] < until]
        for k in open_.tolist():
            if official == "never" or not official_check(states, scene.dt, scene.vehicle, [k]).ok.all():
                return [Violation(Reason.KINEMATICS, float(states.t[k]), report.limit(k))]
        return []


_NOT_FINITE = Verdict((Violation(Reason.KINEMATICS, 0.0, "the trajectory is not finite"),))


def _finite(path: CartesianPath) -> bool:
    return bool(np.isfinite(path.xy).all() and np.isfinite(path.heading).all())
