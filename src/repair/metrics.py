"""Peaks of a driven path, measured the same way for every backend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

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


def peaks(path: CartesianPath, keep: npt.NDArray[np.bool_] | None = None) -> Peaks:
    """Peaks over the samples that ``keep`` selects (all by default).

    The longitudinal acceleration is the derivative of the signed speed, the lateral one speed times
    the rate of the heading, both by second-order differences over the dense samples.
    """
    selected = np.ones(len(path.t), dtype=bool) if keep is None else keep
    if len(path.t) < 3:
        zero = np.zeros(len(path.t))
        longitudinal, lateral = zero, zero
    else:
        longitudinal = np.gradient(path.speed, path.t)
        lateral = path.speed * np.gradient(path.heading, path.t)
    longitudinal, lateral, speed = longitudinal[selected], lateral[selected], path.speed[selected]
    return Peaks(
        float(speed.min()),
        float(speed.max()),
        float(longitudinal.min()),
        float(longitudinal.max()),
        float(np.abs(lateral).max()),
        float(np.hypot(longitudinal, lateral).max()),
    )
