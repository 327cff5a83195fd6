"""Reference trajectories by the name of their source."""

from __future__ import annotations

from typing import TYPE_CHECKING

from repair.curves.base import Curve
from repair.reference.blind import limit_at
from repair.reference.planner import plan_speed
from repair.reference.profile import SpeedProfile
from repair.reference.recorded import fit_positions, recorded_positions
from repair.reference.settings import ReferenceConfig
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["make_reference"]


def make_reference(scene: Scene, config: ReferenceConfig, occupancy: Occupancy) -> Curve:
    """The reference trajectory over [0, scene.horizon] in the scene's frame.

    Parameters
    ----------
    occupancy : Occupancy
        Inflated obstacles; only ``awareness: constant_velocity`` looks at it, and only at t = 0.

    Raises
    ------
    ReferenceTrajectoryError
        If the source has no usable trajectory; the sentence says what is missing.
    """
    if config.source == "planner":
        return plan_speed(scene, config, occupancy)
    s0, v0 = float(scene.start[0, 0]), float(scene.start[1, 0])
    if config.source == "constant":
        return SpeedProfile.from_accelerations(s0, v0, [scene.horizon], [0.0])
    if config.source == "accelerate":
        target = max(v0, limit_at(scene, s0))
        ramp = min(target - v0, scene.horizon)
        return SpeedProfile.from_accelerations(s0, v0, [ramp, max(scene.horizon - ramp, 0.0)], [1.0, 0.0])
    positions, what = recorded_positions(scene, config)
    return fit_positions(scene, positions, what)
