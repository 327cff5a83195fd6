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

    def times(self, t_end: float) -> Array:
        """Dense sample times over [0, t_end]: ``substeps`` to a scenario step, whole steps only."""
        steps = min(int(np.floor(t_end / self.scene.dt + 1e-6)), self.scene.n_steps)
        k = np.arange(steps * self.config.substeps + 1)
        return np.asarray(k * (self.scene.dt / self.config.substeps))

    def _path(self, curve: Curve, t_end: float) -> CartesianPath:
        return self.scene.frame.cartesian(curve.sample(self.times(t_end)))

    def _drive(self, path: CartesianPath) -> DrivenStates:
        return drive(path.t, path.xy, path.heading, path.speed, path.distance, self.scene.vehicle)

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
        """Verdict on the reference until ``problem.t_rep`` followed by ``curve``."""
        spliced = SplicedCurve(problem.reference, curve, problem.t_rep)
        return self._judge(self._path(spliced, problem.t_end), problem.t_rep)

    def check_reference(self, reference: Curve, t_end: float) -> Verdict:
        """Verdict on a reference trajectory: everything but the limits, which are the repair's."""
        return self._judge(self._path(reference, t_end), None)

    def _judge(self, path: CartesianPath, t_rep: float | None) -> Verdict:
        if not (np.isfinite(path.xy).all() and np.isfinite(path.heading).all()):
            return Verdict((Violation(Reason.KINEMATICS, 0.0, "the trajectory is not finite"),))
        states = self._drive(path)
        found: list[Violation] = []
        if t_rep is not None and self.config.limits:
            found += self._limits(path, t_rep)
        contact = self.world.contact(states.x, states.y, states.orientation)
        if contact is not None:
            behind = " from behind" if contact.from_behind else ""
            detail = f"obstacle {contact.obstacle_id}{behind}"
            found.append(Violation(Reason.COLLISION, contact.time, detail))
        if self.road is not None:
            index = self.road.first_off_road(states.x, states.y, states.orientation)
            if index is not None:
                found.append(Violation(Reason.OFF_ROAD, float(states.t[index]), "the ego leaves the road"))
        found += self._kinematics(states.every(self.config.substeps), decisive=not found)
        return Verdict(tuple(found))

    def _limits(self, path: CartesianPath, t_rep: float) -> list[Violation]:
        limits, late = self.limits, path.t >= t_rep - 1e-9
        reached = peaks(path, late)
        checks = (
            (reached.min_speed < -STANDSTILL, f"reverses at {-reached.min_speed:.2f} m/s"),
            (reached.max_speed > limits.v_max * (1 + SLACK) + 0.1, f"speed {reached.max_speed:.1f} m/s"),
            (reached.min_acceleration < limits.a_min * (1 + SLACK), f"brakes at {reached.min_acceleration:.2f} m/s²"),
            (reached.max_acceleration > limits.a_max * (1 + SLACK), f"accelerates at {reached.max_acceleration:.2f}"),
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

    def _kinematics(self, states: DrivenStates, decisive: bool) -> list[Violation]:
        """Direct check first; the drivability checker decides what is left, if that still matters."""
        if len(states) < 2:
            return []
        scene, official = self.scene, self.config.official
        report = direct_check(states, scene.dt, scene.vehicle)
        open_ = np.flatnonzero(~report.ok)
        if official == "always":
            open_ = np.arange(len(report.ok))
        if not len(open_):
            return []
        first = int(open_[0])
        if official == "never" or not decisive:
            return [Violation(Reason.KINEMATICS, float(states.t[first]), report.limit(first))]
        answer = official_check(states, scene.dt, scene.vehicle, open_)
        refused = answer.transitions[~answer.ok]
        if not len(refused):
            return []
        at = int(refused[0])
        return [Violation(Reason.KINEMATICS, float(states.t[at]), report.limit(at))]
