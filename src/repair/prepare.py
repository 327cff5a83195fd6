"""From a scene and a configuration to what is searched."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from repair.check.checker import Checker
from repair.check.conflict import detect_conflict
from repair.config import Config
from repair.errors import ConfigError
from repair.problem.limits import resolve_limits
from repair.reference.recorded import known_until, recorded_positions
from repair.reference.registry import make_reference
from repair.scene.reframe import as_ego, reframe
from repair.situation import Prepared
from repair.world.occupancy import build_occupancy, shrink_to_start

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["Phases", "prepare"]

# Wider than a rounding error, narrower than anything that matters: what is kept by default beyond
# half of the vehicle, because a box in (s, l) is not the vehicle's rectangle.
_BODY_MARGIN = 0.1


@dataclass
class Phases:
    """Wall time by phase [s]."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, name: str):  # type: ignore[no-untyped-def]
        begin = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin


def prepare(scene: Scene, config: Config) -> Prepared:
    """Occupancy, reference, checker and conflict of a scene.

    Raises
    ------
    RepairError
        If no reference can be had.
    """
    phases = Phases()
    if config.reference.source in ("recorded", "file"):
        positions, _ = recorded_positions(scene, config.reference)
        scene = reframe(scene, positions[: known_until(positions)])
        if config.reference.source == "recorded" and config.reference.obstacle_id is not None:
            scene = as_ego(scene, config.reference.obstacle_id)
    vehicle = scene.vehicle
    s_offset, l_offset = config.scene.s_offset, config.scene.l_offset
    s_offset = 0.5 * vehicle.length + _BODY_MARGIN if s_offset is None else s_offset
    l_offset = 0.5 * vehicle.width + _BODY_MARGIN if l_offset is None else l_offset
    with phases("occupancy"):
        occupancy, notes = build_occupancy(scene.obstacles, scene.frame, scene.dt, s_offset, l_offset)
    limits = resolve_limits(config.limits, vehicle, float(scene.start[1, 0]), scene.dt)
    with phases("checker"):
        checker = Checker(scene, limits, config.checker)
        touching = checker.touching_at_start()
    occupancy, more = shrink_to_start(occupancy, scene.start[0], touching)
    with phases("reference"):
        reference = make_reference(scene, config.reference, occupancy)
    t_reference = min(scene.horizon, reference.t_end)
    with phases("conflict"):
        conflict, _ = detect_conflict(reference, occupancy, checker, t_reference)
    wanted = config.repair.horizon
    if wanted is None:
        wanted = conflict.time + config.repair.after_conflict
    elif np.isfinite(conflict.time) and wanted <= conflict.time:
        raise ConfigError(
            f"repair.horizon is {wanted:g} s, but the conflict is at {conflict.time:g} s: "
            "a repair has to reach beyond it"
        )
    t_end = min(wanted, t_reference)
    t_end = max(np.floor(t_end / scene.dt + 1e-6) * scene.dt, min(scene.dt, t_reference))
    return Prepared(
        scene, config, limits, occupancy, reference, checker, conflict, t_reference, float(t_end),
        (*scene.notes, *notes, *more), phases.seconds,
    )  # fmt: skip
