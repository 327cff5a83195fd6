"""The scene from above."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.report.lines import Line, coloured, probe_line, reference_line, shown_until, title_of
from repair.report.style import EGO, OBSTACLE, REFERENCE, STYLE, WIDTH
from repair.search.result import SearchStatus

if TYPE_CHECKING:
    from repair.api import RepairResult
    from repair.scene.traffic.obstacle import Obstacle

__all__ = ["birdseye_figure"]

_Window = tuple[tuple[float, float], tuple[float, float]]
"""Ranges of x and y [m]."""


def birdseye_figure(result: RepairResult) -> Any:
    """Road, obstacles at a few times, the reference and the repaired trajectories from above."""
    from matplotlib import rc_context
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    scene, conflict = result.prepared.scene, result.search.conflict
    reference = reference_line(result)
    window, shape = _window(result, reference)
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, 0.87 * WIDTH * shape + 1.3), layout="constrained")
        axes = figure.add_subplot()
        lanelets = scene.scenario.lanelet_network.lanelets
        outlines = [np.vstack([x.left_vertices, x.right_vertices[::-1]])[:, :2] for x in lanelets]
        axes.add_collection(PolyCollection(outlines, facecolor="#ECECEC", edgecolor="none", zorder=0))
        edges = [v[:, :2] for x in lanelets for v in (x.left_vertices, x.right_vertices)]
        axes.add_collection(LineCollection(edges, colors="#B5B5B5", linewidths=0.6, zorder=0.5))
        # Above the repairs: one that stays on the reference must not hide it.
        axes.plot(*reference.xy.T, color=REFERENCE, lw=1.2, ls=":", label="reference", zorder=4.5)
        for probe, colour in coloured(result):
            line = probe_line(result, probe, colour)
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
            title=title_of(result),
        )
        axes.grid(visible=False)
        figure.legend(loc="outside lower center", ncols=4, frameon=False)
    return figure


# -- bird's-eye view -------------------------------------------------------------------------------


def _window(result: RepairResult, reference: Line) -> tuple[_Window, float]:
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
    moment, end = round(at / dt), round(shown_until(result) / dt)
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
            colour = OBSTACLE if hit else "#8A8A8A"
            axes.fill(*outline.T, facecolor=colour, edgecolor=colour, alpha=dark, zorder=2)
            if hit and obstacle.role != "static":
                labels.add(f"{k * dt:.3g} s", 0.5 * (outline.min(axis=0) + outline.max(axis=0)))
        if k < len(states):
            corners = _placed(body, states.x[k], states.y[k], states.orientation[k])
            axes.fill(*corners.T, facecolor=EGO, edgecolor=EGO, alpha=dark, zorder=3)
            labels.add(f"{k * dt:.3g} s", corners.mean(axis=0))
    _draw_motion(axes, result, end, window)
    if result.status is SearchStatus.FOUND:
        driven = prepared.checker.drive(prepared.reference, prepared.t_reference)
        driven = driven.every(prepared.config.checker.substeps)
        if moment < len(driven):
            ghost = _placed(body, driven.x[moment], driven.y[moment], driven.orientation[moment])
            axes.fill(
                *ghost.T, fill=False, ec=REFERENCE, ls="--", zorder=5, label=f"ego unrepaired, {at:.3g} s"
            )
    axes.fill([], [], color=EGO, alpha=0.75, label=f"ego (dark: {at:.3g} s)")
    if opponent is not None:
        axes.fill([], [], color=OBSTACLE, alpha=0.75, label=f"obstacle {opponent} (dark: {at:.3g} s)")
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
