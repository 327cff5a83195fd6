"""The page of one result."""

from __future__ import annotations

from typing import Any

from repair.io.drawing_json import drawing_to_dict
from repair.outcome.data import Outcome
from repair.report.page.html import study_page

__all__ = ["result_page"]

_LIKE_A_STUDY = (
    "backend", "status", "ttc_s", "f_ttr_s", "maneuver", "repaired_by", "by_fallback", "decided_by",
    "checked_until_s",
)  # fmt: skip


def result_page(outcome: Outcome) -> str:
    """The page of a study with one row.

    Parameters
    ----------
    outcome : Outcome
        Without a drawing, its curves are left out.

    Raises
    ------
    PlotlyMissing
        If Plotly is not installed.
    """
    record = outcome.record
    conflict, source, metrics = record["conflict"], record["provenance"], record.get("metrics") or {}
    row: dict[str, Any] = {name: record.get(name) for name in _LIKE_A_STUDY}
    row.update(
        file=source["name"] or record["scenario"], reference=record["config"]["reference"]["source"],
        conflict=conflict["kind"], search_time_s=record["time_s"].get("search"), detail="", variation="",
        ttr_s=metrics.get("ttr", {}).get("value_s"), ending=(record.get("terminal") or {}).get("ending"),
        probes=" ".join(f"{p['t_rep_s']:g}:{'-'.join(('', *p['reasons'])) or '+'}" for p in record["probes"]),
    )  # fmt: skip
    drawing = None if outcome.drawing is None else drawing_to_dict(outcome.drawing)
    told = {"command": "repair run", "versions": "\n".join(f"{k} {v}" for k, v in record["versions"].items())}
    whole = {"record": record, "drawing": drawing}
    return study_page([row], [whole], told, {row["file"]: source["sha256"] or ""})
