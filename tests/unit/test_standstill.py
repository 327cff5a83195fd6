"""Repairs that begin in a standstill: the body stands as it came to rest, whatever is done next."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests import roads

from repair.config import load_config
from repair.curves.base import FrenetTrajectory
from repair.preparation import prepare
from repair.scene.commonroad import load_scene

V0, BRAKES, RESTS = 8.0, 4.0, 28.0  # from s = 20 m at 8 m/s with 4 m/s²: 2 s, 8 m
T_REP = 3.5


@dataclass(frozen=True)
class Way:
    """A motion with constant acceleration along l(s) = slope x + bend x²/2, x from s0 on; never backwards."""

    t_start: float
    s0: float
    v0: float
    a: float
    slope: float = 0.0
    bend: float = 0.0
    t_end: float = 20.0

    def sample(self, t):
        t = np.atleast_1d(np.asarray(t, dtype=float))
        tau = np.maximum(t - self.t_start, 0.0)
        if self.a < 0.0:
            tau = np.minimum(tau, self.v0 / -self.a)
        x, v = self.v0 * tau + 0.5 * self.a * tau**2, self.v0 + self.a * tau
        a = np.full(len(t), self.a) * (v > 1e-9)
        slope = self.slope + self.bend * x
        return FrenetTrajectory(
            t,
            np.stack([self.s0 + x, self.slope * x + 0.5 * self.bend * x**2], axis=1),
            np.stack([v, slope * v], axis=1),
            np.stack([a, slope * a + self.bend * v**2], axis=1),
            np.zeros((len(t), 2)),
        )


@dataclass(frozen=True)
class Shifted:
    """A motion that begins aside."""

    way: Way
    l0: float

    t_start = property(lambda self: self.way.t_start)
    t_end = property(lambda self: self.way.t_end)

    def sample(self, t):
        found = self.way.sample(t)
        return replace(found, position=found.position + np.array([0.0, self.l0]))


def judge(tmp_path, obstacles, reference, curve):
    lanes = [
        roads.lanelet(1, range(0, 401, 20), [0.0] * 21, more='<adjacentLeft ref="2" drivingDir="same"/>'),
        roads.lanelet(2, range(0, 401, 20), [3.5] * 21, more='<adjacentRight ref="1" drivingDir="same"/>'),
    ]
    start = roads.problem(100, roads.state(20.0, 0.0, v=V0))
    file = tmp_path / "scenario.xml"
    file.write_text(
        roads.scenario(road="".join(lanes), obstacles=obstacles, problems=start), encoding="utf-8"
    )
    config = load_config(overrides=["reference.source=constant", "repair.horizon=5.5"])
    made = prepare(load_scene(file, config), config)
    problem = replace(made.source, reference=reference, t_end=5.5).plain(T_REP)
    return made.checker.check(problem, curve)


FAR = roads.driving(30, 60.0, 0.0, 0.0, range(1, 81))
STOPS = Way(0.0, 20.0, V0, -BRAKES)


@pytest.mark.parametrize("slope, drivable", [(0.0, True), (2.5, False)])
def test_nobody_moves_off_sideways(tmp_path, slope, drivable):
    """The centre of a body at rest may leave aside as far as the front wheels turn, and no farther."""
    off = Way(T_REP, RESTS, 0.0, 0.8, slope)
    assert judge(tmp_path, FAR, STOPS, off).ok is drivable


def test_who_stopped_turned_stands_turned(tmp_path):
    """A car comes past, clear of a body along the lane, and not of one that is turned to it."""
    bend = 0.3 / (RESTS - 20.0)
    turned = Way(0.0, 20.0, V0, -BRAKES, 0.0, bend)
    aside = float(turned.sample([5.0]).position[0, 1])
    stands = Shifted(Way(T_REP, RESTS, 0.0, 0.0, 0.0), aside)
    straight = Shifted(STOPS, aside)
    for over, reference, met in ((0.35, straight, False), (0.35, turned, True), (1.2, turned, False)):
        y = aside + 0.8 + over + 0.9
        past = roads.driving(31, -15.0, y, 10.0, range(1, 81))
        verdict = judge(tmp_path, FAR + past, reference, stands)
        assert ("collision" in verdict.reasons or "margin" in verdict.reasons) is met, (over, verdict)
