"""The seam between search and backends: what a backend is given, and what it answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from repair.curves.base import Curve
from repair.problem.problem import RepairProblem
from repair.problem.settings import RepairConfig

__all__ = [
    "BackendSpec",
    "Capabilities",
    "Closest",
    "Configuration",
    "RepairBackend",
    "SolveResult",
    "SolveStatus",
]


class SolveStatus(str, Enum):
    """How a solve ended; ``.sentence`` says it for people.

    Attributes
    ----------
    SOLVED
        The solver converged.
    INFEASIBLE
        The problem has no solution.
    NO_CORRIDOR
        No convex driving corridor connects the start to the horizon.
    ITERATION_LIMIT, TIME_LIMIT
        It came before convergence.
    NUMERICAL_ERROR
        The solver failed numerically.
    UNAVAILABLE
        The solver is not installed.
    """

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
class Capabilities:
    """What a backend is able to do; the search asks nothing else about it.

    Attributes
    ----------
    relaxes : bool
        It keeps ``problem.margin`` whatever that costs. Where nothing is feasible, the search asks again
        with another acceleration in ``problem.start``, as brakes may jump, and with the smaller margins of
        ``repair.relax``.
    keeps_hull : bool
        Its curves keep limits and margin at every time, by the hull of their control points, and the
        residual ``obstacles`` says how far they are from it.
    uses_warm_start : bool
        A neighbouring curve is of use to it; others are handed none.
    own_way : bool
        It finds its own way past the obstacles: it is asked once for each t_rep, with all the room there is,
        without a guide (``problem.passing`` is None), and with the true shapes (``problem.shapes``).
    keeps_path : bool
        Where a problem is not ``lateral``, its curves stay on the path of the reference, to some centimetres.
    jumps : bool
        The acceleration of its curves may jump, at t_rep too, as an input of the vehicle's model may.
    helpers : mapping of str to callable
        Each makes a backend that the search asks where this one has found nothing, one after the other. If
        the checker accepts a curve of it, this one is asked again, with that curve as guide and
        ``warm_start``.
    members : callable or None
        Makes the backends that it is made of, by name: the search makes a search of each.
    fallbacks : callable or None
        Makes the backends that the search asks, one after the other, where it ends without a repair.
    """

    relaxes: bool = False
    keeps_hull: bool = False
    uses_warm_start: bool = False
    own_way: bool = False
    keeps_path: bool = False
    jumps: bool = False
    helpers: Mapping[str, Callable[[], RepairBackend]] = field(default_factory=dict)
    members: Callable[[], Mapping[str, RepairBackend]] | None = None
    fallbacks: Callable[[], Mapping[str, RepairBackend]] | None = None


@dataclass(frozen=True)
class Closest:
    """The curve that comes closest where there is none that keeps the margin.

    Attributes
    ----------
    curve : Curve
        Keeps everything but the margin.
    miss : float
        By how much it misses the margin [m].
    residuals : mapping
        Its own, as :class:`SolveResult` has them.
    what : str
        What it is, for people.
    instead : Closest or None
        Another one, where the checker rejects this one too.
    """

    curve: Curve
    miss: float
    residuals: Mapping[str, float] = field(default_factory=dict)
    what: str = "that curve"
    instead: Closest | None = None


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
        Final objective, a number without unit (nan where there is none).
    iterations : int
    build_time, solve_time : float
        Wall time [s].
    detail : str
        The solver's own word, or why there is no curve.
    residuals : mapping
        Largest violation of each constraint family, recomputed from the problem data (0: kept).
        The names are the backend's own; whoever reads them may not rely on one being there.
    stages : mapping
        Intermediate curves by name (``deformation``, ``refinement``).
    closest : Closest or None
        What the checker may accept where there is no ``curve`` or that one is rejected: boxes in (s, l) are
        wider than the vehicles in them.
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
    closest: Closest | None = None


class RepairBackend(Protocol):
    """The seam: a planner from a time-to-repair on. Never raises because a problem is infeasible.

    Attributes
    ----------
    name : str
        By which it is registered.
    capabilities : Capabilities
        What it is able to do.
    """

    name: str
    capabilities: Capabilities

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """Solve one repair; raises :class:`repair.errors.BackendError` for a malformed problem only.

        Parameters
        ----------
        problem : RepairProblem
        warm_start : Curve, optional
            The last curve that was verified, of an earlier t_rep. One that begins at ``problem.t_rep`` was
            verified there, as another backend's: ``closest`` may then be what comes nearest to it.
        time_limit : float, optional
            [s].

        Returns
        -------
        SolveResult
            A curve, or why there is none. Whether it can be driven is for the checker to say.
        """
        ...


class Configuration(Protocol):
    """What a backend's factory sees of the configuration."""

    @property
    def repair(self) -> RepairConfig:
        """The repair problem, the same for every backend."""
        ...

    @property
    def fallback(self) -> Sequence[str] | None:
        """Names of the backends that are asked where a search ends without a repair; None: as registered."""
        ...

    def section(self, name: str) -> Any:
        """The section of a backend: an instance of its settings' dataclass."""
        ...


@dataclass(frozen=True)
class BackendSpec:
    """A backend as it is registered: how it is made, and what may be set.

    Attributes
    ----------
    factory : callable or str
        Called with the :class:`Configuration`, gives a :class:`RepairBackend`; or ``"module:name"``.
    settings : type or None
        Dataclass of the backend's own section, with fields made by :func:`repair.settings.setting`. The
        keys are ``<name of the backend>.<field>``.
    needs : tuple of str
        Packages without which it cannot be made.
    says : str
        One line for people.
    helpers : tuple of str, or str
        Names of the backends that :attr:`Capabilities.helpers` make; or the field of its settings that lists
        them.
    usual_helpers : tuple of str
        Who they are where that field is null. In the cycles of a :class:`repair.Repairer` it is nobody then.
    fallbacks : tuple of str
        Names of the backends that :attr:`Capabilities.fallbacks` makes where nobody says otherwise.
    members : str
        Field of its settings that names the backends that :attr:`Capabilities.members` makes; empty for none.
    """

    factory: Callable[[Any], RepairBackend] | str
    settings: type | None = None
    needs: tuple[str, ...] = ()
    says: str = "registered by the program"
    helpers: tuple[str, ...] | str = ()
    usual_helpers: tuple[str, ...] = ()
    fallbacks: tuple[str, ...] = ()
    members: str = ""
