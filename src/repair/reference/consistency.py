"""Whether the states of a recording or a solution file can be one drive of the ego, and where not.

The tolerances are what CommonRoad's own checks allow (commonroad-drivability-checker 2025.4,
``feasibility_checker`` and ``solution_checker.starts_at_correct_state``), so that no officially valid
solution is refused: a step is simulated from its first state with a constant input, and has to end within
0.02 m along either axis and 0.03 rad of the next one. The speed at the end of a step is free there, so speeds
may be off by what the strongest constant acceleration makes of a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from repair.arrays import Array, wrap
from repair.errors import ReferenceTrajectoryError
from repair.vehicle.parameters import Vehicle

__all__ = [
    "HEADING_OFF",
    "POSITION_OFF",
    "SPEED_MAX",
    "START_HEADING_OFF",
    "START_OFF",
    "START_SPEED_OFF",
    "Recording",
    "are_of_the_body",
    "require_consistent",
    "require_start",
    "require_turns",
]

POSITION_OFF = 0.03
"""A step may end this far from where its first state leads [m]: 0.02 along either axis."""
HEADING_OFF = 0.03
"""The heading after a step may be off by this [rad]."""
START_OFF = 0.1
"""The first position may be off the ego's by this along either axis [m]."""
START_HEADING_OFF = 0.1
"""The first heading may be off the ego's by this [rad]."""
START_SPEED_OFF = 2.0
"""The first speed may be off the ego's by this [m/s]."""
SPEED_MAX = 150.0
"""Faster than this a recording jumps [m/s]."""
_CRAWLS = 0.1  # a step shorter than this has no direction of its own [m]


@dataclass(frozen=True)
class Recording:
    """What was driven before, from the planning problem's first step on, without a hole.

    Attributes
    ----------
    what : str
        Its name in sentences: the file, or the obstacle.
    first : int
        Time step of the first row.
    positions : (K, 2) array
        Of the centre [m].
    directions, speeds : (K,) array
        Where the point ``rear`` metres behind the centre moves to [rad], and how fast [m/s]; NaN where that
        is not said.
    headings : (K,) array
        Of the body [rad]; NaN where that is not said.
    rear : float
        [m]; 0 for models whose motion is stated at the centre.
    velocities : (K, 2) array or None
        Of the centre [m/s], where the states say it.
    model : str
        The vehicle model whose states these are, as CommonRoad names it; empty where there is none.
    refused : callable or None
        The time [s] since the first row from which on CommonRoad's drivability checker refuses the states as
        they were given, inf if it never does; None where there is nothing to ask it about.
    """

    what: str
    first: int
    positions: Array
    directions: Array
    speeds: Array
    headings: Array
    rear: float = 0.0
    velocities: Array | None = None
    model: str = ""
    refused: Callable[[], float] | None = None

    def until(self, count: int) -> Recording:
        """The first ``count`` rows."""
        velocities = None if self.velocities is None else self.velocities[:count]
        columns = self.positions, self.directions, self.speeds, self.headings
        positions, directions, speeds, headings = (column[:count] for column in columns)
        return replace(
            self, positions=positions, directions=directions, speeds=speeds, headings=headings,
            velocities=velocities,
        )  # fmt: skip


def require_consistent(recording: Recording, dt: float, vehicle: Vehicle | None = None) -> None:
    """Refuse a recording whose speeds or headings contradict its positions.

    Parameters
    ----------
    recording : Recording
    dt : float
        Time step [s].
    vehicle : Vehicle, optional
        Of which the states are; without it only gross jumps are looked for.

    Raises
    ------
    ReferenceTrajectoryError
        The sentence names the first time step, what is wrong there, and by how much.
    """
    for name, column in (
        ("position", recording.positions),
        ("heading", recording.headings),
        ("speed", recording.speeds),
    ):
        wrong = np.isinf(column) if name != "position" else ~np.isfinite(column)
        if wrong.any():
            step = int(np.argmax(wrong.reshape(len(column), -1).any(axis=1)))
            _refuse(recording, step, f"the {name} is not finite")
    if len(recording.positions) < 2:
        return
    moved = np.hypot(*np.diff(recording.positions, axis=0).T)
    _first(recording, moved - SPEED_MAX * dt, lambda k: f"it jumps by {moved[k]:.3g} m within a time step", 1)
    if vehicle is None:
        return
    if np.isnan(recording.headings).all():
        _velocities(recording, dt)
        return
    if recording.rear:
        _turns(recording, dt, vehicle)
    _directions(recording, dt, vehicle)
    _speeds(recording, dt, vehicle.a_max)


