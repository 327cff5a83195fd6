"""The scene from above."""

from __future__ import annotations

from typing import Any

import numpy as np

from repair.arrays import Array
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Drawing, Outcome
from repair.report.lines import continuation_lines, drawing_in, reference_line, repair_lines, title_of
from repair.report.style import EGO, OBSTACLE, OTHERS, REFERENCE, FigureStyle

__all__ = ["birdseye_figure", "placed", "window_around"]

_LONG = 50.0  # of a longer way only that is shown on which something happens [m]
_ELSEWHERE, _BEFORE = 0.5, 1.0  # who is so far from the reference [m], and how long before that [s]
_COVERED = 8  # a label that covers more points of what is drawn is left out
_Window = tuple[tuple[float, float], tuple[float, float]]
"""Ranges of x and y [m]."""


def birdseye_figure(outcome: Outcome, style: FigureStyle | None = None) -> Any:
    """Road, obstacles at a few times, the reference and the repaired trajectories from above.

    What is shown begins where the first repair leaves the reference, a little before it.

    Parameters
    ----------
    outcome : Outcome
    style : FigureStyle, optional

    Returns
    -------
    matplotlib.figure.Figure
    """
    import_matplotlib()
    from matplotlib import rc_context
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    drawing = drawing_in(outcome)
    reference = reference_line(outcome).line
    style = style or FigureStyle()
    window, shape = window_around(outcome)
    with rc_context(style.rc):
        size = style.width, 0.87 * style.width * shape + (1.3 + style.narrow) * style.font_size / 9.5
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.add_subplot()
        axes.add_collection(
            PolyCollection(list(drawing.areas), facecolor="#ECECEC", edgecolor="none", zorder=0)
        )
        axes.add_collection(LineCollection(list(drawing.edges), colors="#B5B5B5", linewidths=0.6, zorder=0.5))
        # Above the repairs: one that stays on the reference must not hide it.
        axes.plot(reference.x, reference.y, color=REFERENCE, lw=1.2, ls=":", label="reference", zorder=4.5)
        for repair in repair_lines(outcome):
            label = repair.label if repair.feasible else f"{repair.label.splitlines()[0]}, infeasible"
            axes.plot(repair.line.x, repair.line.y, label=label, zorder=4, **repair.style)
        for stop in continuation_lines(outcome):
            axes.plot(stop.line.x, stop.line.y, label=stop.label.replace("\n", " "), zorder=4.2, **stop.style)
        _draw_vehicles(axes, outcome, window)
        _draw_departures(axes, outcome)
        _draw_impact(axes, outcome)
        axes.set(
            xlim=window[0],
            ylim=window[1],
            aspect="equal",
            xlabel="x [m]",
            ylabel="y [m]",
            title=title_of(outcome),
        )
        axes.grid(visible=False)
        few = {"ncols": 2, "fontsize": "small"} if style.narrow else {"ncols": 4}
        figure.legend(loc="outside lower center", frameon=False, **few)
    return figure


def window_around(outcome: Outcome) -> tuple[_Window, float]:
    """Ranges of x and y that hold all that happens with some room, and their ratio of height to width."""
    drawing = drawing_in(outcome)
    reference = drawing.lines[0]
    driven = [reference, *(line for line in drawing.lines if line.kind == "continuation")]
    begin = _begins(outcome)
    first = int(begin / float(outcome.record["trajectory"]["dt_s"]))
    paths = [np.column_stack([line.x, line.y])[line.t >= begin] for line in driven]
    points = np.vstack([*paths, drawing.ego[min(first, len(drawing.ego) - 1) :, :2]])
    ends = [line for line in drawing.lines if line.kind == "mitigation" and line.name != "none"]
    if ends:  # what comes after an impact is nobody's motion
        points = np.column_stack([ends[0].x, ends[0].y])
    elif (place := outcome.record["conflict"].get("place_m")) is not None:
        points = np.vstack([points, place])
    road = np.vstack(drawing.edges) if drawing.edges else points
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


def _begins(outcome: Outcome) -> float:
    """Shortly before a repair is somewhere else than the reference [s]; 0 where the way there is short."""
    drawing = drawing_in(outcome)
    reference, times = drawing.lines[0], []
    if np.ptp(reference.s) < _LONG or not np.isfinite(outcome.ttc):
        return 0.0
    for line in drawing.lines:
        if line.kind in ("repair", "mitigation"):
            x, y = (np.interp(line.t, reference.t, column) for column in (reference.x, reference.y))
            times += line.t[np.hypot(line.x - x, line.y - y) > _ELSEWHERE][:1].tolist()
    return max(float(min([outcome.f_ttr or outcome.ttc, outcome.ttc, *times])) - _BEFORE, 0.0)


