"""What the ego demands of tyres, engine and steering, against the limits asked for and the vehicle's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.certify.certificate import CertificateRow, at_least, at_most
from repair.certify.motion import Motion, States
from repair.certify.solution import STANDS
from repair.timegrid import INSTANT

if TYPE_CHECKING:
    from repair.problem.limits import Limits
    from repair.vehicle.parameters import Vehicle

_PLACE, _ORIENTATION = 0.02, 0.03  # the drivability checker's tolerances [m], [rad]
_PARTS = 20  # of a step, in which the model is integrated
# Steering angle [rad] and speed [m/s] at the end of a step beside the next state's, within its tolerances.
_ELSEWHERE = [(beyond, faster) for beyond in np.linspace(-0.03, 0.03, 13) for faster in (0.0, -0.03, 0.03)]

__all__ = ["driven_rows", "physical_rows", "weakened"]


def driven_rows(motion: Motion, limits: Limits, reference: Limits, t_rep: float) -> list[CertificateRow]:
    """The middle of the vehicle along the curve, from millisecond to millisecond.

    The reference until the repair begins and the repair are held against limits of their own; a row has the
    one that is nearer to its limit.

    Parameters
    ----------
    motion : Motion
    limits : Limits
        Of the repair.
    reference : Limits
        Of the reference, which is followed until then; it may begin by rolling back, as the planning problem
        has it.
    t_rep : float
        When the repair begins [s]; inf without one.
    """
    step = np.diff(motion.t)
    along = np.diff(motion.speed) / step
    across = 0.5 * (motion.speed[1:] + motion.speed[:-1]) * np.diff(motion.heading) / step
    slow = np.minimum(np.abs(motion.speed[1:]), np.abs(motion.speed[:-1])) < STANDS
    # A direction is held where it stands; who sets out with turned wheels leaves it without any force.
    across[slow] = 0.0
    begins = int(motion.t.searchsorted(t_rep - INSTANT))
    rolling = min(0.0, float(motion.speed[0]))
    parts = [
        _held(motion.speed[part], along[part], across[part], own, slowest)
        for part, own, slowest in (
            (slice(begins, None), limits, 0.0),
            (slice(0, begins), reference, rolling),
        )
        if len(along[part])
    ]
    rows = [min(same, key=lambda row: row.margin) for same in zip(*parts, strict=True)]
    return [row for row in rows if np.isfinite(row.limit)]  # CommonRoad's own checker judges the rest


def _held(speed: Array, along: Array, across: Array, limits: Limits, slowest: float) -> list[CertificateRow]:
    """A part of the way against the limits that hold there."""
    grip = float(np.hypot(along, across).max())
    return [
        at_most("speed, driven", float(speed.max()), limits.v_max, "sampled", "m/s"),
        at_least("speed, driven, least", float(speed.min()), slowest, "sampled", "m/s"),
        at_least("acceleration, driven, least", float(along.min()), limits.a_min, "sampled", "m/s²"),
        at_most("acceleration, driven, largest", float(along.max()), limits.a_max, "sampled", "m/s²"),
        at_most("lateral acceleration", float(np.abs(across).max()), limits.a_lat, "sampled", "m/s²"),
        at_most("friction circle", grip, limits.a_total, "sampled", "m/s²"),
    ]


def physical_rows(states: States, dt: float, vehicle: Vehicle) -> list[CertificateRow]:
    """The states of the solution file before CommonRoad's own parameters, whatever was asked for.

    The steering rate is told; what counts of it is where the vehicle gets to with the rate that it has.
    """
    v, delta = states.speed, states.steering
    along, rate = np.diff(v) / dt, np.diff(delta) / dt
    across = v**2 * np.tan(delta) / vehicle.wheelbase
    grip = np.hypot(along, across[:-1])  # at the start of a step, as the drivability checker has it
    engine = vehicle.engine_acceleration(np.minimum(v[1:], v[:-1]))
    use = np.where(along > 0.0, along / engine, -along / vehicle.a_max)
    most, rate_most, way = vehicle.a_max, vehicle.steering_rate_max, float(np.abs(rate).max(initial=0.0))
    off, turned = _missed(states, dt, vehicle)
    return [
        at_most("vehicle: speed", float(np.abs(v).max()), vehicle.v_max, "files", "m/s"),
        at_most("vehicle: engine and brakes", float(use.max(initial=0.0)), 1.0, "files", "share"),
        at_most("vehicle: grip of the tyres", float(grip.max(initial=0.0)), most, "files", "m/s²"),
        at_most("vehicle: steering angle", float(np.abs(delta).max()), vehicle.steering_max, "files", "rad"),
        CertificateRow(
            "vehicle: steering rate", way, rate_most, rate_most - way, way <= rate_most, "files", "rad/s",
            claim=False,
        ),
        at_most("vehicle: place missed with it cut off", off, _PLACE, "files", "m"),
        at_most("vehicle: orientation missed with it cut off", turned, _ORIENTATION, "files", "rad"),
    ]  # fmt: skip


def _missed(states: States, dt: float, vehicle: Vehicle) -> tuple[float, float]:
    """By how much the next states are missed, the steering rate cut off: place [m], orientation [rad].

    A step may end with another steering angle and speed than the next state's, by as much as the drivability
    checker allows: that counts which misses the least, as there, where inputs are optimised.
    """
    psi = np.unwrap(states.orientation)
    axle = states.xy - vehicle.rear * np.stack([np.cos(psi), np.sin(psi)], axis=1)
    v, delta = states.speed, states.steering
    reach, share = vehicle.steering_rate_max * dt, 1.0 / _PARTS
    best = np.full((2, max(len(v) - 1, 0)), np.inf)
    for beyond, faster in _ELSEWHERE:
        change, gained = np.clip(np.diff(delta) + beyond, -reach, reach), np.diff(v) + faster
        here, body = axle[:-1].copy(), psi[:-1].copy()
        for i in range(_PARTS):
            middle = (i + 0.5) * share
            way = (v[:-1] + middle * gained) * dt * share
            turn = way * np.tan(delta[:-1] + middle * change) / vehicle.wheelbase
            here += way[:, None] * np.stack([np.cos(body + 0.5 * turn), np.sin(body + 0.5 * turn)], axis=1)
            body += turn
        missed = np.array((np.abs(here - axle[1:]).max(axis=1), np.abs(body - psi[1:])))
        allowed = np.array([[_PLACE], [_ORIENTATION]])
        nearer = (missed / allowed).max(axis=0) < (best / allowed).max(axis=0)
        best[:, nearer] = missed[:, nearer]
    return float(best[0].max(initial=0.0)), float(best[1].max(initial=0.0))


def weakened(limits: Limits, usual: Limits) -> list[str]:
    """Limits that allow more than those that hold where nothing is asked for, in words.

    Not ``a_max``: the engine is judged whatever is asked for (``vehicle: engine and brakes``).
    """
    found = []
    for name in ("v_max", "v_lat", "a_lat", "a_total", "j_lon", "j_lat", "curvature"):
        value, most = getattr(limits, name), getattr(usual, name)
        if value > most * (1.0 + 1e-9):
            found.append(f"limits.{name}={value:g} (usual: {most:g})")
    if limits.a_min < usual.a_min * (1.0 + 1e-9):
        found.append(f"limits.a_min={limits.a_min:g} (usual: {usual.a_min:g})")
    return found
