"""The hard-constraint backend: the same uniform B-spline as an NLP, solved by IPOPT or SQP.

What a curve that this backend calls solved keeps, recomputed from the solution with NumPy:

* speed (0 to v_max), lateral speed, s'' and l'', s''' and l''', and the direction of travel
  (|l'| <= tan(heading) s'): the Bernstein points of every piece are inside, so the curve is, at
  *every* time from t_rep on;
* obstacles, ``obstacles: hull``: for every window (at most one scenario step long, or ``WINDOW``,
  whichever is longer: the cost grows with their number) the Bernstein points lie beyond the moving
  edge of the inflated box, so the curve is clear at *every* time until t_end, the box moving linearly
  between scenario steps (:mod:`repair.solvers.casadi.separation`);
  ``obstacles: sampled``: the curve is clear at the control points' Greville times, and only there;
* the road's edges: as ``hull``, with the narrowest width over the s the curve covers in a window;
* accelerations in the plane (friction circle, longitudinal and lateral limit), the curvature of the
  driven path and the ends of the body against the road's edges, the axis' curvature included: at the
  ends of all windows, and only there. The friction circle is used to 99.5 %, which has kept it at
  every millisecond as well.

Sides of passing are the guide's, window by window, unless those contradict the limits; then the curve
that misses the obstacles by the least is asked for its sides. The axis' curvature and the road's width
over s enter as lines around the last path; the NLP is solved again around its own solution, s within a
trust region, until the exact values agree.

The convex QP of all linear constraints is solved first, by daqp. Where it has no solution there is
none; where its solution keeps the nonlinear rows as well, it is the optimum of all of them, and no
other solver is asked.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np

from repair.arrays import Array, frozen
from repair.backend.base import Capabilities, Closest, Configuration, SolveResult, SolveStatus
from repair.backend.stopping import able_to_stop
from repair.curves.base import Curve
from repair.curves.bases import n_points_for
from repair.curves.bspline import UniformBSpline
from repair.curves.fitting import fit_to_curve
from repair.deadline import OutOfTime, until
from repair.errors import BackendError
from repair.problem.lateral import LastPath
from repair.problem.problem import RepairProblem
from repair.solvers.casadi.instance import ROAD_SLACK, Instance, lay_out, overhang_of
from repair.solvers.casadi.model import TOLERANCE, Model, build_model, status_of
from repair.solvers.casadi.residuals import (
    largest_violation,
    require_whole,
    residuals_of,
    start_violation,
    worst_family,
)
from repair.solvers.casadi.rows import Structure
from repair.solvers.casadi.separation import Separation, separate
from repair.solvers.casadi.settings import CasadiConfig
from repair.solvers.casadi.sides import keeping_to, no_nearer, open_sides
from repair.timegrid import INSTANT

__all__ = ["WINDOW", "CasadiBackend", "make"]

#: A window is no shorter than this [s]: steps of the scenario that fall inside are covered by its line.
WINDOW = 0.1
# An SQP that converges does so in 23 iterations mostly: of 1,272 (both folders, several grids and horizons)
# the longest took 73, and one that does not goes on for as long as it may. Others may take 200.
_ITERATIONS = {"sqpmethod": 80}
_TRUST = 8.0  # [m] that s may move between the first two rounds; half of it in the next, and so on


class CasadiBackend:
    """Hard constraints through CasADi.

    The search may ask again with a smaller margin, see ``repair.relax``.

    Parameters
    ----------
    config : CasadiConfig
    degree : int
        Degree of the B-spline.
    spacing : float
        Knot spacing [s].
    """

    name = "casadi"
    capabilities = Capabilities(relaxes=True, keeps_hull=True, keeps_path=True, uses_warm_start=True)

    def __init__(self, config: CasadiConfig | None = None, *, degree: int = 3, spacing: float = 0.2) -> None:
        self.config = config or CasadiConfig()
        self.degree = degree
        self.spacing = spacing
        self._path_of = LastPath()

    def solve(
        self, problem: RepairProblem, *, warm_start: Curve | None = None, time_limit: float | None = None
    ) -> SolveResult:
        """Solve one repair.

        Raises
        ------
        repair.errors.BackendError
            If the problem is malformed (no time left between t_rep and t_end, states not finite).
        """
        begin = time.perf_counter()
        require_whole(problem)
        deadline = None if time_limit is None else begin + time_limit
        try:
            with until(deadline):
                model = build_model(self.structure(problem, timed=time_limit is not None))
                instance, points = lay_out(problem, model, path_of=self._path_of)
                built, before = time.perf_counter(), model.build_time
                result = self._rounds(instance, points, warm_start, deadline, time_limit)
                result = able_to_stop(result, problem, partial(self._bounded, problem, deadline, time_limit))
                if warm_start is not None and abs(warm_start.t_start - problem.t_rep) <= INSTANT:
                    result = self._nearest(result, problem, model, warm_start, deadline)
        except OutOfTime as over:
            spent = time.perf_counter() - begin
            return SolveResult(SolveStatus.TIME_LIMIT, build_time=spent, detail=_cut(time_limit, over))
        except (BackendError, ImportError) as error:
            return SolveResult(
                SolveStatus.UNAVAILABLE, build_time=time.perf_counter() - begin, detail=str(error)
            )
        late = model.build_time - before  # the NLP is made when it is first needed
        spent = time.perf_counter() - built
        return replace(result, build_time=built - begin + late, solve_time=spent - late)

    def structure(self, problem: RepairProblem, *, timed: bool = False, bounded: bool = False) -> Structure:
        """The structure of a problem: what its model depends on.

        Parameters
        ----------
        problem : RepairProblem
        timed : bool
            The solver can be stopped in time.
        bounded : bool
            The end has to leave room for a stop.
        """
        c = self.config
        return Structure(
            n=n_points_for(problem.t_end - problem.t_rep, self.spacing, self.degree),
            degree=self.degree,
            spacing=self.spacing,
            windows=max(1, int(np.ceil(self.spacing / max(problem.dt, WINDOW) - 1e-9))),
            lateral=problem.lateral,
            sampled=c.obstacles == "sampled",
            weights=(c.w_acceleration, c.w_jerk, c.w_reference),
            solver=c.solver,
            max_iterations=c.max_iterations or _ITERATIONS.get(c.solver, 200),
            tolerance=c.tolerance,
            tangent=float(np.tan(c.heading)),
            overhang=overhang_of(problem) if c.overhang is None else c.overhang,
            timed=timed,
            ending=round(problem.t_end - problem.t_rep, 9) if bounded else None,
        )

    def _bounded(
        self, problem: RepairProblem, deadline: float | None, time_limit: float | None, within: Array
    ) -> SolveResult:
        """As :meth:`_rounds`, with the end within bounds."""
        try:
            model = build_model(self.structure(problem, timed=time_limit is not None, bounded=True))
            instance, points = lay_out(problem, model, within, self._path_of)
            return self._rounds(instance, points, None, deadline, time_limit)
        except OutOfTime as over:  # what was found before stays
            return SolveResult(SolveStatus.TIME_LIMIT, detail=_cut(time_limit, over))

    def _rounds(
        self,
        instance: Instance,
        points: Array,
        warm_start: Curve | None,
        deadline: float | None,
        time_limit: float | None,
    ) -> SolveResult:
        """Solve around the guide, then around the solution, until the exact constraints are kept."""
        problem, model = instance.problem, instance.model
        why = start_violation(problem)
        if why:
            return SolveResult(SolveStatus.INFEASIBLE, detail=why)
        separation, points, why, closest = open_sides(instance, points)
        if why:
            return self._infeasible(instance, why, closest)
        residuals = residuals_of(instance, separation, points)
        if _answered(instance, separation, points, residuals):
            word = "the optimum of the linear rows keeps the others too"
            found, cost = self._curve(instance, points), instance.objective(points)
            return SolveResult(SolveStatus.SOLVED, found, cost, detail=word, residuals=residuals)
        points = self._warmer(instance, separation, points, residuals, warm_start)
        iterations, cut = 0, _cut(time_limit)
        for round_ in range(self.config.rounds):
            trust = _TRUST * 0.5**round_ if round_ else None
            low, high = instance.bounds(separation, points, trust)
            try:
                points, status, word, count = self._run(instance, points, low, high, deadline)
                points = instance.on_path(points)
            except OutOfTime as over:  # what there is may do
                status, word, count = SolveStatus.TIME_LIMIT, "", 0
                cut = _cut(time_limit, over)
            iterations += count
            residuals = residuals_of(instance, separation, points)
            kept = largest_violation(residuals) <= TOLERANCE
            if status is not SolveStatus.SOLVED or kept:
                break
            if deadline is not None and time.perf_counter() > deadline:
                status = SolveStatus.TIME_LIMIT
                break
            shape = instance.shape(points)
            room = instance.room(shape, min(ROAD_SLACK, 0.5 * trust) if trust else ROAD_SLACK)
            separation = separate(
                problem, instance.windows, len(model.obstacle), shape, room, separation.side, instance.boxes
            )
        detail = word
        if status is SolveStatus.SOLVED and not kept:
            status = SolveStatus.NUMERICAL_ERROR
            detail = f"{worst_family(residuals)} after {self.config.rounds} rounds"
        elif status is SolveStatus.TIME_LIMIT:
            detail = cut
        elif status not in (SolveStatus.SOLVED, SolveStatus.INFEASIBLE):
            detail = f"{word}; at the last iterate {worst_family(residuals)}"
        usable = kept and status is not SolveStatus.INFEASIBLE
        curve = self._curve(instance, points) if usable else None
        objective = instance.objective(points)
        return SolveResult(status, curve, objective, iterations, detail=detail, residuals=residuals)

    def _nearest(
        self, result: SolveResult, problem: RepairProblem, model: Model, curve: Curve, deadline: float | None
    ) -> SolveResult:
        """With what is nearest to a verified curve and keeps all rows, of the margin as much as that curve.

        Nearest by the objective's own weights; the curve itself where it keeps the rows.
        """
        instance, kept, verified = keeping_to(problem, model, curve)
        if kept.why:
            return replace(result, detail=f"{result.detail}; the verified curve: {kept.why}")
        broken = residuals_of(instance, kept, verified)
        detail = result.detail
        if largest_violation(broken) > TOLERANCE:
            detail += f"; of the verified curve {worst_family(broken)}"
        # No nearer to an obstacle than it is, at any time; or else at the closest.
        for separation in (no_nearer(instance, kept, verified), kept):
            points = self._projected(instance, separation, verified, deadline)
            if points is not None:
                miss = problem.margin - instance.problem.margin
                residuals = residuals_of(instance, separation, points) | {"obstacles": miss}
                before = None if problem.afterwards is None else result.closest
                nearest = Closest(self._curve(instance, points), miss, residuals, instead=before)
                return replace(result, closest=nearest, detail=detail)
        return replace(result, detail=f"{detail}, and nothing near it keeps all rows")

    def _projected(
        self, instance: Instance, separation: Separation, verified: Array, deadline: float | None
    ) -> Array | None:
        """The control points nearest to given ones that keep all rows; None where none are found."""
        model, points = instance.model, verified
        p, axes = model.structure.degree, model.structure.axes
        slope = -(model.hessian[p:, p:] @ verified[p:])[:, :axes].T.ravel()
        for round_ in range(self.config.rounds + 1):
            if largest_violation(residuals_of(instance, separation, points)) <= TOLERANCE:
                return points
            if round_:
                bounds = instance.bounds(separation, points, _TRUST * 0.5**round_)
                points, status, _, _ = self._run(instance, points, *bounds, deadline, slope)
                if status is not SolveStatus.SOLVED:
                    return None
            else:  # the linear rows alone
                bounds = instance.bounds(separation, None, modest=True)
                x, _ = model.presolve(model.unknowns(points), slope, *bounds)
                if x is None:
                    return None
                points = model.with_unknowns(points, x)
        return None

    def _curve(self, instance: Instance, points: Array) -> UniformBSpline:
        t_rep = instance.problem.t_rep
        return UniformBSpline(t_rep, self.spacing, self.degree, frozen(points + instance.origin))

    def _infeasible(
        self, instance: Instance, why: str, closest: tuple[Array, dict[str, float]] | None
    ) -> SolveResult:
        """No solution; with the curve, if any, that keeps all other linear rows and comes closest."""
        if closest is None:
            return SolveResult(SolveStatus.INFEASIBLE, detail=why)
        curve = self._curve(instance, closest[0])
        return SolveResult(
            SolveStatus.INFEASIBLE, detail=why, residuals=closest[1], stages={"closest": curve},
            closest=Closest(curve, closest[1]["obstacles"]),
        )  # fmt: skip

    def _warmer(
        self,
        instance: Instance,
        separation: Separation,
        points: Array,
        residuals: dict[str, float],
        warm_start: Curve | None,
    ) -> Array:
        """The neighbouring probe's curve instead of ``points`` where it violates less."""
        if warm_start is None or warm_start.t_start > instance.problem.t_rep + INSTANT:
            return points
        worst = largest_violation(residuals)
        if worst <= 0.0:
            return points
        model, t_rep = instance.model, instance.problem.t_rep
        shifted = (
            fit_to_curve(warm_start, t_rep, len(points), self.degree, self.spacing).points - instance.origin
        )
        warm = model.with_unknowns(points, model.unknowns(shifted))
        return warm if max(residuals_of(instance, separation, warm).values()) < worst else points

    def _run(
        self,
        instance: Instance,
        points: Array,
        low: Array,
        high: Array,
        deadline: float | None,
        slope: Array | None = None,
    ) -> tuple[Array, SolveStatus, str, int]:
        """One NLP: the new control points, the status, the solver's word, the iterations."""
        model = instance.model
        x0, data = model.unknowns(points), instance.sample_data(points)
        slope = instance.slope if slope is None else slope
        solution = model.solve(x0, data, slope, low, high, deadline)
        return (
            model.with_unknowns(points, solution.x),
            status_of(model, solution),
            solution.word,
            solution.iterations,
        )


def _answered(instance: Instance, separation: Separation, points: Array, residuals: dict[str, float]) -> bool:
    """Whether the optimum of the linear rows keeps the nonlinear ones too, and so is the NLP's."""
    if points is not instance.relaxed or largest_violation(residuals) > 0.0:
        return False
    return instance.keeps_curved(points, *instance.bounds(separation, points))


def _cut(time_limit: float | None, why: OutOfTime | None = None) -> str:
    """That there was no time, and for what, as a sentence."""
    said = "no time is left" if time_limit is None else f"time limit of {time_limit:g} s"
    return f"{said}: {why}" if why is not None and str(why) else said


def make(config: Configuration) -> CasadiBackend:
    """The backend as the configuration describes it."""
    return CasadiBackend(config.section("casadi"), degree=config.repair.degree, spacing=config.repair.spacing)
