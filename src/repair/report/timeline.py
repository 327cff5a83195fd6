"""The time to react as a line: verified, unknown, proven too late; as text and as a figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from repair.io.plotting import import_matplotlib
from repair.outcome.data import Outcome
from repair.report.lines import title_of
from repair.report.style import FigureStyle

__all__ = ["Part", "parts_of", "text_bar", "timeline_figure", "timeline_rows"]

#: What can be said of a time, with its sign in text, its colour and its hatching: told apart by each alone.
_LOOKS = {
    "verified": ("=", "#0072B2", ""),
    "unknown": ("?", "#F0E442", "...."),
    "proven too late": ("x", "#D55E00", "////"),
}
_CELLS = 40  # of a bar of text
_FOR = {"vehicle": "the vehicle", "search": "the checker"}


class Part(NamedTuple):
    """A part of the time until the conflict: what can be said of it, and from when to when [s]."""

    what: str
    begin: float
    end: float


def parts_of(f_ttr: float | None, late: float | None, ttc: float) -> tuple[Part, ...]:
    """The time until the conflict in parts, those of no length left out.

    Until the F-TTR a repair is verified: who reacts earlier may follow the reference until then. From the
    bound on it is proven too late; what lies between is unknown, as is everything where nothing was asked.

    Parameters
    ----------
    f_ttr : float or None
        [s]; None where nothing was found.
    late : float or None
        The bound [s]; None where there is no proof.
    ttc : float
        [s]
    """
    first = min(max(f_ttr or 0.0, 0.0), ttc)
    last = ttc if late is None else min(max(late, first), ttc)
    made = (Part("verified", 0.0, first), Part("unknown", first, last), Part("proven too late", last, ttc))
    return tuple(part for part in made if part.end > part.begin)


def text_bar(f_ttr: float | None, late: float | None, ttc: float, cells: int = _CELLS) -> str:
    """The same in characters that every terminal has; each part has one at least."""
    parts = parts_of(f_ttr, late, ttc)
    if not parts:
        return ""
    sizes = [max(round((part.end - part.begin) / ttc * cells), 1) for part in parts]
    sizes[sizes.index(max(sizes))] += cells - sum(sizes)
    return "".join(_LOOKS[part.what][0] * size for part, size in zip(parts, sizes, strict=True))


def timeline_rows(content: Mapping[str, Any]) -> list[tuple[str, str]]:
    """A line for the console, where the bound was asked for.

    Parameters
    ----------
    content : mapping
        What ``result.json`` holds.
    """
    bound, ttc = content.get("bound"), content["ttc_s"]
    if not bound or not ttc:
        return []
    parts = parts_of(content["f_ttr_s"], bound["t_bound_s"], ttc)
    legend = ", ".join(f"{_LOOKS[part.what][0]} {part.what}" for part in parts)
    bar = text_bar(content["f_ttr_s"], bound["t_bound_s"], ttc)
    return [("Timeline", f"0 |{bar}| {ttc:.2f} s ({legend})")]


def timeline_figure(outcome: Outcome, style: FigureStyle | None = None) -> Any:
    """F-TTR, gap and bound over the time until the conflict, a bar for each kind of bound.

    Ticks below the bars are the times-to-repair that were visited.

    Parameters
    ----------
    outcome : Outcome
    style : FigureStyle, optional

    Returns
    -------
    matplotlib.figure.Figure or None
        None where the bound was not asked for, or there is no time until the conflict.
    """
    record = outcome.record
    bound, ttc = record.get("bound"), record["ttc_s"]
    if not bound or not ttc:
        return None
    import_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    kinds = bound["kinds"]
    style = style or FigureStyle()
    look = {**style.rc, "hatch.linewidth": 0.6, "axes.grid": False, "axes.spines.left": False}
    with rc_context(look):
        size = style.width, (1.5 + 0.55 * len(kinds)) * max(style.width / 8.0, 0.7)
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.add_subplot()
        for row, one in enumerate(kinds.values()):
            for part in parts_of(record["f_ttr_s"], one["t_bound_s"], ttc):
                _, colour, hatch = _LOOKS[part.what]
                axes.barh(
                    -row, part.end - part.begin, 0.6, part.begin, color=colour, hatch=hatch,
                    edgecolor="#333333", linewidth=0.6,
                )  # fmt: skip
                _length(axes, part, -row, ttc)
            if one["t_bound_s"] is not None:
                axes.plot([one["t_bound_s"]] * 2, [-row - 0.4, -row + 0.4], color="#000000", lw=1.6)
        _ticks(axes, record, 1.0 - len(kinds) - 0.55)
        axes.set_yticks([-row for row in range(len(kinds))], [f"for {_FOR.get(k, k)}" for k in kinds])
        axes.tick_params(axis="y", length=0)
        axes.set(
            xlim=(-0.012 * ttc, 1.012 * ttc), ylim=(-len(kinds) + 0.25, 0.95), xlabel="time to react [s]",
            title=title_of(outcome),
        )  # fmt: skip
        _marks(axes, record, ttc)
        patches = [
            Patch(facecolor=colour, hatch=hatch, edgecolor="#333333", linewidth=0.6, label=what)
            for what, (_, colour, hatch) in _LOOKS.items()
        ]
        figure.legend(handles=patches, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _length(axes: Any, part: Part, row: float, ttc: float) -> None:
    """How long a part is, written in it where there is room."""
    if part.end - part.begin < 0.08 * ttc:
        return
    box = {"boxstyle": "square,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.9}
    middle = 0.5 * (part.begin + part.end)
    axes.text(
        middle, row, f"{part.end - part.begin:.3g} s", ha="center", va="center", fontsize="small", bbox=box
    )


def _ticks(axes: Any, record: Mapping[str, Any], height: float) -> None:
    """The visited times-to-repair: a dot where a repair was verified, a cross where none was found."""
    found = {p["t_rep_s"] for p in record["probes"] if p["feasible"]}
    missed = {p["t_rep_s"] for p in record["probes"]} - found
    for times, marker, label in ((found, "o", "repaired"), (missed, "x", "none found")):
        if times:
            axes.plot(
                sorted(times), [height] * len(times), ls="", marker=marker, ms=5, color="#333333", label=label
            )
    if found or missed:
        place = {"loc": "upper left", "bbox_to_anchor": (1.0, 0.25)}
        axes.legend(**place, frameon=False, fontsize="small", handletextpad=0.1)


def _marks(axes: Any, record: Mapping[str, Any], ttc: float) -> None:
    """F-TTR and TTC above the bars."""
    marks = [(ttc, f"TTC {ttc:.3g} s", "right")]
    if record["f_ttr_s"] is not None:
        marks.append((record["f_ttr_s"], f"F-TTR {record['f_ttr_s']:.3g} s", "center"))
    for time, words, side in marks:
        near = side == "center" and (time < 0.12 * ttc or time > 0.75 * ttc)
        side = ("left" if time < 0.12 * ttc else "right") if near else side
        height = 0.62 if side == "right" and time >= ttc else 0.42
        axes.text(time, height, words, ha=side, va="bottom", fontsize="small")
        axes.plot([time] * 2, [0.3, 0.44], color="#000000", lw=1.0)
