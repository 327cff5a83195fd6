"""The bound on the time to react, in words."""

from __future__ import annotations

from typing import Any

__all__ = ["bound_rows"]

_FOR = {"vehicle": "for the vehicle", "search": "for what the checker calls feasible"}
_NO_PROOF = {
    "open": "a relaxed motion meets nothing",
    "nodes": "bound.nodes reached",
    "time": "bound.time_limit reached",
    "reference": "the reference itself goes beyond what is assumed",
    "model": "the vehicle is no kinematic single-track model",
    "limits_off": "checker.limits is off",
    "no_conflict": "there is no conflict",
}


def bound_rows(content: dict[str, Any]) -> list[tuple[str, str]]:
    """From when on it is proven too late, for whom, and how far that is from the F-TTR.

    Parameters
    ----------
    content : dict
        What ``result.json`` holds.
    """
    bound = content.get("bound")
    if not bound or content["ttc_s"] is None:
        return []
    parts = []
    for kind, one in bound["kinds"].items():
        if one["t_bound_s"] is not None:
            parts.append(f"proven too late from {_seconds(one['t_bound_s'])} on {_FOR[kind]}")
        else:
            parts.append(f"no proof before the conflict {_FOR[kind]} ({_NO_PROOF[one['status']]})")
    rows = [("Bound", "; ".join(parts))]
    if bound["gap_s"] is not None:
        end = "bound" if bound["t_bound_s"] is not None else "conflict"
        words = f"{_seconds(bound['gap_s'])} from the F-TTR to the {end}"
        if bound["proven_optimal"]:
            words += ": no later time-to-repair on the search's grid has a repair"
        rows.append(("Gap", words))
    return rows


def _seconds(value: float) -> str:
    """With three decimals where two would hide something."""
    return f"{value:.2f} s" if abs(value - round(value, 2)) < 1e-6 else f"{value:.3f} s"
