"""What the checker asks of a vehicle, whatever its kinematics."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from repair.arrays import Array
from repair.errors import ConfigError, kind_of
from repair.registry import Registry
from repair.vehicle.commonroad_ks import official_check, to_ks_states
from repair.vehicle.parameters import VEHICLE_NAMES, Vehicle, load_vehicle
from repair.vehicle.single_track import body_angles, drive, driven_states
from repair.vehicle.states import DrivenStates
from repair.vehicle.transitions import direct_check
from repair.vehicle.transitions_fast import clearly_drivable

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath

__all__ = ["VEHICLES", "KinematicSingleTrack", "VehicleModel", "register", "vehicle_model"]


@runtime_checkable
class VehicleModel(Protocol):
    """A vehicle that drives paths.

    Attributes
    ----------
    parameters : Vehicle
        Body, reference point, limits.
    """

    parameters: Vehicle

    def angles(self, path: CartesianPath, slip0: float | None = None) -> tuple[Array, Array]:
        """Slip angle and orientation of the body (K,) [rad] while its centre drives ``path``.

        ``slip0`` is the slip angle at the first sample; without it, that of steady driving.
        """
        ...

    def states(self, t: Array, xy: Array, speed: Array, slip: Array, orientation: Array) -> DrivenStates:
        """The states at samples (K,) of which :meth:`angles` gave the angles."""
        ...

    def drive(self, path: CartesianPath, slip0: float | None = None) -> DrivenStates:
        """The states along the whole path."""
        ...

    def first_undrivable(
        self, t: Array, xy: Array, speed: Array, slip: Array, orientation: Array, dt: float,
        official: str, until: float,
    ) -> tuple[float, str] | None:  # fmt: skip
        """The first transition between scenario steps that the vehicle cannot drive.

        Parameters
        ----------
        t, speed, slip, orientation : (T,) array
        xy : (T, 2) array
            At the scenario's steps, ``dt`` [s] apart.
        official : str
            ``checker.official``: whom to ask where the model itself is not sure.
        until : float
            Later transitions [s] are left alone where asking about them is expensive.

        Returns
        -------
        tuple or None
            Time [s], and the limit that is broken, in words.
        """
        ...

    def to_commonroad(self, states: DrivenStates, initial_time_step: int) -> list[Any]:
        """The states as CommonRoad ones of the model that solutions are written for (KS)."""
        ...


class KinematicSingleTrack:
    """CommonRoad's kinematic single-track model (KS).

    Parameters
    ----------
    parameters : Vehicle
    """

    def __init__(self, parameters: Vehicle) -> None:
        self.parameters = parameters

    def angles(self, path: CartesianPath, slip0: float | None = None) -> tuple[Array, Array]:
        """See :func:`repair.vehicle.single_track.body_angles`."""
        return body_angles(path, self.parameters, slip0)

    def states(self, t: Array, xy: Array, speed: Array, slip: Array, orientation: Array) -> DrivenStates:
        """See :func:`repair.vehicle.single_track.driven_states`."""
        return driven_states(t, xy, speed, slip, orientation, self.parameters)

    def drive(self, path: CartesianPath, slip0: float | None = None) -> DrivenStates:
        """See :func:`repair.vehicle.single_track.drive`."""
        return drive(path.t, path.xy, path.heading, path.speed, path.distance, self.parameters, slip0=slip0)

    def first_undrivable(
        self, t: Array, xy: Array, speed: Array, slip: Array, orientation: Array, dt: float,
        official: str, until: float,
    ) -> tuple[float, str] | None:  # fmt: skip
        """Direct check first; the drivability checker decides what is left before ``until``.

        A vehicle that is not one of CommonRoad's has the direct check alone.
        """
        vehicle = self.parameters
        if official != "always" and clearly_drivable(xy, speed, slip, orientation, dt, vehicle):
            return None
        states = driven_states(t, xy, speed, slip, orientation, vehicle)
        report = direct_check(states, dt, vehicle)
        open_ = np.arange(len(report.ok)) if official == "always" else np.flatnonzero(~report.ok)
        open_ = open_[states.t[open_] < until]
        ask = official != "never" and vehicle.type_id in VEHICLE_NAMES
        for k in open_.tolist():
            if not ask or not official_check(states, dt, vehicle, [k]).ok.all():
                return float(states.t[k]), report.limit(k)
        return None

    def to_commonroad(self, states: DrivenStates, initial_time_step: int) -> list[Any]:
        """See :func:`repair.vehicle.commonroad_ks.to_ks_states`."""
        return to_ks_states(states, initial_time_step)


def _commonroad(type_id: int) -> Callable[[], VehicleModel]:
    return lambda: KinematicSingleTrack(load_vehicle(type_id))


def _made(vehicle: Any) -> Callable[[], VehicleModel]:
    """Makes a vehicle of parameters, of a model, or of what makes either.

    Raises
    ------
    ConfigError
        If that is none; where something else makes it, when it is asked for.
    """
    if isinstance(vehicle, type) or (callable(vehicle) and not isinstance(vehicle, VehicleModel)):
        return lambda: _made(vehicle())()  # noqa: PLW0108 - only when it is asked for
    model = KinematicSingleTrack(vehicle) if isinstance(vehicle, Vehicle) else vehicle
    if not isinstance(model, VehicleModel):
        raise ConfigError(f"a vehicle is expected, and {kind_of(vehicle)} is none")
    return lambda: model


VEHICLES: Registry[Callable[[], VehicleModel]] = Registry(
    "vehicle",
    {name: _commonroad(type_id) for type_id, name in VEHICLE_NAMES.items()},
    error=ConfigError,
    group="repair.vehicles",
    admit=_made,
)


def register(name: str, vehicle: Vehicle | VehicleModel) -> None:
    """Add a vehicle of your own for this process; ``scene.vehicle: name`` asks for it.

    Parameters
    ----------
    name : str
    vehicle : Vehicle or VehicleModel
        Parameters alone drive as :class:`KinematicSingleTrack`.

    Raises
    ------
    ConfigError
        If the name is taken, or it is no vehicle.
    """
    model = KinematicSingleTrack(vehicle) if isinstance(vehicle, Vehicle) else vehicle
    if not isinstance(model, VehicleModel):
        raise ConfigError(f"vehicle {name!r} is {type(vehicle).__name__}, which is no vehicle model")
    VEHICLES.register(name, lambda: model)


def vehicle_model(which: int | str) -> VehicleModel:
    """The vehicle of a CommonRoad type (1 to 4) or of a registered name.

    Raises
    ------
    ConfigError
        If there is none; the sentence lists those that there are.
    """
    if isinstance(which, int):
        return KinematicSingleTrack(load_vehicle(which))
    return VEHICLES[which]()
