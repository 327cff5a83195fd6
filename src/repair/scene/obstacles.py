"""Obstacles of a CommonRoad scenario as plain arrays, one row per time step.

What CommonRoad leaves open is settled here, towards the larger occupancy:

- a shape turns about its own centre, which is then moved by the state (commonroad-io's reading);
- an uncertain position or orientation takes the rectangle that encloses every placement;
- a missing orientation is the direction of motion;
- a dynamic obstacle without a prediction stands where it is (noted);
- a set-based occupancy over [k, k + 1] counts at k and at k + 1;
- after its prediction an obstacle is gone (CommonRoad's own reading), or held, or moves on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from repair.errors import ConfigError, ScenarioError
from repair.types import Array, frozen

__all__ = ["AFTER_PREDICTION", "Obstacle", "last_predicted_step", "obstacles_of"]

AFTER_PREDICTION = ("remove", "hold", "constant_velocity")

_EDGE = 2.0  # outline points are at most this far apart [m]
_CORNERS = 16  # of the polygon circumscribed about a circle


@dataclass(frozen=True)
class Obstacle:
    """Where one obstacle is, for every step k = 0 .. T-1 after the planning problem's start.

    Rows of steps at which it is absent are NaN throughout (``polygons``: an empty tuple).

    Attributes
    ----------
    id : int
        CommonRoad id (not unique: some files give a static and a dynamic obstacle the same).
    kind : str
        CommonRoad obstacle type, such as ``car``.
    role : str
        ``static``, ``dynamic``, ``set_based``, ``phantom`` or ``environment``.
    vertices : (T, V, 2) array
        Outline points [m] for projection: no two neighbours more than 2 m apart, circles
        circumscribed. A row repeats its last point to fill V.
    rectangles : (T, 5) array or None
        ``x, y, heading, half length, half width`` where every occupancy is one rectangle.
    circles : (T, 3) array or None
        ``x, y, radius`` where every occupancy is one circle.
    polygons : tuple of tuple of (m, 2) arrays
        Convex polygons (not closed) whose union is the occupancy, per step, where it is neither of
        the above; otherwise empty.
    states : (T, 4) array
        ``x, y, heading, speed``; for an occupancy without a state its centre and NaN.
    """

    id: int
    kind: str
    role: str
    vertices: Array
    rectangles: Array | None
    circles: Array | None
    polygons: tuple[tuple[Array, ...], ...]
    states: Array

    @property
    def n_steps(self) -> int:
        """Index of the last step; ``vertices`` has one row more."""
        return len(self.vertices) - 1


class _Placed(NamedTuple):
    """One occupancy: exactly one of the three is set; and the state behind it."""

    rectangle: tuple[float, ...] | None
    circle: tuple[float, ...] | None
    polygons: tuple[Array, ...] | None
    state: tuple[float, float, float, float]

    def moved(self, shift: Array) -> _Placed:
        dx, dy = float(shift[0]), float(shift[1])
        return _Placed(
            self.rectangle and (self.rectangle[0] + dx, self.rectangle[1] + dy, *self.rectangle[2:]),
            self.circle and (self.circle[0] + dx, self.circle[1] + dy, self.circle[2]),
            self.polygons and tuple(p + shift for p in self.polygons),
            (self.state[0] + dx, self.state[1] + dy, *self.state[2:]),
        )


# ---------------------------------------------------------------------- shapes


def _interval(value: Any) -> tuple[float, float]:
    """Bounds of an exact or interval value."""
    if hasattr(value, "start") and hasattr(value, "end"):
        return float(value.start), float(value.end)
    return float(value), float(value)


def _box(center: Sequence[float], heading: float, half: Sequence[float]) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=np.float64) * np.asarray(half)
    return np.asarray(center, dtype=np.float64) + corners @ np.array([[c, s], [-s, c]])


def _ring(center: Sequence[float], radius: float) -> Array:
    angle = np.arange(_CORNERS) * 2.0 * np.pi / _CORNERS
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(center, dtype=np.float64) + around * radius / np.cos(np.pi / _CORNERS)


def _convex_parts(vertices: Array) -> tuple[Array, ...]:
    """Convex polygons (not closed, counter-clockwise) that make up a simple polygon."""
    import shapely

    outline = shapely.Polygon(vertices)
    hull = outline.convex_hull
    if not outline.is_valid:
        outline = hull
    if hull.area - outline.area <= 1e-6 * max(hull.area, 1e-9):
        parts = [hull]
    else:
        parts = list(shapely.get_parts(shapely.constrained_delaunay_triangles(outline)))
    rings = [np.asarray(shapely.get_coordinates(shapely.normalize(p)))[:-1][::-1] for p in parts if p.area > 0.0]
    if not rings:  # a line or a point: give it a finger's width
        rings = [np.asarray(shapely.get_coordinates(hull.buffer(0.01, quad_segs=2)))[:-1][::-1]]
    return tuple(rings)


def _parts(shape: Any) -> list[Any]:
    """The primitive shapes of a shape."""
    if hasattr(shape, "shapes"):
        return [leaf for member in shape.shapes for leaf in _parts(member)]
    return [shape]


def _center_of(part: Any) -> Array:
    """The point a primitive shape is turned about: its own centre, as commonroad-io does it."""
    return np.asarray(part.center, dtype=np.float64)


def _outlines(shape: Any, position: Array, heading: float) -> list[Array]:
    """Convex outlines of a body shape placed exactly: turned about its own centre, then moved."""
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, s], [-s, c]])
    found: list[Array] = []
    for part in _parts(shape):
        center = _center_of(part)
        if hasattr(part, "radius"):
            found.append(_ring(center + position, float(part.radius)))
        elif hasattr(part, "length"):
            half = (part.length / 2.0, part.width / 2.0)
            found.append(_box(center + position, heading + part.orientation, half))
        else:
            found.extend((p - center) @ turn + center + position for p in _convex_parts(np.asarray(part.vertices)))
    return found


def _place(shape: Any, position: Array, heading: float, speed: float) -> _Placed:
    """A body shape at an exact pose."""
    parts = _parts(shape)
    state = (float(position[0]), float(position[1]), heading, speed)
    part = parts[0]
    if len(parts) == 1 and (hasattr(part, "radius") or hasattr(part, "length")):
        center = _center_of(part) + position
        if hasattr(part, "radius"):
            return _Placed(None, (float(center[0]), float(center[1]), float(part.radius)), None, state)
        half = (float(part.length) / 2.0, float(part.width) / 2.0)
        where = (float(center[0]), float(center[1]), heading + float(part.orientation))
        return _Placed((*where, *half), None, None, state)
    return _Placed(None, None, tuple(_outlines(shape, position, heading)), state)


def _enclosing(shape: Any, area: Any, low: float, high: float, speed: float) -> _Placed:
    """Rectangle around every placement with the position in ``area`` and the heading in [low, high]."""
    heading = (low + high) / 2.0
    spread = min((high - low) / 2.0, np.pi)
    body = np.concatenate(_outlines(shape, np.zeros(2), 0.0))
    radius = np.hypot(body[:, 0], body[:, 1])
    angle = np.arctan2(body[:, 1], body[:, 0])
    # a corner sweeps an arc; its extreme along an axis is inside the arc or at one end
    reach = []
    for axis in (0.0, np.pi / 2, np.pi, -np.pi / 2):
        off = np.abs((angle - axis + np.pi) % (2 * np.pi) - np.pi)
        reach.append(float(np.max(radius * np.cos(np.maximum(off - spread, 0.0)))))
    if hasattr(area, "center") or hasattr(area, "shapes"):
        where = np.concatenate(_outlines(area, np.zeros(2), 0.0))
    else:
        where = np.asarray(area, dtype=np.float64)[None, :2]
    c, s = np.cos(heading), np.sin(heading)
    local = where @ np.array([[c, -s], [s, c]])
    upper = np.max(local, axis=0) + reach[:2]
    lower = np.min(local, axis=0) - reach[2:]
    center = (upper + lower) / 2.0 @ np.array([[c, s], [-s, c]])
    half = (upper - lower) / 2.0
    middle = np.mean(where, axis=0)
    return _Placed(
        (float(center[0]), float(center[1]), heading, float(half[0]), float(half[1])),
        None,
        None,
        (float(middle[0]), float(middle[1]), heading, speed),
    )


def _occupied(shape: Any) -> _Placed:
    """An occupancy that is given in the plane."""
    placed = _place(shape, np.zeros(2), 0.0, np.nan)
    if placed.rectangle:
        return placed._replace(state=(*placed.rectangle[:2], np.nan, np.nan))
    if placed.circle:
        return placed._replace(state=(*placed.circle[:2], np.nan, np.nan))
    middle = np.mean(np.concatenate(placed.polygons or ()), axis=0)
    return placed._replace(state=(float(middle[0]), float(middle[1]), np.nan, np.nan))


# ---------------------------------------------------------------------- states over time


def _position(state: Any) -> Array:
    position = state.position
    if hasattr(position, "center") or hasattr(position, "shapes"):
        return np.mean(np.concatenate(_outlines(position, np.zeros(2), 0.0)), axis=0)
    return np.asarray(position, dtype=np.float64)[:2]


def _attribute(state: Any, name: str) -> Any:
    value = getattr(state, name, None)
    if value is None and name == "velocity":
        return np.nan
    return value


def _headings(states: Sequence[Any]) -> list[tuple[float, float]]:
    """Heading interval of every state; a missing one is the direction of motion."""
    found = [_attribute(s, "orientation") for s in states]
    if all(h is not None for h in found):
        return [_interval(h) for h in found]
    where = np.array([_position(s) for s in states])
    step = np.gradient(where, axis=0) if len(where) > 1 else np.zeros_like(where)
    moving = np.hypot(step[:, 0], step[:, 1]) > 1e-3
    motion = np.arctan2(step[:, 1], step[:, 0])
    if moving.any():
        last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
        motion = motion[np.where(last < 0, int(np.argmax(moving)), last)]
    return [_interval(h) if h is not None else (float(m), float(m)) for h, m in zip(found, motion)]


def _state_occupancy(shape: Any, state: Any, heading: tuple[float, float]) -> _Placed:
    speed = sum(_interval(_attribute(state, "velocity"))) / 2.0
    lateral = getattr(state, "velocity_y", None)
    if lateral is not None:
        speed = float(np.hypot(speed, sum(_interval(lateral)) / 2.0))
    position = state.position
    exact = not (hasattr(position, "center") or hasattr(position, "shapes"))
    if exact and heading[0] == heading[1]:
        return _place(shape, np.asarray(position, dtype=np.float64)[:2], heading[0], speed)
    return _enclosing(shape, position, heading[0], heading[1], speed)


def _steps(value: Any) -> tuple[int, int]:
    low, high = _interval(value)
    return int(np.floor(low)), int(np.ceil(high))


def _timeline(obstacle: Any) -> tuple[dict[int, _Placed], str]:
    """Occupancies by the scenario's own time steps, and the role."""
    prediction = getattr(obstacle, "prediction", None)
    initial = getattr(obstacle, "initial_state", None)
    trajectory = getattr(prediction, "trajectory", None)
    placed: dict[int, _Placed] = {}
    states: dict[int, Any] = {}
    if initial is not None:
        states[_steps(initial.time_step)[0]] = initial
    if trajectory is not None:
        for state in trajectory.state_list:
            states.setdefault(_steps(state.time_step)[0], state)
    if states:
        order = sorted(states)
        shape = obstacle.obstacle_shape
        for step, heading in zip(order, _headings([states[k] for k in order])):
            if getattr(states[step], "hitch_angle", None) is not None:  # a trailer: commonroad-io knows how it trails
                item = _occupied(obstacle.occupancy_at_time(step).shape)
                placed[step] = item._replace(state=_state_occupancy(shape, states[step], heading).state)
            else:
                body = shape if trajectory is None or step == order[0] else prediction.shape
                placed[step] = _state_occupancy(body, states[step], heading)
    if prediction is not None and trajectory is None:
        for occupancy in prediction.occupancy_set:
            low, high = _steps(occupancy.time_step)
            item = _occupied(occupancy.shape)
            for step in range(low, high + 1):
                before = placed.get(step)
                placed[step] = item if before is None else _union(before, item)
        return placed, "phantom" if initial is None else "set_based"
    return placed, "dynamic"


