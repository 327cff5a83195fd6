"""The constraints of the hard NLP as matrices over the control points.

Rows are *Bernstein* control points: a polynomial piece lies in the convex hull of its Bernstein
points, so that a bound on them is a bound on the curve at every time of the piece (Farouki, *The
Bernstein polynomial basis: a centennial retrospective*, 2012). They span the same curve as the
B-spline's control points and are the tighter hull.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from math import comb

import numpy as np
import numpy.typing as npt

from repair.arrays import Array, frozen
from repair.curves.bases import basis_matrix, derivative_matrix, segment_matrix, to_bernstein
from repair.curves.bspline import greville_offsets
from repair.terminal.room import STOP_TIMES

__all__ = ["FAMILIES", "SAMPLED", "Datum", "Layout", "RowKind", "Rows", "Structure", "bernstein_rows"]

#: The linear rows of an axis, in their order.
FAMILIES = ("velocity", "acceleration", "jerk", "obstacles")


class RowKind(IntEnum):
    """What bounds a row. Those before ``PLACE`` are the derivatives, in turn of s and of l."""

    VELOCITY_S = 0
    VELOCITY_L = 1
    ACCELERATION_S = 2
    ACCELERATION_L = 3
    JERK_S = 4
    JERK_L = 5
    PLACE = 6  #: where obstacles and road are: nothing that is known beforehand
    HEADING = 7  #: the direction of travel
    CIRCLE = 8  #: the friction circle
    ACROSS = 9  #: the acceleration across the axis
    ALONG = 10  #: the acceleration along the axis
    CURVATURE = 11  #: that of the driven path
    STOP = 12  #: where the vehicle could be brought to rest after the end


class Datum(IntEnum):
    """What the nonlinear rows need to know about each sample, by row of the data (8, S).

    Of position, velocity and acceleration it is the part that does not depend on the unknowns; the axis'
    curvature is a line in s.
    """

    S = 0  #: s, and its derivatives in the next two rows
    L = 3  #: l, and its derivatives in the next two rows
    BEND = 6  #: the line's value at s = 0
    BEND_SLOPE = 7  #: and its slope


SAMPLED = 8  #: rows of that data

_KINDS = (
    (RowKind.VELOCITY_S, RowKind.ACCELERATION_S, RowKind.JERK_S, RowKind.PLACE),
    (RowKind.VELOCITY_L, RowKind.ACCELERATION_L, RowKind.JERK_L, RowKind.PLACE),
)
# The nonlinear rows in their order, without and with l unknown; the places are those of the body's ends.
_NONLINEAR = (
    (RowKind.CIRCLE, RowKind.ACROSS),
    (RowKind.CIRCLE, RowKind.ACROSS, RowKind.ALONG, RowKind.CURVATURE, RowKind.PLACE, RowKind.PLACE),
)


@dataclass(frozen=True)
class Structure:
    """What a :class:`repair.solvers.casadi.model.Model` depends on.

    Attributes
    ----------
    n : int
        Number of control points; the first ``degree`` of them are given.
    degree : int
    spacing : float
        Knot spacing [s].
    windows : int
        Windows to a segment, within each of which an obstacle is passed on one side.
    lateral : bool
        l is unknown too.
    sampled : bool
        Obstacle rows at the Greville times instead of the windows' Bernstein points.
    weights : tuple of float
        Of acceleration, jerk and distance to the reference.
    solver : str
        ``ipopt`` or ``sqpmethod``.
    max_iterations : int
    tolerance : float
    tangent : float
        Largest l' / s'.
    overhang : float
        Half length of the body that the road must hold [m].
    timed : bool
        The solver asks after every iteration whether there is time left.
    ending : float or None
        The repair's end since t_rep [s], where that has to leave room for a stop.
    """

    n: int
    degree: int
    spacing: float
    windows: int
    lateral: bool
    sampled: bool
    weights: tuple[float, float, float]
    solver: str
    max_iterations: int
    tolerance: float
    tangent: float
    overhang: float
    timed: bool = False
    ending: float | None = None

    @property
    def points(self) -> int:
        """Number of samples, the ends of all windows: what the cost of making the NLP grows with."""
        return self.segments * self.windows

    @property
    def entries(self) -> int:
        """About how many entries the linear rows have: what the cost of laying them out grows with."""
        return self.segments**2 * self.axes * (self.degree * (self.windows + 3) * self.axes)

    @property
    def segments(self) -> int:
        """Number of polynomial pieces."""
        return self.n - self.degree

    @property
    def axes(self) -> int:
        """1 or 2: s, or s and l."""
        return 2 if self.lateral else 1


def _sub_bernstein(degree: int, start: float, end: float) -> Array:
    """Map (p+1, p+1) from a segment's B-spline points to the Bernstein points of its part [start, end]."""
    p = degree
    shift = np.zeros((p + 1, p + 1))
    for i in range(p + 1):
        for k in range(i, p + 1):
            shift[i, k] = comb(k, i) * start ** (k - i) * (end - start) ** i
    return np.asarray(to_bernstein(p) @ shift @ segment_matrix(p))


