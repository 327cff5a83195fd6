"""The feasibility check."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["CheckerConfig"]


@dataclass
class CheckerConfig:
    """The feasibility check."""

    substeps: int = setting(4, "samples per scenario step between which nothing is looked at", low=1, high=50)
    official: str = setting(
        "leftover",
        "which transitions the drivability checker is asked about: those left over, all, or none",
        choices=("leftover", "always", "never"),
    )
    road: bool = setting(True, "the ego's rectangle stays on the road")
    limits: bool = setting(True, "the repaired part keeps the limits")
    margin: bool = setting(False, "the repaired part keeps out of the inflated boxes, as the TTC has it")
    extra: list[str] = setting(
        factory=list, says="registered checks that a repair has to pass too", registry="check"
    )
