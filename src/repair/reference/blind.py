"""References that look at nothing but the initial state and the speed limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["limit_at"]

_CRUISE = 13.9  # m/s, 50 km/h: where a blind accelerating ego stops accelerating without a sign


def limit_at(scene: Scene, s: float) -> float:
    """Speed limit [m/s] at ``s``; the speed of built-up areas where no sign gives one."""
    limit = float(scene.speed_limit.at(s)) if scene.speed_limit is not None else np.inf
    return limit if np.isfinite(limit) else _CRUISE