def _polygons(item: _Placed) -> tuple[Array, ...]:
    if item.rectangle:
        return (_box(item.rectangle[:2], item.rectangle[2], item.rectangle[3:]),)
    if item.circle:
        return (_ring(item.circle[:2], item.circle[2]),)
    return item.polygons or ()


def _union(first: _Placed, second: _Placed) -> _Placed:
    if not (first.polygons or second.polygons) and first == second:
        return first
    return _Placed(None, None, _polygons(first) + _polygons(second), second.state)


def _subdivided(corners: Array) -> Array:
    step = np.roll(corners, -1, axis=0) - corners
    count = np.maximum(np.ceil(np.hypot(step[:, 0], step[:, 1]) / _EDGE), 1).astype(int)
    pieces = [c + np.arange(n)[:, None] / n * d for c, n, d in zip(corners, count, step)]
    return np.concatenate(pieces)


# ---------------------------------------------------------------------- arrays


def _filled(
    rows: list[_Placed | None], after: str, dt: float, *, before_last: _Placed | None = None
) -> list[_Placed | None]:
    """Continue past the last known row."""
    known = [k for k, row in enumerate(rows) if row is not None]
    if after == "remove" or not known:
        return rows
    last = known[-1]
    item = rows[last]
    assert item is not None
    previous = rows[last - 1] if last > 0 else before_last
    shift = np.zeros(2)
    if after == "constant_velocity":
        if np.isfinite(item.state[3]) and np.isfinite(item.state[2]):
            shift = item.state[3] * dt * np.array([np.cos(item.state[2]), np.sin(item.state[2])])
        elif previous is not None:
            shift = np.subtract(item.state[:2], previous.state[:2])
    return [row if k <= last else item.moved((k - last) * shift) for k, row in enumerate(rows)]


