"""The page of a study, or of one result, made of what was stored."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from repair.errors import RepairError
from repair.io.drawing_json import drawing_to_dict
from repair.io.result_json import load_result
from repair.report.page.html import study_page
from repair.study.plan import package_version
from repair.study.rows import STUDY_COLUMNS
from repair.study.store import Store
from repair.study.task import unpacked

__all__ = ["page_of_result", "page_of_study"]


def page_of_study(folder: Path) -> str:
    """The page of the study in a folder.

    Raises
    ------
    RepairError
        If there is no row yet, or Plotly is missing.
    """
    with Store(folder, readonly=True) as store:
        rows, tasks = list(store.rows()), store.tasks()
        if not rows:
            raise RepairError(f"{store.path} holds no row of its study yet")
        done = [task for task in tasks if task["done"]]
        told = {
            "command": "", "study": "", **store.about(), "version": package_version(),
            "rows": f"{len(done)} of {len(tasks)} are there",
        }  # fmt: skip
        told = {name: text for name, text in told.items() if text and name != "schema"}
        files = {task["file"]: task["sha256"] for task in tasks}

        def wholes() -> Iterator[dict[str, Any] | None]:
            for task in done:
                whole = store.whole(task["position"])
                yield None if whole is None else unpacked(whole)

        return study_page(rows, wholes(), told, files)


def page_of_result(folder: Path) -> str:
    """The page of one result, as ``repair run --out`` wrote it.

    Raises
    ------
    RepairError
        If there is none, or Plotly is missing.
    """
    outcome = load_result(folder)
    record = outcome.record
    row: dict[str, Any] = {name: record.get(name) for name in STUDY_COLUMNS}
    conflict, source = record["conflict"], record["provenance"]
    row.update({name: conflict[name] for name in ("obstacle_id", "margin_only", "from_behind")})
    row.update(
        file=source["name"] or record["scenario"], reference=record["config"]["reference"]["source"],
        conflict=conflict["kind"], search_time_s=record["time_s"].get("search"), detail="", variation="",
        probes=" ".join(f"{p['t_rep_s']:g}:{'-'.join(('', *p['reasons'])) or '+'}" for p in record["probes"]),
    )  # fmt: skip
    whole = {
        "record": record,
        "drawing": None if outcome.drawing is None else drawing_to_dict(outcome.drawing),
    }
    told = {"command": "repair run", "versions": "\n".join(f"{k} {v}" for k, v in record["versions"].items())}
    return study_page([row], [whole], told, {row["file"]: source["sha256"] or ""})
