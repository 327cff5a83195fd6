"""Curves through states that were driven before, from the first to the last of them and not beyond."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from repair.arrays import Array, frozen, wrap
from repair.curves.base import Curve
from repair.curves.bases import basis_matrix, n_points_for
from repair.curves.bernstein import BernsteinCurve
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import splice_points
from repair.errors import ReferenceTrajectoryError
from repair.scene.road.passes import along
from repair.scene.start import slip_at_start

if TYPE_CHECKING:
    from repair.curves.plane import CartesianPath
    from repair.reference.consistency import Recording
    from repair.scene.scene import Scene

__all__ = ["between_steps", "deviation", "fit_recording"]

_DEGREE = 3
_SPACING = 0.4  # knots of a spline through recorded positions are at most this far apart [s], or two steps
_SPEED_OFF = 0.05  # a recording that starts faster or slower than the ego by more has its own speed [m/s]
_FIT_OFF = 0.05  # a spline farther from the positions than this [m] gets more freedom
_ROUGH = 2.0  # accelerations that swing and jump by more come from rounding [m/s²]
_DENSE = 0.5  # positions between the steps are at most this far apart [m]
_PARTS = 4  # of a step, at whose ends a curve is looked at
_SHORT = 200  # steps of a plan up to which what fits a spline to such plans is kept


def fit_recording(
    scene: Scene, recording: Recording, *, noisy: bool = False, coordinates: Array | None = None
) -> Curve:
    """Curve through what was driven; it ends with the last state.

    Where the velocities are known, it goes through positions and velocities alike, cubic from step to step,
    which is exact for constant accelerations. Where the vehicle cannot follow that, because the states were
    rounded or are those of another model, and wherever only positions are known, it is a smoothing spline
    that starts with the scene's state, or with the recording's own speed where that differs; its knots are
    spread over the recording's own duration. Where the vehicle cannot follow the spline either, since it
    swings around a jump of the acceleration, and can follow what speeds and headings say, it is that.

    Parameters
    ----------
    scene : Scene
    recording : Recording
        At the scenario's steps.
    noisy : bool
        The positions were measured: no knots are added to follow them more closely.
    coordinates : (K, 2) array, optional
        The positions in the scene's frame, where they are known.

    Raises
    ------
    ReferenceTrajectoryError
        If there are less than four positions, or they leave the neighbourhood of the route.
    """
    positions, what = recording.positions, recording.what
    last = len(positions)
    if last < 4:
        raise ReferenceTrajectoryError(f"{what} is known for {last} steps only; a reference takes at least 4")
    if coordinates is None:
        coordinates = along(scene.frame, positions, float(scene.start[0, 0]))
    if not np.isfinite(coordinates).all():
        step = recording.first + int(np.argmin(np.isfinite(coordinates).all(axis=1)))
        back = _back(positions)
        raise ReferenceTrajectoryError(
            f"{what} leaves the neighbourhood of the route at time step {step} and cannot be a reference"
            if back is None
            else f"{what} turns back at time step {recording.first + back}, over its own path; it can be "
            "driven forwards or in reverse, but not one after the other"
        )
    if recording.velocities is None:
        smooth = _smooth(scene, recording, coordinates, noisy=noisy)[0]
        told = np.isfinite([recording.speeds, recording.headings]).all()
        if noisy or not told or not _swings(scene, smooth):
            return smooth
        exact = _hermite(scene, coordinates, _by_the_body(recording, scene.dt))
        return exact if _drivable_until(scene, exact) >= _drivable_until(scene, smooth) else smooth
    exact = _hermite(scene, coordinates, recording.velocities)
    first = _drivable_until(scene, exact)
    rough = _roughness(exact) > _ROUGH
    if rough or np.isfinite(first):
        smooth, off = _smooth(scene, recording, coordinates)
        then = _drivable_until(scene, smooth) if off <= _FIT_OFF else 0.0
        if then > first or (rough and then == first):
            return smooth
    return exact


def _back(positions: Array) -> int | None:
    """Index of the first position that lies back from the ones before, by more than noise; or None."""
    last, ahead = positions[0], np.zeros(2)
    for k, point in enumerate(positions):
        moved = point - last
        if np.hypot(*moved) >= _DENSE:
            if float(moved @ ahead) < 0.0:
                return k
            last, ahead = point, moved
    return None


def _hermite(scene: Scene, coordinates: Array, velocities: Array) -> BernsteinCurve:
    """The curve through coordinates and velocities (K, 2), cubic from step to step."""
    return BernsteinCurve.hermite(0.0, scene.dt, coordinates, _in_frame(scene, coordinates, velocities))


def _swings(scene: Scene, smooth: UniformBSpline) -> bool:
    """Whether a spline may need more grip than there is, as it does around a jump of what is needed."""
    along_it = np.abs(smooth.derivative_points(2)[:, 0]).max()
    return bool(along_it > scene.vehicle.a_max) or _slides(scene, *_looked_at(scene, smooth)) < np.inf


def _by_the_body(recording: Recording, dt: float) -> Array:
    """Velocities (K, 2) of the centre [m/s], by the speed, heading and turning of the body.

    The turning is that of a cubic spline: differences smear it where the steering's rate jumps.
    """
    from scipy.interpolate import CubicSpline

    heading = np.unwrap(recording.headings)
    times = np.arange(len(heading)) * dt
    across = recording.rear * CubicSpline(times, heading)(times, 1)
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = recording.speeds * cos - across * sin, recording.speeds * sin + across * cos
    return np.stack([x, y], axis=1)


def _setting_out(scene: Scene, recording: Recording, speed: float) -> Array:
    """Velocity (1, 2) of the centre at the start [m/s], by the orientation and the turning of the body.

    It slips no more than the steering allows, so that noise says nothing while the vehicle stands.
    """
    vehicle, heading = scene.vehicle, np.unwrap(recording.headings[:3])
    most = abs(speed) * vehicle.rear / vehicle.wheelbase * np.tan(vehicle.steering_max)
    across = np.clip(vehicle.rear * np.gradient(heading, scene.dt, edge_order=2)[0], -most, most)
    cos, sin = np.cos(heading[0]), np.sin(heading[0])
    return np.array([[speed * cos - across * sin, speed * sin + across * cos]])


def _roughness(exact: BernsteinCurve) -> float:
    """By how much accelerations along the path swing within steps and jump back between them [m/s²].

    Constant inputs jump and do not swing, smooth motion swings and does not jump; rounding does both.
    """
    begin, end = exact.derivative_points(2)[..., 0].T
    swing, jump = np.abs(end - begin), np.abs(begin[1:] - end[:-1])
    return float(np.minimum(np.minimum(swing[1:], swing[:-1]), jump).max(initial=0.0))


def between_steps(recording: Recording, dt: float) -> Array:
    """Positions (M, 2) [m], also between the steps where the velocities are known."""
    if recording.velocities is None or len(recording.positions) < 2:
        return recording.positions
    chain = BernsteinCurve.hermite(0.0, dt, recording.positions, recording.velocities)
    farthest = float(np.hypot(*recording.velocities.T).max()) * dt
    count = int(np.clip(np.ceil(farthest / _DENSE), 1, 100))
    return chain.sample(np.arange((len(recording.positions) - 1) * count + 1) * (dt / count)).position


def deviation(scene: Scene, recording: Recording, curve: Curve) -> tuple[float, float, float]:
    """By how much a curve misses what was recorded at the steps: place [m], speed [m/s], orientation [rad].

    Speed and orientation are those where the recording states them, and 0 where it does not.
    """
    count = len(recording.positions)
    path = scene.frame.cartesian(curve.sample(np.arange(count) * scene.dt))
    off = float(np.abs(path.xy - recording.positions).max())
    faster = turned = 0.0
    if recording.velocities is not None:
        faster = float(np.abs(np.abs(path.speed) - np.hypot(*recording.velocities.T)).max())
    known = np.isfinite(recording.headings)
    if known.any():
        turned = float(np.abs(wrap(_orientation(scene, curve, count) - recording.headings))[known].max())
    return off, faster, turned


def _in_frame(scene: Scene, coordinates: Array, velocities: Array) -> Array:
    """Velocities (K, 2) in the plane as rates of ``[s, l]``."""
    s, l = coordinates.T  # noqa: E741
    heading = scene.frame.heading(s)
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = velocities.T
    return np.stack([(cos * x + sin * y) / (1.0 - scene.frame.curvature(s) * l), cos * y - sin * x], axis=1)


def _orientation(scene: Scene, curve: Curve, count: int) -> Array:
    """Of the body that drives along a curve, at the steps (count,) [rad]."""
    times = np.arange((count - 1) * _PARTS + 1) * (scene.dt / _PARTS)
    path = scene.frame.cartesian(curve.sample(times))
    _, orientation = scene.model.angles(path, slip_at_start(scene, path))
    return orientation[::_PARTS]


def _drivable_until(scene: Scene, curve: Curve) -> float:
    """When the scene's vehicle leaves a curve because it cannot drive it, or has not the grip [s]; or inf."""
    times, path = _looked_at(scene, curve)
    slip, orientation = scene.model.angles(path, slip_at_start(scene, path))
    found = scene.model.first_undrivable(
        times[::_PARTS], path.xy[::_PARTS], path.speed[::_PARTS], slip[::_PARTS], orientation[::_PARTS],
        scene.dt, "leftover", np.inf,
    )  # fmt: skip
    until = _slides(scene, times, path)
    return until if found is None else min(found[0], until)


