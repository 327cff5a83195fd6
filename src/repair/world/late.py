"""By how many steps the drivability checker is late."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    pass

__all__ = ["official_shifts"]


def official_shifts(scenario: Any) -> dict[int, int]:
    """By how many steps the drivability checker is late, for the obstacles where it is not on time.

    ``commonroad_dc.create_collision_object`` takes the initial state as the first occupancy and
    appends those of the prediction, whatever the prediction's own first time step.
    """
    shifts = {}
    for obstacle in scenario.dynamic_obstacles:
        prediction = obstacle.prediction
        if prediction is None:
            continue
        # A trajectory's occupancy set is computed when asked for, which takes far longer than its states.
        trajectory = getattr(prediction, "trajectory", None)
        parts = prediction.occupancy_set if trajectory is None else trajectory.state_list
        if not parts:
            continue
        first = parts[0].time_step  # of a set this may be an interval
        placed = obstacle.initial_state.time_step + 1
        if not getattr(first, "start", first) <= placed <= getattr(first, "end", first):
            shifts[obstacle.obstacle_id] = int(placed - getattr(first, "start", first))
    return shifts
