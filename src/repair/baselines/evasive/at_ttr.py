"""The repair problems at the TTR: around the manoeuvre that gave it, then the other open sides.

The order of the paper's baseline (``driver: at_ttr``) is first a TTR, then one repair at that TTR. The TTR
comes from fixed manoeuvres, the trajectory from a planner that knows nothing of them; that nothing
guarantees a repair at the TTR is the paper's argument for searching both together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from repair.baselines.evasive.maneuvers import EvasiveManeuver
from repair.baselines.evasive.times import EvasiveResult
from repair.curves.base import Curve
from repair.problem.factory import ProblemFactory
from repair.problem.problem import Maneuver, RepairProblem

__all__ = ["AtTtr"]

_KIND = {
    EvasiveManeuver.BRAKE: Maneuver.YIELD,
    EvasiveManeuver.KICK_DOWN: Maneuver.GO_AHEAD,
    EvasiveManeuver.STEER_LEFT: Maneuver.LEFT,
    EvasiveManeuver.STEER_RIGHT: Maneuver.RIGHT,
}


@dataclass(frozen=True)
class AtTtr:
    """Makes the problems at the TTR (a :class:`repair.search.probe.ProblemSource`).

    Attributes
    ----------
    factory : ProblemFactory
        Of the situation.
    evasive : EvasiveResult
        The TTR, and the manoeuvre behind it.
    """

    factory: ProblemFactory
    evasive: EvasiveResult

    @property
    def visits(self) -> tuple[float, ...]:
        """The TTR [s]; nothing where no manoeuvre helps."""
        return () if self.evasive.curve is None else (self.evasive.curve.t_start,)

    def at(self, t_rep: float) -> tuple[RepairProblem, ...]:
        """Around the manoeuvre, then the other open sides.

        The manoeuvre shows that a way is open even where the limits of the repair allow no guide.
        """
        curve = self.evasive.curve
        if curve is None or self.evasive.maneuver is None:
            return ()
        kind = _KIND[self.evasive.maneuver]
        others = self.factory.at(t_rep)
        around = self.factory.along(curve, kind)
        return (around, *(p for p in others if p.passing is None or p.passing.maneuver is not kind))

    def relaxed(self, t_rep: float) -> Iterable[tuple[RepairProblem, ...]]:
        """The open sides again with smaller and smaller margins."""
        return self.factory.relaxed(t_rep)

    def widened(self, t_rep: float) -> Iterable[tuple[RepairProblem, ...]]:
        """As the search has it: see :meth:`repair.search.probe.ProblemSource.widened`."""
        return self.factory.widened(t_rep)

    @property
    def notches(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """As the search has them: see :attr:`repair.search.probe.ProblemSource.notches`."""
        return self.factory.notches

    def along(self, manoeuvre: Curve, kind: Maneuver, *, jumps: bool = False) -> RepairProblem:
        """The problem at the start of a curve, with that curve as the guide."""
        return self.factory.along(manoeuvre, kind, jumps=jumps)

    def without_guide(self, t_rep: float) -> tuple[RepairProblem, ...]:
        """See :meth:`repair.problem.factory.ProblemFactory.without_guide`."""
        return self.factory.without_guide(t_rep)
