"""The search over the controls for one problem: the cross-entropy method around several manoeuvres."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from enum import Enum

import numpy as np

from repair.arrays import Array
from repair.backend.base import Closest
from repair.check.limits import plane_excess
from repair.curves.base import Curve
from repair.deadline import in_time
from repair.problem.problem import RepairProblem
from repair.solvers.shooting.curve import curve_along, curve_of
from repair.solvers.shooting.motion import Car, Driven, drive_along, drive_freely
from repair.solvers.shooting.plans import Plan, Steps, first_along, first_freely
from repair.solvers.shooting.settings import ShootingConfig
from repair.solvers.shooting.shots import First, Looked, Shot, apart, effort_of, far
from repair.solvers.shooting.space import Space
from repair.timegrid import SHORT
from repair.vehicle.parameters import Vehicle, load_vehicle
from repair.vehicle.single_track import body_angles

__all__ = ["Task"]

_COARSE, _FINE = 2, 8  # looks at a step: while searching, and before a trajectory counts as found
_ON_MAP = 4  # looks at a step at the road itself
_DEEPEST = 0.5  # weight of the deepest place against the sum over time
_EFFORT = 1e-4  # weight of the controls against the excess
_ROUNDING = 1e-3  # share of the limits that is left to the rounding of curves
_HISTORY = 120  # samples of the reference before t_rep, after which the body's angle is forgotten
_MORE = 0.01  # and more of it, where that is too little
_LITTLE = 0.01  # what counts as a miss and is none of a distance [m]
_PROGRESS = 0.02  # share of what is left by which an iteration has to be better than those before it
_INCH = 1e-3  # by which more is kept from obstacles where what is driven exactly meets one [m]
_EDGE = 0.05  # by which the lateral room is narrowed where a trajectory in it leaves the road [m]


class _Why(Enum):
    """What the closer look found that the first one had not seen."""

    ROAD, PLACE, STRAIN = range(3)


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
        self._last: tuple[Plan, Array, Driven] | None = None
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
        return drive_freely(
            car, self.start, wanted, plan.steering(rows, self.steps), plan.tail(rows, self.steps)
        )

    def curve(self, plan: Plan, shot: Shot) -> Curve:
        """The curve of the best trajectory."""
        driven = self._exactly(plan, shot.row)
        if not plan.steers:
            return curve_along(self.problem, driven, self.exact)
        return curve_of(self.problem, driven, self.exact)

    def closest(self, plan: Plan, shot: Shot) -> Closest:
        """The curve of the best trajectory where it misses something, and by how much until its end."""
        driven = self._exactly(plan, shot.row)
        miss = max(shot.miss, float(self.fine.excess(driven)[1][0]))
        return Closest(self.curve(plan, shot), miss)

    def _exactly(self, plan: Plan, rows: Array) -> Driven:
        """The trajectories (N,) on the axis itself; those of the last time are remembered."""
        if self._last is not None and plan is self._last[0] and len(rows) == 1:
            same = np.flatnonzero((self._last[1] == rows).all(axis=1))
            if len(same):
                return self._last[2].take(same[:1])
        driven = self.drive(plan, rows, self.exact)
        self._last = plan, rows, driven
        return driven

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
        looked = self._look(plan, rows)
        return First(rows, looked.cost, self._best(plan, rows, looked))

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
        means = apart(rows, cost, self.config.means)
        spreads = np.repeat(plan.spread[None], len(means), axis=0)
        # By place alone: what makes an impact least is no matter of all or nothing.
        avoids = self.coarse.adds_up
        patience = self.config.patience if plan.steers or not avoids else 1
        least, idle = [np.array((best.miss, cost.min()))], 0
        for left in reversed(range(self.config.iterations)):
            in_time()
            noise = random.standard_normal((len(means), self.config.population, plan.size))
            draws = plan.kept((means[:, None] + spreads[:, None] * noise).reshape(-1, plan.size))
            draws[:: self.config.population] = means
            looked = self._look(plan, draws)
            found = self._best(plan, draws, looked)
            if found.miss <= 0.0:
                return found
            now = np.array((found.miss, looked.cost.min()))
            if found.miss < best.miss:
                best = found
            idle = 0 if (now < (1.0 - _PROGRESS) * least[-1]).any() else idle + 1
            least.append(np.minimum(least[-1], now))
            if idle == patience or (avoids and far(least, left)):
                break
            means, spreads = self._next(means, spreads, draws, looked.cost)
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

    def _look(self, plan: Plan, rows: Array) -> Looked:
        """The trajectories (N,), and what there is to say of them."""
        self.iterations += 1
        driven = self.drive(plan, rows, self.car)
        total, most = self.coarse.excess(driven)
        fast = np.zeros(len(rows)) if plan.steers else self.coarse.overload(driven)
        effort = effort_of(driven)
        cost = total + _DEEPEST * most + fast + _EFFORT * effort
        return Looked(cost, np.maximum(most, fast), effort, driven)

    def _best(self, plan: Plan, rows: Array, looked: Looked) -> Shot:
        """The best of the cheapest and the least deep ones; a closer look at those that seem clear."""
        order = (values.argsort(kind="stable") for values in (looked.cost, looked.deep))
        few = np.unique(np.concatenate([some[: self.config.elite] for some in order]))
        most, effort = looked.deep[few], looked.effort[few]
        clear = np.flatnonzero(most <= 0.0)
        if len(clear):
            clear = clear[effort[clear].argsort(kind="stable")]
            most[clear] = self._from_near(plan, rows[few[clear]], looked.driven.take(few[clear]))
        k = int(np.lexsort((effort, most))[0])
        return Shot(rows[few[k : k + 1]], float(looked.cost[few[k]]), float(most[k]))

    def _from_near(self, plan: Plan, rows: Array, driven: Driven) -> Array:
        """What keeps trajectories (N,) that seem clear from being found, as metres: until one is found.

        The gentlest ones, which come first, mostly are what they seem to be.
        """
        most = np.zeros(len(rows))
        why: set[_Why] = set()
        for part in np.split(np.arange(len(rows)), [1]):
            if not len(part):
                continue
            some = driven.take(part)
            most[part] = self.fine.excess(some)[1]
            if not plan.steers:
                most[part] = np.maximum(most[part], self.fine.overload(some))
            part = part[most[part] <= 0.0]
            # Who is off the road as driven here is off it as driven exactly.
            most[part] = _LITTLE * self.on_map.off_the_map(driven.take(part))
            if most[part].any():
                why.add(_Why.ROAD)
            if len(part := part[most[part] <= 0.0]):
                most[part] = self._closely(plan, rows[part], why)
                if not most[part].all():
                    return most
        if plan.steers:
            self._keep_more(why)
        return most

    def _closely(self, plan: Plan, rows: Array, why: set[_Why]) -> Array:
        """What else keeps trajectories (N,) from being found, as metres, and why."""
        exact = self._exactly(plan, rows)
        most = self.fine.excess(exact)[1]
        if not plan.steers:
            most = np.maximum(most, self.fine.overload(exact))
        if most.any():
            why.add(_Why.PLACE)
        clear = np.flatnonzero(most <= 0.0)
        most[clear] = _LITTLE * self.on_map.off_the_map(exact.take(clear))
        if most[clear].any():
            why.add(_Why.ROAD)
        if not plan.steers:
            return np.asarray(most)
        for k in np.flatnonzero(most <= 0.0).tolist():
            if self._strains(curve_of(self.problem, exact.take(np.array([k])), self.exact)):
                most[k] = _LITTLE
                why.add(_Why.STRAIN)
        return np.asarray(most)

    def _keep_more(self, why: set[_Why]) -> None:
        """Let the next trajectories keep more from what the closer look has found."""
        edge, spare = self.coarse.edge, self.coarse.spare
        if _Why.ROAD in why:  # the lateral room is a table, and the road is not
            edge += _EDGE
        if _Why.PLACE in why:  # what is looked at has been driven by a cheaper rule
            spare += _INCH
        if (edge, spare) != (self.coarse.edge, self.coarse.spare):
            self.coarse = replace(self.coarse, edge=edge, spare=spare)
        if _Why.STRAIN in why:  # where the axis bends sharply, steps and quintics follow it less closely
            limits = self.car.limits.reserving(_MORE)
            self.car, self.exact = replace(self.car, limits=limits), replace(self.exact, limits=limits)
            self._last = None

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
