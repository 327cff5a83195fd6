"""The fixed evasive manoeuvres behind the TTR of the paper's baseline."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class EvasiveConfig:
    """The fixed evasive manoeuvres behind the TTR of the paper's baseline."""

    a_brake: float = 8.0  # full braking [m/s²]
    a_kick: float = 8.0  # kick-down, as far as the engine goes [m/s²]
    a_steer: float = 8.0  # steering: lateral acceleration [m/s²]
    model: str = "point_mass"  # point_mass | kinematic
    collision: str = "rectangles"  # rectangles | boxes
    offset_max: float = 4.0  # widest lateral offset to steer to [m]
    offset_step: float = 0.5  # [m]
