"""The Feasible Time-To-React as a measure of CommonRoad-CriMe; imported in CriMe's environment only.

>>> from commonroad_crime.data_structure.crime_interface import CriMeInterface    # doctest: +SKIP
>>> record = json.loads(Path("results/result.json").read_text())                  # doctest: +SKIP
>>> CriMeInterface(config).evaluate_scenario([FTTR.of(record)])                   # doctest: +SKIP

``repair`` and CriMe ask for different versions of the drivability checker, so the repair is made elsewhere,
by ``repair run --json`` or ``--out``, and its record is what this class is given.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from typing import Any

from commonroad_crime.data_structure.base import CriMeBase
from commonroad_crime.data_structure.type import TypeMonotone


class TypeRepair(str, Enum):
    """What CriMe calls the measure; its own lists of types cannot be added to."""

    FTTR = "feasible time-to-react"


class FTTR(CriMeBase):
    """How long [s] from a time step on the ego's trajectory can be followed and still be repaired.

    It is the record's ``f_ttr_s`` at the first step, and less by the time that has passed at later ones: the
    reference and the predictions are the same. ``inf`` where nothing is in conflict, ``-inf`` where no repair
    was found or its time has passed, NaN where the search was cut short, so that it is not known.

    Source: Tong et al., *Safety Metric Aware Trajectory Repairing for Automated Driving*, ITSC 2024,
    Algorithm 1.
    """

    measure_name = TypeRepair.FTTR
    monotone = TypeMonotone.NEG
    record: Mapping[str, Any] = {}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> type[FTTR]:
        """The measure of one result, made from a configuration as CriMe makes its own.

        Parameters
        ----------
        record : mapping
            What ``result.json`` holds.

        Raises
        ------
        ValueError
            If it is not the record of a repair.
        """
        if "f_ttr_s" not in record or "status" not in record:
            raise ValueError("the record is not what result.json holds")
        return type("FTTR", (cls,), {"record": dict(record)})

    def compute(self, time_step: int = 0, vehicle_id: int | None = None, verbose: bool = True) -> float:
        """The value [s] at a time step of the scenario; see the class.

        Parameters
        ----------
        time_step : int
        vehicle_id : int, optional
            Taken because CriMe asks vehicle by vehicle; the measure is of all traffic at once.
        verbose : bool
            Whether CriMe's logger is told.
        """
        if not self.validate_update_states_log(None, time_step, verbose):
            return math.nan
        self.value = self._at((time_step - self.ego_vehicle.initial_state.time_step) * self.dt)
        return self.value

    def _at(self, passed: float) -> float:
        said = self.record["f_ttr_s"]
        if self.record["status"] == "no_conflict":
            return math.inf
        if said is None:
            return -math.inf if self.record.get("complete", True) else math.nan
        left = round(said - passed, 9)
        return left if left >= 0.0 else -math.inf

    def visualize(self) -> None:
        """Nothing of its own: ``repair run --out`` draws the repair."""
