"""How far a stop after a repair may get: whom it has to stay behind, as bounds on the repair's end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.base import Curve
from repair.problem.problem import RepairProblem
from repair.scene.traffic.obstacle import later
from repair.terminal.stop import RESERVE
from repair.terminal.traffic import traffic_until
from repair.timegrid import steps_until
from repair.world.boxes import Occupancy
from repair.world.dead_ends import with_boxes
from repair.world.occupancy import build_occupancy

if TYPE_CHECKING:
    from repair.problem.limits import Limits
    from repair.scene.scene import Scene

__all__ = ["STOP_TIMES", "RoomToStop", "missed_by", "room_to_stop"]

#: Since the end of the repair [s], closer where most stops are: from 45 m/s full braking takes no longer.
STOP_TIMES: Array = frozen([*(0.2 * k for k in range(11)), 2.4, 2.8, 3.4, 4.2, 5.2])

_BODY = 0.1  # kept beyond half of the vehicle, if margins are: a box in (s, l) is not its rectangle [m]
_LEFT = 0.2  # share of full braking that counts where bends leave less of it: the judge has the last word
_LOOKED_AT = 40  # places of the way to standstill
_STANDS = 1e-2  # below this speed [m/s] a path has no direction


@dataclass(frozen=True)
class RoomToStop:
    """What is about after the repairs of a situation (a :class:`repair.problem.problem.Afterwards`).

    Attributes
    ----------
    boxes : callable
        Makes ``occupancy``, which most backends never ask for.
    braking : float
        How hard a stop brakes where the path is straight [m/s²].
    circle : float
        Radius of the friction circle that it uses [m/s²].
    wait : float
        How long nobody may meet the vehicle once it stands [s].
    """

    boxes: Callable[[], Occupancy]
    braking: float
    circle: float
    wait: float = 0.0

    @cached_property
    def occupancy(self) -> Occupancy:
        """Boxes that the ego's reference point has to keep out of; their time begins where repairs end."""
        return self.boxes()

    def within(self, problem: RepairProblem, curve: Curve) -> Array:
        """What s + v tau may be at the end of a repair, for each of :data:`STOP_TIMES` (K,) [m].

        Full braking with b from (s, v) on is, after tau, at s + v tau - b tau²/2. To be behind r(tau) then is
        s + v tau <= r(tau) + b tau²/2: a line in s and v for each tau, and so in a spline's control points.
        Ahead is what comes into the way beyond where ``curve`` ends and is not passed before it comes; inf
        where nothing is.

        Parameters
        ----------
        problem : RepairProblem
        curve : Curve
            Over [t_rep, t_end]: on which path it ends, where and how fast, as a first guess.
        """
        state = curve.sample([problem.t_end])
        (s, l), (v, w) = state.position[0].tolist(), state.velocity[0].tolist()  # noqa: E741
        v = max(v, 0.0)
        # The stop's path straightens out evenly over the way to standstill (``settling_from``).
        aside = l + (0.5 * w * v / (2.0 * self.braking) if v > _STANDS else 0.0)
        rate, dt = self._rate(problem, s, l, v), problem.dt
        since = dt * np.arange(math.ceil((v / rate + self.wait) / dt) + 2)
        slows = np.minimum(since, v / rate)
        rear = self._rear(since, s, s + v * slows - 0.5 * rate * slows**2, (min(l, aside), max(l, aside)))
        # Where it stands it stays: what is free at a time has to be free from then on.
        free = np.minimum.accumulate(rear[::-1])[::-1]
        at = np.minimum((STOP_TIMES / dt + 1e-9).astype(np.intp), len(since) - 1)
        # Between these times the parabola bulges, and a stop's last step is braked evenly.
        bulge = np.gradient(STOP_TIMES) ** 2 + dt**2
        most = free[at] + rate * (0.5 * STOP_TIMES**2 - 0.125 * bulge)
        most -= min(max(problem.margin + _BODY, 0.0), _BODY)
        return np.where(since[-1] >= STOP_TIMES, most, np.inf)

    def _rear(self, since: Array, s: float, stops: Array, path: tuple[float, float]) -> Array:
        """The hindmost rear end (T,) of what is ahead at times since the end of the repair; inf without any.

        Parameters
        ----------
        s : float
            Where the repair ends [m].
        stops : (T,) array
            Where a stop from there gets [m].
        path : (right, left)
            Ends of the path's l [m].
        """
        lower, upper = self.occupancy.at(since)
        met = (lower[..., 1] < path[1]) & (upper[..., 1] > path[0])  # what is not there is not met
        rear = np.full(len(since), np.inf)
        for k in np.flatnonzero(met.any(axis=1)):
            first = int(met[k].argmax())
            if lower[k, first, 0] > s and upper[k, first, 0] > stops[first]:
                rear = np.minimum(rear, np.where(met[k], lower[k, :, 0], np.inf))
        return rear

    def _rate(self, problem: RepairProblem, s: float, l: float, v: float) -> float:  # noqa: E741
        """What full braking takes off ds/dt each second at least, in the bends ahead at the speed of now."""
        way = 1.5 * v * v / (2.0 * self.braking) + 1.0
        kappa = problem.curvature_at(s + way * np.linspace(0.0, 1.0, _LOOKED_AT))
        across = float(np.abs(kappa).max()) * v * v
        left = min(self.braking, math.sqrt(max(self.circle**2 - across**2, 0.0)))
        return max(left, _LEFT * self.braking) / max(float((1.0 - kappa * l).max()), 0.1)


def missed_by(curve: Curve, t_end: float, within: Array) -> float:
    """By how much [m] a stop from a curve's state at ``t_end`` gets too far; negative where it does not."""
    state = curve.sample([t_end])
    return float((state.position[0, 0] + STOP_TIMES * state.velocity[0, 0] - within).max())


def room_to_stop(
    scene: Scene,
    limits: Limits,
    t_end: float,
    clearance: float,
    wait: float,
    road_ends: Callable[[float], list[tuple[Array, Array]]],
) -> RoomToStop:
    """The room after the repairs of a situation.

    Parameters
    ----------
    scene : Scene
    limits : Limits
        Of the repairs.
    t_end : float
        End of the repairs [s], on a step.
    clearance : float
        What the checker wants around the ego's rectangle [m].
    wait : float
        How long nobody may meet the vehicle once it stands [s].
    road_ends : callable
        The ends of the road up to a distance after the start [m], as boxes.
    """
    braking = RESERVE * -limits.a_min
    fastest = min(limits.v_max, max(float(scene.start[1, 0]), 0.0) + limits.a_max * t_end)
    longest = min(fastest / braking, float(STOP_TIMES[-1])) + wait

    def boxes() -> Occupancy:
        first = steps_until(t_end, scene.dt)
        n_steps = max(first + steps_until(longest, scene.dt) + 2, scene.n_steps)
        traffic = (later(one, first) for one in traffic_until(scene, n_steps))
        vehicle = scene.vehicle
        offsets = vehicle.half_length + clearance, vehicle.half_width + clearance + _BODY
        there = [one for one in traffic if one is not None]
        occupancy, _ = build_occupancy(there, scene.frame, scene.dt, *offsets)
        return with_boxes(occupancy, road_ends(fastest * t_end + 0.5 * fastest**2 / braking))

    return RoomToStop(boxes, braking, RESERVE * limits.a_total, wait)
