"""A result as a film: the plan as it was, and beside it the plan repaired."""

from __future__ import annotations

import math

import numpy as np

from repair.arrays import Array
from repair.outcome.data import Line, Outcome
from repair.report.birdseye import window_around
from repair.report.film.bodies import kept
from repair.report.film.frames import Film, Panel
from repair.report.lines import drawing_in, title_of
from repair.timegrid import INSTANT

__all__ = ["film_of_result"]

_STANDS = 0.3  # below this speed a heading is that of before [m/s]


def film_of_result(outcome: Outcome) -> Film:
    """The film of a result.

    Parameters
    ----------
    outcome : Outcome

    Raises
    ------
    OutputError
        If there is nothing to draw.
    """
    drawing = drawing_in(outcome)
    dt = float(outcome.record["trajectory"]["dt_s"])
    last = min(round(drawing.until / dt), len(drawing.ego) - 1)
    t = np.arange(last + 1) * dt
    f_ttr = outcome.f_ttr if outcome.status == "found" else None
    plan = _along(drawing.lines[0], t)
    mark = None if f_ttr is None else plan[min(round(f_ttr / dt), last), :2]
    hit = None if outcome.ttc == np.inf else math.ceil((outcome.ttc - INSTANT) / dt)
    planned = tuple(
        f"as planned{', in conflict' if hit is not None and k >= hit else ''}" for k in range(last + 1)
    )
    driven = tuple(_countdown(outcome, f_ttr, float(now)) for now in t)
    (xs, ys), _ = window_around(outcome)
    return Film(
        title_of(outcome), dt, drawing, outcome.record["conflict"]["obstacle_id"],
        (
            Panel(plan, True, hit, planned),
            Panel(np.asarray(drawing.ego[: last + 1]), False, None, driven, mark),
        ),
        np.tile([*xs, *ys], (last + 1, 1)),
    )  # fmt: skip


def _along(line: Line, t: Array) -> Array:
    """x, y and heading of a line at times; where it stands, the heading stays."""
    x, y = np.interp(t, line.t, line.x), np.interp(t, line.t, line.y)
    across = np.column_stack([np.gradient(line.x), np.gradient(line.y)])
    heading = kept(np.unwrap(np.arctan2(across[:, 1], across[:, 0])), line.speed > _STANDS)
    return np.column_stack([x, y, np.interp(t, line.t, heading)])


def _countdown(outcome: Outcome, f_ttr: float | None, t: float) -> str:
    """What of the time to react is left."""
    if f_ttr is None:
        return f"driven ({outcome.status.replace('_', ' ')})"
    left = f_ttr - t
    return f"repaired: F-TTR in {left:.2f} s" if left > INSTANT else f"repaired, since {f_ttr:g} s"
