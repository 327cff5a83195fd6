"""The search over the controls for one problem: the cross-entropy method around several manoeuvres."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from repair.arrays import Array
from repair.check.limits import plane_excess
from repair.curves.base import Curve
from repair.deadline import in_time
from repair.problem.problem import RepairProblem
from repair.solvers.shooting.curve import curve_along, curve_of
from repair.solvers.shooting.motion import Car, Driven, drive_along, drive_freely
from repair.solvers.shooting.plans import Plan, Steps, first_along, first_freely
from repair.solvers.shooting.settings import ShootingConfig
from repair.solvers.shooting.space import Space
from repair.timegrid import SHORT
from repair.vehicle.parameters import Vehicle, load_vehicle
from repair.vehicle.single_track import body_angles

__all__ = ["First", "Shot", "Task"]

_COARSE, _FINE = 2, 8  # looks at a step: while searching, and before a trajectory counts as found
_ON_MAP = 4  # looks at a step at the road itself
_DEEPEST = 0.5  # weight of the deepest place against the sum over time
_EFFORT = 1e-4  # weight of the controls against the excess
_ROUNDING = 1e-3  # share of the limits that is left to the rounding of curves
_HISTORY = 120  # samples of the reference before t_rep, after which the body's angle is forgotten
_MORE = 0.01  # and more of it, where that is too little
_LITTLE = 0.01  # what counts as a miss and is none of a distance [m]
_PROGRESS = 0.02  # share of what is left by which an iteration has to be better than those before it
_EDGE = 0.05  # by which the lateral room is narrowed where a trajectory in it leaves the road [m]


@dataclass(frozen=True)
class Shot:
    """The best trajectory so far.

    Attributes
    ----------
    row : (1, D) array
    cost, miss : float
        What was minimised, and by how much an obstacle or the road's edge is missed at most [m].
    """

    row: Array
    cost: float
    miss: float


class First(NamedTuple):
    """The manoeuvres that a search begins with: rows (N, D), their costs (N,), and the best of them."""

    rows: Array
    cost: Array
    best: Shot


class Task:
    """One problem, to be searched with one plan after the other.

    Parameters
    ----------
    problem : RepairProblem
    config : ShootingConfig
    space : callable
        Makes what says how far trajectories miss, of the problem, the steps and the looks at each.

    Attributes
    ----------
    iterations : int
        How many sets of trajectories were driven.
    """

    def __init__(
        self, problem: RepairProblem, config: ShootingConfig, space: Callable[..., Space] = Space
    ) -> None:
        self.problem, self.config = problem, config
        self.iterations = 0
        self.steps = Steps.between(problem.t_rep, problem.t_end, problem.dt)
        shapes = problem.shapes
        vehicle = shapes.vehicle if shapes is not None else load_vehicle()
        limits = problem.limits.reserving(_ROUNDING)
        self.car = Car(
            vehicle, limits, problem.curvature_at, self.steps.dt, config.slack, each=self.steps.each
        )
        # A table of the curvature is faster; what is handed over is driven on the axis itself.
        curvature = problem.curvature_at if shapes is None else shapes.frame.curvature
        self.exact = replace(self.car, curvature=curvature, parts=2)
        looks = _COARSE, _FINE, _ON_MAP
        self.coarse, self.fine, self.on_map = (space(problem, self.steps, each) for each in looks)
        (s, l), (along, aside) = problem.start[:2].tolist()  # noqa: E741
        kappa = float(problem.curvature_at(s))
        forward = (1.0 - kappa * l) * max(along, 0.0)
        v = float(np.hypot(forward, aside))
        chi = float(np.arctan2(aside, forward)) if v > 0.1 else 0.0
        beta = _slip(problem, vehicle)
        self.start = np.array((s, l, v, chi, beta))

    def drive(self, plan: Plan, rows: Array, car: Car) -> Driven:
        """The trajectories (N,) of controls (N, D)."""
        limits, begun = self.problem.limits, float(self.problem.start[2, 0])
        wanted = plan.accelerations(rows, self.steps, begun, limits.a_min, limits.a_max)
        if not plan.steers:
            return drive_along(car, self.start, wanted)
        turning = plan.steering(rows, self.steps)
        return drive_freely(car, self.start, wanted, turning, plan.tail(rows, self.steps))

    def curve(self, plan: Plan, shot: Shot) -> Curve:
        """The curve of the best trajectory."""
        driven = self.drive(plan, shot.row, self.exact)
        if not plan.steers:
            return curve_along(self.problem, driven, self.exact)
        return curve_of(self.problem, driven, self.exact)

    def shots(self, plans: Iterable[Plan]) -> Iterator[tuple[Plan, Shot]]:
        """The best of what each plan begins with, and then of what is drawn around that."""
        begun: dict[Plan, First] = {}
        for plan in plans:
            in_time()
            begun[plan] = self._first(plan)
            yield plan, begun[plan].best
        for plan, first in begun.items():
            in_time()
            yield plan, self.search(plan, first)

    def _first(self, plan: Plan) -> First:
        rows = first_freely() if plan.steers else first_along()
        cost, deep, driven = self._cost(plan, rows)
        return First(rows, cost, self._best(plan, rows, cost, deep, driven))

    def search(self, plan: Plan, first: First | None = None) -> Shot:
        """The best that is found.

        The search ends with the first iteration that finds one without excess, and where iterations no longer
        come closer to one.

        Parameters
        ----------
        plan : Plan
        first : First, optional
            Of the manoeuvres that it begins with, where they have been looked at.
        """
        rows, cost, best = first or self._first(plan)
        if best.miss <= 0.0 or not self.config.iterations:
            return best
        random = np.random.default_rng(self.config.seed)
        means = _apart(rows, cost, self.config.means)
        spreads = np.repeat(plan.spread[None], len(means), axis=0)
        least, idle = np.array((best.miss, cost.min())), 0
        for _ in range(self.config.iterations):
            in_time()
            noise = random.standard_normal((len(means), self.config.population, plan.size))
            draws = plan.kept((means[:, None] + spreads[:, None] * noise).reshape(-1, plan.size))
            draws[:: self.config.population] = means
            cost, deep, driven = self._cost(plan, draws)
            found = self._best(plan, draws, cost, deep, driven)
            if found.miss <= 0.0:
                return found
            if found.miss < best.miss:
                best = found
            now = np.array((found.miss, cost.min()))
            idle = 0 if (now < (1.0 - _PROGRESS) * least).any() else idle + 1
            if idle == self.config.patience:
                break
            least = np.minimum(least, now)
            means, spreads = self._next(means, spreads, draws, cost)
        return best

    def _next(self, means: Array, spreads: Array, draws: Array, cost: Array) -> tuple[Array, Array]:
        """Means and spreads of the next iteration, by the elites around each mean."""
        shape = len(means), self.config.population
        order = cost.reshape(shape).argsort(axis=1, kind="stable")[:, : self.config.elite]
        elite = np.take_along_axis(draws.reshape(*shape, -1), order[..., None], axis=1)
        new, wide = elite.mean(axis=1), elite.std(axis=1)
        means = 0.2 * means + 0.8 * new
        spreads = 0.3 * spreads + 0.7 * np.maximum(wide, 0.02)
        least = np.take_along_axis(cost.reshape(shape), order[:, :1], axis=1)[:, 0]
        good = least <= 4.0 * least.min() + 1e-9
        return means[good], spreads[good]

    def _cost(self, plan: Plan, rows: Array) -> tuple[Array, Array, Driven]:
        """What is minimised, the deepest place (N,), and the trajectories."""
        self.iterations += 1
        driven = self.drive(plan, rows, self.car if plan.steers else self.exact)
        total, most = self.coarse.excess(driven)
        cost = total + _DEEPEST * most + _EFFORT * _effort(driven)
        if not plan.steers:
            fast = self.coarse.overload(driven)
            cost, most = cost + fast, np.maximum(most, fast)
        return cost, most, driven

    def _best(self, plan: Plan, rows: Array, cost: Array, deep: Array, driven: Driven) -> Shot:
        """The best of the trajectories, by a closer look at the cheapest and the least deep of them."""
        order = (values.argsort(kind="stable") for values in (cost, deep))
        few = np.unique(np.concatenate([some[: self.config.elite] for some in order]))
        some = driven.take(few)
        most = self.fine.excess(some)[1]
        if not plan.steers:
            most = np.maximum(most, self.fine.overload(some))
        clear = np.flatnonzero(most <= 0.0)
        if len(clear):
            most[clear] = self._closely(plan, rows[few[clear]])
        k = int(np.lexsort((_effort(some), most))[0])
        return Shot(rows[few[k : k + 1]], float(cost[few[k]]), float(most[k]))

    def _closely(self, plan: Plan, rows: Array) -> Array:
        """What else keeps trajectories (N,) from being found, as metres; the next ones keep more from it."""
        exact = self.drive(plan, rows, self.exact)
        most = np.maximum(self.fine.excess(exact)[1], _LITTLE * self.on_map.off_the_map(exact))
        if not plan.steers:
            return np.asarray(most)
        if most.all():  # the lateral room is a table, and the road is not
            self.coarse = replace(self.coarse, edge=self.coarse.edge + _EDGE)
        for k in np.flatnonzero(most <= 0.0).tolist():
            if self._strains(curve_of(self.problem, exact.take(np.array([k])), self.exact)):
                most[k] = _LITTLE
        if most.all():  # where the axis bends sharply, steps and quintics follow it less closely
            limits = self.car.limits.reserving(_MORE)
            self.car, self.exact = replace(self.car, limits=limits), replace(self.exact, limits=limits)
        return np.asarray(most)

    def _strains(self, curve: Curve) -> bool:
        """Whether a curve asks for more than the limits, between the steps or by its own derivatives."""
        problem, shapes = self.problem, self.problem.shapes
        if shapes is None:
            return False
        times = np.arange(problem.t_rep, problem.t_end, 0.25 * max(problem.dt, SHORT))
        samples = curve.sample(times)
        return bool(plane_excess(curve, samples, shapes.frame, problem.limits, shapes.vehicle, 0.0))


def _slip(problem: RepairProblem, vehicle: Vehicle) -> float:
    """Slip angle at t_rep of who has followed the reference until then [rad]."""
    shapes, times = problem.shapes, np.arange(problem.t_rep, -1e-9, -0.25 * max(problem.dt, SHORT))[::-1]
    if shapes is None or len(times) < 3:
        kappa = float(problem.curvature_at(problem.start[0, 0]))
        return float(np.arcsin(np.clip(vehicle.rear * kappa, -0.9, 0.9)))
    path = shapes.frame.cartesian(problem.reference.sample(times[-_HISTORY:]))
    return float(body_angles(path, vehicle)[0][-1])


def _effort(driven: Driven) -> Array:
    """How much is asked of the vehicle (N,): mean squares of both accelerations."""
    across = driven.v[:, :-1] * driven.rate
    return np.asarray((driven.a**2).mean(axis=1) + (across**2).mean(axis=1))


def _apart(rows: Array, cost: Array, count: int) -> Array:
    """The cheapest rows (count, D) of which no two are much alike."""
    chosen: list[int] = []
    for k in cost.argsort(kind="stable").tolist():
        if all(np.abs(rows[k] - rows[other]).max() > 0.9 for other in chosen):
            chosen.append(k)
        if len(chosen) == count:
            break
    return np.asarray(rows[chosen])
