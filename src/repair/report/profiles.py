"""The paper's Fig. 4 (s-t, speed, acceleration) and Fig. 5 (stages)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Outcome
from repair.report.lines import (
    Along,
    Styled,
    continuation_lines,
    drawing_in,
    driven_line,
    lateral_acceleration,
    overlapped,
    reference_line,
    repair_lines,
    title_of,
)
from repair.report.style import EGO, OBSTACLE, FigureStyle
from repair.timegrid import INSTANT, STEP

__all__ = ["profile_figure", "stages_figure"]

_ASIDE = 0.2  # who keeps to the axis within this needs no panel for that [m]
_APART = (0.07, 0.09)  # names of obstacles are at least so far from each other and from lines, of the panel


def profile_figure(outcome: Outcome, style: FigureStyle | None = None) -> Any:
    """The paper's Fig. 4: s-t with obstacles, speed and accelerations, one curve for each t_rep.

    Where the reference goes far, distances are those from the reference, which moves: else nothing of
    what happens could be seen.

    Parameters
    ----------
    outcome : Outcome
    style : FigureStyle, optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    lines = [reference_line(outcome), *repair_lines(outcome), *continuation_lines(outcome)]
    return _profiles(outcome, lines, title_of(outcome), style or FigureStyle())


def stages_figure(outcome: Outcome, t_rep: float | None = None, style: FigureStyle | None = None) -> Any:
    """The paper's Fig. 5: the stages of one repair, such as deformation against refinement.

    Parameters
    ----------
    outcome : Outcome
    t_rep : float, optional
        A visited time-to-repair [s]; by default that of the F-TTR.
    style : FigureStyle, optional

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
    title = f"{title_of(outcome)}\nstages at $t_{{rep}}$ = {chosen.t_rep:g} s"
    return _profiles(outcome, lines, title, style or FigureStyle())


def _profiles(outcome: Outcome, lines: Sequence[Styled], title: str, style: FigureStyle) -> Any:
    import_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    drawing = drawing_in(outcome)
    along = Along.of(drawing)
    sideways = max(float(np.abs(x.line.l).max()) for x in lines) > _ASIDE
    heights = [2.6, 1.2, 1.2, 1.2] + [1.2] * sideways
    columns = [
        [along(x.line.t, x.line.s) for x in lines],
        [x.line.speed for x in lines],
        [x.line.acceleration for x in lines],
        [lateral_acceleration(x.line) for x in lines],
        *([[x.line.l for x in lines]] * sideways),
    ]
    labels = (along.label, "speed\n[m/s]", "acceleration\n[m/s²]", "lateral acc.\n[m/s²]", "offset l\n[m]")
    with rc_context(style.rc):
        scale = max(style.width / 8.0, style.font_size / 9.5)  # labels need their room
        height = (0.9 + 1.8 * style.narrow + (0.95 - 0.15 * style.narrow) * sum(heights)) * scale
        figure = Figure(figsize=(style.width, height), layout="constrained")
        axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        for panel, values, label in zip(axes, columns, labels, strict=False):
            for x, column in zip(lines, values, strict=True):
                panel.plot(x.line.t, column, label=x.label if panel is axes[0] else None, zorder=3, **x.style)
                if x.line.t[0] > 0.0:  # where a repair leaves the reference
                    panel.plot(x.line.t[0], column[0], "o", color=x.style["color"], zorder=4)
            panel.set_ylabel(label)
        t_end = max(float(x.line.t[-1]) for x in lines)
        axes[0].set(title=title, xlim=(0.0, t_end))
        _room(axes[0], columns[0], 2.0 * along.half)
        names = _draw_obstacles(axes[0], outcome, along, t_end)
        _draw_length(axes[0], outcome, along)
        _no_magnifier(axes[3])
        _mark_limits(axes, outcome)
        _mark_times(axes, outcome)
        _write_names(axes[0], names, [(x.line.t, c) for x, c in zip(lines, columns[0], strict=True)])
        axes[-1].set_xlabel("time t [s]")
        figure.align_ylabels(axes)
        below = {"loc": "outside lower center", "ncols": 2, "fontsize": "small"}
        figure.legend(**(below if style.narrow else {"loc": "outside right upper"}), frameon=False)
    return figure


def _room(panel: Any, columns: Sequence[Array], least: float) -> None:
    """What is driven, and some room around it in which the others are."""
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    pad = max(0.25 * (high - low), least)
    panel.set_ylim(low - 0.5 * pad, high + pad)


def _no_magnifier(panel: Any) -> None:
    """Hardly any lateral acceleration is shown as that, not as the last digits of places."""
    low, high = panel.get_ylim()
    panel.set_ylim(min(low, -1.0), max(high, 1.0))


def _draw_obstacles(
    panel: Any, outcome: Outcome, along: Along, t_end: float
) -> list[tuple[str, Array, Array, bool]]:
    """The s-interval of every box while it covers the reference's l; names, and where they could stand."""
    drawing, hit = drawing_in(outcome), outcome.record["conflict"]["obstacle_id"]
    bottom, top = panel.get_ylim()
    labels: list[str | None] = ["with margin and half\nof the ego's length", "obstacle on the path"]
    names = []
    for box in drawing.boxes:
        keep = box.t <= t_end + INSTANT
        t, low, high = box.t[keep], along(box.t[keep], box.low[keep]), along(box.t[keep], box.high[keep])
        seen = (high > bottom) & (low < top)
        if not seen.any():
            continue
        kwargs = {"where": seen, "color": OBSTACLE, "lw": 0.0, "zorder": 1}
        panel.fill_between(t, low, high, alpha=0.18, label=labels[0], **kwargs)
        inner = low + drawing.s_offset, high - drawing.s_offset
        panel.fill_between(t, *inner, alpha=0.55, label=labels[1], **kwargs)
        labels = [None, None]
        middle = 0.5 * (np.maximum(inner[0], bottom) + np.minimum(inner[1], top))
        shown = seen & (inner[1] > bottom) & (inner[0] < top)
        names.append((str(box.id), t[shown], middle[shown], box.id == hit))
    return sorted(names, key=lambda name: not name[3])


