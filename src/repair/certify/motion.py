"""The ego's way through the plane, twice: as the solution file says, and as the curve says.

An integration of its own of CommonRoad's kinematic single-track model (Althoff and Würsching, *CommonRoad:
Vehicle Models*, 2020); nothing of :mod:`repair.vehicle` but the parameters takes part.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.certify.certificate import SAMPLE

if TYPE_CHECKING:
    from repair.curves.base import Curve
    from repair.scene.frame import FrenetFrame
    from repair.vehicle.parameters import Vehicle

__all__ = ["Motion", "States", "along_curve", "states_of", "through_states", "wrapped"]


@dataclass(frozen=True)
class Motion:
    """Poses of the middle of the vehicle, linear in time between the samples.

    Attributes
    ----------
    t : (K,) array
        [s]
    poses : (K, 3) array
        x, y [m] and orientation [rad], unwrapped.
    speed, heading : (K,) array
        Of the middle of the vehicle [m/s], [rad].
    """

    t: Array
    poses: Array
    speed: Array
    heading: Array


@dataclass(frozen=True)
class States:
    """The states of a solution file, or of the columns of a record.

    Attributes
    ----------
    steps : (T,) array
        Time steps.
    xy : (T, 2) array
    orientation, speed, steering : (T,) array
    """

    steps: Array
    xy: Array
    orientation: Array
    speed: Array
    steering: Array


def wrapped(angle: Any) -> Any:
    """Angles brought into [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi


def states_of(source: Any) -> States:
    """States of a list of CommonRoad KS states, or of the columns of ``trajectory`` in ``result.json``.

    Raises
    ------
    KeyError, AttributeError, TypeError, ValueError
        If it is neither.
    """
    if isinstance(source, Mapping):
        first, count = int(source["initial_time_step"]), len(source["t_s"])
        names = ("x_m", "y_m", "orientation_rad", "speed_mps", "steering_rad")
        x, y, psi, v, delta = (np.array(source[name], dtype=np.float64) for name in names)
        return States(first + np.arange(count, dtype=np.float64), np.stack([x, y], axis=1), psi, v, delta)
    rows = [
        (s.time_step, s.position[0], s.position[1], s.orientation, s.velocity, s.steering_angle)
        for s in source
    ]
    steps, x, y, psi, v, delta = np.array(rows, dtype=np.float64).T
    return States(steps, np.stack([x, y], axis=1), psi, v, delta)


def through_states(states: States, first: int, dt: float, vehicle: Vehicle) -> Motion:
    """Drive from state to state with constant acceleration and steering rate.

    What the end of a step misses of the next state is spread over the step, so that the way is continuous.
    """
    count = max(math.ceil(dt / SAMPLE - 1e-9), 1)
    h, rear, base = dt / count, vehicle.rear, vehicle.wheelbase
    psi = np.unwrap(states.orientation)
    axle = states.xy - rear * np.stack([np.cos(psi), np.sin(psi)], axis=1)
    v, delta = states.speed, states.steering
    times, rows = [], []
    share = np.arange(count + 1) / count
    for k in range(len(psi) - 1):
        speed = v[k] + share * (v[k + 1] - v[k])
        middle = 0.5 * (speed[1:] + speed[:-1])
        steer = delta[k] + (share[:-1] + 0.5 / count) * (delta[k + 1] - delta[k])
        turn = np.concatenate(([0.0], np.cumsum(middle * np.tan(steer) * (h / base))))
        angle = psi[k] + 0.5 * (turn[1:] + turn[:-1])
        way = np.stack([middle * np.cos(angle), middle * np.sin(angle)], axis=1) * h
        place = axle[k] + np.concatenate((np.zeros((1, 2)), np.cumsum(way, axis=0)))
        place += share[:, None] * (axle[k + 1] - place[-1])
        body = psi[k] + turn
        body += share * (psi[k + 1] - body[-1])
        times.append((states.steps[k] - first + share[:-1]) * dt)
        rows.append(np.column_stack([place, body])[:-1])
    times.append(np.array([(states.steps[-1] - first) * dt]))
    rows.append(np.array([[*axle[-1], psi[-1]]]))
    t, poses = np.concatenate(times), np.concatenate(rows)
    poses[:, :2] += rear * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=1)
    rate = np.diff(poses[:, :2], axis=0)
    length = np.hypot(rate[:, 0], rate[:, 1]) / np.maximum(np.diff(t), 1e-12)
    return Motion(t, poses, np.append(length, length[-1:]), poses[:, 2])


def along_curve(
    curve: Curve, frame: FrenetFrame, vehicle: Vehicle, t_end: float, dt: float, orientation: float | None
) -> Motion:
    """Drive the vehicle's middle along a curve; the body follows as the rear axle allows.

    Parameters
    ----------
    curve : Curve
        In the frame, over [0, ``t_end``].
    frame : FrenetFrame
    vehicle : Vehicle
    t_end, dt : float
        End, and the scenario's step, which the samples divide [s].
    orientation : float or None
        Of the body at t = 0 [rad]; None for that of steady driving.
    """
    count = max(math.ceil(dt / SAMPLE - 1e-9), 1)
    samples = round(t_end / dt * count)
    t = np.arange(samples + 1) * (dt / count)
    path = frame.cartesian(curve.sample(t))
    heading, speed = path.heading, path.speed
    step = np.where(path.step > 1e-9, np.copysign(path.step, speed[1:] + speed[:-1]), 0.0)
    turn = np.where(path.step > 1e-9, np.diff(heading), 0.0)
    if orientation is None:
        moving = np.flatnonzero(step != 0.0)
        bend = turn[moving[0]] / step[moving[0]] if len(moving) else 0.0
        slip = math.asin(min(max(vehicle.rear * bend, -0.95), 0.95))
    else:
        slip = float(wrapped(heading[0] - orientation))
    body, theta = [heading[0] - slip], float(heading[0])
    psi = body[0]
    for way, bent in zip(step.tolist(), turn.tolist(), strict=True):
        # the middle of the step, half of the body's turn already done
        before = math.sin(theta - psi) / vehicle.rear
        middle = theta + 0.5 * bent
        psi += way * math.sin(middle - (psi + 0.5 * way * before)) / vehicle.rear
        theta += bent
        body.append(psi)
    return Motion(t, np.column_stack([path.xy, body]), speed, heading)
