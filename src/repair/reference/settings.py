"""Where the reference trajectory comes from."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["ReferenceConfig"]

_PLANNED = ("reference.source", ("planner",))


@dataclass
class ReferenceConfig:
    """Where the reference trajectory comes from."""

    source: str = setting("planner", "what makes the reference", registry="reference source")
    file: str | None = setting(
        None, "CommonRoad solution file (source: file)", only_with=("reference.source", ("file",))
    )
    obstacle_id: int | None = setting(
        None,
        "recorded obstacle (source: recorded); null: the recorded ego",
        only_with=("reference.source", ("recorded",)),
    )
    awareness: str = setting(
        "none",
        "how the planner takes the traffic: not at all, or as going on at constant velocity",
        choices=("none", "constant_velocity"),
        only_with=_PLANNED,
    )
    desired_speed: float | None = setting(
        None,
        "[m/s]; null: the larger of initial speed and speed limit",
        low=0.0,
        high=200.0,
        only_with=_PLANNED,
    )
    a_lat: float = setting(
        1.2, "lateral comfort on the path's curvature [m/s²]", low=1e-2, high=50.0, only_with=_PLANNED
    )
    a_min: float = setting(-1.5, "comfort braking [m/s²]", low=-50.0, high=-1e-2, only_with=_PLANNED)
    a_max: float = setting(1.0, "comfort acceleration [m/s²]", low=1e-2, high=50.0, only_with=_PLANNED)
    progress: float = setting(
        0.1,
        "cost of 1 m/s below the desired speed, against (1 m/s²)² of acceleration",
        low=0.0,
        high=100.0,
        only_with=_PLANNED,
    )
    time_step: float = setting(1.0, "layer of the graph search [s]", low=0.1, high=5.0, only_with=_PLANNED)
    speed_step: float = setting(
        0.25, "grid of the graph search [m/s]", low=0.02, high=5.0, only_with=_PLANNED
    )