def _arrays(name: int, kind: str, role: str, rows: Sequence[_Placed | None], static_rows: int = 0) -> Obstacle:
    """Stack rows into an obstacle; a single row is repeated ``static_rows`` times without copying."""
    present = [row for row in rows if row is not None]
    rectangles = circles = None
    polygons: tuple[tuple[Array, ...], ...] = ()
    if all(row.rectangle for row in present):
        rectangles = np.array([row.rectangle if row else (np.nan,) * 5 for row in rows], dtype=np.float64)
    elif all(row.circle for row in present):
        circles = np.array([row.circle if row else (np.nan,) * 3 for row in rows], dtype=np.float64)
    else:
        polygons = tuple(tuple(frozen(p) for p in _polygons(row)) if row else () for row in rows)
    outlines = [np.concatenate([_subdivided(p) for p in _polygons(row)]) if row else None for row in rows]
    width = max(len(o) for o in outlines if o is not None)
    vertices = np.full((len(rows), width, 2), np.nan)
    for k, outline in enumerate(outlines):
        if outline is not None:
            vertices[k, : len(outline)] = outline
            vertices[k, len(outline) :] = outline[-1]
    states = np.array([row.state if row else (np.nan,) * 4 for row in rows], dtype=np.float64)
    made = Obstacle(
        name, kind, role, frozen(vertices), None if rectangles is None else frozen(rectangles),
        None if circles is None else frozen(circles), polygons, frozen(states),
    )  # fmt: skip
    return _repeated(made, static_rows) if static_rows else made