def are_of_the_body(recording: Recording) -> bool:
    """Whether headings (K,) are rather those of the body than directions of the centre's path.

    The rear axle follows the one, the centre the other; where neither turns both hold.
    """
    if not np.isfinite(recording.headings).all():
        return False
    ways = (_along_and_across(way)[1] for way in (recording, replace(recording, rear=0.0)))
    body, centre = (float(np.abs(across).sum()) for across in ways)
    return body <= centre


def require_start(recording: Recording, x: float, y: float, heading: float, speed: float) -> None:
    """Refuse a recording that does not start with the ego.

    Parameters
    ----------
    x, y, heading, speed : float
        The ego's initial state [m, rad, m/s].

    Raises
    ------
    ReferenceTrajectoryError
        The sentence says by how much it is off.
    """
    apart = recording.positions[0] - (x, y)
    if not np.abs(apart).max() <= START_OFF:
        off = float(np.hypot(*apart))
        raise ReferenceTrajectoryError(
            f"{recording.what} starts {off:.4g} m from the ego's initial position (time step "
            f"{recording.first}; at most {START_OFF:g} m along either axis)"
        )
    turned = abs(wrap(recording.headings[0] - heading))
    if turned > START_HEADING_OFF:
        raise ReferenceTrajectoryError(
            f"{recording.what} starts {turned:.3g} rad off the ego's initial heading (time step "
            f"{recording.first}; at most {START_HEADING_OFF:g} rad)"
        )
    faster = recording.speeds[0] - speed
    if abs(faster) > START_SPEED_OFF:
        raise ReferenceTrajectoryError(
            f"{recording.what} starts with {recording.speeds[0]:.4g} m/s, the ego with {speed:.4g} m/s "
            f"(time step {recording.first}; at most {START_SPEED_OFF:g} m/s apart)"
        )


def _refuse(recording: Recording, step: int, sentence: str) -> None:
    raise ReferenceTrajectoryError(f"{recording.what}: at time step {recording.first + step} {sentence}")


def _first(recording: Recording, excess: Array, says: Callable[[int], str], shift: int = 0) -> None:
    """Refuse at the first row where ``excess`` is positive; NaN is not."""
    wrong = np.greater(excess, 0.0)
    if wrong.any():
        k = int(np.argmax(wrong))
        _refuse(recording, k + shift, says(k))


def _displacements(recording: Recording) -> Array:
    """How far the point behind the centre moves from step to step (K - 1, 2) [m]."""
    points = recording.positions
    if recording.rear:
        headings = np.nan_to_num(recording.headings)
        points = points - recording.rear * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    return np.asarray(np.diff(points, axis=0))


def _velocities(recording: Recording, dt: float) -> None:
    """A point mass accelerates constantly: a step goes as far as the mean of its ends' velocities."""
    directions = np.nan_to_num(recording.directions)
    velocity = recording.speeds[:, None] * np.stack([np.cos(directions), np.sin(directions)], axis=1)
    off = np.diff(recording.positions, axis=0) - 0.5 * dt * (velocity[1:] + velocity[:-1])
    missed, allowed = np.hypot(*off.T), POSITION_OFF + 0.5 * dt * POSITION_OFF  # the checker takes m for m/s
    _first(
        recording,
        missed - allowed,
        lambda k: (
            f"the velocity leads {missed[k]:.3g} m off the next position (at most {allowed:.2g} m): "
            "speed or heading contradict the positions"
        ),
    )


def _turns(recording: Recording, dt: float, vehicle: Vehicle) -> None:
    """How far the body turns in a step, against what steering and friction allow."""
    moved = np.hypot(*np.diff(recording.positions, axis=0).T)
    most = _most_turned(recording.positions, np.abs(recording.speeds[:-1]), dt, vehicle)
    _require_turned(recording, moved, most)


