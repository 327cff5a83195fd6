"""The corridor, made for all pieces and obstacles at once, against its definition one by one."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from tests.toy import DT, WIDE, box, problem

from repair.arrays import frozen
from repair.baselines.qptr.backend import QptrBackend
from repair.baselines.qptr.corridor import corridor_around
from repair.baselines.qptr.settings import QptrConfig
from repair.baselines.qptr.time_grid import time_grid
from repair.curves.base import FrenetTrajectory
from repair.problem.problem import Maneuver, Passing, Side
from repair.reference.profile import SpeedProfile

AROUND = (-2.0, 0.0, 2.0)


def scene(seed, lateral, t_rep):
    """A guide that brakes or accelerates and may swerve, between boxes that come, go and move."""
    rng = np.random.default_rng(seed)
    boxes = []
    for _ in range(rng.integers(0, 6)):
        s, l = rng.uniform(-15.0, 60.0), rng.uniform(-8.0, 6.0)  # noqa: E741
        first = rng.choice([0.0, rng.uniform(0.0, 4.0)])
        v = rng.choice([0.0, 1.0]) * rng.uniform([-8.0, -4.0], [12.0, 4.0])
        boxes.append(box((s, s + rng.uniform(0.5, 9)), (l, l + rng.uniform(0.5, 4)), v, (first, first + 3.0)))
    base = problem(boxes, t_rep=t_rep, lateral=lateral, bounds=WIDE)
    times = t_rep + DT * np.arange(np.ceil((base.t_end - t_rep) / DT - 1e-6) + 1)
    tau, v0 = times - t_rep, base.start[1, 0]
    rate = rng.uniform(-8.0, 4.0)
    run = np.minimum(tau, -v0 / rate) if rate < 0.0 else tau
    s = base.start[0, 0] + v0 * run + 0.5 * rate * run**2
    sideways = rng.uniform(-3.0, 3.0) * np.clip(tau / 2.0, 0.0, 1.0) ** 2
    still = np.zeros((len(times), 2))
    guide = FrenetTrajectory(times, np.column_stack([s, sideways]), still, still, still)
    sides = np.zeros((len(boxes), len(times)), dtype=np.int8)
    passing = Passing(Maneuver.YIELD, guide, sides, 0.0)
    return problem(boxes, t_rep=t_rep, lateral=lateral, bounds=WIDE, passing=passing)


def plain_sides(rooms):
    """Side of one box at each of a piece's times, from the rooms {side: (L,)}, NaN where it is not there."""
    least = {side: np.nanmin(room) for side, room in rooms.items()}
    best = max(least, key=lambda side: least[side])
    at_once = [max(rooms, key=lambda side: rooms[side][k]) for k in range(len(rooms[best]))]
    return [best] * len(at_once) if least[best] >= -1e-6 else at_once


def plain_line(t, values, guide):
    """Ends of the line below the values that leaves the guide the most room, of all that are candidates."""
    slopes = [(k, (values[m] - values[k]) / (t[m] - t[k])) for k, m in combinations(range(len(t)), 2)]
    slopes += [(k, (guide[-1] - guide[0]) / (t[-1] - t[0])) for k in range(len(t))]
    lines = [values[k] + slope * (t - t[k]) for k, slope in slopes]
    kept = [line for line in lines if np.all(line <= values + 1e-6)]
    best = max(kept, key=lambda line: np.min(line - guide))
    return best[[0, -1]], np.min(best - guide)


