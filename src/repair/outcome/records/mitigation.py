"""What a result says of the motion that hits least hard."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from repair.arrays import number
from repair.bounds.latest import Bound
from repair.mitigation.mitigate import Mitigation, Motion
from repair.outcome.ending import columns_of, place_of

__all__ = ["mitigation_to_dict"]


def mitigation_to_dict(
    mitigation: Mitigation | None, bounds: Mapping[str, Bound] | None, first_step: int, dt: float
) -> dict[str, Any] | None:
    """Impact, full braking beside it, and the states until then; None where nobody asked.

    Parameters
    ----------
    mitigation : Mitigation or None
    bounds : mapping or None
        For whether the proof that nothing avoids it needs the edge of the road.
    first_step : int
        The planning problem's time step.
    dt : float
        Scenario time step [s].
    """
    if mitigation is None:
        return None
    best, braking = mitigation.best, mitigation.braking
    return {
        **_motion(best, first_step, dt),
        "full_braking": None if braking is None else _motion(braking, first_step, dt),
        "gained_mps": None if best is None or braking is None else _gained(best, braking),
        "proven": _proven((bounds or {}).get("vehicle")),
        "looked_until_s": number(mitigation.t_end),
        "tried": mitigation.tried,
        "complete": mitigation.complete,
        "solution_file": None,
    }


def _motion(motion: Motion | None, first_step: int, dt: float) -> dict[str, Any]:
    if motion is None:
        names = (
            "maneuver", "found_by", "ends", "contact_t_s", "obstacle_id", "from_behind", "impact_speed_mps",
            "own_speed_mps", "overlap_m", "place_m", "trajectory",
        )  # fmt: skip
        return dict.fromkeys(names)
    impact = motion.impact
    return {
        "maneuver": motion.maneuver,
        "found_by": motion.by,
        "ends": impact.kind,
        "contact_t_s": number(impact.time),
        "obstacle_id": impact.obstacle_id,
        "from_behind": impact.from_behind,
        "impact_speed_mps": number(impact.speed),
        "own_speed_mps": number(impact.own_speed),
        "overlap_m": number(impact.overlap),
        "place_m": place_of(impact.place),
        "trajectory": {
            "initial_time_step": first_step, "dt_s": number(dt), **columns_of(motion.states, motion.curve)
        },
    }  # fmt: skip


def _gained(best: Motion, braking: Motion) -> float | None:
    return number(max(braking.impact.speed - best.impact.speed, 0.0))


def _proven(bound: Bound | None) -> str | None:
    """``contact``, or ``contact_or_off_road`` where a proof needs the edge of the road; None without one."""
    proof = None if bound is None else bound.proof
    if proof is None or proof.time > 0.0:
        return None
    return "contact_or_off_road" if any(o < 0 for o in proof.obstacles) else "contact"
