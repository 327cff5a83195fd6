"""A planning problem made ready for the search."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.scene.frame import FrenetFrame
from repair.scene.road.bounds import LateralBounds
from repair.scene.road.route import RoadEnd
from repair.scene.settings import SceneConfig
from repair.scene.traffic.obstacle import Obstacle
from repair.scene.traffic.prediction import Mode
from repair.scene.traffic.stepwise import expand_sets
from repair.vehicle.model import VehicleModel
from repair.vehicle.parameters import Vehicle

__all__ = ["InitialState", "Scene", "SpeedLimit"]

_AT_THE_END = 6.0  # who leaves the road so near to its end leaves it there [m]


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


@dataclass(frozen=True, repr=False)
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
    model : VehicleModel
        The ego: how it drives, and its parameters (``vehicle``).
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
        The CommonRoad objects that were given. The traffic is ``obstacles``; those of the scenario are
        looked at by nobody, and what CommonRoad's own checker is to judge comes from :meth:`official`.
    settings : SceneConfig
        What the scene was loaded with.
    road_end : RoadEnd or None
        What kind of end the road has there; None where the route goes on beyond what is looked at.
    modes : tuple of Mode
        Of obstacles that were given several predictions (:func:`repair.with_traffic`).
    first_heading : float or None
        Orientation of the body at t = 0 [rad] where a reference states it; None for that of steady driving
        along the frame.
    """

    id: str
    path: Path | None
    sha256: str
    dt: float
    frame: FrenetFrame
    model: VehicleModel
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
    settings: SceneConfig = field(default_factory=SceneConfig)
    road_end: RoadEnd | None = None
    modes: tuple[Mode, ...] = ()
    first_heading: float | None = None

    def ending_at(self, place: tuple[float, float]) -> str:
        """What the road's end is, as it goes on a sentence about a ``place`` [m]; empty elsewhere."""
        end = self.road_end
        if end is None or np.hypot(place[0] - end.place[0], place[1] - end.place[1]) > _AT_THE_END:
            return ""
        return f"; {end}"

    def __repr__(self) -> str:
        return (
            f"<Scene {self.id}, planning problem {self.planning_problem_id}: "
            f"{len(self.obstacles)} obstacles, {self.horizon:g} s in steps of {self.dt:g} s, "
            f"{self.initial_state.velocity:.4g} m/s>"
        )

    @property
    def vehicle(self) -> Vehicle:
        """Body, reference point and limits of the ego."""
        return self.model.parameters

    def official(self) -> Any:
        """The CommonRoad scenario with the traffic of this scene alone: a copy.

        Recordings of the ego itself are left out, with which every solution would collide. Sets that hold
        over intervals, start late or pause are given step by step, since the drivability checker counts them.
        """
        kept = {id(obstacle.source) for obstacle in self.obstacles}
        gone = {o.obstacle_id for o in self.scenario.dynamic_obstacles if id(o) not in kept}
        copied = deepcopy(self.scenario)
        for obstacle in [o for o in copied.dynamic_obstacles if o.obstacle_id in gone]:
            copied.remove_obstacle(obstacle)
        expand_sets(copied, self.initial_time_step + self.n_steps)
        return copied

    @property
    def times(self) -> Array:
        """Times of the steps (n_steps + 1,) [s]."""
        return np.arange(self.n_steps + 1, dtype=np.float64) * self.dt
