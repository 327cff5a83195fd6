"""Occupancies over intervals, one for each step: what CommonRoad's own collision check can read.

``commonroad_dc`` takes the occupancies of a set-based prediction for those of consecutive steps, whatever
intervals they hold over: one over [1, 10] counts at step 1 alone, and the next one at step 2. Asked about the
same sets step by step it says what the file says.
"""

from __future__ import annotations

from typing import Any

from repair.scene.traffic.timeline import steps_of

__all__ = ["expand_intervals", "holds_over_intervals"]


def holds_over_intervals(obstacle: Any) -> bool:
    """Whether an obstacle's prediction has an occupancy that holds over more than one step."""
    prediction = getattr(obstacle, "prediction", None)
    if prediction is None or getattr(prediction, "trajectory", None) is not None:
        return False
    return any(len(set(steps_of(o.time_step))) > 1 for o in prediction.occupancy_set)


def expand_intervals(scenario: Any, last: int) -> None:
    """Give every dynamic obstacle one occupancy for each step it is there at, in place.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
        Changed: hand over a copy.
    last : int
        Last time step that matters.
    """
    from commonroad.geometry.shape import ShapeGroup
    from commonroad.prediction.prediction import Occupancy, SetBasedPrediction

    for obstacle in scenario.dynamic_obstacles:
        if not holds_over_intervals(obstacle):
            continue
        shapes: dict[int, list[Any]] = {}
        for occupancy in obstacle.prediction.occupancy_set:
            low, high = steps_of(occupancy.time_step)
            for step in range(max(low, obstacle.initial_state.time_step + 1), min(high, last) + 1):
                shapes.setdefault(step, []).extend(getattr(occupancy.shape, "shapes", [occupancy.shape]))
        if not shapes:
            continue
        sets = [
            Occupancy(step, parts[0] if len(parts) == 1 else ShapeGroup(parts))
            for step, parts in sorted(shapes.items())
        ]
        obstacle.prediction = SetBasedPrediction(sets[0].time_step, sets)
