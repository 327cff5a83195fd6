"""The states and occupancies of a CommonRoad obstacle, placed step by step."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError
from repair.scene.traffic.shapes import Placed, enclosing, interval, occupied, outlines, place, union
from repair.scene.traffic.trailers import is_train, train

__all__ = [
    "STEPS_MAX",
    "attribute_of",
    "continued",
    "headings_of",
    "position_of",
    "state_occupancy",
    "steps_of",
    "timeline",
]

STEPS_MAX = 10**9
"""Time steps beyond this are an error in the file."""


def position_of(state: Any) -> Array:
    """Position (2,) of a CommonRoad state [m]; of an uncertain one the mean of its area's corners.

    Raises
    ------
    ScenarioError
        If it has none.
    """
    position = getattr(state, "position", None)
    if position is None:
        raise ScenarioError("a state of it has no position")
    if hasattr(position, "center") or hasattr(position, "shapes"):
        return np.asarray(np.mean(np.concatenate(outlines(position, np.zeros(2), 0.0)), axis=0))
    return np.asarray(position, dtype=np.float64)[:2]


def attribute_of(state: Any, name: str) -> Any:
    """A value of the state's own; what commonroad-io would derive from others is not one.

    Its ``velocity_y`` of a state with an orientation is along the y axis, not across the body, and
    fails for intervals; so does the orientation of a point mass.
    """
    if name in vars(state):
        return getattr(state, name)
    if name == "orientation" and not any(
        hasattr(attribute_of(state, v), "start") for v in ("velocity", "velocity_y")
    ):
        return getattr(state, name, None)
    return None


def headings_of(states: Sequence[Any]) -> list[tuple[float, float]]:
    """Heading interval of every state; a missing one is the direction of motion."""
    found = [attribute_of(s, "orientation") for s in states]
    if all(h is not None for h in found):
        return [interval(h) for h in found]
    where = np.array([position_of(s) for s in states])
    step = np.gradient(where, axis=0) if len(where) > 1 else np.zeros_like(where)
    moving = np.hypot(step[:, 0], step[:, 1]) > 1e-3
    motion = np.arctan2(step[:, 1], step[:, 0])
    if moving.any():
        last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
        motion = motion[np.where(last < 0, int(np.argmax(moving)), last)]
    return [
        interval(h) if h is not None else (float(m), float(m)) for h, m in zip(found, motion, strict=True)
    ]


def state_occupancy(shape: Any, state: Any, heading: tuple[float, float]) -> Placed:
    """What a body covers in a state: exactly, or what encloses every placement where it is uncertain.

    Parameters
    ----------
    shape : commonroad.geometry.shape.Shape
        The body.
    state : commonroad.scenario.state.State
    heading : tuple of float
        Smallest and largest orientation [rad].
    """
    forward, lateral = attribute_of(state, "velocity"), attribute_of(state, "velocity_y")
    speed = np.nan if forward is None else sum(interval(forward)) / 2.0
    if lateral is not None:
        speed = float(np.hypot(speed, sum(interval(lateral)) / 2.0))
    position = state.position
    exact = not (hasattr(position, "center") or hasattr(position, "shapes"))
    if exact and heading[0] == heading[1]:
        return place(shape, np.asarray(position, dtype=np.float64)[:2], heading[0], speed)
    return enclosing(shape, position, heading[0], heading[1], speed)


def steps_of(value: Any) -> tuple[int, int]:
    """First and last time step that a time step or an interval of such reaches.

    Raises
    ------
    ScenarioError
        If one of them is beyond ``STEPS_MAX``.
    """
    low, high = getattr(value, "start", value), getattr(value, "end", value)
    if not (abs(low) <= STEPS_MAX and abs(high) <= STEPS_MAX):
        raise ScenarioError(f"a time step of an obstacle is beyond {STEPS_MAX}")
    return math.floor(low), math.ceil(high)


def timeline(obstacle: Any, first: int, last: int) -> tuple[dict[int, Placed], str]:
    """Where a moving obstacle is, step by step, and its role.

    Parameters
    ----------
    obstacle : commonroad.scenario.obstacle.Obstacle
    first, last : int
        Of an occupancy that holds over an interval, only the steps around these are taken.

    Returns
    -------
    placed : dict
        Scenario time step -> occupancy.
    role : str
        ``dynamic``, ``set_based`` or ``phantom``.

    Raises
    ------
    ScenarioError
        If its steps cannot be used: an interval at the start, out of order, or a hole between states.
    """
    prediction = getattr(obstacle, "prediction", None)
    initial = getattr(obstacle, "initial_state", None)
    trajectory = getattr(prediction, "trajectory", None)
    placed: dict[int, Placed] = {}
    states: dict[int, Any] = {}
    if initial is not None:
        if hasattr(initial.time_step, "start"):
            raise ScenarioError("the time step of its initial state is an interval")
        states[steps_of(initial.time_step)[0]] = initial
    if trajectory is not None:
        _check_order([steps_of(s.time_step) for s in trajectory.state_list], states)
        for state in trajectory.state_list:
            states.setdefault(steps_of(state.time_step)[0], state)
    if states:
        order = sorted(states)
        headings = dict(zip(order, headings_of([states[k] for k in order]), strict=True))
        if is_train(obstacle):
            return train(obstacle, states, headings), "dynamic"
        shape = obstacle.obstacle_shape
        for step, heading in headings.items():
            body = shape if trajectory is None or step == order[0] else getattr(prediction, "shape", shape)
            placed[step] = state_occupancy(body, states[step], heading)
    if prediction is not None and trajectory is None:
        # It may start late and pause: occupancies are found by their time step, not counted.
        _check_order([steps_of(o.time_step) for o in prediction.occupancy_set], (), may_pause=True)
        for occupancy in prediction.occupancy_set:
            low, high = steps_of(occupancy.time_step)
            item = occupied(occupancy.shape)
            for step in range(max(low, min(first, high) - 1), min(high, last) + 1):
                before = placed.get(step)
                placed[step] = item if before is None else union(before, item)
        return placed, "phantom" if initial is None else "set_based"
    return placed, "dynamic"


def _check_order(steps: Sequence[tuple[int, int]], initial: Iterable[int], may_pause: bool = False) -> None:
    """Time steps of a prediction: from the initial one on, in order, without a hole unless it may pause."""
    before = list(initial)[:1]
    if before and steps and steps[0][0] > before[0] + 1:
        raise ScenarioError(
            f"its prediction starts at time step {steps[0][0]}, its initial state at {before[0]}"
        )
    for (low, high), (following, _) in pairwise(steps):
        if not low < following or (following > high + 1 and not may_pause):
            raise ScenarioError(f"its prediction goes from time step {high} to {following}")


def continued(
    rows: list[Placed | None], timeline: dict[int, Placed], first: int, after: str, dt: float
) -> list[Placed | None]:
    """Rows from step ``first`` on, continued past the last known one, also where that was earlier.

    Parameters
    ----------
    rows : list of Placed or None
        What is known.
    timeline : dict
        Occupancies by time step, also those before ``first``.
    first : int
        Time step of the first row.
    after : str
        ``remove``, ``hold`` or ``constant_velocity``.
    dt : float
        Time step [s].
    """
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
