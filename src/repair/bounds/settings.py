"""The bound on the time to react."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["KINDS", "BoundConfig"]

#: For whom a bound holds: any motion of the vehicle, or any that the search's checker would call feasible.
KINDS = ("vehicle", "search")

_WITH = ("bound.wanted", (True,))


@dataclass
class BoundConfig:
    """The bound on the time to react."""

    wanted: bool = setting(False, "prove from when on nothing avoids the conflict any more")
    kinds: list[str] = setting(
        factory=lambda: list(KINDS),
        says="vehicle: no motion of the vehicle does; search: none that the checker would call feasible",
        choices=KINDS,
        only_with=_WITH,
    )
    road: bool = setting(
        True, "who leaves the road has not avoided the conflict (with checker.road)", only_with=_WITH
    )
    step: float = setting(
        0.025, "resolution of the bound [s]; at least that of checker.substeps", low=1e-3, high=1.0,
        only_with=_WITH,
    )  # fmt: skip
    after: float = setting(
        0.5, "until how long after the conflict what is met is looked at [s]", low=0.0, high=10.0,
        only_with=_WITH,
    )  # fmt: skip
    nodes: int = setting(200, "parts of a proof at most", low=1, high=100_000, only_with=_WITH)
    time_limit: float = setting(
        2.0,
        "processor time for each kind of bound [s]; what is proven by then stands",
        low=0.0,
        high=1e6,
        only_with=_WITH,
    )
