"""Direct shooting: controls are drawn, driven by the vehicle's model, and drawn again around the best.

The cross-entropy method (Rubinstein, *The cross-entropy method for combinatorial and continuous
optimization*, Methodology and Computing in Applied Probability 1, 1999; for trajectories Kobilarov,
*Cross-entropy motion planning*, IJRR 31, 2012) over piecewise constant acceleration and steering rate. The
limits are kept by construction: what is left to minimise is how deep a trajectory reaches into obstacles and
beyond the road. It needs no guide and no side of passing: it begins with a family of manoeuvres and follows
the best of them side by side. Its acceleration may jump, at t_rep too, as an input of the vehicle may.
"""

from __future__ import annotations

import time

from repair.backend.base import Capabilities, Configuration, SolveResult, SolveStatus
from repair.curves.base import Curve
from repair.deadline import OutOfTime, until
from repair.errors import BackendError
from repair.problem.problem import RepairProblem
from repair.solvers.shooting.plans import ALONG, FREE, Plan
from repair.solvers.shooting.settings import ShootingConfig
from repair.solvers.shooting.shots import Shot
from repair.solvers.shooting.task import Task

__all__ = ["ShootingBackend", "make"]


class ShootingBackend:
    """Cross-entropy search over the controls of a single-track vehicle.

    Parameters
    ----------
    config : ShootingConfig, optional
    """

    name = "shooting"
    capabilities = Capabilities(own_way=True, jumps=True)

    def __init__(self, config: ShootingConfig | None = None) -> None:
        self.config = config or ShootingConfig()
        if self.config.elite > self.config.population:
            raise BackendError(
                f"shooting.elite {self.config.elite} are the best of shooting.population "
                f"{self.config.population}, and cannot be more"
            )

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """Along the path of the reference first, and then anywhere, where the problem allows it.

        The manoeuvres that either search begins with are looked at before anything is drawn around them.

        Raises
        ------
        repair.errors.BackendError
            Never for a well-formed problem.
        """
        begin = time.perf_counter()
        task = Task(problem, self.config)
        built = time.perf_counter()
        best: tuple[Plan, Shot] | None = None
        try:
            with until(None if time_limit is None else begin + time_limit):
                plans = (ALONG, FREE) if problem.lateral else (ALONG,)
                for plan, shot in task.shots(plans):
                    if shot.miss <= 0.0:
                        return SolveResult(
                            SolveStatus.SOLVED, task.curve(plan, shot), shot.cost, task.iterations,
                            built - begin, time.perf_counter() - built, residuals={"excess": shot.miss},
                        )  # fmt: skip
                    if best is None or shot.miss < best[1].miss:
                        best = plan, shot
                assert best is not None
                closest = task.closest(*best)
        except OutOfTime:
            return SolveResult(
                SolveStatus.TIME_LIMIT, iterations=task.iterations, build_time=built - begin,
                solve_time=time.perf_counter() - built, detail="the time limit was reached",
            )  # fmt: skip
        return SolveResult(
            SolveStatus.INFEASIBLE, iterations=task.iterations, build_time=built - begin,
            solve_time=time.perf_counter() - built,
            detail=f"no trajectory was found; the closest reaches {closest.miss:.2f} m too far",
            residuals={"excess": closest.miss}, closest=closest,
        )  # fmt: skip


def make(config: Configuration) -> ShootingBackend:
    """The backend as the configuration describes it."""
    return ShootingBackend(config.section("shooting"))
