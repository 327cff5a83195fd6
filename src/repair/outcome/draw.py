"""What the figures show, taken from a search while the vehicle can still be driven."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from repair.arrays import Array, frozen
from repair.curves.base import Curve, SplicedCurve
from repair.mitigation.mitigate import Mitigation
from repair.onward.plan import Onward
from repair.outcome.data import Body, Box, Drawing, Line
from repair.preparation import Prepared
from repair.scene.traffic.obstacle import Obstacle
from repair.search.result import SearchResult, SearchStatus
from repair.terminal.verdict import Terminal
from repair.timegrid import INSTANT, STEP
from repair.vehicle.states import DrivenStates

__all__ = ["body_of", "drawing_of", "road_between", "rounded"]

_DIGITS = 4  # of metres and seconds: what is read from a file is what was drawn at once
_AROUND = 20.0  # road and traffic are shown at least this far beyond what is driven [m]
_STAYS = 0.5  # who moves less than this in all stands [m]


def drawing_of(
    prepared: Prepared,
    found: SearchResult,
    states: DrivenStates,
    terminal: Terminal | None = None,
    onward: Onward | None = None,
    mitigation: Mitigation | None = None,
) -> Drawing:
    """Lines, boxes, road and traffic of a result.

    Parameters
    ----------
    prepared : Prepared
    found : SearchResult
    states : DrivenStates
        What is driven, at the scenario's steps.
    terminal : Terminal or None
        How the repair ends.
    onward : Onward or None
        What is driven after the evasive part.
    mitigation : Mitigation or None
        The motion that hits least hard, drawn until then.
    """
    scene, dt = prepared.scene, prepared.scene.dt
    until = prepared.t_end if found.probes else prepared.t_reference
    at = found.conflict.time if np.isfinite(found.conflict.time) else prepared.t_end
    moment, end = round(at / dt), round(until / dt)
    # The conflict first: where labels would cover each other, the earlier one stays.
    hit = mitigation.best.impact.time if mitigation is not None and mitigation.best is not None else np.inf
    shown = [moment, 0, end, moment // 2, *([round(hit / dt)] if np.isfinite(hit) else [])]
    steps = tuple(dict.fromkeys(shown))
    lines = (*_lines(prepared, found, until), *_after(prepared, terminal, onward, mitigation))
    driven = rounded(np.column_stack([states.x, states.y, states.orientation]))
    seen = np.concatenate([np.column_stack([lines[0].x, lines[0].y]), driven[:, :2]])
    # A figure is at least as high as a fifth of its width, and shows that much road.
    around = _AROUND + float(np.ptp(seen, axis=0).max())
    low, high = seen.min(axis=0) - around, seen.max(axis=0) + around
    areas, edges = road_between(scene.scenario.lanelet_network, low, high)
    settings = prepared.config.scene
    return Drawing(
        start_s=round(float(scene.start[0, 0]), _DIGITS),
        s_offset=scene.vehicle.half_length if settings.s_offset is None else settings.s_offset,
        until=round(float(until), _DIGITS),
        steps=steps,
        body=rounded(scene.vehicle.corners),
        ego=driven,
        unrepaired=_unrepaired(prepared, found, moment),
        lines=lines,
        boxes=_boxes(prepared, max(float(line.t[-1]) for line in lines if len(line.t))),
        bodies=_bodies(scene.obstacles, steps, end, (low, high), found.conflict.obstacle_id),
        areas=areas,
        edges=edges,
    )


def rounded(values: Array) -> Array:
    """As it is written [m], [s]."""
    return frozen(np.round(values, _DIGITS) + 0.0)


def _lines(prepared: Prepared, found: SearchResult, until: float) -> tuple[Line, ...]:
    lines = [_line(prepared, prepared.reference, None, "reference", "", until)]
    for probe in found.probes:
        if probe.solve.curve is None:
            continue
        lines.append(_line(prepared, probe.solve.curve, probe.t_rep, "repair", "", until))
        for name, curve in probe.solve.stages.items():
            lines.append(_line(prepared, curve, probe.t_rep, "stage", name, until))
    return tuple(lines)


def _line(prepared: Prepared, curve: Curve, t_rep: float | None, kind: str, name: str, until: float) -> Line:
    """Sample a curve from ``t_rep`` on, or the reference from 0; the dense samples of the checker."""
    t_end = prepared.t_end if t_rep is not None else prepared.t_reference
    whole = curve if t_rep is None else SplicedCurve(prepared.reference, curve, t_rep)
    samples = whole.sample(prepared.checker.times(t_end))
    path = prepared.scene.frame.cartesian(samples)
    acceleration = np.gradient(path.speed, path.t) if len(path.t) > 2 else np.zeros(len(path.t))
    k = path.t >= (t_rep or 0.0) - INSTANT
    if t_rep is None:
        k &= path.t <= until + INSTANT
    columns = (path.t, *samples.position.T, *path.xy.T, path.speed, acceleration)
    return Line(kind, name, t_rep, *(rounded(column[k]) for column in columns))


def _after(
    prepared: Prepared, terminal: Terminal | None, onward: Onward | None, mitigation: Mitigation | None
) -> tuple[Line, ...]:
    """The stop after the repair, what is driven after it, what hits least hard; as densely as the others."""
    curves: list[tuple[str, str, Curve, float]] = []
    if terminal is not None and terminal.continuation is not None:
        stop = terminal.continuation.stop
        curves.append(("continuation", terminal.ending.value, stop, stop.t_end))
    if onward is not None and onward.leg is not None:
        curves.append(("onward", onward.kind, onward.leg, onward.leg.t_end))
    if mitigation is not None and (best := mitigation.best) is not None:
        end = min(best.impact.time, mitigation.t_end)
        curves.append(("mitigation", best.impact.kind, best.curve, end))
    lines = []
    for kind, name, curve, end in curves:
        if end - curve.t_start < INSTANT:
            continue  # what leaves the road at the very start has no way that could be drawn
        steps = max(math.ceil((end - curve.t_start) / prepared.scene.dt - STEP), 1)
        count = steps * prepared.checker.config.substeps
        samples = curve.sample(np.linspace(curve.t_start, end, count + 1))
        path = prepared.scene.frame.cartesian(samples)
        columns = (path.t, *samples.position.T, *path.xy.T, path.speed, np.gradient(path.speed, path.t))
        lines.append(Line(kind, name, None, *(rounded(column) for column in columns)))
    return tuple(lines)


def _boxes(prepared: Prepared, t_end: float) -> tuple[Box, ...]:
    """The s-interval of every box while it covers the reference's l: where the ego, a point, must not be."""
    occupancy = prepared.occupancy
    if not len(occupancy):
        return ()
    keep = occupancy.t <= t_end + INSTANT
    t, lower, upper = occupancy.t[keep], occupancy.lower[:, keep], occupancy.upper[:, keep]
    sideways = prepared.reference.sample(t).position[:, 1]
    in_the_way = (lower[..., 1] < sideways) & (sideways < upper[..., 1])
    return tuple(
        Box(
            int(occupancy.ids[k]),
            rounded(t),
            rounded(np.where(in_the_way[k], lower[k, :, 0], np.nan)),
            rounded(np.where(in_the_way[k], upper[k, :, 0], np.nan)),
        )
        for k in np.flatnonzero(in_the_way.any(axis=1))
    )


