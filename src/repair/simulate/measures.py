"""From drives to rows: what a policy did, beside what would have happened without it."""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import Array, number, wrap
from repair.simulate.data import Driven
from repair.study.rows import Table

__all__ = ["SIMULATION", "row_of"]


_COLUMNS: dict[str, type] = {
    "duration_s": float, "plan_contact_s": float, "plan_contact_id": int,
    "plan_contact_from_behind": bool, "plan_margin": bool,
    "contact_s": float, "contact_id": int, "contact_from_behind": bool, "impact_speed_mps": float,
    "ego_impact_speed_mps": float, "within_verified": bool, "interventions": int,
    "first_intervention_s": float, "braked_cycles": int, "peak_deceleration_mps2": float,
    "peak_jerk_mps3": float, "peak_lateral_acceleration_mps2": float, "deviation_ms": float, "pairs": int,
    "jumps": int, "dissolved": int, "lost": int, "cycles": int, "cut_short": int, "cycle_p50_ms": float,
    "cycle_max_ms": float,
}  # fmt: skip
#: What is stored of each drive; prediction, policy and shift are what varies.
SIMULATION = Table(
    "simulation", "`repair simulate --out`",
    {
        **dict.fromkeys(("file", "backend", "reference", "status", "detail"), str), **_COLUMNS,
        "variation": str, "row_time_s": float, "worker_peak_memory_mb": float,
    },
)  # fmt: skip


def row_of(driven: Driven, never: Driven, clearance: float, period: float) -> dict[str, Any]:
    """The measures of a drive.

    Parameters
    ----------
    driven, never : Driven
        With the policy, and with the plan followed whatever happens.
    clearance : float
        The margin [m].
    period : float
        From cycle to cycle [s].

    Returns
    -------
    dict
        Those columns of :data:`SIMULATION` that the drives tell.
    """
    hit, planned = driven.struck, never.struck
    modes = [c.mode for c in driven.cycles]
    left = [k for k, mode in enumerate(modes) if mode != "plan" and (k == 0 or modes[k - 1] == "plan")]
    spent = [1e3 * c.spent for c in driven.cycles]
    return {
        "duration_s": number(driven.states["t"][-1], 6),
        "plan_contact_s": None if planned is None else number(planned.time, 6),
        "plan_contact_id": None if planned is None else planned.obstacle_id,
        "plan_contact_from_behind": None if planned is None else planned.from_behind,
        "plan_margin": planned is not None or never.distance < clearance,
        "contact_s": None if hit is None else number(hit.time, 6),
        "contact_id": None if hit is None else hit.obstacle_id,
        "contact_from_behind": None if hit is None else hit.from_behind,
        "impact_speed_mps": None if hit is None else number(hit.speed, 4),
        "ego_impact_speed_mps": None if hit is None else number(hit.ego_speed, 4),
        "within_verified": driven.broken,
        "interventions": len(left),
        "first_intervention_s": number(driven.cycles[left[0]].t, 6) if left else None,
        "braked_cycles": modes.count("brake"),
        **_peaks(driven),
        "deviation_ms": number(_deviation(driven), 4),
        **_flicker(driven, period),
        "cycles": len(modes),
        "cut_short": sum(not c.complete for c in driven.cycles),
        "cycle_p50_ms": number(float(np.median(spent)), 3) if spent else None,
        "cycle_max_ms": number(max(spent), 3) if spent else None,
    }


def _peaks(driven: Driven) -> dict[str, float | None]:
    """From states at the scenario's steps."""
    speed, yaw = (np.asarray(driven.states[name]) for name in ("speed", "orientation"))
    a = np.diff(speed) / driven.dt
    rate = np.asarray(wrap(np.diff(yaw))) / driven.dt
    aside = np.abs(rate * 0.5 * (speed[1:] + speed[:-1]))
    return {
        "peak_deceleration_mps2": number(float(np.max(-a, initial=0.0)), 4),
        "peak_jerk_mps3": number(float(np.max(np.abs(np.diff(a)), initial=0.0)) / driven.dt, 3),
        "peak_lateral_acceleration_mps2": number(float(np.max(aside, initial=0.0)), 4),
    }


def _deviation(driven: Driven) -> float:
    """Distance to where the plan would be, over time [m s]."""
    ego, plan = (_places(driven, prefix) for prefix in ("", "plan_"))
    return float(np.trapezoid(np.hypot(*(ego - plan).T), dx=driven.dt)) if len(ego) > 1 else 0.0


def _places(driven: Driven, prefix: str) -> Array:
    return np.column_stack([driven.states[f"{prefix}{name}"] for name in ("x", "y")])


def _flicker(driven: Driven, period: float) -> dict[str, int]:
    """How the F-TTR runs down while the plan is followed.

    A jump is more than a step of the grid off; dissolved is a conflict that is gone before its F-TTR is due,
    lost one whose repair is gone before. Where a search is carried on in the next cycle there is no F-TTR
    yet, only a repair that can be waited for: such cycles make no pairs.
    """
    pairs = jumps = dissolved = lost = 0
    for one, two in zip(driven.cycles[:-1], driven.cycles[1:], strict=True):
        if one.mode != "plan" or one.f_ttr is None or one.f_ttr == float("inf"):
            continue
        waits = two.mode == "plan" and not two.complete
        if two.ttc < float("inf") and (waits or not one.complete):
            continue
        pairs += 1
        if two.ttc == float("inf"):
            dissolved += 1
        elif two.f_ttr is None:
            lost += one.f_ttr - period > driven.dt + 1e-9
        else:
            jumps += abs(two.f_ttr - (one.f_ttr - period)) > driven.dt + 1e-9
    return {"pairs": pairs, "jumps": jumps, "dissolved": dissolved, "lost": lost}