@lru_cache(maxsize=256)
def bernstein_rows(n: int, degree: int, cuts: tuple[int, ...]) -> Array:
    """Bernstein points of a uniform spline's pieces as a linear map of its control points.

    Parameters
    ----------
    n, degree : int
        Of the spline.
    cuts : tuple of int
        Into how many equal pieces each of the n - degree segments is cut.

    Returns
    -------
    (sum(cuts) * degree + 1, n) array
        Row ``k * degree + j`` is point j of piece k; neighbours share their end point. For degree 0
        one row for each segment.
    """
    if degree == 0:
        return frozen(np.eye(n))
    matrix = np.zeros((sum(cuts) * degree + 1, n))
    row = 0
    for segment, pieces in enumerate(cuts):
        for k in range(pieces):
            part = _sub_bernstein(degree, k / pieces, (k + 1) / pieces)
            matrix[row : row + degree + 1, segment : segment + degree + 1] = part
            row += degree
    return frozen(matrix)


@dataclass(frozen=True)
class Rows:
    """Linear rows of one axis: ``matrix`` (R, n) times that axis' control points.

    Attributes
    ----------
    family : str
        One of ``FAMILIES``, or ``ending``.
    axis : int
        0 for s, 1 for l.
    kind : RowKind
    matrix : (R, n) array
    """

    family: str
    axis: int
    kind: RowKind
    matrix: Array


