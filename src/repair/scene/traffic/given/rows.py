"""Obstacles of a planner's cycle: from predictions without a detour where poses are given."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any, NamedTuple, TypeGuard

import numpy as np

from repair.arrays import Array, frozen
from repair.errors import ScenarioError, foreign
from repair.scene.traffic.given.scenario import (
    given_scenario,
    known_rows,
    require_kind,
    require_threshold,
    speeds_along,
    standing_as,
)
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.obstacles import last_predicted_step, obstacles_of
from repair.scene.traffic.prediction import Mode, Prediction, name_of, size_of
from repair.scene.traffic.rows import outline_of, require_sane_poses

__all__ = ["given_obstacles"]


def given_obstacles(
    old: Any, first_step: int, traffic: Iterable[Any], *, after_prediction: str, steps_max: int,
    threshold: float = 0.0,
) -> tuple[tuple[Obstacle, ...], int, tuple[Mode, ...], list[str]]:  # fmt: skip
    """The obstacles of a cycle.

    Parameters
    ----------
    old : commonroad.scenario.scenario.Scenario
        Whose road and time step are kept.
    first_step : int
        Time step of the first row.
    traffic : iterable
        As in :func:`repair.scene.traffic.given.scenario.given_scenario`.
    after_prediction : str
        ``remove``, ``hold`` or ``constant_velocity``.
    steps_max : int
        Longer than this nothing is looked at.
    threshold : float
        Modes less probable than this are left out.

    Returns
    -------
    obstacles : tuple of Obstacle
    n_steps : int
        Until the last prediction, or ``steps_max`` where nothing moves or obstacles stay.
    modes : tuple of Mode
        Of the obstacles that have several.
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
    if plain and all(isinstance(p, Prediction) and p.occupancies is p.shape is None for p in things):
        require_threshold(threshold)
        chosen, modes, notes = standing_as(things, threshold, set())
        for _, one in chosen:
            require_kind(one.kind, name_of(one))
        rows = [
            _Row(name, one, size_of(one), table)
            for (name, one), table in zip(chosen, _tables(chosen), strict=True)
        ]
        if all(_moves(row.table) for row in rows):
            longest = max((len(row.table) for row in rows), default=0) - 1
            n_steps = min(longest, steps_max) if longest > 0 else steps_max
            return _of_tables(rows, n_steps, float(old.dt)), n_steps, modes, notes
    scenario, modes, notes = given_scenario(old, first_step, things, threshold)
    last = last_predicted_step(scenario)
    ends = last is not None and last > first_step and after_prediction == "remove"
    n_steps = min(last - first_step, steps_max) if ends and last is not None else steps_max
    found, _, more = obstacles_of(
        scenario, first_step=first_step, n_steps=n_steps, after_prediction=after_prediction
    )
    return found, n_steps, modes, [*notes, *more]


def _moves(table: Array) -> bool:
    """Whether poses that end with a known one say more than where somebody stands."""
    return len(table) > 1 and bool(np.isfinite(table[-2]).all())


class _Row(NamedTuple):
    """An obstacle to be: its id, length and width [m], and poses (T, 3)."""

    id: int
    prediction: Prediction
    size: tuple[float, float]
    table: Array


def _tables(chosen: list[tuple[int, Prediction]]) -> list[Array]:
    """Poses (T, 3) of each, looked at; those that are there throughout, as most are, all at once."""
    tables = [p.poses for _, p in chosen]
    if not tables or not all(map(_plain, tables)):
        return [_table_of(p) for _, p in chosen]
    finite = np.isfinite(np.concatenate(tables)).all(axis=1)
    whole = np.logical_and.reduceat(finite, np.cumsum([0, *map(len, tables[:-1])])).tolist()
    return [t if k else _table_of(p) for t, k, (_, p) in zip(tables, whole, chosen, strict=True)]


def _plain(table: Any) -> TypeGuard[Array]:
    return (
        isinstance(table, np.ndarray)
        and table.dtype == float
        and table.ndim == 2
        and table.shape[1] == 3
        and len(table) > 0
    )


