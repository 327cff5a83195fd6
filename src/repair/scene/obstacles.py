"""Obstacles of a CommonRoad scenario as plain arrays, one row per time step.

What CommonRoad leaves open is settled here, towards the larger occupancy:

- a shape turns about its own centre, which is then moved by the state (commonroad-io's reading);
- an uncertain position or orientation takes the rectangle that encloses every placement;
- a missing orientation is the direction of motion;
- a dynamic obstacle without a prediction stands where it is (noted);
- a set-based occupancy over [k, k + 1] counts at k and at k + 1;
- after its prediction an obstacle is gone (CommonRoad's own reading), or held, or moves on.

A prediction with a hole, or with steps out of order, is refused: commonroad-io and the drivability
checker count its states instead of reading their time steps, and would put the obstacle elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from repair.errors import ConfigError, ScenarioError
from repair.scene.shapes import (
    FAR,
    Placed,
    enclosing,
    interval,
    occupied,
    outlines,
    place,
    polygons_of,
    subdivided,
    union,
)
from repair.types import Array, frozen

__all__ = ["AFTER_PREDICTION", "Obstacle", "last_predicted_step", "obstacles_of"]

AFTER_PREDICTION = ("remove", "hold", "constant_velocity")

_STEPS_MAX = 10**9
_LARGEST = 1e4  # half size of an obstacle beyond which it is an error in the file [m]


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


# ---------------------------------------------------------------------- states over time


def _position(state: Any) -> Array:
    position = getattr(state, "position", None)
    if position is None:
        raise ScenarioError("a state of it has no position")
    if hasattr(position, "center") or hasattr(position, "shapes"):
        return np.asarray(np.mean(np.concatenate(outlines(position, np.zeros(2), 0.0)), axis=0))
    return np.asarray(position, dtype=np.float64)[:2]


def _attribute(state: Any, name: str) -> Any:
    """A value of the state's own; what commonroad-io would derive from others is not one.

    Its ``velocity_y`` of a state with an orientation is along the y axis, not across the body, and
    fails for intervals; so does the orientation of a point mass.
    """
    if name in vars(state):
        return getattr(state, name)
    if name == "orientation" and not any(
        hasattr(_attribute(state, v), "start") for v in ("velocity", "velocity_y")
    ):
        return getattr(state, name, None)
    return None


def _headings(states: Sequence[Any]) -> list[tuple[float, float]]:
    """Heading interval of every state; a missing one is the direction of motion."""
    found = [_attribute(s, "orientation") for s in states]
    if all(h is not None for h in found):
        return [interval(h) for h in found]
    where = np.array([_position(s) for s in states])
    step = np.gradient(where, axis=0) if len(where) > 1 else np.zeros_like(where)
    moving = np.hypot(step[:, 0], step[:, 1]) > 1e-3
    motion = np.arctan2(step[:, 1], step[:, 0])
    if moving.any():
        last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
        motion = motion[np.where(last < 0, int(np.argmax(moving)), last)]
    return [
        interval(h) if h is not None else (float(m), float(m)) for h, m in zip(found, motion, strict=True)
    ]


def _state_occupancy(shape: Any, state: Any, heading: tuple[float, float]) -> Placed:
    forward, lateral = _attribute(state, "velocity"), _attribute(state, "velocity_y")
    speed = np.nan if forward is None else sum(interval(forward)) / 2.0
    if lateral is not None:
        speed = float(np.hypot(speed, sum(interval(lateral)) / 2.0))
    position = state.position
    exact = not (hasattr(position, "center") or hasattr(position, "shapes"))
    if exact and heading[0] == heading[1]:
        return place(shape, np.asarray(position, dtype=np.float64)[:2], heading[0], speed)
    return enclosing(shape, position, heading[0], heading[1], speed)


def _steps(value: Any) -> tuple[int, int]:
    low, high = getattr(value, "start", value), getattr(value, "end", value)
    if not (abs(low) <= _STEPS_MAX and abs(high) <= _STEPS_MAX):
        raise ScenarioError(f"a time step of an obstacle is beyond {_STEPS_MAX}")
    return int(np.floor(low)), int(np.ceil(high))


def _timeline(obstacle: Any, first: int, last: int) -> tuple[dict[int, Placed], str]:
    """Occupancies by the scenario's own time steps, and the role.

    Of an occupancy that holds over an interval, only the steps around ``first`` to ``last``.
    """
    prediction = getattr(obstacle, "prediction", None)
    initial = getattr(obstacle, "initial_state", None)
    trajectory = getattr(prediction, "trajectory", None)
    placed: dict[int, Placed] = {}
    states: dict[int, Any] = {}
    if initial is not None:
        if hasattr(initial.time_step, "start"):
            raise ScenarioError("the time step of its initial state is an interval")
        states[_steps(initial.time_step)[0]] = initial
    if trajectory is not None:
        _check_order([_steps(s.time_step) for s in trajectory.state_list], states)
        for state in trajectory.state_list:
            states.setdefault(_steps(state.time_step)[0], state)
    if states:
        order = sorted(states)
        shape = obstacle.obstacle_shape
        for step, heading in zip(order, _headings([states[k] for k in order]), strict=True):
            if (
                getattr(states[step], "hitch_angle", None) is not None
            ):  # a trailer: commonroad-io knows how it trails
                item = occupied(obstacle.occupancy_at_time(step).shape)
                placed[step] = item._replace(state=_state_occupancy(shape, states[step], heading).state)
            else:
                body = (
                    shape if trajectory is None or step == order[0] else getattr(prediction, "shape", shape)
                )
                placed[step] = _state_occupancy(body, states[step], heading)
    if prediction is not None and trajectory is None:
        _check_order([_steps(o.time_step) for o in prediction.occupancy_set], states)
        for occupancy in prediction.occupancy_set:
            low, high = _steps(occupancy.time_step)
            item = occupied(occupancy.shape)
            for step in range(max(low, min(first, high) - 1), min(high, last) + 1):
                before = placed.get(step)
                placed[step] = item if before is None else union(before, item)
        return placed, "phantom" if initial is None else "set_based"
    return placed, "dynamic"


def _check_order(steps: Sequence[tuple[int, int]], initial: Iterable[int]) -> None:
    """Time steps of a prediction: from the initial one on, in order, without a hole."""
    before = list(initial)[:1]
    if before and steps and steps[0][0] > before[0] + 1:
        raise ScenarioError(
            f"its prediction starts at time step {steps[0][0]}, its initial state at {before[0]}"
        )
    for (low, high), (following, _) in pairwise(steps):
        if not low < following <= high + 1:
            raise ScenarioError(f"its prediction goes from time step {high} to {following}")


# ---------------------------------------------------------------------- arrays


def _continued(
    rows: list[Placed | None], timeline: dict[int, Placed], first: int, after: str, dt: float
) -> list[Placed | None]:
    """Rows from step ``first`` on, continued past the last known one, also where that was earlier."""
    known = [step for step in timeline if step < first + len(rows)]
    if after == "remove" or not known:
        return rows
    last = max(known)
    item, previous = timeline[last], timeline.get(last - 1)
    shift = np.zeros(2)
    if after == "constant_velocity":
        if np.isfinite(item.state[3]) and np.isfinite(item.state[2]):
            shift = item.state[3] * dt * np.array([np.cos(item.state[2]), np.sin(item.state[2])])
        elif previous is not None:
            shift = np.subtract(item.state[:2], previous.state[:2])
    return [row if k <= last else item.moved((k - last) * shift) for k, row in enumerate(rows, start=first)]


def _rigid_outline(rectangles: Array) -> Array | None:
    """Outlines of one rectangle on its way, all at once; None where its size changes."""
    half = rectangles[np.isfinite(rectangles[:, 0]), 3:]
    if np.ptp(half, axis=0).any():
        return None
    local = subdivided(np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * half[0])
    c, s = np.cos(rectangles[:, 2, None]), np.sin(rectangles[:, 2, None])
    x = c * local[:, 0] - s * local[:, 1] + rectangles[:, 0, None]
    y = s * local[:, 0] + c * local[:, 1] + rectangles[:, 1, None]
    return np.stack([x, y], axis=-1)


def _outline_rows(rows: Sequence[Placed | None]) -> Array:
    """Outlines of whatever shape, padded with their last point to the same length."""
    shells = [np.concatenate([subdivided(p) for p in polygons_of(row)]) if row else None for row in rows]
    vertices = np.full((len(rows), max(len(o) for o in shells if o is not None), 2), np.nan)
    for k, outline in enumerate(shells):
        if outline is not None:
            vertices[k, : len(outline)] = outline
            vertices[k, len(outline) :] = outline[-1]
    return vertices


def _arrays(name: int, kind: str, role: str, rows: Sequence[Placed | None], static_rows: int = 0) -> Obstacle:
    """Stack rows into an obstacle; a single row is repeated ``static_rows`` times without copying."""
    present = [row for row in rows if row is not None]
    rectangles = circles = None
    polygons: tuple[tuple[Array, ...], ...] = ()
    if all(row.rectangle for row in present):
        rectangles = np.array([row.rectangle if row else (np.nan,) * 5 for row in rows], dtype=np.float64)
    elif all(row.circle for row in present):
        circles = np.array([row.circle if row else (np.nan,) * 3 for row in rows], dtype=np.float64)
    else:
        polygons = tuple(tuple(frozen(p) for p in polygons_of(row)) if row else () for row in rows)
    vertices = _rigid_outline(rectangles) if rectangles is not None else None
    if vertices is None:
        vertices = _outline_rows(rows)
    states = np.array([row.state if row else (np.nan,) * 4 for row in rows], dtype=np.float64)
    made = Obstacle(
        name, kind, role, frozen(vertices), None if rectangles is None else frozen(rectangles),
        None if circles is None else frozen(circles), polygons, frozen(states),
    )  # fmt: skip
    return _repeated(made, static_rows) if static_rows else made


def _repeated(obstacle: Obstacle, count: int) -> Obstacle:
    def wide(array: Array) -> Array:
        return np.broadcast_to(array[0], (count, *array.shape[1:]))

    return replace(
        obstacle,
        vertices=wide(obstacle.vertices),
        rectangles=None if obstacle.rectangles is None else wide(obstacle.rectangles),
        circles=None if obstacle.circles is None else wide(obstacle.circles),
        polygons=obstacle.polygons * count,
        states=wide(obstacle.states),
    )


def _checked(placed: Iterable[Placed]) -> None:
    for item in placed:
        places = [np.asarray(item.state[:2]), *(item.polygons or ())]
        places += [np.asarray(shape[:2]) for shape in (item.rectangle, item.circle) if shape]
        sizes = [*(item.rectangle or ())[3:], *(item.circle or ())[2:]]
        sizes += [float(np.max(np.ptp(p, axis=0))) / 2.0 for p in item.polygons or ()]
        angle = item.rectangle[2] if item.rectangle else 0.0
        if not (np.isfinite([*sizes, angle]).all() and all(np.isfinite(p).all() for p in places)):
            raise ScenarioError("a state or shape of it is not finite")
        if not 0.0 < min(sizes) <= max(sizes) <= _LARGEST:
            raise ScenarioError(f"its size is {2.0 * min(sizes):g} to {2.0 * max(sizes):g} m")
        if max(float(np.max(np.abs(p))) for p in places) > FAR:
            raise ScenarioError(f"it is farther than {FAR:g} m out")


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
        raise ConfigError(
            f"after_prediction is {after_prediction!r}; it can be {', '.join(AFTER_PREDICTION)}"
        )
    found: list[Obstacle] = []
    ego: Obstacle | None = None
    notes: list[str] = []
    for obstacle in _all(scenario):
        name = int(obstacle.obstacle_id)
        try:
            placed, role = _placed(obstacle, first_step, first_step + n_steps)
        except ScenarioError as error:
            raise ScenarioError(f"obstacle {name}: {error}") from error
        kind = str(getattr(getattr(obstacle, "obstacle_type", None), "value", "unknown"))
        if isinstance(placed, Placed):
            if role == "dynamic":
                notes.append(f"obstacle {name} has no prediction and is taken to stand still")
            found.append(_arrays(name, kind, role, [placed], n_steps + 1))
            continue
        rows = [placed.get(first_step + k) for k in range(n_steps + 1)]
        rows = _continued(rows, placed, first_step, after_prediction, float(scenario.dt))
        if not any(row is not None for row in rows):
            notes.append(f"obstacle {name} is never there within the horizon")
            continue
        made = _arrays(name, kind, role, rows)
        if role == "dynamic" and ego is None and is_ego(obstacle):
            ego = made
            notes.append(f"obstacle {name} is the ego's own recording and is left out")
        elif (
            role == "dynamic"
            and name == ego_id
            and abs(np.nan_to_num(made.states[0, 3], nan=1e9) - ego_speed) < 1.0
        ):
            notes.append(
                f"obstacle {name} has the planning problem's id and the ego's speed: a copy, left out"
            )
        else:
            found.append(made)
    return tuple(found), ego, notes


def _placed(obstacle: Any, first: int, last: int) -> tuple[Placed | dict[int, Placed], str]:
    """Where an obstacle is, for good or by time step, and its role.

    Raises
    ------
    ScenarioError
        Without the obstacle's name.
    """
    still = _standing(obstacle)
    if still is not None:
        _checked([still[1]])
        return still[1], still[0]
    timeline, role = _timeline(obstacle, first, last)
    _checked(timeline.values())
    return timeline, role


def _standing(obstacle: Any) -> tuple[str, Placed] | None:
    """Role and place of an obstacle that never moves; None for the others."""
    role = str(getattr(obstacle.obstacle_role, "value", obstacle.obstacle_role))
    if getattr(obstacle, "initial_state", None) is None:
        shape = getattr(obstacle, "obstacle_shape", None)
        return None if shape is None else ("environment", occupied(shape))
    if role != "static" and getattr(obstacle, "prediction", None) is not None:
        return None
    state = obstacle.initial_state
    placed = _state_occupancy(obstacle.obstacle_shape, state, _headings([state])[0])
    if role == "static":
        placed = placed._replace(state=(*placed.state[:3], 0.0))
    return ("static" if role == "static" else "dynamic"), placed
