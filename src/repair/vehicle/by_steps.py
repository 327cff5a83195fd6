"""Paths that a vehicle can follow whose inputs are constant over each of the scenario's time steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.vehicle.transitions import ORIENTATION_TOLERANCE, POSITION_TOLERANCE, STEERING_RATE

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle

__all__ = ["missed_by_steps"]


def missed_by_steps(kappa: Array, speed: Array, dt: float, vehicle: Vehicle) -> float:
    """By how much one steering rate for each step misses a path, as a share of what is clearly drivable.

    With a constant rate the curvature is linear in time. What the path's differs from that is integrated over
    the step: once for the orientation at its end, twice for how far that lies beside the path.

    Parameters
    ----------
    kappa, speed : (K, n + 1) array
        Curvature of the path [1/m] and speed along it [m/s] at equal times within K steps, ends included.
    dt : float
        Time step [s].
    vehicle : Vehicle

    Returns
    -------
    float
        Above 1 the direct check (:mod:`repair.vehicle.transitions`) would not accept it.
    """
    parts = kappa.shape[1] - 1
    change = kappa[:, -1:] - kappa[:, :1]
    way = speed * (dt / parts)
    off = (kappa - kappa[:, :1] - change * np.linspace(0.0, 1.0, parts + 1)) * way
    turned = np.cumsum(0.5 * (off[:, 1:] + off[:, :-1]), axis=1)
    beside = np.sum(turned * way[:, 1:], axis=1)
    rate = vehicle.wheelbase * float(np.abs(change).max()) / dt
    return max(
        float(np.abs(beside).max()) / (0.5 * POSITION_TOLERANCE),
        float(np.abs(turned[:, -1]).max()) / (0.4 * ORIENTATION_TOLERANCE),
        rate / (STEERING_RATE * vehicle.steering_rate_max),
    )
