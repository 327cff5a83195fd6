"""What a motion hits first and how hard, and whether it can be driven until then."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from repair.check.checker import Checker
from repair.check.verdict import Violation
from repair.curves.base import Curve
from repair.problem.shapes import Shapes
from repair.solvers.shooting.impact import struck, velocities
from repair.timegrid import intervals, steps_until
from repair.vehicle.states import DrivenStates
from repair.world.tracks import as_complex

if TYPE_CHECKING:
    from repair.situation import Situation

__all__ = ["Impact", "ImpactJudge"]

_SEEN = 0.02  # by which a shape is enlarged to see where it touches another [m]


@dataclass(frozen=True)
class Impact:
    """The end of a motion: what it hits first.

    Attributes
    ----------
    kind : str
        ``contact`` (of the true shapes), ``off_road`` (the road is left before that), or ``none``.
    time : float
        When [s]; infinite for ``none``.
    speed : float
        Impact speed [m/s]: the size of the difference between the velocities of the ego's centre and of the
        centre of what is hit, at that time. What lies beyond the road stands. 0 for ``none``.
    own_speed : float
        Speed of the ego's centre then; for ``none`` at the end of what was looked at [m/s].
    obstacle_id : int or None
    from_behind : bool
        The obstacle strikes the ego from behind.
    worst : float
        The largest impact speed at the first contact with anybody, and of leaving the road, if everybody went
        on as planned [m/s]: who is brushed first does not save one from the wall.
    overlap : float
        How deep the shapes (polygons as the rectangles around them) would overlap at most then [m].
    place : (float, float) or None
        Where the shapes touch, or the road is left [m].
    """

    kind: str
    time: float = math.inf
    speed: float = 0.0
    own_speed: float = 0.0
    obstacle_id: int | None = None
    from_behind: bool = False
    worst: float = 0.0
    overlap: float = 0.0
    place: tuple[float, float] | None = None


class ImpactJudge:
    """Judges motions from the start on by what they hit.

    Parameters
    ----------
    situation : Situation
    t_end : float
        Until when is looked [s]: a scenario step within the scene's horizon.
    """

    def __init__(self, situation: Situation, t_end: float) -> None:
        self.situation, self.t_end = situation, t_end
        checker = situation.checker
        self.checker = checker
        # The drivability of a motion is one question, what it hits another.
        config = replace(checker.config, margin=False, road=False, clearance=0.0, extra=[])
        scene = replace(checker.scene, obstacles=())
        self._alone = Checker(scene, checker.limits, config, checker.reference_limits, like=checker)

    def impact(self, curve: Curve) -> Impact:
        """What is hit first, in continuous time; the edge of the road at the checker's samples.

        Parameters
        ----------
        curve : Curve
            From t = 0 on.
        """
        states = self.checker.drive(curve, self.t_end)
        contact = self.checker.world.contact(states.x, states.y, states.orientation)
        time, road, k = math.inf if contact is None else contact.time, self.checker.road, None
        if road is not None:
            k = road.first_off_road(states.x, states.y, states.orientation)
        left = math.inf if k is None else float(states.t[k])
        beyond = 0.0 if k is None else abs(self._velocity(curve, left))
        if road is not None and k is not None and left < time:
            x, y, psi = float(states.x[k]), float(states.y[k]), float(states.orientation[k])
            worst = max(beyond, self._later(curve, states)[0])
            return Impact("off_road", left, beyond, beyond, worst=worst, place=road.departure(x, y, psi)[1])
        if contact is None:
            return Impact("none", own_speed=abs(self._velocity(curve, self.t_end)))
        own = self._velocity(curve, time)
        speed = abs(own - complex(*contact.velocity))
        worst, overlap = self._later(curve, states)
        return Impact(
            "contact", time, speed, abs(own), contact.obstacle_id, contact.from_behind,
            max(worst, speed, beyond), overlap, self._touching(states, time),
        )  # fmt: skip

    def _velocity(self, curve: Curve, t: float) -> complex:
        """Of the ego's centre [m/s]."""
        path = self.situation.scene.frame.cartesian(curve.sample([t]))
        return complex(path.speed[0] * np.exp(1j * path.heading[0]))

    @cached_property
    def _shapes(self) -> Shapes:
        shapes = self.situation.source.plain(0.0).shapes
        assert shapes is not None
        return shapes

    def _later(self, curve: Curve, states: DrivenStates) -> tuple[float, float]:
        """The hardest of all first contacts at the checker's samples [m/s], and the deepest overlap [m]."""
        path = self.situation.scene.frame.cartesian(curve.sample(states.t))
        velocity = (path.speed * np.exp(1j * path.heading))[None]
        boxes, moving = self._shapes.at(states.t), velocities(self._shapes, states.t)
        centre = as_complex(states.x, states.y)[None]
        met = struck(self._shapes, boxes, moving, centre, states.orientation[None], velocity)
        return float(met.worst[0]), float(met.deepest[0])

    def _touching(self, states: DrivenStates, time: float) -> tuple[float, float]:
        """The middle of where the ego and the rectangle nearest to it touch at a time."""
        import shapely

        vehicle = self.situation.scene.vehicle
        pose = [float(np.interp(time, states.t, x)) for x in (states.x, states.y, states.orientation)]
        boxes = self._shapes.at(np.array([time]))[:, 0]
        boxes = boxes[np.isfinite(boxes[:, 0])]
        if not len(boxes):
            return pose[0], pose[1]
        placed = np.array([[*pose, vehicle.half_length, vehicle.half_width], *boxes])
        half = as_complex(placed[:, 3], placed[:, 4])
        around = np.stack([half, -half.conj(), -half, half.conj()], axis=1)
        corners = around * np.exp(1j * placed[:, 2:3]) + as_complex(placed[:, :1], placed[:, 1:2])
        ego, *others = shapely.polygons(np.stack([corners.real, corners.imag], axis=-1))
        apart = shapely.distance(ego, others)
        nearest = int(apart.argmin())
        both = ego.buffer(float(apart[nearest]) + _SEEN).intersection(others[nearest])
        return float(both.centroid.x), float(both.centroid.y)

    def until(self, impact: Impact) -> float:
        """The scenario step at or after an impact, until which a motion is driven [s]."""
        dt = self.situation.scene.dt
        last = steps_until(self.t_end, dt)
        if math.isinf(impact.time):
            return last * dt
        return min(max(intervals(impact.time, dt), 1), last) * dt

    def faults(self, curve: Curve, impact: Impact) -> tuple[Violation, ...]:
        """Limits and kinematics that a motion breaks until its impact, by the one checker."""
        problem = replace(self.situation.source, t_end=self.until(impact)).plain(0.0)
        return self._alone.check(problem, curve).violations

    def driven(self, curve: Curve, impact: Impact) -> DrivenStates:
        """The vehicle at the scenario's steps, until the one at or after the impact."""
        return self.checker.drive(curve, self.until(impact)).every(self.checker.config.substeps)
