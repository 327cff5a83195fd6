"""The page of a study, or of one result, made of what was stored."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from repair.errors import RepairError
from repair.io.result_json import load_result
from repair.progress import Progress
from repair.report.page.html import study_page
from repair.report.page.one import result_page
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
            "command": "", "study": "", **store.about(), "version": ", ".join(store.versions()),
            "versions of the first row": _versions(store, done),
            "rows": f"{len(done)} of {len(tasks)} are there",
        }  # fmt: skip
        told = {name: text for name, text in told.items() if text and name != "schema"}
        files = {task["file"]: task["sha256"] for task in tasks}

        def wholes() -> Iterator[dict[str, Any] | None]:
            shown = Progress(len(done))
            for task in done:
                whole = store.whole(task["position"])
                yield None if whole is None else unpacked(whole)
                shown.one()
            shown.close()

        return study_page(rows, wholes(), told, files)


def _versions(store: Store, done: list[dict[str, Any]]) -> str:
    """What the first stored result was made with; empty where no result was kept."""
    kept = (store.whole(task["position"]) for task in done)
    first = next((whole for whole in kept if whole is not None), None)
    found = {} if first is None else unpacked(first)["record"].get("versions", {})
    return "\n".join(f"{name} {version}" for name, version in found.items())


def page_of_result(folder: Path) -> str:
    """The page of one result, as ``repair run --out`` wrote it.

    Raises
    ------
    RepairError
        If there is none, or Plotly is missing.
    """
    return result_page(load_result(folder))
