"""CommonRoad vehicle parameters, and what follows from them: shape, reference point, limits.

The formulas are those of CommonRoad's kinematic single-track model; nothing outside of this folder
repeats them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.errors import ConfigError

__all__ = ["VEHICLE_NAMES", "Vehicle", "load_vehicle"]

VEHICLE_NAMES = {1: "FORD_ESCORT", 2: "BMW_320i", 3: "VW_VANAGON", 4: "TRUCK"}


@dataclass(frozen=True)
class Vehicle:
    """A CommonRoad vehicle (Althoff and Würsching, *CommonRoad: Vehicle Models*, 2020).

    Attributes
    ----------
    type_id : int
        CommonRoad vehicle type, 1 to 4; any other number where it is none of CommonRoad's.
    length, width : float
        Body [m], centred on the reference point of CommonRoad states.
    rear : float
        Distance b from that point back to the rear axle [m].
    wheelbase : float
        a + b [m].
    a_max : float
        Radius of the friction circle, and largest braking [m/s²].
    v_min, v_max, v_switch : float
        Speed limits, and the speed from which the engine limits acceleration [m/s].
    steering_max, steering_rate_max : float
        Front-wheel angle [rad] and its rate [rad/s] (symmetric in every CommonRoad vehicle).
    """

    type_id: int
    length: float
    width: float
    rear: float
    wheelbase: float
    a_max: float
    v_min: float
    v_max: float
    v_switch: float
    steering_max: float
    steering_rate_max: float

    @property
    def name(self) -> str:
        """Name in ``commonroad.common.solution.VehicleType``; empty where it is none of CommonRoad's."""
        return VEHICLE_NAMES.get(self.type_id, "")

    @property
    def half_length(self) -> float:
        """Half of the body's length [m]."""
        return 0.5 * self.length

    @property
    def half_width(self) -> float:
        """Half of the body's width [m]."""
        return 0.5 * self.width

    @property
    def radius(self) -> float:
        """Radius of the body's circumcircle [m]."""
        return float(np.hypot(self.half_length, self.half_width))

    @property
    def corners(self) -> Array:
        """Corners ``[forward, left]`` (4, 2) of the body [m], from the front left one on anticlockwise."""
        forward, left = self.half_length, self.half_width
        return frozen([[forward, left], [-forward, left], [-forward, -left], [forward, -left]])

    def largest_curvature(self, share: float = 1.0) -> float:
        """Largest curvature of the centre's path [1/m], from the steering limit.

        Parameters
        ----------
        share : float
            Of the steering limit that may be used.
        """
        slip = np.arctan(self.rear / self.wheelbase * np.tan(share * self.steering_max))
        return float(np.sin(slip) / self.rear)

    def steady_slip(self, curvature: float) -> float:
        """Slip angle at the centre [rad] on a path of constant ``curvature`` [1/m]."""
        return float(np.arcsin(self.rear * curvature))

    def engine_acceleration(self, speed: npt.ArrayLike, share: float = 1.0) -> Array:
        """Largest acceleration [m/s²] at ``speed`` [m/s] (any shape) that tyres and engine allow.

        From ``v_switch`` on the engine's power limits it (CommonRoad vehicle models, eq. 2).

        Parameters
        ----------
        share : float
            Of ``a_max`` that may be used.
        """
        # Any speed above zero will do instead of one that is not: there the engine is no limit.
        return np.asarray(share * self.a_max * np.minimum(1.0, self.v_switch / np.maximum(speed, 1e-9)))

    def lateral_acceleration(self, speed: Array | float, steering: Array | float) -> Array:
        """Lateral acceleration of the rear axle [m/s²] at a speed [m/s] and steering angle [rad]."""
        return np.asarray(speed**2 * np.tan(steering) / self.wheelbase)

    def lateral_jerk(self, speed: float) -> float:
        """Largest jerk to the side [m/s³] while driving straight, from the limit of the steering rate."""
        return speed**2 * self.steering_rate_max / self.wheelbase


@lru_cache(maxsize=8)
def load_vehicle(type_id: int = 1) -> Vehicle:
    """Read a CommonRoad vehicle's parameters.

    Raises
    ------
    ConfigError
        If there is no such vehicle type.
    """
    if type_id not in VEHICLE_NAMES:
        known = ", ".join(f"{k} ({v})" for k, v in VEHICLE_NAMES.items())
        raise ConfigError(f"vehicle type {type_id!r} is unknown; CommonRoad has {known}")
    from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

    p = setup_vehicle_parameters(type_id)
    return Vehicle(
        type_id=type_id,
        length=float(p.l),
        width=float(p.w),
        rear=float(p.b),
        wheelbase=float(p.a + p.b),
        a_max=float(p.longitudinal.a_max),
        v_min=float(p.longitudinal.v_min),
        v_max=float(p.longitudinal.v_max),
        v_switch=float(p.longitudinal.v_switch),
        steering_max=float(p.steering.max),
        steering_rate_max=float(p.steering.v_max),
    )
