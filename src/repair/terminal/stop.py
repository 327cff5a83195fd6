"""Stops: to brake to standstill along a path that may leave the frame's axis sideways."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.check.limits import plane_accelerations
from repair.curves.base import FrenetTrajectory
from repair.problem.lateral import quintics
from repair.timegrid import steps_until

if TYPE_CHECKING:
    from repair.problem.limits import Limits
    from repair.scene.frame import FrenetFrame

__all__ = ["RESERVE", "Settling", "Stop", "settling_from", "stop_along"]

#: Share of every limit that a stop uses: it is laid out by samples, and checked at all times.
RESERVE = 0.98
_SPACING = 0.25  # at which the path is looked at [m]
_STANDS = 1e-2  # below this speed [m/s] a path has no direction
_RESTS = 1e-6  # what is slower than this is at rest, whatever its last digits [m/s]
_LONGEST = 60.0  # who has not come to rest by then never will [s]


@dataclass(frozen=True)
class Settling:
    """A path l(s): a quintic to an offset, parallel to the axis from there on.

    Attributes
    ----------
    s0 : float
        Where it begins [m].
    start : (3,) array
        Offset, slope and bend dl/ds, d²l/ds² there [m], [-], [1/m].
    target, length : float
        The offset that it ends at, and over which way [m].
    """

    s0: float
    start: Array
    target: float
    length: float

    def at(self, s: Array) -> tuple[Array, Array, Array]:
        """Offset, slope and bend at ``s`` (K,); before it begins as there."""
        rows = quintics(
            self.start, np.array([self.target]), np.array([self.length]), np.maximum(s - self.s0, 0.0)
        )
        return rows[0][0], rows[1][0], rows[2][0]


@dataclass(frozen=True)
class Stop:
    """A trajectory that brakes to standstill along a path; implements :class:`repair.curves.base.Curve`.

    Attributes
    ----------
    t_start, t_end : float
        From the state that it begins in to standstill, or a little longer [s].
    phases : (P, 4) array
        Time since ``t_start``, s, ds/dt and d²s/dt² at the start of each phase; the last one stands.
    path : Settling
    """

    t_start: float
    t_end: float
    phases: Array
    path: Settling

    @property
    def stands_at(self) -> float:
        """When it has come to rest [s]."""
        return self.t_start + float(self.phases[-1, 0])

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate position and derivatives; the jerk along the path is that within the phases."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        since = np.maximum(times - self.t_start, 0.0)
        t0, s0, v0, a = self.phases[np.searchsorted(self.phases[1:, 0], since + 1e-12, side="right")].T
        tau = since - t0
        s, v = s0 + v0 * tau + 0.5 * a * tau**2, np.maximum(v0 + a * tau, 0.0)
        l, slope, bend = self.path.at(s)  # noqa: E741
        return FrenetTrajectory(
            times,
            np.column_stack([s, l]),
            np.column_stack([v, slope * v]),
            np.column_stack([a, slope * a + bend * v * v]),
            np.column_stack([np.zeros_like(s), 3.0 * bend * v * a]),
        )


def settling_from(state: FrenetTrajectory, target: float | None, length: float) -> Settling:
    """A path from a state (its first sample) on.

    Parameters
    ----------
    state : FrenetTrajectory
    target : float or None
        Offset to end at [m]; None: where a path ends that straightens out evenly.
    length : float
        Over which way [m].
    """
    (s, l), (v, w), (a, b) = state.position[0], state.velocity[0], state.acceleration[0]  # noqa: E741
    slope = bend = 0.0
    if v > _STANDS:
        slope = w / v
        bend = (b - slope * a) / v**2
    length = max(length, 1e-2)
    if target is None:
        target = l + 0.5 * slope * length + bend * length**2 / 12.0
    return Settling(float(s), np.array([l, slope, bend]), float(target), length)


def stop_along(
    state: FrenetTrajectory, path: Settling, frame: FrenetFrame, limits: Limits, dt: float, share: float
) -> Stop | None:
    """Brake along a path, as hard as limits and friction circle leave it, or a share of that.

    The acceleration is constant from one scenario step to the next, as in the kinematic model's inputs, so
    that what is laid out can be driven. The state lies on a step.

    Parameters
    ----------
    state : FrenetTrajectory
        Where it begins: the first sample.
    path : Settling
    frame : FrenetFrame
    limits : Limits
    dt : float
        Scenario time step [s].
    share : float
        Of the braking that is possible, in (0, 1].

    Returns
    -------
    Stop or None
        None where the path's bends leave nothing to brake with.
    """
    t, s, v = float(state.t[0]), float(state.position[0, 0]), max(float(state.velocity[0, 0]), 0.0)
    begin = s
    reach = v * v / (2.0 * share * RESERVE * -limits.a_min) * 1.5 + v * dt + 1.0
    places = s + np.arange(0.0, reach + _SPACING, _SPACING)
    forward, along, across = _demands(path, frame, places)
    phases, since = [], 0.0
    while v > _RESTS:
        low, high = ((x - begin) / _SPACING for x in (s, s + v * dt))
        here = slice(int(low), min(int(high) + 2, len(places)))
        if here.start >= len(places) - 1 or since > _LONGEST:
            return None
        bend = float(across[here].max()) * v * v
        room = min(RESERVE * -limits.a_min, math.sqrt(max((RESERVE * limits.a_total) ** 2 - bend**2, 0.0)))
        rate = share * (room + float(along[here].min()) * v * v) / float(forward[here].max())
        if bend > limits.a_lat or rate <= 0.0:
            return None
        rate = min(rate, v / dt)
        phases.append((since, s, v, -rate))
        s, v, since = s + v * dt - 0.5 * rate * dt**2, v - rate * dt, since + dt
    phases.append((since, s, 0.0, 0.0))
    end = (max(steps_until(t + since, dt), steps_until(t, dt) + 1)) * dt
    return Stop(t, end, frozen(phases), path)


def _demands(path: Settling, frame: FrenetFrame, s: Array) -> tuple[Array, Array, Array]:
    """What a unit of ds/dt asks of the vehicle at places (K,) on a path.

    Returns
    -------
    forward : (K,) array
        Speed, and likewise acceleration along the path by d²s/dt².
    along, across : (K,) array
        Accelerations that a constant ds/dt = 1 takes along and across the path; the latter by size.
    """
    l, slope, bend = path.at(s)  # noqa: E741
    one, zero = np.ones_like(s), np.zeros_like(s)
    unit = FrenetTrajectory(
        s, np.column_stack([s, l]), np.column_stack([one, slope]), np.column_stack([zero, bend]),
        np.column_stack([zero, zero]),
    )  # fmt: skip
    along, across = plane_accelerations(frame, unit)
    return np.hypot(1.0 - frame.curvature(s) * l, slope), along, np.abs(across)
