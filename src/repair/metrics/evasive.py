"""TTB, TTK, TTS and TTR: the latest start of full braking, kick-down, steering, and of any of them.

Source: Hillenbrand, Spieker and Kroschel, *A multilevel collision mitigation approach*, T-ITS 2006; the TTR
is Definition 1 of the paper (Tong et al. 2024).
"""

from __future__ import annotations

from repair.baselines.evasive.maneuvers import EvasiveManeuver
from repair.metrics.base import Asked, MetricValue

__all__ = ["ttb", "ttk", "ttr", "tts"]

_STEERING = (EvasiveManeuver.STEER_LEFT, EvasiveManeuver.STEER_RIGHT)


def _value(asked: Asked, value: float, *maneuvers: EvasiveManeuver) -> MetricValue:
    """With the status of the manoeuvre that gave the value, or of the first where none did."""
    found = asked.evasive
    best = max(maneuvers, key=lambda m: m in found.curves and found.curves[m].t_start)
    return MetricValue(value, found.status[best].value)


def ttb(asked: Asked) -> MetricValue:
    """Time-To-Brake: the latest start of full braking."""
    return _value(asked, asked.evasive.ttb, EvasiveManeuver.BRAKE)


def ttk(asked: Asked) -> MetricValue:
    """Time-To-Kickdown: the latest start of accelerating as far as the engine goes."""
    return _value(asked, asked.evasive.ttk, EvasiveManeuver.KICK_DOWN)


def tts(asked: Asked) -> MetricValue:
    """Time-To-Steer: the latest start of steering to either side."""
    return _value(asked, asked.evasive.tts, *_STEERING)


def ttr(asked: Asked) -> MetricValue:
    """Time-To-React: the latest of TTB, TTK and TTS."""
    return _value(asked, asked.evasive.ttr, *EvasiveManeuver)
