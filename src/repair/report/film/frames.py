"""Frames of a film: two panels of the same traffic, with another ego in each."""

from __future__ import annotations

import logging
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from repair.arrays import Array
from repair.errors import OutputError
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Drawing
from repair.report.birdseye import placed
from repair.report.film.bodies import Moving
from repair.report.style import EGO, OBSTACLE, OTHERS, REFERENCE, FigureStyle

__all__ = ["Film", "Panel", "animation", "frames_of"]

_DPI = 90
_FASTEST = 25.0  # frames a second
_LAST = 1.0  # how long the last frame stays [s]


@dataclass(frozen=True)
class Panel:
    """One of the two pictures.

    Attributes
    ----------
    ego : (T, 3) array
        x, y [m] and heading [rad] at the steps.
    planned : bool
        It is the plan, as it was; else what is driven.
    hit : int or None
        The step from which on it is in contact: it stays there.
    titles : tuple of str
        For each step.
    mark : (2,) array or None
        Where the plan is left [m].
    """

    ego: Array
    planned: bool
    hit: int | None
    titles: tuple[str, ...]
    mark: Array | None = None


@dataclass(frozen=True)
class Film:
    """What is shown.

    Attributes
    ----------
    title : str
    dt : float
        [s].
    drawing : Drawing
        Road, traffic, and the outline of the ego.
    opponent : int or None
        Who is in another colour.
    panels : (Panel, Panel)
    windows : (T, 4) array
        Lowest and highest x, lowest and highest y at each step [m].
    """

    title: str
    dt: float
    drawing: Drawing
    opponent: int | None
    panels: tuple[Panel, Panel]
    windows: Array

    @property
    def n_steps(self) -> int:
        """Frames before any is left out."""
        return len(self.windows)


def animation(film: Film, file_format: str = "gif", progress: Callable[..., Any] | None = None) -> bytes:
    """The film, in its own time.

    Parameters
    ----------
    film : Film
    file_format : str
        ``gif``, or ``mp4`` (needs ffmpeg).
    progress : callable, optional
        Wraps the frames, as tqdm does.

    Raises
    ------
    OutputError
        If the format is unknown, or ffmpeg is not there, or makes no film.
    """
    import_matplotlib()
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if file_format not in ("gif", "mp4"):
        raise OutputError(f"a film is a .gif or an .mp4, and not a .{file_format}")
    if file_format == "mp4" and not FFMpegWriter.isAvailable():
        raise OutputError("an .mp4 needs the program ffmpeg, which is not there; a .gif needs nothing")
    every = max(1, round(1.0 / (film.dt * _FASTEST)))
    rate: Any = 1.0 / (film.dt * every)
    shown = list(range(film.n_steps))[::every]
    shown += [shown[-1]] * round(_LAST * rate)
    writer = PillowWriter(fps=rate) if file_format == "gif" else FFMpegWriter(fps=rate)
    figure, draw = _figure(film)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"film.{file_format}"
        steps: Iterable[int] = shown if progress is None else progress(shown)
        with _by_ffmpeg(writer) if file_format == "mp4" else nullcontext():
            writer.setup(figure, str(file), _DPI)
            for k in steps:
                draw(k)
                writer.grab_frame()
            writer.finish()
        return file.read_bytes()


@contextmanager
def _by_ffmpeg(writer: Any) -> Iterator[None]:
    """What ffmpeg complains of is one sentence, whether it ends at once or after the last frame."""
    log = logging.getLogger("matplotlib.animation")
    before, log.disabled = log.disabled, True  # it would show all that ffmpeg says
    try:
        try:
            yield
        except BrokenPipeError:
            writer.finish()  # which says why
            raise
    except (OSError, subprocess.CalledProcessError) as error:
        said = str(getattr(error, "stderr", None) or error).strip().splitlines()
        raise OutputError(f"ffmpeg made no film: {said[-1]}; a .gif needs no ffmpeg") from error
    finally:
        log.disabled = before


def frames_of(film: Film, steps: Iterable[int]) -> list[Any]:
    """Single frames, as figures."""
    figures = []
    for k in steps:
        figure, draw = _figure(film)
        draw(min(max(k, 0), film.n_steps - 1))
        figures.append(figure)
    return figures


def _figure(film: Film) -> tuple[Any, Callable[[int], None]]:
    """A figure, and what draws a step into it."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    x0, x1, y0, y1 = film.windows[0].tolist()
    shape, style = (y1 - y0) / (x1 - x0), FigureStyle()
    beside = shape > 0.45
    bodies = [Moving(body, film.n_steps - 1, film.dt) for body in film.drawing.bodies]
    with rc_context({**style.rc, "axes.grid": False}):
        wide = style.width * (1.25 if beside else 1.0)
        high = wide * shape * 0.5 + 0.9 if beside else wide * shape * 2.0 + 1.5
        # Even numbers of pixels, which films want.
        size = [2 * round(0.5 * _DPI * each) / _DPI for each in (wide, high)]
        figure = Figure(figsize=(size[0], size[1]), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, 2) if beside else figure.subplots(2, 1)
        for axes in panels:
            axes.set(aspect="equal", xticks=[], yticks=[])
            _road(axes, film.drawing)
    moving: list[Any] = []

    def draw(k: int) -> None:
        while moving:
            moving.pop().remove()
        for axes, panel in zip(panels, film.panels, strict=True):
            axes.set(xlim=film.windows[k, :2], ylim=film.windows[k, 2:])
            moving.extend(_others(axes, bodies, film, k))
            moving.extend(_ego(axes, panel, film, k))
        figure.suptitle(f"{film.title}: {k * film.dt:.2f} s", fontsize=10)

    return figure, draw


def _road(axes: Any, drawing: Drawing) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    axes.add_collection(PolyCollection(list(drawing.areas), facecolor="#ECECEC", edgecolor="none", zorder=0))
    axes.add_collection(LineCollection(list(drawing.edges), colors="#B5B5B5", linewidths=0.6, zorder=0.5))


def _others(axes: Any, bodies: list[Moving], film: Film, k: int) -> list[Any]:
    made = []
    for one in bodies:
        outline = one.outline(k)
        if outline is not None:
            shade = OBSTACLE if one.body.id == film.opponent else OTHERS
            made += axes.fill(*outline.T, facecolor=shade, edgecolor=shade, alpha=0.75, zorder=2)
    return made


def _ego(axes: Any, panel: Panel, film: Film, k: int) -> list[Any]:
    """The way, the place where the plan is left, and the ego at a step."""
    hit = panel.hit is not None and k >= panel.hit
    plain = REFERENCE if panel.planned else EGO
    colour = OBSTACLE if hit else plain
    made = list(
        axes.plot(
            *panel.ego[:, :2].T, color=plain, lw=1.0, ls=":" if panel.planned else "-", alpha=0.6, zorder=1.5
        )
    )
    if panel.mark is not None:
        made += axes.plot(*panel.mark, ls="", marker="v", ms=7, color="#009E73", mec="#000000", zorder=4)
        said = axes.annotate(
            "$t_{rep}$", panel.mark, (0, 7), textcoords="offset points", ha="center", fontsize=8, zorder=5,
            annotation_clip=True,
        )  # fmt: skip
        made.append(said)
    at = k if panel.hit is None else min(k, panel.hit)
    corners = placed(film.drawing.body, *panel.ego[min(at, len(panel.ego) - 1)])
    made += axes.fill(*corners.T, facecolor=colour, edgecolor="#000000", lw=0.5, alpha=0.9, zorder=3)
    axes.set_title(panel.titles[k], color=colour if panel.planned or hit else "#000000", fontsize=9.5)
    return made
