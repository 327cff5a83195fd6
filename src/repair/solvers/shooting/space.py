"""How deep trajectories reach into what they must keep out of: obstacles, and what is no road."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from repair.arrays import Array, Points
from repair.problem.problem import RepairProblem
from repair.problem.shapes import Shapes
from repair.solvers.shooting.motion import Driven
from repair.solvers.shooting.plans import Steps
from repair.world.tracks import as_complex

__all__ = ["Space", "depths", "looks"]

_ABEAM = 1.3  # [rad]
_INCH = 1e-3  # a margin that is kept to this is kept [m]
_MOST = 100_000  # places of bodies and obstacles that are compared at once: 1.6 MB for each step of it


@dataclass(frozen=True)
class Space:
    """What a problem's trajectories must keep out of, at every ``fine``-th part of a step.

    True shapes where the problem knows them, and its boxes in (s, l) otherwise.

    Attributes
    ----------
    problem : RepairProblem
    steps : Steps
        Of a trajectory.
    fine : int
        Looks at each step.
    edge : float
        Distance to keep from the end of the lateral room [m].
    """

    problem: RepairProblem
    steps: Steps
    fine: int
    edge: float = 0.0

    @cached_property
    def _times(self) -> Array:
        problem = self.problem
        count, between = self.steps.count * self.fine, self.steps.dt / self.fine
        times = problem.t_rep + between * np.arange(1, count + 1)
        return times[times <= problem.t_end + 0.5 * between]

    @cached_property
    def _rectangles(self) -> Array:
        shapes = self.problem.shapes
        assert shapes is not None
        return shapes.at(self._times)

    @cached_property
    def _room(self) -> Array:
        """By how much the ego is enlarged for each obstacle (M,): not where it is that near already."""
        problem, shapes = self.problem, self.problem.shapes
        assert shapes is not None
        now = shapes.at(np.array([problem.t_rep]))
        rows, columns = np.isfinite(now[..., 0]).nonzero()
        room = np.full(len(now), shapes.room + _INCH)
        if len(rows):
            s, l = problem.start[0]  # noqa: E741
            centre = shapes.frame.to_cartesian(s, l).view(np.complex128)
            heading = np.atleast_1d(shapes.frame.heading(s))
            depth = depths(
                np.broadcast_to(centre, (1, len(rows))), np.broadcast_to(heading, (1, len(rows))),
                now[rows, columns], shapes, room[rows],
            )[0]  # fmt: skip
            room[rows[depth > 0.0]] = 0.0
        return room

    def excess(self, driven: Driven) -> tuple[Array, Array]:
        """How far into obstacles and beyond the road, in metres times looks, and at most in metres (N,)."""
        s, l, chi, beta = looks(self.problem, driven, self.steps.dt, self.fine)  # noqa: E741
        shown = len(self._times)
        s, l, chi, beta = s[:, :shown], l[:, :shown], chi[:, :shown], beta[:, :shown]  # noqa: E741
        if self.problem.shapes is None:
            total, most = self._in_boxes(s, l)
        else:
            total, most = self._in_shapes(s, l, chi - beta, self.problem.shapes)
        total, most = total + _lost(driven), most + _lost(driven)
        if self.problem.lateral:
            beyond = self._off_road(s, l, chi - beta)
            total = total + beyond.sum(axis=1) / self.fine
            most = np.maximum(most, beyond.max(axis=1, initial=0.0))
        return total, most

    def overload(self, driven: Driven) -> Array:
        """By how much who keeps to the axis is too fast for its bends (N,) [m/s²]."""
        problem, limits = self.problem, self.problem.limits
        shapes, s = problem.shapes, driven.s
        kappa = problem.curvature_at(s) if shapes is None else shapes.frame.curvature(s)
        across: Array = np.abs(kappa) * driven.v**2
        both = np.maximum(across[:, :-1], across[:, 1:])
        both = np.maximum(np.hypot(both, driven.a) - limits.a_total, both - limits.a_lat)
        fastest: Array = np.maximum(both, 0.0).max(axis=1, initial=0.0)
        return fastest

    def off_the_map(self, driven: Driven) -> Array:
        """At how many looks the ego leaves the road itself (N,), of which the lateral room is a table."""
        shapes = self.problem.shapes
        if shapes is None or shapes.road is None:
            return np.zeros(len(driven.s))
        s, l, chi, beta = looks(self.problem, driven, self.steps.dt, self.fine)  # noqa: E741
        x, y = shapes.frame.to_cartesian(s, l).reshape(-1, 2).T
        inside = shapes.road.inside(shapes.road.outline(x, y, (shapes.frame.heading(s) + chi - beta).ravel()))
        off: Array = np.count_nonzero(~inside.reshape(s.shape), axis=1).astype(np.float64)
        return off

    def _in_shapes(self, s: Array, l: Array, turned: Array, shapes: Shapes) -> tuple[Array, Array]:  # noqa: E741
        plane = shapes.frame.to_cartesian(s, l)
        centre = as_complex(plane[..., 0], plane[..., 1])
        heading = shapes.frame.heading(s) + turned
        boxes = self._rectangles
        # Only who may be met by some trajectory at that time is looked at.
        reach = shapes.vehicle.radius + shapes.room + np.hypot(boxes[..., 3], boxes[..., 4])
        away = [
            np.maximum(low.min(axis=0) - at, at - low.max(axis=0))
            for low, at in ((centre.real, boxes[..., 0]), (centre.imag, boxes[..., 1]))
        ]
        track, look = ((away[0] < reach) & (away[1] < reach)).nonzero()
        if not len(track):
            none = np.zeros(len(s))
            return none, none
        depth = np.empty((len(s), len(look)))
        for part in _parts(len(look), _MOST // len(s)):  # what is made on the way is several times as large
            who, when = track[part], look[part]
            depth[:, part] = depths(
                centre[:, when], heading[:, when], boxes[who, when], shapes, self._room[who]
            )
        return depth.sum(axis=1) / self.fine, depth.max(axis=1)

    def _in_boxes(self, s: Array, l: Array) -> tuple[Array, Array]:  # noqa: E741
        occupancy, margin = self.problem.occupancy, self.problem.margin
        if not len(occupancy):
            none = np.zeros(len(s))
            return none, none
        lower, upper = occupancy.at(self._times)
        place = np.stack((s, l), axis=-1)[:, None]
        depth = np.minimum(place - lower + margin, upper + margin - place).min(axis=-1)
        depth = np.maximum(np.nan_to_num(depth), 0.0)
        return depth.sum(axis=(1, 2)) / self.fine, depth.max(axis=(1, 2))

    def _off_road(self, s: Array, l: Array, turned: Array) -> Array:  # noqa: E741
        """How far the ego's corner that is farthest out is beyond the lateral room."""
        problem, shapes = self.problem, self.problem.shapes
        length, width = (shapes.vehicle.half_length, shapes.vehicle.half_width) if shapes else (0.0, 0.0)
        kappa = problem.curvature_at(s)
        cos, sin = np.cos(turned), np.sin(turned)
        beyond = np.zeros_like(s)
        for ahead, aside in ((1, 1), (1, -1), (-1, 1), (-1, -1)) if shapes else ((0, 0),):
            along = ahead * length * cos - aside * width * sin
            across = l + ahead * length * sin + aside * width * cos - 0.5 * kappa * along * along
            right, left = problem.bounds.at(s + along / (1.0 - kappa * l))
            spare = width - self.edge
            np.maximum(beyond, right - spare - across, out=beyond)
            np.maximum(beyond, across - left - spare, out=beyond)
        return beyond


