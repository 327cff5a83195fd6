"""References that look at nothing but the initial state and the speed limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.reference.profile import SpeedProfile
from repair.timegrid import STEP, steps_until

if TYPE_CHECKING:
    from repair.reference.settings import ReferenceConfig
    from repair.scene.scene import Scene
    from repair.world.boxes import Occupancy

__all__ = ["accelerating", "constant_speed", "limit_at"]

_CRUISE = 13.9  # m/s, 50 km/h: where a blind accelerating ego stops accelerating without a sign


def constant_speed(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> SpeedProfile:
    """The initial speed, held to the horizon."""
    s0, v0 = float(scene.start[0, 0]), float(scene.start[1, 0])
    return SpeedProfile.from_accelerations(s0, v0, [scene.horizon], [0.0])


def accelerating(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> SpeedProfile:
    """1 m/s² up to the speed limit, or to 13.9 m/s where there is no sign."""
    s0, v0 = float(scene.start[0, 0]), float(scene.start[1, 0])
    target = max(v0, limit_at(scene, s0))
    # What is left of the ramp after whole steps is spread over one more: the vehicle is steered step by step,
    # and no constant input of a step would end the ramp within it.
    whole = min(steps_until(target - v0, scene.dt), scene.n_steps)
    rest = (target - v0 - whole * scene.dt) / scene.dt if whole < scene.n_steps else 0.0
    rest = max(rest, 0.0) if rest > STEP else 0.0
    durations = [whole * scene.dt, scene.dt if rest else 0.0]
    durations.append(max(scene.horizon - sum(durations), 0.0))
    return SpeedProfile.from_accelerations(s0, v0, durations, [1.0, rest, 0.0])


def limit_at(scene: Scene, s: float) -> float:
    """Speed limit [m/s] at ``s``; the speed of built-up areas where no sign gives one."""
    limit = float(scene.speed_limit.at(s)) if scene.speed_limit is not None else np.inf
    return limit if np.isfinite(limit) else _CRUISE
