"""Peaks of a driven path, measured the same way for every backend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.types import Array

if TYPE_CHECKING:
    from repair.scene.frame import CartesianPath

__all__ = ["Peaks", "peaks"]


@dataclass(frozen=True)
class Peaks:
    """Extremes over the samples, SI units; accelerations of the vehicle's centre."""

    min_speed: float
    max_speed: float
    min_acceleration: float
    max_acceleration: float
    max_lateral_acceleration: float
    max_total_acceleration: float


def peaks(path: CartesianPath, keep: npt.NDArray[np.bool_] | slice | None = None) -> Peaks:
    """Peaks over the samples that ``keep`` selects (all by default).

    The longitudinal acceleration is the derivative of the signed speed, the lateral one speed times
    the rate of the heading, both by differences over the dense, equally spaced samples.
    """
    if len(path.t) < 3:
        longitudinal: Array = np.zeros(len(path.t))
        lateral = longitudinal
    else:
        step = path.t[1] - path.t[0]
        longitudinal = _rate(path.speed, step)
        lateral = path.speed * _rate(path.heading, step)
    speed = path.speed
    if keep is not None:
        longitudinal, lateral, speed = longitudinal[keep], lateral[keep], speed[keep]
    return Peaks(
        float(np.minimum.reduce(speed)),
        float(np.maximum.reduce(speed)),
        float(np.minimum.reduce(longitudinal)),
        float(np.maximum.reduce(longitudinal)),
        float(np.maximum.reduce(np.abs(lateral))),
        float(np.maximum.reduce(np.hypot(longitudinal, lateral))),
    )


def _rate(values: Array, step: float) -> Array:
    """Derivative of equally spaced samples: central differences, one-sided at the ends."""
    result = np.empty_like(values)
    result[1:-1] = (values[2:] - values[:-2]) / (2.0 * step)
    result[0] = (values[1] - values[0]) / step
    result[-1] = (values[-1] - values[-2]) / step
    return result