def _repeated(obstacle: Obstacle, count: int) -> Obstacle:
    def wide(array: Array | None) -> Array | None:
        return None if array is None else np.broadcast_to(array[0], (count, *array.shape[1:]))

    return replace(
        obstacle,
        vertices=wide(obstacle.vertices),
        rectangles=wide(obstacle.rectangles),
        circles=wide(obstacle.circles),
        polygons=obstacle.polygons * count,
        states=wide(obstacle.states),
    )


def _checked(name: int, placed: Iterable[_Placed]) -> None:
    for item in placed:
        numbers = [*(item.rectangle or ()), *(item.circle or ()), *item.state[:2]]
        finite = np.isfinite(numbers).all() and all(np.isfinite(p).all() for p in item.polygons or ())
        if not finite:
            raise ScenarioError(f"obstacle {name} has a state or shape that is not finite")


def _all(scenario: Any) -> list[Any]:
    return [
        *scenario.static_obstacles, *scenario.dynamic_obstacles,
        *getattr(scenario, "phantom_obstacle", ()), *getattr(scenario, "environment_obstacle", ()),
    ]  # fmt: skip


def last_predicted_step(scenario: Any) -> int | None:
    """Last time step at which any moving obstacle is predicted; None where nothing moves."""
    last = []
    for obstacle in _all(scenario):
        prediction = getattr(obstacle, "prediction", None)
        trajectory = getattr(prediction, "trajectory", None)
        if trajectory is not None:
            last.append(max(_steps(s.time_step)[1] for s in trajectory.state_list))
        elif prediction is not None:
            last.extend(_steps(o.time_step)[1] for o in prediction.occupancy_set)
    return max(last, default=None)


