"""How hard trajectories hit what they hit first: what is minimised where nothing can be avoided."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from repair.arrays import Array, Points
from repair.problem.shapes import Shapes
from repair.solvers.shooting.motion import Driven, direction
from repair.solvers.shooting.space import Space, depths, looks
from repair.world.tracks import Index, as_complex

__all__ = ["Impacts", "Struck", "struck", "velocities"]

_DEEP = 0.01  # what a metre of overlap counts against a metre a second: it decides between equals
_OFF = 1e3  # what it costs to leave the road where that is not to be [m/s]
_ABEAM = 1.3  # who turns farther from the axis has no coordinates [rad]


class Struck(NamedTuple):
    """What trajectories meet, of P looks.

    Attributes
    ----------
    first : (N,) int array
        The first look with contact; P where there is none.
    speed, worst : (N,) array
        Impact speed at that look, and the largest at the first contact with anybody, as if earlier ones
        changed nothing [m/s].
    deepest : (N,) array
        How deep shapes overlap at most [m].
    """

    first: Index
    speed: Array
    worst: Array
    deepest: Array


def velocities(shapes: Shapes, times: Array) -> Points:
    """Of the rectangles' centres (M, P), over the scenario's step of each time; 0 where there is none."""
    k = np.floor(times / shapes.dt - 1e-6)
    before, after = (shapes.at((k + i) * shapes.dt) for i in (0, 1))
    moved = (after - before)[..., :2] / shapes.dt
    return np.nan_to_num(as_complex(moved[..., 0], moved[..., 1]))


def struck(
    shapes: Shapes, boxes: Array, moving: Points, centre: Points, heading: Array, velocity: Points
) -> Struck:
    """Contacts of the true shapes at looks, and how hard they are.

    Parameters
    ----------
    shapes : Shapes
    boxes : (M, P, 5) array
        What :meth:`repair.problem.shapes.Shapes.at` has at the looks.
    moving : (M, P) complex array
        See :func:`velocities`.
    centre, velocity : (N, P) complex array
        Of the ego's centre.
    heading : (N, P) array
        Of its body.
    """
    count, shown = centre.shape
    first, speed = np.full(count, shown), np.zeros(count)
    worst, deepest = np.zeros(count), np.zeros(count)
    reach = shapes.vehicle.radius + np.hypot(boxes[..., 3], boxes[..., 4])
    away = [
        np.maximum(low.min(axis=0) - at, at - low.max(axis=0))
        for low, at in ((centre.real, boxes[..., 0]), (centre.imag, boxes[..., 1]))
    ]
    near = (away[0] < reach) & (away[1] < reach)
    for m in np.flatnonzero(near.any(axis=1)).tolist():
        look = np.flatnonzero(near[m])
        depth = depths(centre[:, look], heading[:, look], boxes[m, look], shapes, np.zeros(len(look)))
        meets = depth > 0.0
        k = meets.argmax(axis=1)
        one = np.arange(count)
        hit = meets[one, k]
        own = np.abs(velocity[one, look[k]] - moving[m, look[k]])
        sooner = hit & ((look[k] < first) | ((look[k] == first) & (own > speed)))
        first, speed = np.where(sooner, look[k], first), np.where(sooner, own, speed)
        worst = np.where(hit, np.maximum(worst, own), worst)
        deepest = np.maximum(deepest, depth.max(axis=1))
    return Struck(first, speed, worst, deepest)


@dataclass(frozen=True)
class Impacts(Space):
    """A :class:`repair.solvers.shooting.space.Space` whose excess is the speed of the first impact.

    That is, at the first look at which the true shapes overlap, the size of the difference between the
    velocities of both centres; where the lateral room is left before that, the ego's own speed. Of true
    shapes only; the margin around the ego does not count.

    Attributes
    ----------
    leaves : bool
        Whether the road may be left, as the lesser evil.
    most : float
        What is hit later must not be hit harder than this [m/s].
    """

    leaves: bool = False
    most: float = math.inf

    adds_up: ClassVar[bool] = False

    def excess(self, driven: Driven) -> tuple[Array, Array]:
        """The speed of the first impact [m/s], twice (N,); 0 for who meets nothing and keeps to the road."""
        problem, shapes, shown = self.problem, self.problem.shapes, len(self._times)
        s, l, chi, beta = looks(driven, self.steps.dt, self.fine, shown)  # noqa: E741
        share = np.arange(1, self.fine + 1) / self.fine
        v = driven.v[:, :-1, None] + share * (driven.v[:, 1:, None] - driven.v[:, :-1, None])
        v = v.reshape(len(s), -1)[:, :shown]
        first = np.full(len(s), shown)
        speed: Array = np.zeros(len(s))
        worst: Array = np.zeros(len(s))
        if shapes is not None:
            plane, axis = shapes.frame.to_cartesian(s, l), shapes.frame.heading(s)
            centre = as_complex(plane[..., 0], plane[..., 1])
            velocity = v * np.exp(1j * (axis + chi))
            met = struck(shapes, self._rectangles, self._moving, centre, axis + chi - beta, velocity)
            speed, worst, first = met.speed + _DEEP * met.deepest, met.worst, met.first
        if problem.lateral:
            beyond = self._off_road(s, l, *direction(chi - beta)) > 0.0
            left = np.where(beyond.any(axis=1), beyond.argmax(axis=1), shown)
            own = np.where(left < shown, v[np.arange(len(s)), np.minimum(left, shown - 1)], 0.0)
            worst = np.maximum(worst, own)
            speed = np.where(left < first, own + (0.0 if self.leaves else _OFF), speed)
        speed = speed + 10.0 * np.maximum(worst - self.most, 0.0)
        speed = np.where(np.abs(driven.chi).max(axis=1) > _ABEAM, speed + _OFF, speed)
        return speed, speed

    @cached_property
    def _moving(self) -> Points:
        shapes = self.problem.shapes
        assert shapes is not None
        return velocities(shapes, self._times)
