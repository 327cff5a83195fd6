"""Small repair problems with answers known by hand, for every backend: no files, a straight road.

Limits, boxes and reference are those of :mod:`tests.toy`: v0 = 10 m/s unless said otherwise, braking
at up to 8 m/s², so that the shortest stop takes 6.25 m and a little more for the jerk.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tests import toy

from repair.arrays import frozen
from repair.curves.base import FrenetTrajectory
from repair.problem.passing import open_passings
from repair.problem.problem import Maneuver, Passing, Side
from repair.reference.profile import SpeedProfile


def guided(problem, maneuver=None):
    """The problem with its first open passing, or the one that is asked for."""
    times = problem.t_rep + toy.DT * np.arange(round((problem.t_end - problem.t_rep) / toy.DT) + 1)
    axis = (problem.curvature_s, problem.curvature)
    found = open_passings(
        problem.reference.sample(times), problem.start, problem.occupancy, problem.bounds, problem.limits,
        problem.margin, problem.lateral, axis,
    )  # fmt: skip
    chosen = [p for p in found if maneuver in (None, p.maneuver)]
    assert chosen, f"no {maneuver} among {[p.maneuver for p in found]}"
    return replace(problem, passing=chosen[0])


def forced(problem, side=Side.BEHIND):
    """The problem with a guide that brakes fully and a side for every obstacle, open or not."""
    times = problem.t_rep + toy.DT * np.arange(round((problem.t_end - problem.t_rep) / toy.DT) + 1)
    tau, v0 = times - problem.t_rep, max(problem.start[1, 0], 0.0)
    brake = np.minimum(tau, v0 / -problem.limits.a_min)
    s = problem.start[0, 0] + v0 * brake + 0.5 * problem.limits.a_min * brake**2
    v = v0 + problem.limits.a_min * brake
    still = np.zeros_like(s)
    columns = [frozen(np.column_stack([x, still])) for x in (s, v, still, still)]
    sides = np.full((len(problem.occupancy), len(times)), side, dtype=np.int8)
    return replace(
        problem, passing=Passing(Maneuver.YIELD, FrenetTrajectory(frozen(times), *columns), sides, 0.0)
    )


def free_road():
    return guided(toy.problem([]))


def static_block():
    """A standing box 30 m ahead on a road too narrow to pass: stop behind it."""
    return guided(toy.problem([toy.box((30.0, 40.0), (-2.0, 2.0))], bounds=toy.NARROW, lateral=False))


def static_block_left():
    """The same box on a wide road: go round it."""
    return guided(toy.problem([toy.box((30.0, 40.0), (-2.0, 2.0))]), Maneuver.LEFT)


def crossing_car():
    """A car from the right that is in the way from t = 1.2 s to 3.3 s."""
    return guided(
        toy.problem([toy.box((22.0, 30.0), (-9.0, -4.0), v=(0.0, 3.0))], lateral=False), Maneuver.YIELD
    )


def closing_gap():
    """Between a slower car in front and a faster one behind; 8 m of the gap are left at the end."""
    boxes = [
        toy.box((25.0, 35.0), (-2.0, 2.0), v=(6.0, 0.0)),
        toy.box((-25.0, -13.0), (-2.0, 2.0), v=(13.0, 0.0)),
    ]
    return guided(toy.problem(boxes, bounds=toy.NARROW, lateral=False, t_end=3.0))


def too_near():
    """A box 5 m ahead, which is less than the stopping distance of 6.25 m: infeasible."""
    boxes = [toy.box((5.0, 15.0), (-2.0, 2.0))]
    return forced(toy.problem(boxes, bounds=toy.NARROW, lateral=False))


def start_at_top_speed():
    """v = v_max exactly, and a box to brake for."""
    limits = replace(toy.LIMITS, v_max=10.0)
    return guided(toy.problem([toy.box((30.0, 40.0), (-2.0, 2.0))], limits=limits, lateral=False))


def start_at_full_braking():
    """a = a_min exactly at t_rep."""
    reference = SpeedProfile.from_accelerations(0.0, 20.0, [1.0, 20.0], [-8.0, 0.0])
    boxes = [toy.box((60.0, 70.0), (-2.0, 2.0))]
    return guided(toy.problem(boxes, reference=reference, t_rep=0.5, t_end=4.5, lateral=False))


def start_above_top_speed():
    """10 m/s where 8 m/s is the limit: infeasible at once."""
    return forced(toy.problem([], limits=replace(toy.LIMITS, v_max=8.0), lateral=False))


def start_inside():
    """The ego starts inside of a box: infeasible at once."""
    return forced(toy.problem([toy.box((-5.0, 5.0), (-2.0, 2.0))], lateral=False))


FEASIBLE = {
    f.__name__: f
    for f in (
        free_road, static_block, static_block_left, crossing_car, closing_gap, start_at_top_speed,
        start_at_full_braking,
    )
}  # fmt: skip
#: name -> (problem, a word that the hard backend's sentence must hold)
INFEASIBLE = {
    "too_near": (too_near, "obstacle 100"),
    "start_above_top_speed": (start_above_top_speed, "start speed"),
    "start_inside": (start_inside, "starts inside obstacle 100"),
}


def clearance(problem, curve, step=1e-3):
    """Smallest distance to a box over [t_rep, t_end] (negative inside), sampled; inf without boxes."""
    t = np.arange(problem.t_rep, problem.t_end + 1e-9, step)
    position = curve.sample(t).position
    lower, upper = problem.occupancy.at(t)
    sides = np.stack([lower - position, position - upper])
    return float(np.nanmin(np.max(sides, axis=(0, 3)), initial=np.inf))
