"""The paper's Fig. 4 (s-t, speed, acceleration) and Fig. 5 (stages)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.curves.base import Curve
from repair.report.lines import Line, coloured, line_of, probe_line, reference_line, title_of
from repair.report.style import EGO, OBSTACLE, STYLE, WIDTH

if TYPE_CHECKING:
    from repair.api import RepairResult

__all__ = ["profile_figure", "profiles", "stages_figure"]


def profile_figure(result: RepairResult) -> Any:
    """The paper's Fig. 4: s-t with obstacles, speed and acceleration, one curve for each t_rep.

    Returns
    -------
    matplotlib.figure.Figure
    """
    reference = reference_line(result)
    lines = [reference, *(probe_line(result, p, c) for p, c in coloured(result))]
    return profiles(result, lines, title_of(result))


def stages_figure(result: RepairResult, t_rep: float | None = None) -> Any:
    """The paper's Fig. 5: the stages of one repair, such as deformation against refinement.

    Parameters
    ----------
    result : RepairResult
    t_rep : float, optional
        A visited time-to-repair [s]; by default that of the F-TTR.

    Raises
    ------
    ValueError
        If there is no curve for that t_rep.
    """
    probes = [p for p in result.search.probes if p.solve.curve is not None]
    if t_rep is not None:
        probes = [p for p in probes if abs(p.t_rep - t_rep) < 1e-6]
    if not probes:
        raise ValueError("no probe with a curve to draw")
    probe = max(probes, key=lambda p: (p.feasible, p.t_rep))
    curves: dict[str, Curve | None] = dict(probe.solve.stages)
    curves = curves or {"repair": probe.solve.curve}
    styles = ((OBSTACLE, "-", 2.6), (EGO, (0, (4, 2)), 1.6), ("#009E73", (0, (1, 1)), 1.6))
    lines = [reference_line(result)]
    for (name, curve), (colour, dashes, width) in zip(curves.items(), styles, strict=False):
        if curve is not None:
            lines.append(
                line_of(result, curve, probe.t_rep, name, {"color": colour, "ls": dashes, "lw": width})
            )
    return profiles(result, lines, f"{title_of(result)}\nstages at $t_{{rep}}$ = {probe.t_rep:g} s")


# -- profiles --------------------------------------------------------------------------------------


def profiles(result: RepairResult, lines: Sequence[Line], title: str) -> Any:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    sideways = max(float(np.abs(x.position[:, 1]).max()) for x in lines) > 0.2
    heights = [2.6, 1.2, 1.2] + [1.2] * sideways
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 1.5 + 0.95 * sum(heights)), layout="constrained")
        axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        s0 = float(result.prepared.scene.start[0, 0])
        columns = [
            [x.position[:, 0] - s0 for x in lines],
            [x.speed for x in lines],
            [x.acceleration for x in lines],
        ]
        columns += [[x.position[:, 1] for x in lines]] * sideways
        labels = ("distance driven s [m]", "speed [m/s]", "acceleration\n[m/s²]", "lateral\noffset l [m]")
        for panel, values, label in zip(axes, columns, labels, strict=False):
            for line, column in zip(lines, values, strict=True):
                panel.plot(
                    line.t, column, label=line.label if panel is axes[0] else None, zorder=3, **line.style
                )
                if line.t[0] > 0.0:  # where a repair leaves the reference
                    panel.plot(line.t[0], column[0], "o", ms=4.5, color=line.style["color"], zorder=4)
            panel.set_ylabel(label)
        t_end = max(float(x.t[-1]) for x in lines)
        _room(axes[0], columns[0])
        _draw_obstacles(axes[0], result, t_end, s0)
        _mark_limits(axes, result)
        _mark_times(axes, result)
        axes[0].set(title=title, xlim=(0.0, t_end))
        axes[-1].set_xlabel("time t [s]")
        figure.align_ylabels(axes)
        figure.legend(loc="outside right upper", frameon=False)
    return figure


def _room(panel: Any, columns: Sequence[Array]) -> None:
    low, high = min(float(c.min()) for c in columns), max(float(c.max()) for c in columns)
    pad = max(0.25 * (high - low), 3.0)
    panel.set_ylim(low - 0.3 * pad, high + pad)


def _draw_obstacles(panel: Any, result: RepairResult, t_end: float, s0: float) -> None:
    """The s-interval of every box while it covers the reference's l: where the ego, a point, must not be."""
    occupancy, prepared = result.prepared.occupancy, result.prepared
    if not len(occupancy):
        return
    keep = occupancy.t <= t_end + 1e-9
    t, lower, upper = occupancy.t[keep], occupancy.lower[:, keep], occupancy.upper[:, keep]
    l_reference = prepared.reference.sample(t).position[:, 1]
    in_the_way = (lower[..., 1] < l_reference) & (l_reference < upper[..., 1])
    bottom, top = panel.get_ylim()
    s_offset = _s_offset(result)
    labelled = False
    for k in range(len(occupancy)):
        low, high = lower[k, :, 0] - s0, upper[k, :, 0] - s0
        seen = in_the_way[k] & (high > bottom) & (low < top)
        if not seen.any():
            continue
        names = (None, None) if labelled else ("obstacle on the path,\nwith margin", "obstacle on the path")
        labelled = True
        kwargs = {"where": seen, "color": OBSTACLE, "lw": 0.0, "zorder": 1}
        panel.fill_between(t, low, high, alpha=0.22, label=names[0], **kwargs)
        panel.fill_between(t, low + s_offset, high - s_offset, alpha=0.55, label=names[1], **kwargs)
        middle = np.flatnonzero(seen)[seen.sum() // 2]
        height = float(np.clip(0.5 * (low[middle] + high[middle]), bottom, top))
        panel.text(
            t[middle],
            height,
            str(int(occupancy.ids[k])),
            ha="center",
            va="center",
            fontsize=8,
            zorder=2,
            clip_on=True,
        )


def _s_offset(result: RepairResult) -> float:
    configured = result.prepared.config.scene.s_offset
    return 0.5 * result.prepared.scene.vehicle.length if configured is None else configured


def _mark_limits(axes: Any, result: RepairResult) -> None:
    """The longitudinal limits, as far as they are near enough to matter, and zero speed."""
    limits, panel = result.prepared.limits, axes[2]
    low, high = panel.get_ylim()
    for value, name in ((limits.a_min, "$a_{min}$"), (limits.a_max, "$a_{max}$")):
        if low - (high - low) <= value <= high + (high - low):
            panel.axhline(value, color="#777777", lw=1.0, ls="-.")
            panel.annotate(
                f" {name}", (1.0, value), xycoords=("axes fraction", "data"), va="center", fontsize=8
            )
    axes[1].axhline(0.0, color="#777777", lw=1.0, ls="-.")


def _mark_times(axes: Any, result: RepairResult) -> None:
    """TTC across all panels."""
    ttc = result.search.conflict.time
    if not np.isfinite(ttc):
        return
    for panel in axes:
        panel.axvline(ttc, color=OBSTACLE, lw=1.0, ls="--", zorder=1)
    axes[0].annotate(
        f" TTC {ttc:.4g} s", (ttc, 0.03), xycoords=("data", "axes fraction"), fontsize=8.5, color=OBSTACLE
    )
