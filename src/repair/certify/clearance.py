"""Distance to the inflated boxes, by hull and by sampling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.certify.certificate import SAMPLE, CertificateRow, at_least
from repair.certify.hull import cut_pieces, pieces_of
from repair.curves.bspline import UniformBSpline
from repair.timegrid import steps_until
from repair.world.boxes import Occupancy

if TYPE_CHECKING:
    from repair.curves.bernstein import BernsteinCurve

_NAME = "distance to the nearest inflated obstacle"

__all__ = ["boxes_kept", "clearance_rows", "jump_said"]


def boxes_kept(content: Mapping[str, Any]) -> float | None:
    """How far into the inflated boxes a repair says that it may go [m, negative]; None if it says nothing.

    Boxes in (s, l) are wider than the vehicles in them. A hard backend keeps out of them, up to the margin
    that its feasible solve names; a soft one promises nothing of them, and is judged by the true shapes.
    """
    best = [p for p in content["probes"] if p["feasible"] and p["t_rep_s"] == content["f_ttr_s"]]
    said = content.get("capabilities")
    # In results of earlier versions the hard backends are those with this residual.
    hard = bool(best) and (
        said.get("keeps_hull", False) if said else "obstacles" in best[0].get("residuals", {})
    )
    if not hard:
        return None
    return min(0.0, float(best[0].get("margin_m") or 0.0))


def jump_said(content: Mapping[str, Any]) -> float:
    """By how much the acceleration jumps where a repair begins, by its own word [m/s²]."""
    best = [p for p in content["probes"] if p["feasible"] and p["t_rep_s"] == content["f_ttr_s"]]
    return abs(float(best[0].get("jump_mps2") or 0.0)) if best else 0.0


def clearance_rows(
    curve: UniformBSpline | BernsteinCurve,
    occupancy: Occupancy,
    dt: float,
    t_end: float,
    allowed: float | None,
    at_steps: bool = False,
) -> list[CertificateRow]:
    """Distance to the nearest inflated box, by hull and by sampling; negative inside of it.

    ``allowed`` is how far into a box the repair may go at most; with None the distance is told only, but for
    the scenario's own steps where ``at_steps`` (``checker.margin``, which is judged at these).

    The distance to a box is the largest of the four signed distances to its sides. Pieces are cut at
    the scenario's steps: in between the sides move linearly, and the Bernstein points of curve minus
    side bound their distance.
    """
    if not len(occupancy):
        return []
    t_end = min(t_end, curve.t_end)
    points, duration = pieces_of(curve)
    steps = np.arange(np.ceil(curve.t_start / dt), steps_until(t_end, dt) + 1) * dt
    grid = np.linspace(curve.t_start, t_end, max(2, round((t_end - curve.t_start) / (2 * SAMPLE))) + 1)
    knots = curve.t_start + np.arange(len(points) + 1) * duration
    edges = np.unique(np.round(np.concatenate([steps, grid, knots[knots <= t_end]]), 10))
    edges = edges[(edges >= curve.t_start) & (edges <= t_end)]
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-8])]
    start, end = edges[:-1], edges[1:]
    piece = np.clip(np.floor(((start + end) / 2 - curve.t_start) / duration), 0, len(points) - 1).astype(
        np.intp
    )
    origin = curve.t_start + piece * duration
    u0, u1 = (np.clip((x - origin) / duration, 0.0, 1.0) for x in (start, end))
    fine = cut_pieces(points[piece], u0, u1)
    sides_start, sides_end = _sides(occupancy, start), _sides(occupancy, end)
    share = np.linspace(0.0, 1.0, fine.shape[1])[None, :, None]
    least, sampled, stepped = np.inf, np.inf, np.inf
    at, on = curve.sample(edges).position, curve.sample(steps).position
    at_sides, on_sides = _sides(occupancy, edges), _sides(occupancy, steps)
    for k in range(len(occupancy)):
        line = (1.0 - share) * sides_start[k][:, None] + share * sides_end[k][:, None]
        distance = np.max(np.min(_signed(fine) - line, axis=1), axis=1)
        least = min(least, float(np.nanmin(distance, initial=np.inf)))
        sampled = min(sampled, _nearest(at, at_sides[k]))
        stepped = min(stepped, _nearest(on, on_sides[k]))
    if not np.isfinite(sampled):
        return []
    limit = 0.0 if allowed is None else allowed
    rows = [
        at_least(_NAME, least, limit, "exact", "m"),
        at_least(_NAME, sampled, limit, "sampled", "m"),
    ]
    if allowed is None:
        rows = [replace(row, claim=False) for row in rows]
    if at_steps:
        rows.append(at_least(f"{_NAME}, at the steps", stepped, 0.0, "sampled", "m"))
    return rows


def _nearest(position: Array, sides: Array) -> float:
    """The least distance to one box at these instants."""
    return float(np.nanmin(np.max(_signed(position) - sides, axis=-1), initial=np.inf))


def _sides(occupancy: Occupancy, times: Array) -> Array:
    """Signed sides (N, K, 4) of the boxes: behind, ahead, right, left."""
    lower, upper = occupancy.at(times)
    return np.stack([-lower[..., 0], upper[..., 0], -lower[..., 1], upper[..., 1]], axis=-1)


def _signed(position: Array) -> Array:
    """Positions (..., 2) in the signs of :func:`_sides`."""
    s, l = position[..., 0], position[..., 1]  # noqa: E741
    return np.stack([-s, s, -l, l], axis=-1)
