"""The types that travel through the house, in the order in which they are made.

SI units throughout, float64, arrays read-only. ``N`` obstacles, ``T`` time steps,
``K`` samples; the last axis of a two-column array is ``[s, l]``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property, lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

#: Floating point; made as float64 throughout (NumPy types many results as some floating dtype only).
Array = npt.NDArray[np.floating[Any]]
#: Points, or directions, of the plane as complex numbers x + iy: one call where coordinates take two.
Points = npt.NDArray[np.complexfloating[Any, Any]]

__all__ = [
    "Array",
    "Conflict",
    "Curve",
    "FrenetTrajectory",
    "LateralBounds",
    "Limits",
    "Maneuver",
    "Occupancy",
    "Passing",
    "Points",
    "Probe",
    "Reason",
    "RepairBackend",
    "RepairProblem",
    "SearchResult",
    "SearchStatus",
    "Side",
    "SolveResult",
    "SolveStatus",
    "Verdict",
    "Violation",
    "frozen",
]


def frozen(values: npt.ArrayLike) -> Array:
    """Copy ``values`` into a read-only float64 array."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class FrenetTrajectory:
    """A trajectory sampled in the Frenet frame.

    Attributes
    ----------
    t : (K,) array
        Time since the start of the scenario [s].
    position, velocity, acceleration, jerk : (K, 2) array
        ``[s, l]`` and its first three time derivatives [m, m/s, m/s², m/s³].
    """

    t: Array
    position: Array
    velocity: Array
    acceleration: Array
    jerk: Array

    def __len__(self) -> int:
        return len(self.t)

    def window(self, start: float, end: float) -> FrenetTrajectory:
        """The samples with ``start - 1e-9 <= t <= end + 1e-9``."""
        keep = (self.t >= start - 1e-9) & (self.t <= end + 1e-9)
        return FrenetTrajectory(
            self.t[keep], self.position[keep], self.velocity[keep],
            self.acceleration[keep], self.jerk[keep],
        )  # fmt: skip


@runtime_checkable
class Curve(Protocol):
    """A trajectory that can be evaluated at any time of its span (a spline, a Bernstein chain)."""

    @property
    def t_start(self) -> float:
        """Start of the span [s]."""
        ...

    @property
    def t_end(self) -> float:
        """End of the span [s]."""
        ...

    def sample(self, t: npt.ArrayLike) -> FrenetTrajectory:
        """Evaluate at the times ``t`` (K,); outside the span the curve is extended from its end state."""
        ...


@dataclass(frozen=True)
class Limits:
    """What the ego may do; every backend and the checker read the same numbers.

    Attributes
    ----------
    v_max : float
        Largest longitudinal speed [m/s]; the smallest is 0 (no reversing).
    v_lat : float
        Largest lateral speed in the Frenet frame [m/s].
    a_min, a_max : float
        Smallest (negative) and largest longitudinal acceleration [m/s²].
    a_lat : float
        Largest lateral acceleration [m/s²].
    a_total : float
        Radius of the friction circle [m/s²].
    j_lon, j_lat : float
        Largest magnitude of the longitudinal and lateral jerk [m/s³].
    curvature : float
        Largest curvature of the driven path [1/m], from the steering limit.
    """

    v_max: float
    v_lat: float
    a_min: float
    a_max: float
    a_lat: float
    a_total: float
    j_lon: float
    j_lat: float
    curvature: float


@dataclass(frozen=True)
class LateralBounds:
    """Where the ego's *reference point* may be sideways, tabulated over s.

    ``right[k] <= l <= left[k]`` at ``s[k]``; half the ego's width is already taken off.
    """

    s: Array
    right: Array
    left: Array

    def at(self, s: npt.ArrayLike) -> tuple[Array, Array]:
        """Right and left bound at ``s`` (any shape), linear in between, constant beyond the ends."""
        query = np.asarray(s, dtype=np.float64)
        return np.interp(query, self.s, self.right), np.interp(query, self.s, self.left)


_KEPT = 1000  # times of a query whose places among the steps are kept


