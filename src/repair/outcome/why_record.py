"""What a result says of why there is no repair, or no later one."""

from __future__ import annotations

from typing import Any

from repair.arrays import number
from repair.why.explain import Explanation
from repair.why.kinds import KINDS
from repair.why.least import Relaxation

__all__ = ["explanation_to_dict"]


def explanation_to_dict(explanation: Explanation | None) -> dict[str, Any] | None:
    """Plain values; None where none was asked for, or there is nothing to explain."""
    if explanation is None:
        return None
    blocks = explanation.blocking
    return {
        "t_rep_s": number(explanation.t_rep),
        "asked": list(explanation.asked),
        "exists_by": explanation.exists_by,
        "proven": explanation.proven,
        "decides": list(explanation.decides),
        "obstacles": None
        if blocks is None
        else [
            {"obstacle_id": one.id, "from_s": number(one.since), "to_s": number(one.until)}
            for one in blocks.obstacles
        ],
        "obstacles_minimal": blocks is not None and blocks.minimal,
        "obstacles_proven": blocks is not None and blocks.proven,
        "road_in_proof": blocks is not None and blocks.road,
        "relaxations": [_relaxation(one) for one in explanation.relaxations],
        "complete": explanation.complete,
        "not_tried": list(explanation.not_tried),
        "tests": explanation.tests,
        "time_s": number(explanation.seconds, 6),
    }


def _relaxation(one: Relaxation) -> dict[str, Any]:
    return {
        "kind": one.kind,
        "obstacle_id": one.obstacle_id,
        "obstacle_index": one.index,
        "status": one.status,
        "amount": number(one.amount),
        "unit": KINDS[one.kind].unit,
        "not_with": number(one.half),
        "proven_too_little": number(one.proven),
        "tried_up_to": number(one.most),
        "found_by": one.by or None,
        "detail": one.detail,
    }
