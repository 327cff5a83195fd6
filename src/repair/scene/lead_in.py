"""The path the ego drives: from its initial pose smoothly onto the route's centre line."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from repair.arrays import Array, wrap
from repair.errors import ScenarioError
from repair.scene.frame import FrenetFrame
from repair.vehicle.by_steps import missed_by_steps
from repair.vehicle.parameters import Vehicle

__all__ = ["LeadIn", "drive_path"]

_BACK = 30.0  # path behind the ego, so that followers have coordinates [m]
_COMFORT = 1.5  # lateral acceleration that the lead-in may add at the initial speed [m/s²]
_GRIP = 0.88  # of the friction circle that the lead-in may use: a little less than what limits leave
_BESIDE = 0.75  # how far beside the route it may run for a while [m]
_SHARP = 0.25  # curvature of a centre line above which its kinks are smoothed harder [1/m]
_SHORT = 0.25  # steps that are not longer follow every lead-in that is comfortable [s]
_PARTS, _STEPS = 16, 60  # of a longer step, and steps, that are looked at
_STEEP = 0.6  # heading error above which the ego first turns towards the route [rad]


@dataclass(frozen=True)
class LeadIn:
    """The path onto the route.

    Attributes
    ----------
    frame : FrenetFrame
        Along the driven path.
    start : float
        The ego's arc length on it [m].
    blend : float
        Length over which the path runs into the route [m].
    notes : tuple of str
        What had to be assumed.
    """

    frame: FrenetFrame
    start: float
    blend: float
    notes: tuple[str, ...]


def _route_frame(center: Array, smoothing: float) -> tuple[FrenetFrame, float]:
    """Frame along a centre line, smoothed harder only if its kinks ask for it; and the tolerance used [m]."""
    for tolerance in (smoothing, *(t for t in (0.25, 0.5, 1.0) if t > smoothing)):
        frame = FrenetFrame.from_points(center, smoothing=tolerance)
        if np.max(np.abs(frame.curvature_table)) <= _SHARP:
            break
    return frame, tolerance


def _quintic(start: Array, length: float, x: Array) -> Array:
    """Value, slope and second derivative at ``x`` of the quintic from ``start`` (3,) to rest; (3, K)."""
    y, y1, y2 = start[0], start[1] * length, start[2] * length**2
    u = np.clip(x / length, 0.0, 1.0)
    c3, c4, c5 = -10 * y - 6 * y1 - 1.5 * y2, 15 * y + 8 * y1 + 1.5 * y2, -6 * y - 3 * y1 - 0.5 * y2
    value = y + u * (y1 + u * (y2 / 2 + u * (c3 + u * (c4 + u * c5))))
    slope = y1 + u * (y2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))
    second = y2 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))
    return np.stack([value, slope / length, second / length**2])


def _offset_curvature(frame: FrenetFrame, s: Array, l: Array) -> Array:  # noqa: E741
    """Curvature of the curve with offsets ``l`` (3, K) over the frame at ``s``."""
    kappa, rate = frame.curvature(s), frame.curvature_rate(s)
    width = 1.0 - kappa * l[0]
    square = width**2 + l[1] ** 2
    twist = (rate * l[0] + kappa * l[1]) * l[1]
    return np.asarray((width * (l[2] + kappa * width) + kappa * l[1] ** 2 + twist) / square**1.5)


def _start_offsets(frame: FrenetFrame, s0: float, l0: float, error: float, curvature: float) -> Array:
    """Offset, slope and second derivative at s0 of a path with this heading error and curvature."""
    kappa, rate = float(frame.curvature(s0)), float(frame.curvature_rate(s0))
    width = 1.0 - kappa * l0
    slope = width * np.tan(error)
    square = width**2 + slope**2
    # the curvature formula above, solved for the second derivative
    second = (curvature * square**1.5 - kappa * slope**2 - (rate * l0 + kappa * slope) * slope) / width
    return np.array([l0, slope, second - kappa * width])


@dataclass(frozen=True)
class _Blend:
    """Offsets of the path from the route: a quintic to rest over ``length``, beside it at first by ``kept``.

    Who comes in at an angle within a bend has turned in a few metres, and takes its time for the rest.
    """

    start: Array
    length: float
    kept: float = 0.0
    rest: float = 1.0

    def __call__(self, x: Array) -> Array:
        """Offset, slope and second derivative (3, K) at ``x`` from the start on."""
        beside = np.array([self.kept, 0.0, 0.0])
        made = _quintic(self.start - beside, self.length, x)
        return made + _quintic(beside, self.rest, x) if self.kept else made

    def excess(self, frame: FrenetFrame, s0: float, speed: float, limit: float, grip: float) -> Array:
        """Curvature, added lateral acceleration, and lateral acceleration, as shares of what they may be.

        The last one is 0 where the route alone exceeds the grip. All are inf where the path would fold.
        """
        s = s0 + np.linspace(0.0, max(self.length, self.rest if self.kept else 0.0), 64)
        offsets = self(s - s0)
        along = frame.curvature(s)
        if np.min(1.0 - along * offsets[0]) < 0.2:
            return np.full(3, np.inf)
        bend, usual = np.abs(_offset_curvature(frame, s, offsets)), np.abs(along)
        pull = np.max(bend) * speed**2 / grip if np.max(usual) * speed**2 <= grip else 0.0
        return np.array([np.max(bend) / limit, np.max(bend - usual) * speed**2 / _COMFORT, pull])

    def missed(self, frame: FrenetFrame, s0: float, speed: float, dt: float, vehicle: Vehicle) -> float:
        """What steering by long steps misses, at constant speed and speeding up; above 1 it is too much."""
        worst, length = 0.0, max(self.length, self.rest if self.kept else 0.0)
        for rate in (0.0, 1.0):
            if dt <= _SHORT or speed + rate <= 0.0:
                continue
            until = length / speed if not rate else float(np.sqrt(speed**2 + 2.0 * length)) - speed
            steps = np.arange(min(int(np.ceil(until / dt)), _STEPS))[:, None]
            t = (steps + np.linspace(0.0, 1.0, _PARTS + 1)) * dt
            x = speed * t + 0.5 * rate * t**2
            kappa = _offset_curvature(frame, (s0 + x).ravel(), self(x.ravel())).reshape(x.shape)
            worst = max(worst, missed_by_steps(kappa, speed + rate * t, dt, vehicle))
        return worst


def _blend(frame: FrenetFrame, s0: float, start: Array, speed: float, vehicle: Vehicle, dt: float) -> _Blend:
    """Shortest blend whose curvature is drivable and adds a comfortable lateral acceleration."""
    limit, grip = 0.8 * vehicle.largest_curvature(), _GRIP * vehicle.a_max
    least = max(8.0, 1.5 * speed)
    options = least * 1.15 ** np.arange(24)
    options = options[options <= max(least, 160.0)]
    best, worst, pull = _Blend(start, float(options[0])), np.inf, 0.0
    for length in options:
        tried = _Blend(start, float(length))
        found = tried.excess(frame, s0, speed, limit, grip)
        excess = max(found[0], found[1])
        if excess < worst - 1e-3:
            best, worst, pull = tried, excess, found[2]
        if excess <= 1.0:
            break
    if pull <= 1.0:
        return _by_steps(best, options, worst, frame, s0, speed, vehicle, dt)
    for length, rest in itertools.product(least * np.array([0.5, 0.7, 1.0]), options[options > 2.0 * least]):
        tried = _Blend(start, float(length), start[0] + 0.5 * start[1] * float(length), float(rest))
        if abs(tried.kept) <= _BESIDE and np.max(tried.excess(frame, s0, speed, limit, grip)) <= 1.0:
            return tried
    return best


def _by_steps(
    usual: _Blend, options: Array, worst: float, frame: FrenetFrame, s0: float, speed: float,
    vehicle: Vehicle, dt: float,
) -> _Blend:  # fmt: skip
    """The shortest blend that long steps can follow; the usual one where that runs far beside the route."""
    if dt <= _SHORT:
        return usual
    limit, grip = 0.8 * vehicle.largest_curvature(), _GRIP * vehicle.a_max
    for length in options[options >= usual.length]:
        tried = _Blend(usual.start, float(length))
        beside = float(np.abs(tried(np.linspace(0.0, length, 64))[0]).max())
        found = tried.excess(frame, s0, speed, limit, grip)
        if beside > abs(usual.start[0]) + _BESIDE or max(found[0], found[1]) > max(worst, 1.0):
            continue
        if tried.missed(frame, s0, speed, dt, vehicle) <= 1.0:
            return tried
    return usual


def _turn_in(frame: FrenetFrame, pose: Array, limit: float, near: float) -> tuple[Array, float]:
    """Steer from a pose (x, y, heading) at about ``near`` towards the route until the heading error is small.

    Pure pursuit with limited curvature, in steps of 0.25 m; returns the poses (K, 3), and where along the
    route the last one is.
    """
    step, ahead = 0.25, 6.0
    poses = [np.asarray(pose, dtype=np.float64)]
    kappa = 0.0
    for _ in range(400):
        x, y, heading = poses[-1]
        s = frame.to_frenet(np.array([[x, y]]), near=near)[0, 0]
        if not np.isfinite(s):
            break
        near = float(s)
        if len(poses) > 1 and abs(wrap(heading - float(frame.heading(s)))) < 0.3:
            return np.array(poses), near
        target = frame.position(s + ahead) - np.array([x, y])
        alpha = wrap(np.arctan2(target[1], target[0]) - heading)
        wanted = np.clip(2.0 * np.sin(alpha) / np.hypot(*target), -limit, limit)
        if abs(alpha) > np.pi / 2:
            wanted = np.copysign(limit, alpha)
        kappa += float(np.clip(wanted - kappa, -0.06, 0.06))
        middle = heading + kappa * step / 2
        poses.append(np.array([x + step * np.cos(middle), y + step * np.sin(middle), heading + kappa * step]))
    raise ScenarioError("no drivable path leads from the ego's initial pose onto its route")


def drive_path(
    center: Array,
    position: Array,
    orientation: float,
    speed: float,
    vehicle: Vehicle,
    *,
    smoothing: float = 0.15,
    near: float | None = None,
    dt: float = 0.0,
) -> LeadIn:
    """Lay the frame along the path from the ego's pose onto the centre line.

    In the route's own frame the path is a quintic l(s) from the ego's offset, direction and the
    route's curvature to zero. The direction of motion is the orientation plus the slip angle
    ``asin(b kappa)`` of the body centre.

    Parameters
    ----------
    center : (M, 2) array
        The route's centre line [m].
    position : (2,) array
        The ego's initial position [m].
    orientation, speed : float
        Initial orientation [rad] and speed [m/s].
    vehicle : Vehicle
    smoothing : float
        How far smoothing may move the centre line [m]; more only to take out kinks (noted).
    near : float, optional
        About where the ego is along the centre line [m], which may pass it more than once.
    dt : float
        Time step, over which the vehicle has one steering rate [s].

    Raises
    ------
    ScenarioError
        If the start cannot be projected on the route, or no drivable path leads onto it.
    """
    frame, tolerance = _route_frame(center, smoothing)
    notes = []
    if tolerance > smoothing:
        notes.append(f"kinks of the centre line were smoothed by up to {tolerance:g} m")
    limit = 0.8 * vehicle.largest_curvature()
    s0, l0 = frame.to_frenet(np.asarray(position)[None], near=near)[0]
    if not np.isfinite(s0):
        raise ScenarioError("the ego's initial position cannot be projected on its route")
    curvature = float(np.clip(frame.curvature(s0) / (1.0 - frame.curvature(s0) * l0), -limit, limit))
    direction = orientation + vehicle.steady_slip(curvature)
    error = wrap(direction - float(frame.heading(s0)))
    turn: Array = np.empty((0, 2))
    if abs(error) > _STEEP:
        notes.append(
            f"the ego starts {np.rad2deg(error):.0f} degrees off its route and first turns towards it"
        )
        poses, s1 = _turn_in(frame, np.array([*position, direction]), limit, s0)
        turn = poses[:-1, :2]
        curvature = (poses[-1, 2] - poses[-2, 2]) / 0.25
        s1, l1 = frame.to_frenet(poses[-1:, :2], near=s1)[0]
        error = wrap(poses[-1, 2] - float(frame.heading(s1)))
    else:
        s1, l1 = s0, l0
    start = _start_offsets(frame, s1, l1, error, curvature)
    blend = _blend(frame, s1, start, max(speed, 0.0), vehicle, dt)
    end = max(frame.length, s1 + 1.0)
    grid = s1 + np.arange(0.0, end - s1, 0.5)
    grid = np.append(grid[: max(1, len(grid) - 1)], end)
    ahead = frame.to_cartesian(grid, blend(grid - s1)[0])
    if len(turn):
        # behind a start across the route, the path is straight: along the ego's own axis
        back = np.arange(_BACK, 0.0, -0.5)
        behind = turn[0] - back[:, None] * np.array([np.cos(direction), np.sin(direction)])
    else:
        mirror = start * np.array([1.0, -1.0, 1.0])
        back = np.arange(_BACK, 0.0, -0.5)
        behind = frame.to_cartesian(s1 - back, _quintic(mirror, max(blend.length, 10.0), back)[0])
    path = FrenetFrame.from_points(np.concatenate([behind, turn, ahead]), smoothing=0.0)
    where = path.to_frenet(np.asarray(position)[None], near=_BACK)[0]
    return LeadIn(path, float(where[0]), max(blend.length, blend.rest), tuple(notes))
