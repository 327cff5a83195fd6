"""A vehicle with more grip, power or steering than the one that there is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from repair.arrays import Array
from repair.vehicle.model import KinematicSingleTrack, VehicleModel
from repair.vehicle.parameters import Vehicle
from repair.vehicle.single_track import driven_states
from repair.vehicle.transitions import direct_check

__all__ = ["Stronger", "more_grip", "more_power", "more_steering"]

_ROUNDING = 1e-9
_FASTER = 3.0  # the engine's limit is taken a little above the speed at the start [m/s]


class Stronger(KinematicSingleTrack):
    """A vehicle of other parameters, which drives whatever the one that there is drives, and more.

    CommonRoad's drivability checker knows its own vehicles only: it is asked about the transitions that the
    other parameters do not allow, with those of the vehicle that there is.

    Parameters
    ----------
    parameters : Vehicle
    usual : VehicleModel
        The vehicle that there is.
    """

    def __init__(self, parameters: Vehicle, usual: VehicleModel) -> None:
        super().__init__(parameters)
        self.usual = usual

    def first_undrivable(
        self, t: Array, xy: Array, speed: Array, slip: Array, orientation: Array, dt: float,
        official: str, until: float,
    ) -> tuple[float, str] | None:  # fmt: skip
        """As its parameters and the drivability checker's tolerances have it, to the letter."""
        states = driven_states(t, xy, speed, slip, orientation, self.parameters)
        report = direct_check(states, dt, self.parameters)
        # of the steering rate decides where it leads to, as for the drivability checker
        beyond = (report.use[1:] > 1.0 + _ROUNDING).any(axis=0)
        for k in np.flatnonzero(beyond & (states.t[:-1] < until)).tolist():
            pair = slice(k, k + 2)
            parts = t[pair], xy[pair], speed[pair], slip[pair], orientation[pair]
            if self.usual.first_undrivable(*parts, dt, official, math.inf) is not None:
                return float(states.t[k]), report.limit(k)
        return None


def more_grip(vehicle: Vehicle, by: float, share: float) -> Vehicle:
    """Tyres with more friction, and the same power.

    Parameters
    ----------
    by : float
        How much more of the friction circle a repair may use [m/s²].
    share : float
        Which part of the circle a repair may use.
    """
    wider = vehicle.a_max + by / share
    return replace(vehicle, a_max=wider, v_switch=vehicle.v_switch * vehicle.a_max / wider)


def more_power(vehicle: Vehicle, acceleration: float, speed: float, share: float) -> Vehicle:
    """An engine that gives an acceleration [m/s²] a little above a speed [m/s]; never a weaker one."""
    needed = acceleration * (max(speed, 0.0) + _FASTER) / (share * vehicle.a_max)
    return replace(vehicle, v_switch=max(vehicle.v_switch, needed))


def more_steering(vehicle: Vehicle, by: float) -> Vehicle:
    """Wheels that turn faster, and bend the path more, by a share ``by`` of what they do."""
    return replace(
        vehicle,
        steering_max=math.atan((1.0 + by) * math.tan(vehicle.steering_max)),
        steering_rate_max=(1.0 + by) * vehicle.steering_rate_max,
    )
