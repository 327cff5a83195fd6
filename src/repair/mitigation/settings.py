"""What is done where nothing was found."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["MitigationConfig"]

_WITH = ("mitigation.wanted", (True,))


@dataclass
class MitigationConfig:
    """The motion that hits least hard, where no repair was found."""

    wanted: bool = setting(
        False,
        "where nothing is found: ask for the bound (vehicle), and look for the least impact speed",
    )
    time_limit: float = setting(
        10.0,
        "wall time for the look [s]; full braking is looked at in any case, and what is found by then stands",
        low=0.0,
        high=1e6,
        only_with=_WITH,
    )
