"""What a curve does about a conflict, and how it may begin: of who was given no way past the obstacles."""

from __future__ import annotations

import math

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.base import Curve
from repair.problem.limits import Limits
from repair.problem.problem import Maneuver, RepairProblem

__all__ = ["begun", "taken"]

_ASIDE = 0.3  # from this offset on a curve passes at a side [m]
_WITHIN = 0.999  # of the limits, for rounding


def taken(problem: RepairProblem, curve: Curve) -> Maneuver:
    """Left or right where the curve leaves the reference's path; else by who is farther at the end."""
    times = np.linspace(problem.t_rep, problem.t_end, 60)
    ahead, aside = (curve.sample(times).position - problem.reference.sample(times).position).T
    farthest = float(aside[np.abs(aside).argmax()])
    if abs(farthest) > _ASIDE:
        return Maneuver.LEFT if farthest > 0.0 else Maneuver.RIGHT
    return Maneuver.GO_AHEAD if float(ahead[-1]) > 0.0 else Maneuver.YIELD


def begun(start: Array, wanted: Array, kappa: float, limits: Limits, lateral: bool) -> Array:
    """A start state (3, 2) with the acceleration of a curve that begins there, as far as the limits allow.

    Parameters
    ----------
    start : (3, 2) array
        Position, velocity and acceleration ``[s, l]`` of the reference.
    wanted : (2,) array
        The curve's acceleration.
    kappa : float
        Curvature of the axis there [1/m].
    limits : Limits
    lateral : bool
        Whether the curve may leave the reference's path.
    """
    total, bend = _WITHIN * limits.a_total, kappa * float(start[1, 0]) ** 2
    along = min(max(float(wanted[0]), _WITHIN * limits.a_min), _WITHIN * limits.a_max)
    along = math.copysign(min(abs(along), math.sqrt(max(total**2 - bend**2, 0.0))), along)
    aside = float(start[2, 1])
    if lateral:
        most = min(math.sqrt(max(total**2 - along**2, 0.0)), _WITHIN * limits.a_lat)
        aside = min(max(float(wanted[1]) + bend, -most), most) - bend
    return frozen([start[0], start[1], (along, aside)])