def _parts(count: int, most: int) -> Iterator[slice]:
    """``count`` things in parts of at most ``most``."""
    step = max(most, 1)
    return (slice(k, k + step) for k in range(0, count, step))


def _lost(driven: Driven) -> Array:
    """How far trajectories (N,) turn beyond the side of the axis, where they have no coordinates."""
    return np.asarray(np.maximum(np.abs(driven.chi) - _ABEAM, 0.0).max(axis=1))


def looks(problem: RepairProblem, driven: Driven, dt: float, fine: int) -> tuple[Array, Array, Array, Array]:
    """s, l, chi and beta (N, T fine) within and at the end of the steps: cubics and lines."""
    s, l, v, chi, beta = driven[:5]  # noqa: E741
    along = v * np.cos(chi) / (1.0 - problem.curvature_at(s) * l)
    found = np.empty((4, len(s), s.shape[1] - 1, fine))
    shares = [(k + 1) / fine for k in range(fine)]
    for out, value, slope in ((found[0], s, along), (found[1], l, v * np.sin(chi))):
        begin, change = value[:, :-1], np.diff(value)
        first, last = dt * slope[:, :-1], dt * slope[:, 1:]
        bend, rest = 3.0 * change - 2.0 * first - last, first + last - 2.0 * change
        for k, x in enumerate(shares):
            out[..., k] = begin + x * (first + x * (bend + x * rest))
    for out, value in ((found[2], chi), (found[3], beta)):
        change = np.diff(value)
        for k, x in enumerate(shares):
            out[..., k] = value[:, :-1] + x * change
    s, l, chi, beta = found.reshape(4, len(s), -1)  # noqa: E741
    return s, l, chi, beta


def depths(centre: Points, heading: Array, boxes: Array, shapes: Shapes, room: Array) -> Array:
    """By how much the ego (N, P), enlarged by ``room`` (P,), reaches into rectangles (P, 5): at least 0.

    Along the axis that leaves most (separating axes).
    """
    length, width = shapes.vehicle.half_length + room, shapes.vehicle.half_width + room
    x, y, direction, half_length, half_width = boxes.T
    away = as_complex(x, y) - centre
    turn = np.exp(1j * (direction - heading))
    axis = np.exp(-1j * direction)
    theirs = away * axis
    mine = theirs * turn
    cos, sin = np.abs(turn.real), np.abs(turn.imag)
    gap = np.abs(mine.real) - (length + half_length * cos + half_width * sin)
    np.maximum(gap, np.abs(mine.imag) - (width + half_length * sin + half_width * cos), out=gap)
    np.maximum(gap, np.abs(theirs.real) - (half_length + length * cos + width * sin), out=gap)
    np.maximum(gap, np.abs(theirs.imag) - (half_width + length * sin + width * cos), out=gap)
    return np.asarray(np.maximum(-gap, 0.0))
