"""A result in a notebook: what is asked first, and the view from above."""

from __future__ import annotations

from base64 import b64encode
from html import escape

from repair.outcome.data import Outcome
from repair.report.birdseye import birdseye_figure
from repair.report.style import render
from repair.report.text import headline

__all__ = ["page_of"]


def page_of(outcome: Outcome) -> str:
    """A piece of HTML that needs nothing else.

    Parameters
    ----------
    outcome : Outcome
        Without a drawing the picture is left out.
    """
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(text)}</td></tr>'
        for name, text in headline(outcome.record)
    )
    picture = ""
    if outcome.drawing is not None:
        data = b64encode(render(birdseye_figure(outcome))).decode()
        picture = f'<img style="max-width:100%" alt="from above" src="data:image/png;base64,{data}">'
    return f"<table>{rows}</table>{picture}"
