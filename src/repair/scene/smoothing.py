"""A C2 path through noisy points: cleaned, smoothed, tabulated over arc length."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.errors import ScenarioError

__all__ = ["KNOT_DISTANCE", "arc_length_table", "cleaned", "resampled", "smoothed"]

KNOT_DISTANCE = 0.25  # knot distance of the table [m]
_MIN_LENGTH = 1.0  # a shorter path has no meaningful direction [m]


def cleaned(points: npt.ArrayLike) -> Array:
    """Points (M, 2) of a path without those that repeat the one before.

    Raises
    ------
    ScenarioError
        If they are not finite or not (M, 2), or the path is shorter than 1 m.
    """
    path = np.asarray(points, dtype=np.float64)
    if path.ndim != 2 or path.shape[1] != 2:
        raise ScenarioError(f"a path needs points of shape (M, 2), not {path.shape}")
    if not np.isfinite(path).all():
        raise ScenarioError("a path has a point that is not finite")
    keep = [0] if len(path) else []
    for index in range(1, len(path)):
        if np.hypot(*(path[index] - path[keep[-1]])) > 1e-3:
            keep.append(index)
    path = path[keep]
    if len(path) < 2 or np.sum(np.hypot(*np.diff(path, axis=0).T)) < _MIN_LENGTH:
        raise ScenarioError(f"a path is shorter than {_MIN_LENGTH:g} m and cannot carry a Frenet frame")
    return path


def _chord(path: Array) -> Array:
    """Length (M,) of a polyline up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])


def resampled(path: Array, spacing: float) -> Array:
    """Points along a polyline, equally far apart: ``spacing`` [m] at most."""
    chord = _chord(path)
    query = np.linspace(0.0, chord[-1], max(int(np.ceil(chord[-1] / spacing)), 4) + 1)
    return np.stack([np.interp(query, chord, path[:, 0]), np.interp(query, chord, path[:, 1])], axis=1)


def smoothed(path: Array, tolerance: float) -> Array:
    """Penalise third differences (jumps of curvature) as hard as the tolerance allows.

    Whittaker's smoother: minimise ``|x - p|^2 + w |D3 x|^2``. The weight is the largest of a
    geometric series at which no point moves farther than ``tolerance``. The ends are held.

    Parameters
    ----------
    path : (M, 2) array
        Equally spaced points [m].
    tolerance : float
        [m]
    """
    from scipy.linalg import solveh_banded

    count = len(path)
    if count < 5:
        return path
    difference = np.array([-1.0, 3.0, -3.0, 1.0])
    band = np.zeros((4, count))  # lower form of D3' D3
    for i in range(4):
        for j in range(i + 1):
            band[i - j, j : j + count - 3] += difference[i] * difference[j]
    identity = np.ones(count)
    identity[[0, -1]] = 1e9
    weights = 2.0 ** np.arange(18.0, -10.0, -1.0)
    for weight in weights:
        matrix = weight * band
        matrix[0] += identity
        smooth = np.asarray(solveh_banded(matrix, identity[:, None] * path, lower=True))
        if np.max(np.hypot(*(smooth - path).T)) <= tolerance:
            return smooth
    return path


def arc_length_table(path: Array) -> tuple[Array, float]:
    """Points at uniform arc length along the C2 spline through ``path``, and the length."""
    from scipy.interpolate import CubicSpline

    chord = _chord(path)
    spline = CubicSpline(chord, path, bc_type="natural")
    nodes, weights = np.polynomial.legendre.leggauss(5)
    fine = np.unique(np.concatenate([np.linspace(0.0, chord[-1], int(chord[-1] / KNOT_DISTANCE) + 2), chord]))
    half = np.diff(fine) / 2.0
    middle = (fine[1:] + fine[:-1]) / 2.0
    speed = np.linalg.norm(spline(middle[:, None] + half[:, None] * nodes, 1), axis=-1)
    arc = np.concatenate([[0.0], np.cumsum(half * (speed @ weights))])
    length = float(arc[-1])
    target = np.linspace(0.0, length, max(int(np.ceil(length / KNOT_DISTANCE)), 4) + 1)
    parameter = np.interp(target, arc, fine)
    # one Newton step on arc(parameter) = target takes the linear interpolation's error away
    cell = np.clip(np.searchsorted(fine, parameter, side="right") - 1, 0, len(half) - 1)
    span = (parameter - fine[cell]) / 2.0
    inside = np.linalg.norm(spline((fine[cell] + span)[:, None] + span[:, None] * nodes, 1), axis=-1)
    error = arc[cell] + span * (inside @ weights) - target
    parameter = np.clip(parameter - error / np.linalg.norm(spline(parameter, 1), axis=-1), 0.0, chord[-1])
    return np.asarray(spline(parameter)), length
