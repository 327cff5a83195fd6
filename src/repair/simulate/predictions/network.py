"""The lanelets of a map, laid out once: which of them somebody is on, and the way that goes on from there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from repair.arrays import Array, wrap
from repair.scene.road.lanes import Lane

__all__ = ["Network", "Way"]

_APART = 1e-6  # points of a line that are nearer to each other are one [m]


@dataclass(frozen=True, eq=False)
class Way:
    """A polyline, ready to be gone along.

    Attributes
    ----------
    line : (M, 2) array
        [m].
    unit : (M - 1, 2) array
        Directions of its pieces.
    reached : (M,) array
        Arc lengths of its points [m].
    middles, headings : (M - 1,) array
        Arc lengths of its pieces' middles [m], and their headings, continuous [rad].
    """

    line: Array
    unit: Array
    reached: Array
    middles: Array
    headings: Array

    @classmethod
    def through(cls, points: Array) -> Way:
        """Through points (M, 2) [m]; those that are there twice are one."""
        line = points[np.append(True, np.hypot(*np.diff(points, axis=0).T) > _APART)]
        step = np.diff(line, axis=0)
        length = np.hypot(*step.T)
        reached, unit = np.append(0.0, np.cumsum(length)), step / length[:, None]
        headings = np.unwrap(np.arctan2(unit[:, 1], unit[:, 0]))
        return cls(line, unit, reached, 0.5 * (reached[1:] + reached[:-1]), headings)

    def at(self, arcs: Array) -> tuple[Array, Array]:
        """Points (T, 2) and headings (T,) at arc lengths; beyond its end it goes straight on."""
        index = self.reached.searchsorted(arcs, side="right") - 1
        index = np.minimum(np.maximum(index, 0), len(self.unit) - 1)
        points = self.line[index] + (arcs - self.reached[index])[:, None] * self.unit[index]
        return points, np.interp(arcs, self.middles, self.headings)


class Network(Mapping[int, Lane]):
    """Lanelets by id, with what is asked of them for everybody in every cycle.

    Parameters
    ----------
    lanes : mapping
    """

    def __init__(self, lanes: Mapping[int, Lane]) -> None:
        self._lanes = dict(lanes)
        self._listed = list(self._lanes.values())
        lines = [lane.center for lane in self._listed]
        none = np.empty((0, 2))
        self._low = np.array([line.min(axis=0) for line in lines]) if lines else none
        self._high = np.array([line.max(axis=0) for line in lines]) if lines else none
        # The pieces of all centre lines, one after the other, and which are those of each
        start = np.concatenate([line[:-1] for line in lines]) if lines else none
        step = np.concatenate([np.diff(line, axis=0) for line in lines]) if lines else none
        square = np.maximum(np.sum(step**2, axis=1), 1e-12)
        self._table = np.ascontiguousarray(np.vstack([start.T, step.T, square]))
        self._length = np.sqrt(square)
        ends = np.cumsum([len(line) - 1 for line in lines], dtype=np.intp).tolist()
        self._pieces = [np.arange(end - len(line) + 1, end) for end, line in zip(ends, lines, strict=True)]
        self._chains: dict[int, list[tuple[float, tuple[Lane, ...]]]] = {}
        self._ways: dict[tuple[int, int], Way] = {}

    def __getitem__(self, name: int) -> Lane:
        return self._lanes[name]

    def __iter__(self) -> Iterator[int]:
        return iter(self._lanes)

    def __len__(self) -> int:
        return len(self._lanes)

    def beside(
        self, point: Array, heading: float, aside: float, turned: float
    ) -> tuple[Lane, float, float] | None:
        """The lanelet whose centre line is nearest among those that lead somebody's way, and the place on it.

        As :func:`repair.scene.road.lanes.locate` has it, of all that are near in one go.

        Parameters
        ----------
        point : (2,) array
            [m].
        heading : float
            [rad].
        aside, turned : float
            Those farther away [m], or turned by more [rad], do not count.

        Returns
        -------
        (lane, arc, offset) or None
            Arc length along the centre line, and offset from it (left positive) [m].
        """
        inside = (self._low - aside <= point) & (point <= self._high + aside)
        near = np.flatnonzero(inside.all(axis=1)).tolist()
        if not near:
            return None
        x, y = point.tolist()
        begin_x, begin_y, step_x, step_y, square = self._table.take(
            np.concatenate([self._pieces[k] for k in near]), axis=1
        )
        gap_x, gap_y = x - begin_x, y - begin_y
        along = np.minimum(np.maximum((gap_x * step_x + gap_y * step_y) / square, 0.0), 1.0)
        gap_x, gap_y = gap_x - along * step_x, gap_y - along * step_y
        away = gap_x * gap_x + gap_y * gap_y
        best, nearest, first = None, aside, 0
        for k in near:
            pieces, last = self._pieces[k], first + len(self._pieces[k])
            at = first + int(away[first:last].argmin())
            offset = float(np.hypot(gap_x[at], gap_y[at]))
            if offset < nearest and abs(float(wrap(np.arctan2(step_y[at], step_x[at]) - heading))) < turned:
                index = at - first
                arc = self._length[pieces[:index]].sum() + along[at] * self._length[pieces[index]]
                left = step_x[at] * gap_y[at] - step_y[at] * gap_x[at]
                best, nearest = (self._listed[k], float(arc), float(np.copysign(offset, left))), offset
            first = last
        return best

    def way(self, lane: Lane, until: float) -> Way:
        """Along a lanelet and the straightest of each one's successors, so long where the map goes on.

        Parameters
        ----------
        lane : Lane
        until : float
            From its beginning on [m].
        """
        chain = self._chains.setdefault(lane.id, [(lane.length, (lane,))])
        while chain[-1][0] < until:
            length, passed = chain[-1]
            following = self._after(passed)
            if following is None:
                break
            chain.append((length + following.length, (*passed, following)))
        passed = next((passed for length, passed in chain if length >= until), chain[-1][1])
        key = lane.id, len(passed)
        if key not in self._ways:
            self._ways[key] = Way.through(np.concatenate([one.center for one in passed]))
        return self._ways[key]

    def _after(self, passed: tuple[Lane, ...]) -> Lane | None:
        """The straightest successor of the last of some lanelets that is none of them."""
        line, seen = passed[-1].center, {one.id for one in passed}
        after = [self._lanes[i] for i in passed[-1].successors if i in self._lanes and i not in seen]
        end = _overall(line)
        return min(after, key=lambda one: abs(float(wrap(_overall(one.center) - end))), default=None)


def _overall(line: Array) -> float:
    """Heading at a line's end [rad]: where it leads to."""
    return float(np.arctan2(*(line[-1] - line[-2])[::-1]))
