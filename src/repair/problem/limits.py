"""What the ego may do: the configured limits, or the vehicle's own; and where it may be within them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.problem.settings import LimitsConfig, RepairConfig
from repair.scene.road.bounds import LateralBounds
from repair.vehicle.transitions import POSITION_TOLERANCE
from repair.world.occupancy import Within

if TYPE_CHECKING:
    from repair.scene.scene import Scene
    from repair.vehicle.parameters import Vehicle

__all__ = ["Limits", "part_in_reach", "reference_limits", "resolve_limits", "room_of"]

# What counts as out of reach is farther away along the path, and beside it, than the ego may be by this [m].
_SLACK, _BESIDE = 5.0, 1.0


@dataclass(frozen=True)
class Limits:
    """What the ego may do.

    Attributes
    ----------
    v_max : float
        Largest longitudinal speed [m/s]; the smallest is 0 (no reversing).
    v_lat : float
        Largest lateral speed in the Frenet frame [m/s].
    a_min, a_max : float
        Smallest (negative) and largest longitudinal acceleration [m/s²].
    a_lat : float
        Largest lateral acceleration [m/s²].
    a_total : float
        Radius of the friction circle [m/s²].
    j_lon, j_lat : float
        Largest magnitude of the longitudinal and lateral jerk [m/s³].
    curvature : float
        Largest curvature of the driven path [1/m], from the steering limit.
    """

    v_max: float
    v_lat: float
    a_min: float
    a_max: float
    a_lat: float
    a_total: float
    j_lon: float
    j_lat: float
    curvature: float

    def reserving(self, share: float) -> Limits:
        """The same with a share of every acceleration left unused."""
        rest = 1.0 - share
        return replace(
            self,
            a_min=rest * self.a_min,
            a_max=rest * self.a_max,
            a_lat=rest * self.a_lat,
            a_total=rest * self.a_total,
        )


# Share of the vehicle's friction circle that a repair may use where nothing else is configured:
# the rest is left for what the kinematic model adds to the planned accelerations.
_USABLE = 0.9


def resolve_limits(config: LimitsConfig, vehicle: Vehicle, speed: float, dt: float) -> Limits:
    """Limits with the vehicle's own numbers where the configuration leaves them open.

    Parameters
    ----------
    speed : float
        Initial speed [m/s]; beyond ``v_switch`` the engine limits acceleration (CommonRoad vehicle
        models, eq. 2), and the limit is taken a little above this speed.
    dt : float
        Time step [s]. The drivability checker drives a transition with constant acceleration and
        allows 2 cm of error; a jerk j moves the end by j dt**3 / 12.
    """
    usable = _USABLE * vehicle.a_max
    engine = float(vehicle.engine_acceleration(speed + 3.0, _USABLE))
    drivable = 0.6 * POSITION_TOLERANCE * 12.0 / dt**3
    a_total = usable if config.a_total is None else config.a_total
    return Limits(
        v_max=config.v_max if config.v_max is not None else vehicle.v_max,
        v_lat=config.v_lat,
        a_min=config.a_min if config.a_min is not None else -a_total,
        a_max=config.a_max if config.a_max is not None else engine,
        a_lat=config.a_lat if config.a_lat is not None else a_total,
        a_total=a_total,
        j_lon=min(config.j_lon, drivable),
        j_lat=config.j_lat,
        curvature=vehicle.largest_curvature(0.95),
    )


def reference_limits(usual: Limits, config: LimitsConfig, vehicle: Vehicle, *, accepted: bool) -> Limits:
    """Limits by which a reference is judged: the vehicle's own where the configuration leaves them open.

    A repair leaves a share of the friction circle unused; somebody else's reference need not. Below its
    radius the engine's limit at each speed is judged beside these.

    Parameters
    ----------
    usual : Limits
        Those of repairs.
    config : LimitsConfig
    vehicle : Vehicle
    accepted : bool
        CommonRoad's drivability checker accepts the reference as it was given, which judges accelerations
        itself, at the rear axle or the centre as the model has it. Those left open are then no limits.
    """
    open_ = np.inf if accepted else vehicle.a_max
    total = open_ if config.a_total is None else config.a_total
    return replace(
        usual,
        a_min=config.a_min if config.a_min is not None else -total,
        a_max=config.a_max if config.a_max is not None else open_,
        a_lat=config.a_lat if config.a_lat is not None else total,
        a_total=total,
    )


def room_of(scene: Scene, settings: RepairConfig) -> LateralBounds:
    """Lateral room of the reference point in a scene, as ``repair.lateral`` says."""
    wide = {"lane": scene.lane, "same_direction": scene.same_direction, "road": scene.road}
    return wide.get(settings.lateral, scene.lane)


def part_in_reach(
    scene: Scene, settings: RepairConfig, limits: Limits, positions: Array, until: float = np.inf,
    coordinates: Array | None = None,
) -> Within:  # fmt: skip
    """The part of the road where the ego may be until its reference ends.

    Parameters
    ----------
    positions : (K, 2) array
        The reference at the scenario's steps [m].
    until : float
        Later than this nobody asks where it is [s].
    coordinates : (K, 2) array, optional
        The same in the scene's frame [m], where that is known.
    """
    positions = positions[: int(min(until / scene.dt + 2.0, len(positions)))]
    (s, aside), (speed, _) = scene.start[:2].tolist()
    last_one = slice(len(positions) - 1, len(positions))
    end = scene.frame.to_frenet(positions[last_one]) if coordinates is None else coordinates[last_one]
    # Until the end of each step; the last of them ends where the reference does.
    t = scene.dt * np.minimum(np.arange(1, len(positions) + 1), len(positions) - 1)
    ways = np.minimum(max(speed, 0.0) + 0.5 * limits.a_max * t, max(limits.v_max, speed)) * t
    followed = np.hypot(*(positions - positions[0]).T)
    ways = np.fmax(ways, np.maximum.accumulate(np.append(followed[1:], followed[-1])))
    first, last = s - _SLACK, float(np.fmax(s + ways[-1], end[0, 0])) + _SLACK
    bound = room_of(scene, settings)
    part = slice(*np.searchsorted(bound.s, (first - _SLACK, last + _SLACK)))
    more = settings.margin + settings.clearance + max(settings.widen, default=0.0) + abs(aside) + _BESIDE
    right, left = (float(np.abs(side[part]).max(initial=0.0)) + more for side in (bound.right, bound.left))
    return Within(s, first, last, (right, left), ways + _SLACK)
