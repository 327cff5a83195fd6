"""What a result says of the bound on the time to react."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from repair.arrays import number
from repair.bounds.latest import Bound
from repair.preparation import Prepared
from repair.search.result import SearchResult
from repair.timegrid import ROUNDING

__all__ = ["bound_to_dict"]


def bound_to_dict(
    prepared: Prepared, found: SearchResult, bounds: Mapping[str, Bound]
) -> dict[str, Any] | None:
    """Bound, gap and whether the F-TTR is proven to be the last on its grid; None where none was asked for.

    Notes
    -----
    Where nothing is proven before the conflict, the search ends there all the same: the upper end is the TTC.
    """
    if not bounds:
        return None
    proven = [b.time for b in bounds.values() if b.proven]
    upper = min([*proven, found.conflict.time])
    f_ttr = found.f_ttr if found.curve is not None else None
    finite = f_ttr is not None and math.isfinite(upper)
    gap = upper - f_ttr if finite and f_ttr is not None else None
    return {
        "t_bound_s": number(min(proven)) if proven else None,
        "gap_s": number(gap),
        "proven_optimal": gap is not None and gap <= prepared.config.search.delta_t + ROUNDING,
        "proven_too_late_at_start": bool(proven) and min(proven) <= 0.0,
        "kinds": {
            kind: {
                "t_bound_s": number(b.time) if b.proven else None,
                "status": b.status,
                "complete": b.complete,
                "nodes": b.nodes,
                "time_s": number(b.seconds, 6),
            }
            for kind, b in bounds.items()
        },
        "proof_file": None,
        "proof_sha256": None,
    }