class Layout:
    """All matrices of one structure.

    Unknowns are the free control points ``x = [s_p .. s_{n-1}, l_p .. l_{n-1}]``.

    Attributes
    ----------
    velocity, acceleration, jerk, position : (R, n) array
        Bernstein points of the curve and its derivatives; ``position`` by window.
    obstacle : (R, n) array
        Rows on which obstacles are bounded: those of ``position``, or the curve at Greville times.
    tau, samples : (S,) array, tuple of (S, n) array
        Ends of the windows since t_rep [s]; position, velocity and acceleration there.
    edge : (S + 1,) array
        Ends of the windows since t_rep [s], the first one's start included.
    fraction : (p + 1,) array
        Where in its window each Bernstein point acts, 0 to 1.
    window_row : (S, p + 1) int array
        Rows of ``position`` that are the points of each window.
    hessian : (n, n) array
        Of the objective, on either axis.
    gauss_tau : (K,) array
        Points of the objective's integration since t_rep [s].
    reference_weight : (K,) array
        Weight of the squared distance to the reference there, times 2.
    pull : (n, K) array
        Map from the reference's positions there to its pull at the control points.
    linear : list of Rows
        The linear rows by family; ``obstacles`` of l include the road.
    kept : list of int arrays
        For each of them, the rows that the unknowns can move.
    free : (L, m) array
        All linear rows that the unknowns can move, over the unknowns; the direction of travel last.
    given : (L, 2 p) array
        The same rows over the given control points, s first.
    linear_count : int
        Their number L.
    bounded : list of tuples
        Axis, ``kept`` and place in those rows of each axis' obstacle rows.
    stopping : tuple or None
        ``kept`` and place in those rows of those that bound the end.
    kind : int array
        :class:`RowKind` of each row, the nonlinear ones included.
    order : int array
        0 to 2 for the rows of ``evaluated`` that are velocities, accelerations, jerks.
    evaluated : (E, n) array
        ``velocity``, ``acceleration``, ``jerk``, ``obstacle`` and ``samples`` on top of each other.
    family_start : (5,) int array
        Where each of these five begins.
    sampled_given : (3 S, p) array
        The samples over the given control points.
    """

    def __init__(self, structure: Structure) -> None:
        self.structure = s = structure
        n, p, h, segments = s.n, s.degree, s.spacing, s.segments
        # The given state fixes the first Bernstein points; there the hull must be tight to let through
        # a start at a limit.
        first = (max(s.windows, 4),) + (1,) * (segments - 1)
        self.velocity = bernstein_rows(n - 1, p - 1, first) @ derivative_matrix(n, 1, h)
        self.acceleration = bernstein_rows(n - 2, p - 2, (1,) * segments) @ derivative_matrix(n, 2, h)
        self.jerk = bernstein_rows(n - 3, p - 3, (1,) * segments) @ derivative_matrix(n, 3, h)
        self.position = bernstein_rows(n, p, (s.windows,) * segments)
        if s.sampled:
            self.obstacle = basis_matrix(np.minimum(greville_offsets(n, p, h)[p:], segments * h), n, p, h)
        else:
            self.obstacle = self.position
        self.tau = np.arange(1, segments * s.windows + 1) * (h / s.windows)
        self.samples = tuple(basis_matrix(self.tau, n, p, h, k) for k in range(3))
        self._quadratic()
        self.linear = self._linear_rows()
        self.kept = [np.flatnonzero(np.abs(r.matrix[:, p:]).max(axis=1) > 1e-12) for r in self.linear]
        self._over_unknowns()
        parts = (self.velocity, self.acceleration, self.jerk, self.obstacle)
        self.evaluated = np.vstack((*parts, *self.samples))
        self.family_start = np.cumsum([0, *(len(part) for part in parts)])
        self.order = np.repeat(np.arange(3), [len(part) for part in parts[:3]])
        self.sampled_given = np.vstack(self.samples)[:, :p]
        self.edge = np.arange(segments * s.windows + 1) * (h / s.windows)
        self.fraction = np.arange(p + 1) / p
        self.window_row = np.arange(segments * s.windows)[:, None] * p + np.arange(p + 1)

    def _quadratic(self) -> None:
        """Exact integrals of the squared derivatives and of the squared distance (Gauss-Legendre)."""
        s = self.structure
        nodes, weights = np.polynomial.legendre.leggauss(s.degree + 1)
        tau = ((np.arange(s.segments)[:, None] + 0.5 * (nodes + 1.0)) * s.spacing).ravel()
        weight = np.tile(0.5 * s.spacing * weights, s.segments)
        self.gauss_tau = tau
        basis = [basis_matrix(tau, s.n, s.degree, s.spacing, k) for k in range(4)]
        w_acceleration, w_jerk, w_reference = s.weights
        parts = ((w_acceleration, 2), (w_jerk, 3), (w_reference, 0))
        self.hessian: Array = np.asarray(
            2.0 * sum(w * basis[k].T @ (weight[:, None] * basis[k]) for w, k in parts)
        )
        self.reference_weight = 2.0 * w_reference * weight
        self.pull = basis[0].T * self.reference_weight  # times the reference's positions at gauss_tau

    def _linear_rows(self) -> list[Rows]:
        matrices = (self.velocity, self.acceleration, self.jerk, self.obstacle)
        rows = [
            Rows(family, axis, kind, matrix)
            for axis in range(self.structure.axes)
            for family, kind, matrix in zip(FAMILIES, _KINDS[axis], matrices, strict=True)
        ]
        s = self.structure
        if s.ending is not None:  # s + v tau at the end, see repair.terminal.room
            place, rate = (basis_matrix([s.ending], s.n, s.degree, s.spacing, k) for k in range(2))
            rows.append(Rows("ending", 0, RowKind.STOP, place + STOP_TIMES[:, None] * rate))
        return rows

    def _over_unknowns(self) -> None:
        """The linear rows over the unknowns and over the given control points."""
        s, p = self.structure, self.structure.degree
        free, given = [], []
        kind: list[int] = []
        self.bounded: list[tuple[int, npt.NDArray[np.intp], slice]] = []
        self.stopping: tuple[npt.NDArray[np.intp], slice] | None = None
        for rows, kept in zip(self.linear, self.kept, strict=True):
            picked = rows.matrix[kept]
            if rows.kind == RowKind.STOP:
                self.stopping = kept, slice(len(kind), len(kind) + len(kept))
            if rows.kind == RowKind.PLACE:
                self.bounded.append((rows.axis, kept, slice(len(kind), len(kind) + len(kept))))
            free.append(np.kron(np.arange(s.axes) == rows.axis, picked[:, p:]))
            given.append(np.kron(np.arange(2) == rows.axis, picked[:, :p]))
            kind += [rows.kind] * len(kept)
        if s.lateral:
            moving = self.velocity[self.kept[0]]
            for sign in (-1.0, 1.0):
                free.append(np.kron([s.tangent, sign], moving[:, p:]))
                given.append(np.kron([s.tangent, sign], moving[:, :p]))
            kind += [RowKind.HEADING] * (2 * len(moving))
        self.free, self.given = np.vstack(free), np.vstack(given)
        self.linear_count = len(self.free)
        # Plain integers: NumPy indexes with them without a look at the enumeration.
        self.kind = np.concatenate((kind, np.repeat(_NONLINEAR[s.lateral], len(self.tau)))).astype(np.intp)

    def unknowns(self, points: Array) -> Array:
        """The unknowns (m,) among control points (n, 2)."""
        return points[self.structure.degree :, : self.structure.axes].T.ravel()

    def with_unknowns(self, points: Array, x: Array) -> Array:
        """Control points (n, 2) with the unknowns set."""
        changed = points.copy()
        changed[self.structure.degree :, : self.structure.axes] = x.reshape(self.structure.axes, -1).T
        return changed
