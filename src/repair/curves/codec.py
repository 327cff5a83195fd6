"""Curves as plain values, and back: what ``result.json`` holds of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.arrays import column, frozen, number
from repair.curves.base import Curve
from repair.curves.bernstein import BernsteinCurve
from repair.curves.bspline import UniformBSpline
from repair.errors import RepairError

__all__ = ["curve_to_dict", "read_curve"]


def curve_to_dict(curve: Curve | None, t_end: float | None = None) -> dict[str, Any] | None:
    """A curve by its control points where it has some, else by samples every 0.1 s."""
    if curve is None:
        return None
    if isinstance(curve, UniformBSpline):
        return {
            "type": "uniform_bspline",
            "t_start_s": number(curve.t_start),
            "t_end_s": number(curve.t_end),
            "spacing_s": number(curve.spacing),
            "degree": curve.degree,
            "control_points_m": [column(point, 12) for point in curve.points],
        }
    if isinstance(curve, BernsteinCurve):
        return {
            "type": "bernstein",
            "t_start_s": number(curve.t_start),
            "t_end_s": number(curve.t_end),
            "spacing_s": number(curve.duration),
            "degree": curve.degree,
            "control_points_m": [[column(point, 12) for point in piece] for piece in curve.points],
        }
    t_start, t_end = curve.t_start, min(curve.t_end, curve.t_end if t_end is None else t_end)
    samples = curve.sample(np.linspace(t_start, t_end, max(2, round((t_end - t_start) / 0.1) + 1)))
    columns = (samples.position, samples.velocity, samples.acceleration)
    return {
        "type": "samples",
        "t_s": column(samples.t),
        **{
            f"{axis}_{name}": column(values[:, k])
            for name, values in zip(("m", "mps", "mps2"), columns, strict=True)
            for k, axis in enumerate(("s", "l"))
        },
    }


def read_curve(content: Mapping[str, Any] | None) -> UniformBSpline | BernsteinCurve | None:
    """The curve that :func:`curve_to_dict` wrote; None where it wrote none.

    Raises
    ------
    RepairError
        If it is given by samples only, or incomplete.
    """
    if content is None:
        return None
    kind = content.get("type")
    if kind == "samples":
        raise RepairError("the curve in result.json is of type 'samples'; only splines can be certified")
    try:
        start, spacing = float(content["t_start_s"]), float(content["spacing_s"])
        points = frozen(content["control_points_m"])
        if kind == "uniform_bspline":
            return UniformBSpline(start, spacing, int(content["degree"]), points)
        if kind == "bernstein":
            return BernsteinCurve(start, spacing, points)
    except (KeyError, TypeError, ValueError) as error:
        raise RepairError(f"the curve in result.json is incomplete: {error!r}") from error
    raise RepairError(f"the curve in result.json is of type {kind!r}; only splines can be certified")
