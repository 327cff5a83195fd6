"""Obstacles that the drivability checker puts elsewhere than the scenario does, and by how many steps."""

from __future__ import annotations

from typing import Any

from repair.scene.traffic.stepwise import holds_over_intervals, pauses

__all__ = ["steps_late"]


def steps_late(obstacle: Any) -> int:
    """By how many steps the drivability checker is late for an obstacle; negative where it is early.

    ``commonroad_dc.create_collision_object`` takes the initial state as the first occupancy and
    appends those of the prediction, whatever the prediction's own first time step.

    Parameters
    ----------
    obstacle : commonroad.scenario.obstacle.Obstacle
    """
    prediction = getattr(obstacle, "prediction", None)
    if prediction is None or getattr(obstacle, "initial_state", None) is None:
        return 0
    # A trajectory's occupancy set is computed when asked for, which takes far longer than its states.
    trajectory = getattr(prediction, "trajectory", None)
    parts = prediction.occupancy_set if trajectory is None else trajectory.state_list
    if not parts:
        return 0
    first = parts[0].time_step  # of a set this may be an interval
    placed = obstacle.initial_state.time_step + 1
    if getattr(first, "start", first) <= placed <= getattr(first, "end", first):
        return 0
    if trajectory is None and (holds_over_intervals(obstacle) or pauses(obstacle)):
        return 0  # it is asked about them step by step
    return int(placed - getattr(first, "start", first))
