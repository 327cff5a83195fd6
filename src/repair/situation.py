"""What a search needs to know about a scene, made once and searched many times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from repair.check.checker import Checker
from repair.check.verdict import Conflict
from repair.config import Config
from repair.curves.base import Curve
from repair.problem.factory import ProblemFactory
from repair.problem.limits import Limits
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["Prepared"]


@dataclass(frozen=True)
class Prepared:
    """Everything that is the same for every backend: made once, searched many times.

    Attributes
    ----------
    t_reference : float
        Until when the reference is followed and judged [s].
    t_end : float
        End of the repairs [s].
    """

    scene: Scene
    config: Config
    limits: Limits
    occupancy: Occupancy
    reference: Curve
    checker: Checker
    conflict: Conflict
    t_reference: float
    t_end: float
    notes: tuple[str, ...]
    phases: dict[str, float]

    @cached_property
    def source(self) -> ProblemFactory:
        """The repair problems of any t_rep."""
        return ProblemFactory(
            self.scene, self.config, self.limits, self.occupancy, self.reference, self.t_end
        )
