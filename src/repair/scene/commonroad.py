"""From a CommonRoad file to a :class:`Scene`: everything the search needs to know, in one object."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.errors import ConfigError, ScenarioError
from repair.scene.bounds import crossings, lateral_bounds
from repair.scene.frame import FrenetFrame
from repair.scene.lead_in import drive_path
from repair.scene.obstacles import Obstacle, last_predicted_step, obstacles_of
from repair.scene.route import Lane, Route, goal_areas, lanes_of, plan_route
from repair.scene.shapes import FAR
from repair.scene.vehicle import Vehicle, load_vehicle
from repair.types import Array, LateralBounds, frozen

__all__ = ["InitialState", "Scene", "SpeedLimit", "load_scene", "scene_from_scenario"]

_HORIZON_MAX = 10.0  # unless the caller wants another [s]
_HORIZON_DEFAULT = 5.0  # where neither a prediction nor a goal time says how long [s]
_ROUTE_MAX = 400.0  # road ahead of the ego that is looked at [m]
_STEPS_MAX = 10**9  # of the initial time step
_SPEED = (-0.1, 100.0)  # initial speeds that can be dealt with [m/s]


@dataclass(frozen=True)
class InitialState:
    """The planning problem's initial state: [m], [rad], [m/s], [m/s²], [rad/s]."""

    x: float
    y: float
    orientation: float
    velocity: float
    acceleration: float
    yaw_rate: float


@dataclass(frozen=True)
class SpeedLimit:
    """Speed limit by traffic signs, tabulated over s; inf where there is none [m/s]."""

    s: Array
    speed: Array

    def at(self, s: npt.ArrayLike) -> Array:
        """Limit at ``s`` (any shape): that of the last table entry at or before ``s``."""
        query = np.asarray(s, dtype=np.float64)
        index = np.clip(np.searchsorted(self.s, query, side="right") - 1, 0, len(self.s) - 1)
        return np.asarray(self.speed[index])


@dataclass(frozen=True)
class Scene:
    """A planning problem made ready: frame along the driven path, ego, road and obstacles.

    Attributes
    ----------
    id : str
        Benchmark id written in the file.
    path : Path or None
        The file; None for a scenario from memory.
    sha256 : str
        Of the file's bytes; empty for a scenario from memory.
    dt : float
        Time step [s].
    frame : FrenetFrame
        Along the path the ego drives: from its pose onto the route's centre line.
    vehicle : Vehicle
    start : (3, 2) array
        Position, velocity and acceleration ``[s, l]`` at t = 0; l = 0 by construction.
    initial_state : InitialState
    planning_problem_id, initial_time_step : int
    goal_s : float or None
        Arc length at which the goal region begins [m]; None without a goal position on the route.
    route_end_s : float
        Arc length at which the road ends [m]; beyond, the frame is only a straight extension.
    route_lanelets : tuple of int
    horizon : float
        Last time considered [s]; ``n_steps * dt``.
    n_steps : int
    obstacles : tuple of Obstacle
        Without the recorded ego; every array has ``n_steps + 1`` rows.
    recorded_ego : Obstacle or None
        A trajectory obstacle that is the ego itself.
    lane, same_direction, road : LateralBounds
        Room of the reference point, half the ego's width taken off: on the route's lanelets, on
        connected lanelets of the same direction, on all connected lanelets.
    speed_limit : SpeedLimit or None
    notes : tuple of str
        What had to be assumed or left out.
    scenario, planning_problem
        The CommonRoad objects.
    """

    id: str
    path: Path | None
    sha256: str
    dt: float
    frame: FrenetFrame
    vehicle: Vehicle
    start: Array
    initial_state: InitialState
    planning_problem_id: int
    initial_time_step: int
    goal_s: float | None
    route_end_s: float
    route_lanelets: tuple[int, ...]
    horizon: float
    n_steps: int
    obstacles: tuple[Obstacle, ...]
    recorded_ego: Obstacle | None
    lane: LateralBounds
    same_direction: LateralBounds
    road: LateralBounds
    speed_limit: SpeedLimit | None
    notes: tuple[str, ...]
    scenario: Any
    planning_problem: Any

    @property
    def times(self) -> Array:
        """Times of the steps (n_steps + 1,) [s]."""
        return np.arange(self.n_steps + 1, dtype=np.float64) * self.dt


