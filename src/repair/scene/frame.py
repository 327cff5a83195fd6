"""A C2 Frenet frame along a path: one cubic spline, parametrised by arc length.

A frame made of a polyline has curvature noise that fails kinematic checks in every turn; here the
polyline is smoothed first, and position, heading and curvature then come from one spline.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, Points, frozen, smallest
from repair.curves.base import FrenetTrajectory
from repair.curves.plane import STANDSTILL, CartesianPath, held_headings
from repair.scene.smoothing import arc_length_table, cleaned, resampled, smoothed

__all__ = ["FrenetFrame"]
_DOMAIN = 0.05  # smallest 1 - kappa l at which a projection still counts as unique
_NEWTON = 8
# As arrays, because NumPy takes longer to convert a plain number than to multiply a row by it.
_ZERO, _ONE = np.array(0.0), np.array(1.0)


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
        self._inverse = np.array(count / self.length)
        # "natural": the curvature ends at 0, so the straight extensions join with C2
        spline = CubicSpline(self.s, points, bc_type="natural")
        cubic = spline.c  # (4, count, 2), highest power first
        ends = np.zeros((4, 2, 2))
        ends[3, 0], ends[2, 0] = points[0], cubic[2, 0]
        ends[3, 1], ends[2, 1] = points[-1], spline(self.length, 1)
        # one straight segment before the first and one after the last: no branches when evaluating
        full = np.concatenate([ends[:, :1], cubic, ends[:, 1:]], axis=1)
        # (9, count + 2): where the segments begin and their coefficients; long rows evaluate fast
        starts = np.concatenate([[0.0], self.s])
        self._segments = frozen(np.vstack([starts, full.transpose(0, 2, 1).reshape(8, -1)]))
        self._last = np.array(count + 1.0)
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
        clean = cleaned(points)
        if smoothing > 0.0:
            clean = cleaned(smoothed(resampled(clean, spacing), smoothing))  # smoothing may fold a spike
        table, length = arc_length_table(clean)
        return cls(table, length, max_lateral=max_lateral)

    # ------------------------------------------------------------------ evaluation

    def pieces_at(self, s: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], Array, Array]:
        """Piece of each ``s`` (...), the way into it (...), coefficients (4, 2, ...), the cubic one first."""
        query = np.asarray(s, dtype=np.float64)
        # fmax/fmin send NaN to segment 0; the offset stays NaN and so does the result
        # and what is not negative is rounded down by the cast
        where = query * self._inverse + _ONE
        index = np.fmin(np.fmax(where, _ZERO), self._last).astype(np.intp)
        segments = self._segments.take(index, axis=1)
        return index, query - segments[0], segments[1:].reshape(4, 2, *query.shape)

    def _derivatives(self, s: npt.ArrayLike, highest: int) -> list[Array]:
        """Position and derivatives by s up to ``highest``, each (2, ...)."""
        _, u, (c3, c2, c1, c0) = self.pieces_at(s)
        found = [((c3 * u + c2) * u + c1) * u + c0]
        if highest >= 1:
            found.append((3.0 * c3 * u + 2.0 * c2) * u + c1)
        if highest >= 2:
            found.append(6.0 * c3 * u + 2.0 * c2)
        if highest >= 3:
            found.append(6.0 * c3)
        return found

    def position(self, s: npt.ArrayLike) -> Array:
        """Points of the path (..., 2) at ``s`` (...)."""
        return _pairs(*self._derivatives(s, 0)[0])

    def heading(self, s: npt.ArrayLike) -> Array:
        """Continuous heading [rad] at ``s``."""
        index, u, (c3, c2, c1, _) = self.pieces_at(s)
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
        _, u, (c3, c2, c1, _) = self.pieces_at(s)
        bend = c3 * u
        (x2, y2), (x1, y1) = 6.0 * bend + 2.0 * c2, (3.0 * bend + 2.0 * c2) * u + c1
        square = x1 * x1 + y1 * y1
        return np.asarray((x1 * y2 - y1 * x2) / (square * np.sqrt(square)))

    def curvature_rate(self, s: npt.ArrayLike) -> Array:
        """Derivative of the curvature by s [1/m²] (piecewise continuous)."""
        return self.bend(s)[1]

    def bend(self, s: npt.ArrayLike) -> tuple[Array, Array]:
        """:meth:`curvature` and :meth:`curvature_rate` at ``s``, with one look at the spline."""
        _, (x1, y1), (x2, y2), (x3, y3) = self._derivatives(s, 3)
        square = x1 * x1 + y1 * y1
        cubed = square * np.sqrt(square)
        cross, rate, dot = x1 * y2 - y1 * x2, x1 * y3 - y1 * x3, x1 * x2 + y1 * y2
        return np.asarray(cross / cubed), np.asarray((rate - 3.0 * cross * dot / square) / cubed)

    def to_cartesian(self, s: npt.ArrayLike, l: npt.ArrayLike) -> Array:  # noqa: E741
        """Points (..., 2) at arc length ``s`` and offset ``l``."""
        (x, y), (x1, y1) = self._derivatives(s, 1)
        offset = np.asarray(l, dtype=np.float64) / np.sqrt(x1 * x1 + y1 * y1)
        return _pairs(x - offset * y1, y + offset * x1)

    def axis(self, s: npt.ArrayLike) -> tuple[Array, Array]:
        """Points of the path and its unit tangents at ``s`` (...), both (2, ...)."""
        points, (x1, y1) = self._derivatives(s, 1)
        return points, np.array((x1, y1)) / np.sqrt(x1 * x1 + y1 * y1)

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

    def nearest(self, points: Array) -> npt.NDArray[np.intp]:
        """Which of the tabulated points are nearest to others (N, 2)."""
        return np.asarray(self._tree.query(points)[1], dtype=np.intp)

    def _nearest(self, flat: Array, hint: Array | None) -> Array:
        if hint is None:
            index = self.nearest(flat)
        else:
            window = np.arange(-60, 61)
            around = np.rint(np.nan_to_num(hint) * self._inverse).astype(np.intp)[:, None] + window
            around = np.clip(around, 0, len(self.s) - 1)
            square = np.sum((self.points[around] - flat[:, None]) ** 2, axis=-1)
            index = np.take_along_axis(around, np.argmin(square, axis=1)[:, None], axis=1)[:, 0]
        return np.array(self.s[index])

    def _project(self, flat: Array, hint: Array | None) -> Array:
        start = self._nearest(flat, hint)
        s, lateral, along, width = self._settled(flat, start)
        # Newton may run away from the nearest sample only along the straight extensions
        strayed = (np.abs(np.clip(s, 0.0, self.length) - start) > 1.0) & (width < 0.5)
        outside = (width <= _DOMAIN) | (np.abs(lateral) > self.max_lateral) | (along > 1e-7) | strayed
        found = np.stack([s, lateral], axis=1)
        found[outside] = np.nan
        return found

    def _settled(self, flat: Array, start: Array) -> tuple[Array, Array, Array, Array]:
        """Newton's method for points (N, 2) from arc lengths (N,) on, wherever that leads.

        Returns
        -------
        s, l, along, width : (N,) array
            Where it ended, how far from a projection that is [m], and ``1 - curvature * l``.
        """
        px, py = np.ascontiguousarray(flat.T)
        s = start
        for _ in range(_NEWTON):
            (x, y), (x1, y1), (x2, y2) = self._derivatives(s, 2)
            gx, gy = px - x, py - y
            slope = gx * x2 + gy * y2 - x1 * x1 - y1 * y1  # -(1 - kappa l)
            step = (gx * x1 + gy * y1) / np.minimum(slope, -_DOMAIN)
            s = s - step
            if np.abs(step).max(initial=0.0) < 1e-11:
                break
        (x, y), (x1, y1), (x2, y2) = self._derivatives(s, 2)
        gx, gy = px - x, py - y
        square = x1 * x1 + y1 * y1
        norm = np.sqrt(square)
        lateral = (x1 * gy - y1 * gx) / norm
        along = np.abs(gx * x1 + gy * y1) / norm
        return s, lateral, along, 1.0 - (gx * x2 + gy * y2) / square

    # ------------------------------------------------------------------ trajectories

    def cartesian(self, trajectory: FrenetTrajectory) -> CartesianPath:
        """Carry a Frenet trajectory into the plane; see :class:`repair.curves.plane.CartesianPath`."""
        motion = np.empty((4, len(trajectory)))
        motion[:2], motion[2:] = trajectory.position.T, trajectory.velocity.T
        return self.carry(trajectory.t, motion)

    def carry(self, t: Array, motion: Array) -> CartesianPath:
        """As :meth:`cartesian`, of the only rows (4, K) that it needs: s, l and their rates.

        Every repair that is tried comes through here: calls into NumPy are what it costs.

        Parameters
        ----------
        t : (K,) array
            Times [s].
        motion : (4, K) array
        """
        s, l, s_rate, l_rate = motion  # noqa: E741
        index, way, (c3, c2, c1, c0) = self.pieces_at(s)
        u = np.empty((2, len(s)))  # rows of the same length need no broadcasting
        u[:] = way
        # Horner's scheme, which gives the derivatives as well
        c3u = c3 * u
        quadratic = c3u + c2
        linear = quadratic * u + c1
        quadratic += c3u
        tangent = quadratic * u + linear
        plane = np.empty(len(s), dtype=np.complex128)
        np.add(linear * u, c0, out=plane.view(np.float64).reshape(-1, 2).T)
        heading = base = self._continuous(np.arctan2(tangent[1], tangent[0]), index)
        forward, sideways, slowest, sign = s_rate, l_rate, _least(s_rate), None
        if not slowest >= 0.0:  # seen as if driven forwards
            sign = np.where(s_rate < 0.0, -1.0, 1.0)
            forward, sideways = sign * s_rate, sign * l_rate
        speed = forward
        if np.count_nonzero(l) or np.count_nonzero(l_rate):  # many repairs keep to the path
            quadratic += c3u  # half of the second derivative
            forward = forward * _aside(plane, tangent, quadratic, l)
            velocity = np.empty_like(plane)
            velocity.real, velocity.imag = forward, sideways
            speed = np.abs(velocity)
            heading = base + np.arctan2(sideways, forward)
            slowest = _least(speed)
        if not slowest >= STANDSTILL:
            heading = held_headings(heading, base, np.abs(speed))
        if sign is not None:
            speed = speed * sign
            slowest = _least(speed)
        return CartesianPath.through(t, plane, heading, speed, slowest)


def _least(values: Array) -> float:
    return smallest(values) if len(values) else np.inf


def _aside(plane: Points, tangent: Array, second: Array, l: Array) -> Array:  # noqa: E741
    """Move points of the path aside by ``l`` (K,); how much longer their way is than that along the path.

    ``tangent`` and ``second`` (2, K) are the first derivative and half of the second.
    """
    x1, y1 = tangent
    square = x1 * x1 + y1 * y1
    offset = l / np.sqrt(square)
    plane.real -= offset * y1
    plane.imag += offset * x1
    bend = (x1 * second[1] - y1 * second[0]) / square  # half of the curvature times the tangent's length
    return np.asarray(1.0 - 2.0 * bend * offset)


def _pairs(x: Array, y: Array) -> Array:
    """Two arrays (...) as one (..., 2)."""
    made = np.empty((*np.shape(x), 2))
    made[..., 0] = x
    made[..., 1] = y
    return made