def _most_turned(positions: Array, speed: Array, dt: float, vehicle: Vehicle) -> Array:
    """How far a heading may change in each step (K - 1,) [rad]."""
    moved = np.hypot(*np.diff(positions, axis=0).T)
    steered = 2.0 * (speed + vehicle.a_max * dt) * vehicle.steering_rate_max / vehicle.wheelbase * dt**2
    most = np.minimum(
        vehicle.largest_curvature() * (moved + POSITION_OFF),
        vehicle.a_max * dt / np.maximum(speed, 1e-6) + steered,  # friction counts at the start of a step
    )
    return np.asarray(most + HEADING_OFF)


def _require_turned(recording: Recording, moved: Array, most: Array) -> None:
    turned = np.abs(wrap(np.diff(recording.headings)))
    _first(
        recording,
        turned - most,
        lambda k: (
            f"the heading has changed by {turned[k]:.3g} rad within {moved[k]:.3g} m "
            f"(at most {most[k]:.2g} rad)"
        ),
        1,
    )


def require_turns(recording: Recording, dt: float, vehicle: Vehicle) -> None:
    """Refuse headings, as directions of the centre's path, that turn faster than the vehicle can be driven.

    While it crawls they are not looked at: a direction that is taken from positions says nothing then.

    Parameters
    ----------
    recording : Recording
    dt : float
        Time step [s].
    vehicle : Vehicle

    Raises
    ------
    ReferenceTrajectoryError
        The sentence names the first time step.
    """
    moved = np.hypot(*np.diff(recording.positions, axis=0).T)
    # The direction of the centre is off the body's by a slip angle, which changes as fast as the steering.
    most = _most_turned(recording.positions, moved / dt, dt, vehicle) + 2.0 * vehicle.steering_rate_max * dt
    _require_turned(recording, moved, np.where(moved < _CRAWLS, np.inf, most))


def _along_and_across(recording: Recording) -> tuple[Array, Array]:
    """How far each step leads along the mean of its ends' directions, and to the left of it (K - 1,) [m]."""
    displacement = _displacements(recording)
    middle = recording.directions[:-1] + 0.5 * wrap(np.diff(recording.directions))
    cos, sin = np.cos(middle), np.sin(middle)
    x, y = displacement.T
    return cos * x + sin * y, cos * y - sin * x


def _speeds(recording: Recording, dt: float, a_max: float) -> None:
    """How far a step goes along its heading, against the speed at its start."""
    along, _ = _along_and_across(recording)
    turn = np.abs(wrap(np.diff(recording.directions)))
    stated = recording.speeds[:-1]
    # A chord is shorter than its arc by a share of turn² / 24.
    allowed = 0.5 * a_max * dt + POSITION_OFF / dt + np.abs(stated) * (turn**2 / 20.0 + 0.5 * HEADING_OFF**2)
    _first(
        recording,
        np.abs(stated - along / dt) - allowed,
        lambda k: (
            f"the speed is {stated[k]:.4g} m/s, but the positions move at {along[k] / dt:.4g} m/s along the "
            f"heading to the next step (at most {allowed[k]:.2g} m/s apart)"
        ),
    )


def _directions(recording: Recording, dt: float, vehicle: Vehicle) -> None:
    """Where a step leads, against the directions of motion at both its ends."""
    along, across = _along_and_across(recording)
    length = np.hypot(along, across)
    # The chord of a step in which the curvature changes is off the mean direction, by length² / 12 times the
    # change. Friction and the steering rate bound that; models with tyres drift besides.
    friction = vehicle.a_max * dt**2 / (6.0 if recording.rear else 2.0)
    steered = length**2 / 6.0 * vehicle.steering_rate_max / vehicle.wheelbase * dt
    allowed = POSITION_OFF + HEADING_OFF * length + np.maximum(friction, steered)
    _first(
        recording,
        np.abs(across) - allowed,
        lambda k: (
            f"the heading is off the direction of motion by {np.arctan2(abs(across[k]), abs(along[k])):.3g} "
            f"rad: the next position lies {abs(across[k]):.3g} m beside it (at most {allowed[k]:.2g} m)"
        ),
    )
