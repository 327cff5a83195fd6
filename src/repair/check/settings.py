"""The feasibility check."""

from __future__ import annotations

from dataclasses import dataclass, replace

from repair.settings import setting
from repair.timegrid import SHORT, intervals

__all__ = ["CheckerConfig", "sampled"]

_APART = 0.0625  # [s] between two samples


@dataclass
class CheckerConfig:
    """The feasibility check."""

    substeps: int = setting(
        4,
        "samples per scenario step at which the road is looked at and the ego's curve is followed; more "
        "where they would be more than 0.0625 s apart; at steps below 0.04 s as far apart as at 0.04 s",
        low=1,
        high=50,
    )
    official: str = setting(
        "leftover",
        "which transitions the drivability checker is asked about: those left over, all, or none",
        choices=("leftover", "always", "never"),
    )
    road: bool = setting(True, "the ego's rectangle stays on the road")
    road_gap: float = setting(
        0.35, "gaps and holes of the map up to this width are road [m]", low=0.0, high=2.0
    )
    gaps: str = setting(
        "as_reference",
        "whether a repair may cross such a gap where CommonRoad's own boundary check has no road: only if "
        "the reference does, or always",
        choices=("as_reference", "always"),
        only_with=("checker.road", (True,)),
    )
    limits: bool = setting(True, "the repaired part keeps the limits")
    margin: bool = setting(False, "the repaired part keeps out of the inflated boxes, as the TTC has it")
    conflict: str = setting(
        "shapes",
        "by what a conflict of the reference is found: true shapes with checker.clearance, as repairs are "
        "judged, or the inflated boxes (the paper)",
        choices=("shapes", "boxes"),
    )
    clearance: float = setting(
        0.1, "safety margin around the ego's rectangle, for conflict and repair alike [m]", low=0.0, high=5.0
    )
    tolerance: float = setting(0.0, "share of every limit by which a repair may exceed it", low=0.0, high=0.1)
    terminal: str = setting(
        "report",
        "whether the vehicle can be brought to rest after a repair: nobody asks, the result says it, or "
        "a repair after which it cannot is none",
        choices=("off", "report", "require"),
    )
    terminal_wait: float = setting(
        0.0,
        "how long the vehicle that has come to rest after a repair still may not be met [s]",
        low=0.0,
        high=60.0,
        only_with=("checker.terminal", ("report", "require")),
    )
    extra: list[str] = setting(
        factory=list, says="registered checks that a repair has to pass too", registry="check"
    )


def sampled(config: CheckerConfig, dt: float) -> CheckerConfig:
    """The same with samples that are close enough at long steps, and no closer than needed at short ones.

    Between samples the ego moves along a chord, and contact is looked for in between as well; every step is
    a sample at least.

    Parameters
    ----------
    config : CheckerConfig
    dt : float
        Scenario time step [s].
    """
    wanted = intervals(min(dt / SHORT, 1.0) * config.substeps, 1.0)
    return replace(config, substeps=max(wanted, intervals(dt, _APART), 1))
