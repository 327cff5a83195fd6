"""Where the reference trajectory comes from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class ReferenceConfig:
    """Where the reference trajectory comes from."""

    source: str = "planner"  # planner | constant | accelerate | recorded | file
    file: str | None = None  # CommonRoad solution file (source: file)
    obstacle_id: int | None = None  # recorded obstacle (source: recorded); null: the recorded ego
    awareness: str = "none"  # none | constant_velocity
    desired_speed: float | None = None  # [m/s]; null: the larger of initial speed and speed limit
    a_lat: float = 1.2  # lateral comfort on the path's curvature [m/s²]
    a_min: float = -1.5  # comfort braking [m/s²]
    a_max: float = 1.0  # comfort acceleration [m/s²]
    progress: float = 0.1  # cost of 1 m/s below the desired speed, against (1 m/s²)² of acceleration
    time_step: float = 1.0  # layer of the graph search [s]
    speed_step: float = 0.25  # grid of the graph search [m/s]
