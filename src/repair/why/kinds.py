"""What could be different: kinds of assumptions, and the situation under each of them."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.check.checker import Checker
from repair.check.edge import RoadEdge
from repair.config.schema import Config
from repair.preparation import Phases, Prepared, laid_out
from repair.scene.road.bounds import LateralBounds
from repair.scene.scene import Scene
from repair.scene.traffic.obstacle import Obstacle
from repair.vehicle.model import KinematicSingleTrack
from repair.vehicle.parameters import Vehicle
from repair.why.moved import delayed, translated
from repair.why.slower import Slower, slower_start
from repair.why.stronger import Stronger, more_grip, more_power, more_steering
from repair.world.road_corridor import RoadCorridor

__all__ = ["KINDS", "Kind", "among", "under"]

_MODEL = "the vehicle is no kinematic single-track model"


@dataclass(frozen=True)
class Kind:
    """One way in which things could be different, by an amount.

    Attributes
    ----------
    name, unit : str
    step, most : float
        To what the amount is found, and how much of it is tried; 0 where there is no amount, infinite where
        it is half of the speed in the beginning.
    of_obstacle : bool
        Whether an obstacle is changed.
    monotone : bool
        Whether more of it always leaves what less of it allows.
    """

    name: str
    unit: str
    step: float
    most: float
    of_obstacle: bool = False
    monotone: bool = True


#: In the order in which they are tried.
KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind("removed", "", 0.0, 0.0, of_obstacle=True),
        Kind("friction", "m/s²", 0.1, 12.8),
        Kind("road", "m", 0.05, 6.4),
        Kind("later", "s", 0.1, 3.2, of_obstacle=True, monotone=False),
        Kind("earlier", "s", 0.1, 3.2, of_obstacle=True, monotone=False),
        Kind("away", "m", 0.1, 25.6, of_obstacle=True, monotone=False),
        Kind("start", "m/s", 0.1, math.inf),
        Kind("engine", "m/s²", 0.1, 6.4),
        Kind("steering", "%", 5.0, 320.0),
    )
}


def among(prepared: Prepared, obstacles: tuple[Obstacle, ...]) -> Prepared:
    """The situation among other traffic, until the same end."""
    return _laid_out(prepared, replace(prepared.scene, obstacles=obstacles))


def under(prepared: Prepared, kind: str, amount: float = 0.0, index: int | None = None) -> Prepared:
    """The situation as it would be.

    Parameters
    ----------
    prepared : Prepared
    kind : str
        One of :data:`KINDS`.
    amount : float
        In its unit.
    index : int, optional
        Of the obstacle in the scene, where an obstacle is changed.

    Raises
    ------
    ValueError
        If it cannot be had; the sentence says why.
    """
    if KINDS[kind].of_obstacle:
        assert index is not None
        return among(prepared, tuple(_changed(prepared, kind, amount, index)))
    return _CHANGES[kind](prepared, amount)


def _changed(prepared: Prepared, kind: str, amount: float, index: int) -> list[Obstacle]:
    """The traffic with one obstacle changed."""
    scene = prepared.scene
    obstacles, one = list(scene.obstacles), scene.obstacles[index]
    if kind == "removed":
        return [*obstacles[:index], *obstacles[index + 1 :]]
    if kind == "away":
        obstacles[index] = translated(one, amount * away_from_ego(prepared, index))
    else:
        steps = round(amount / scene.dt)
        obstacles[index] = delayed(one, steps if kind == "later" else -steps)
    return obstacles


def away_from_ego(prepared: Prepared, index: int) -> Array:
    """Unit vector (2,) from the ego to an obstacle: at the conflict, or where the reference is nearest."""
    states = prepared.checker.drive(prepared.reference, prepared.t_reference)
    n = prepared.checker.config.substeps
    ego = np.stack((states.x[::n], states.y[::n]), axis=1)
    there = prepared.scene.obstacles[index].states[: len(ego), :2]
    way = there - ego[: len(there)]
    length = np.hypot(way[:, 0], way[:, 1])
    if not np.isfinite(length).any():
        raise ValueError("the obstacle is never there")
    k = round(prepared.conflict.time / prepared.scene.dt)
    if not (k < len(length) and np.isfinite(length[k])):
        k = int(np.nanargmin(length))
    heading = float(states.orientation[::n][k])
    return way[k] / length[k] if length[k] > 1e-6 else np.array([math.cos(heading), math.sin(heading)])


def _friction(prepared: Prepared, amount: float) -> Prepared:
    """Tyres with more grip; limits that were configured are moved likewise."""
    asked, vehicle = prepared.config.limits, prepared.scene.vehicle
    share = prepared.limits.a_total / vehicle.a_max if asked.a_total is None else 1.0
    more = {
        name: value + sign * amount
        for name, sign in (("a_total", 1.0), ("a_lat", 1.0), ("a_min", -1.0))
        if (value := getattr(asked, name)) is not None
    }
    scene = _driven_by(prepared, more_grip(vehicle, amount, share))
    return _laid_out(prepared, scene, replace(prepared.config, limits=replace(asked, **more)))


def _engine(prepared: Prepared, amount: float) -> Prepared:
    """More power, and as much more acceleration allowed."""
    asked, vehicle = prepared.config.limits, prepared.scene.vehicle
    most = prepared.limits.a_max + amount
    if prepared.limits.a_max >= prepared.limits.a_total:
        raise ValueError("the tyres limit acceleration, not the engine")
    share = prepared.limits.a_total / vehicle.a_max if asked.a_total is None else 1.0
    stronger = more_power(vehicle, most, float(prepared.scene.start[1, 0]), share)
    limits = asked if asked.a_max is None else replace(asked, a_max=most)
    return _laid_out(prepared, _driven_by(prepared, stronger), replace(prepared.config, limits=limits))


def _steering(prepared: Prepared, amount: float) -> Prepared:
    """Wheels that turn faster and farther."""
    return _laid_out(prepared, _driven_by(prepared, more_steering(prepared.scene.vehicle, amount / 100.0)))


def _road(prepared: Prepared, amount: float) -> Prepared:
    """A road that reaches farther on all sides."""
    scene, edge = prepared.scene, prepared.checker.edge
    if edge is None:
        raise ValueError("checker.road is off")
    lane, same, road = (_wider(room, amount) for room in (scene.lane, scene.same_direction, scene.road))
    wider = replace(scene, lane=lane, same_direction=same, road=road)
    return _laid_out(prepared, wider, edge=_wider_edge(edge, amount))


def _start(prepared: Prepared, amount: float) -> Prepared:
    """An ego that is slower from the start on."""
    speed = float(prepared.scene.start[1, 0])
    share = 1.0 - amount / speed if speed > 0.0 else 0.0
    if share <= 0.0:
        raise ValueError("the ego would stand")
    scene = slower_start(prepared.scene, share)
    return _laid_out(prepared, scene, reference=Slower(prepared.reference, share))


_CHANGES: dict[str, Callable[[Prepared, float], Prepared]] = {
    "friction": _friction,
    "engine": _engine,
    "steering": _steering,
    "road": _road,
    "start": _start,
}


def _driven_by(prepared: Prepared, vehicle: Vehicle) -> Scene:
    """The scene with a stronger vehicle."""
    usual = prepared.scene.model
    if not isinstance(usual, KinematicSingleTrack):
        raise ValueError(_MODEL)
    return replace(prepared.scene, model=Stronger(vehicle, usual))


def _wider(bounds: LateralBounds, by: float) -> LateralBounds:
    return LateralBounds(bounds.s, bounds.right - by, bounds.left + by)


def _wider_edge(edge: RoadEdge, by: float) -> RoadEdge:
    """The edge of a road that reaches farther by ``by`` [m] on all sides."""
    boundary = edge.boundary.widened(by)
    return replace(edge, boundary=boundary, corridor=RoadCorridor(boundary, edge.frame, edge.vehicle))


def _laid_out(
    prepared: Prepared,
    scene: Scene,
    config: Config | None = None,
    *,
    reference: Any = None,
    edge: RoadEdge | None = None,
) -> Prepared:
    """The situation with other parts, until the same end."""
    config = config or prepared.config
    config = replace(config, repair=replace(config.repair, horizon=None))  # the end is that of before
    edge = edge or prepared.checker.edge
    like: Checker = copy.copy(prepared.checker)
    if edge is not None:  # the body is the same, whatever drives it
        like.edge = replace(edge, vehicle=scene.vehicle)
    followed = prepared.reference if reference is None else reference
    made = laid_out(scene, config, prepared.given, Phases(), reference=followed, like=like)
    return replace(made, t_end=prepared.t_end)
