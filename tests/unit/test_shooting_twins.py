"""Direct shooting: what is quick while it searches says what the plain way says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests import toy
from tests.unit.test_shooting import STEPS, VEHICLE, among, bend, car_of, standing

from repair.scene.frame import FrenetFrame
from repair.solvers.shooting.motion import Driven, direction, drive_freely
from repair.solvers.shooting.plans import FREE
from repair.solvers.shooting.shots import far
from repair.solvers.shooting.space import Space, depths, looks
from repair.world.tracks import as_complex

START = np.array([2.0, 0.3, 11.0, 0.02, 0.01])


@pytest.fixture(scope="module")
def problem():
    boxes = [standing(30.0, 1.0, 0.4), standing(45.0, 8.0, 1.0, 3.0), standing(20.0, -4.0, 0.0)]
    return among(toy.problem([], v0=11.0), bend(), *boxes)


@pytest.fixture(scope="module")
def rows():
    return FREE.kept(np.random.default_rng(3).normal(0.0, 0.6, (60, FREE.size)))


def controls(rows):
    return FREE.accelerations(rows, STEPS, 0.0, -8.0, 4.0), FREE.steering(rows, STEPS), FREE.tail(rows, STEPS)


def test_the_cheaper_rule_drives_as_runge_and_kutta_do(problem, rows):
    plain = replace(car_of(problem), curvature=problem.curvature_at, parts=4)
    exact, quick = (drive_freely(replace(plain, parts=parts), START, *controls(rows)) for parts in (4, 0))
    kept = (np.abs(exact.l).max(axis=1) < 8.0) & (np.abs(exact.chi).max(axis=1) < 1.2)
    assert kept.sum() > 40
    off = [np.abs(a - b)[kept].max(axis=1) for a, b in zip(exact, quick, strict=True)]
    assert max(values.max() for values in off[:5]) < 0.02
    assert max(np.median(values) for values in off[:5]) < 1e-3


def test_the_rates_are_those_of_the_places(problem, rows):
    driven = drive_freely(car_of(problem), START, *controls(rows))
    kappa = problem.shapes.frame.curvature(driven.s)
    np.testing.assert_allclose(driven.along, driven.v * np.cos(driven.chi) / (1.0 - kappa * driven.l))
    np.testing.assert_allclose(driven.aside, driven.v * np.sin(driven.chi), atol=1e-12)


def test_only_who_is_near_is_compared_and_nothing_is_missed(problem, rows):
    problem = replace(problem, lateral=False)
    driven = drive_freely(car_of(problem), START, *controls(rows))
    driven = driven.take(np.flatnonzero(np.abs(driven.chi).max(axis=1) < 1.2))
    space, shapes = Space(problem, STEPS, 2), problem.shapes
    s, l, chi, beta = looks(driven, STEPS.dt, 2)  # noqa: E741
    plane = shapes.frame.to_cartesian(s, l)
    centre, heading = as_complex(plane[..., 0], plane[..., 1]), shapes.frame.heading(s) + chi - beta
    times = problem.t_rep + 0.5 * STEPS.dt * np.arange(1, s.shape[1] + 1)
    room = np.full(len(times), shapes.room + 1e-3)
    all_pairs = np.array([depths(centre, heading, row, shapes, room) for row in shapes.at(times)])
    total, most = space.excess(driven)
    assert (most > 0.5).any()
    assert (most == 0.0).any()
    np.testing.assert_allclose(total, all_pairs.sum(axis=(0, 2)) / 2, atol=1e-9)
    np.testing.assert_allclose(most, all_pairs.max(axis=(0, 2)), atol=1e-9)


def test_corners_that_come_near_along_the_diagonal_are_seen():
    """The margin is kept on every side, so that corners reach farther than sides do."""
    frame = FrenetFrame.from_points(np.column_stack((np.linspace(0.0, 100.0, 201), np.zeros(201))))
    away = 0.1 - 0.01 + np.array((VEHICLE.half_length + 2.0, VEHICLE.half_width + 1.0))
    problem = among(toy.problem((), lateral=False), frame, standing(*(np.array((20.0, 0.0)) + away), 0.0))
    still = np.zeros((1, 5))
    driven = Driven(still + 20.0, *(still for _ in range(4)), still[:, 1:], still[:, 1:], still, still)
    assert Space(problem, STEPS, 2).excess(driven)[1] == pytest.approx(0.01 + 1e-3, abs=1e-6)


def test_directions_are_cosines_and_sines():
    angles = np.linspace(-3.1, 3.1, 201)
    np.testing.assert_allclose(direction(angles), (np.cos(angles), np.sin(angles)), atol=1e-14)


def test_who_is_too_far_even_at_a_faster_pace_gives_up():
    def places(*values):
        return [np.array((value, value)) for value in values]

    assert not far(places(9.0, 9.0, 9.0), 10)  # too few to tell
    assert far(places(9.0, 9.0, 9.0, 9.0), 10)
    assert far(places(9.3, 9.2, 9.1, 9.0), 10)
    assert not far(places(9.3, 9.2, 9.1, 1.0), 10)
    assert not far([np.array((1.0, 9.0)), *places(1.0, 1.0, 1.0)], 1)  # one of both will do
