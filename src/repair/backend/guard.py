"""A backend that is not believed: what it answers is looked at before anything is made of it."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

import numpy as np

from repair.backend.base import Closest, RepairBackend, SolveResult, SolveStatus
from repair.curves.base import Curve, FrenetTrajectory, is_curve
from repair.curves.bspline import UniformBSpline
from repair.errors import BackendError, foreign, in_words, kind_of
from repair.problem.problem import RepairProblem
from repair.timegrid import STEP

__all__ = ["Guarded"]

_LOOKED_AT = 9  # places of a curve
_FAR = 1e15  # from here on a tenth of a metre is lost in the rounding
_KNOTS = 1e-3, 1e3  # [s], between which a spline's derivatives are as finite as its control points


class Guarded:
    """A backend behind the same seam; whatever is wrong with it is a :class:`BackendError` that names it.

    Parameters
    ----------
    backend : RepairBackend
    name : str
        By which it was asked for.
    """

    def __init__(self, backend: RepairBackend, name: str) -> None:
        self.backend, self.name = backend, name
        self.capabilities = backend.capabilities

    def solve(
        self,
        problem: RepairProblem,
        *,
        warm_start: Curve | None = None,
        time_limit: float | None = None,
    ) -> SolveResult:
        """What the backend answers, if it is an answer.

        Raises
        ------
        BackendError
            If the backend raises, or gives no :class:`SolveResult`, or one with a curve that is none, is
            not finite, or does not reach from ``t_rep`` to ``t_end``.
        """
        with foreign(f"backend {self.name!r}, at t_rep = {problem.t_rep:g} s,", BackendError):
            answer: Any = self.backend.solve(problem, warm_start=warm_start, time_limit=time_limit)
        if why := _wrong(answer, problem):
            raise BackendError(f"backend {self.name!r}: its solve gave {why} at t_rep = {problem.t_rep:g} s")
        assert isinstance(answer, SolveResult)
        return answer


def _wrong(answer: Any, problem: RepairProblem) -> str:
    """What is wrong with an answer, in words; empty where nothing is."""
    if not isinstance(answer, SolveResult):
        return f"{kind_of(answer)}, no SolveResult"
    if not isinstance(answer.status, SolveStatus):
        return f"the status {in_words(answer.status)}, which is no SolveStatus"
    if type(answer.iterations) is not int and not isinstance(answer.iterations, Integral):
        return f"{in_words(answer.iterations)} iterations"
    for name in ("objective", "build_time", "solve_time"):
        value = getattr(answer, name)
        if type(value) is not float and not isinstance(value, Real):
            return f"{kind_of(value)} as its {name}"
    if not isinstance(answer.residuals, Mapping) or not all(
        isinstance(v, Real) for v in answer.residuals.values()
    ):
        return "residuals that are no mapping of numbers"
    if not isinstance(answer.stages, Mapping) or not all(map(is_curve, answer.stages.values())):
        return "stages that are no mapping of curves"
    if answer.curve is not None and (why := _wrong_curve(answer.curve, problem)):
        return why
    return _wrong_closest(answer.closest, problem)


def _wrong_closest(closest: Any, problem: RepairProblem) -> str:
    if closest is None:
        return ""
    if not isinstance(closest, Closest) or not isinstance(closest.miss, Real):
        return f"{kind_of(closest)} as its closest curve, no Closest"
    return _wrong_curve(closest.curve, problem) or _wrong_closest(closest.instead, problem)


def _wrong_curve(curve: Any, problem: RepairProblem) -> str:
    if not is_curve(curve):
        return f"{kind_of(curve)} as its curve, which needs t_start, t_end and sample(t)"
    try:
        start, end = float(curve.t_start), float(curve.t_end)
    except (TypeError, ValueError):
        return "a curve whose span is no pair of numbers"
    if not (start <= problem.t_rep + STEP and end >= problem.t_end - STEP):
        span = f"from {start:g} to {end:g} s"
        return f"a curve {span} where one from {problem.t_rep:g} to {problem.t_end:g} s was asked for"
    if type(curve) is UniformBSpline:
        if not isinstance(curve.degree, Integral) or curve.degree < 1:
            return f"a B-spline of degree {in_words(curve.degree)}"
        if _surely_finite(curve):
            return ""
    times = np.linspace(problem.t_rep, problem.t_end, _LOOKED_AT)
    try:
        found: Any = curve.sample(times)
    except Exception as error:  # of a foreign curve
        return f"a curve that cannot be sampled ({type(error).__name__}: {in_words(error)})"
    if not isinstance(found, FrenetTrajectory):
        return f"a curve whose sample(t) is {kind_of(found)}, no FrenetTrajectory"
    for column in (found.position, found.velocity, found.acceleration):
        if np.shape(column) != (_LOOKED_AT, 2):
            return f"a curve with samples of shape {np.shape(column)} instead of {(_LOOKED_AT, 2)}"
        if not np.isfinite(column).all():
            return "a curve that is not finite"
        if not (np.abs(column) < _FAR).all():
            return f"a curve with numbers beyond {_FAR:g}"
    return ""


def _surely_finite(curve: UniformBSpline) -> bool:
    """Whether a B-spline can be sampled, and is finite, by its control points alone."""
    points: Any = curve.points
    if type(points) is not np.ndarray or points.dtype != np.float64 or points.ndim != 2:
        return False
    if not (points.shape[0] > curve.degree and points.shape[1] == 2):
        return False
    return _KNOTS[0] <= curve.spacing <= _KNOTS[1] and bool((np.abs(points) < _FAR).all())
