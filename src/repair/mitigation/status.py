"""Whether nothing was found because nothing can be: told apart by the proof."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from repair.bounds.latest import Bound
from repair.search.result import SearchResult, SearchStatus

__all__ = ["NOTHING", "certain"]

#: How a search ends that has found nothing, though there is something to react to.
NOTHING = (SearchStatus.NONE_FEASIBLE, SearchStatus.BUDGET_EXHAUSTED)


def certain(found: SearchResult, bounds: Mapping[str, Bound]) -> SearchResult:
    """The answer of a search, ``unavoidable`` where it is proven that the vehicle cannot avoid the conflict.

    The proof has to be of the kind ``vehicle``, of the time 0: contact of the true shapes, or the road left.
    One of the kind ``search`` counts safety margins and the configured limits, and is none of a collision.

    Parameters
    ----------
    found : SearchResult
    bounds : mapping
        What :func:`repair.bounds.latest.bound` returned; empty where nobody asked.
    """
    proof = bounds["vehicle"].proof if "vehicle" in bounds else None
    if found.status not in NOTHING or proof is None or proof.time > 0.0:
        return found
    return replace(found, status=SearchStatus.UNAVOIDABLE)
