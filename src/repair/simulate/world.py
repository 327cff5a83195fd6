"""The others: what they did, what was known of them at a step, and what is believed of their future."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from repair.arrays import Array
from repair.scene.road.lanes import Lane
from repair.scene.traffic.obstacle import Obstacle
from repair.simulate.predictions.base import Known, Predictor, cut

__all__ = ["Beliefs", "World", "displaced", "widened"]

_STATED = frozenset(
    {"static", "environment", "phantom", "set_based"}
)  # who does not move, or is a set of places
_MOVES = 0.5  # who is believed to move by less is believed to stand [m]


@dataclass(frozen=True, eq=False)
class World:
    """Recorded traffic, from a while after the record's beginning on. It does not react.

    Attributes
    ----------
    obstacles : tuple of Obstacle
        All rows of the record.
    dt : float
        [s].
    n_steps : int
        Steps of the drive.
    shift : int
        By how many steps the drive begins later than the record.
    lanes : mapping
        The lanelets, by id.
    """

    obstacles: tuple[Obstacle, ...]
    dt: float
    n_steps: int
    shift: int = 0
    lanes: Mapping[int, Lane] = field(default_factory=dict)

    def since(self, step: int, until: int) -> list[Obstacle]:
        """What truly happens from a step of the drive to another, both included."""
        found = (cut(o, self.shift + step, self.shift + until) for o in self.obstacles)
        return [o for o in found if np.isfinite(o.vertices).any()]


@dataclass(eq=False)
class Beliefs:
    """What one prediction says, made once for each step of the record.

    Attributes
    ----------
    world : World
    predictor : Predictor
    lookahead : int
        [steps].
    """

    world: World
    predictor: Predictor
    lookahead: int
    _made: dict[int, dict[int, Obstacle | None]] = field(default_factory=dict)

    def ahead(self, step: int) -> int:
        """How far is looked at a step of the drive [steps]: never beyond the record's end."""
        return min(self.lookahead, self.world.n_steps - step)

    def at(self, step: int) -> tuple[Obstacle, ...]:
        """Everybody from a step of the drive on, over ``ahead(step) + 1`` rows."""
        return self.around(step, np.full(2, -np.inf), np.full(2, np.inf), 0.0)

    def around(self, step: int, low: Array, high: Array, reach: float) -> tuple[Obstacle, ...]:
        """As :meth:`at`, but for some of those who surely stay farther from a rectangle than ``reach`` [m].

        Parameters
        ----------
        step : int
        low, high : (2,) array
            Smallest and largest x and y of the rectangle [m].
        reach : float
            Between an outline and the rectangle.
        """
        made, now, ahead = self._made.setdefault(step, {}), self.world.shift + step, self.ahead(step)
        (left, bottom), (right, top) = low.tolist(), high.tolist()
        for k, record in enumerate(self.world.obstacles):
            if k in made:
                continue
            place = self._stays_within(record, now, ahead)
            if place is not None:
                x, y, room = place
                if not (left <= x + room + reach and x - room - reach <= right):
                    continue
                if not (bottom <= y + room + reach and y - room - reach <= top):
                    continue
            one = self._one(record, now, ahead)
            made[k] = one if one is not None and bool(np.isfinite(one.vertices).any()) else None
        return tuple(one for _, one in sorted(made.items()) if one is not None)

    def _stays_within(self, record: Obstacle, now: int, n_steps: int) -> tuple[float, float, float] | None:
        """A circle that somebody is believed not to leave: x, y and radius [m]; None: nobody knows."""
        if not getattr(self.predictor, "at_the_speed_of_now", False) or record.role in _STATED:
            return None
        x, y, _, speed = record.states[now].tolist()
        if record.polygons or not math.isfinite(x + y + speed):
            return None
        outline = record.vertices[now]
        size = float(np.hypot(outline[:, 0] - x, outline[:, 1] - y).max())
        return x, y, size + abs(speed) * n_steps * self.world.dt

    def _one(self, record: Obstacle, now: int, n_steps: int) -> Obstacle | None:
        if record.role in _STATED:
            return cut(record, now, now + n_steps)
        looks_ahead = getattr(self.predictor, "looks_ahead", False)
        if not looks_ahead and not np.isfinite(record.vertices[now]).any():
            return None
        world = self.world
        past = cut(record, 0, now)
        known = Known(past, record if looks_ahead else past, now, world.dt, n_steps, world.lanes)
        return self.predictor.predict(known)


def widened(obstacles: tuple[Obstacle, ...], error: float, dt: float) -> tuple[Obstacle, ...]:
    """Everybody, and everybody who moves ahead of and behind where he is believed to be.

    Parameters
    ----------
    obstacles : tuple of Obstacle
    error : float
        The distance is half of it times t² [m/s²]; nobody is believed to back up.
    dt : float
        [s].
    """
    if error <= 0.0:
        return obstacles
    ways = [(one, way) for one in obstacles if (way := _way(one)) is not None]
    return (*obstacles, *(_displaced(one, way, by, dt) for by in (error, -error) for one, way in ways))


def displaced(obstacles: tuple[Obstacle, ...], error: float, dt: float) -> tuple[Obstacle, ...]:
    """Everybody, who moves ahead of where he is believed to be; behind with a negative error.

    Parameters
    ----------
    obstacles : tuple of Obstacle
    error : float
        The distance is half of it times t² [m/s²]; nobody is believed to back up.
    dt : float
        [s].
    """
    ways = ((one, _way(one)) for one in obstacles)
    return tuple(one if way is None else _displaced(one, way, error, dt) for one, way in ways)


def _way(one: Obstacle) -> tuple[Array, Array] | None:
    """How far an obstacle has come at each step (T,) [m], and its directions (T, 2); None where it stays."""
    places = one.states[:, :2]
    if one.role in _STATED or not np.isfinite(places).all():
        return None
    arc = np.append(0.0, np.cumsum(np.hypot(*(places[1:] - places[:-1]).T)))
    if arc[-1] < _MOVES:
        return None
    heading = np.nan_to_num(one.states[:, 2])
    return arc, np.column_stack([np.cos(heading), np.sin(heading)])


def _displaced(one: Obstacle, way: tuple[Array, Array], error: float, dt: float) -> Obstacle:
    """An obstacle shifted along its headings."""
    arc, direction = way
    off = 0.5 * error * (np.arange(len(arc)) * dt) ** 2
    shift = (np.maximum.accumulate(np.maximum(arc + off, 0.0)) - arc)[:, None] * direction

    def shifted(table: Array) -> Array:
        found = table.copy()
        found[:, :2] += shift
        return found

    return replace(
        one,
        vertices=one.vertices + shift[:, None],
        rectangles=None if one.rectangles is None else shifted(one.rectangles),
        circles=None if one.circles is None else shifted(one.circles),
        polygons=tuple(tuple(p + shift[k] for p in parts) for k, parts in enumerate(one.polygons)),
        states=shifted(one.states),
    )
