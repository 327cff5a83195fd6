"""Algorithm 1."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["SearchConfig"]


@dataclass
class SearchConfig:
    """Algorithm 1."""

    rule: str = setting(
        "bisect",
        "guided: fewer probes; scan: every one; as_printed: to the letter",
        registry="search rule",
        only_with=("driver", ("f_ttr",)),
    )
    delta_t: float = setting(
        0.4, "resolution of the search grid [s]", low=1e-3, high=1e3, only_with=("driver", ("f_ttr",))
    )
    upper: float | None = setting(
        None, "upper end [s]; null: TTC", low=0.0, high=1e3, only_with=("driver", ("f_ttr",))
    )
    time_limit: float | None = setting(
        None,
        "of the search alone [s]; what is found by then is the answer, load and preparation are in time_s",
        low=0.0,
        high=1e6,
    )
    sides: str = setting(
        "best",
        "best: every open side of passing is tried; first: the first feasible one",
        choices=("best", "first"),
    )
