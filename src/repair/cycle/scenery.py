"""The scene of a cycle: the road as it is kept, the ego and the traffic as they are now."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from repair.arrays import Array, frozen, wrap
from repair.config.schema import Config
from repair.errors import ConfigError, ScenarioError, kind_of
from repair.scene.commonroad import load_scene, scene_from_scenario
from repair.scene.frame import FrenetFrame
from repair.scene.scene import InitialState, Scene
from repair.scene.traffic.given.rows import given_obstacles
from repair.scene.traffic.obstacle import Obstacle, later
from repair.scene.traffic.prediction import Mode
from repair.timegrid import INSTANT, steps_until

__all__ = ["fits", "in_frame", "scene_now", "scene_of"]

_BESIDE = 0.2  # a plan further beside the kept frame's path gets one of its own [m]; smoothing takes 0.1
_SETS_OUT, _SLOPE = 0.1, 0.2  # after so much of it [m] it leads across the path by no more than this share
_LEAST = 3  # steps of a horizon
_HORIZON = 10.0  # unless ``scene.horizon`` says another [s]


def scene_of(road: Any, planning_problem: Any, config: Config) -> Scene:
    """The scene of whatever a road is given as."""
    if hasattr(road, "lanelet_network"):
        return scene_from_scenario(road, planning_problem, config)
    if planning_problem is not None:
        raise ConfigError(
            "planning_problem belongs to a CommonRoad scenario; a scene has its own, and of a file it is the "
            "key scene.planning_problem"
        )
    if isinstance(road, Scene):
        return road
    if not isinstance(road, str | Path):
        raise ScenarioError(f"a road is a scene, a path or a CommonRoad scenario, not {kind_of(road)}")
    return load_scene(road, config)


def scene_now(
    base: Scene, recorded: Scene, step: int, ego: InitialState, traffic: Iterable[Any] | None,
    threshold: float = 0.0,
) -> Scene:  # fmt: skip
    """The scene of a cycle, on the road's own frame.

    Parameters
    ----------
    base : Scene
        The road that is laid out.
    recorded : Scene
        Whose traffic it is where none is given.
    step : int
        When the cycle begins.
    ego : InitialState
    traffic : iterable, optional
    threshold : float
        See :meth:`repair.Repairer.update`.

    Raises
    ------
    ScenarioError
        If the traffic cannot be used, or ends too soon.
    """
    first = recorded.initial_time_step + step
    notes: list[str] = []
    modes: tuple[Mode, ...] = ()
    if traffic is None:
        obstacles: tuple[Obstacle, ...] = tuple(
            o for o in (later(o, step) for o in recorded.obstacles) if o is not None
        )
        n_steps = recorded.n_steps - step
        if n_steps < _LEAST:
            end = recorded.horizon
            raise ScenarioError(
                f"the scenario's own traffic ends at {end:g} s, and now is {step * base.dt:g} s"
            )
    else:
        obstacles, n_steps, modes, notes = given_obstacles(
            base.scenario, first, traffic, threshold=threshold,
            after_prediction=base.settings.after_prediction,
            steps_max=steps_until(base.settings.horizon or _HORIZON, base.dt),
        )  # fmt: skip
    start = frozen([base.start[0], [ego.velocity, 0.0], [ego.acceleration, 0.0]])
    return replace(
        base, initial_state=ego, start=start, obstacles=obstacles, n_steps=n_steps,
        horizon=n_steps * base.dt, initial_time_step=first, recorded_ego=None, notes=tuple(notes),
        modes=modes,
    )  # fmt: skip


def fits(places: Array, frame: FrenetFrame, room: float, body: float | None) -> bool:
    """Whether a plan is on a frame's path, with as much of it ahead as a new frame would have.

    It has to set out along it, too: who crawls would bend within centimetres to get from one to the other.
    Of a plan that hardly moves the direction says nothing, and the body [rad] has to stand along the path,
    unless it is None.
    """
    if not np.isfinite(places).all():
        return False
    moved = places - places[0]
    begun = moved[np.hypot(*moved.T) >= _SETS_OUT]
    if len(begun):
        along = abs(begun[0, 1]) <= _SLOPE * abs(begun[0, 0])
    else:
        along = body is None or abs(float(wrap(frame.heading(places[0, 0]) - body))) <= _SLOPE
    return bool(
        np.abs(places[:, 1]).max() <= _BESIDE
        and places[0, 0] > 1.0
        and places[-1, 0] <= frame.length - room + INSTANT
        and along
    )


def in_frame(kept: Scene, scene: Scene, place: Array, heading: float | None) -> Scene:
    """The scene of this cycle in the frame of another one; ``heading`` of the body [rad], where known."""
    start = frozen([place, scene.start[1], scene.start[2]])
    return replace(
        scene, frame=kept.frame, start=start, route_end_s=kept.route_end_s, goal_s=kept.goal_s,
        lane=kept.lane, same_direction=kept.same_direction, road=kept.road, speed_limit=kept.speed_limit,
        first_heading=heading,
    )  # fmt: skip