def load_scene(
    path: str | Path,
    *,
    planning_problem: int | None = None,
    vehicle: int = 1,
    horizon: float | None = None,
    after_prediction: str = "remove",
    smoothing: float = 0.15,
) -> Scene:
    """Read a CommonRoad XML file and make a scene of one planning problem in it.

    Parameters
    ----------
    path : path
        The file; at most 200 MB, without document type declarations.
    planning_problem : int, optional
        Id of the planning problem; by default the smallest one.
    vehicle : int
        CommonRoad vehicle type of the ego, 1 to 4.
    horizon : float, optional
        Consider at most this time [s]; by default at most 10 s.
    after_prediction : str
        ``remove``, ``hold`` or ``constant_velocity``: what becomes of an obstacle after its
        prediction.
    smoothing : float
        How far smoothing may move the route's centre line [m]; more of it means gentler curves.

    Raises
    ------
    ScenarioError
        If the file cannot be read or lacks what planning needs; the sentence names the file.
    ConfigError
        If ``vehicle``, ``horizon`` or ``after_prediction`` is not one of the possible values.
    """
    from repair.scene.reading import read_file

    contents = read_file(Path(path))
    try:
        problem, note = _select(contents.problems, planning_problem)
        scene = scene_from_scenario(
            contents.scenario, problem, vehicle=vehicle, horizon=horizon, after_prediction=after_prediction,
            smoothing=smoothing,
        )  # fmt: skip
    except ScenarioError as error:
        raise ScenarioError(f"{contents.path.name}: {error}") from error
    return replace(
        scene,
        id=contents.benchmark_id,
        path=contents.path,
        sha256=contents.sha256,
        notes=(*contents.notes, *note, *scene.notes),
    )


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
    *,
    vehicle: int = 1,
    horizon: float | None = None,
    after_prediction: str = "remove",
    smoothing: float = 0.15,
) -> Scene:
    """Make a scene of a CommonRoad scenario and planning problem in memory; see :func:`load_scene`."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"(commonroad|shapely|google)\.")
        return _build(scenario, planning_problem, load_vehicle(vehicle), horizon, after_prediction, smoothing)


def _build(
    scenario: Any, problem: Any, vehicle: Vehicle, horizon: float | None, after: str, smoothing: float
) -> Scene:
    if not (np.isfinite(smoothing) and smoothing > 0.0):
        raise ConfigError(f"smoothing is {smoothing!r} m; it has to be positive")
    dt = float(scenario.dt)
    if not 1e-3 <= dt <= 10.0:
        raise ScenarioError(f"the time step is {dt!r} s; it has to be positive, from 0.001 to 10 s")
    ego = _initial_state(problem.initial_state)
    first_step = _first_step(problem.initial_state)
    n_steps = _steps_considered(scenario, problem, dt, first_step, horizon, after)
    duration = n_steps * dt

    lanes, notes = lanes_of(scenario.lanelet_network)
    speed = max(ego.velocity, 0.0)
    ahead = float(np.clip(speed * duration + duration**2 + 40.0, 80.0, _ROUTE_MAX))
    position = np.array([ego.x, ego.y])
    route = plan_route(lanes, position, ego.orientation, problem.goal, speed=speed, ahead=ahead)
    lead_in = drive_path(route.center, position, ego.orientation, speed, vehicle, smoothing=smoothing)
    frame, s0 = lead_in.frame, lead_in.start
    notes += [*route.notes, *lead_in.notes]
    if route.road_ends and frame.length - s0 < speed * duration:
        notes.append(f"the road ends {frame.length - s0:.0f} m ahead, within the horizon")

    obstacles, recorded, remarks = obstacles_of(
        scenario, first_step=first_step, n_steps=n_steps, after_prediction=after,
        is_ego=partial(_is_ego, ego=ego, first_step=first_step, vehicle=vehicle),
        ego_id=int(problem.planning_problem_id), ego_speed=ego.velocity,
    )  # fmt: skip
    found = crossings(frame, lanes)
    half = vehicle.width / 2.0
    return Scene(
        id=str(scenario.scenario_id), path=None, sha256="", dt=dt, frame=frame, vehicle=vehicle,
        start=frozen([[s0, 0.0], [ego.velocity, 0.0], [ego.acceleration, 0.0]]),
        initial_state=ego, planning_problem_id=int(problem.planning_problem_id), initial_time_step=first_step,
        goal_s=_goal_s(frame, s0, route, lanes, problem.goal), route_end_s=frame.length,
        route_lanelets=route.lanelets, horizon=duration, n_steps=n_steps,
        obstacles=obstacles, recorded_ego=recorded,
        lane=lateral_bounds(found, half, lanelets=(*route.behind, *route.lanelets)),
        same_direction=lateral_bounds(
            found, half, lanelets=(*route.behind, *route.lanelets), same_direction=True),
        road=lateral_bounds(found, half),
        speed_limit=_speed_limit(scenario, frame, route, lanes, notes),
        notes=(*notes, *remarks), scenario=scenario, planning_problem=problem,
    )  # fmt: skip


def _initial_state(state: Any) -> InitialState:
    values = []
    position = getattr(state, "position", None)
    if position is None or hasattr(position, "center") or hasattr(position, "shapes"):
        raise ScenarioError("the planning problem's initial position is not an exact point")
    for name in ("orientation", "velocity", "acceleration", "yaw_rate"):
        value = getattr(state, name, None)
        if value is not None and hasattr(value, "start"):
            value = (value.start + value.end) / 2.0
        if value is None and name in ("orientation", "velocity"):
            raise ScenarioError(f"the planning problem's initial state has no {name}")
        values.append(0.0 if value is None else float(value))
    numbers = [float(position[0]), float(position[1]), *values]
    if not np.isfinite(numbers).all():
        raise ScenarioError("the planning problem's initial state is not finite")
    made = InitialState(*numbers)
    if max(abs(made.x), abs(made.y)) > FAR:
        raise ScenarioError(
            f"the ego's initial position ({made.x:g}, {made.y:g}) is farther than {FAR:g} m out"
        )
    if not _SPEED[0] <= made.velocity <= _SPEED[1]:
        raise ScenarioError(
            f"the ego's initial speed is {made.velocity:g} m/s; it has to be from 0 to {_SPEED[1]:g} m/s"
        )
    return made


def _first_step(state: Any) -> int:
    step = getattr(state, "time_step", None)
    if step is None:
        raise ScenarioError("the planning problem's initial state has no time step")
    first = int(step.start if hasattr(step, "start") else step)
    if not 0 <= first <= _STEPS_MAX:
        raise ScenarioError(f"the planning problem starts at time step {first}; CommonRoad counts from 0")
    return first


def _steps_considered(
    scenario: Any, problem: Any, dt: float, first: int, horizon: float | None, after: str
) -> int:
    """Steps to the last prediction, else to the goal's time, else 5 s; at most ``horizon``."""
    if horizon is not None and not (np.isfinite(horizon) and horizon > 0.0):
        raise ConfigError(f"the horizon is {horizon!r} s; it has to be positive")
    limit = max(int(np.floor((_HORIZON_MAX if horizon is None else horizon) / dt + 1e-6)), 1)
    last = last_predicted_step(scenario)
    if last is not None and last > first:
        open_ended = after != "remove" and horizon is not None
        return limit if open_ended else min(last - first, limit)
    times = [getattr(state, "time_step", None) for state in problem.goal.state_list]
    # the smaller one first: a file may hold integers that no float can
    ends = [min(limit, getattr(t, "end", t) - first) for t in times if t is not None]
    ends = [int(e) for e in ends if e >= 1]
    return max(ends) if ends else min(max(round(_HORIZON_DEFAULT / dt), 1), limit)


