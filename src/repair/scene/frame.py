"""A C2 Frenet frame along a path: one cubic spline, parametrised by arc length.

A frame made of a polyline has curvature noise that fails kinematic checks in every turn; here the
polyline is smoothed first, and position, heading and curvature then come from one spline.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.errors import ScenarioError
from repair.types import Array, FrenetTrajectory, frozen

__all__ = ["STANDSTILL", "CartesianPath", "FrenetFrame"]

STANDSTILL = 1e-2
"""Below this speed [m/s] the direction of motion is noise: a trajectory's heading is held."""

_STEP = 0.25  # knot distance of the table [m]
_MIN_LENGTH = 1.0  # a shorter path has no meaningful direction [m]
_DOMAIN = 0.05  # smallest 1 - kappa l at which a projection still counts as unique
_NEWTON = 8


@dataclass(frozen=True)
class CartesianPath:
    """A trajectory in the plane.

    Attributes
    ----------
    t : (K,) array
        Time [s].
    xy : (K, 2) array
        Position of the reference point [m].
    heading : (K,) array
        Direction of its velocity [rad], continuous; held where it stands, and not turned round
        while reversing.
    speed : (K,) array
        Signed speed [m/s], negative while reversing.
    distance : (K,) array
        Distance driven since the first sample [m].
    """

    t: Array
    xy: Array
    heading: Array
    speed: Array
    distance: Array