def _looked_at(scene: Scene, curve: Curve) -> tuple[Array, CartesianPath]:
    """Times at which a curve is looked at [s], several to a step, and the path there."""
    steps = round((curve.t_end - curve.t_start) / scene.dt)
    times = np.arange(steps * _PARTS + 1) * (scene.dt / _PARTS)
    return times, scene.frame.cartesian(curve.sample(times))


def _slides(scene: Scene, times: Array, path: CartesianPath) -> float:
    """When a path needs more grip than there is [s]; or inf."""
    velocity = path.speed[:, None] * np.stack([np.cos(path.heading), np.sin(path.heading)], axis=1)
    grip = np.hypot(*np.diff(velocity, axis=0).T) * (_PARTS / scene.dt)
    slides = np.flatnonzero(grip > scene.vehicle.a_max)
    return float(times[slides[0]]) if len(slides) else np.inf


def _smooth(
    scene: Scene, recording: Recording, coordinates: Array, *, noisy: bool = False
) -> tuple[UniformBSpline, float]:
    """Smoothing spline through ``[s, l]`` (K, 2) at the steps, and by how much it misses them [m]."""
    state = np.array([coordinates[0], scene.start[1], scene.start[2]])
    own = float(recording.speeds[0]) if np.isfinite(recording.speeds[0]) else state[1, 0]
    if np.linalg.norm(coordinates[0] - scene.start[0]) > 0.5:
        state[1] = (coordinates[1] - coordinates[0]) / scene.dt
        state[2] = 0.0
    elif abs(own - state[1, 0]) > _SPEED_OFF:
        state[1, 0] = own
    spacing = max(_SPACING, 2.0 * scene.dt)
    # Who is said to brake and would stop within a knot need not do so: the positions say how it goes on.
    free = state[1, 0] + min(state[2, 0], 0.0) * spacing < min(state[1, 0], 0.0)
    if recording.velocities is None and scene.first_heading is not None:
        state[1] = _in_frame(scene, coordinates[:1], _setting_out(scene, recording, own))[0]
        free = True  # they also say how a body bends that need not drive steadily yet
    best, off = _fitted(coordinates, state[:2] if free else state, scene.dt, spacing)
    for finer, fixed in ((spacing, 2), (0.5 * spacing, 2)):
        if noisy or off <= _FIT_OFF:
            break
        made, miss = _fitted(coordinates, state[:fixed], scene.dt, finer)
        if miss < off:
            best, off = made, miss
    return best, off


