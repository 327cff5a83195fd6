"""A drawing as plain values, and back. What is not there at a time is ``null``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.arrays import Array, column, frozen
from repair.outcome.data import Body, Box, Drawing, Line

__all__ = ["drawing_from", "drawing_to_dict"]

_HUGE = 1e9  # beyond that nothing is drawn
_COLUMNS = ("t", "s", "l", "x", "y", "speed", "acceleration")


def drawing_to_dict(drawing: Drawing) -> dict[str, Any]:
    """Plain Python values: no NaN, no array."""
    return {
        "schema": 1,
        "start_s_m": drawing.start_s,
        "s_offset_m": drawing.s_offset,
        "until_s": drawing.until,
        "steps": list(drawing.steps),
        "body": _rows(drawing.body),
        "ego": _rows(drawing.ego),
        "unrepaired": None if drawing.unrepaired is None else column(drawing.unrepaired),
        "lines": [
            {"kind": x.kind, "name": x.name, "t_rep_s": x.t_rep}
            | {name: column(getattr(x, name)) for name in _COLUMNS}
            for x in drawing.lines
        ],
        "boxes": [
            {"id": x.id, "t": column(x.t), "low": column(x.low), "high": column(x.high)}
            for x in drawing.boxes
        ],
        "bodies": [
            {
                "id": x.id,
                "role": x.role,
                "centres": _rows(x.centres),
                "outlines": {str(step): _rows(outline) for step, outline in x.outlines.items()},
            }
            for x in drawing.bodies
        ],
        "areas": [_rows(x) for x in drawing.areas],
        "edges": [_rows(x) for x in drawing.edges],
    }


def drawing_from(content: Mapping[str, Any]) -> Drawing:
    """The drawing that :func:`drawing_to_dict` made.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError, ArithmeticError
        If it is incomplete or of another shape.
    """
    drawing = Drawing(
        start_s=float(content["start_s_m"]),
        s_offset=float(content["s_offset_m"]),
        until=float(content["until_s"]),
        steps=tuple(int(step) for step in content["steps"]),
        body=_array(content["body"], 2),
        ego=_array(content["ego"], 3),
        unrepaired=None if content["unrepaired"] is None else _array(content["unrepaired"]),
        lines=tuple(
            Line(
                str(x["kind"]), str(x["name"]), None if x["t_rep_s"] is None else float(x["t_rep_s"]),
                *(_array(x[name]) for name in _COLUMNS),
            )
            for x in content["lines"]
        ),
        boxes=tuple(
            Box(int(x["id"]), _array(x["t"]), _array(x["low"]), _array(x["high"])) for x in content["boxes"]
        ),
        bodies=tuple(
            Body(
                int(x["id"]), str(x["role"]), _array(x["centres"], 2),
                {int(step): _array(outline, 2) for step, outline in x["outlines"].items()},
            )
            for x in content["bodies"]
        ),
        areas=tuple(_array(x, 2) for x in content["areas"]),
        edges=tuple(_array(x, 2) for x in content["edges"]),
    )  # fmt: skip
    _require_whole(drawing)
    return drawing


def _require_whole(drawing: Drawing) -> None:
    """Refuse what could not be drawn.

    Raises
    ------
    ValueError
        Saying what is wrong.
    """
    if not drawing.steps or not drawing.lines:
        raise ValueError("it has no lines")
    if not all(0 <= step < _HUGE for step in drawing.steps):
        raise ValueError("it has a step before the first one")
    columns = [
        *([getattr(x, name) for name in _COLUMNS] for x in drawing.lines),
        *([x.t, x.low, x.high] for x in drawing.boxes),
    ]
    if any(len({len(column) for column in one}) > 1 for one in columns):
        raise ValueError("the columns of a line or a box differ in length")
    if any(not len(one[0]) or not np.isfinite(one[0]).all() for one in columns):
        raise ValueError("a line or a box lacks times")
    if not all(np.isfinite(getattr(x, name)).all() for x in drawing.lines for name in _COLUMNS):
        raise ValueError("a line lacks numbers")
    outlines = [outline for x in drawing.bodies for outline in x.outlines.values()]
    shapes = [drawing.ego, drawing.body, *outlines, *drawing.areas, *drawing.edges]
    if any(not len(shape) or not np.isfinite(shape).all() for shape in shapes):
        raise ValueError("a shape lacks points")
    placed = drawing.unrepaired
    if placed is not None and (len(placed) != 3 or not np.isfinite(placed).all()):
        raise ValueError("the ego has no place at the conflict")
    single = np.array([drawing.start_s, drawing.s_offset, drawing.until])
    if not np.isfinite(single).all():
        raise ValueError("it has no end")
    centres = [x.centres for x in drawing.bodies]
    for numbers in (single, *shapes, *centres, *(x for one in columns for x in one)):
        if (np.abs(numbers) > _HUGE).any():
            raise ValueError("a number is out of range")


def _rows(values: Array) -> list[list[float | None]]:
    if not len(values):
        return []
    table = np.atleast_2d(values)
    flat, width = column(table.ravel()), table.shape[1]
    return [flat[k : k + width] for k in range(0, len(flat), width)]


def _array(values: Any, width: int | None = None) -> Array:
    made = frozen([[np.nan if v is None else v for v in row] if width else (np.nan if row is None else row)
                   for row in values])  # fmt: skip
    if width is None:
        return made.reshape(-1)
    return made.reshape(-1, width)
