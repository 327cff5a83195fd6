"""Legs: what is driven after the evasive part, along a path that may lead back to the axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, column, frozen, number
from repair.curves.base import FrenetTrajectory
from repair.problem.lateral import quintics
from repair.terminal.stop import Settling

__all__ = ["Leg", "leg_from_dict", "leg_to_dict", "motions"]


@dataclass(frozen=True)
class Leg:
    """A quintic in time along a path l(s); implements :class:`repair.curves.base.Curve`.

    Attributes
    ----------
    t_start, t_end : float
        Span [s].
    along : (4,) array
        s, ds/dt and d²s/dt² at the start, and s at the end [m].
    speed : float
        ds/dt at the end [m/s], where the acceleration is 0; it is held from there on.
    path : Settling
    """

    t_start: float
    t_end: float
    along: Array
    speed: float
    path: Settling

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate position and derivatives; the jerk is that along the path alone."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        s, v, a = (row[0] for row in motions(
            self.along[:3], np.array([self.along[3]]), np.array([self.speed]),
            np.array([self.t_end - self.t_start]), np.maximum(times - self.t_start, 0.0),
        ))  # fmt: skip
        l, slope, bend = self.path.at(s)  # noqa: E741
        zero = np.zeros_like(s)
        return FrenetTrajectory(
            times,
            np.column_stack([s, l]),
            np.column_stack([v, slope * v]),
            np.column_stack([a, slope * a + bend * v * v]),
            np.column_stack([zero, zero]),
        )


def motions(
    start: Array, place: Array, speed: Array, duration: Array, tau: Array
) -> tuple[Array, Array, Array]:
    """Quintics from (s, v, a) to (place, speed, 0), at the end speed from there on.

    Parameters
    ----------
    start : (3,) array
    place, speed, duration : (Q,) array
        Where they end [m], how fast [m/s], after what time [s].
    tau : (K,) array
        Times to look at [s].

    Returns
    -------
    s, v, a : (Q, K) array
    """
    # Less what a steady motion at the end speed makes of it, that is a quintic to rest.
    parts = []
    for s1, v1, d in zip(place, speed, duration, strict=True):
        steady = s1 - v1 * d
        rest = quintics(
            np.array([start[0] - steady, start[1] - v1, start[2]]), np.zeros(1), np.array([d]), tau
        )
        parts.append((rest[0][0] + steady + v1 * tau, rest[1][0] + v1, rest[2][0]))
    s, v, a = (np.array([part[k] for part in parts]) for k in range(3))
    return s, v, a


def leg_to_dict(leg: Leg) -> dict[str, Any]:
    """Plain values, from which :func:`leg_from_dict` makes it again."""
    return {
        "t_start_s": number(leg.t_start),
        "t_end_s": number(leg.t_end),
        "along": column(leg.along, 12),
        "speed_mps": number(leg.speed, 12),
        "path_from_m": number(leg.path.s0, 12),
        "path_start": column(leg.path.start, 12),
        "path_target_m": number(leg.path.target, 12),
        "path_length_m": number(leg.path.length, 12),
    }


def leg_from_dict(content: Any) -> Leg:
    """The leg that :func:`leg_to_dict` wrote.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is incomplete.
    """
    path = Settling(
        float(content["path_from_m"]), frozen(content["path_start"]), float(content["path_target_m"]),
        float(content["path_length_m"]),
    )  # fmt: skip
    return Leg(
        float(content["t_start_s"]), float(content["t_end_s"]), frozen(content["along"]),
        float(content["speed_mps"]), path,
    )  # fmt: skip