class FrenetFrame:
    """A C2 path with coordinates s (arc length) and l (offset, left positive).

    Beyond both ends the frame continues straight (curvature 0). Build it with :meth:`from_points`.

    Attributes
    ----------
    length : float
        Arc length of the path [m].
    s : (M,) array
        Uniform arc lengths of the table, 0 to ``length``.
    curvature_table : (M,) array
        Curvature at ``s`` [1/m].
    heading_table : (M,) array
        Unwrapped heading at ``s`` [rad].
    points : (M, 2) array
        Positions at ``s`` [m].
    max_lateral : float
        Farther from the path than this [m], points have no coordinates.
    """

    def __init__(self, points: Array, length: float, *, max_lateral: float = 60.0) -> None:
        from scipy.interpolate import CubicSpline

        count = len(points) - 1
        self.length = float(length)
        self.max_lateral = float(max_lateral)
        self.s = frozen(np.linspace(0.0, length, count + 1))
        self._inverse = count / self.length
        # "natural": the curvature ends at 0, so the straight extensions join with C2
        spline = CubicSpline(self.s, points, bc_type="natural")
        cubic = spline.c  # (4, count, 2), highest power first
        ends = np.zeros((4, 2, 2))
        ends[3, 0], ends[2, 0] = points[0], cubic[2, 0]
        ends[3, 1], ends[2, 1] = points[-1], spline(self.length, 1)
        # one straight segment before the first and one after the last: no branches when evaluating
        full = np.concatenate([ends[:, :1], cubic, ends[:, 1:]], axis=1)
        self._coefficients = frozen(full.transpose(0, 2, 1))  # (4, 2, count + 2): long rows evaluate fast
        self._knots = frozen(np.concatenate([[0.0], self.s]))
        self._last = float(count + 1)
        velocity, second = spline(self.s, 1), spline(self.s, 2)
        heading = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
        self.points = frozen(points)
        self.heading_table = frozen(heading)
        self._turns = frozen(np.concatenate([heading[:1], heading]))
        cross = velocity[:, 0] * second[:, 1] - velocity[:, 1] * second[:, 0]
        self.curvature_table = frozen(cross / np.hypot(velocity[:, 0], velocity[:, 1]) ** 3)

    @classmethod
    def from_points(
        cls,
        points: npt.ArrayLike,
        *,
        spacing: float = 1.0,
        smoothing: float = 0.15,
        max_lateral: float = 60.0,
    ) -> FrenetFrame:
        """Smooth a polyline and lay the frame along it.

        Parameters
        ----------
        points : (M, 2) array
            The polyline [m]; repeated points are dropped.
        spacing : float
            Distance of the points that are smoothed and interpolated [m].
        smoothing : float
            How far smoothing may move the path [m]; 0 interpolates the points as they are.
        max_lateral : float
            See the class.

        Raises
        ------
        ScenarioError
            If the points are not finite, or the path is shorter than 1 m.
        """
        clean = _clean(points)
        if smoothing > 0.0:
            clean = _clean(_smooth(_resample_chord(clean, spacing), smoothing))  # smoothing may fold a spike
        table, length = _arc_length_table(clean)
        return cls(table, length, max_lateral=max_lateral)

    # ------------------------------------------------------------------ evaluation

    def _locate(self, s: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], Array]:
        query = np.asarray(s, dtype=np.float64)
        # fmax/fmin send NaN to segment 0; the offset stays NaN and so does the result
        # and what is not negative is rounded down by the cast
        where = query * self._inverse + 1.0
        index = np.fmin(np.fmax(where, 0.0), self._last).astype(np.intp)
        return index, query - self._knots.take(index)

    def _derivatives(self, s: npt.ArrayLike, highest: int) -> tuple[list[Array], Any]:
        """Position and derivatives by s up to ``highest``, each (2, ...), and the segment."""
        index, u = self._locate(s)
        c3, c2, c1, c0 = self._coefficients.take(index, axis=2)
        found = [((c3 * u + c2) * u + c1) * u + c0]
        if highest >= 1:
            found.append((3.0 * c3 * u + 2.0 * c2) * u + c1)
        if highest >= 2:
            found.append(6.0 * c3 * u + 2.0 * c2)
        if highest >= 3:
            found.append(6.0 * c3)
        return found, index

    def position(self, s: npt.ArrayLike) -> Array:
        """Points of the path (..., 2) at ``s`` (...)."""
        return _pairs(*self._derivatives(s, 0)[0][0])

    def heading(self, s: npt.ArrayLike) -> Array:
        """Continuous heading [rad] at ``s``."""
        index, u = self._locate(s)
        c3, c2, c1, _ = self._coefficients.take(index, axis=2)
        x1, y1 = (3.0 * c3 * u + 2.0 * c2) * u + c1
        return self._continuous(np.arctan2(y1, x1), index)

    def _continuous(self, angle: Array, index: Any) -> Array:
        if self._principal:
            return angle
        turns = np.rint((self._turns.take(index) - angle) / (2.0 * np.pi))
        return np.asarray(angle + 2.0 * np.pi * turns)

    @cached_property
    def _principal(self) -> bool:
        """Whether the heading stays away from +-pi, so that no turn has to be added to arctan2's value."""
        return bool(np.abs(self.heading_table).max() < 0.75 * np.pi)

    def curvature(self, s: npt.ArrayLike) -> Array:
        """Curvature [1/m] at ``s``, left positive."""
        (_, (x1, y1), (x2, y2)), _ = self._derivatives(s, 2)
        square = x1 * x1 + y1 * y1
        return np.asarray((x1 * y2 - y1 * x2) / (square * np.sqrt(square)))

    def curvature_rate(self, s: npt.ArrayLike) -> Array:
        """Derivative of the curvature by s [1/m²] (piecewise continuous)."""
        (_, (x1, y1), (x2, y2), (x3, y3)), _ = self._derivatives(s, 3)
        square = x1 * x1 + y1 * y1
        cross, rate, dot = x1 * y2 - y1 * x2, x1 * y3 - y1 * x3, x1 * x2 + y1 * y2
        return np.asarray((rate - 3.0 * cross * dot / square) / (square * np.sqrt(square)))

    def to_cartesian(self, s: npt.ArrayLike, l: npt.ArrayLike) -> Array:  # noqa: E741
        """Points (..., 2) at arc length ``s`` and offset ``l``."""
        ((x, y), (x1, y1)), _ = self._derivatives(s, 1)
        offset = np.asarray(l, dtype=np.float64) / np.sqrt(x1 * x1 + y1 * y1)
        return _pairs(x - offset * y1, y + offset * x1)

    # ------------------------------------------------------------------ projection

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def to_frenet(self, points: npt.ArrayLike, near: npt.ArrayLike | None = None) -> Array:
        """Project points on the path.

        Parameters
        ----------
        points : (..., 2) array
            Points in the plane [m]; NaN is allowed.
        near : (...) array or float, optional
            Arc length to search around (15 m to both sides), where the path passes twice.

        Returns
        -------
        (..., 2) array
            ``[s, l]``; NaN where the projection is not unique (``1 - curvature * l <= 0.05``) or
            farther than ``max_lateral``. Before the start and after the end, s runs on along the
            straight extensions.
        """
        query = np.asarray(points, dtype=np.float64)
        flat = query.reshape(-1, 2)
        result = np.full(flat.shape, np.nan)
        usable = (np.abs(flat) < 1e12).all(axis=1)  # the search tree has no answer where a square overflows
        if usable.any():
            hint = None
            if near is not None:
                hint = np.broadcast_to(np.asarray(near, dtype=np.float64), query.shape[:-1]).reshape(-1)[
                    usable
                ]
            result[usable] = self._project(flat[usable], hint)
        return result.reshape(query.shape)

    def _nearest(self, flat: Array, hint: Array | None) -> Array:
        if hint is None:
            index = np.asarray(self._tree.query(flat)[1])
        else:
            window = np.arange(-60, 61)
            around = np.rint(np.nan_to_num(hint) * self._inverse).astype(np.intp)[:, None] + window
            around = np.clip(around, 0, len(self.s) - 1)
            square = np.sum((self.points[around] - flat[:, None]) ** 2, axis=-1)
            index = np.take_along_axis(around, np.argmin(square, axis=1)[:, None], axis=1)[:, 0]
        return np.array(self.s[index])

    def _project(self, flat: Array, hint: Array | None) -> Array:
        start = self._nearest(flat, hint)
        px, py = np.ascontiguousarray(flat.T)
        s = start
        for _ in range(_NEWTON):
            ((x, y), (x1, y1), (x2, y2)), _ = self._derivatives(s, 2)
            gx, gy = px - x, py - y
            slope = gx * x2 + gy * y2 - x1 * x1 - y1 * y1  # -(1 - kappa l)
            step = (gx * x1 + gy * y1) / np.minimum(slope, -_DOMAIN)
            s = s - step
            if np.max(np.abs(step)) < 1e-11:
                break
        ((x, y), (x1, y1), (x2, y2)), _ = self._derivatives(s, 2)
        gx, gy = px - x, py - y
        square = x1 * x1 + y1 * y1
        norm = np.sqrt(square)
        lateral = (x1 * gy - y1 * gx) / norm
        along = np.abs(gx * x1 + gy * y1) / norm
        width = 1.0 - (gx * x2 + gy * y2) / square
        # Newton may run away from the nearest sample only along the straight extensions
        strayed = (np.abs(np.clip(s, 0.0, self.length) - start) > 1.0) & (width < 0.5)
        outside = (width <= _DOMAIN) | (np.abs(lateral) > self.max_lateral) | (along > 1e-7) | strayed
        found = np.stack([s, lateral], axis=1)
        found[outside] = np.nan
        return found

    # ------------------------------------------------------------------ trajectories

    def cartesian(self, trajectory: FrenetTrajectory) -> CartesianPath:
        """Carry a Frenet trajectory into the plane; see :class:`CartesianPath`."""
        return self.carry(trajectory.t, trajectory.position, trajectory.velocity)

    def carry(self, t: Array, position: Array, velocity: Array) -> CartesianPath:
        """As :meth:`cartesian`, of the only columns (K, 2) that it needs.

        Every repair that is tried comes through here: calls into NumPy are what it costs.
        """
        s, s_rate, sideways = position[:, 0], velocity[:, 0], velocity[:, 1]
        index, u = self._locate(s)
        c3, c2, c1, c0 = self._coefficients.take(index, axis=2)
        c3u = c3 * u
        axis = ((c3u + c2) * u + c1) * u + c0
        second = 3.0 * c3u + c2  # half of it
        tangent = (second + c2) * u + c1
        x1, y1 = tangent[0], tangent[1]
        square = x1 * x1 + y1 * y1
        offset = position[:, 1] / np.sqrt(square)
        plane, motion = np.empty((2, len(s)), dtype=np.complex128)
        np.subtract(axis[0], offset * y1, out=plane.real)
        np.add(axis[1], offset * x1, out=plane.imag)
        bend = (x1 * second[1] - y1 * second[0]) / square  # half of the curvature times the tangent's length
        forward = s_rate * (1.0 - 2.0 * bend * offset)
        motion.real, motion.imag = forward, sideways
        speed = np.abs(motion)
        base = self._continuous(np.arctan2(y1, x1), index)
        if s_rate.size and np.minimum.reduce(s_rate) >= 0.0:
            heading = _held(base + np.arctan2(sideways, forward), base, speed)
        else:
            sign = np.where(s_rate < 0.0, -1.0, 1.0)
            slip = np.arctan2(sign * sideways, sign * forward)
            heading = _held(base + slip, base, speed)
            speed *= sign
        distance = np.zeros(len(s))
        np.add.accumulate(np.abs(plane[1:] - plane[:-1]), out=distance[1:])
        return CartesianPath(t, plane.view(np.float64).reshape(-1, 2), heading, speed, distance)


