"""What is said of a contact: when, with whom, from where, and how fast that is."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["Contact", "told"]


class Contact(NamedTuple):
    """First contact: time [s], the obstacle, whether it strikes from behind, and its velocity (x, y) [m/s].

    The velocity is that of its centre within the scenario's step; zero for who has none, as some sets.
    """

    time: float
    obstacle_id: int
    from_behind: bool
    velocity: tuple[float, float] = (0.0, 0.0)


def told(
    time: float, obstacle: Obstacle, dt: float, pose: tuple[complex, float], velocity: complex, half: float
) -> Contact:
    """A contact with an obstacle.

    Parameters
    ----------
    time : float
        [s].
    obstacle : Obstacle
    dt : float
        The scenario's time step [s].
    pose : (complex, float)
        The ego's centre [m] and orientation [rad].
    velocity : complex
        The ego's [m/s].
    half : float
        Half of the ego's length [m].
    """
    centre, other = _motion(obstacle, dt, time)
    back = cmath.rect(1.0, -pose[1])
    behind = ((centre - pose[0]) * back).real < -0.5 * half and ((other - velocity) * back).real > 0.0
    vx, vy = (0.0 if math.isnan(v) else v for v in (other.real, other.imag))
    return Contact(time, obstacle.id, behind, (vx, vy))


def _motion(obstacle: Obstacle, dt: float, time: float) -> tuple[complex, complex]:
    """Centre [m] and velocity [m/s] of an obstacle at a time."""
    states = obstacle.states
    place = min(time / dt, len(states) - 1)
    low = int(place + 1e-9)
    weight = place - low
    centre = complex(*states[low, :2].tolist())
    if not weight < 1e-9:
        centre = (1 - weight) * centre + weight * complex(*states[low + 1, :2].tolist())
    if len(states) < 2:
        return centre, 0j
    first = min(low, len(states) - 2)
    here, there = (complex(*states[k, :2].tolist()) for k in (first, first + 1))
    velocity = (there - here) / dt
    if not cmath.isfinite(velocity):
        heading, speed = states[low, 2:4].tolist()
        velocity = speed * complex(math.cos(heading), math.sin(heading))
    return centre, velocity
