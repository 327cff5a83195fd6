"""Small tables of text with the numbers behind them, rendered as Markdown, JSON and LaTeX."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

__all__ = ["DASH", "Section", "Table", "against", "decimal"]

DASH = "–"  # where there is no number


@dataclass(frozen=True)
class Section:
    """A grid of texts under a heading.

    Attributes
    ----------
    heading : str
    columns : tuple of str
    rows : tuple of tuple of str
    rule_after : int or None
        A line is drawn below this many rows.
    rule_label : str
        What the rows below that line are.
    """

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    rule_after: int | None = None
    rule_label: str = "not in the paper"


@dataclass(frozen=True)
class Table:
    """A regenerated table: texts to render, and the numbers behind them.

    Attributes
    ----------
    title : str
    sections : tuple of Section
    notes : tuple of str
    data : dict
        What :meth:`to_json` writes: plain numbers, None where there is none.
    """

    title: str
    sections: tuple[Section, ...]
    notes: tuple[str, ...]
    data: dict[str, Any] = field(default_factory=dict)

    def to_markdown(self) -> str:
        """GitHub-flavoured Markdown."""
        lines = [f"## {self.title}"]
        for section in self.sections:
            lines += [
                "",
                f"### {section.heading}",
                "",
                _pipe(section.columns),
                _pipe(["---"] * len(section.columns)),
            ]
            for k, row in enumerate(section.rows):
                if k == section.rule_after:
                    lines.append(_pipe([f"*{section.rule_label}*"] + [""] * (len(row) - 1)))
                lines.append(_pipe(row))
        lines += ["", *(f"- {note}" for note in self.notes)]
        return "\n".join(lines) + "\n"

    def to_json(self) -> str:
        """Strict JSON."""
        content = {"title": self.title, **self.data, "notes": list(self.notes)}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def to_latex(self) -> str:
        """One ``table`` with a booktabs ``tabular`` for each section."""
        lines = [
            "% needs \\usepackage{booktabs}",
            "\\begin{table}[htbp]",
            "  \\centering",
            f"  \\caption{{{_tex(self.title)}}}",
        ]
        for k, section in enumerate(self.sections):
            lines += [] if k == 0 else ["  \\par\\medskip"]
            lines += [f"  {_tex(section.heading)}\\par\\smallskip"]
            lines += [
                f"  \\begin{{tabular}}{{@{{}}l{'r' * (len(section.columns) - 2)}l@{{}}}}",
                "    \\toprule",
            ]
            lines += ["    " + " & ".join(_tex(c) for c in section.columns) + " \\\\", "    \\midrule"]
            for number, row in enumerate(section.rows):
                if number == section.rule_after:
                    lines.append("    \\midrule")
                lines.append("    " + " & ".join(_tex(c) for c in row) + " \\\\")
            lines += ["    \\bottomrule", "  \\end{tabular}"]
        lines += [f"  \\par\\footnotesize {_tex(note)}" for note in self.notes]
        return "\n".join([*lines, "\\end{table}"]) + "\n"


def _pipe(cells: Sequence[str]) -> str:
    return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


_TEX = {
    "\\": "\\textbackslash{}", "&": "\\&", "%": "\\%", "$": "\\$", "#": "\\#", "_": "\\_",
    "{": "\\{", "}": "\\}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "²": "$^2$",
    "±": "$\\pm$", "−": "$-$", "–": "--", "…": "\\ldots{}", "Δ": "$\\Delta$", "<": "$<$", ">": "$>$",
}  # fmt: skip


def _tex(text: str) -> str:
    return "".join(_TEX.get(c, c) for c in text)


def against(paper: float | None, ours: float | None) -> dict[str, float | None]:
    """Paper, ours and the difference; None where there is no number."""
    ours = round(ours, 6) if ours is not None and math.isfinite(ours) else None
    difference = round(ours - paper, 6) if ours is not None and paper is not None else None
    return {"paper": paper, "ours": ours, "difference": difference}


def decimal(value: float | None, digits: int, signed: bool = False) -> str:
    """A number with a typographic minus; a dash where there is none."""
    if value is None:
        return DASH
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    return text.replace("-", "−") if float(text) != 0.0 else f"{0.0:.{digits}f}"
