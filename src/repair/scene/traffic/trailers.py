"""Trailers, which follow their tractor: where each body of a train is.

CommonRoad's kinematic single-track model with one on-axle trailer (``vehicle_dynamics_kst`` of
commonroad-vehicle-models 3.0) hitches the trailer to the tractor's rear axle: with the hitch angle alpha its
heading is psi + alpha, and alpha' = -v (sin(alpha) / l_trailer + tan(delta) / l). A CommonRoad file gives the
bodies as a shape group, tractor first, their wheelbases as ``<wheelbase>``, and alpha in every state of the
trajectory. commonroad-io 2024.3 places them so in ``geometry.shape.shape_group_occupancy_shape_from_state``:
the state's position is the tractor's centre, each hitch lies half a wheelbase behind the centre before it,
the next centre half a wheelbase of its own behind the hitch. That is the reading here. Its reader, however,
keeps the lengths in ``prediction.wheelbase`` where that function never sees them: its occupancies, and with
them CommonRoad's own collision check, lay every trailer on its tractor (noted in the scene).

Where a state has no hitch angle (initial states never have one) the trailer is dragged: its axle moves along
its own heading, which is what the equation above says without time in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import ScenarioError
from repair.scene.traffic.shapes import Placed, interval, outlines

__all__ = ["is_train", "train", "wheelbases_of"]


def wheelbases_of(obstacle: Any) -> tuple[float, ...] | None:
    """Wheelbases of the bodies of a train [m]; None where the obstacle has none."""
    for owner in (getattr(obstacle, "prediction", None), obstacle):
        for name in ("wheelbase", "wheelbase_lengths", "_wheelbase_lenghts"):  # so it is spelt there
            value = getattr(owner, name, None)
            if value is not None and len(value):
                return tuple(float(length) for length in value)
    return None


def is_train(obstacle: Any) -> bool:
    """Whether an obstacle is a tractor with a trailer: several bodies, and wheelbases or hitch angles."""
    if len(_bodies(obstacle.obstacle_shape)) < 2:
        return False
    trajectory = getattr(getattr(obstacle, "prediction", None), "trajectory", None)
    if trajectory is None:
        return False
    hitched = any(vars(state).get("hitch_angle") is not None for state in trajectory.state_list)
    return hitched or wheelbases_of(obstacle) is not None


def train(
    obstacle: Any, states: Mapping[int, Any], headings: Mapping[int, tuple[float, float]]
) -> dict[int, Placed]:
    """All bodies of a train, as the convex parts of one occupancy for each step.

    Parameters
    ----------
    obstacle : commonroad.scenario.obstacle.DynamicObstacle
    states : dict
        Time step -> state.
    headings : dict
        Time step -> smallest and largest orientation [rad].

    Raises
    ------
    ScenarioError
        If a pose is uncertain, or there is not one wheelbase for each body.
    """
    bodies = _bodies(obstacle.obstacle_shape)
    lengths = wheelbases_of(obstacle) or tuple(_length_of(body) for body in bodies)
    if len(lengths) != len(bodies):
        raise ScenarioError(f"it has {len(lengths)} wheelbases for {len(bodies)} bodies")
    if not (np.isfinite(lengths).all() and min(lengths) > 0.0):
        raise ScenarioError("a wheelbase of it is not a positive length")
    order = sorted(states)
    centres, angles = _tractor(order, states, headings)
    hitches = [_hitch_of(states[step]) for step in order]
    shells = [[*outlines(bodies[0], c, a)] for c, a in zip(centres, angles, strict=True)]
    tractor = angles
    for k, body in enumerate(bodies[1:], start=1):
        hitch = centres - 0.5 * lengths[k - 1] * _along(angles)
        angles = _dragged(hitch, angles, hitches, lengths[k])
        centres = hitch - 0.5 * lengths[k] * _along(angles)
        for shell, centre, angle in zip(shells, centres, angles, strict=True):
            shell.extend(outlines(body, centre, float(angle)))
    placed = {}
    for step, shell, heading in zip(order, shells, tractor.tolist(), strict=True):
        x, y = (float(v) for v in np.asarray(states[step].position)[:2])
        speed = vars(states[step]).get("velocity")
        speed = np.nan if speed is None else sum(interval(speed)) / 2.0
        placed[step] = Placed(None, None, tuple(shell), (x, y, heading, speed))
    return placed


def _bodies(shape: Any) -> list[Any]:
    return list(getattr(shape, "shapes", ()))


def _length_of(body: Any) -> float:
    """A body's length, which stands for its wheelbase where the file gives none [m]."""
    return float(np.ptp(np.concatenate(outlines(body, np.zeros(2), 0.0))[:, 0]))


def _along(angles: Array) -> Array:
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def _tractor(
    order: Sequence[int], states: Mapping[int, Any], headings: Mapping[int, tuple[float, float]]
) -> tuple[Array, Array]:
    """Centres (T, 2) and headings (T,) of the tractor."""
    for step in order:
        position, (low, high) = states[step].position, headings[step]
        if hasattr(position, "center") or hasattr(position, "shapes") or low != high:
            raise ScenarioError(f"it draws a trailer, and its pose at time step {step} is uncertain")
    centres = np.array([np.asarray(states[step].position)[:2] for step in order], dtype=np.float64)
    return centres, np.array([headings[step][0] for step in order])


def _hitch_of(state: Any) -> float:
    """Hitch angle of a state [rad]; NaN where it has none."""
    value = vars(state).get("hitch_angle")
    if value is None:
        return np.nan
    low, high = interval(value)
    if low != high:
        raise ScenarioError("a hitch angle of it is uncertain")
    return low


def _dragged(hitch: Array, leading: Array, hitches: Sequence[float], length: float) -> Array:
    """Headings (T,) of a trailer behind a body with headings ``leading``, hitched at ``hitch`` (T, 2)."""
    found = leading + np.asarray(hitches)
    known = np.flatnonzero(np.isfinite(found))
    if not len(known):
        found[0], known = leading[0], np.array([0])
    for k in range(int(known[0]) - 1, -1, -1):  # before: the axle came along its own heading
        along = _along(found[k + 1])
        axle = hitch[k + 1] - length * along - float((hitch[k + 1] - hitch[k]) @ along) * along
        found[k] = np.arctan2(*(hitch[k] - axle)[::-1])
    for k in range(int(known[0]) + 1, len(found)):
        if np.isnan(found[k]):
            axle = hitch[k - 1] - length * _along(found[k - 1])
            found[k] = np.arctan2(*(hitch[k] - axle)[::-1])
    return np.asarray(found)
