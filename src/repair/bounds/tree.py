"""Branch and bound over where and how the body can be: every motion is shown to meet something, or not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.bounds.forbidden import forbidden
from repair.bounds.motion import NEAR, Motions
from repair.bounds.relaxed import Drive, Relaxation, Rows, excess

__all__ = ["Attempt", "Forbidden", "attempt"]

_DEEP = 1e-3  # a place counts as forbidden if it is this far inside [m]
_NARROW = 0.06  # intervals of headings shorter than this are not halved [rad]
_ROUND = 0.01  # places are looked up for intervals of headings with ends on this grid [rad]
_TRIED = 6  # contacts of a relaxed motion whose forbidden places are looked up
_SLACK = 1e-5  # less than this is no sign of anything [m]
_ANGLE = 1e-8  # outwards, against rounding [rad]
_DIGITS = 7  # of multipliers, of which the largest is 1
_PLACES = 6  # decimals of places [m]


@dataclass(frozen=True)
class Forbidden:
    """A polygon of forbidden places at an instant.

    Attributes
    ----------
    instant, column : int
        Of which shape at which instant.
    low, high : float
        Headings for which they are forbidden [rad].
    corners : (V, 2) array
        Anticlockwise, seen from the start [m].
    normals, levels : (V, 2), (V,) array
        Sides: inside is normals @ p <= levels.
    """

    instant: int
    column: int
    low: float
    high: float
    corners: Array
    normals: Array
    levels: Array


@dataclass
class Attempt:
    """What came of trying to prove that every motion meets something.

    Attributes
    ----------
    proven : bool
    nodes : int
        Looked at.
    tree : dict or None
        The proof (docs/bound.md has its form); None where there is none.
    cuts : list of Forbidden
        To which the tree refers by place.
    shapes : list of (K, 2) arrays
        The shape of each cut, seen from the start [m].
    open : (I, 2) array or None
        Places of a relaxed motion that meets nothing that is known, where that ended the attempt.
    """

    proven: bool
    nodes: int = 0
    tree: dict[str, Any] | None = None
    cuts: list[Forbidden] = field(default_factory=list)
    shapes: list[Array] = field(default_factory=list)
    open: Array | None = None


@dataclass(frozen=True)
class _Node:
    """Rows about places (cut, side, +1 outside or -1 inside), headings, and where its proof goes."""

    places: tuple[tuple[int, int, int], ...]
    low: Array
    high: Array
    narrowed: npt.NDArray[np.bool_]
    into: dict[str, Any]


class _Search:
    """One attempt."""

    def __init__(self, motions: Motions, times: Array, shapes: Array) -> None:
        self.motions, self.times = motions, times
        self.relaxed = Relaxation(motions, times)
        self.turning = motions.turning(times)
        self.reach = 0.5 * motions.acceleration * times**2
        self.cuts: list[Forbidden] = []
        self._known: dict[tuple[int, int, float, float], int | None] = {}
        shapes = np.round(shapes - motions.position, _PLACES)
        middle = shapes.mean(axis=2)
        size = np.hypot(*np.moveaxis(shapes - middle[:, :, None], 3, 0)).max(axis=2)
        away = np.hypot(*np.moveaxis(middle - self.relaxed.free[:, None], 2, 0)) - size
        near = (away <= (self.reach + motions.reach)[:, None]).any(axis=0)
        self.columns = np.flatnonzero(near)
        self.shapes = shapes[:, self.columns]
        self.there = np.isfinite(self.shapes[:, :, 0, 0])
        way = np.roll(self.shapes, -1, axis=2) - self.shapes
        length = np.hypot(way[..., 0], way[..., 1])
        real = length > 1e-9
        with np.errstate(invalid="ignore"):
            normal = np.stack((way[..., 1], -way[..., 0]), axis=-1) / np.where(real, length, 1.0)[..., None]
        self.normal = np.where(real[..., None], normal, 0.0)
        self.level = np.where(real, np.sum(normal * self.shapes, axis=-1), np.inf)

    def run(self, limit: int, late: Callable[[], bool]) -> Attempt:
        root: dict[str, Any] = {}
        none = np.zeros(len(self.times), dtype=np.bool_)
        stack = [_Node((), self.turning.low, self.turning.high, none, root)]
        nodes = 0
        while stack:
            node = stack.pop()
            nodes += 1
            if nodes > limit or late():
                return Attempt(False, nodes)
            rows, drive = self._rows(node), self._drive(node)
            place, velocity, slack, multipliers = self.relaxed.solve(rows, drive)
            if slack > _SLACK and self._closed(node, rows, drive, multipliers):
                continue
            children = self._branch(node, place, velocity, slack)
            if children is None:
                return Attempt(False, nodes, open=place + self.motions.position)
            stack += children
        column = {c: m for m, c in enumerate(self.columns.tolist())}
        shapes = [self.shapes[c.instant, column[c.column]] for c in self.cuts]
        return Attempt(True, nodes, root, self.cuts, shapes)

    # -- rows -------------------------------------------------------------------------------------------

    def _rows(self, node: _Node) -> Rows:
        cuts = self.cuts
        instant = np.array([cuts[c].instant for c, _, _ in node.places], dtype=np.intp)
        if len(node.places):
            sign = np.array([s for _, _, s in node.places], dtype=np.float64)
            direction = np.array([cuts[c].normals[k] for c, k, _ in node.places]) * sign[:, None]
            level = np.array([cuts[c].levels[k] for c, k, _ in node.places]) * sign
        else:
            direction, level = np.empty((0, 2)), np.empty(0)
        slip = self.turning.slip
        low, high = node.low - slip, node.high + slip
        turned = np.flatnonzero(node.narrowed & (high - low < np.pi))
        low, high = low[turned], high[turned]
        left = np.stack((-np.sin(low), np.cos(low)), axis=1)
        right = np.stack((np.sin(high), -np.cos(high)), axis=1)
        moving = np.zeros(len(instant) + 2 * len(turned), dtype=np.bool_)
        moving[len(instant) :] = True
        return Rows(
            np.concatenate((instant, turned, turned)),
            np.concatenate((direction, left, right)),
            np.concatenate((level, np.zeros(2 * len(turned)))),
            moving,
        )

    def _drive(self, node: _Node) -> Drive:
        """Bounds along the middle of the courses that are possible in each piece."""
        turning, most = self.turning, self.motions.acceleration
        between = np.diff(turning.turned)
        slip = turning.slip[1:]
        low = 0.5 * (node.low[1:] + node.low[:-1] - between) - slip
        high = 0.5 * (node.high[1:] + node.high[:-1] + between) + slip
        low = np.maximum(low, turning.course - turning.veer[1:])
        high = np.minimum(high, turning.course + turning.veer[1:])
        middle, half = 0.5 * (low + high), np.maximum(0.5 * (high - low), 0.0)
        bounds = (
            most * np.sin(np.minimum(np.arcsin(np.minimum(b / most, 1.0)) + half, 0.5 * np.pi))
            for b in (turning.forward, turning.braking)
        )
        return Drive(np.stack((np.cos(middle), np.sin(middle)), axis=1), *bounds)

    def _closed(self, node: _Node, rows: Rows, drive: Drive, multipliers: Array) -> bool:
        most = multipliers.max(initial=0.0)
        if not most > 0.0:  # the solver gave up: that closes nothing
            return False
        share = np.round(multipliers / most, _DIGITS)
        if not excess(self.motions, self.times, rows, drive, share) > 0.0:
            return False
        turned = (len(share) - len(node.places)) // 2
        names: list[tuple[Any, ...]] = [("place", *place) for place in node.places]
        instants = rows.instant[len(node.places) :].tolist()
        slip = self.turning.slip
        names += [("course", i, 0, float(node.low[i] - slip[i])) for i in instants[:turned]]
        names += [("course", i, 1, float(node.high[i] + slip[i])) for i in instants[turned:]]
        node.into["close"] = [[*name, float(m)] for name, m in zip(names, share, strict=True) if m > 0.0]
        return True

    # -- branching --------------------------------------------------------------------------------------

    def _branch(self, node: _Node, place: Array, velocity: Array, slack: float) -> list[_Node] | None:
        deep = _DEEP + slack  # what it breaks within the slack would only be met again
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        course += 2.0 * np.pi * np.round((0.5 * (node.low + node.high) - course) / (2.0 * np.pi))
        heading = np.clip(course, node.low, node.high)
        depth = self._depths(place, heading)
        met = np.argwhere(depth > deep)
        if not len(met):
            return None
        score = depth[met[:, 0], met[:, 1]] / (self.reach[met[:, 0]] + 0.05)
        order = met[np.argsort(-score)]
        best, found = 0.0, -1
        i, m = order[:_TRIED].T
        # The body is no deeper in what is forbidden for all headings than in what is for one of them.
        deepest = np.min(
            [self._deep(place[i], h[i], self.normal[i, m], self.level[i, m], self.shapes[i, m])
             for h in (heading, node.low, node.high)], axis=0,
        )  # fmt: skip
        for (i, m), most in zip(order[:_TRIED].tolist(), deepest.tolist(), strict=True):
            if most <= deep or most / (self.reach[i] + 0.05) <= best:
                continue
            cut = self._cut(i, m, float(node.low[i]), float(node.high[i]))
            if cut is None:
                continue
            c = self.cuts[cut]
            inside = float(np.min(c.levels - c.normals @ place[i]))
            if inside > deep and inside / (self.reach[i] + 0.05) > best:
                best, found = inside / (self.reach[i] + 0.05), cut
        if found >= 0:
            return self._outside(node, found, place)
        for i, _ in order.tolist():
            if node.high[i] - node.low[i] > _NARROW:
                return self._halved(node, i, float(heading[i]))
        return None

    def _depths(self, place: Array, heading: Array) -> Array:
        """How deep the body is in each shape at each instant (I, M) [m]; negative where it is clear."""
        deep = self._deep(place[:, None], heading[:, None], self.normal, self.level, self.shapes)
        return np.where(self.there, deep, -np.inf)

    def _deep(self, place: Array, heading: Array, normal: Array, level: Array, shape: Array) -> Array:
        """The same (...) of places (..., 2), headings (...), and the sides (..., K) of shapes (..., K, 2)."""
        corners, c, s = self.motions.corners, np.cos(heading)[..., None], np.sin(heading)[..., None]
        x = place[..., :1] + c * corners[:, 0] - s * corners[:, 1]  # (..., 4)
        y = place[..., 1:] + s * corners[:, 0] + c * corners[:, 1]
        least = np.min(normal[..., :1] * x[..., None, :] + normal[..., 1:] * y[..., None, :], axis=-1)
        depth = np.min(level - least, axis=-1)
        away = shape - place[..., None, :]
        u = c * away[..., 0] + s * away[..., 1]
        w = c * away[..., 1] - s * away[..., 0]
        low, high = corners.min(axis=0), corners.max(axis=0)
        for seen, a, b in ((u, low[0], high[0]), (w, low[1], high[1])):
            depth = np.minimum(depth, np.minimum(seen.max(axis=-1) - a, b - seen.min(axis=-1)))
        return np.asarray(depth)

    def _cut(self, i: int, m: int, low: float, high: float) -> int | None:
        """Place in ``cuts`` of the polygon for a shape at an instant; None where there is none."""
        if high - low >= 2.0 * math.pi:
            low, high = 0.0, 2.0 * math.pi + _ROUND
        low = math.floor((low - _ANGLE) / _ROUND) * _ROUND
        high = math.ceil((high + _ANGLE) / _ROUND) * _ROUND
        key = i, m, round(low, 6), round(high, 6)
        if key not in self._known:
            polygon = forbidden(self.shapes[i, m], self.motions.corners, key[2], key[3])
            self._known[key] = None
            if polygon is not None:
                polygon = np.round(polygon, _PLACES)
                way = np.roll(polygon, -1, axis=0) - polygon
                normals = np.stack((way[:, 1], -way[:, 0]), axis=1) / np.hypot(*way.T)[:, None]
                levels = np.sum(normals * polygon, axis=1)
                self._known[key] = len(self.cuts)
                column = int(self.columns[m])
                self.cuts.append(Forbidden(i, column, key[2], key[3], polygon, normals, levels))
        return self._known[key]

    def _outside(self, node: _Node, cut: int, place: Array) -> list[_Node]:
        """One child for each side beyond which the reference point may be, each inside of those before."""
        c = self.cuts[cut]
        i = c.instant
        off = NEAR.place + NEAR.speed * self.times[i] + _SLACK  # as Relaxation and excess have it
        far = c.normals @ self.relaxed.free[i] + self.reach[i] + off < c.levels
        # who cannot get beyond a side needs no row; the nearest side last, which is first on the stack
        order = np.argsort(c.normals @ place[i] - c.levels)
        sides = [*np.flatnonzero(far).tolist(), *(k for k in order.tolist() if not far[k])]
        node.into["cut"], node.into["sides"] = cut, sides
        node.into["children"] = parts = [_part() for _ in sides]
        children: list[_Node] = []
        inside: tuple[tuple[int, int, int], ...] = ()
        for side, into in zip(sides, parts, strict=True):
            if far[side]:
                into["close"] = [["place", cut, side, 1, 1.0]]
                continue
            places = (*node.places, *inside, (cut, side, 1))
            children.append(_Node(places, node.low, node.high, node.narrowed, into))
            inside = (*inside, (cut, side, -1))
        return children

    def _halved(self, node: _Node, i: int, heading: float) -> list[_Node]:
        low, high = float(node.low[i]), float(node.high[i])
        share = 0.3 * (high - low)
        at = round(min(max(heading, low + share), high - share), 4)
        node.into["split"], node.into["at"] = i, at
        node.into["children"] = parts = [_part(), _part()]
        turned = np.abs(self.turning.turned - self.turning.turned[i])
        children: list[_Node] = []
        for into, (a, b) in zip(parts, ((low, at), (at, high)), strict=True):
            new_low = np.maximum(node.low, a - turned - _ANGLE)
            new_high = np.minimum(node.high, b + turned + _ANGLE)
            narrowed = node.narrowed | (new_low > node.low + 1e-9) | (new_high < node.high - 1e-9)
            if (new_low > new_high).any():
                into["empty"] = True
                continue
            children.append(_Node(node.places, new_low, new_high, narrowed, into))
        return children


def _part() -> dict[str, Any]:
    return {}


def attempt(
    motions: Motions, times: Array, shapes: Array, limit: int = 200, late: Callable[[], bool] = lambda: False
) -> Attempt:
    """Try to prove that every motion meets something.

    Parameters
    ----------
    motions : Motions
    times : (I,) array
        Instants since the start [s], 0 the first, evenly spaced.
    shapes : (I, M, K, 2) array
        What is occupied then: convex polygons as :class:`repair.bounds.obstacles.Occupied` has them.
    limit : int
        Nodes at most.
    late : callable
        Whether time is up.
    """
    return _Search(motions, times, shapes).run(limit, late)
