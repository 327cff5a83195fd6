"""Repair problems made by hand: a straight road, boxes that move at constant speed, no files."""

from __future__ import annotations

import numpy as np

from repair.arrays import frozen
from repair.problem.limits import Limits
from repair.problem.problem import RepairProblem
from repair.reference.profile import SpeedProfile
from repair.scene.road.bounds import LateralBounds
from repair.world.boxes import Occupancy

DT = 0.1
LIMITS = Limits(
    v_max=30.0,
    v_lat=3.0,
    a_min=-8.0,
    a_max=4.0,
    a_lat=4.0,
    a_total=8.0,
    j_lon=60.0,
    j_lat=60.0,
    curvature=0.3,
)
WIDE = LateralBounds(frozen([0.0, 500.0]), frozen([-6.0, -6.0]), frozen([6.0, 6.0]))
NARROW = LateralBounds(frozen([0.0, 500.0]), frozen([-0.5, -0.5]), frozen([0.5, 0.5]))


def box(s, l, v=(0.0, 0.0), present=(0.0, np.inf)):  # noqa: E741
    """A box: intervals along s and l at t = 0, its velocity, and when it is there."""
    return tuple(s), tuple(l), tuple(v), tuple(present)


def occupancy(*boxes, duration=8.0, dt=DT):
    t = np.arange(round(duration / dt) + 1) * dt
    lower = np.full((len(boxes), len(t), 2), np.nan)
    upper = np.full((len(boxes), len(t), 2), np.nan)
    for k, (s, l, v, present) in enumerate(boxes):  # noqa: E741
        there = (t >= present[0] - 1e-9) & (t <= present[1] + 1e-9)
        shift = t[there, None] * np.array(v)
        lower[k, there] = np.array([s[0], l[0]]) + shift
        upper[k, there] = np.array([s[1], l[1]]) + shift
    ids = np.arange(100, 100 + len(boxes))
    static = np.array([b[2] == (0.0, 0.0) for b in boxes], dtype=bool)
    return Occupancy(frozen(t), ids, frozen(lower), frozen(upper), static)


def constant(v0=10.0, s0=0.0, duration=20.0):
    return SpeedProfile.from_accelerations(s0, v0, [duration], [0.0])


def problem(boxes, *, t_rep=0.0, t_end=4.0, v0=10.0, bounds=WIDE, lateral=True, passing=None, **keys):
    """A repair problem on a straight road at constant speed; ``passing`` as it is given."""
    reference = keys.pop("reference", None) or constant(v0)
    at = reference.sample([t_rep])
    return RepairProblem(
        reference=reference,
        t_rep=t_rep,
        t_end=t_end,
        start=frozen([at.position[0], at.velocity[0], at.acceleration[0]]),
        occupancy=boxes if isinstance(boxes, Occupancy) else occupancy(*boxes),
        bounds=bounds,
        limits=keys.pop("limits", LIMITS),
        clearance=keys.pop("clearance", 1.0),
        margin=keys.pop("margin", 0.1),
        passing=passing,
        curvature_s=frozen([0.0, 500.0]),
        curvature=frozen([0.0, 0.0]),
        dt=DT,
        lateral=lateral,
        half_length=2.15,
    )


class Judging:
    """A checker whose word on the traffic alone nobody waits for: ``check`` says it all."""

    def refuses_traffic(self, problem, curve):
        return None

    def blocked(self, problem):
        return None