@lru_cache(maxsize=64)
def _steps_at(
    times: bytes, start: float, step: float, count: int
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array | None, npt.NDArray[np.bool_] | None]:
    """Where times lie among equally spaced steps: the steps below and above, and the weight of the upper one.

    None for the weights where all times are on a step, and for which are outside where none is. Searches
    ask for the same times over and over.
    """
    where = (np.frombuffer(times) - start) / step
    nearest = np.rint(where)
    off_step = np.abs(where - nearest) >= 1e-6
    where = np.where(off_step, where, nearest)
    below = np.floor(where)
    low = below.astype(np.intp)
    # On a step its own row counts alone: the next one may be NaN.
    high = np.where(off_step, low + 1, low)
    weight, outside = (where - below)[:, None], (where < 0) | (where > count - 1)
    for kept in (low, high, weight, outside):
        kept.setflags(write=False)
    return low, high, weight if off_step.any() else None, outside if outside.any() else None


@dataclass(frozen=True)
class Occupancy:
    """Obstacles as boxes in (s, l, t), inflated so that the ego is a point.

    Between two steps the box is the linear interpolation of its neighbours. An obstacle that is
    not there at a step has NaN in its row.

    Attributes
    ----------
    t : (T,) array
        Times of the steps [s], starting at 0, equally spaced.
    ids : (N,) int array
        CommonRoad obstacle ids.
    lower, upper : (N, T, 2) array
        Corners ``[s, l]`` of the boxes [m], S_offset and L_offset included.
    static : (N,) bool array
        The box never moves.
    """

    t: Array
    ids: npt.NDArray[np.int64]
    lower: Array
    upper: Array
    static: npt.NDArray[np.bool_]

    def at(self, times: npt.ArrayLike) -> tuple[Array, Array]:
        """Boxes (N, K, 2) at ``times`` (K,); NaN where an obstacle is absent or the time is outside."""
        query = np.asarray(times, dtype=np.float64)
        step = self.t.item(1) - self.t.item(0) if len(self.t) > 1 else 1.0
        look_up = _steps_at if query.size <= _KEPT else _steps_at.__wrapped__
        low, high, weight, outside = look_up(query.tobytes(), self.t.item(0), step, len(self.t))
        lower, upper = self.lower.take(low, axis=1, mode="clip"), self.upper.take(low, axis=1, mode="clip")
        if weight is not None:
            lower += weight * (self.lower.take(high, axis=1, mode="clip") - lower)
            upper += weight * (self.upper.take(high, axis=1, mode="clip") - upper)
        if outside is not None:
            lower[:, outside] = np.nan
            upper[:, outside] = np.nan
        return lower, upper

    @cached_property
    def swept(self) -> Array:
        """What each box spans between two steps, ``[s_max, -s_min, l_max, -l_min]`` (4, N, T - 1).

        NaN where the box is at neither step; where there is one step only, the box itself (4, N, 1).
        The signs let one comparison tell what is near.
        """
        first, second = (slice(-1), slice(1, None)) if len(self.t) > 1 else (slice(None), slice(None))
        lower = np.fmin(self.lower[:, first], self.lower[:, second])
        upper = np.fmax(self.upper[:, first], self.upper[:, second])
        return frozen([upper[..., 0], -lower[..., 0], upper[..., 1], -lower[..., 1]])

    def select(self, keep: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Occupancy:
        """The obstacles that ``keep`` names."""
        rows = keep.nonzero()[0] if keep.dtype == np.bool_ else keep
        lower, upper = self.lower.take(rows, axis=0), self.upper.take(rows, axis=0)
        return Occupancy(self.t, self.ids.take(rows), lower, upper, self.static.take(rows))

    def __len__(self) -> int:
        return len(self.ids)


class Maneuver(str, Enum):
    """What a repaired trajectory does about the conflict, named as people would."""

    # That of Enum hashes the member's name, in Python, and differs from that of the equal string.
    __hash__ = str.__hash__

    YIELD = "yield"
    GO_AHEAD = "go_ahead"
    LEFT = "left"
    RIGHT = "right"


class Side(int, Enum):
    """On which side of an obstacle's box the ego stays."""

    BEHIND = 0
    AHEAD = 1
    LEFT = 2
    RIGHT = 3


@dataclass(frozen=True)
class Passing:
    """One way past the obstacles: a coarse guide, and the side it takes of each.

    Attributes
    ----------
    maneuver : Maneuver
    guide : FrenetTrajectory
        The coarse trajectory that shows the way; an initial guess, not a result.
    sides : (N, K) int array, or callable
        What ``side`` is; or makes it, if it is asked for: many backends take the guide alone.
    cost : float
        The guide's cost; smaller is gentler.
    open : bool
        Whether the guide keeps clear of every box and within the limits; if not, it comes closest to that.
    """

    maneuver: Maneuver
    guide: FrenetTrajectory
    sides: npt.NDArray[np.int8] | Callable[[], npt.NDArray[np.int8]]
    cost: float
    open: bool = True

    @cached_property
    def side(self) -> npt.NDArray[np.int8]:
        """:class:`Side` of every obstacle at each guide time (N, K); constant between guide times."""
        return self.sides() if callable(self.sides) else self.sides

    def side_at(self, times: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """Side of every obstacle (N, K') at ``times``: that of the nearest guide time."""
        query = np.asarray(times, dtype=np.float64)
        grid = self.guide.t
        step = grid[1] - grid[0] if len(grid) > 1 else 1.0
        index = np.rint((query - grid[0]) / step).astype(np.intp)
        return np.asarray(self.side.take(index, axis=1, mode="clip"))


@dataclass(frozen=True)
class RepairProblem:
    """Everything a backend may know about one repair: follow until ``t_rep``, evade until ``t_end``.

    Attributes
    ----------
    reference : Curve
        The reference trajectory over [0, t_end].
    t_rep, t_end : float
        Time-to-repair and end of the repair [s].
    start : (3, 2) array
        Position, velocity and acceleration ``[s, l]`` of the reference at ``t_rep``.
    occupancy : Occupancy
        Obstacles (inflated), as far as they matter; the order is that of ``passing.side``.
    bounds : LateralBounds
        Lateral room of the reference point.
    limits : Limits
    clearance : float
        The paper's s_f [m], wanted beyond the inflated box by soft backends; hard backends use
        ``margin``.
    margin : float
        Extra distance [m] a hard backend keeps from the inflated box.
    passing : Passing or None
        The way past the obstacles to take; None where nothing is in the way.
    curvature_s, curvature : (M,) array
        Curvature of the frame's axis [1/m] over s, linear in between.
    dt : float
        The scenario's time step [s].
    lateral : bool
        Whether the backend may move sideways; if not, l stays on the reference.
    strict : bool
        No part of the margin may be given up, whatever the checker says of the true rectangles.
    """

    reference: Curve
    t_rep: float
    t_end: float
    start: Array
    occupancy: Occupancy
    bounds: LateralBounds
    limits: Limits
    clearance: float
    margin: float
    passing: Passing | None
    curvature_s: Array
    curvature: Array
    dt: float
    lateral: bool = True
    strict: bool = False

    def curvature_at(self, s: npt.ArrayLike) -> Array:
        """Curvature of the frame's axis [1/m] at ``s``."""
        return np.asarray(np.interp(np.asarray(s, dtype=np.float64), self.curvature_s, self.curvature))


class SolveStatus(str, Enum):
    """How a solve ended; ``.sentence`` says it for people."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    NO_CORRIDOR = "no_corridor"
    ITERATION_LIMIT = "iteration_limit"
    TIME_LIMIT = "time_limit"
    NUMERICAL_ERROR = "numerical_error"
    UNAVAILABLE = "unavailable"

    @property
    def sentence(self) -> str:
        """What the status means, in a sentence."""
        return {
            "solved": "the solver converged",
            "infeasible": "the optimisation problem has no solution",
            "no_corridor": "no convex driving corridor connects the start to the horizon",
            "iteration_limit": "the iteration limit was reached before convergence",
            "time_limit": "the time limit was reached before convergence",
            "numerical_error": "the solver failed numerically",
            "unavailable": "the solver is not installed",
        }[self.value]


@dataclass(frozen=True)
class SolveResult:
    """What a backend found; it does not judge feasibility, the checker does.

    Attributes
    ----------
    status : SolveStatus
    curve : Curve or None
        The repaired part over [t_rep, t_end]. Present whenever the solver left something usable,
        also with ``iteration_limit``.
    objective : float
        Final objective (nan where there is none).
    iterations : int
    build_time, solve_time : float
        Wall time [s].
    detail : str
        The solver's own word, or why there is no curve.
    residuals : mapping
        Largest violation of each constraint family, recomputed from the problem data (0: kept).
    stages : mapping
        Intermediate curves by name (``deformation``, ``refinement``).
    """

    status: SolveStatus
    curve: Curve | None = None
    objective: float = float("nan")
    iterations: int = 0
    build_time: float = 0.0
    solve_time: float = 0.0
    detail: str = ""
    residuals: Mapping[str, float] = field(default_factory=dict)
    stages: Mapping[str, Curve] = field(default_factory=dict)


class RepairBackend(Protocol):
    """The seam: a planner from a time-to-repair on. Never raises because a problem is infeasible."""

    name: str

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """Solve one repair; raises :class:`repair.errors.BackendError` for a malformed problem only."""
        ...


class Reason(str, Enum):
    """Why a trajectory is not feasible."""

    COLLISION = "collision"
    OFF_ROAD = "off_road"
    KINEMATICS = "kinematics"
    LIMITS = "limits"
    MARGIN = "margin"
    CHECKER_ERROR = "checker_error"
    NOT_SOLVED = "not_solved"
    NO_CORRIDOR = "no_corridor"
    NO_PASSAGE = "no_passage"


@dataclass(frozen=True)
class Violation:
    """One reason, when it first holds [s], and the particulars in words."""

    reason: Reason
    time: float
    detail: str = ""


@dataclass(frozen=True)
class Verdict:
    """The checker's answer."""

    violations: tuple[Violation, ...] = ()

    @property
    def ok(self) -> bool:
        """No violation of any kind."""
        return not self.violations

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons' words, in the order of checking."""
        return tuple(v.reason.value for v in self.violations)

    @property
    def first_time(self) -> float:
        """Time of the earliest violation [s], inf where there is none."""
        return min((v.time for v in self.violations), default=float("inf"))


@dataclass(frozen=True)
class Conflict:
    """Where the reference stops being drivable.

    Attributes
    ----------
    time : float
        TTC [s]: first scenario step at which the reference violates something; inf if never.
    kind : str
        ``margin`` (inflated occupancy entered), ``collision``, ``off_road``, ``kinematics`` or
        ``none``.
    obstacle_id : int or None
    contact_time : float
        First contact of the true rectangles [s], inf if never.
    contact_id : int or None
    from_behind : bool
        The obstacle strikes the ego from behind.
    """

    time: float
    kind: str = "none"
    obstacle_id: int | None = None
    contact_time: float = float("inf")
    contact_id: int | None = None
    from_behind: bool = False


@dataclass(frozen=True)
class Probe:
    """One visited t_rep: what was solved, with which margin to the boxes [m], and what the checker said."""

    t_rep: float
    solve: SolveResult
    verdict: Verdict
    maneuver: Maneuver | None = None
    check_time: float = 0.0
    tried: tuple[str, ...] = ()
    margin: float | None = None

    @property
    def feasible(self) -> bool:
        """Whether the repaired trajectory passed every check."""
        return self.solve.curve is not None and self.verdict.ok


class SearchStatus(str, Enum):
    """How a search ended."""

    FOUND = "found"
    NO_CONFLICT = "no_conflict"
    ALREADY_COLLIDING = "already_colliding"
    NONE_FEASIBLE = "none_feasible"
    BUDGET_EXHAUSTED = "budget_exhausted"

    @property
    def sentence(self) -> str:
        """What the status means, in a sentence."""
        return {
            "found": "a repaired trajectory passed every check",
            "no_conflict": "the reference can be followed to its end",
            "already_colliding": "the ego is in conflict at the very start",
            "none_feasible": "no tested time-to-repair has a feasible repair",
            "budget_exhausted": "the time limit ended the search before any feasible repair was found",
        }[self.value]


@dataclass(frozen=True)
class SearchResult:
    """The answer of Algorithm 1.

    Attributes
    ----------
    status : SearchStatus
    conflict : Conflict
    f_ttr : float or None
        Last verified t_rep [s]; inf without a conflict; None where nothing was verified.
    curve : Curve or None
        The repaired part from ``f_ttr`` on; None without a repair.
    probes : tuple of Probe
        In the order of visiting.
    complete : bool
        Whether the rule ran to its end (False: interrupted or out of time).
    wall_time : float
        Wall time of the search [s].
    """

    status: SearchStatus
    conflict: Conflict
    f_ttr: float | None
    curve: Curve | None
    probes: tuple[Probe, ...] = ()
    complete: bool = True
    wall_time: float = 0.0

    @property
    def best(self) -> Probe | None:
        """The probe behind ``f_ttr``."""
        feasible = [p for p in self.probes if p.feasible]
        return max(feasible, key=lambda p: p.t_rep) if feasible else None

    def __iter__(self) -> Iterator[Probe]:
        return iter(self.probes)
