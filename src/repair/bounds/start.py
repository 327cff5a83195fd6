"""Where a reaction starts, and what is assumed of the motions from there on, for each kind of bound."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import wrap
from repair.bounds.motion import Motions

if TYPE_CHECKING:
    from repair.check.settings import CheckerConfig
    from repair.problem.limits import Limits
    from repair.vehicle.parameters import Vehicle
    from repair.vehicle.states import DrivenStates

__all__ = ["driven_within", "motions_from"]

#: Share by which the limits that the checker samples every millisecond may be exceeded between the samples.
SAMPLED = 0.01


def motions_from(
    states: DrivenStates, k: int, kind: str, vehicle: Vehicle, limits: Limits, checker: CheckerConfig
) -> Motions:
    """All motions from a sample of the reference on.

    Parameters
    ----------
    states : DrivenStates
        Along the reference.
    k : int
        The sample.
    kind : str
        ``vehicle``: the rear axle of the kinematic single-track model, with friction, engine and steering
        angle, but any steering rate. ``search``: the middle of the body, with the limits and the safety
        margin of the checker.
    vehicle, limits, checker
        Of the situation.
    """
    x, y, psi = float(states.x[k]), float(states.y[k]), float(states.orientation[k])
    speed, steering = float(states.speed[k]), float(states.steering[k])
    along = np.array([math.cos(psi), math.sin(psi)])
    rate = speed * math.tan(steering) / vehicle.wheelbase
    power = vehicle.a_max * vehicle.v_switch
    if kind == "vehicle":
        return Motions(
            np.array([x, y]) - vehicle.rear * along, max(speed, 0.0) * along, psi, rate, vehicle.a_max,
            math.tan(vehicle.steering_max) / vehicle.wheelbase, 0.0, vehicle.rear,
            vehicle.half_length, vehicle.half_width, vehicle.a_max, vehicle.a_max, power,
        )  # fmt: skip
    more = (1.0 + SAMPLED) * (1.0 + checker.tolerance)
    across = vehicle.rear * rate * np.array([-along[1], along[0]])
    return Motions(
        np.array([x, y]), speed * along + across, psi, rate, more * limits.a_total,
        vehicle.largest_curvature(), vehicle.rear, 0.0, vehicle.half_length + checker.clearance,
        vehicle.half_width + checker.clearance, more * limits.a_max, -more * limits.a_min, more * power,
    )  # fmt: skip


def driven_within(
    states: DrivenStates, first: int, last: int, kind: str, vehicle: Vehicle, most: float
) -> bool:
    """Whether the reference itself is such a motion between two samples.

    It is then one of the motions of every earlier reaction, so that what holds at the first sample holds at
    all later ones.
    """
    part = slice(first, last + 1)
    psi, v, h = states.orientation[part], states.speed[part], np.diff(states.t[part])
    velocity = v * np.exp(1j * psi)
    if kind != "vehicle":
        rate = v * np.tan(states.steering[part]) / vehicle.wheelbase
        velocity = velocity + 1j * vehicle.rear * rate * np.exp(1j * psi)
    ok = np.abs(np.diff(velocity)) <= most * h * (1.0 + SAMPLED) + 1e-6
    turned = np.abs(wrap(np.diff(psi))) <= math.pi / 2
    return bool(ok.all() and turned.all() and (v >= -1e-6).all())
