"""The page itself: one file of HTML, with Plotly's script, all data and no reference to anywhere."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from repair.errors import OutputError
from repair.report.page.detail import case_of, detail_of
from repair.report.page.figures import figures_of, summary_of, verdict

__all__ = ["PlotlyMissing", "study_page"]

_HERE = Path(__file__).parent
_SHOWN = (
    "file", "reference", "backend", "variation", "status", "conflict", "ttc_s", "ttr_s", "f_ttr_s",
    "maneuver", "repaired_by", "ending", "search_time_s", "certificate", "detail",
)  # fmt: skip


class PlotlyMissing(OutputError):
    """The library that draws the page is not installed."""


def study_page(
    rows: Sequence[Mapping[str, Any]],
    wholes: Iterable[Mapping[str, Any] | None],
    about: Mapping[str, str],
    files: Mapping[str, str],
) -> str:
    """The page of a study.

    Parameters
    ----------
    rows : sequence of mapping
        With the columns of a study.
    wholes : iterable of mapping or None
        The whole result of each row, ``record``, ``drawing`` and perhaps ``certificate``, where it was kept.
    about : mapping
        What was run: command, versions, the study's own text; by name.
    files : mapping
        Checksum of each scenario, by name.

    Raises
    ------
    PlotlyMissing
        If Plotly is not installed.
    """
    script = _plotly()
    cases: dict[str, str] = {}
    details: list[str | None] = []
    for row, whole in zip(rows, wholes, strict=True):
        if whole is None:
            details.append(None)
            continue
        name = f"{row['file']} {row['reference']}"
        drawing = whole["drawing"]
        if drawing is not None and name not in cases:
            cases[name] = _packed(case_of(drawing))
        details.append(_packed(detail_of(whole["record"], drawing, whole.get("certificate"))))
    figures = figures_of(rows)
    head, body = summary_of(rows)
    columns = [name for name in _SHOWN if any(row.get(name) not in (None, "") for row in rows)]
    data = {
        "columns": columns,
        "rows": [[row.get(name) for name in columns] for row in rows],
        "names": [f"{row['file']} {row['reference']}" for row in rows],
        "cases": cases,
        "details": details,
        "figures": figures,
    }
    return _text("page.html").format(
        style=_text("page.css"), kind="one" if len(rows) == 1 else "many",
        verdict=escape(verdict(rows)), about=_about(about, files),
        summary=_table(head, body), figures=_figures(figures), plotly=_in_script(script),
        data=_in_script(json.dumps(data, allow_nan=False, separators=(",", ":"))), script=_text("page.js"),
    )  # fmt: skip


def _plotly() -> str:
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise PlotlyMissing(f"a report needs the package plotly: pip install plotly ({error})") from error
    return str(get_plotlyjs())


def _text(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _in_script(text: str) -> str:
    """Text that does not end the element which it stands in."""
    return text.replace("</", "<\\/").replace("<!--", "<\\!--")


def _packed(content: Mapping[str, Any]) -> str:
    plain = json.dumps(content, allow_nan=False, separators=(",", ":")).encode("utf-8", "backslashreplace")
    return base64.b64encode(gzip.compress(plain, 9, mtime=0)).decode("ascii")


def _table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    lines = ["".join(f"<th scope='col'>{escape(cell)}</th>" for cell in head)]
    lines += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in body]
    first, *others = (f"<tr>{line}</tr>" for line in lines)
    return f"<table><thead>{first}</thead><tbody>{''.join(others)}</tbody></table>"


def _about(about: Mapping[str, str], files: Mapping[str, str]) -> str:
    told = "".join(
        f"<dt>{escape(name)}</dt><dd><pre>{escape(text)}</pre></dd>" for name, text in about.items()
    )
    sums = "\n".join(f"{checksum}  {name}" for name, checksum in files.items())
    return f"<dl>{told}<dt>SHA-256 of the scenarios</dt><dd><pre>{escape(sums)}</pre></dd></dl>"


def _figures(figures: Sequence[Mapping[str, Any]]) -> str:
    return "".join(
        f"<figure><figcaption>{escape(each['title'])}</figcaption>"
        f"<div class='plot' id='figure-{escape(each['id'])}'></div></figure>"
        for each in figures
    )
