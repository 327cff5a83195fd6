"""The paper's Fig. 4 (s-t, speed, acceleration) and Fig. 5 (stages)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Outcome
from repair.report.lines import Styled, continuation_lines, drawing_in, reference_line, repair_lines, title_of
from repair.report.style import EGO, OBSTACLE, STYLE, WIDTH
from repair.timegrid import INSTANT, STEP

__all__ = ["profile_figure", "stages_figure"]


def profile_figure(outcome: Outcome) -> Any:
    """The paper's Fig. 4: s-t with obstacles, speed and acceleration, one curve for each t_rep.

    Returns
    -------
    matplotlib.figure.Figure
    """
    lines = [reference_line(outcome), *repair_lines(outcome), *continuation_lines(outcome)]
    return _profiles(outcome, lines, title_of(outcome))


def stages_figure(outcome: Outcome, t_rep: float | None = None) -> Any:
    """The paper's Fig. 5: the stages of one repair, such as deformation against refinement.

    Parameters
    ----------
    outcome : Outcome
    t_rep : float, optional
        A visited time-to-repair [s]; by default that of the F-TTR.

    Raises
    ------
    ValueError
        If there is no curve for that t_rep.
    """
    repairs = repair_lines(outcome)
    if t_rep is not None:
        repairs = [r for r in repairs if abs((r.line.t_rep or 0.0) - t_rep) < STEP]
    if not repairs:
        raise ValueError("no probe with a curve to draw")
    chosen = max(repairs, key=lambda r: (r.feasible, r.line.t_rep or 0.0)).line
    stages = [x for x in drawing_in(outcome).lines if x.kind == "stage" and x.t_rep == chosen.t_rep]
    styles = ((OBSTACLE, "-", 2.6), (EGO, (0, (4, 2)), 1.6), ("#009E73", (0, (1, 1)), 1.6))
    lines = [reference_line(outcome)]
    for line, (colour, dashes, width) in zip(stages or [chosen], styles, strict=False):
        lines.append(Styled(line, line.name or "repair", {"color": colour, "ls": dashes, "lw": width}))
    return _profiles(outcome, lines, f"{title_of(outcome)}\nstages at $t_{{rep}}$ = {chosen.t_rep:g} s")


def _profiles(outcome: Outcome, lines: Sequence[Styled], title: str) -> Any:
    import_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    drawing = drawing_in(outcome)
    sideways = max(float(np.abs(x.line.l).max()) for x in lines) > 0.2
    heights = [2.6, 1.2, 1.2] + [1.2] * sideways
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 1.5 + 0.95 * sum(heights)), layout="constrained")
        axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        columns = [
            [x.line.s - drawing.start_s for x in lines],
            [x.line.speed for x in lines],
            [x.line.acceleration for x in lines],
        ]
        columns += [[x.line.l for x in lines]] * sideways
        labels = ("distance driven s [m]", "speed [m/s]", "acceleration\n[m/s²]", "lateral\noffset l [m]")
        for panel, values, label in zip(axes, columns, labels, strict=False):
            for x, column in zip(lines, values, strict=True):
                panel.plot(x.line.t, column, label=x.label if panel is axes[0] else None, zorder=3, **x.style)
                if x.line.t[0] > 0.0:  # where a repair leaves the reference
                    panel.plot(x.line.t[0], column[0], "o", ms=4.5, color=x.style["color"], zorder=4)
            panel.set_ylabel(label)
        t_end = max(float(x.line.t[-1]) for x in lines)
        _room(axes[0], columns[0])
        _draw_obstacles(axes[0], outcome, t_end)
        _mark_limits(axes, outcome)
        _mark_times(axes, outcome)
        axes[0].set(title=title, xlim=(0.0, t_end))
        axes[-1].set_xlabel("time t [s]")
        figure.align_ylabels(axes)
        figure.legend(loc="outside right upper", frameon=False)
    return figure


def _room(panel: Any, columns: Sequence[Array]) -> None:
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    pad = max(0.25 * (high - low), 3.0)
    panel.set_ylim(low - 0.3 * pad, high + pad)


def _draw_obstacles(panel: Any, outcome: Outcome, t_end: float) -> None:
    """The s-interval of every box while it covers the reference's l: where the ego, a point, must not be."""
    drawing = drawing_in(outcome)
    bottom, top = panel.get_ylim()
    labelled = False
    for box in drawing.boxes:
        keep = box.t <= t_end + INSTANT
        t, low, high = box.t[keep], box.low[keep] - drawing.start_s, box.high[keep] - drawing.start_s
        seen = (high > bottom) & (low < top)
        if not seen.any():
            continue
        names = (None, None) if labelled else ("obstacle on the path,\nwith margin", "obstacle on the path")
        labelled = True
        kwargs = {"where": seen, "color": OBSTACLE, "lw": 0.0, "zorder": 1}
        panel.fill_between(t, low, high, alpha=0.22, label=names[0], **kwargs)
        inner = low + drawing.s_offset, high - drawing.s_offset
        panel.fill_between(t, *inner, alpha=0.55, label=names[1], **kwargs)
        middle = np.flatnonzero(seen)[seen.sum() // 2]
        height = float(np.clip(0.5 * (low[middle] + high[middle]), bottom, top))
        panel.text(
            t[middle], height, str(box.id), ha="center", va="center", fontsize=8, zorder=2, clip_on=True
        )


def _mark_limits(axes: Any, outcome: Outcome) -> None:
    """The longitudinal limits, as far as they are near enough to matter, and zero speed."""
    limits, panel = outcome.record["limits"], axes[2]
    low, high = panel.get_ylim()
    for value, name in ((limits["a_min_mps2"], "$a_{min}$"), (limits["a_max_mps2"], "$a_{max}$")):
        if low - (high - low) <= value <= high + (high - low):
            panel.axhline(value, color="#777777", lw=1.0, ls="-.")
            panel.annotate(
                f" {name}", (1.0, value), xycoords=("axes fraction", "data"), va="center", fontsize=8
            )
    axes[1].axhline(0.0, color="#777777", lw=1.0, ls="-.")


def _mark_times(axes: Any, outcome: Outcome) -> None:
    """TTC across all panels."""
    ttc = outcome.ttc
    if not np.isfinite(ttc):
        return
    for panel in axes:
        panel.axvline(ttc, color=OBSTACLE, lw=1.0, ls="--", zorder=1)
    axes[0].annotate(
        f" TTC {ttc:.4g} s", (ttc, 0.03), xycoords=("data", "axes fraction"), fontsize=8.5, color=OBSTACLE
    )