def _is_ego(obstacle: Any, *, ego: InitialState, first_step: int, vehicle: Vehicle) -> bool:
    """Whether a moving obstacle starts where, how fast and about as large as the ego."""
    state = obstacle.state_at_time(first_step)
    if state is None or hasattr(state.position, "center") or hasattr(state.position, "shapes"):
        return False
    heading, speed = getattr(state, "orientation", None), getattr(state, "velocity", None)
    if hasattr(heading, "start") or hasattr(speed, "start"):  # uncertain
        return False
    off = np.hypot(state.position[0] - ego.x, state.position[1] - ego.y)
    turned = 0.0 if heading is None else abs((heading - ego.orientation + np.pi) % (2 * np.pi) - np.pi)
    faster = 0.0 if speed is None else abs(speed - ego.velocity)
    length = getattr(obstacle.obstacle_shape, "length", None)
    alike = length is None or abs(length - vehicle.length) < 2.0
    return bool(off < 0.5 and turned < 0.1 and faster < 1.0 and alike)


def _goal_s(
    frame: FrenetFrame, s0: float, route: Route, lanes: Mapping[int, Lane], goal: Any
) -> float | None:
    """Where the goal region begins along the path: never before the ego."""
    named = {i for ids in (goal.lanelets_of_goal_position or {}).values() for i in ids}
    entries: list[Array] = [lanes[i].center[:1] for i in route.goal_lanelets if i in named]
    if not named:
        entries = [np.asarray(area.exterior.coords)[:, :2] for area in goal_areas(goal)]
    starts = []
    for points in entries:
        projected = frame.to_frenet(points)
        close = projected[np.abs(projected[:, 1]) < 15.0]
        if len(close) and close[:, 0].max() >= s0 and close[:, 0].min() <= frame.length:
            starts.append(float(close[:, 0].min()))
    return max(min(starts), s0) if starts else None


