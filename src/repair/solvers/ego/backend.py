"""The paper's backend: soft penalties on a uniform B-spline, deformation then refinement.

Deformation (Sec. IV-C) minimises J = lambda_s J_s + lambda_c J_c + lambda_d J_d with the start of
the curve fixed and its end free; refinement (Sec. IV-D) minimises J' = lambda_s J_s + lambda_d J_d
+ lambda_f J_f with both ends fixed and the duration kept (T' = T). Both costs are convex: there is
one minimum, and Newton steps or the paper's L-BFGS (``ego.solver``) lead to it. The stages are
:mod:`repair.solvers.ego.stages`; here they are put together.
"""

from __future__ import annotations

import time

import numpy as np

from repair.arrays import Array
from repair.backend.base import Capabilities, Configuration, SolveResult, SolveStatus
from repair.curves.base import Curve
from repair.curves.bases import fitted_knots
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.deadline import OutOfTime
from repair.problem.lateral import LastPath, kept_path
from repair.problem.problem import RepairProblem
from repair.solvers.ego.cost_structure import SIZES, Sizes
from repair.solvers.ego.minimise import Minimiser, Minimum
from repair.solvers.ego.pairs import closest_distance
from repair.solvers.ego.settings import EgoConfig
from repair.solvers.ego.stages import Stages

__all__ = ["EgoBackend", "make"]


def _standing(points: Array, degree: int) -> Array:
    """Stand instead of rolling back: what is left of a reversing motion becomes a standstill.

    Non-decreasing control points make the speed non-negative on the whole curve (convex hull).
    """
    result = points.copy()
    np.maximum.accumulate(points[degree - 1 :, 0], out=result[degree - 1 :, 0])
    result.setflags(write=False)
    return result


class EgoBackend:
    """Deformation and refinement (paper, Sec. IV; after EGO-Planner, Zhou et al. 2021).

    Parameters
    ----------
    config : EgoConfig
        Weights and solver settings.
    degree : int
        Degree of the B-spline.
    spacing : float
        Largest knot spacing [s]: the knots are fitted to the duration of the repair.
    minimise : Minimiser, optional
        How the stages' costs are minimised; as ``config.solver`` says where it is not given.
    sizes : Sizes
        Up to which sizes a cost takes the forms for small problems: a matter of the machine.
    """

    name = "ego"
    capabilities = Capabilities(keeps_path=True)

    def __init__(
        self,
        config: EgoConfig | None = None,
        *,
        degree: int = 3,
        spacing: float = 0.4,
        minimise: Minimiser | None = None,
        sizes: Sizes = SIZES,
    ) -> None:
        self.config = config or EgoConfig()
        self.degree = degree
        self.spacing = spacing
        self.stages = Stages(self.config, degree, minimise, sizes)
        self._path_of = LastPath()
        self._fitted: tuple[Curve, UniformBSpline] | None = None

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """Deform and refine; the result is soft and it is for the checker to judge it.

        Raises
        ------
        repair.errors.BackendError
            Never for a well-formed problem.
        """
        begin = time.perf_counter()
        deadline = begin + time_limit if time_limit is not None else None
        n, spacing = fitted_knots(problem.t_end - problem.t_rep, self.spacing, self.degree)
        initial = self._initial(problem.reference, problem.t_rep, n, spacing)
        built = time.perf_counter()
        try:
            deformed, pairs, cap, rounds = self.stages.deform(problem, initial, deadline)
            refined = self.stages.refine(problem, deformed, spacing, cap, deadline)
            near = closest_distance(pairs, refined.points) if self.config.guard else 0.0
            if near < 0.0 and near < closest_distance(pairs, deformed.points):
                refined = deformed
        except OutOfTime:
            now = time.perf_counter()
            return SolveResult(
                SolveStatus.TIME_LIMIT, build_time=built - begin, solve_time=now - built,
                detail=f"time limit of {time_limit:g} s",
            )  # fmt: skip
        curves = {"deformation": self._driven(problem, deformed, spacing)}
        curves["refinement"] = (
            curves["deformation"] if refined is deformed else self._driven(problem, refined, spacing)
        )
        converged = deformed.converged and refined.converged
        return SolveResult(
            status=SolveStatus.SOLVED if converged else SolveStatus.ITERATION_LIMIT,
            curve=curves["refinement"],
            objective=refined.cost,
            iterations=deformed.iterations + refined.iterations,
            build_time=built - begin,
            solve_time=time.perf_counter() - built,
            detail=f"deformation {deformed.iterations} iterations in {rounds} round(s), "
            f"refinement {refined.iterations}",
            stages=curves,
        )

    def _initial(self, reference: Curve, t_rep: float, n: int, spacing: float) -> UniformBSpline:
        """The reference from t_rep on; the last answer is kept, as sides are asked one after the other."""
        known = self._fitted  # read once: another thread may put its own there
        if known is not None and known[0] is reference:
            fitted = known[1]
            if (fitted.t_start, len(fitted.points), fitted.spacing) == (t_rep, n, spacing):
                return fitted
        fitted = fit_to_curve(reference, t_rep, n, self.degree, spacing)
        self._fitted = reference, fitted
        return fitted

    def _driven(self, problem: RepairProblem, minimum: Minimum, spacing: float) -> UniformBSpline:
        points = _standing(minimum.points, self.degree)
        if not problem.lateral:
            points = kept_path(problem, points, self.degree, spacing, self._path_of)
            points.setflags(write=False)
        return UniformBSpline(problem.t_rep, spacing, self.degree, points)


def make(config: Configuration) -> EgoBackend:
    """The backend as the configuration describes it."""
    return EgoBackend(config.section("ego"), degree=config.repair.degree, spacing=config.repair.spacing)