class _Observed(NamedTuple):
    """Least squares for a spline with some of the derivatives at its start given.

    Attributes
    ----------
    left : (count + n - 3, n) array
        From control points to positions at the steps, and to a whisper of smoothing.
    columns : (count + n - 3, n - given) array
        The same from what is free: what is not given of the start, then the other control points.
    inverse : (n - given, count + n - 3) array or None
        Pseudo-inverse of ``columns``: worth its time where one plan after the other is as long, too slow to
        make where many steps are fitted once.
    """

    left: Array
    columns: Array
    inverse: Array | None

    def solved(self, right: Array) -> Array:
        """What is free, where ``columns`` times it comes closest to ``right``."""
        if self.inverse is None:
            return np.asarray(np.linalg.lstsq(self.columns, right, rcond=None)[0])
        return np.asarray(self.inverse @ right)


@lru_cache(maxsize=16)
def _observed(count: int, dt: float, n: int, spacing: float, given: int) -> _Observed:
    basis = basis_matrix(np.arange(count) * dt, n, _DEGREE, spacing)
    left = np.vstack([basis, 1e-3 * np.diff(np.eye(n), n=3, axis=0)])
    free = splice_points(np.eye(_DEGREE), _DEGREE, spacing)[:, given:]
    columns = np.hstack([left[:, :_DEGREE] @ free, left[:, _DEGREE:]])
    inverse = frozen(np.linalg.pinv(columns)) if count <= _SHORT else None
    return _Observed(frozen(left), frozen(columns), inverse)


def _fitted(coordinates: Array, state: Array, dt: float, spacing: float) -> tuple[UniformBSpline, float]:
    """Least-squares spline with the derivatives ``state`` at its start, and by how much it misses [m]."""
    duration = (len(coordinates) - 1) * dt
    n = n_points_for(duration, spacing, _DEGREE)
    spacing = duration / (n - _DEGREE)
    if spacing * (n - _DEGREE) > duration:  # by a rounding error
        spacing = float(np.nextafter(spacing, 0.0))
    observed = _observed(len(coordinates), dt, n, spacing, len(state))
    left, basis = observed.left, observed.left[: len(coordinates)]
    right = np.vstack([coordinates, np.zeros((len(left) - len(coordinates), 2))])
    # What is not given of the start is found: it is linear in that.
    given, free = np.split(splice_points(np.eye(_DEGREE), _DEGREE, spacing), [len(state)], axis=1)
    head = given @ state
    found = observed.solved(right - left[:, :_DEGREE] @ head)
    more = _DEGREE - len(state)
    points = np.vstack([head + free @ found[:more], found[more:]])
    miss = float(np.abs(basis @ points - coordinates).max())
    return UniformBSpline(0.0, spacing, _DEGREE, frozen(points)), miss
