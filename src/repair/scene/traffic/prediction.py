"""Predictions from memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError, foreign

__all__ = ["WHAT", "Mode", "Prediction", "name_of", "predictions_of", "size_of"]

WHAT = "the given traffic"
"""Its name in sentences."""
_SAME = 1e-9  # sizes that differ by less are the same [m]


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where an obstacle will be, as one mode of a prediction has it.

    Attributes
    ----------
    id : int
        Positive. Several predictions with one id are modes of that obstacle.
    poses : (T, 3) array or None
        ``x, y`` [m] and ``yaw`` [rad] of the obstacle's centre at the scenario's steps from the planning
        problem's start on; rows of NaN at the beginning or the end where it is not there. One pose alone
        predicts nothing: the obstacle stands there, and a note says so.
    length, width : float
        Of its rectangle [m].
    occupancies : sequence, or None
        Instead of poses: the set in which it is, for each step a polygon (V, 2) [m], several of them, or a
        CommonRoad shape; None at the beginning or the end where it is not there.
    kind : str
        CommonRoad obstacle type, such as ``car``.
    probability : float
        Of this mode, a number from 0 to 1.
    mode : str
        Its name.
    shape : commonroad.geometry.shape.Shape, or (V, 2) array, or None
        Instead of length and width: a CommonRoad shape, which CommonRoad turns about its own middle, or an
        outline [m] around the pose, ahead being along x.
    """

    id: int
    poses: Any = None
    length: float | None = None
    width: float | None = None
    occupancies: Sequence[Any] | None = None
    kind: str = "car"
    probability: float = 1.0
    mode: str = ""
    shape: Any = None


@dataclass(frozen=True)
class Mode:
    """One of several predictions of an obstacle, and the id under which it is among the traffic."""

    obstacle_id: int
    name: str
    probability: float
    stands_as: int


def predictions_of(
    boxes: Any, *, length: Any = None, width: Any = None, ids: Sequence[int] | None = None, kind: str = "car"
) -> list[Prediction]:
    """Predictions of many obstacles from one array.

    Parameters
    ----------
    boxes : (N, T, 3) or (N, T, 5) array
        ``x, y`` [m] and ``yaw`` [rad] of the centres at the scenario's steps, and with five columns ``length,
        width`` [m] too; NaN where an obstacle is not there. Whose size changes is taken by the sets that its
        boxes are, without a speed.
    length, width : float or (N,) array
        [m], where the array has three columns.
    ids : sequence of int, optional
        1, 2, ... by default.
    kind : str
        CommonRoad obstacle type.

    Returns
    -------
    list of Prediction
        One for each obstacle, in the order of the array.

    Raises
    ------
    ScenarioError
        If the shapes do not fit.
    """
    with foreign(WHAT, ScenarioError):
        table = np.asarray(boxes, dtype=np.float64)
    if table.ndim != 3 or table.shape[2] not in (3, 5):
        raise ScenarioError(f"{WHAT} is of shape {table.shape}; boxes are (N, T, 3) or (N, T, 5)")
    count = len(table)
    with foreign(f"the ids of {WHAT}", ScenarioError):
        names = list(range(1, count + 1)) if ids is None else list(ids)
    if len(names) != count:
        raise ScenarioError(f"{WHAT} has {count} obstacles and {len(names)} ids")
    if table.shape[2] == 5:
        if length is not None or width is not None:
            raise ScenarioError(f"{WHAT} holds its sizes; leave length and width out")
        return [_of_boxes(name, rows, kind) for name, rows in zip(names, table, strict=True)]
    if length is None or width is None:
        raise ScenarioError(f"{WHAT} is of shape {table.shape}; it takes length and width as well")
    try:
        size = np.stack([np.broadcast_to(np.asarray(v, dtype=np.float64), count) for v in (length, width)], 1)
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"{WHAT}: length and width do not fit {count} obstacles") from error
    return [
        Prediction(name, rows[:, :3], float(a), float(b), kind=kind)
        for name, rows, (a, b) in zip(names, table, size, strict=True)
    ]


def _of_boxes(name: int, rows: Array, kind: str) -> Prediction:
    """One obstacle of boxes (T, 5): x, y, yaw, length, width."""
    sizes = rows[np.isfinite(rows).all(axis=1), 3:]
    if not len(sizes):
        return Prediction(name, rows[:, :3], 1.0, 1.0, kind=kind)  # who takes it says that no pose is finite
    if not (sizes > 0.0).all():
        step = int(np.argmax((rows[:, 3:] <= 0.0).any(axis=1)))
        raise ScenarioError(f"{WHAT}: the box of obstacle {name} has no size at step {step}")
    if not np.ptp(sizes, axis=0).max() > _SAME:
        return Prediction(name, rows[:, :3], float(sizes[0, 0]), float(sizes[0, 1]), kind=kind)
    cos, sin = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    along, across = 0.5 * rows[:, 3] * np.stack([cos, sin]), 0.5 * rows[:, 4] * np.stack([-sin, cos])
    corners = np.stack([along + across, across - along, -along - across, along - across], axis=1)
    outlines = corners.transpose(2, 1, 0) + rows[:, None, :2]
    there = np.asarray(np.isfinite(rows).all(axis=1))
    return Prediction(
        name, occupancies=[o if k else None for o, k in zip(outlines, there.tolist(), strict=True)], kind=kind
    )


def name_of(prediction: Prediction) -> str:
    """What a prediction is called in sentences."""
    named = f", {prediction.mode}" if prediction.mode else ""
    return f"prediction of obstacle {prediction.id}{named}"


def size_of(prediction: Prediction) -> tuple[float, float]:
    """Length and width of a prediction's rectangle [m].

    Raises
    ------
    ScenarioError
        If one of them is not positive.
    """
    length, width = prediction.length, prediction.width
    if not all(isinstance(v, Real) and np.isfinite(v) and v > 0.0 for v in (length, width)):
        raise ScenarioError(
            f"{name_of(prediction)}: length and width are {length!r} and {width!r}; both have to be positive"
        )
    return float(length or 0.0), float(width or 0.0)