def _draw_vehicles(axes: Any, outcome: Outcome, window: _Window) -> None:
    """Everybody at the time of the conflict; the ego and its opponent at a few times before and after it."""
    drawing, record = drawing_in(outcome), outcome.record
    dt, opponent = float(record["trajectory"]["dt_s"]), record["conflict"]["obstacle_id"]
    at = float(record["t_end_s"]) if record["ttc_s"] is None else float(record["ttc_s"])
    moment = drawing.steps[0]
    labels = _Labels(axes, window, drawing)
    body = drawing.body
    for k in drawing.steps:
        dark = 0.75 if k == moment else 0.25
        for other in drawing.bodies:
            hit, outline = other.id == opponent, other.outlines.get(k)
            if outline is None or not (hit or k == moment):
                continue
            colour = OBSTACLE if hit else OTHERS
            axes.fill(*outline.T, facecolor=colour, edgecolor=colour, alpha=dark, zorder=2)
            if hit and other.role != "static":
                labels.add(f"{k * dt:.3g} s", outline, OBSTACLE)
        if k < len(drawing.ego):
            corners = placed(body, *drawing.ego[k])
            axes.fill(*corners.T, facecolor=EGO, edgecolor=EGO, alpha=dark, zorder=3)
            labels.add(f"{k * dt:.3g} s", corners, EGO)
    _draw_motion(axes, drawing, window)
    if drawing.unrepaired is not None:
        ghost = placed(body, *drawing.unrepaired)
        axes.fill(*ghost.T, fill=False, ec=REFERENCE, ls="--", zorder=5, label=f"ego unrepaired, {at:.3g} s")
    axes.fill([], [], color=EGO, alpha=0.75, label=f"ego (dark: {at:.3g} s)")
    if opponent is not None:
        axes.fill([], [], color=OBSTACLE, alpha=0.75, label=f"obstacle {opponent} (dark: {at:.3g} s)")
    if any(other.id != opponent for other in drawing.bodies):
        axes.fill([], [], color=OTHERS, alpha=0.75, label=f"other obstacles, {at:.3g} s")


def _draw_departures(axes: Any, outcome: Outcome) -> None:
    """Where the reference or a repair leaves the road."""
    record = outcome.record
    said = [record["conflict"], *(one for probe in record["probes"] for one in probe["details"])]
    places = [one["place_m"] for one in said if one.get("place_m") is not None]
    if places:
        x, y = zip(*dict.fromkeys(map(tuple, places)), strict=True)
        axes.plot(x, y, ls="", marker="x", ms=7, mew=1.8, color="#D00000", zorder=6, label="off the road")


def _draw_impact(axes: Any, outcome: Outcome) -> None:
    """Where the motion that hits least hard ends: the ego then, and the place of contact."""
    told = outcome.record.get("mitigation") or {}
    time, place = told.get("contact_t_s"), told.get("place_m")
    if time is None or place is None:
        return
    steps = told["trajectory"]
    columns = (steps["x_m"], steps["y_m"], np.unwrap(steps["orientation_rad"]))
    x, y, psi = (float(np.interp(time, steps["t_s"], column)) for column in columns)
    corners = placed(drawing_in(outcome).body, x, y, psi)
    axes.fill(*corners.T, fill=False, ec="#CC79A7", lw=1.8, zorder=6, label=f"ego then, {time:.3g} s")
    words = f"impact, {told['impact_speed_mps']:.3g} m/s"
    axes.plot(*place, ls="", marker="*", ms=10, color="#CC79A7", mec="#000000", zorder=7, label=words)


def _draw_motion(axes: Any, drawing: Drawing, window: _Window) -> None:
    """Where the others' centres go, those that move and are seen."""
    label: str | None = f"others' motion, 0 to {drawing.until:.3g} s"
    low, high = np.array(window).T
    for other in drawing.bodies:
        centres = other.centres[np.isfinite(other.centres).all(axis=1)]
        if len(centres) > 1 and ((low < centres) & (centres < high)).all(axis=1).any():
            axes.plot(*centres.T, color="#888888", lw=0.8, ls=(0, (1, 2)), zorder=1.5, label=label)
            label = None


class _Labels:
    """Times written beside vehicles, where they cover neither vehicles, nor lines, nor an earlier time."""

    def __init__(self, axes: Any, window: _Window, drawing: Drawing) -> None:
        self.axes, self.window = axes, np.array(window)
        width = self.window[0, 1] - self.window[0, 0]
        self.size = np.array([0.035, 0.018]) * width  # half of a label, about
        lines = [np.column_stack([x.x, x.y]) for x in drawing.lines]
        bodies = [x.outlines[drawing.steps[0]] for x in drawing.bodies if drawing.steps[0] in x.outlines]
        self.taken = np.vstack([*lines, *map(_filled, bodies)])

    def add(self, text: str, outline: Array, colour: str) -> None:
        middle = outline.mean(axis=0)
        if not ((self.window[:, 0] <= middle) & (middle <= self.window[:, 1])).all():
            return
        angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False) + 0.25 * np.pi
        away = np.column_stack([np.cos(angles), np.sin(angles)])
        beyond = ((outline - middle) @ away.T).max(axis=0) + 1.1 * np.abs(away) @ self.size
        places = middle + away * beyond[:, None]
        inside = (places - self.size > self.window[:, 0]) & (places + self.size < self.window[:, 1])
        places = places[inside.all(axis=1)]
        if not len(places):
            return
        taken = np.vstack([self.taken, _filled(outline)])
        covered = (np.abs(places[:, None] - taken[None]) < self.size).all(axis=2).sum(axis=1)
        best = int(np.argmin(covered))
        if covered[best] > _COVERED:
            return
        from matplotlib.patheffects import withStroke

        corners = self.size * [[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]]
        self.taken = np.vstack([taken, *([places[best] + corners] * 3)])
        halo = [withStroke(linewidth=2.0, foreground="white")]
        self.axes.text(*places[best], text, fontsize="small", ha="center", va="center", zorder=7,
                       color=colour, path_effects=halo)  # fmt: skip


def _filled(outline: Array) -> Array:
    """Points all over a shape."""
    shares = np.linspace(0.0, 1.0, 6)[:, None, None]
    edges = outline + shares * (np.roll(outline, -1, axis=0) - outline)
    middle = outline.mean(axis=0)
    return np.asarray((middle + shares[:, None] * (edges - middle)).reshape(-1, 2))


def placed(corners: Array, x: float, y: float, heading: float) -> Array:
    """Corners (V, 2) seen from a middle, turned by a heading [rad] and put at a place [m]."""
    cos, sin = np.cos(heading), np.sin(heading)
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + [x, y])
