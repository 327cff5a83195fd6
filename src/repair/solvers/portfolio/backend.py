"""Several backends as one (``backend: portfolio``).

The search makes one search of each member (:func:`repair.search.several.search_with`). Asked for a single
problem, outside of a search, the first curve that a member answers is the answer.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

from repair.backend.base import Capabilities, Configuration, RepairBackend, SolveResult, SolveStatus
from repair.curves.base import Curve
from repair.errors import BackendError
from repair.problem.problem import RepairProblem

__all__ = ["PortfolioBackend", "make"]


class PortfolioBackend:
    """The members that :attr:`Capabilities.members` makes."""

    name = "portfolio"
    capabilities = Capabilities()

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """The first curve that a member answers, or the first answer where none has a curve.

        Raises
        ------
        repair.errors.BackendError
            Whatever a member raises.
        """
        begin, first = time.perf_counter(), None
        for name, member in self._members().items():
            left = None if time_limit is None else max(time_limit - (time.perf_counter() - begin), 0.0)
            answer = member.solve(problem, warm_start=warm_start, time_limit=left)
            if answer.curve is not None:
                return replace(answer, detail=f"{name}: {answer.detail}" if answer.detail else name)
            first = first or replace(answer, detail=f"{name}: {answer.detail}")
        return first or SolveResult(SolveStatus.UNAVAILABLE, detail="portfolio.members is empty")

    def _members(self) -> Mapping[str, RepairBackend]:
        if self.capabilities.members is None:
            raise BackendError("a portfolio is made by its name: make_backend('portfolio', config)")
        return self.capabilities.members()


def make(config: Configuration) -> PortfolioBackend:
    """The backend as the configuration describes it.

    Raises
    ------
    BackendError
        If it has no members, or is one of them.
    """
    members = config.section("portfolio").members
    if not members or "portfolio" in members:
        raise BackendError(f"portfolio.members is {members}; it needs at least one, and none of itself")
    return PortfolioBackend()
