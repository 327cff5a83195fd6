"""Algorithm 1."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class SearchConfig:
    """Algorithm 1."""

    rule: str = "bisect"  # guided: fewer probes; scan: every one; as_printed: to the letter
    delta_t: float = 0.4  # resolution of the search grid [s]
    upper: float | None = None  # upper end [s]; null: TTC
    time_limit: float | None = None  # whole search [s]
    sides: str = "best"  # best: every open side of passing is tried; first: the first feasible one
