"""TTC: where the reference stops being drivable."""

from __future__ import annotations

import numpy as np

from repair.check.checker import Checker
from repair.check.verdict import Conflict, Reason, Verdict
from repair.curves.base import Curve
from repair.timegrid import on_grid, steps_until
from repair.world.advance import FINEST
from repair.world.boxes import Occupancy
from repair.world.occupancy import first_entry

__all__ = ["detect_conflict"]


def detect_conflict(
    reference: Curve, occupancy: Occupancy, checker: Checker, t_end: float
) -> tuple[Conflict, Verdict]:
    """TTC: the first violation of any kind on the reference, at the scenario's steps.

    Returns
    -------
    Conflict
        The first violation, at the scenario's step at or before it; with the time of contact of the true
        shapes beside it. With ``checker.conflict: boxes`` an inflated box that is entered at a step counts
        as well, and contact at the step after it (the paper's TTC).
    Verdict
        The checker's whole verdict on the reference.
    """
    dt = checker.scene.dt
    verdict = checker.check_reference(reference, t_end)
    contact = checker.contact(reference, t_end)
    candidates: list[tuple[float, int, str, int | None, str, float]] = []
    boxes = checker.config.conflict == "boxes"
    if boxes:
        steps = min(steps_until(t_end, dt), checker.scene.n_steps)
        sampled = reference.sample(np.arange(steps + 1) * dt)
        entry = first_entry(occupancy, sampled)
        if entry is not None:
            who = int(occupancy.ids[entry[1]])
            at = float(sampled.t[entry[0]])
            candidates.append((at, 0, "margin", who, "", at))
    for violation in verdict.violations:
        at = on_grid(violation.time + FINEST, dt)  # a time of contact is early by no more than that
        if boxes and violation.reason is Reason.COLLISION and at < violation.time:
            at += dt  # the paper looks at steps
        said = violation.detail if violation.obstacle_id is None else ""
        candidates.append((at, 1, violation.reason.value, violation.obstacle_id, said, violation.time))
    if not candidates:
        return Conflict(float("inf")), verdict
    time, _, kind, obstacle, said, exact = min(candidates, key=lambda c: c[:2])
    if contact is None:
        return Conflict(time, kind, obstacle, detail=said, exact_time=exact), verdict
    touched = contact.time, contact.obstacle_id, contact.from_behind
    return Conflict(time, kind, obstacle, *touched, said, exact), verdict
