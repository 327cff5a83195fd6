"""CommonRoad's word on states as somebody else wrote them: in their own model, transition by transition."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from repair.deadline import OutOfTime, in_time
from repair.vehicle.commonroad_ks import at_origin
from repair.vehicle.parameters import load_vehicle
from repair.vehicle.states import DrivenStates
from repair.vehicle.transitions import direct_check

__all__ = ["first_refused"]


def first_refused(states: list[Any], model: str, type_id: int, dt: float) -> int | None:
    """The first transition that CommonRoad's drivability checker refuses.

    Transitions of the kinematic single-track model that are clearly drivable are not asked about.

    Parameters
    ----------
    states : list of commonroad.scenario.state.State
        One for each time step, of the model.
    model : str
        A ``commonroad.common.solution.VehicleModel``: PM, KS, ST, MB, ...
    type_id : int
        CommonRoad vehicle type.
    dt : float
        Time step [s].

    Returns
    -------
    int or None
        Transition i leads from state i to state i + 1; None where all are accepted. What the checker cannot
        answer (an exception of its own) counts as refused.

    Raises
    ------
    repair.deadline.OutOfTime
        If the deadline passes before.
    """
    from commonroad.common.solution import VehicleModel, VehicleType
    from commonroad_dc.feasibility.feasibility_checker import state_transition_feasibility
    from commonroad_dc.feasibility.vehicle_dynamics import VehicleDynamics

    dynamics = VehicleDynamics.from_model(VehicleModel[model], VehicleType(type_id))
    for k in _unsure(states, model, type_id, dt):
        in_time()
        try:
            with warnings.catch_warnings():  # of its integrator and optimiser, about inputs they only try
                warnings.simplefilter("ignore")
                feasible, _ = state_transition_feasibility(*at_origin(states[k : k + 2]), dynamics, dt)
        except OutOfTime:
            raise
        except Exception:  # the checker wraps whatever happens into a bare Exception
            feasible = False
        if not feasible:
            return k
    return None


def _unsure(states: list[Any], model: str, type_id: int, dt: float) -> list[int]:
    """The transitions to ask about."""
    if model != "KS":
        return list(range(len(states) - 1))
    rows = [(*s.position, s.steering_angle, s.velocity, s.orientation) for s in states]
    x, y, steering, speed, psi = np.array(rows, dtype=np.float64).T
    driven = DrivenStates(np.arange(len(rows)) * dt, x, y, steering, speed, np.unwrap(psi))
    report = direct_check(driven, dt, load_vehicle(type_id))
    return [int(k) for k in np.flatnonzero(~report.ok)]
