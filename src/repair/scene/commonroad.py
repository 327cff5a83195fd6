"""From a CommonRoad file to a :class:`Scene`: everything the search needs to know, in one object."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from repair.arrays import Array, frozen
from repair.errors import ConfigError, ScenarioError, kind_of, path_of
from repair.scene.frame import FrenetFrame
from repair.scene.lead_in import drive_path
from repair.scene.reading import read_file, require_commonroad
from repair.scene.road.bounds import crossings, lateral_bounds
from repair.scene.road.direction import driven_lanes
from repair.scene.road.goal import goal_areas
from repair.scene.road.lanes import Lane
from repair.scene.road.passes import every_pass
from repair.scene.road.route import Route, plan_route
from repair.scene.scene import InitialState, Scene
from repair.scene.settings import SceneConfig
from repair.scene.speed_signs import speed_limit_along
from repair.scene.start import first_step_of, initial_state_of, is_ego
from repair.scene.traffic.given.scenario import given_scenario
from repair.scene.traffic.obstacles import last_predicted_step, obstacles_of
from repair.settings import keys_of, require_type
from repair.timegrid import steps_until
from repair.vehicle.model import vehicle_model

__all__ = ["load_scene", "moved_on", "scene_from_scenario", "with_traffic"]

_HORIZON_MAX = 10.0  # unless the caller wants another [s]
_HORIZON_DEFAULT = 5.0  # where neither a prediction nor a goal time says how long [s]
_ROUTE_MAX = 400.0  # road ahead of the ego that is looked at [m],
_FASTER = 10.0  # or what is driven at this much more than the initial speed [m/s]


def load_scene(
    path: str | Path,
    config: Any = None,
    *,
    planning_problem: int | None = None,
    vehicle: int | str | None = None,
    horizon: float | None = None,
    after_prediction: str | None = None,
    smoothing: float | None = None,
) -> Scene:
    """Read a CommonRoad XML file and make a scene of one planning problem in it.

    Parameters
    ----------
    path : path
        The file; at most 200 MB, without document type declarations.
    config : Config or SceneConfig, optional
        How it is read (the section ``scene``); a repair of the scene may not ask for anything else.
    planning_problem, vehicle, horizon, after_prediction, smoothing
        Single keys of that section, laid over it.

    Returns
    -------
    Scene
        Its ``settings`` say what it was loaded with.

    Raises
    ------
    ScenarioError
        If the file cannot be read or lacks what planning needs; the sentence names the file.
    ConfigError
        If a setting has an impossible value.
    """
    asked = {
        "planning_problem": planning_problem, "vehicle": vehicle, "horizon": horizon,
        "after_prediction": after_prediction, "smoothing": smoothing,
    }  # fmt: skip
    settings = _settings(config, asked)
    if hasattr(path, "lanelet_network"):
        raise ScenarioError(
            "a CommonRoad scenario is given where the path of a file is expected; "
            "repair.scene_from_scenario(scenario, planning_problem) makes a scene of it"
        )
    contents = read_file(path_of(path, "a scenario file", ScenarioError))
    try:
        problem, note = _select(contents.problems, settings.planning_problem)
        scene = _quiet(contents.scenario, problem, settings)
    except ScenarioError as error:
        raise ScenarioError(f"{contents.path.name}: {error}") from error
    return replace(
        scene,
        id=contents.benchmark_id,
        path=contents.path,
        sha256=contents.sha256,
        notes=(*contents.notes, *note, *scene.notes),
    )


def _settings(config: Any, asked: Mapping[str, Any]) -> SceneConfig:
    """The section ``scene`` of a configuration, or the section itself, with single keys laid over it."""
    section = getattr(config, "scene", config)
    if section is None:
        section = SceneConfig()
    if not isinstance(section, SceneConfig):
        raise ConfigError(f"a scene is loaded with a configuration, not with {type(config).__name__}")
    laid = {key: value for key, value in asked.items() if value is not None}
    plain = {key: value.item() if isinstance(value, np.generic) else value for key, value in laid.items()}
    settings = replace(section, **plain)
    for key in keys_of(SceneConfig, "scene."):
        require_type(key, getattr(settings, key.name.removeprefix("scene.")))
    return settings


def _select(problems: Mapping[int, Any], wanted: int | None) -> tuple[Any, tuple[str, ...]]:
    if not problems:
        raise ScenarioError("it contains no planning problem")
    if wanted is not None and wanted not in problems:
        known = ", ".join(str(i) for i in sorted(problems))
        raise ScenarioError(f"it has no planning problem {wanted}; there is {known}")
    chosen = min(problems) if wanted is None else wanted
    if wanted is None and len(problems) > 1:
        return problems[chosen], (f"{len(problems)} planning problems: {chosen} is used, the smallest id",)
    return problems[chosen], ()


def scene_from_scenario(
    scenario: Any,
    planning_problem: Any,
    config: Any = None,
    *,
    vehicle: int | str | None = None,
    horizon: float | None = None,
    after_prediction: str | None = None,
    smoothing: float | None = None,
) -> Scene:
    """Make a scene of a CommonRoad scenario and planning problem in memory; see :func:`load_scene`.

    Parameters
    ----------
    scenario : commonroad.scenario.scenario.Scenario
    planning_problem : commonroad.planning.planning_problem.PlanningProblem
    config : Config or SceneConfig, optional
        How it is read (the section ``scene``).
    vehicle, horizon, after_prediction, smoothing
        Single keys of that section, laid over it.

    Returns
    -------
    Scene

    Raises
    ------
    ScenarioError
        If they are of another kind, or lack what planning needs.
    ConfigError
        If a setting has an impossible value.
    """
    asked = {
        "vehicle": vehicle, "horizon": horizon, "after_prediction": after_prediction, "smoothing": smoothing,
    }  # fmt: skip
    settings = _settings(config, asked)
    _require_objects(scenario, planning_problem)
    return _quiet(scenario, planning_problem, settings)


def with_traffic(scene: Scene, traffic: Iterable[Any], *, threshold: float = 0.0) -> Scene:
    """The same scene among other traffic, from memory.

    Parameters
    ----------
    scene : Scene
        Its own traffic is left out.
    traffic : iterable
        CommonRoad obstacles, or :class:`repair.Prediction`: poses or occupancies over the scenario's steps.
        Several predictions with one id are modes of that obstacle: a repair has to be clear of all of them.
        :func:`repair.predictions_of` makes predictions of arrays.
    threshold : float
        Modes less probable than this number are left out, with a note.

    Returns
    -------
    Scene
        Its ``modes`` say which prediction stands under which id. The horizon is that of the predictions.

    Raises
    ------
    ScenarioError
        If an obstacle cannot be had; the sentence names it.
    """
    if not isinstance(scene, Scene):
        raise ScenarioError(f"a scene is expected (repair.load_scene), not {kind_of(scene)}")
    scenario, modes, notes = given_scenario(scene.scenario, scene.initial_time_step, traffic, threshold)
    made = _quiet(scenario, scene.planning_problem, scene.settings)
    return replace(made, id=scene.id, modes=modes, notes=(*made.notes, *notes))


def moved_on(scene: Scene, ego: InitialState) -> Scene:
    """The scene laid out anew from where the ego is now, for the same goal.

    Raises
    ------
    ScenarioError
        If there is no road at that place.
    """
    from commonroad.planning.planning_problem import PlanningProblem
    from commonroad.scenario.state import InitialState as State

    state = State(
        time_step=scene.initial_time_step, position=np.array([ego.x, ego.y]), orientation=ego.orientation,
        velocity=ego.velocity, acceleration=ego.acceleration, yaw_rate=ego.yaw_rate, slip_angle=0.0,
    )  # fmt: skip
    problem = PlanningProblem(scene.planning_problem_id, state, scene.planning_problem.goal)
    return replace(_quiet(scene.scenario, problem, scene.settings), id=scene.id)


def _require_objects(scenario: Any, problem: Any) -> None:
    """Refuse what is no CommonRoad scenario, or no planning problem of one."""
    require_commonroad()
    if not all(hasattr(scenario, name) for name in ("dt", "lanelet_network", "dynamic_obstacles")):
        raise ScenarioError(f"a CommonRoad scenario is expected, not {kind_of(scenario)}")
    if hasattr(problem, "planning_problem_dict"):
        raise ScenarioError(
            "a single planning problem is expected, not a set; planning_problem_dict has them"
        )
    if not all(hasattr(problem, name) for name in ("initial_state", "goal", "planning_problem_id")):
        raise ScenarioError(f"a CommonRoad planning problem is expected, not {kind_of(problem)}")


def _quiet(scenario: Any, problem: Any, settings: SceneConfig) -> Scene:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"(commonroad|shapely|google)\.")
        return _build(scenario, problem, settings)


def _build(scenario: Any, problem: Any, settings: SceneConfig) -> Scene:
    model = vehicle_model(settings.vehicle)
    vehicle, after, smoothing = model.parameters, settings.after_prediction, settings.smoothing
    if not (np.isfinite(smoothing) and smoothing > 0.0):
        raise ConfigError(f"smoothing is {smoothing!r} m; it has to be positive")
    dt = float(scenario.dt)
    if not 1e-3 <= dt <= 10.0:
        raise ScenarioError(f"the time step is {dt!r} s; it has to be positive, from 0.001 to 10 s")
    ego = initial_state_of(problem.initial_state)
    first_step = first_step_of(problem.initial_state)
    n_steps = _steps_considered(scenario, problem, dt, first_step, settings.horizon, after)
    duration = n_steps * dt

    position = np.array([ego.x, ego.y])
    lanes, notes = driven_lanes(scenario.lanelet_network, position, ego.orientation)
    speed = max(ego.velocity, 0.0)
    farthest = max(_ROUTE_MAX, (speed + _FASTER) * duration)  # as often around a ring as that takes
    ahead = float(np.clip(speed * duration + duration**2 + 40.0, 80.0, farthest))
    route = plan_route(lanes, position, ego.orientation, problem.goal, speed=speed, ahead=ahead)
    lead_in = drive_path(
        route.center, position, ego.orientation, speed, vehicle, smoothing=smoothing, near=route.start, dt=dt
    )
    frame, s0 = lead_in.frame, lead_in.start
    notes += [*route.notes, *lead_in.notes]
    goal_s = _goal_s(frame, s0, route, lanes, problem.goal)
    if route.end is not None and frame.length - s0 < speed * duration:
        note = f"the road ends {frame.length - s0:.0f} m ahead, within the horizon: {route.end}"
        if goal_s is not None:
            note += f"; the goal begins {max(frame.length - goal_s, 0.0):.0f} m before it"
        notes.append(note)

    obstacles, recorded, remarks = obstacles_of(
        scenario, first_step=first_step, n_steps=n_steps, after_prediction=after,
        is_ego=partial(is_ego, ego=ego, first_step=first_step, vehicle=vehicle),
        ego_id=int(problem.planning_problem_id), ego_speed=ego.velocity,
    )  # fmt: skip
    found = crossings(frame, lanes)
    half = vehicle.half_width
    return Scene(
        id=str(scenario.scenario_id), path=None, sha256="", dt=dt, frame=frame, model=model,
        start=frozen([[s0, 0.0], [ego.velocity, 0.0], [ego.acceleration, 0.0]]),
        initial_state=ego, planning_problem_id=int(problem.planning_problem_id), initial_time_step=first_step,
        goal_s=goal_s, route_end_s=frame.length, road_end=route.end,
        route_lanelets=route.lanelets, horizon=duration, n_steps=n_steps,
        obstacles=obstacles, recorded_ego=recorded,
        lane=lateral_bounds(found, half, lanelets=(*route.behind, *route.lanelets)),
        same_direction=lateral_bounds(
            found, half, lanelets=(*route.behind, *route.lanelets), same_direction=True),
        road=lateral_bounds(found, half),
        speed_limit=speed_limit_along(scenario, frame, route, lanes, notes),
        notes=(*notes, *remarks), scenario=scenario, planning_problem=problem,
        settings=settings,
    )  # fmt: skip


def _steps_considered(
    scenario: Any, problem: Any, dt: float, first: int, horizon: float | None, after: str
) -> int:
    """Steps to the last prediction, else to the goal's time, else 5 s; at most ``horizon``."""
    if horizon is not None and not (np.isfinite(horizon) and horizon > 0.0):
        raise ConfigError(f"the horizon is {horizon!r} s; it has to be positive")
    limit = max(steps_until(_HORIZON_MAX if horizon is None else horizon, dt), 1)
    last = last_predicted_step(scenario)
    if last is not None and last > first:
        open_ended = after != "remove" and horizon is not None
        return limit if open_ended else min(last - first, limit)
    times = [getattr(state, "time_step", None) for state in problem.goal.state_list]
    # the smaller one first: a file may hold integers that no float can
    ends = [min(limit, getattr(t, "end", t) - first) for t in times if t is not None]
    ends = [int(e) for e in ends if e >= 1]
    return max(ends) if ends else min(max(round(_HORIZON_DEFAULT / dt), 1), limit)


def _goal_s(
    frame: FrenetFrame, s0: float, route: Route, lanes: Mapping[int, Lane], goal: Any
) -> float | None:
    """Where the goal region begins along the path: never before the ego."""
    named = {i for ids in (goal.lanelets_of_goal_position or {}).values() for i in ids}
    entries: list[Array] = [lanes[i].center[:1] for i in route.goal_lanelets if i in named]
    if not named:
        entries = [np.asarray(area.exterior.coords)[:, :2] for area in goal_areas(goal)]
    starts = []
    for projected in (found for points in entries for found in every_pass(frame, points)):
        close = projected[np.abs(projected[:, 1]) < 15.0]
        if len(close) and close[:, 0].max() >= s0 and close[:, 0].min() <= frame.length:
            starts.append(float(close[:, 0].min()))
    return max(min(starts), s0) if starts else None
