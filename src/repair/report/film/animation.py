"""A result as a film: the traffic, the plan as it was, and beside it the plan repaired."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import OutputError
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Body, Drawing, Line, Outcome
from repair.report.birdseye import placed, window_around
from repair.report.lines import drawing_in, title_of
from repair.report.style import EGO, OBSTACLE, OTHERS, REFERENCE, FigureStyle
from repair.timegrid import INSTANT

__all__ = ["animation", "frames_of"]

_DPI = 90
_FASTEST = 25.0  # frames a second
_STANDS = 0.3  # below this speed a body keeps its heading [m/s]
_LAST = 1.0  # how long the last frame stays [s]


@dataclass(frozen=True)
class _Film:
    """What does not change from frame to frame."""

    outcome: Outcome
    drawing: Drawing
    dt: float
    steps: range
    plan: Array
    driven: Array
    headings: dict[int, Array]
    hit: float | None
    f_ttr: float | None


def animation(
    outcome: Outcome, file_format: str = "gif", progress: Callable[..., Any] | None = None
) -> bytes:
    """A film of a result, in its own time.

    Parameters
    ----------
    outcome : Outcome
        With something to draw.
    file_format : str
        ``gif``, or ``mp4`` (needs ffmpeg).
    progress : callable, optional
        Wraps the frames, as tqdm does.

    Raises
    ------
    OutputError
        If there is nothing to draw, the format is unknown, or ffmpeg is not there.
    """
    import_matplotlib()
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if file_format not in ("gif", "mp4"):
        raise OutputError(f"a film is a .gif or an .mp4, and not a .{file_format}")
    if file_format == "mp4" and not FFMpegWriter.isAvailable():
        raise OutputError("an .mp4 needs the program ffmpeg, which is not there; a .gif needs nothing")
    film = _film(outcome)
    every = max(1, round(1.0 / (film.dt * _FASTEST)))
    rate: Any = 1.0 / (film.dt * every)
    shown = list(film.steps)[::every]
    shown += [shown[-1]] * round(_LAST * rate)
    writer = PillowWriter(fps=rate) if file_format == "gif" else FFMpegWriter(fps=rate)
    figure, draw = _figure(film)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"film.{file_format}"
        writer.setup(figure, str(file), _DPI)
        steps: Iterable[int] = shown if progress is None else progress(shown)
        for k in steps:
            draw(k)
            writer.grab_frame()
        writer.finish()
        return file.read_bytes()


def frames_of(outcome: Outcome, steps: Iterable[int]) -> list[Any]:
    """Single frames, as figures.

    Parameters
    ----------
    outcome : Outcome
    steps : iterable of int
        Of the scenario.
    """
    film, figures = _film(outcome), []
    for k in steps:
        figure, draw = _figure(film)
        draw(min(max(k, film.steps[0]), film.steps[-1]))
        figures.append(figure)
    return figures


def _film(outcome: Outcome) -> _Film:
    drawing = drawing_in(outcome)
    dt = float(outcome.record["trajectory"]["dt_s"])
    reference = drawing.lines[0]
    last = min(round(drawing.until / dt), len(drawing.ego) - 1)
    t = np.arange(last + 1) * dt
    bodies = {body.id: _heading(body, last, dt) for body in drawing.bodies}
    f_ttr = outcome.f_ttr if outcome.status == "found" else None
    hit = None if outcome.ttc == np.inf else outcome.ttc
    plan, driven = _along(reference, t), np.asarray(drawing.ego[: last + 1])
    return _Film(outcome, drawing, dt, range(last + 1), plan, driven, bodies, hit, f_ttr)


def _along(line: Line, t: Array) -> Array:
    """x, y and heading of a line at times; where it stands, the heading stays."""
    x, y = np.interp(t, line.t, line.x), np.interp(t, line.t, line.y)
    across = np.column_stack([np.gradient(line.x), np.gradient(line.y)])
    heading = _kept(np.unwrap(np.arctan2(across[:, 1], across[:, 0])), line.speed > _STANDS)
    return np.column_stack([x, y, np.interp(t, line.t, heading)])


def _kept(heading: Array, moving: Any) -> Array:
    """The last heading while moving; the first one before."""
    if not moving.any():
        return np.full_like(heading, heading[0])
    last = np.maximum.accumulate(np.where(moving, np.arange(len(heading)), -1))
    return np.asarray(heading[np.where(last < 0, int(np.argmax(moving)), last)])


def _heading(body: Body, last: int, dt: float) -> Array:
    """How far a body is turned at each step against its first outline [rad].

    Outlines are known at a few steps. Between them it turns as its motion does, but for what the outlines say
    is left over.
    """
    known = _known(body)
    count = min(last + 1, len(body.centres))
    if not known or count < 3 or len({len(body.outlines[k]) for k in known}) > 1:
        return np.zeros(last + 1)
    centres = body.centres[:count]
    there: Any = np.isfinite(centres).all(axis=1)
    rate = np.gradient(np.where(there[:, None], centres, 0.0), dt, axis=0)
    steady: Any = there & np.roll(there, 1) & np.roll(there, -1)
    moving = np.asarray(steady & (np.hypot(rate[:, 0], rate[:, 1]) > _STANDS))
    course = _kept(np.unwrap(np.arctan2(rate[:, 1], rate[:, 0])), moving)
    edge = [body.outlines[k][1] - body.outlines[k][0] for k in known]
    shape = np.unwrap([np.arctan2(e[1], e[0]) for e in edge])
    at = [min(k, count - 1) for k in known]
    rest = np.unwrap(shape - shape[0] - (course[at] - course[at[0]]))
    turned = course - course[at[0]] + np.interp(np.arange(count), at, rest)
    return np.concatenate([turned, np.full(last + 1 - count, turned[-1])])


def _outline(film: _Film, body: Body, k: int) -> Array | None:
    """The outline of one of the others at a step; None where it is not there."""
    if len(body.centres) < 2:  # it stands
        return next(iter(body.outlines.values()), None)
    if k >= len(body.centres) or not np.isfinite(body.centres[k]).all():
        return body.outlines.get(k)
    known = _known(body)
    if not known:
        return None
    if len({len(body.outlines[j]) for j in known}) > 1:  # a set: its nearest outline, moved
        near = min(known, key=lambda j: abs(j - k))
        return np.asarray(body.outlines[near] + (body.centres[k] - body.centres[near]))
    first = known[0]
    away, turned = body.outlines[first] - body.centres[first], film.headings[body.id]
    x, y = body.centres[k].tolist()
    return placed(away, x, y, float(turned[k] - turned[first]))


def _known(body: Body) -> list[int]:
    """The steps at which outline and middle are known."""
    there = [k for k in sorted(body.outlines) if k < len(body.centres)]
    return [k for k in there if np.isfinite(body.centres[k]).all()]


def _figure(film: _Film) -> tuple[Any, Callable[[int], None]]:
    """A figure, and what draws a step into it."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    window, shape = window_around(film.outcome)
    beside, style = shape > 0.45, FigureStyle()
    with rc_context({**style.rc, "axes.grid": False}):
        wide = style.width * (1.25 if beside else 1.0)
        high = wide * shape * (0.55 if beside else 2.0) + 1.5
        figure = Figure(figsize=(round(wide, 1), round(high, 1)), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, 2) if beside else figure.subplots(2, 1)
        for axes in panels:
            axes.set(xlim=window[0], ylim=window[1], aspect="equal", xticks=[], yticks=[])
            _road(axes, film.drawing)
    moving: list[Any] = []

    def draw(k: int) -> None:
        while moving:
            moving.pop().remove()
        t = k * film.dt
        struck = film.hit is not None and t >= film.hit - INSTANT
        colour = OBSTACLE if struck else REFERENCE
        at = min(k, round(film.hit / film.dt)) if film.hit is not None else k
        moving.extend(_scene(panels[0], film, k, film.plan[at], colour))
        moving.extend(_scene(panels[1], film, k, film.driven[k], EGO))
        panels[0].set_title(f"as planned{', in conflict' if struck else ''}", color=colour, fontsize=9.5)
        panels[1].set_title(_countdown(film, t), fontsize=9.5)
        figure.suptitle(f"{title_of(film.outcome)}: {t:.2f} s", fontsize=10)

    return figure, draw


