"""How a repair ends: whether the vehicle can still be brought to rest from its last state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from repair.check.verdict import Violation
from repair.terminal.stop import Stop
from repair.vehicle.states import DrivenStates

__all__ = ["Continuation", "Ending", "Terminal"]


class Ending(str, Enum):
    """What can be said about the end of a repair."""

    SAFE = "safe"
    SAFE_UNLESS_EXTENDED = "safe_unless_extended"
    UNSAFE = "unsafe"

    @property
    def sentence(self) -> str:
        """What it means, in a sentence."""
        return {
            "safe": "from its last state the vehicle comes to rest and meets nothing, whether those whose "
            "prediction has ended go on at constant velocity or are held",
            "safe_unless_extended": "from its last state the vehicle comes to rest and meets nothing that is "
            "predicted, but may meet something whose prediction has ended",
            "unsafe": "no stop that was tried from its last state passes every check",
        }[self.value]


@dataclass(frozen=True)
class Continuation:
    """A stop, driven.

    Attributes
    ----------
    maneuver : str
        ``stand``, ``brake``, ``swerve_left`` or ``swerve_right``.
    stop : Stop
        The curve from the last state of the repair on.
    states : DrivenStates
        The vehicle at the scenario's steps, from that state on.
    """

    maneuver: str
    stop: Stop
    states: DrivenStates


@dataclass(frozen=True)
class Terminal:
    """The end of a repair, judged.

    Attributes
    ----------
    ending : Ending
    continuation : Continuation or None
        What shows it; where the end is unsafe, full braking along the path, which fails. None where not even
        that can be laid out.
    extended : mapping
        For ``constant_velocity`` and ``hold`` what is met then; None where nothing is.
    violations : tuple of Violation
        What full braking along the path fails on, where the end is unsafe.
    tried : int
        How many stops were looked at.
    """

    ending: Ending
    continuation: Continuation | None
    extended: Mapping[str, Violation | None] = field(default_factory=dict)
    violations: tuple[Violation, ...] = ()
    tried: int = 0
