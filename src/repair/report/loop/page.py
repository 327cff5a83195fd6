"""The page of a simulation: one file of HTML with the table and the F-TTR over the drives."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from repair.report.loop.countdown import countdown_figure
from repair.report.loop.table import table_of
from repair.report.style import render

__all__ = ["simulation_page"]

Row = Mapping[str, Any]
_DRAWN = 12  # so many cases are drawn
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: 13px; }
td, th { border-bottom: 1px solid #ccc; padding: .25rem .6rem; text-align: left; } td { white-space: nowrap; }
img { max-width: 100%; } figure { margin: 2rem 0; } figcaption { font-weight: 600; }
"""


def simulation_page(rows: Sequence[Row]) -> str:
    """Table, and the drives in which the policies differ most: by which of them is struck or acts.

    Parameters
    ----------
    rows : sequence of mapping
        As they are stored.
    """
    cases: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row["status"] == "driven":
            key = row["file"], row["reference"], row["shift_s"], row["prediction"]
            cases.setdefault(key, []).append(row)
    acting = {key: own for key, own in cases.items() if any(row["interventions"] for row in own)}
    chosen = sorted(acting.items(), key=lambda item: -_differ(item[1]))[:_DRAWN]
    figures = "".join(_figure(key, own) for key, own in chosen)
    left = len(acting) - len(chosen)
    more = f"<p>{left} more cases in which somebody acts are not drawn.</p>" if left else ""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Closed loop</title>'
        f'<link rel="icon" href="data:,"><style>{_STYLE}</style></head><body><h1>Closed loop</h1>'
        f"{_html(table_of(rows))}<h2>The F-TTR over the drive</h2>{figures}{more}</body></html>\n"
    )


def _differ(own: Sequence[Row]) -> int:
    return len({(row["contact_s"] is None, bool(row["interventions"])) for row in own})


def _figure(key: tuple[Any, ...], own: Sequence[Row]) -> str:
    file, plan, shift, prediction = key
    words = f"{file}, plan {plan}, traffic {shift:g} s later, prediction {prediction}"
    picture = base64.b64encode(render(countdown_figure(own))).decode("ascii")
    return (
        f"<figure><figcaption>{escape(words)}</figcaption>"
        f'<img alt="TTC, F-TTR and speed over time" src="data:image/png;base64,{picture}"></figure>'
    )


def _html(markdown: str) -> str:
    """The table as HTML, and each line beside it as a paragraph."""
    made, table = [], []
    for line in [*markdown.splitlines(), ""]:
        if line.startswith("|"):
            table.append([cell.strip() for cell in line.strip("|").split("|")])
            continue
        if table:
            head, body = table[0], table[2:]
            lines = ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in body]
            top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
            cells = "".join(f"<tr>{one}</tr>" for one in lines)
            made.append(f'<div class="wide"><table><tr>{top}</tr>{cells}</table></div>')
            table = []
        if line:
            made.append(f"<p>{escape(line)}</p>")
    return "".join(made)
