"""The F-TTR running down over a drive, one panel for each policy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from repair.io.plotting import import_matplotlib
from repair.report.style import EGO, OBSTACLE, OTHERS, REFERENCE, FigureStyle

__all__ = ["countdown_figure"]

Row = Mapping[str, Any]
_MODES = {"repair": ("#0072B2", "a repair is driven"), "brake": ("#D55E00", "full braking")}


def countdown_figure(rows: Sequence[Row]) -> Any:
    """TTC, F-TTR and speed over the drive.

    Parameters
    ----------
    rows : sequence of mapping
        Drives of one case with one prediction, one for each policy.

    Returns
    -------
    matplotlib.figure.Figure
    """
    import_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style = FigureStyle()
    with rc_context(style.rc):
        figure = Figure(figsize=(style.width, 0.6 + 1.5 * len(rows)), layout="constrained")
        panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
        for panel, row in zip(panels, rows, strict=True):
            _panel(panel, row)
        panels[-1].set_xlim(0.0, max(row["drive"]["states"]["t"][-1] for row in rows))
        panels[-1].set_xlabel("time [s]")
        handles, labels = panels[0].get_legend_handles_labels()
        for panel in panels[1:]:
            for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
                if label not in labels:
                    handles.append(handle)
                    labels.append(label)
        figure.legend(handles, labels, loc="outside upper center", ncols=6, frameon=False, fontsize=8)
    return figure


def _panel(panel: Any, row: Row) -> None:
    drive = row["drive"]
    cycles, states = drive["cycles"], drive["states"]
    begin = {c["t"]: n["t"] for c, n in pairwise(cycles)}
    named = set()
    for cycle in cycles:
        if cycle["mode"] in _MODES:
            colour, label = _MODES[cycle["mode"]]
            until = begin.get(cycle["t"], states["t"][-1])
            panel.axvspan(
                cycle["t"], until, color=colour, alpha=0.18, lw=0, label="" if label in named else label
            )
            named.add(label)
    for key, label, colour, marker in (("ttc", "TTC", OBSTACLE, "o"), ("f_ttr", "F-TTR", EGO, "s")):
        seen = [(c["t"], c[key]) for c in cycles if c[key] is not None]
        if seen:
            panel.plot(*zip(*seen, strict=True), marker, color=colour, ms=3, label=label)
    if row["contact_s"] is not None:
        panel.axvline(row["contact_s"], color=REFERENCE, lw=1.5, label="contact")
    panel.set_ylabel(f"{row['policy']}\n[s]")
    panel.set_ylim(bottom=0.0)
    speed = panel.twinx()
    speed.plot(states["t"], states["speed"], color=OTHERS, lw=1.0)
    panel.plot([], [], color=OTHERS, lw=1.0, label="speed (right)")
    speed.set_ylabel("[m/s]", color=OTHERS)
    speed.set_ylim(bottom=0.0)
    speed.grid(False)
