"""Margins at every time, through the convex hull of Bernstein points: an arithmetic of its own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from repair.arrays import Array
from repair.certify.certificate import CertificateRow, at_least, at_most
from repair.curves.base import Curve
from repair.curves.bspline import UniformBSpline
from repair.problem.limits import Limits

if TYPE_CHECKING:
    from repair.curves.bernstein import BernsteinCurve

__all__ = ["cut_pieces", "derivative_rows", "pieces_of", "seam_rows"]


def seam_rows(
    reference: Curve, curve: Curve, t_rep: float, *, jumps: bool, jump: float = 0.0
) -> list[CertificateRow]:
    """Jumps in position, velocity and acceleration where the repair leaves the reference.

    With ``jumps`` that in acceleration is told only: the repair may begin with any input of the vehicle's.
    ``jump`` is what a repair says that it begins with [m/s²].
    """
    here, after = reference.sample([t_rep]), curve.sample([t_rep])
    allowed, rows = jump, []
    for name, unit in (("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s²")):
        jump = float(np.max(np.abs(getattr(here, name) - getattr(after, name))))
        most = allowed if name == "acceleration" else 0.0
        row = at_most(f"jump in {name} at the seam", jump, most, "exact", unit)
        rows.append(replace(row, claim=not (jumps and name == "acceleration")))
    return rows


def pieces_of(curve: UniformBSpline | BernsteinCurve) -> tuple[Array, float]:
    """Bernstein points (M, p + 1, 2) of the curve's pieces, and their duration [s]."""
    if isinstance(curve, UniformBSpline):
        return curve.bernstein_segments(), curve.spacing
    return curve.points, curve.duration


def cut_pieces(points: Array, start: Array, end: Array) -> Array:
    """Bernstein points of the parts [start, end] (M,) of pieces (M, p + 1, d), by de Casteljau twice."""
    right = points.copy()
    degree = points.shape[1] - 1
    u = start[:, None, None]
    for k in range(degree):  # the part from start on
        right[:, : degree - k] = (1.0 - u) * right[:, : degree - k] + u * right[:, 1 : degree - k + 1]
    left = right.copy()
    w = ((end - start) / np.maximum(1.0 - start, 1e-15))[:, None, None]
    for k in range(degree):  # of that, the part up to end
        left[:, k + 1 :] = (1.0 - w) * left[:, k:-1] + w * left[:, k + 1 :]
    return left


def derivative_rows(
    curve: UniformBSpline | BernsteinCurve, limits: Limits, *, keeps_hull: bool
) -> list[CertificateRow]:
    """Hulls of the first three derivatives, each piece cut into 16 so that the hull is tight.

    Lateral speed, jerk and the accelerations along the axes are claimed of backends that keep hulls, and told
    of the others: what the vehicle may do is judged in the plane.
    """
    points, duration = pieces_of(curve)
    cuts = 16
    u = np.tile(np.arange(cuts) / cuts, len(points))
    fine = cut_pieces(np.repeat(points, cuts, axis=0), u, u + 1.0 / cuts)
    step, degree = duration / cuts, points.shape[1] - 1
    hull = []
    for order in (1, 2, 3):
        fine = (degree - order + 1) / step * np.diff(fine, axis=1)
        hull.append((fine.min(axis=(0, 1)), fine.max(axis=(0, 1))))
    (v_low, v_high), (a_low, a_high), (j_low, j_high) = hull
    rows = [
        at_least("speed s', least", float(v_low[0]), 0.0, "exact", "m/s"),
        at_most("speed s', largest", float(v_high[0]), limits.v_max, "exact", "m/s"),
    ]
    hulls = [
        at_most("lateral speed |l'|", _abs(v_low[1], v_high[1]), limits.v_lat, "exact", "m/s"),
        at_least("acceleration s'', least", float(a_low[0]), limits.a_min, "exact", "m/s²"),
        at_most("acceleration s'', largest", float(a_high[0]), limits.a_max, "exact", "m/s²"),
        at_most("lateral acceleration |l''|", _abs(a_low[1], a_high[1]), limits.a_lat, "exact", "m/s²"),
        at_most("jerk |s'''|", _abs(j_low[0], j_high[0]), limits.j_lon, "exact", "m/s³", 1e-4),
        at_most("jerk |l'''|", _abs(j_low[1], j_high[1]), limits.j_lat, "exact", "m/s³", 1e-4),
    ]
    return rows + [replace(row, claim=keeps_hull) for row in hulls]


def _abs(low: float, high: float) -> float:
    return float(max(-low, high))
