"""CommonRoad's kinematic single-track (KS) model: its states, and the drivability checker's word on them."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from repair.deadline import OutOfTime, in_time, limited

if TYPE_CHECKING:
    from repair.vehicle.parameters import Vehicle
    from repair.vehicle.states import DrivenStates

__all__ = ["OfficialReport", "at_origin", "load_official", "official_check", "to_ks_states"]

_OFFICIAL = "commonroad_dc.feasibility.feasibility_checker"
_IMPORT = 0.5  # what importing it takes at most [s]


@dataclass(frozen=True)
class OfficialReport:
    """Answer of :func:`official_check`.

    Attributes
    ----------
    transitions : (n,) int array
        The transitions asked about.
    ok : (n,) bool array
    reasons : dict
        Transition -> why not, for every transition that is not ok.
    """

    transitions: npt.NDArray[np.intp]
    ok: npt.NDArray[np.bool_]
    reasons: dict[int, str]


def load_official() -> None:
    """Import the drivability checker: once in the life of a process that takes longer than many a search.

    Where that cannot be done, whoever needs it will say so.
    """
    with suppress(ImportError):
        import commonroad_dc.feasibility.feasibility_checker  # noqa: F401


def official_check(
    states: DrivenStates, dt: float, vehicle: Vehicle, transitions: Iterable[int] | None = None
) -> OfficialReport:
    """Ask the drivability checker about single transitions, each moved so that it begins at the origin.

    Whether a motion can be driven does not hang on where it is. The checker's integrator has errors relative
    to the coordinates, which at those of UTM hide the slope of its cost from its optimiser now and then.

    Parameters
    ----------
    states : DrivenStates
        At the scenario's time steps.
    dt : float
        Time step [s].
    vehicle : Vehicle
    transitions : iterable of int, optional
        Transition i leads from state i to state i + 1; by default all.

    Returns
    -------
    OfficialReport
        An exception inside the drivability checker is a "no" with its message as the reason.

    Raises
    ------
    repair.deadline.OutOfTime
        If the deadline passes before; its optimiser is stopped between two of its attempts.
    """
    if _OFFICIAL not in sys.modules:
        in_time(_IMPORT, "importing the drivability checker")
    from commonroad_dc.feasibility.feasibility_checker import (
        position_orientation_objective,
        state_transition_feasibility,
    )

    from repair.vehicle.ks_dynamics import quick_dynamics

    asked = np.arange(len(states) - 1) if transitions is None else np.array(list(transitions), dtype=np.intp)
    ks = to_ks_states(states, 0)
    dynamics = quick_dynamics(vehicle.type_id)
    reasons: dict[int, str] = {}

    def timed(*values: Any) -> float:
        in_time()
        return float(position_orientation_objective(*values))

    objective = timed if limited() else position_orientation_objective
    for i in asked.tolist():
        in_time()
        pair = at_origin(ks[i : i + 2])
        values = [(s.position[0], s.position[1], s.steering_angle, s.velocity, s.orientation) for s in pair]
        if not np.isfinite(values).all():
            reasons[i] = "a state is not finite"
            continue
        try:
            with warnings.catch_warnings():  # of its integrator and optimiser, about inputs they only try
                warnings.simplefilter("ignore")
                feasible, _ = state_transition_feasibility(*pair, dynamics, dt, objective)
        except Exception as error:  # the checker wraps whatever happens into a bare Exception
            cause = error.__cause__ or error
            if isinstance(cause, OutOfTime):
                raise cause from None
            reasons[i] = f"drivability checker: {type(cause).__name__}: {cause}"
            continue
        if not feasible:
            reasons[i] = "no input of the KS model leads to the next state"
    return OfficialReport(
        asked, np.array([i not in reasons for i in asked.tolist()], dtype=np.bool_), reasons
    )


def at_origin(pair: list[Any]) -> list[Any]:
    """CommonRoad states moved so that the first of them is at the origin."""
    moved = []
    for state in pair:
        other = copy(state)
        other.position = np.asarray(state.position, dtype=np.float64) - pair[0].position
        moved.append(other)
    return moved


def to_ks_states(states: DrivenStates, initial_time_step: int) -> list[Any]:
    """The states as ``commonroad.scenario.state.KSState``, one time step apart.

    Values are plain floats (the solution writer then writes them so that reading gives the same
    numbers); orientations are brought into [-pi, pi], as CommonRoad demands.

    Parameters
    ----------
    states : DrivenStates
        At the scenario's time steps.
    initial_time_step : int
        That of the first state.
    """
    from commonroad.scenario.state import KSState

    wrapped = np.arctan2(np.sin(states.orientation), np.cos(states.orientation))
    rows = np.column_stack((states.steering, states.speed, wrapped)).tolist()
    return [
        KSState(
            time_step=initial_time_step + i,
            position=np.array([states.x[i], states.y[i]]),
            steering_angle=steering,
            velocity=speed,
            orientation=orientation,
        )
        for i, (steering, speed, orientation) in enumerate(rows)
    ]
