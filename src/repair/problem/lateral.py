"""Lateral motions past the first obstacle in conflict, and the path that is kept where there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from repair.arrays import Array
from repair.curves.base import Curve, FrenetTrajectory
from repair.problem.limits import Limits
from repair.problem.problem import Maneuver, RepairProblem
from repair.problem.surroundings import Surroundings
from repair.scene.road.bounds import LateralBounds

__all__ = [
    "LastPath",
    "LateralProfile",
    "Path",
    "aside_at",
    "kept_path",
    "lateral_profiles",
    "path_of",
    "quintics",
]

_FINE = 0.02  # between the places of the reference that a kept path goes through [s]


class LateralProfile(NamedTuple):
    """One lateral motion l(t).

    Attributes
    ----------
    maneuver : Maneuver or None
        None: it keeps the path; yielding or going ahead is then decided by the speed.
    l, rate, acceleration : (K,) array
        Offset and derivatives [m], [m/s], [m/s²]; 0.0 stands for an acceleration of 0 throughout.
    cost : float
        What it adds to that of the speed; smaller is gentler.
    """

    maneuver: Maneuver | None
    l: Array  # noqa: E741
    rate: Array
    acceleration: Array | float
    cost: float


# Coefficients of x^3, x^4, x^5 by what is left of the way, the speed and the acceleration at x = 1.
_QUINTIC = np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]])


def quintics(start: Array, target: Array, duration: Array, tau: Array) -> tuple[Array, Array, Array]:
    """Quintics from (l, l', l'') to (target, 0, 0), constant from there on.

    Parameters
    ----------
    start : (3,) array
        Offset, rate and acceleration at the time 0.
    target, duration : (Q,) array
        Where they end [m], and when [s].
    tau : (K,) array
        Times to look at [s].

    Returns
    -------
    l, rate, acceleration : (Q, K) array
    """
    l0, v0, a0 = start.tolist()
    d = np.maximum(duration, 1e-3)
    speed, bend = v0 * d, a0 * d**2
    rest = np.array([target - l0 - speed - 0.5 * bend, -speed - bend, -bend])
    c3, c4, c5 = (_QUINTIC @ rest)[..., None]
    d = d[:, None]
    u = np.minimum(tau, d)
    x = u / d
    square = x * x
    position = l0 + (v0 + 0.5 * a0 * u) * u + ((c5 * x + c4) * x + c3) * (square * x)
    rate = v0 + a0 * u + ((5.0 * c5 * x + 4.0 * c4) * x + 3.0 * c3) * square / d
    acceleration = a0 + ((20.0 * c5 * x + 12.0 * c4) * x + 6.0 * c3) * x / d**2
    moving = tau <= d
    return position, rate * moving, acceleration * moving


def lateral_profiles(
    start: Array,
    tau: Array,
    reference: FrenetTrajectory,
    boxes: Surroundings,
    limits: Limits,
    bounds: LateralBounds,
    margin: float,
    lateral: bool,
) -> list[LateralProfile]:
    """To keep the path, and motions past the first obstacle in conflict: to either side, fast and slow.

    Parameters
    ----------
    start : (3, 2) array
        State at t_rep.
    tau : (K,) array
        Times since t_rep [s].
    reference : FrenetTrajectory
        From t_rep on, at these times.
    boxes : Surroundings
        The obstacles at these times.
    limits : Limits
    bounds : LateralBounds
        A side without room is left out.
    margin : float
        Distance to the boxes that the motions end at [m].
    lateral : bool
        Whether moving sideways is allowed; if not, the path is kept.
    """
    keep = LateralProfile(None, reference.position[:, 1], reference.velocity[:, 1], 0.0, 0.0)
    profiles = [keep]
    if not lateral or boxes.conflict is None:
        return profiles
    lower, upper, (k, j) = boxes.lower, boxes.upper, boxes.conflict
    s = reference.position[:, 0]
    room = 5.0 + 0.5 * max(float(start[1, 0]), 0.0)
    beside = (lower[j, :, 0] - room < s) & (s < upper[j, :, 0] + room)
    if not beside.any():
        return profiles
    right, left = bounds.at(s[beside])
    targets = (
        (Maneuver.LEFT, float(np.fmax.reduce(upper[j, beside, 1])) + margin),
        (Maneuver.RIGHT, float(np.fmin.reduce(lower[j, beside, 1])) - margin),
    )
    rightmost, leftmost = float(right.max()) - 1e-6, float(left.min()) + 1e-6
    available = float(tau[k])
    moves = []
    for maneuver, target in targets:
        if not rightmost <= target <= leftmost:
            continue
        shift = abs(target - float(start[0, 1]))
        # Peak acceleration of a quintic lane change is 10/sqrt(3) shift / T**2.
        shortest = max(math.sqrt(5.8 * shift / (0.9 * limits.a_lat)), 1.9 * shift / limits.v_lat, 0.3)
        longer = max(shortest, min(available, 4.0)), max(shortest, min(1.5 * available, 5.0))
        moves += [(maneuver, target, duration) for duration in sorted({shortest, *longer})]
    if not moves:
        return profiles
    kinds, ends, durations = zip(*moves, strict=True)
    l, rate, acceleration = quintics(start[:, 1], np.array(ends), np.array(durations), tau)  # noqa: E741
    cost = np.add.reduce(acceleration**2, axis=1) / len(tau) + 0.1
    return profiles + [
        LateralProfile(*one) for one in zip(kinds, l, rate, acceleration, cost.tolist(), strict=True)
    ]


class Path(NamedTuple):
    """The path of a reference: where it is aside of the frame's axis.

    Attributes
    ----------
    s, l : (K,) array
        Places along the axis, ascending, and how far aside it is there [m].
    """

    s: Array
    l: Array  # noqa: E741


def path_of(reference: Curve, since: float) -> Path | None:
    """The path of a reference from a time [s] on; None where it is the axis itself."""
    if getattr(reference, "along_axis", False):  # it says so itself
        return None
    count = max(int((reference.t_end - since) / _FINE), 2)
    path = reference.sample(since + _FINE * np.arange(count + 1)).position
    if not np.count_nonzero(path[:, 1]):
        return None
    return Path(np.maximum.accumulate(path[:, 0]), path[:, 1])


class LastPath:
    """:func:`path_of`, which keeps its last answer: a search asks for the same one again and again."""

    def __init__(self) -> None:
        self._known: tuple[Curve, float, Path | None] | None = None

    def __call__(self, reference: Curve, since: float) -> Path | None:
        """As :func:`path_of`."""
        known = self._known  # read once: another thread may put its own there
        if known is None or known[0] is not reference or known[1] != since:
            known = self._known = reference, since, path_of(reference, since)
        return known[2]


def aside_at(
    problem: RepairProblem,
    s: Array,
    before: float = 0.0,
    path_of: Callable[[Curve, float], Path | None] = path_of,
) -> Array | None:
    """Where the reference's path is aside of the frame's axis at ``s`` (K,) [m]; None where it never is.

    Who keeps the path and drives it more slowly is aside by what the reference is at that place, not at that
    time: else it would slide sideways where it stands.

    Parameters
    ----------
    before : float
        From so long before t_rep on the reference is looked at [s].
    path_of : callable
        :func:`path_of`, or a :class:`LastPath`.
    """
    path = path_of(problem.reference, problem.t_rep - before)
    return None if path is None else np.asarray(np.interp(s, path.s, path.l))


def kept_path(
    problem: RepairProblem,
    points: Array,
    degree: int,
    spacing: float,
    path_of: Callable[[Curve, float], Path | None] = path_of,
) -> Array:
    """The control points of a uniform B-spline with l where the reference's path is, see :func:`aside_at`.

    Those of l are a quasi-interpolant of l(s(t)) (de Boor, *A Practical Guide to Splines*, ch. XII), which is
    local, so that l rests where s does.

    Parameters
    ----------
    problem : RepairProblem
    points : (n, 2) array
        ``[s, l]`` [m]; the first ``degree`` rows are the state at t_rep and stay as they are.
    degree : int
    spacing : float
        Of the knots [s].
    path_of : callable
        As in :func:`aside_at`.
    """
    path = path_of(problem.reference, problem.t_rep - degree * spacing)
    if path is None:
        return points
    share = (degree + 1) / 24.0
    s = points[:, 0].copy()
    step = s[1:] - s[:-1]
    s[1:-1] += share * (step[1:] - step[:-1])  # where the curve is when each point acts
    aside = np.interp(s, path.s, path.l)
    rise = np.empty(len(aside))
    rise[:-1] = aside[1:] - aside[:-1]
    rise[-1] = (2.0 * aside[-1] - aside[-2]) - aside[-1]  # it goes on as it ends
    found = points.copy()
    found[degree:, 1] = aside[degree:] - share * (rise[degree:] - rise[degree - 1 : -1])
    return found
