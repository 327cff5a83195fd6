"""Motions by direct shooting, to hold a bound against: cross-entropy over piecewise constant accelerations.

What is searched for is a motion that meets nothing; who finds one at or after a bound has shown it wrong. The
accelerations, the integration and the final test (the checker's world, in continuous time) share nothing with
the proof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from repair.bounds.edges import no_road
from repair.bounds.obstacles import occupied, with_standing

_STEP = 0.005  # of the integration [s]
_SHARE = 0.999  # of the largest acceleration that is used
_ELITE = 0.1


@dataclass(frozen=True)
class Shot:
    """The best motion: whether it meets nothing, how deep it was in something, and how many were tried."""

    free: bool
    depth: float
    tried: int


class Shooting:
    """Motions of a situation's vehicle after the reference, over the time that a bound looks at."""

    def __init__(self, prepared, kind: str, t_end: float) -> None:
        self.prepared, self.kind = prepared, kind
        self.scene, self.checker = prepared.scene, prepared.checker
        self.vehicle, self.limits = self.scene.vehicle, prepared.limits
        self.substeps = self.checker.config.substeps
        self.h = self.scene.dt / self.substeps
        self.states = self.checker.drive(prepared.reference, prepared.t_reference)
        count = self.scene.n_steps * self.substeps + 1
        self.shapes = occupied(self.scene.obstacles, count, self.substeps)
        if self.checker.road is not None:  # only to see how far a motion is over the edge
            k = min(round(prepared.conflict.time / self.h), len(self.states) - 1)
            centre = np.array([self.states.x[k], self.states.y[k]])
            self.shapes = with_standing(self.shapes, no_road(self.checker.road.region, (), centre, 40.0, 0.0))
        self.stop = min(round(t_end / self.h), count - 1)
        start = self.scene.initial_state
        self.margin = self.checker.config.clearance if kind == "search" else 0.0
        place = complex(start.x, start.y)
        self.beside = self.checker.world.met_at(0, place, start.orientation, self.margin)

    def drive(self, k: int, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Poses x, y, psi of the body's middle (N, T, 3) at samples from ``k`` on, for accelerations (N, T).

        They are along and across the velocity of the rear axle (``vehicle``) or of the middle (``search``).
        """
        v, s = self.vehicle, self.states
        count, steps = along.shape
        inner = max(1, math.ceil(self.h / _STEP))
        dt = self.h / inner
        psi = np.full(count, float(s.orientation[k]))
        x, y = np.full(count, float(s.x[k])), np.full(count, float(s.y[k]))
        axle = float(s.speed[k])
        rate = axle * math.tan(float(s.steering[k])) / v.wheelbase
        poses = np.empty((count, steps + 1, 3))
        poses[:, 0] = np.stack((x, y, psi), axis=1)
        if self.kind == "vehicle":
            x, y, speed = x - v.rear * np.cos(psi), y - v.rear * np.sin(psi), np.full(count, axle)
            most = math.tan(v.steering_max) / v.wheelbase
        else:
            speed, theta = (
                np.full(count, math.hypot(axle, v.rear * rate)),
                psi + math.atan2(v.rear * rate, axle),
            )
            most = v.largest_curvature()
        for i in range(steps):
            for _ in range(inner):
                push, pull = along[:, i], across[:, i]
                if self.kind == "vehicle":
                    turn = np.clip(pull / np.maximum(speed, 0.1), -most * speed, most * speed)
                    push = np.minimum(push, v.a_max * v.v_switch / np.maximum(speed, v.v_switch))
                    new = np.maximum(speed + push * dt, 0.0)
                    way, course = 0.5 * (speed + new) * dt, psi + 0.5 * turn * dt
                    x, y, psi, speed = (
                        x + way * np.cos(course),
                        y + way * np.sin(course),
                        psi + turn * dt,
                        new,
                    )
                    continue
                limit = np.minimum(self.limits.a_max, v.a_max * v.v_switch / np.maximum(speed, v.v_switch))
                new = np.maximum(speed + np.minimum(push, limit) * dt, 0.0)
                bend = np.clip(pull / np.maximum(speed, 0.1), -most * speed, most * speed)
                way, course = 0.5 * (speed + new) * dt, theta + 0.5 * bend * dt
                psi = psi + way * np.sin(course - psi) / v.rear
                x, y, theta, speed = (
                    x + way * np.cos(course),
                    y + way * np.sin(course),
                    theta + bend * dt,
                    new,
                )
            ahead = v.rear if self.kind == "vehicle" else 0.0
            poses[:, i + 1] = np.stack((x + ahead * np.cos(psi), y + ahead * np.sin(psi), psi), axis=1)
        return poses

    def depths(self, k: int, poses: np.ndarray) -> np.ndarray:
        """How deep each motion (N,) is in the shapes, summed over the samples [m]."""
        sides = np.array((self.vehicle.half_length, self.vehicle.half_width)) + self.margin
        corners = sides * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
        total = np.zeros(len(poses))
        for i in range(0, poses.shape[1], 2):
            shapes = self.shapes.vertices[k + i]
            shapes = shapes[np.isfinite(shapes[:, 0, 0])]
            x, y, psi = poses[:, i].T
            away = np.hypot(shapes[..., 0] - x.mean(), shapes[..., 1] - y.mean())
            near = away.min(axis=1) < 60.0
            c, s = np.cos(psi)[:, None], np.sin(psi)[:, None]
            bx, by = (
                x[:, None] + c * corners[:, 0] - s * corners[:, 1],
                y[:, None] + s * corners[:, 0] + c * corners[:, 1],
            )
            for shape in shapes[near]:
                way = np.roll(shape, -1, axis=0) - shape
                length = np.hypot(*way.T)
                way, level = way[length > 1e-9] / length[length > 1e-9, None], shape[length > 1e-9]
                normal = np.stack((way[:, 1], -way[:, 0]), axis=1)
                over = np.min(bx[:, None] * normal[:, :1] + by[:, None] * normal[:, 1:], axis=2)
                deep = np.min(np.sum(normal * level, axis=1) - over, axis=1)
                u = c * (shape[:, 0] - x[:, None]) + s * (shape[:, 1] - y[:, None])
                w = c * (shape[:, 1] - y[:, None]) - s * (shape[:, 0] - x[:, None])
                for seen, half in ((u, sides[0]), (w, sides[1])):
                    deep = np.minimum(deep, np.minimum(seen.max(axis=1) + half, half - seen.min(axis=1)))
                total += np.maximum(deep, 0.0)
        return total

    def free(self, k: int, poses: np.ndarray) -> bool:
        """Whether one motion (T, 3) meets nothing and stays on the road, by the checker's own measures."""
        centre = poses[:, 0] + 1j * poses[:, 1]
        turn, beside = np.ascontiguousarray(poses[:, 2]), self.beside if self.margin else frozenset()
        world = self.checker.world
        met = world.contact_along(centre, turn, k, margin=self.margin, beside=beside)
        if met is not None or world.contact_along(centre, turn, k) is not None:
            return False
        road = self.checker.road
        return road is None or road.first_off_road(poses[:, 0], poses[:, 1], turn) is None

    def best(self, t_rep: float, tries: int = 256, rounds: int = 10, pieces: int = 6, seed: int = 0) -> Shot:
        """Search for a motion from a time to react on that meets nothing."""
        rng = np.random.default_rng(seed)
        k = round(t_rep / self.h)
        steps = self.stop - k
        if steps < 1:
            return Shot(False, math.inf, 0)
        most = _SHARE * (self.vehicle.a_max if self.kind == "vehicle" else self.limits.a_total)
        piece = np.minimum(np.arange(steps) * pieces // steps, pieces - 1)
        mean, spread = np.zeros((pieces, 2)), np.full((pieces, 2), most)
        tried, least = 0, math.inf
        for turn in range(rounds):
            asked = mean + spread * rng.standard_normal((tries, pieces, 2))
            if turn == 0:  # the corners of what is possible
                angle = rng.integers(0, 16, (tries, 1)) * (math.pi / 8) + np.zeros((tries, pieces))
                angle[: tries // 2] = rng.integers(0, 16, (tries // 2, pieces)) * (math.pi / 8)
                asked = most * np.stack((np.cos(angle), np.sin(angle)), axis=2)
            size = np.hypot(asked[..., 0], asked[..., 1])
            asked *= np.minimum(1.0, most / np.maximum(size, 1e-9))[..., None]
            poses = self.drive(k, asked[:, piece, 0], asked[:, piece, 1])
            deep = self.depths(k, poses)
            tried += tries
            order = np.argsort(deep)
            least = min(least, float(deep[order[0]]))
            if any(self.free(k, poses[i]) for i in order[:3]):
                return Shot(True, 0.0, tried)
            elite = asked[order[: max(4, int(_ELITE * tries))]]
            mean, spread = elite.mean(axis=0), elite.std(axis=0) + 0.02 * most
        return Shot(False, least, tried)