def _pairs(x: Array, y: Array) -> Array:
    """Two arrays (...) as one (..., 2)."""
    made = np.empty((*np.shape(x), 2))
    made[..., 0] = x
    made[..., 1] = y
    return made


def _held(heading: Array, fallback: Array, pace: Array) -> Array:
    """Headings with those of standing samples taken from the last (else the first) moving one."""
    if np.minimum.reduce(pace, initial=np.inf) >= STANDSTILL:
        return _unwrapped(heading)
    moving = pace >= STANDSTILL
    if not moving.any():
        return np.full_like(fallback, fallback[0]) if len(fallback) else fallback
    last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
    return _unwrapped(heading[np.where(last < 0, int(np.argmax(moving)), last)])


def _unwrapped(angle: Array) -> Array:
    """:func:`numpy.unwrap`, which is slow, only where there is something to unwrap."""
    jump = angle[1:] - angle[:-1]
    if jump.size and not np.maximum.reduce(np.abs(jump)) < np.pi:
        return np.asarray(np.unwrap(angle))
    return angle


def _clean(points: npt.ArrayLike) -> Array:
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
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])


def _resample_chord(path: Array, spacing: float) -> Array:
    chord = _chord(path)
    query = np.linspace(0.0, chord[-1], max(int(np.ceil(chord[-1] / spacing)), 4) + 1)
    return np.stack([np.interp(query, chord, path[:, 0]), np.interp(query, chord, path[:, 1])], axis=1)


