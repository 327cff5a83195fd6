"""What is driven after the evasive part, as plain values."""

from __future__ import annotations

from typing import Any

from repair.arrays import number
from repair.onward.leg import leg_to_dict
from repair.onward.plan import Onward

__all__ = ["onward_to_dict"]


def onward_to_dict(onward: Onward | None) -> dict[str, Any] | None:
    """What ``result.json`` holds of it; None where nobody asked."""
    if onward is None:
        return None
    leg = onward.leg
    return {
        "kind": onward.kind,
        "reached": onward.reached,
        "how": onward.how,
        "sentence": _sentence(onward),
        "from_s": None if leg is None else number(leg.t_start),
        "until_s": None if leg is None else number(leg.t_end),
        "missed": [
            {"condition": m.condition, f"by_{_UNITS[m.unit]}": number(m.by), "t_s": number(m.time)}
            for m in onward.missed
        ],
        "tried": onward.tried,
        "leg": None if leg is None else leg_to_dict(leg),
    }


_UNITS = {"s": "s", "m": "m", "rad": "rad", "m/s": "mps"}


def _sentence(onward: Onward) -> str:
    leg = onward.leg
    if onward.kind == "rejoin":
        if onward.how == "short":
            return "no room for a way back to the reference: it is known for less than 2 s after the repair"
        if leg is None:
            return f"no way back to the reference is known, free and comfortable ({onward.tried} were tried)"
        where = {
            "position": "where the reference is at that time",
            "speed": "on its path, at its speed",
            "path": "on its path, and as near to its speed as is comfortable",
        }
        return f"evades until {leg.t_start:.2f} s, is back at {leg.t_end:.2f} s: {where[onward.how]}"
    if onward.reached:
        if leg is None:
            return "the goal is reached by what is driven anyway"
        return f"leaves what is driven anyway at {leg.t_start:.2f} s, reaches the goal at {leg.t_end:.2f} s"
    missed = ", ".join(f"{m.condition} by {m.by:.2f} {m.unit} at {m.time:.2f} s" for m in onward.missed)
    if not missed:
        return "the goal is not reached: it has no state that can be read"
    return f"the goal is not reached: missed are {missed} ({onward.tried} ways on were tried)"
