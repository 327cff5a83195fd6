"""Obstacles as they would be a little later, earlier, further off, or for a while only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.scene.traffic.obstacle import Obstacle

__all__ = ["delayed", "only_between", "translated"]


def delayed(obstacle: Obstacle, steps: int) -> Obstacle:
    """The obstacle where it was some steps before (negative: where it will be).

    What its rows do not say, before the first and after the last of them, goes on straight as at that end;
    an obstacle that is absent there stays so.

    Parameters
    ----------
    steps : int
        Of the scenario.
    """
    count = obstacle.n_steps + 1
    row = np.arange(count) - steps
    known = np.clip(row, 0, count - 1)
    beyond = row - known
    begin, end = _pace(obstacle, 0, 1), _pace(obstacle, count - 2, count - 1)
    way = np.where(beyond[:, None] < 0, begin, end) * beyond[:, None]
    return _placed(obstacle, known, way)


def translated(obstacle: Obstacle, way: Array) -> Obstacle:
    """The obstacle moved by ``way`` (2,) [m] at all times."""
    count = obstacle.n_steps + 1
    return _placed(obstacle, np.arange(count), np.broadcast_to(way, (count, 2)))


def only_between(obstacle: Obstacle, first: int, last: int) -> Obstacle:
    """The obstacle at the steps ``first`` .. ``last`` alone; it is absent at all others."""
    row = np.arange(obstacle.n_steps + 1)
    there = (row >= first) & (row <= last)

    def kept(values: Array) -> Array:
        return np.where(there.reshape(-1, *(1,) * (values.ndim - 1)), values, np.nan)

    return replace(
        obstacle,
        vertices=kept(obstacle.vertices),
        rectangles=None if obstacle.rectangles is None else kept(obstacle.rectangles),
        circles=None if obstacle.circles is None else kept(obstacle.circles),
        polygons=tuple(
            part if is_there else () for part, is_there in zip(obstacle.polygons, there, strict=True)
        )
        if obstacle.polygons
        else (),
        states=kept(obstacle.states),
    )


def _pace(obstacle: Obstacle, first: int, second: int) -> Array:
    """What it moves by in a step (2,) [m]; nothing where that is not known."""
    if obstacle.n_steps < 1:
        return np.zeros(2)
    step = obstacle.states[second, :2] - obstacle.states[first, :2]
    return np.asarray(step) if np.isfinite(step).all() else np.zeros(2)


def _placed(obstacle: Obstacle, row: npt.NDArray[np.intp], way: Array) -> Obstacle:
    """The rows that are named, each moved by its way (T, 2)."""

    def moved(values: Array) -> Array:
        taken = values[row]
        taken[..., :2] += way.reshape(len(way), *(1,) * (taken.ndim - 2), 2)
        return taken

    return replace(
        obstacle,
        vertices=moved(obstacle.vertices),
        rectangles=None if obstacle.rectangles is None else moved(obstacle.rectangles),
        circles=None if obstacle.circles is None else moved(obstacle.circles),
        polygons=tuple(
            tuple(part + shift for part in obstacle.polygons[k]) for k, shift in zip(row, way, strict=True)
        )
        if obstacle.polygons
        else (),
        states=moved(obstacle.states),
    )
