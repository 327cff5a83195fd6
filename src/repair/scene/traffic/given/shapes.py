"""Shapes from memory: what an obstacle looks like, and the sets in which it is, as CommonRoad shapes."""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError
from repair.scene.traffic.prediction import Prediction, size_of

__all__ = ["body_of", "sets_of"]


def body_of(prediction: Prediction, what: str) -> tuple[Any, Array]:
    """The body of an obstacle, and where its middle is, seen from the obstacle's pose (2,) [m].

    Parameters
    ----------
    prediction : Prediction
        With ``shape``, or ``length`` and ``width``.
    what : str
        Its name in sentences.

    Returns
    -------
    commonroad.geometry.shape.Shape
        CommonRoad turns a shape about its own middle.
    (2,) array
        Zero but for an outline, which turns about the pose.

    Raises
    ------
    ScenarioError
        If both are given, or the shape is none.
    """
    from commonroad.geometry.shape import Polygon, Rectangle, Shape

    if prediction.shape is None:
        return Rectangle(*size_of(prediction)), np.zeros(2)
    if prediction.length is not None or prediction.width is not None:
        raise ScenarioError(f"{what}: either a shape, or length and width are given")
    if isinstance(prediction.shape, Shape):
        return prediction.shape, np.zeros(2)
    outline = _outline(prediction.shape)
    if outline is None:
        raise ScenarioError(
            f"{what}: its shape is neither one of CommonRoad's nor an outline (V, 2) of three corners or more"
        )
    middle = np.asarray(Polygon(outline).center, dtype=np.float64)
    return Polygon(outline - middle), middle


def sets_of(prediction: Prediction, what: str) -> tuple[int, list[Any]]:
    """The sets of an obstacle as CommonRoad shapes, from the first step on at which it is there.

    Returns
    -------
    int
        That step.
    list of commonroad.geometry.shape.Shape
        Until the last step at which it is there.

    Raises
    ------
    ScenarioError
        If one is none, it is away in between, or there are fewer than two; the sentence names the first step.
    """
    given = () if prediction.occupancies is None else prediction.occupancies
    made = [_set(one, k, what) for k, one in enumerate(given)]
    there = [k for k, shape in enumerate(made) if shape is not None]
    if len(there) < 2:
        raise ScenarioError(
            f"{what}: {len(there)} of its {len(made)} occupancies say where it is; at least two have to, "
            "and there is one for each step"
        )
    known = made[there[0] : there[-1] + 1]
    if len(there) < len(known):
        hole = there[0] + next(k for k, shape in enumerate(known) if shape is None)
        raise ScenarioError(f"{what} has a hole: at step {hole} it is nowhere, and later it is again")
    return there[0], known


def _set(given: Any, step: int, what: str) -> Any:
    """One set: a CommonRoad shape, a polygon (V, 2), or several of them; None where it is not there."""
    from commonroad.geometry.shape import Polygon, Shape, ShapeGroup

    if given is None or (isinstance(given, Shape) and getattr(given, "shapes", True)):
        return given
    outline = _outline(given)
    if outline is not None:
        return Polygon(outline)
    parts = [_outline(part) for part in given] if hasattr(given, "__len__") else []
    if not parts or any(part is None for part in parts):
        raise ScenarioError(
            f"{what}: its occupancy at step {step} is no polygon (V, 2) of three corners or more, and not "
            "several of them"
        )
    return ShapeGroup([Polygon(part) for part in parts])


def _outline(given: Any) -> Array | None:
    """Corners (V, 2) [m]; None where that is no polygon."""
    try:
        corners = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    shaped = corners.ndim == 2 and corners.shape[1] == 2 and len(corners) >= 3
    return corners if shaped and np.isfinite(corners).all() else None
