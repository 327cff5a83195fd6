"""CommonRoad vehicle parameters: shape, reference point, limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from repair.errors import ConfigError

__all__ = ["VEHICLE_NAMES", "Vehicle", "load_vehicle"]

VEHICLE_NAMES = {1: "FORD_ESCORT", 2: "BMW_320i", 3: "VW_VANAGON", 4: "TRUCK"}


@dataclass(frozen=True)
class Vehicle:
    """A CommonRoad vehicle (Althoff and Würsching, *CommonRoad: Vehicle Models*, 2020).

    Attributes
    ----------
    type_id : int
        CommonRoad vehicle type, 1 to 4.
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
        """Name in ``commonroad.common.solution.VehicleType``."""
        return VEHICLE_NAMES[self.type_id]


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