def _smooth(path: Array, tolerance: float) -> Array:
    """Penalise third differences (jumps of curvature) as hard as the tolerance allows.

    Whittaker's smoother: minimise ``|x - p|^2 + w |D3 x|^2``. The weight is the largest of a
    geometric series at which no point moves farther than ``tolerance``. The ends are held.
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


def _arc_length_table(path: Array) -> tuple[Array, float]:
    """Points at uniform arc length along the C2 spline through ``path``, and the length."""
    from scipy.interpolate import CubicSpline

    chord = _chord(path)
    spline = CubicSpline(chord, path, bc_type="natural")
    nodes, weights = np.polynomial.legendre.leggauss(5)
    fine = np.unique(np.concatenate([np.linspace(0.0, chord[-1], int(chord[-1] / _STEP) + 2), chord]))
    half = np.diff(fine) / 2.0
    middle = (fine[1:] + fine[:-1]) / 2.0
    speed = np.linalg.norm(spline(middle[:, None] + half[:, None] * nodes, 1), axis=-1)
    arc = np.concatenate([[0.0], np.cumsum(half * (speed @ weights))])
    length = float(arc[-1])
    target = np.linspace(0.0, length, max(int(np.ceil(length / _STEP)), 4) + 1)
    parameter = np.interp(target, arc, fine)
    # one Newton step on arc(parameter) = target takes the linear interpolation's error away
    cell = np.clip(np.searchsorted(fine, parameter, side="right") - 1, 0, len(half) - 1)
    span = (parameter - fine[cell]) / 2.0
    inside = np.linalg.norm(spline((fine[cell] + span)[:, None] + span[:, None] * nodes, 1), axis=-1)
    error = arc[cell] + span * (inside @ weights) - target
    parameter = np.clip(parameter - error / np.linalg.norm(spline(parameter, 1), axis=-1), 0.0, chord[-1])
    return np.asarray(spline(parameter)), length
