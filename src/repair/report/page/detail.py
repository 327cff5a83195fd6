"""What the page shows of one row, from the stored result: thinned out, rounded to what can be seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.io.drawing_json import drawing_from
from repair.outcome.data import Drawing, Line
from repair.report.lines import lateral_acceleration

__all__ = ["case_of", "detail_of"]

_POINTS = 70  # of a curve


def detail_of(
    record: Mapping[str, Any], drawing: Mapping[str, Any] | None, certificate: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The curves of one result, what was said of each time-to-repair, its limits, and its certificate."""
    detail: dict[str, Any] = {
        "sentence": record["status_sentence"],
        "status": record["status"],
        "ttc": record["ttc_s"],
        "f_ttr": record["f_ttr_s"],
        "probes": [_probe(probe) for probe in record["probes"]],
        "limits": {
            name: record["limits"].get(f"{name}_{unit}")
            for name, unit in (("v_max", "mps"), ("a_min", "mps2"), ("a_max", "mps2"), ("a_lat", "mps2"),
                               ("a_total", "mps2"))
        },
        "notes": list(record["notes"]),
        "lines": [],
        "certificate": certificate,
    }  # fmt: skip
    if drawing is None:
        return detail
    drawn = drawing_from(drawing)
    body = np.asarray(drawn.body)
    detail.update(
        length=round(float(np.ptp(body[:, 0])), 2), width=round(float(np.ptp(body[:, 1])), 2),
        start=drawn.start_s, until=drawn.until,
        lines=[_line(line, drawn.lines[0]) for line in drawn.lines if line.kind != "stage"],
        ego=_poses(drawn), dt=record["trajectory"]["dt_s"],
    )  # fmt: skip
    return detail


def case_of(drawing: Mapping[str, Any]) -> dict[str, Any]:
    """Road and traffic, which all rows of one scenario and reference have in common."""
    drawn = drawing_from(drawing)
    return {
        "areas": [_outline(area, 60) for area in drawn.areas],
        "boxes": [
            {"id": box.id, "runs": runs}
            for box in drawn.boxes
            if (runs := _runs(box.t, box.low, box.high, drawn.s_offset))
        ],
        "offset": round(drawn.s_offset, 2),
        "steps": list(drawn.steps),
        "bodies": [
            {
                "id": body.id,
                "role": body.role,
                "path": _columns(_there(body.centres), 40),
                "shapes": {str(step): _outline(points, 12) for step, points in body.outlines.items()},
            }
            for body in drawn.bodies
        ],
    }


def _probe(probe: Mapping[str, Any]) -> dict[str, Any]:
    details = "; ".join(
        f"{each['reason']} at {each['t_s']:.2f} s: {each['detail']}" for each in probe["details"]
    )
    return {
        "t": probe["t_rep_s"],
        "ok": probe["feasible"],
        "by": probe.get("backend") or "",
        "words": "; ".join(probe["tried"])
        or ("feasible" if probe["feasible"] else ", ".join(probe["reasons"])),
        "why": details,
    }


def _thin(count: int, most: int = _POINTS) -> Any:
    """Which of so many samples are kept; the first and the last always."""
    if count <= most:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))


def _line(line: Line, reference: Line) -> dict[str, Any]:
    keep = _thin(len(line.t))
    beside = line.l - np.interp(line.t, reference.t, reference.l)
    columns = {
        "t": line.t, "s": line.s, "l": line.l, "x": line.x, "y": line.y, "v": line.speed,
        "a": line.acceleration,
        "across": lateral_acceleration(line), "beside": beside,
    }  # fmt: skip
    return {
        "kind": line.kind,
        "name": line.name,
        "t_rep": line.t_rep,
        **{name: _plain(values[keep]) for name, values in columns.items()},
    }


def _poses(drawn: Drawing) -> list[list[float]]:
    keep = _thin(len(drawn.ego), 120)
    return [[round(float(v), 3) for v in drawn.ego[k]] + [int(k)] for k in keep]


def _runs(t: Array, low: Array, high: Array, offset: float) -> list[list[list[float]]]:
    """Times, and the ends of the obstacle itself, where it is in the way: one run for each time it is."""
    there = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
    if not len(there):
        return []
    parts = np.split(there, np.flatnonzero(np.diff(there) > 1) + 1)
    return [
        [_plain(t[part]), _plain(low[part] + offset), _plain(high[part] - offset)]
        for part in (part[_thin(len(part), 40)] for part in parts)
    ]


def _there(points: Array) -> Array:
    made: Array = points[np.isfinite(points).all(axis=1)]
    return made


def _outline(points: Array, most: int) -> list[list[float]]:
    return _columns(np.vstack([points, points[:1]])[_thin(len(points) + 1, most)], most)


def _columns(points: Array, most: int) -> list[list[float]]:
    kept = points[_thin(len(points), most)] if len(points) else points
    return [_plain(kept[:, 0]), _plain(kept[:, 1])] if len(kept) else [[], []]


def _plain(values: Sequence[float] | Array) -> list[float]:
    made: list[float] = (np.round(np.asarray(values, dtype=float), 2) + 0.0).tolist()
    return made
