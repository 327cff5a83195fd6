"""CommonRoad's KS model for the drivability checker, with the same numbers in half of the time.

The drivability checker's optimiser simulates a transition some forty times. Its own dynamics make the bounds
of the inputs anew for each, and look up every parameter at each of the integrator's evaluations.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import cos, sin, tan
from typing import Any

import numpy as np
from commonroad.common.solution import VehicleType
from commonroad_dc.feasibility.vehicle_dynamics import KinematicSingleTrackDynamics
from scipy.integrate import odeint
from scipy.optimize import Bounds

__all__ = ["QuickKinematicSingleTrack", "quick_dynamics"]

_CLEAR = 1e-3  # inputs this far within their bounds need no rounding to be known as such


class QuickKinematicSingleTrack(KinematicSingleTrackDynamics):  # type: ignore[misc]
    """The drivability checker's ``KinematicSingleTrackDynamics``, each operation in the same order.

    Parameters
    ----------
    vehicle_type : commonroad.common.solution.VehicleType
    """

    def __init__(self, vehicle_type: VehicleType) -> None:
        super().__init__(vehicle_type)
        p = self.parameters
        self._bounds = super().input_bounds
        self._steering = float(p.steering.min), float(p.steering.max)
        self._rate = float(p.steering.v_min), float(p.steering.v_max)
        speed = p.longitudinal
        self._speed = float(speed.v_min), float(speed.v_max), float(speed.v_switch)
        self._a_max, self._wheelbase = float(speed.a_max), float(p.a + p.b)

    @property
    def input_bounds(self) -> Bounds:
        """Of steering rate [rad/s] and acceleration [m/s^2]."""
        return self._bounds

    def dynamics(self, t: float, x: Any, u: Any) -> list[float]:
        """Rates of the state (x, y, steering angle, speed, orientation) under the inputs ``u``."""
        rates: list[float] = self._under(*np.asarray(u).tolist())(t, np.asarray(x))
        return rates

    def _under(self, rate: float, acceleration: float) -> Callable[[float, Any], list[float]]:
        """The rates as a function of time and state (an array) for one pair of inputs."""
        (least, most), (slowest, fastest, switch) = self._steering, self._speed
        a_max, wheelbase = self._a_max, self._wheelbase
        turning = min(max(rate, self._rate[0]), self._rate[1])
        pushing = min(max(acceleration, -a_max), a_max)
        freely = min(fastest, switch)

        def rates(_: float, x: Any) -> list[float]:
            _x, _y, steering, speed, psi = x.tolist()
            turn, push = turning, pushing
            if not least < steering < most and rate * steering >= 0:
                turn = 0.0
            if not slowest < speed < freely:
                if (speed <= slowest and acceleration <= 0) or (speed >= fastest and acceleration >= 0):
                    push = 0.0
                elif speed > switch:
                    push = min(push, a_max * switch / speed)
            return [speed * cos(psi), speed * sin(psi), turn, push, speed / wheelbase * tan(steering)]

        return rates

    def input_within_bounds(self, u: Any, throw: bool = False) -> bool:
        """Whether the inputs are within their bounds, as the drivability checker rounds them."""
        rate, acceleration = u.tolist()
        low, high = self._rate
        if low + _CLEAR <= rate <= high - _CLEAR and abs(acceleration) <= self._a_max - _CLEAR:
            return True
        return bool(super().input_within_bounds(u, throw))

    def violates_friction_circle(self, x: Any, u: Any, throw: bool = False) -> bool:
        """Whether acceleration and lateral acceleration at the start are beyond the circle of ``a_max``."""
        if throw:
            return bool(super().violates_friction_circle(x, u, throw))
        _, _, steering, speed, _ = x.tolist()
        along, across = u.tolist()[1], speed * (speed / self._wheelbase * tan(steering))
        return bool(along * along + across * across > self._a_max**2)

    def forward_simulation(self, x: Any, u: Any, dt: float, throw: bool = True) -> Any:
        """The state after ``dt`` [s]; None where the inputs are not allowed and ``throw`` is False."""
        if throw:
            return super().forward_simulation(x, u, dt, throw)
        if not self.input_within_bounds(u) or self.violates_friction_circle(x, u):
            return None
        return odeint(self._under(*u.tolist()), x, [0.0, dt], tfirst=True)[1]


@lru_cache(maxsize=8)
def quick_dynamics(type_id: int) -> QuickKinematicSingleTrack:
    """The dynamics of a CommonRoad vehicle type."""
    return QuickKinematicSingleTrack(VehicleType(type_id))
