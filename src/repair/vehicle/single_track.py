"""Kinematic single-track states along a driven path.

The model is CommonRoad's KS model (Althoff and Würsching, *CommonRoad: Vehicle Models*, 2020),
referenced to the rear axle; CommonRoad states are referenced to the centre of the vehicle, ``rear``
(b) ahead of that axle. With theta the direction of the centre's velocity and psi the orientation of
the body, the slip angle at the centre is beta = theta - psi, and

    tan(beta) = b / L * tan(delta)                     (no slip at the wheels)
    d(psi)/d(sigma) = sin(beta) / b                    (sigma: arc length driven forward)

Whether the vehicle can drive from state to state is for :mod:`repair.vehicle.transitions` to say.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, smallest
from repair.vehicle.states import DrivenStates

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.vehicle.parameters import Vehicle

__all__ = ["body_angles", "drive", "driven_states"]

# Samples at least this far apart [m] are those of a moving vehicle.
_MOVES = 1e-9
# Factors as arrays, because NumPy takes long to convert a plain number.
_TWICE, _DECAY = np.array(2.0), np.array(-2.0)


def drive(
    t: Array,
    xy: Array,
    heading: Array,
    speed: Array,
    distance: Array,
    vehicle: Vehicle,
    *,
    slip0: float | None = None,
) -> DrivenStates:
    """States of the vehicle whose centre drives a sampled path.

    Parameters
    ----------
    t : (K,) array
        Times [s].
    xy : (K, 2) array
        Centre of the vehicle [m].
    heading : (K,) array
        Direction theta of the centre's velocity [rad], unwrapped.
    speed : (K,) array
        Speed of the centre [m/s], negative while reversing (the heading then still points forward).
    distance : (K,) array
        Arc length driven by the centre [m], growing in either direction.
    vehicle : Vehicle
    slip0 : float, optional
        Slip angle beta = theta - psi at the first sample [rad]; by default that of steady driving at
        the path's initial curvature, asin(kappa b).

    Returns
    -------
    DrivenStates
        Where ``distance`` does not grow, orientation and steering are held: a vehicle at rest does
        not turn, whatever the path's heading does there.
    """
    step, turn = distance[1:] - distance[:-1], heading[1:] - heading[:-1]
    slowest = float(np.minimum.reduce(speed, initial=np.inf))
    slip, orientation = _angles(heading, speed, step, turn, slowest, vehicle.rear, slip0)
    return driven_states(t, xy, speed, slip, orientation, vehicle)


def body_angles(path: CartesianPath, vehicle: Vehicle, slip0: float | None = None) -> tuple[Array, Array]:
    """Slip angle and orientation along a path in the plane, by the rules of :func:`drive`.

    Parameters
    ----------
    path : CartesianPath
    vehicle : Vehicle
    slip0 : float, optional
        Slip angle at the first sample [rad], as in :func:`drive`.

    Returns
    -------
    slip, orientation : (K,) array
        [rad]
    """
    return _angles(path.heading, path.speed, path.step, path.turn, path.slowest, vehicle.rear, slip0)


def _angles(
    heading: Array, speed: Array, step: Array, turn: Array, slowest: float, rear: float, slip0: float | None
) -> tuple[Array, Array]:
    if len(step) and smallest(step) > _MOVES:
        if not slowest > 0.0:
            step = np.copysign(step, speed[1:] + speed[:-1])
        slip = _slip_angle(turn, step, step, rear, slip0)
        return slip, heading - slip
    moving = step > _MOVES
    step = np.where(moving, np.copysign(step, speed[1:] + speed[:-1]), 0.0)
    turn = np.where(moving, turn, 0.0)
    # Where nothing moves, nothing turns: a length of 1 there only avoids the division by zero.
    slip = _slip_angle(turn, step, np.where(moving, step, 1.0), rear, slip0)
    return slip, heading[0] + np.concatenate(([0.0], np.cumsum(turn))) - slip


def driven_states(
    t: Array, xy: Array, speed: Array, slip: Array, orientation: Array, vehicle: Vehicle
) -> DrivenStates:
    """States at samples of which :func:`body_angles` gave the angles: all of them, or every n-th.

    Parameters
    ----------
    t, xy, speed : array
        As in :func:`drive`.
    slip, orientation : (K,) array
        [rad]
    vehicle : Vehicle
    """
    steering = np.arctan(vehicle.wheelbase / vehicle.rear * np.tan(slip))
    return DrivenStates(t, xy[:, 0], xy[:, 1], steering, speed * np.cos(slip), orientation)


def _slip_angle(turn: Array, step: Array, length: Array, rear: float, slip0: float | None) -> Array:
    """Integrate d(beta)/d(sigma) = d(theta)/d(sigma) - sin(beta)/b over the samples.

    ``length`` is ``step`` but for intervals on which nothing moves, and not 0 there. Each interval is
    split: half of the turn, then a straight piece, then the other half. On a straight piece the rear
    axle draws a tractrix, tan(beta/2) shrinking by exp(-step/b) exactly; the turn is scaled so that the
    small-angle solution at constant curvature is exact as well. In tan(beta/2) a rotation is a Möbius
    map, so that the recurrence needs no trigonometric function.
    """
    if slip0 is None:
        slip0 = _steady(turn, step, length, rear)
    if not len(step):
        return np.array([slip0])
    ratio = step * (0.5 / rear)
    quarter = (0.5 * rear) * turn * np.tanh(ratio) / length
    half = quarter.copy()  # of the rotation between two straight pieces
    half[1:] += quarter[:-1]
    value = math.tan(0.5 * slip0)
    tangents = np.tan(half).tolist()
    with np.errstate(over="ignore"):  # it grows for who goes back, and in one huge step beyond all numbers
        decay = np.exp(_DECAY * ratio).tolist()
    slip = np.empty(len(step) + 1)
    slip[0] = slip0
    slip[1:] = [
        value := factor * (value + tangent) / (1.0 - value * tangent)
        for tangent, factor in zip(tangents, decay, strict=True)
    ]
    slip[1:] = _TWICE * (np.arctan(slip[1:]) + quarter)
    return slip


def _steady(turn: Array, step: Array, length: Array, rear: float) -> float:
    """Slip angle [rad] of steady driving where the path begins to move."""
    if not len(step):
        return 0.0
    first = 0 if step[0] else int(np.argmax(step != 0.0))
    bend = rear * float(turn[first]) / float(length[first])
    return math.asin(min(max(bend, -0.95), 0.95))
