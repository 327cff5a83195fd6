"""A drive of the closed loop as a film: what a policy did, beside the plan that was kept to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.outcome.data import Drawing
from repair.report.film.frames import Film, Panel

__all__ = ["film_of_drive"]

Row = Mapping[str, Any]
_LEAST, _AROUND = 28.0, 15.0  # half of what is seen along x at least, and beyond the two egos [m]
_HIGH = 0.75  # height to width of what is seen
_SAYS = {"repair": "a repair is driven", "brake": "full braking"}


def film_of_drive(row: Row, drawing: Drawing) -> Film:
    """The film of a drive; what is seen moves along with the ego.

    Parameters
    ----------
    row : mapping
        As it is stored, with its ``drive``.
    drawing : Drawing
        What is around it.
    """
    drive = row["drive"]
    dt, t = float(drive["dt"]), np.asarray(drive["states"]["t"])
    plan, ego = (
        np.column_stack([drive["states"][f"{prefix}{name}"] for name in ("x", "y", "orientation")])
        for prefix in ("plan_", "")
    )
    planned_hit, hit = (_step(row[name], dt, len(t)) for name in ("plan_contact_s", "contact_s"))
    left = row["first_intervention_s"]
    mark = None if left is None else plan[min(round(left / dt), len(t) - 1), :2]
    panels = (
        Panel(plan, True, planned_hit, tuple(_planned(k, planned_hit) for k in range(len(t)))),
        Panel(ego, False, hit, _titles(row, drive["cycles"], t, hit), mark),
    )
    shift = f", traffic {row['shift_s']:g} s later" if row["shift_s"] else ""
    title = f"{row['file'].removesuffix('.xml')}{shift}, {row['prediction']}"
    opponent = row["contact_id"] if row["contact_id"] is not None else row["plan_contact_id"]
    stays = plan if planned_hit is None else plan[np.minimum(np.arange(len(t)), planned_hit)]
    return Film(title, dt, drawing, opponent, panels, _windows(stays, ego))


def _step(contact: float | None, dt: float, count: int) -> int | None:
    """The first step at which a contact has happened, or the last one before the drive ended with it."""
    return None if contact is None else min(int(np.ceil(contact / dt - 1e-6)), count - 1)


def _planned(k: int, hit: int | None) -> str:
    return "as planned, in contact" if hit is not None and k >= hit else "as planned"


def _titles(row: Row, cycles: Sequence[Mapping[str, Any]], t: Array, hit: int | None) -> tuple[str, ...]:
    """What is done at each step, and how much of the F-TTR is left."""
    begins = np.array([cycle["t"] for cycle in cycles])
    made = []
    for k, now in enumerate(t.tolist()):
        if hit is not None and k >= hit:
            made.append(f"{row['policy']}: contact at {row['impact_speed_mps']:.1f} m/s")
            continue
        cycle = cycles[max(int(np.searchsorted(begins, now + 1e-6, side="right")) - 1, 0)]
        words = _SAYS.get(cycle["mode"], "the plan is followed")
        if cycle["mode"] == "plan" and cycle["f_ttr"] is not None:
            words = f"F-TTR in {max(cycle['f_ttr'] - (now - cycle['t']), 0.0):.2f} s"
        elif cycle["mode"] == "plan" and (left := row["first_intervention_s"]) is not None and now > left:
            words = "back to the plan"
        made.append(f"{row['policy']}: {words}")
    return tuple(made)


def _windows(plan: Array, ego: Array) -> Array:
    """Ranges of x and y (T, 4) that hold both [m]."""
    low, high = (pick(plan[:, :2], ego[:, :2]) for pick in (np.minimum, np.maximum))
    middle, apart = 0.5 * (low + high), high - low
    half = np.maximum(_LEAST, np.maximum(apart[:, 0], apart[:, 1] / _HIGH) / 2.0 + _AROUND)
    # It only grows: what is seen does not pump.
    half = np.maximum.accumulate(half)
    x, y = middle.T
    return np.column_stack([x - half, x + half, y - _HIGH * half, y + _HIGH * half])