def _write_names(
    panel: Any, names: Sequence[tuple[str, Array, Array, bool]], lines: Sequence[tuple[Array, Array]]
) -> None:
    """Each obstacle's number on it, where it covers neither a line nor another number; else it has none."""
    (left, right), (bottom, top) = panel.get_xlim(), panel.get_ylim()
    scale = np.array([_APART[0] * (right - left), _APART[1] * (top - bottom)])
    taken = [np.column_stack(line) / scale for line in lines]
    low, high = np.array([left, bottom]) / scale + 0.5, np.array([right, top]) / scale - 0.5
    for text, t, middle, hit in names:
        places = np.column_stack([t, middle]) / scale
        places = places[((low <= places) & (places <= high)).all(axis=1)]
        if not len(places):
            continue
        places = places[np.unique(np.linspace(0, len(places) - 1, 41).round().astype(int))]
        blocked = np.vstack(taken)
        free = np.hypot(*(places[:, None] - blocked[None]).T).min(axis=0)
        best = int(np.argmax(np.minimum(free, 1.0) - 1e-3 * np.abs(np.arange(len(places)) - len(places) / 2)))
        if free[best] < 0.6 and not hit:
            continue
        taken.append(places[best : best + 1])
        panel.text(
            *(places[best] * scale), text, ha="center", va="center", fontsize="small", zorder=5, clip_on=True
        )


def _draw_length(panel: Any, outcome: Outcome, along: Along) -> None:
    """The ego from end to end on what is driven, and where it is beside somebody and not in somebody."""
    drawing = drawing_in(outcome)
    line, repaired = driven_line(outcome)
    s = along(line.t, line.s)
    panel.fill_between(
        line.t,
        s - along.half,
        s + along.half,
        color=EGO,
        alpha=0.2,
        lw=0.0,
        zorder=2,
        label="the ego's length",
    )
    beside = overlapped(drawing, line, along.half) if repaired else np.zeros(len(line.t), dtype=bool)
    if beside.any():
        every = max(len(line.t) // 40, 1)
        shown = np.flatnonzero(beside)[::every]
        panel.plot(
            line.t[shown], s[shown], ls="", marker="o", mfc="white", mec=EGO, ms=5, zorder=4.5,
            label="beside it, as from above:\nno contact",
        )  # fmt: skip


def _mark_limits(axes: Any, outcome: Outcome) -> None:
    """The limits, as far as they are near enough to matter, and zero speed; their values in the legend."""
    limits = outcome.record["limits"]
    low, high, across, fast = (
        limits.get(name) for name in ("a_min_mps2", "a_max_mps2", "a_lat_mps2", "v_max_mps")
    )
    marked = ((axes[1], (0.0, fast)), (axes[2], (low, high)), (axes[3], (across, across and -across)))
    for panel, values in marked:
        bottom, top = panel.get_ylim()
        for value in values:
            if value is not None and bottom - 0.5 * (top - bottom) <= value <= top + 0.5 * (top - bottom):
                panel.axhline(value, color="#777777", lw=1.0, ls="-.")
    words = [f"along {low:.3g} to {high:.3g} m/s²"]
    words += [f"lateral ±{across:.3g} m/s²"] if across is not None else []
    words += [f"speed 0 to {fast:.3g} m/s"] if fast is not None else []
    axes[0].plot([], [], color="#777777", lw=1.0, ls="-.", label="limits: " + ",\n".join(words))


def _mark_times(axes: Any, outcome: Outcome) -> None:
    """TTC across all panels."""
    ttc = outcome.ttc
    if not np.isfinite(ttc):
        return
    for panel in axes:
        label = f"TTC {ttc:.4g} s" if panel is axes[0] else None
        panel.axvline(ttc, color=OBSTACLE, lw=1.0, ls="--", zorder=1, label=label)
