"""The seam between search and backends: what a backend is given, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from repair.curves.base import Curve
from repair.problem.problem import RepairProblem

__all__ = ["RepairBackend", "SolveResult", "SolveStatus"]


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
