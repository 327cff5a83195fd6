"""Obstacles of a planner's cycle: from predictions without a detour where poses are given."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from repair.arrays import Array, frozen
from repair.errors import ScenarioError, foreign
from repair.scene.traffic.given import given_scenario, known_rows, speeds_along, standing_as
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.obstacles import last_predicted_step, obstacles_of
from repair.scene.traffic.prediction import Prediction, name_of, size_of
from repair.scene.traffic.rows import rigid_outline

__all__ = ["given_obstacles"]


def given_obstacles(
    old: Any, first_step: int, traffic: Iterable[Any], *, after_prediction: str, steps_max: int
) -> tuple[tuple[Obstacle, ...], int, list[str]]:
    """The obstacles of a cycle.

    Parameters
    ----------
    old : commonroad.scenario.scenario.Scenario
        Whose road and time step are kept.
    first_step : int
        Time step of the first row.
    traffic : iterable
        As in :func:`repair.scene.traffic.given.given_scenario`, all modes included.
    after_prediction : str
        ``remove``, ``hold`` or ``constant_velocity``.
    steps_max : int
        Longer than this nothing is looked at.

    Returns
    -------
    obstacles : tuple of Obstacle
    n_steps : int
        Until the last prediction, or ``steps_max`` where nothing moves or obstacles stay.
    notes : list of str

    Raises
    ------
    ScenarioError
        If an obstacle cannot be had; the sentence names it.
    """
    things: Any = traffic
    if hasattr(traffic, "__iter__") and not isinstance(traffic, str | bytes):
        things = list(traffic)
    plain = after_prediction == "remove" and isinstance(things, list)
    if not plain or not all(isinstance(p, Prediction) and p.occupancies is None for p in things):
        scenario, _, notes = given_scenario(old, first_step, things, 0.0)
        last = last_predicted_step(scenario)
        ends = last is not None and last > first_step and after_prediction == "remove"
        n_steps = min(last - first_step, steps_max) if ends and last is not None else steps_max
        found, _, more = obstacles_of(
            scenario, first_step=first_step, n_steps=n_steps, after_prediction=after_prediction
        )
        return found, n_steps, [*notes, *more]
    chosen, _, notes = standing_as(things, 0.0, set())
    tables = [(name, prediction, _table_of(prediction)) for name, prediction in chosen]
    longest = max((len(table) for _, _, table in tables), default=0) - 1
    n_steps = min(longest, steps_max) if longest > 0 else steps_max
    made = tuple(_of_table(name, one, table, n_steps, float(old.dt)) for name, one, table in tables)
    return made, n_steps, notes


def _table_of(prediction: Prediction) -> Array:
    """Poses (T, 3), looked at."""
    what = name_of(prediction)
    size_of(prediction)
    if prediction.poses is None:
        raise ScenarioError(f"{what}: either poses or occupancies are given")
    with foreign(what, ScenarioError):
        table = np.asarray(prediction.poses, dtype=np.float64)
        begin, rows = known_rows(table, what)
    return table[: begin + len(rows)]


def _of_table(name: int, prediction: Prediction, table: Array, n_steps: int, dt: float) -> Obstacle:
    """An obstacle of poses (T, 3)."""
    rectangles = np.full((n_steps + 1, 5), np.nan)
    states = np.full((n_steps + 1, 4), np.nan)
    count = min(len(table), n_steps + 1)
    there = np.flatnonzero(np.isfinite(table[:, 0]))
    speed = np.full(len(table), np.nan)
    speed[there] = speeds_along(table[there], dt)
    states[:count, :3], states[:count, 3] = table[:count], speed[:count]
    rectangles[:count, :3] = table[:count]
    rectangles[np.isfinite(rectangles[:, 0]), 3:] = 0.5 * np.array(size_of(prediction))
    vertices = rigid_outline(rectangles)
    assert vertices is not None
    return Obstacle(
        name, prediction.kind, "dynamic", frozen(vertices), frozen(rectangles), None, (), frozen(states)
    )