def road_between(network: object, low: Array, high: Array) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Lanelets that meet a rectangle: their areas, and their bounds."""
    areas, edges = [], []
    for lanelet in network.lanelets:  # type: ignore[attr-defined]
        left, right = lanelet.left_vertices[:, :2], lanelet.right_vertices[:, :2]
        outline = np.vstack([left, right[::-1]])
        if (outline.max(axis=0) >= low).all() and (outline.min(axis=0) <= high).all():
            areas.append(rounded(outline))
            edges += [rounded(left), rounded(right)]
    return tuple(areas), tuple(edges)


def _outline(obstacle: Obstacle, step: int) -> Array | None:
    """Outline (V, 2) of an obstacle at a step, None where it is absent."""
    if step > obstacle.n_steps:
        return None
    points = obstacle.vertices[step]
    points = points[np.isfinite(points).all(axis=1)]
    return points if len(points) else None


def _bodies(
    obstacles: Sequence[Obstacle],
    steps: tuple[int, ...],
    end: int,
    window: tuple[Array, Array],
    opponent: int | None,
) -> tuple[Body, ...]:
    """Those who come into the picture at the conflict, and who is met at all times that are shown."""
    made = (
        body_of(one, steps, end, None) if one.id == opponent else body_of(one, steps[:1], end, window)
        for one in obstacles
    )
    return tuple(body for body in made if body is not None)


def body_of(
    obstacle: Obstacle, steps: tuple[int, ...], end: int, window: tuple[Array, Array] | None
) -> Body | None:
    """An obstacle that is shown.

    Parameters
    ----------
    obstacle : Obstacle
    steps : tuple of int
        At which its outline is kept, as far as it is there.
    end : int
        Its middle is kept until this step.
    window : pair of (2,) arrays, or None
        Lowest and highest x and y [m]: None is returned for who never comes into it.
    """
    middles = _middles(obstacle, end)
    there = middles[np.isfinite(middles).all(axis=1)]
    if window is not None and not ((window[0] < there) & (there < window[1])).all(axis=1).any():
        return None
    shown = {step: rounded(outline) for step in steps if (outline := _outline(obstacle, step)) is not None}
    moves = len(there) > 1 and np.ptp(there, axis=0).max() >= _STAYS
    return Body(obstacle.id, obstacle.role, rounded(middles if moves else middles[:1]), shown)


def _middles(obstacle: Obstacle, end: int) -> Array:
    """Middles (end + 1, 2) of what is known of its outlines; NaN where it is absent."""
    outlines = obstacle.vertices[: end + 1]
    known = np.asarray(np.isfinite(outlines).all(axis=2))[..., None]
    low, high = (np.where(known, outlines, far) for far in (np.inf, -np.inf))
    middles = np.full((end + 1, 2), np.nan)
    there = known[..., 0].any(axis=1)
    middles[: len(outlines)][there] = 0.5 * (low[there].min(axis=1) + high[there].max(axis=1))
    return middles


def _unrepaired(prepared: Prepared, found: SearchResult, moment: int) -> Array | None:
    """The ego on the reference at the conflict, where it is repaired."""
    if found.status is not SearchStatus.FOUND:
        return None
    driven = prepared.checker.drive(prepared.reference, prepared.t_reference)
    driven = driven.every(prepared.checker.config.substeps)
    if moment >= len(driven):
        return None
    return rounded(np.array([driven.x[moment], driven.y[moment], driven.orientation[moment]]))