def obstacles_of(
    scenario: Any,
    *,
    first_step: int,
    n_steps: int,
    after_prediction: str = "remove",
    is_ego: Callable[[Any], bool] = lambda obstacle: False,
    ego_id: int | None = None,
    ego_speed: float = np.nan,
) -> tuple[tuple[Obstacle, ...], Obstacle | None, list[str]]:
    """Read every obstacle of a scenario.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    first_step : int
        The planning problem's initial time step, k = 0 here; earlier steps are cut.
    n_steps : int
        Rows are k = 0 .. n_steps.
    after_prediction : str
        What becomes of an obstacle after its prediction: ``remove``, ``hold`` or ``constant_velocity``.
    is_ego : callable
        Recognises the ego's own recording among the dynamic obstacles by its start.
    ego_id, ego_speed
        The planning problem's id and initial speed [m/s]: a trajectory obstacle with that id (ids
        are unique in CommonRoad) and speed is the ego's recording from a later start, and left out.

    Returns
    -------
    obstacles, recorded ego (or None), notes

    Raises
    ------
    ConfigError
        If ``after_prediction`` is none of the three.
    ScenarioError
        If an obstacle has a number that is not finite; the sentence names it.
    """
    if after_prediction not in AFTER_PREDICTION:
        raise ConfigError(f"after_prediction is {after_prediction!r}; it can be {', '.join(AFTER_PREDICTION)}")
    found: list[Obstacle] = []
    ego: Obstacle | None = None
    notes: list[str] = []
    for obstacle in _all(scenario):
        name = int(obstacle.obstacle_id)
        kind = str(getattr(getattr(obstacle, "obstacle_type", None), "value", "unknown"))
        still = _standing(obstacle)
        if still is not None:
            role, placed = still
            _checked(name, [placed])
            if role == "dynamic":
                notes.append(f"obstacle {name} has no prediction and is taken to stand still")
            found.append(_arrays(name, kind, role, [placed], n_steps + 1))
            continue
        timeline, role = _timeline(obstacle)
        _checked(name, timeline.values())
        rows = [timeline.get(first_step + k) for k in range(n_steps + 1)]
        rows = _continued(rows, timeline, first_step, after_prediction, float(scenario.dt))
        if not any(row is not None for row in rows):
            notes.append(f"obstacle {name} is never there within the horizon")
            continue
        made = _arrays(name, kind, role, rows)
        if role == "dynamic" and ego is None and is_ego(obstacle):
            ego = made
            notes.append(f"obstacle {name} is the ego's own recording and is left out")
        elif role == "dynamic" and name == ego_id and abs(np.nan_to_num(made.states[0, 3], nan=1e9) - ego_speed) < 1.0:
            notes.append(f"obstacle {name} has the planning problem's id and the ego's speed: a copy, left out")
        else:
            found.append(made)
    return tuple(found), ego, notes


def _continued(
    rows: list[_Placed | None], timeline: dict[int, _Placed], first: int, after: str, dt: float
) -> list[_Placed | None]:
    if after == "remove" or not timeline:
        return rows
    last = max(timeline)
    if last < first:  # the prediction ended before the start
        item = timeline[last]
        moved = _filled([item] + [None] * (first - last + len(rows) - 1), after, dt, before_last=timeline.get(last - 1))
        return moved[first - last :]
    return _filled(rows, after, dt, before_last=timeline.get(first - 1))


def _standing(obstacle: Any) -> tuple[str, _Placed] | None:
    """Role and place of an obstacle that never moves; None for the others."""
    role = str(getattr(obstacle.obstacle_role, "value", obstacle.obstacle_role))
    if getattr(obstacle, "initial_state", None) is None:
        shape = getattr(obstacle, "obstacle_shape", None)
        return None if shape is None else ("environment", _occupied(shape))
    if role != "static" and getattr(obstacle, "prediction", None) is not None:
        return None
    state = obstacle.initial_state
    placed = _state_occupancy(obstacle.obstacle_shape, state, _headings([state])[0])
    if role == "static":
        placed = placed._replace(state=(*placed.state[:3], 0.0))
    return ("static" if role == "static" else "dynamic"), placed
