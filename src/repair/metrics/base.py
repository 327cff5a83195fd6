"""What a metric of a reference is: a value with its status."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from repair.baselines.evasive.settings import EvasiveConfig
from repair.baselines.evasive.times import EvasiveResult, evasive_ttr
from repair.errors import ConfigError
from repair.situation import Situation

__all__ = ["Asked", "Metric", "MetricValue"]


@dataclass(frozen=True)
class MetricValue:
    """One metric of one reference.

    Attributes
    ----------
    value : float
        By CommonRoad-CriMe's conventions for times: inf without a conflict, -inf where there is none.
    status : str
        Why it has this value: ``found``, ``no_conflict``, ``never``, ``already_colliding``, or the
        metric's own word.
    unit : str
        ``s`` for times; as in the keys of ``result.json``.
    """

    value: float
    status: str = "found"
    unit: str = "s"

    def __post_init__(self) -> None:
        if not self.unit.isidentifier():
            raise ConfigError(f"the unit of a metric ends a key, such as s or mps; it is {self.unit!r}")


@dataclass(frozen=True)
class Asked:
    """What a metric is asked about; what several of them need is made once.

    Attributes
    ----------
    situation : Situation
    settings : EvasiveConfig
        Of the fixed manoeuvres.
    """

    situation: Situation
    settings: EvasiveConfig

    @cached_property
    def evasive(self) -> EvasiveResult:
        """The fixed evasive manoeuvres, rolled out."""
        return evasive_ttr(self.situation, self.settings)

    @property
    def evaded(self) -> bool:
        """Whether that has been done."""
        return "evasive" in vars(self)


#: Measures a reference in its situation.
Metric = Callable[[Asked], MetricValue]
