"""The planning problem's initial state, and who of the traffic is the ego itself."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import wrap
from repair.curves.plane import STANDSTILL
from repair.errors import ScenarioError, in_words
from repair.scene.scene import InitialState
from repair.scene.traffic.shapes import FAR
from repair.scene.traffic.timeline import STEPS_MAX
from repair.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.scene.scene import Scene

__all__ = [
    "SPEED_RANGE",
    "first_step_of",
    "initial_state_of",
    "is_ego",
    "possible_state",
    "slip_at_start",
]

SPEED_RANGE = (-0.1, 100.0)
"""Initial speeds that can be dealt with [m/s]."""
# The body begins as the planning problem has it where that of steady driving is off by more than the one and
# less than the other [rad]; beyond, the path says something else about the start than the problem.
_UNSTEADY, _STATED = 0.003, 0.03
_CRAWLS, _NEAR = 1.0, 0.1  # [m/s], [rad]; from there a body comes to its path by steering of 0.1 rad/s


def initial_state_of(state: Any, whose: str = "the planning problem's initial") -> InitialState:
    """Read a planning problem's initial state; of an interval, the middle.

    Parameters
    ----------
    state : commonroad.scenario.state.State
    whose : str
        In sentences, before what of the state is meant.

    Raises
    ------
    ScenarioError
        If position, orientation or velocity are missing, the position is not exact, or a number is not
        finite or out of range.
    """
    values = []
    position = getattr(state, "position", None)
    if position is None or hasattr(position, "center") or hasattr(position, "shapes"):
        raise ScenarioError(f"{whose} position is not an exact point")
    # A point mass has no orientation of its own, and its velocity is that along x alone.
    point = "velocity_y" in vars(state) and "orientation" not in vars(state)
    for name in ("orientation", "velocity", "acceleration", "yaw_rate"):
        value = getattr(state, name, None)
        if value is not None and hasattr(value, "start"):
            value = (value.start + value.end) / 2.0
        if name == "orientation" and point and state.velocity == state.velocity_y == 0.0:
            value = None  # commonroad-io makes 0 of it
        if value is None and name in ("orientation", "velocity"):
            raise ScenarioError(f"{whose} state has no {name}")
        values.append(0.0 if value is None else value)
    if point:
        pair = (_number(v, f"{whose} velocity") for v in (values[1], state.velocity_y))
        values[1] = math.hypot(*pair)
    if np.shape(position) != (2,):
        raise ScenarioError(f"{whose} position is {in_words(position)}; it is x, y")
    return possible_state((*position, *values), whose)


def possible_state(values: Iterable[Any], whose: str) -> InitialState:
    """The state of six numbers, in the order of :class:`InitialState`, that can be dealt with.

    Raises
    ------
    ScenarioError
        If one is no number, not finite, or out of range.
    """
    names = ("x", "y", "orientation", "velocity", "acceleration", "yaw rate")
    numbers = [_number(value, f"{whose} {name}") for value, name in zip(values, names, strict=True)]
    for number, name in zip(numbers, names, strict=True):
        if not math.isfinite(number):
            raise ScenarioError(f"{whose} {name} is not finite")
    made = InitialState(*numbers)
    if max(abs(made.x), abs(made.y)) > FAR:
        raise ScenarioError(f"{whose} position ({made.x:g}, {made.y:g}) is farther than {FAR:g} m out")
    if not SPEED_RANGE[0] <= made.velocity <= SPEED_RANGE[1]:
        raise ScenarioError(
            f"{whose} speed is {made.velocity:g} m/s; it has to be from 0 to {SPEED_RANGE[1]:g} m/s"
        )
    return made


def _number(value: Any, what: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ScenarioError(f"{what} is {in_words(value)}, which is no number") from error


def first_step_of(state: Any) -> int:
    """Time step of a planning problem's initial state.

    Raises
    ------
    ScenarioError
        If there is none or it is out of range.
    """
    step = getattr(state, "time_step", None)
    if step is None:
        raise ScenarioError("the planning problem's initial state has no time step")
    first = int(step.start if hasattr(step, "start") else step)
    if not 0 <= first <= STEPS_MAX:
        raise ScenarioError(f"the planning problem starts at time step {first}; CommonRoad counts from 0")
    return first


def is_ego(obstacle: Any, *, ego: InitialState, first_step: int, vehicle: Vehicle) -> bool:
    """Whether a moving obstacle starts where, how fast and about as large as the ego.

    Parameters
    ----------
    obstacle : commonroad.scenario.obstacle.DynamicObstacle
    ego : InitialState
    first_step : int
        Time step at which the planning problem starts.
    vehicle : Vehicle
        The ego's.
    """
    state = obstacle.state_at_time(first_step)
    if state is None or hasattr(state.position, "center") or hasattr(state.position, "shapes"):
        return False
    heading, speed = getattr(state, "orientation", None), getattr(state, "velocity", None)
    if hasattr(heading, "start") or hasattr(speed, "start"):  # uncertain
        return False
    off = np.hypot(state.position[0] - ego.x, state.position[1] - ego.y)
    turned = 0.0 if heading is None else abs((heading - ego.orientation + np.pi) % (2 * np.pi) - np.pi)
    faster = 0.0 if speed is None else abs(speed - ego.velocity)
    length = getattr(obstacle.obstacle_shape, "length", None)
    alike = length is None or abs(length - vehicle.length) < 2.0
    return bool(off < 0.5 and turned < 0.1 and faster < 1.0 and alike)


def slip_at_start(scene: Scene, path: CartesianPath) -> float | None:
    """Slip angle at t = 0 where the body's orientation is known; None for that of steady driving.

    It is where a reference states it, and where the vehicle stands: of a path that stands the direction is
    held, so that it says nothing about the body's. Where it crawls along its body, the bends of the path,
    which are of centimetres then, say no more of it.
    """
    if not len(path.speed):
        return None
    if scene.first_heading is not None:
        return float(wrap(path.heading[0] - scene.first_heading))
    body, pace = scene.initial_state.orientation, abs(float(path.speed[0]))
    off = float(wrap(path.heading[0] - body))
    if pace < STANDSTILL or (pace < _CRAWLS and abs(off) < _NEAR):
        return off
    if len(path.speed) > 1:  # where a path begins in a bend that changes, no steady driving fits it
        _, orientation = scene.model.angles(path, None)
        if _UNSTEADY < abs(float(wrap(orientation[0] - body))) < _STATED:
            return off
    return None
