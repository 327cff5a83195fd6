"""The certificate's own collision test: contact at any time, whatever the step."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from repair.certify.contact import first_meeting, outlines
from repair.certify.motion import Motion
from repair.certify.traffic import Body


def straight(dt, steps, v=10.0):
    """The ego along x, and its motion."""
    t = np.arange(round(steps * dt / 1e-3) + 1) * 1e-3
    poses = np.stack([v * t, np.zeros_like(t), np.zeros_like(t)], axis=1)
    return Motion(t, poses, np.full_like(t, v), np.zeros_like(t))


@pytest.mark.parametrize("seed", range(12))
def test_contact_is_found_whatever_the_step(seed):
    """Random crossings, turning, with steps up to 0.5 s: the first contact of a look every 0.2 ms."""
    rng = np.random.default_rng(seed)
    dt, steps = float(rng.choice([0.1, 0.5])), 6
    ego, half = straight(dt, steps), (2.2, 0.9)
    place = np.array([rng.uniform(0.0, 10.0 * dt * steps), 0.0])
    speed, angle, turn = rng.uniform(5.0, 35.0), rng.uniform(0.5, 2.6), rng.uniform(-3.0, 3.0)
    at = (np.arange(steps + 1) - rng.uniform(0.0, steps)) * dt
    centres = place + speed * at[:, None] * np.array([np.cos(angle), np.sin(angle)])
    poses = np.column_stack([centres, angle + turn * at])
    box = shapely.box(-rng.uniform(0.1, 3.0), -0.3, 0.1, 0.3)
    radius = float(np.hypot(*shapely.get_coordinates(box).T).max())
    met = first_meeting(ego, half, [Body(7, box, poses, radius)], dt)
    t = np.arange(round(dt * steps / 2e-4)) * 2e-4
    ego_at = np.stack([np.interp(t, ego.t, c) for c in ego.poses.T], axis=1)
    body = np.stack([np.interp(t, np.arange(steps + 1) * dt, c) for c in poses.T], axis=1)
    corners = shapely.get_coordinates(box)[:-1]
    c, s = np.cos(body[:, 2, None]), np.sin(body[:, 2, None])
    x = body[:, :1] + c * corners[:, 0] - s * corners[:, 1]
    y = body[:, 1:2] + s * corners[:, 0] + c * corners[:, 1]
    hit = shapely.intersects(outlines(ego_at, *half), shapely.polygons(np.stack([x, y], axis=-1)))
    if hit.any():
        assert met.time == pytest.approx(t[np.argmax(hit)], abs=2.1e-4)
        assert met.obstacle_id == 7
    else:
        assert met.time == np.inf or met.distance < 0.02


def test_a_thin_box_between_two_samples_is_met():
    """30 m/s and a step of 0.5 s: at no step anywhere near."""
    poses = np.array([[5.0, 22.5 - 15.0 * k, -np.pi / 2] for k in range(5)])
    box = shapely.box(-0.25, -0.25, 0.25, 0.25)
    met = first_meeting(straight(0.5, 4, v=10.0), (2.0, 0.9), [Body(1, box, poses, 0.36)], 0.5)
    assert met.time < np.inf


def test_a_region_holds_from_step_to_step():
    """Stated at step 2 alone, it covers what lies around it, and nothing else."""
    region = shapely.box(0.0, -1.0, 0.5, 1.0)
    held = (None, region, region, None, None)
    met = first_meeting(straight(0.1, 4), (2.0, 0.9), [Body(1, None, np.empty((0, 3)), 0.0, held)], 0.1)
    assert met.time == pytest.approx(0.1, abs=1e-3)


def test_a_margin_that_the_ego_starts_in_counts_once_it_has_left():
    """Beside a box at the start, clear of it, and beside another: the second one counts."""
    near = np.tile([0.0, 1.5, 0.0], (11, 1))
    box = shapely.box(-1.0, -0.5, 1.0, 0.5)
    ego, half = straight(0.1, 10), (2.1, 1.05)
    met = first_meeting(ego, half, [Body(1, box, near, 1.2)], 0.1, beside=True)
    assert met.time == np.inf
    back = near.copy()
    back[6:, 0] = 8.0
    met = first_meeting(ego, half, [Body(1, box, back, 1.2)], 0.1, beside=True)
    assert 0.5 < met.time < 0.7