def _table_of(prediction: Prediction) -> Array:
    """Poses (T, 3), looked at."""
    what = name_of(prediction)
    if prediction.poses is None:
        raise ScenarioError(f"{what}: either poses or occupancies are given")
    with foreign(what, ScenarioError):
        table = np.asarray(prediction.poses, dtype=np.float64)
        begin, rows = known_rows(table, what)
    return table[: begin + len(rows)]


def _of_tables(rows: list[_Row], n_steps: int, dt: float) -> tuple[Obstacle, ...]:
    """Obstacles of poses (T, 3) each, all at once: there are dozens of them every cycle."""
    require_sane_poses([row.id for row in rows], [row.table for row in rows], [row.size for row in rows])
    longest = max((len(row.table) for row in rows), default=0)
    poses = np.full((len(rows), max(longest, n_steps + 1), 3), np.nan)
    for place, row in zip(poses, rows, strict=True):
        place[: len(row.table)] = row.table
    speed = _speeds(poses[:, :longest], dt)
    poses = poses[:, : n_steps + 1]
    states, rectangles = np.full((2, len(rows), n_steps + 1, 5), np.nan)
    states[..., :3] = rectangles[..., :3] = poses
    states[:, : speed.shape[1], 3] = speed[:, : n_steps + 1]
    sizes = np.array([row.size for row in rows]).reshape(-1, 1, 2)
    rectangles[..., 3:] = np.where(np.isfinite(poses[..., :1]), 0.5 * sizes, np.nan)
    outlines = [_outline(*row.size) for row in rows]
    for made in (states, rectangles):
        made.setflags(write=False)
    vertices = _placed(outlines, poses)
    return tuple(
        Obstacle(
            row.id, row.prediction.kind, "dynamic", vertices[k], rectangles[k], None, (), states[k, :, :4]
        )
        for k, row in enumerate(rows)
    )


def _speeds(poses: Array, dt: float) -> Array:
    """Speeds (N, T) along the headings of poses (N, T, 3) [m/s]; NaN where there is no pose."""
    made = np.full(poses.shape[:2], np.nan)
    there = np.isfinite(poses[..., 0])
    whole = there.all(axis=1)
    if whole.any() and poses.shape[1] > 1:
        moved = np.gradient(poses[whole, :, :2], dt, axis=1)
        yaw = poses[whole, :, 2]
        made[whole] = moved[..., 0] * np.cos(yaw) + moved[..., 1] * np.sin(yaw)
    for k in np.flatnonzero(~whole if poses.shape[1] > 1 else whole | ~whole).tolist():
        made[k, there[k]] = speeds_along(poses[k, there[k]], dt)
    return made


@lru_cache(maxsize=256)
def _outline(length: float, width: float) -> Array:
    """Points (V, 2) around a rectangle, seen from its middle."""
    return frozen(outline_of(0.5 * length, 0.5 * width))


def _placed(outlines: list[Array], poses: Array) -> list[Array]:
    """Outlines (V, 2) where the poses (N, T, 3) have them, (T, V, 2) each."""
    cos, sin = np.cos(poses[..., 2, None]), np.sin(poses[..., 2, None])
    made: list[Array] = [np.empty(0)] * len(outlines)
    for size in {len(outline) for outline in outlines}:
        rows = [k for k, outline in enumerate(outlines) if len(outline) == size]
        x, y = np.array([outlines[k] for k in rows]).transpose(2, 0, 1)[:, :, None]
        placed = np.empty((len(rows), poses.shape[1], size, 2))
        placed[..., 0] = cos[rows] * x - sin[rows] * y + poses[rows, :, 0, None]
        placed[..., 1] = sin[rows] * x + cos[rows] * y + poses[rows, :, 1, None]
        placed.setflags(write=False)
        for k, one in zip(rows, placed, strict=True):
            made[k] = one
    return made
