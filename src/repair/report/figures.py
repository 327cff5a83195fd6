"""Figures of a result: the paper's Fig. 4 (s-t, speed, acceleration), Fig. 5 (stages), and a bird's-eye view.

Everything is drawn with matplotlib's object interface, so that nothing global is touched. Colours tell
times-to-repair apart in the order of a colour-blind-safe map; dashed means infeasible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.checker import SplicedCurve
from repair.types import Array, Curve, Probe, SearchStatus

if TYPE_CHECKING:
    from repair.api import RepairResult
    from repair.scene.obstacles import Obstacle

__all__ = ["birdseye_figure", "paper_figures", "profile_figure", "render", "stages_figure"]

_Window = tuple[tuple[float, float], tuple[float, float]]
"""Ranges of x and y [m]."""

_WIDTH = 8.0  # in; at 150 dots per inch readable at the width of a README
_EGO, _OBSTACLE, _REFERENCE = "#0072B2", "#D55E00", "#000000"
_STYLE: Any = {
    "axes.grid": True,
    "grid.alpha": 0.25,
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


@dataclass(frozen=True)
class _Line:
    """One driven curve: its samples in both frames, and how it is drawn."""

    label: str
    t: Array
    position: Array
    xy: Array
    speed: Array
    acceleration: Array
    style: dict[str, Any]


def render(figure: Any, file_format: str = "png") -> bytes:
    """A figure as the bytes of a file (``png``, ``pdf``, ``svg``), the same bytes for the same figure."""
    buffer = BytesIO()
    metadata = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(
        file_format
    )
    figure.savefig(buffer, format=file_format, dpi=150, bbox_inches="tight", metadata=metadata)
    return buffer.getvalue()


def profile_figure(result: RepairResult) -> Any:
    """The paper's Fig. 4: s-t with obstacles, speed and acceleration, one curve for each t_rep.

    Returns
    -------
    matplotlib.figure.Figure
    """
    reference = _reference(result)
    lines = [reference, *(_probe_line(result, p, c) for p, c in _coloured(result))]
    return _profiles(result, lines, _title(result))


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
    styles = ((_OBSTACLE, "-", 2.6), (_EGO, (0, (4, 2)), 1.6), ("#009E73", (0, (1, 1)), 1.6))
    lines = [_reference(result)]
    for (name, curve), (colour, dashes, width) in zip(curves.items(), styles, strict=False):
        if curve is not None:
            lines.append(
                _line(result, curve, probe.t_rep, name, {"color": colour, "ls": dashes, "lw": width})
            )
    return _profiles(result, lines, f"{_title(result)}\nstages at $t_{{rep}}$ = {probe.t_rep:g} s")


def birdseye_figure(result: RepairResult) -> Any:
    """Road, obstacles at a few times, the reference and the repaired trajectories from above."""
    from matplotlib import rc_context
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    scene, conflict = result.prepared.scene, result.search.conflict
    reference = _reference(result)
    window, shape = _window(result, reference)
    with rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, 0.87 * _WIDTH * shape + 1.3), layout="constrained")
        axes = figure.add_subplot()
        lanelets = scene.scenario.lanelet_network.lanelets
        outlines = [np.vstack([x.left_vertices, x.right_vertices[::-1]])[:, :2] for x in lanelets]
        axes.add_collection(PolyCollection(outlines, facecolor="#ECECEC", edgecolor="none", zorder=0))
        edges = [v[:, :2] for x in lanelets for v in (x.left_vertices, x.right_vertices)]
        axes.add_collection(LineCollection(edges, colors="#B5B5B5", linewidths=0.6, zorder=0.5))
        # Above the repairs: one that stays on the reference must not hide it.
        axes.plot(*reference.xy.T, color=_REFERENCE, lw=1.2, ls=":", label="reference", zorder=4.5)
        for probe, colour in _coloured(result):
            line = _probe_line(result, probe, colour)
            label = line.label if probe.feasible else f"{line.label.splitlines()[0]}, infeasible"
            axes.plot(*line.xy.T, label=label, zorder=4, **line.style)
        _draw_vehicles(
            axes, result, conflict.time if np.isfinite(conflict.time) else result.prepared.t_end, window
        )
        axes.set(
            xlim=window[0],
            ylim=window[1],
            aspect="equal",
            xlabel="x [m]",
            ylabel="y [m]",
            title=_title(result),
        )
        axes.grid(visible=False)
        figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


def paper_figures(backend: str = "ego", file_format: str = "png") -> dict[str, bytes]:
    """The paper's Figures 4 and 5 (Scenario 1) and 6 (Scenario 2), computed anew.

    The view from above of Scenario 1 belongs to Figure 4; the other drawings of Scenario 2 are not in
    the paper.

    Returns
    -------
    dict
        File name to content.
    """
    from repair.api import repair
    from repair.config import load_config
    from repair.scene.bundled import paper_scenario

    results = []
    for name in ("scenario_1", "scenario_2"):
        with paper_scenario(name) as path:
            results.append(repair(path, load_config(name, backend=backend)))
    drawn = {
        "figure_4": profile_figure(results[0]),
        "figure_4_birdseye": birdseye_figure(results[0]),
        "figure_5": stages_figure(results[0]),
        "figure_6": birdseye_figure(results[1]),
        "figure_6_profiles": profile_figure(results[1]),
        "figure_6_stages": stages_figure(results[1]),
    }
    return {f"{name}.{file_format}": render(figure, file_format) for name, figure in drawn.items()}


# -- lines -----------------------------------------------------------------------------------------


def _line(
    result: RepairResult, curve: Curve, t_rep: float | None, label: str, style: dict[str, Any]
) -> _Line:
    """Sample a curve from ``t_rep`` on, or from 0; accelerations as in :mod:`repair.metrics`."""
    prepared = result.prepared
    t_end = prepared.t_end if t_rep is not None else prepared.t_reference
    whole = curve if t_rep is None else SplicedCurve(prepared.reference, curve, t_rep)
    samples = whole.sample(prepared.checker.times(t_end))
    path = prepared.scene.frame.cartesian(samples)
    acceleration = np.gradient(path.speed, path.t) if len(path.t) > 2 else np.zeros(len(path.t))
    k = path.t >= (t_rep or 0.0) - 1e-9
    return _Line(label, path.t[k], samples.position[k], path.xy[k], path.speed[k], acceleration[k], style)


def _reference(result: RepairResult) -> _Line:
    style = {"color": _REFERENCE, "lw": 1.4, "ls": ":"}
    line = _line(result, result.prepared.reference, None, "reference", style)
    shown = line.t <= _shown_until(result) + 1e-9
    names = ("t", "position", "xy", "speed", "acceleration")
    return replace(line, **{name: getattr(line, name)[shown] for name in names})


def _shown_until(result: RepairResult) -> float:
    """End of the time axis: that of the repairs, or of the reference where nothing is repaired."""
    prepared = result.prepared
    return prepared.t_end if result.search.probes else prepared.t_reference


def _coloured(result: RepairResult) -> list[tuple[Probe, Any]]:
    """The probes that have a curve, by t_rep, each with its colour."""
    from matplotlib import colormaps

    probes = sorted((p for p in result.search.probes if p.solve.curve is not None), key=lambda p: p.t_rep)
    shades: Any = np.linspace(0.08, 0.86, max(len(probes), 2))[-len(probes) :] if probes else []
    return [(p, colormaps["viridis"](shade)) for p, shade in zip(probes, shades, strict=True)]


def _probe_line(result: RepairResult, probe: Probe, colour: Any) -> _Line:
    assert probe.solve.curve is not None
    best = result.search.best is probe
    verdict = " (F-TTR)" if best else ""
    if not probe.feasible:
        verdict = "\n" + ", ".join(probe.verdict.reasons).replace("_", " ")
    style = {"color": colour, "lw": 2.4 if best else 1.5, "ls": "-" if probe.feasible else (0, (4, 2))}
    return _line(result, probe.solve.curve, probe.t_rep, f"$t_{{rep}}$ = {probe.t_rep:g} s{verdict}", style)


def _title(result: RepairResult) -> str:
    from repair.export import provenance

    scene, config = result.prepared.scene, result.prepared.config
    kind = " (reconstruction)" if provenance(scene)["kind"] == "reconstruction" else ""
    return f"{scene.id}{kind}, backend {config.backend}"


# -- profiles --------------------------------------------------------------------------------------


def _profiles(result: RepairResult, lines: Sequence[_Line], title: str) -> Any:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    sideways = max(float(np.abs(x.position[:, 1]).max()) for x in lines) > 0.2
    heights = [2.6, 1.2, 1.2] + [1.2] * sideways
    with rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, 1.5 + 0.95 * sum(heights)), layout="constrained")
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
        kwargs = {"where": seen, "color": _OBSTACLE, "lw": 0.0, "zorder": 1}
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
        panel.axvline(ttc, color=_OBSTACLE, lw=1.0, ls="--", zorder=1)
    axes[0].annotate(
        f" TTC {ttc:.4g} s", (ttc, 0.03), xycoords=("data", "axes fraction"), fontsize=8.5, color=_OBSTACLE
    )


# -- bird's-eye view -------------------------------------------------------------------------------


def _window(result: RepairResult, reference: _Line) -> tuple[_Window, float]:
    """Ranges of x and y that hold all that is driven with some room, and their ratio of height to width."""
    points = np.vstack([reference.xy, np.column_stack([result.states.x, result.states.y])])
    network = result.prepared.scene.scenario.lanelet_network
    road = np.vstack([v[:, :2] for x in network.lanelets for v in (x.left_vertices, x.right_vertices)])
    # No further than the road goes.
    low = np.maximum(points.min(axis=0) - 10.0, road.min(axis=0) - 2.0)
    high = np.minimum(points.max(axis=0) + 10.0, road.max(axis=0) + 2.0)
    size, centre = high - low, 0.5 * (low + high)
    shape = float(np.clip(size[1] / size[0], 0.22, 0.75))
    width = max(size[0], size[1] / shape)
    (x0, y0), (x1, y1) = (
        centre - 0.5 * width * np.array([1, shape]),
        centre + 0.5 * width * np.array([1, shape]),
    )
    return ((float(x0), float(x1)), (float(y0), float(y1))), shape


def _draw_vehicles(axes: Any, result: RepairResult, at: float, window: _Window) -> None:
    """Everybody at the time of the conflict; the ego and its opponent at a few times before and after it."""
    prepared, scene, dt = result.prepared, result.prepared.scene, result.prepared.scene.dt
    moment, end = round(at / dt), round(_shown_until(result) / dt)
    # The conflict first: where labels would cover each other, the earlier one stays.
    steps = list(dict.fromkeys([moment, 0, end, moment // 2]))
    opponent = result.search.conflict.obstacle_id
    labels = _Labels(axes, 0.055 * (window[0][1] - window[0][0]), window)
    body = _corners(scene.vehicle.length, scene.vehicle.width)
    states = result.states
    for k in steps:
        dark = 0.75 if k == moment else 0.25
        for obstacle in scene.obstacles:
            hit = obstacle.id == opponent
            outline = _outline(obstacle, k)
            if outline is None or not (hit or k == moment):
                continue
            colour = _OBSTACLE if hit else "#8A8A8A"
            axes.fill(*outline.T, facecolor=colour, edgecolor=colour, alpha=dark, zorder=2)
            if hit and obstacle.role != "static":
                labels.add(f"{k * dt:.3g} s", 0.5 * (outline.min(axis=0) + outline.max(axis=0)))
        if k < len(states):
            corners = _placed(body, states.x[k], states.y[k], states.orientation[k])
            axes.fill(*corners.T, facecolor=_EGO, edgecolor=_EGO, alpha=dark, zorder=3)
            labels.add(f"{k * dt:.3g} s", corners.mean(axis=0))
    _draw_motion(axes, result, end, window)
    if result.status is SearchStatus.FOUND:
        driven = prepared.checker.drive(prepared.reference, prepared.t_reference)
        driven = driven.every(prepared.config.checker.substeps)
        if moment < len(driven):
            ghost = _placed(body, driven.x[moment], driven.y[moment], driven.orientation[moment])
            axes.fill(
                *ghost.T, fill=False, ec=_REFERENCE, ls="--", zorder=5, label=f"ego unrepaired, {at:.3g} s"
            )
    axes.fill([], [], color=_EGO, alpha=0.75, label=f"ego (dark: {at:.3g} s)")
    if opponent is not None:
        axes.fill([], [], color=_OBSTACLE, alpha=0.75, label=f"obstacle {opponent} (dark: {at:.3g} s)")
    if any(o.id != opponent for o in scene.obstacles):
        axes.fill([], [], color="#8A8A8A", alpha=0.75, label=f"other obstacles, {at:.3g} s")


def _draw_motion(axes: Any, result: RepairResult, end: int, window: _Window) -> None:
    """Where the others' centres go until ``end``, those that move and are seen."""
    label: str | None = f"others' motion, 0 to {end * result.prepared.scene.dt:.3g} s"
    low, high = np.array(window).T
    for obstacle in result.prepared.scene.obstacles:
        outlines = [_outline(obstacle, k) for k in range(end + 1)]
        centres = np.array([0.5 * (x.min(axis=0) + x.max(axis=0)) for x in outlines if x is not None])
        if len(centres) < 2 or np.ptp(centres, axis=0).max() < 0.5:
            continue
        if ((low < centres) & (centres < high)).all(axis=1).any():
            axes.plot(*centres.T, color="#555555", lw=1.0, ls=(0, (1, 2)), zorder=1.5, label=label)
            label = None


