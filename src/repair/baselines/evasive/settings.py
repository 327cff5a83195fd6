"""The fixed evasive manoeuvres behind TTB, TTK, TTS and TTR."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["EvasiveConfig"]


@dataclass
class EvasiveConfig:
    """The fixed evasive manoeuvres behind TTB, TTK, TTS and TTR."""

    a_brake: float = setting(8.0, "full braking [m/s²]", low=0.1, high=100.0)
    a_kick: float = setting(8.0, "kick-down, as far as the engine goes [m/s²]", low=0.1, high=100.0)
    a_steer: float = setting(8.0, "steering: lateral acceleration [m/s²]", low=0.1, high=100.0)
    model: str = setting(
        "point_mass",
        "who steers: a point mass, or within the steering limits",
        choices=("point_mass", "kinematic"),
    )
    collision: str = setting(
        "rectangles", "what a manoeuvre has to keep clear of", choices=("rectangles", "boxes")
    )
    offset_max: float = setting(4.0, "widest lateral offset to steer to [m]", low=0.1, high=20.0)
    offset_step: float = setting(0.5, "step of the offsets that are tried [m]", low=0.05, high=20.0)
