"""Peaks of a driven path, measured the same way for every backend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath

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
    measured = np.zeros((4, len(path.t)))
    measured[0] = path.speed
    if len(path.t) >= 3:
        motion = np.array((path.speed, path.heading))
        longitudinal, turning = _rate(motion, path.t[1] - path.t[0])
        lateral = path.speed * turning
        measured[1] = longitudinal
        np.abs(lateral, out=measured[2])
        np.hypot(longitudinal, lateral, out=measured[3])
    if keep is not None:
        measured = measured[:, keep]
    low = np.minimum.reduce(measured[:2], axis=1).tolist()
    high = np.maximum.reduce(measured, axis=1).tolist()
    return Peaks(low[0], high[0], low[1], *high[1:])


def _rate(values: Array, step: float) -> Array:
    """Derivative of equally spaced samples (..., K): central differences, one-sided at the ends."""
    result = np.empty_like(values)
    result[..., 1:-1] = (values[..., 2:] - values[..., :-2]) / (2.0 * step)
    result[..., 0] = (values[..., 1] - values[..., 0]) / step
    result[..., -1] = (values[..., -1] - values[..., -2]) / step
    return result
