"""How a scenario is read."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class SceneConfig:
    """How the scenario is read."""

    vehicle: int = 1  # CommonRoad vehicle type; 1 is the Ford Escort
    planning_problem: int | None = None  # id; null: the smallest
    horizon: float | None = None  # cap of the planning horizon [s]
    after_prediction: str = "remove"  # remove | hold | constant_velocity
    s_offset: float | None = None  # S_offset [m]; null: half the vehicle's length + 0.1
    l_offset: float | None = None  # L_offset [m]; null: half the vehicle's width + 0.1
