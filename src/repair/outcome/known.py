"""What is known beside the search: from when on it is too late, why, and what is left then."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from repair.bounds.latest import Bound, bound
from repair.mitigation.mitigate import Mitigation, mitigate
from repair.mitigation.status import NOTHING, certain
from repair.preparation import Phases, Prepared
from repair.search.result import SearchResult
from repair.why.explain import Explanation, explain

__all__ = ["Known", "what_is_known"]


@dataclass(frozen=True)
class Known:
    """What is known beside the search.

    Attributes
    ----------
    found : SearchResult
        The search's, ``unavoidable`` where that is proven.
    bounds : dict
        From when on it is proven too late, by kind; empty where nobody asked.
    mitigation : Mitigation or None
        What hits least hard, where nothing was found and ``mitigation.wanted``.
    explanation : Explanation or None
        Why there is no repair, or no later one (``explain.wanted``).
    """

    found: SearchResult
    bounds: dict[str, Bound] = field(default_factory=dict)
    mitigation: Mitigation | None = None
    explanation: Explanation | None = None


def what_is_known(
    prepared: Prepared,
    found: SearchResult,
    timed: Phases,
    on_explaining: Callable[[str], None] | None = None,
) -> Known:
    """Ask for the bound, for the least impact speed and for the reasons, where they are wanted.

    Parameters
    ----------
    prepared : Prepared
    found : SearchResult
    timed : Phases
        Where the time that it takes is noted.
    on_explaining : callable, optional
        Called with what an explanation looks at next, in words.
    """
    config = prepared.config
    missing = config.mitigation.wanted and found.status in NOTHING
    kinds = list(config.bound.kinds) if config.bound.wanted else []
    kinds += ["vehicle"] if missing and "vehicle" not in kinds else []
    bounds: dict[str, Bound] = {}
    if kinds:
        with timed("bound"):
            bounds = bound(prepared, replace(config.bound, kinds=kinds))
    mitigation = None
    if missing:
        with timed("mitigation"):
            mitigation = mitigate(prepared)
    explanation = None
    if config.explain.wanted:
        with timed("explain"):
            explanation = explain(prepared, found, on_progress=on_explaining)
        # An explanation looks for small proofs only, and for none where the reference is in conflict at once.
        if explanation is not None and any(one.time <= explanation.t_rep for one in bounds.values()):
            explanation = replace(explanation, proven=True)
    return Known(certain(found, bounds), bounds, mitigation, explanation)
