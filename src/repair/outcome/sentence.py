"""What a result claims, in words: no more than was looked at, and until when it was."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from repair.check.settings import CheckerConfig
from repair.search.result import SearchStatus
from repair.timegrid import INSTANT

if TYPE_CHECKING:
    from repair.check.verdict import Conflict
    from repair.preparation import Prepared
    from repair.search.result import SearchResult

__all__ = ["checked_until", "checks_off", "margin_only", "one_point", "status_sentence"]


def checks_off(config: CheckerConfig) -> tuple[str, ...]:
    """Checks that are on by default and were off or weakened, as they stand in a sentence."""
    usual = CheckerConfig()
    off = [
        name.replace("_", " ")
        for name in ("road", "limits", "margin")
        if getattr(usual, name, False) is True and getattr(config, name) is False
    ]
    if usual.clearance > 0.0 and config.clearance <= 0.0 and not config.margin:
        off.append("safety margin")
    if config.official == "never":
        off.append("drivability checker")
    return tuple(off)


def margin_only(conflict: Conflict) -> bool | None:
    """Whether a safety margin is entered and nothing is ever touched; None without a conflict."""
    if not math.isfinite(conflict.time):
        return None
    return conflict.kind == "margin" and not math.isfinite(conflict.contact_time)


def checked_until(prepared: Prepared, found: SearchResult) -> float:
    """Until when the answer holds [s]: the end of what was judged."""
    return prepared.t_reference if found.status is SearchStatus.NO_CONFLICT else prepared.t_end


def status_sentence(prepared: Prepared, found: SearchResult) -> str:
    """How the search ended, what the conflict is, which checks were off, and until when all this holds."""
    checker, conflict = prepared.config.checker, found.conflict
    until = f"{checked_until(prepared, found):.3g} s"
    off = checks_off(checker)
    but = f" but those that were off ({_listed(off)})" if off else ""
    if (slack := getattr(checker, "tolerance", 0.0)) > 0.0:
        but += f"; limits may be exceeded by {100.0 * slack:g} %"
    if found.status is SearchStatus.NO_CONFLICT:
        unseen = f"; not looked at: {_listed(off)}" if off else ""
        return f"{found.status.sentence}, until {until}{unseen}"
    if found.status is SearchStatus.FOUND:
        text = f"{found.status.sentence}{but}; checked until {until}"
    else:
        text = f"{found.status.sentence}; checked until {until}"
    what = "margin only, nothing is touched" if margin_only(conflict) else _KINDS.get(conflict.kind, "")
    return f"{text} (conflict: {what or conflict.kind.replace('_', ' ')})"


_KINDS = {"margin": "margin, then contact", "collision": "contact", "off_road": "off the road"}


def _listed(words: Sequence[str]) -> str:
    return ", ".join(words)


def one_point(prepared: Prepared, found: SearchResult) -> str:
    """A note where the grid of the search has a single point; empty where it has more."""
    config, ttc = prepared.config, found.conflict.time
    if config.driver != "f_ttr" or not math.isfinite(ttc) or found.status is SearchStatus.ALREADY_COLLIDING:
        return ""
    upper = config.search.upper
    end, name = (ttc, "TTC") if upper is None or ttc <= upper else (upper, "search.upper")
    if end > config.search.delta_t + INSTANT:
        return ""
    return (
        f"search.delta_t is {config.search.delta_t:g} s, not below the {name} of {end:g} s: "
        "the search has one point only, t_rep = 0"
    )
