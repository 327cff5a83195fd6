"""The end of a repair as plain values: what ``result.json`` holds of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import column, number
from repair.check.verdict import Violation
from repair.curves.base import Curve
from repair.terminal.verdict import Terminal
from repair.vehicle.states import DrivenStates

__all__ = ["columns_of", "detail_of", "place_of", "terminal_to_dict"]


def terminal_to_dict(terminal: Terminal | None) -> dict[str, Any] | None:
    """How a repair ends; None where nobody asked, or there is no repair.

    Parameters
    ----------
    terminal : Terminal or None
    """
    if terminal is None:
        return None
    shown = terminal.continuation
    stop = None if shown is None else shown.stop
    return {
        "ending": terminal.ending.value,
        "sentence": terminal.ending.sentence,
        "maneuver": None if shown is None else shown.maneuver,
        "from_s": None if stop is None else number(stop.t_start),
        "stands_s": None if stop is None else number(stop.stands_at),
        "checked_until_s": None if stop is None else number(stop.t_end),
        "offset_m": None if stop is None else number(stop.path.target),
        "peak_deceleration_mps2": None if stop is None else number(float(stop.phases[:, 3].min())),
        "extended": {
            how: None if violation is None else detail_of(violation)
            for how, violation in terminal.extended.items()
        },
        "details": [detail_of(violation) for violation in terminal.violations],
        "tried": terminal.tried,
        "trajectory": None if shown is None else columns_of(shown.states, shown.stop),
    }


def detail_of(violation: Violation) -> dict[str, Any]:
    """A violation: reason, time, particulars in words, obstacle, place."""
    return {
        "reason": violation.reason.value,
        "t_s": number(violation.time),
        "detail": violation.detail,
        "obstacle_id": getattr(violation, "obstacle_id", None),
        "place_m": place_of(violation.place),
    }


def place_of(place: tuple[float, float] | None) -> list[float | None] | None:
    """A place to the millimetre [m]."""
    return None if place is None else [number(value, 3) for value in place]


def columns_of(states: DrivenStates, curve: Curve) -> dict[str, Any]:
    """Driven states at the scenario's steps; centre of the vehicle, speed at the rear axle."""
    along = curve.sample(states.t)
    return {
        "t_s": column(states.t),
        "x_m": column(states.x),
        "y_m": column(states.y),
        "orientation_rad": column(np.arctan2(np.sin(states.orientation), np.cos(states.orientation))),
        "steering_rad": column(states.steering),
        "speed_mps": column(states.speed),
        "s_m": column(along.position[:, 0]),
        "l_m": column(along.position[:, 1]),
    }
