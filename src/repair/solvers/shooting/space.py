"""How deep trajectories reach into what they must keep out of: obstacles, and what is no road."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from repair.arrays import Array, Points
from repair.problem.problem import RepairProblem
from repair.problem.shapes import Shapes
from repair.solvers.shooting.motion import Driven, direction
from repair.solvers.shooting.plans import Steps

__all__ = ["Space", "depths", "looks"]

_ABEAM = 1.3  # [rad]
_INCH = 1e-3  # a margin that is kept to this is kept [m]
_MOST = 30_000  # places of bodies and obstacles that are compared at once: what is made on the way stays near


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
    edge, spare : float
        Distance to keep from the end of the lateral room, and more of it from obstacles [m].
    """

    problem: RepairProblem
    steps: Steps
    fine: int
    edge: float = 0.0
    spare: float = 0.0

    #: Whether the excess over one time is part of that over a longer one.
    adds_up: ClassVar[bool] = True

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
        room = np.full(len(now), shapes.room + _INCH + self.spare)
        if len(rows):
            s, l = problem.start[0]  # noqa: E741
            centre = shapes.frame.to_cartesian(s, l).view(np.complex128)
            heading = np.atleast_1d(shapes.frame.heading(s))
            depth = depths(
                np.broadcast_to(centre, (1, len(rows))), np.broadcast_to(heading, (1, len(rows))),
                now[rows, columns], shapes, room[rows],
            )[0]  # fmt: skip
            room[rows[depth > 0.0]] = self.spare
        return room

    def excess(self, driven: Driven) -> tuple[Array, Array]:
        """How far into obstacles and beyond the road, in metres times looks, and at most in metres (N,).

        Parameters
        ----------
        driven : Driven
        """
        # (P, N): what is compared with an obstacle at a look lies together.
        shown = len(self._times)
        s, l, chi, beta = (x.T for x in looks(driven, self.steps.dt, self.fine, shown))  # noqa: E741
        now = slice(0, len(s))
        turned = chi - beta
        cos, sin = direction(turned)
        if self.problem.shapes is None:
            total, most = self._in_boxes(s.T, l.T, now)
        else:
            total, most = self._in_shapes(s, l, cos, sin, self.problem.shapes, now)
        total, most = total + _lost(driven), most + _lost(driven)
        if self.problem.lateral:
            beyond = self._off_road(s, l, cos, sin)
            total = total + beyond.sum(axis=0) / self.fine
            most = np.maximum(most, beyond.max(axis=0, initial=0.0))
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
        if shapes is None or shapes.road is None or not len(driven.s):
            return np.zeros(len(driven.s))
        s, l, chi, beta = looks(driven, self.steps.dt, self.fine)  # noqa: E741
        x, y = np.moveaxis(shapes.frame.to_cartesian(s, l), -1, 0)
        heading, road = shapes.frame.heading(s) + chi - beta, shapes.road
        known = np.array([road.surely_inside(*pose) for pose in zip(x, y, heading, strict=True)])
        row, look = (~known).nonzero()
        inside = road.inside(road.outline(x[row, look], y[row, look], heading[row, look]))
        return np.bincount(row[~inside], minlength=len(s)).astype(np.float64)

    def _in_shapes(
        self, s: Array, l: Array, cos: Array, sin: Array, shapes: Shapes, now: slice  # noqa: E741
    ) -> tuple[Array, Array]:  # fmt: skip
        """Of bodies (P, N), turned out of the axis."""
        (x, y), (tx, ty) = shapes.frame.axis(s)
        x, y = x - l * ty, y + l * tx
        boxes, count = self._rectangles[:, now], s.shape[1]
        # Only who may be met by some trajectory at that time is looked at, and then by whom.
        reach = self._reach[:, now]
        away = [
            np.maximum(low.min(axis=1) - at, at - low.max(axis=1))
            for low, at in ((x, boxes[..., 0]), (y, boxes[..., 1]))
        ]
        track, look = ((away[0] < reach) & (away[1] < reach)).nonzero()
        total, most = np.zeros(count), np.zeros(count)
        for part in _parts(len(look), _MOST // count):
            who, when = track[part], look[part]
            box = boxes[who, when]
            dx, dy = box[:, :1] - x[when], box[:, 1:2] - y[when]
            pair, row = (dx * dx + dy * dy < reach[who, when, None] ** 2).nonzero()
            if not len(pair):
                continue
            k = when[pair]
            mine = cos[k, row], sin[k, row], tx[k, row], ty[k, row]
            heading = mine[2] * mine[0] - mine[3] * mine[1], mine[3] * mine[0] + mine[2] * mine[1]
            turn, halves = box[:, 2], box[:, 3:].T
            depth = _overlap(
                dx[pair, row], dy[pair, row], heading, (np.cos(turn)[pair], np.sin(turn)[pair]),
                halves.take(pair, axis=1), shapes, self._room[who][pair],
            )  # fmt: skip
            total += np.bincount(row, depth, count)
            np.maximum.at(most, row, depth)
        return total / self.fine, most

    @cached_property
    def _reach(self) -> Array:
        """How far from the ego's centre those of the rectangles (M, P) are that it may meet [m]."""
        shapes, sides = self.problem.shapes, self._rectangles[..., 3:]
        assert shapes is not None
        car, room = shapes.vehicle, shapes.room + _INCH + self.spare
        own = np.hypot(car.half_length + room, car.half_width + room)
        return np.asarray(own + np.hypot(sides[..., 0], sides[..., 1]))

    def _in_boxes(self, s: Array, l: Array, now: slice) -> tuple[Array, Array]:  # noqa: E741
        occupancy, margin = self.problem.occupancy, self.problem.margin
        if not len(occupancy):
            none = np.zeros(len(s))
            return none, none
        lower, upper = occupancy.at(self._times[now])
        place = np.stack((s, l), axis=-1)[:, None]
        depth = np.minimum(place - lower + margin, upper + margin - place).min(axis=-1)
        depth = np.maximum(np.nan_to_num(depth), 0.0)
        return depth.sum(axis=(1, 2)) / self.fine, depth.max(axis=(1, 2))

    def _off_road(self, s: Array, l: Array, cos: Array, sin: Array) -> Array:  # noqa: E741
        """How far the ego's corners are beyond the lateral room, each on its own side."""
        problem, shapes = self.problem, self.problem.shapes
        length, width = (shapes.vehicle.half_length, shapes.vehicle.half_width) if shapes else (0.0, 0.0)
        beyond, bounds = np.zeros(s.shape), problem.bounds
        spare, flank = width - self.edge, width * cos
        kappa = problem.curvature_at(s)
        scale = 1.0 - kappa * l
        for ahead in (1, -1) if shapes else (0,):
            for side, table in ((1.0, bounds.left), (-1.0, bounds.right)):
                along = ahead * length * cos - side * width * sin
                across = l + ahead * length * sin + side * flank - 0.5 * kappa * along * along
                room = np.interp(s + along / scale, bounds.s, table)
                np.maximum(beyond, side * (across - room) - spare, out=beyond)
        return beyond


def _parts(count: int, most: int) -> Iterator[slice]:
    """``count`` things in parts of at most ``most``."""
    step = max(most, 1)
    return (slice(k, k + step) for k in range(0, count, step))


def _lost(driven: Driven) -> Array:
    """How far trajectories (N,) turn beyond the side of the axis, where they have no coordinates."""
    return np.asarray(np.maximum(np.abs(driven.chi) - _ABEAM, 0.0).max(axis=1))


def looks(driven: Driven, dt: float, fine: int, shown: int | None = None) -> tuple[Array, ...]:
    """s, l, chi and beta (N, P) at the first looks within and at the end of steps: cubics and lines."""
    count, steps = driven.a.shape
    found = np.empty((4, steps, fine, count))
    shares = [(k + 1) / fine for k in range(fine - 1)]
    for out, column, rate in ((found[0], driven.s, driven.along), (found[1], driven.l, driven.aside)):
        value, slope = column.T, dt * rate.T
        begin, change = value[:-1], np.diff(value, axis=0)
        first, last = slope[:-1], slope[1:]
        bend, rest = 3.0 * change - 2.0 * first - last, first + last - 2.0 * change
        for k, x in enumerate(shares):
            out[:, k] = begin + x * (first + x * (bend + x * rest))
        out[:, -1] = value[1:]
    for out, value in ((found[2], driven.chi.T), (found[3], driven.beta.T)):
        change = np.diff(value, axis=0)
        for k, x in enumerate(shares):
            out[:, k] = value[:-1] + x * change
        out[:, -1] = value[1:]
    return tuple(found.reshape(4, steps * fine, count)[:, :shown].transpose(0, 2, 1))


def depths(centre: Points, heading: Array, boxes: Array, shapes: Shapes, room: Array) -> Array:
    """By how much the ego (N, P), enlarged by ``room`` (P,), reaches into rectangles (P, 5): at least 0.

    Along the axis that leaves most (separating axes).
    """
    x, y, turn, half_length, half_width = boxes.T
    body, other = (np.cos(heading), np.sin(heading)), (np.cos(turn), np.sin(turn))
    return _overlap(x - centre.real, y - centre.imag, body, other, (half_length, half_width), shapes, room)


def _overlap(
    dx: Array, dy: Array, body: Sequence[Array], other: Sequence[Array], halves: Sequence[Array] | Array,
    shapes: Shapes, room: Array,
) -> Array:  # fmt: skip
    """As :func:`depths`: of rectangles that are (dx, dy) away, by the directions of both."""
    length, width = shapes.vehicle.half_length + room, shapes.vehicle.half_width + room
    (hx, hy), (ox, oy), (half_length, half_width) = body, other, halves
    cos, sin = np.abs(hx * ox + hy * oy), np.abs(hx * oy - hy * ox)
    gap = np.abs(dx * hx + dy * hy) - (length + half_length * cos + half_width * sin)
    np.maximum(gap, np.abs(dy * hx - dx * hy) - (width + half_length * sin + half_width * cos), out=gap)
    np.maximum(gap, np.abs(dx * ox + dy * oy) - (half_length + length * cos + width * sin), out=gap)
    np.maximum(gap, np.abs(dy * ox - dx * oy) - (half_width + length * sin + width * cos), out=gap)
    return np.asarray(np.maximum(-gap, 0.0))
