"""A scene whose frame runs along a recorded path instead of the planned lead-in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen
from repair.scene.frame import FrenetFrame
from repair.scene.road.bounds import crossings, lateral_bounds
from repair.scene.road.direction import driven_lanes
from repair.scene.road.lanes import Lane
from repair.scene.road.passes import along

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["as_ego", "lanes_at", "reframe"]

_SPACING = 0.5  # recorded points closer than this [m] are noise to a path
_JOIN_TURN = 0.4  # a path that heads elsewhere by more than this [rad] goes straight on
_JOIN_SLOPE = 5.0  # so many metres for each metre that it lies beside the route, if that is longer
_JOIN = 15.0  # length over which the recorded path runs into the route again [m]


def reframe(
    scene: Scene,
    positions: Array,
    heading: float | None = None,
    lanes: Mapping[int, Lane] | None = None,
) -> Scene:
    """Lay the frame along recorded centre positions (M, 2), then on along the old frame.

    Where the recording ends across the route or against it, the frame goes straight on instead: a path back
    to the route would fold, and places on it would have two coordinates.

    A reference that changes lanes then has l = 0 like any other, so that it can be followed more
    slowly without leaving its path.

    Parameters
    ----------
    scene : Scene
    positions : (M, 2) array
        [m]; of fewer than four different ones no path is made, and the frame stays as it is.
    heading : float, optional
        Orientation of the recorded body at the start [rad].
    lanes : mapping, optional
        Those of the scene's map, where they are known already.
    """
    scene = scene if heading is None else replace(scene, first_heading=heading)
    path = [positions[0]]
    for point in positions[1:]:
        if np.hypot(*(point - path[-1])) >= _SPACING:
            path.append(point)
    recorded = np.array(path)
    if len(recorded) < 4:
        return scene
    old = scene.frame
    s_end, l_end = along(old, recorded, float(scene.start[0, 0]))[-1]
    direction = recorded[-1] - recorded[-2]
    if np.isfinite(s_end) and abs(_turn(direction, float(old.heading(s_end)))) < _JOIN_TURN:
        ahead = np.arange(_SPACING, max(old.length - s_end, _SPACING * 2), 1.0)
        share = np.clip(ahead / max(_JOIN, _JOIN_SLOPE * abs(l_end)), 0.0, 1.0)
        offset = l_end * (1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share**2))
        following = old.to_cartesian(s_end + ahead, offset)
    else:  # it drives where the route does not go, and a path back to it would fold
        following = recorded[-1] + np.arange(1.0, 40.0)[:, None] * direction / np.hypot(*direction)
    direction = recorded[1] - recorded[0]
    back = np.arange(30.0, 0.0, -1.0)[:, None]
    behind = recorded[0] - back * direction / np.hypot(*direction)
    frame = FrenetFrame.from_points(np.concatenate([behind, recorded, following]), smoothing=0.1)
    s0, l0 = frame.to_frenet(positions[:1], near=np.array([30.0]))[0]
    speed, acceleration = scene.start[1, 0], scene.start[2, 0]
    if lanes is None:
        lanes = lanes_at(scene)
    found = crossings(frame, lanes)
    half = scene.vehicle.half_width
    return replace(
        scene,
        frame=frame,
        start=frozen([[s0, l0], [speed, 0.0], [acceleration, 0.0]]),
        route_end_s=frame.length,
        goal_s=None,
        lane=lateral_bounds(found, half, lanelets=scene.route_lanelets),
        same_direction=lateral_bounds(found, half, lanelets=scene.route_lanelets, same_direction=True),
        road=lateral_bounds(found, half),
        speed_limit=None,
        notes=(*scene.notes, "the frame runs along the recorded reference"),
    )


def lanes_at(scene: Scene) -> dict[int, Lane]:
    """The map's lanes by id, as the scene's ego drives them."""
    start = scene.initial_state
    place = np.array([start.x, start.y])
    return driven_lanes(scene.scenario.lanelet_network, place, start.orientation)[0]


def _turn(direction: Array, heading: float) -> float:
    """Angle from a heading to a direction (2,) [rad]."""
    return float((np.arctan2(direction[1], direction[0]) - heading + np.pi) % (2.0 * np.pi) - np.pi)


def as_ego(scene: Scene, obstacle_id: int) -> Scene:
    """Let a recorded obstacle be the ego: it leaves the traffic, and the scene starts with its state.

    An obstacle with unknown id is left to whoever asks for its trajectory.
    """
    chosen = [o for o in scene.obstacles if o.id == obstacle_id]
    if not chosen:
        return scene
    x, y, heading, speed = (float(v) for v in chosen[0].states[0])
    speed = speed if np.isfinite(speed) else 0.0
    start = scene.start.copy()
    start[1, 0], start[2, 0] = speed, 0.0
    return replace(
        scene,
        obstacles=tuple(o for o in scene.obstacles if o.id != obstacle_id),
        recorded_ego=chosen[0],
        start=frozen(start),
        initial_state=replace(
            scene.initial_state, x=x, y=y, orientation=heading, velocity=speed, acceleration=0.0, yaw_rate=0.0
        ),
        notes=(*scene.notes, f"obstacle {obstacle_id} is taken as the ego and leaves the traffic"),
    )
