"""What a hard backend says of the curve that comes closest holds of that curve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import toy
from tests.contract import problems

from repair.solvers.casadi.backend import CasadiBackend
from repair.solvers.casadi.settings import CasadiConfig


@pytest.mark.parametrize("start", [0.02, 0.05, 0.09, 0.15])
@pytest.mark.parametrize("slower", [3.0, 5.0])
def test_the_miss_is_one_of_the_margin_also_for_who_starts_nearer(start, slower):
    """A slower box right ahead, nearer than the margin at the start: braking comes too late."""
    ahead = toy.box((start, start + 5.0), (-1.0, 1.0), (10.0 - slower, 0.0))
    problem = problems.forced(toy.problem([ahead], lateral=False))
    found = CasadiBackend(CasadiConfig(solver="sqpmethod")).solve(problem)
    assert found.closest is not None
    t = np.arange(0.0, 4.0, 1e-3)
    nearest = (start + (10.0 - slower) * t - found.closest.curve.sample(t).position[:, 0]).min()
    assert nearest >= problem.margin - found.closest.miss - 1e-6
    assert nearest <= problem.margin - found.closest.miss + problem.margin  # and says no more than that


def test_what_is_nearest_to_a_verified_curve_is_looked_for_beside_others():
    boxes = [toy.box((30.0, 40.0), (-1.0, 1.0)), toy.box((10.0, 15.0), (0.45, 2.5))]
    backend = CasadiBackend(CasadiConfig(solver="sqpmethod"))
    problem = problems.forced(toy.problem(boxes, lateral=False))
    nearer = backend.solve(replace(problem, margin=problem.margin - 0.3)).curve
    nearest = backend.solve(problem, warm_start=nearer).closest
    assert nearest.miss == pytest.approx(0.3, abs=0.01)
    assert nearest.curve.points == pytest.approx(nearer.points, abs=0.05)
