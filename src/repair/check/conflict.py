"""TTC: where the reference stops being drivable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from repair.check.checker import Checker
from repair.check.verdict import Conflict, Verdict
from repair.curves.base import Curve
from repair.timegrid import on_grid, steps_until
from repair.world.boxes import Occupancy
from repair.world.occupancy import first_entry

if TYPE_CHECKING:
    pass

__all__ = ["detect_conflict"]


def detect_conflict(
    reference: Curve, occupancy: Occupancy, checker: Checker, t_end: float
) -> tuple[Conflict, Verdict]:
    """TTC: the first violation of any kind on the reference, at the scenario's steps.

    Returns
    -------
    Conflict
        The paper's TTC (inflated occupancy entered), or an earlier contact, end of the road, or
        kinematic impossibility; with the contact TTC by true rectangles beside it.
    Verdict
        The checker's whole verdict on the reference.
    """
    dt = checker.scene.dt
    steps = min(steps_until(t_end, dt), checker.scene.n_steps)
    sampled = reference.sample(np.arange(steps + 1) * dt)
    entry = first_entry(occupancy, sampled)
    verdict = checker.check_reference(reference, t_end)
    contact = checker.contact(reference, t_end)
    candidates: list[tuple[float, int, str, int | None]] = []
    if entry is not None:
        candidates.append((float(sampled.t[entry[0]]), 0, "margin", int(occupancy.ids[entry[1]])))
    for violation in verdict.violations:
        at = on_grid(violation.time, dt)
        who = contact.obstacle_id if contact is not None and violation.reason.value == "collision" else None
        candidates.append((at, 1, violation.reason.value, who))
    touched = (contact.time, contact.obstacle_id, contact.from_behind) if contact is not None else None
    if not candidates:
        return Conflict(float("inf")), verdict
    first = min(candidates, key=lambda c: c[:2])
    return (
        Conflict(
            time=first[0],
            kind=first[2],
            obstacle_id=first[3],
            contact_time=touched[0] if touched else float("inf"),
            contact_id=touched[1] if touched else None,
            from_behind=bool(touched and touched[2]),
        ),
        verdict,
    )
