"""Sets that hold over intervals, start late or pause, step by step: as CommonRoad's own check reads them.

``commonroad_dc`` takes the occupancies of a set-based prediction for those of consecutive steps, whatever
their time steps are: one over [1, 10] counts at step 1 alone, and the next one at step 2, also where it is
stated for step 40. Asked about the same sets step by step it says what the file says. It knows no step at
which a moving obstacle is not there; a speck far away stands for that.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.scene.traffic.timeline import steps_of

__all__ = ["expand_sets", "holds_over_intervals", "pauses"]

_ELSEWHERE = (-3e7, 3e7)  # where a speck stands for nothing: no road is there [m]


def _sets(obstacle: Any) -> list[Any]:
    """The occupancies of a set-based prediction."""
    prediction = getattr(obstacle, "prediction", None)
    if prediction is None or getattr(prediction, "trajectory", None) is not None:
        return []
    return list(prediction.occupancy_set)


def holds_over_intervals(obstacle: Any) -> bool:
    """Whether an obstacle's prediction has an occupancy that holds over more than one step."""
    return any(len(set(steps_of(o.time_step))) > 1 for o in _sets(obstacle))


def pauses(obstacle: Any) -> tuple[tuple[int, int], ...]:
    """From which step to which an obstacle's sets say nothing, after its initial state and between them."""
    initial = getattr(obstacle, "initial_state", None)
    if initial is None or hasattr(initial.time_step, "start"):
        return ()
    before, found = steps_of(initial.time_step)[1], []
    for low, high in sorted(steps_of(o.time_step) for o in _sets(obstacle)):
        if low > before + 1:
            found.append((before + 1, low - 1))
        before = max(before, high)
    return tuple(found)


def expand_sets(scenario: Any, last: int) -> None:
    """Give every such obstacle one occupancy for each step from its initial state on, in place.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
        Changed: hand over a copy.
    last : int
        Last time step that matters.
    """
    from commonroad.geometry.shape import Circle, ShapeGroup
    from commonroad.prediction.prediction import Occupancy, SetBasedPrediction

    nowhere = Circle(0.01, np.array(_ELSEWHERE))
    for obstacle in scenario.dynamic_obstacles:
        if not (holds_over_intervals(obstacle) or pauses(obstacle)):
            continue
        begin = int(obstacle.initial_state.time_step) + 1
        shapes: dict[int, list[Any]] = {}
        for occupancy in obstacle.prediction.occupancy_set:
            low, high = steps_of(occupancy.time_step)
            for step in range(max(low, begin), min(high, last) + 1):
                shapes.setdefault(step, []).extend(getattr(occupancy.shape, "shapes", [occupancy.shape]))
        if not shapes:
            continue
        sets = [
            Occupancy(step, parts[0] if len(parts) == 1 else ShapeGroup(parts))
            for step in range(begin, max(shapes) + 1)
            for parts in [shapes.get(step, [nowhere])]
        ]
        obstacle.prediction = SetBasedPrediction(sets[0].time_step, sets)