class _Labels:
    """Times written on vehicles, left out where they would cover an earlier one."""

    def __init__(self, axes: Any, apart: float, window: _Window) -> None:
        self.axes, self.apart, self.window, self.taken = axes, apart, window, []  # type: ignore[var-annotated]

    def add(self, text: str, at: Array) -> None:
        inside = all(low <= c <= high for c, (low, high) in zip(at, self.window, strict=True))
        if not inside or any(np.hypot(*(at - other)) < self.apart for other in self.taken):
            return
        from matplotlib.patheffects import withStroke

        self.taken.append(at)
        halo = [withStroke(linewidth=2.0, foreground="white")]
        self.axes.text(*at, text, fontsize=8, ha="center", va="center", zorder=7, path_effects=halo)


def _outline(obstacle: Obstacle, step: int) -> Array | None:
    """Outline (V, 2) of an obstacle at a step, None where it is absent."""
    if step > obstacle.n_steps:
        return None
    points = obstacle.vertices[step]
    points = points[np.isfinite(points).all(axis=1)]
    return points if len(points) else None


def _corners(length: float, width: float) -> Array:
    return 0.5 * np.array([[length, width], [length, -width], [-length, -width], [-length, width]])


def _placed(corners: Array, x: float, y: float, heading: float) -> Array:
    cos, sin = np.cos(heading), np.sin(heading)
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + [x, y])