def plain_piece(task, begin, end):
    """Walls of one piece: times, guide (s, l), smallest and largest s at each time, the interval of l."""
    steps = task.occupancy.t
    t = np.array([begin, *steps[(steps > begin + 1e-9) & (steps < end - 1e-9)], end])
    path = task.passing.guide
    s, l = (np.interp(t, path.t, path.position[:, k]) for k in (0, 1))  # noqa: E741
    if not task.lateral:
        l = task.reference.sample(t).position[:, 1]  # noqa: E741
    low, high = np.full(len(t), task.start[0, 0] - 1.0), np.full(len(t), 0.0)
    high += task.start[0, 0] + task.limits.v_max * (task.t_end - task.t_rep) + 1.0
    right, left = [-np.inf], [np.inf]
    for lower, upper in zip(*task.occupancy.at(t), strict=True):
        lower, upper = lower - task.margin, upper + task.margin
        there = np.isfinite(lower[:, 0])
        rooms = {Side.BEHIND: lower[:, 0] - s, Side.AHEAD: s - upper[:, 0]}
        if task.lateral:
            rooms |= {Side.LEFT: l - upper[:, 1], Side.RIGHT: lower[:, 1] - l}
        else:
            there &= (lower[:, 1] < l) & (l < upper[:, 1])
        if not there.any():
            continue
        for k, side in enumerate(plain_sides({x: np.where(there, r, np.nan) for x, r in rooms.items()})):
            if there[k]:
                low[k] = max(low[k], upper[k, 0]) if side is Side.AHEAD else low[k]
                high[k] = min(high[k], lower[k, 0]) if side is Side.BEHIND else high[k]
                right += [upper[k, 1]] if side is Side.LEFT else []
                left += [lower[k, 1]] if side is Side.RIGHT else []
    if task.lateral:
        road = [task.bounds.at(s + shift) for shift in AROUND]
        # The start always counts as on the road.
        start = task.start[0, 1] if begin == task.t_rep else np.nan
        right += [np.fmin(max(r.max() for r, _ in road), start)]
        left += [np.fmax(min(x.min() for _, x in road), start)]
    return t, s, low, high, (max(right), min(left))


@pytest.mark.thinned(5)
@pytest.mark.parametrize("lateral", [False, True])
@pytest.mark.parametrize("t_rep", [0.0, 0.33, 1.6])
@pytest.mark.parametrize("seed", range(40))
def test_all_pieces_at_once_are_the_pieces_one_by_one(seed, t_rep, lateral):
    task = scene(seed, lateral, t_rep)
    made = corridor_around(task, time_grid(task, 7))
    for i in range(7):
        t, s, low, high, sideways = plain_piece(task, made.edges[i], made.edges[i + 1])
        upper, room = plain_line(t, high, s)
        lower, behind = plain_line(t, -low, -s)
        np.testing.assert_allclose(made.s[1, i], upper, atol=1e-7)
        np.testing.assert_allclose(made.s[0, i], -lower, atol=1e-7)
        assert room == pytest.approx(np.min(np.interp(t, t[[0, -1]], made.s[1, i]) - s), abs=1e-7)
        assert behind == pytest.approx(np.min(s - np.interp(t, t[[0, -1]], made.s[0, i])), abs=1e-7)
        np.testing.assert_allclose(made.l[:, i], sideways, atol=1e-9)


class Swaying(SpeedProfile):
    """A reference that sways around the path."""

    def sample(self, t):
        on_path = super().sample(t)
        phase = on_path.t[:, None] + np.array([0.0, 0.5, 1.0, 1.5]) * np.pi
        sway = [np.column_stack([np.zeros_like(on_path.t), x]) for x in 0.3 * np.sin(phase).T]
        return FrenetTrajectory(
            on_path.t,
            on_path.position + sway[0],
            on_path.velocity + sway[1],
            on_path.acceleration + sway[2],
            on_path.jerk + sway[3],
        )


def test_who_keeps_a_reference_that_sways_pays_for_its_jerk():
    reference = Swaying(frozen([0.0, 20.0]), frozen([0.0, 200.0]), frozen([10.0, 10.0]), frozen([0.0, 0.0]))
    task = problem([], reference=reference, lateral=False)
    answer = QptrBackend(QptrConfig()).solve(task)
    times = np.linspace(0.0, 4.0, 4001)
    ours, wanted = answer.curve.sample(times), reference.sample(times)
    np.testing.assert_allclose(ours.position, wanted.position, atol=1e-4)
    square = np.sum(ours.jerk**2 + 0.1 * (ours.position - wanted.position) ** 2, axis=1)
    assert answer.objective > 0.1
    assert answer.objective == pytest.approx(0.5 * (square[1:] + square[:-1]) @ np.diff(times), rel=1e-3)