def _speed_limit(
    scenario: Any, frame: FrenetFrame, route: Route, lanes: Mapping[int, Lane], notes: list[str]
) -> SpeedLimit | None:
    """Limits by traffic signs on the route's lanelets."""
    from commonroad.scenario.traffic_sign import SupportedTrafficSignCountry
    from commonroad.scenario.traffic_sign_interpreter import TrafficSignInterpreter

    try:
        country = SupportedTrafficSignCountry(scenario.scenario_id.country_id)
    except ValueError:
        country = SupportedTrafficSignCountry.ZAMUNDA
    interpreter = TrafficSignInterpreter(country, scenario.lanelet_network)
    entries: list[tuple[float, float]] = []
    for name in route.lanelets:
        try:
            limit = interpreter.speed_limit(frozenset({name}))
        except (AssertionError, AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            notes.append(f"the traffic signs of lanelet {name} cannot be read ({error})")
            limit = None
        entry = frame.to_frenet(lanes[name].center[:1])[0, 0]
        # a lanelet that begins before the path counts from its start on
        begin = 0.0 if not np.isfinite(entry) else float(np.clip(entry, 0.0, frame.length))
        begin = begin if not entries else max(begin, entries[-1][0])
        entries.append((begin, np.inf if limit is None or not 0.0 < limit <= _SPEED[1] else float(limit)))
    if all(np.isinf(limit) for _, limit in entries):
        return None
    s, speed = zip(*entries, strict=True)
    return SpeedLimit(frozen(s), frozen(speed))
