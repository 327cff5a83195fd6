"""TTC: where the reference stops being drivable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from repair.check.checker import Checker
from repair.check.verdict import Conflict, Reason, Verdict, Violation
from repair.curves.base import Curve
from repair.timegrid import on_grid, steps_until
from repair.world.advance import FINEST
from repair.world.boxes import Boxes
from repair.world.occupancy import first_entry

__all__ = ["detect_conflict"]


def detect_conflict(
    reference: Curve, boxes: Boxes, checker: Checker, t_end: float
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
    candidates: list[tuple[float, int, Violation]] = []
    by_boxes = checker.config.conflict == "boxes"
    if by_boxes:
        steps = min(steps_until(t_end, dt), checker.scene.n_steps)
        sampled = reference.sample(np.arange(steps + 1) * dt)
        entry = first_entry(boxes.occupancy, sampled)
        if entry is not None:
            at = float(sampled.t[entry[0]])
            candidates.append((at, 0, Violation(Reason.MARGIN, at, "", int(boxes.occupancy.ids[entry[1]]))))
    for violation in verdict.violations:
        at = on_grid(violation.time + FINEST, dt)  # a time of contact is early by no more than that
        if by_boxes and violation.reason is Reason.COLLISION and at < violation.time:
            at += dt  # the paper looks at steps
        candidates.append((at, 1, violation))
    if not candidates:
        return Conflict(float("inf")), verdict
    time, _, first = min(candidates, key=lambda c: c[:2])
    conflict = Conflict(
        time,
        first.reason.value,
        first.obstacle_id,
        detail=first.detail if first.obstacle_id is None else "",
        exact_time=first.time,
        place=first.place,
    )
    if contact is not None:
        conflict = replace(
            conflict,
            contact_time=contact.time,
            contact_id=contact.obstacle_id,
            from_behind=contact.from_behind,
        )
    return conflict, verdict
