"""The goal of a planning problem: where along the path it can be met, and by how much it is missed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, wrap

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["GoalState", "Miss", "goal_states", "misses"]


@dataclass(frozen=True)
class GoalState:
    """One way to reach the goal.

    Attributes
    ----------
    first, last : int
        Steps, counted from the start, between which it has to be met.
    region
        A shapely geometry in which the vehicle's middle has to be; None where any place will do.
    speed, orientation : (float, float) or None
        Intervals [m/s], [rad] (from the first to the second, to the left); None where any will do.
    """

    first: int
    last: int
    region: Any
    speed: tuple[float, float] | None
    orientation: tuple[float, float] | None

    def holds_at(self, places: Array) -> npt.NDArray[np.bool_]:
        """Which places (K, 2) are in the region."""
        if self.region is None:
            return np.ones(len(places), dtype=np.bool_)
        import shapely

        return np.asarray(shapely.intersects_xy(self.region, places[:, 0], places[:, 1]))

    def turned_off(self, orientation: Array) -> Array:
        """By how much orientations (K,) are outside of the interval [rad]."""
        if self.orientation is None:
            return np.zeros(len(orientation))
        low, high = self.orientation
        half = 0.5 * (high - low)
        return np.asarray(np.maximum(np.abs(wrap(orientation - 0.5 * (low + high))) - half, 0.0))

    def too_fast(self, speed: Array) -> Array:
        """By how much speeds (K,) are outside of the interval [m/s]."""
        if self.speed is None:
            return np.zeros(len(speed))
        return np.asarray(np.maximum(np.maximum(self.speed[0] - speed, speed - self.speed[1]), 0.0))


@dataclass(frozen=True)
class Miss:
    """A condition of the goal that is not met, by how much, and at which time [s] it comes closest."""

    condition: str
    by: float
    unit: str
    time: float


def goal_states(scene: Scene) -> list[GoalState]:
    """The goal states of a scene's planning problem; those that cannot be read are left out."""
    import shapely

    found = []
    for state in scene.planning_problem.goal.state_list:
        span = getattr(state, "time_step", None)
        if span is None:
            continue
        region = None
        if state.has_value("position"):
            shapes = getattr(state.position, "shapes", [state.position])
            known = [s.shapely_object for s in shapes if hasattr(type(s), "shapely_object")]
            if not known:
                continue
            region = shapely.union_all(known)
        low, high = getattr(span, "start", span), getattr(span, "end", span)
        found.append(
            GoalState(
                int(low) - scene.initial_time_step,
                int(high) - scene.initial_time_step,
                region,
                _interval(state, "velocity"),
                _interval(state, "orientation"),
            )
        )
    return found


def _interval(state: Any, name: str) -> tuple[float, float] | None:
    if not state.has_value(name):
        return None
    value = getattr(state, name)
    return float(getattr(value, "start", value)), float(getattr(value, "end", value))


def misses(goal: GoalState, places: Array, speed: Array, orientation: Array, dt: float) -> tuple[Miss, ...]:
    """What a trajectory misses of a goal state, at the step at which it comes closest; empty if nothing.

    Parameters
    ----------
    goal : GoalState
    places, speed, orientation
        (K, 2), (K,), (K,) at the scenario's steps from the start on.
    dt : float
        Time step [s].
    """
    steps = np.arange(len(places))
    late = np.maximum(np.maximum(goal.first - steps, steps - goal.last), 0) * dt
    far = np.zeros(len(places))
    if goal.region is not None:
        import shapely

        far = np.asarray(shapely.distance(goal.region, shapely.points(places)))
    conditions = {
        "time": (late, "s"),
        "position": (far, "m"),
        "orientation": (goal.turned_off(orientation), "rad"),
        "velocity": (goal.too_fast(speed), "m/s"),
    }
    columns = np.array([values for values, _ in conditions.values()])
    count, size = np.count_nonzero(columns > 0.0, axis=0), columns.sum(axis=0)
    # In time first, if it ever is: what is missed there says more than by how much the time is.
    k = int(np.lexsort((size, count, late))[0])
    return tuple(
        Miss(name, float(values[k]), unit, k * dt)
        for name, (values, unit) in conditions.items()
        if values[k] > 0.0
    )
