"""Algorithm 1, and why it finds nothing."""

from __future__ import annotations

from dataclasses import dataclass

from repair.settings import setting

__all__ = ["EXPLAINED", "ExplainConfig", "SearchConfig"]

#: What could be different, in the order in which it is tried.
EXPLAINED = (
    "removed", "friction", "road", "later", "earlier", "away", "start", "engine", "steering",
)  # fmt: skip
_WITH = ("explain.wanted", (True,))


@dataclass
class SearchConfig:
    """Algorithm 1."""

    rule: str = setting(
        "guided",
        "guided: from the last open way past the obstacles on; bisect: the paper's; scan: every one; "
        "as_printed: to the letter",
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
        "best: of the open sides of passing that one whose repair costs least, and where each has to be "
        "tightened the first that passes; first: the first feasible one",
        choices=("best", "first"),
    )
    proofs: bool = setting(
        True,
        "where nothing is found at first, and more would take long, a small proof that nothing can be found "
        "is looked for; it never changes what is found",
    )


@dataclass
class ExplainConfig:
    """Why there is no repair, or no later one."""

    wanted: bool = setting(
        False, "say what is in the way of a repair, or of a later one, and what would help"
    )
    kinds: list[str] = setting(
        factory=lambda: list(EXPLAINED),
        says="what could be different: an obstacle removed, later, earlier or further away; more friction, "
        "road, engine, steering; a slower start",
        choices=EXPLAINED,
        only_with=_WITH,
    )
    time_limit: float = setting(
        10.0,
        "processor time [s]; what is found by then is told, and which kinds were not tried",
        low=0.0,
        high=1e6,
        only_with=_WITH,
    )
