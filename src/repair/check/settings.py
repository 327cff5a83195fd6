"""The feasibility check."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class CheckerConfig:
    """The feasibility check."""

    substeps: int = 4  # samples per scenario step between which nothing is looked at
    official: str = "leftover"  # leftover | always | never
    road: bool = True  # the ego's rectangle stays on the road
    limits: bool = True  # the repaired part keeps the limits
    margin: bool = False  # the repaired part keeps out of the inflated boxes, as the TTC has it
