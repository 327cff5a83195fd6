"""How a scenario is read."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["AFTER_PREDICTION", "LOADING", "SceneConfig"]

AFTER_PREDICTION = ("remove", "hold", "constant_velocity")
#: The keys that a loaded scene is made by; the others are about what is made of it.
LOADING = ("vehicle", "planning_problem", "horizon", "after_prediction", "smoothing")


@dataclass
class SceneConfig:
    """How the scenario is read."""

    vehicle: int | str = setting(1, "CommonRoad vehicle type, or a registered vehicle; 1 is the Ford Escort")
    planning_problem: int | None = setting(None, "id; null: the smallest")
    horizon: float | None = setting(None, "cap of the planning horizon [s]", low=1e-3, high=1e3)
    after_prediction: str = setting(
        "remove",
        "what becomes of an obstacle after its prediction; one without any stands, or keeps its velocity",
        choices=AFTER_PREDICTION,
    )
    smoothing: float = setting(
        0.15, "how far smoothing may move the route's centre line [m]", low=1e-4, high=10.0
    )
    s_offset: float | None = setting(
        None, "S_offset [m]; null: half the vehicle's length + checker.clearance + 0.1", low=0.0, high=100.0
    )
    l_offset: float | None = setting(
        None, "L_offset [m]; null: half the vehicle's width + checker.clearance + 0.1", low=0.0, high=100.0
    )