def _road(axes: Any, drawing: Drawing) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    axes.add_collection(PolyCollection(list(drawing.areas), facecolor="#ECECEC", edgecolor="none", zorder=0))
    axes.add_collection(LineCollection(list(drawing.edges), colors="#B5B5B5", linewidths=0.6, zorder=0.5))


def _countdown(film: _Film, t: float) -> str:
    """What of the time to react is left."""
    if film.f_ttr is None:
        return f"driven ({film.outcome.status.replace('_', ' ')})"
    left = film.f_ttr - t
    return f"repaired: F-TTR in {left:.2f} s" if left > INSTANT else f"repaired, since {film.f_ttr:g} s"


def _scene(axes: Any, film: _Film, k: int, ego: Array, colour: str) -> list[Any]:
    """Traffic, the way so far, the place of t_rep and the ego at a step."""
    opponent = film.outcome.record["conflict"]["obstacle_id"]
    made = []
    for body in film.drawing.bodies:
        outline = _outline(film, body, k)
        if outline is not None:
            shade = OBSTACLE if body.id == opponent else OTHERS
            made += axes.fill(*outline.T, facecolor=shade, edgecolor=shade, alpha=0.75, zorder=2)
    repaired = colour == EGO
    way = film.driven if repaired else film.plan
    made += axes.plot(
        *way[:, :2].T, color=colour, lw=1.0, ls=":" if not repaired else "-", alpha=0.6, zorder=1.5
    )
    if film.f_ttr is not None and repaired:
        at = film.plan[min(round(film.f_ttr / film.dt), len(film.plan) - 1)]
        made += axes.plot(*at[:2], ls="", marker="v", ms=7, color="#009E73", mec="#000000", zorder=4)
        said = axes.annotate(
            "$t_{rep}$", at[:2], (0, 7), textcoords="offset points", ha="center", fontsize=8, zorder=5
        )
        made.append(said)
    corners = placed(film.drawing.body, *ego)
    made += axes.fill(*corners.T, facecolor=colour, edgecolor="#000000", lw=0.5, alpha=0.9, zorder=3)
    return made
