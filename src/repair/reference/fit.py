"""A spline through recorded positions, from the first to the last of them and not beyond."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.bases import basis_matrix, n_points_for
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import splice_points
from repair.errors import ReferenceTrajectoryError
from repair.scene.road.passes import along

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["fit_positions"]

_DEGREE = 3
_SPACING = 0.4  # knots of a spline through recorded positions are at most this far apart [s], or two steps
_SPEED_OFF = 0.05  # a recording that starts faster or slower than the ego by more has its own speed [m/s]
_FIT_OFF = 0.05  # a spline farther from the positions than this [m] gets more freedom


def fit_positions(
    scene: Scene, positions: Array, speeds: Array, what: str, *, noisy: bool = False
) -> UniformBSpline:
    """Spline through recorded centre positions.

    It ends at the last position: its knots are spread over the recording's own duration. It starts with the
    scene's state, or with the recording's own speed where that differs.

    Parameters
    ----------
    scene : Scene
    positions : (K, 2) array
        At the scenario's steps [m].
    speeds : (K,) array
        Those recorded [m/s]; NaN where unknown.
    what : str
        Name of the recording, for sentences.
    noisy : bool
        The positions were measured: no knots are added to follow them more closely.

    Raises
    ------
    ReferenceTrajectoryError
        If there are less than four positions, or they leave the neighbourhood of the route.
    """
    last = len(positions)
    if last < 4:
        raise ReferenceTrajectoryError(f"{what} is known for {last} steps only; a reference takes at least 4")
    coordinates = along(scene.frame, positions, float(scene.start[0, 0]))
    if not np.isfinite(coordinates).all():
        raise ReferenceTrajectoryError(
            f"{what} leaves the neighbourhood of the route and cannot be a reference"
        )
    state = np.array([coordinates[0], scene.start[1], scene.start[2]])
    own = float(speeds[0]) if np.isfinite(speeds[0]) else state[1, 0]
    if np.linalg.norm(coordinates[0] - scene.start[0]) > 0.5:
        state[1] = (coordinates[1] - coordinates[0]) / scene.dt
        state[2] = 0.0
    elif abs(own - state[1, 0]) > _SPEED_OFF:
        state[1, 0] = own
    spacing = max(_SPACING, 2.0 * scene.dt)
    best, off = _fitted(coordinates, state, scene.dt, spacing)
    for finer, fixed in ((spacing, 2), (0.5 * spacing, 2)):
        if noisy or off <= _FIT_OFF:
            break
        made, miss = _fitted(coordinates, state[:fixed], scene.dt, finer)
        if miss < off:
            best, off = made, miss
    return best


def _fitted(coordinates: Array, state: Array, dt: float, spacing: float) -> tuple[UniformBSpline, float]:
    """Least-squares spline with the derivatives ``state`` at its start, and by how much it misses [m]."""
    duration = (len(coordinates) - 1) * dt
    n = n_points_for(duration, spacing, _DEGREE)
    spacing = duration / (n - _DEGREE)
    if spacing * (n - _DEGREE) > duration:  # by a rounding error
        spacing = float(np.nextafter(spacing, 0.0))
    basis = basis_matrix(np.arange(len(coordinates)) * dt, n, _DEGREE, spacing)
    ridge = 1e-3 * np.diff(np.eye(n), n=3, axis=0)
    left = np.vstack([basis, ridge])
    right = np.vstack([coordinates, np.zeros((len(ridge), 2))])
    if len(state) < _DEGREE:
        # What is not given is found: the start is linear in it.
        heads = splice_points(np.eye(_DEGREE), _DEGREE, spacing)
        given, free = heads[:, : len(state)] @ state, heads[:, len(state) :]
        right = right - left[:, :_DEGREE] @ given
        columns = np.hstack([left[:, :_DEGREE] @ free, left[:, _DEGREE:]])
        found = np.linalg.lstsq(columns, right, rcond=None)[0]
        head = given + free @ found[: _DEGREE - len(state)]
        tail = found[_DEGREE - len(state) :]
    else:
        head = splice_points(state, _DEGREE, spacing)
        tail = np.linalg.lstsq(left[:, _DEGREE:], right - left[:, :_DEGREE] @ head, rcond=None)[0]
    points = np.vstack([head, tail])
    miss = float(np.abs(basis @ points - coordinates).max())
    return UniformBSpline(0.0, spacing, _DEGREE, frozen(points)), miss
