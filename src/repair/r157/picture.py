"""The usual picture: distance against lateral speed, a panel for each policy, three colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.io.plotting import import_matplotlib
from repair.r157.cases import CASES
from repair.r157.results import AT_SIGHT, Fate, Results
from repair.report.style import FigureStyle

__all__ = ["SHOWN", "picture"]

#: Which pair of speeds [km/h] is drawn by default; all of them in the deceleration case.
SHOWN = {"cut_in_low": (60, 20), "cut_in_high": (110, 40), "cut_out": (100, 100), "deceleration": None}
_AVOIDED, _STRUCK, _PROVEN, _UNASKED = "#9ECAE1", "#E6550D", "#3B3B3B", "#F0F0F0"
_ACROSS = 4


def picture(results: Results, pair: tuple[int, int] | None) -> Any:
    """A panel for each policy.

    Parameters
    ----------
    results : Results
    pair : (int, int) or None
        Speeds of the ego and the other [km/h]; None takes all points (deceleration: speed against
        deceleration).

    Returns
    -------
    matplotlib.figure.Figure
    """
    import_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    points = results.points
    rows = np.arange(len(points))
    if pair is not None:
        rows = np.flatnonzero((points.ego == pair[0]) & (points.other == pair[1]))
    braking = points.case == "deceleration"
    across, up = (points.ego, points.deceleration) if braking else (points.distance, points.lateral)
    x, y = np.unique(across[rows]), np.unique(np.round(up[rows], 6))
    place = np.searchsorted(y, np.round(up[rows], 6)), np.searchsorted(x, across[rows])
    names = _panels(results, rows)
    wide = min(len(names), _ACROSS)
    deep = -(-len(names) // wide)
    style = FigureStyle()
    with rc_context({**style.rc, "axes.grid": False}):
        figure = Figure(figsize=(1.25 * style.width, 2.3 * deep + 1.0), layout="constrained")
        panels = figure.subplots(deep, wide, sharex=True, sharey=True, squeeze=False)
        for axes, (name, title) in zip(panels.flat, names.items(), strict=False):
            colours = np.zeros((len(y), len(x)))
            colours[place] = _colours(results, results.fates[name], rows)
            _panel(axes, x, y, colours, title)
        for axes in panels.flat[len(names) :]:
            axes.set_visible(False)
        words = ("speed [km/h]", "deceleration [g]") if braking else ("distance [m]", "lateral speed [m/s]")
        for axes in panels.flat[max(len(names) - wide, 0) : len(names)]:  # with nothing below
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(words[0])
        for axes in panels[:, 0]:
            axes.set_ylabel(words[1])
        at = "" if pair is None else f": {pair[0]} km/h, the other {pair[1]} km/h"
        figure.suptitle(f"{CASES[points.case].capitalize()}{at}", fontsize=11)
        told = [Patch(color=_AVOIDED, label="avoided"), Patch(color=_STRUCK, label="struck")]
        if results.proven is not None:
            told.append(Patch(color=_PROVEN, label="proven unavoidable"))
        if any(not results.fates[name].asked[rows].all() for name in names):
            told.append(Patch(color=_UNASKED, label="not looked at"))
        figure.legend(handles=told, loc="outside lower center", ncols=len(told), frameon=False)
    return figure


def _panels(results: Results, rows: npt.NDArray[Any]) -> dict[str, str]:
    """Policies and their titles; one that comes out as at the F-TTR is no panel of its own."""
    made: dict[str, str] = {}
    for name, fate in results.fates.items():
        late = name.removesuffix(AT_SIGHT)
        if name == "never":
            continue
        if late in made and (fate.struck[rows] == results.fates[late].struck[rows]).all():
            made[late] = f"{late}, F-TTR or sight"
            continue
        made[name] = name
    return made


def _colours(results: Results, fate: Fate, rows: npt.NDArray[Any]) -> Array:
    colours = np.where(fate.struck, 1.0, 0.0)
    if results.proven is not None:
        colours = np.where(results.proven & fate.struck, 2.0, colours)
    return np.asarray(np.where(fate.asked, colours, 3.0)[rows])


def _panel(axes: Any, x: Array, y: Array, colours: Array, name: str) -> None:
    from matplotlib.colors import ListedColormap

    def edges(values: Array) -> Array:
        if len(values) == 1:
            return np.array([values[0] - 0.5, values[0] + 0.5])
        middle = 0.5 * (values[1:] + values[:-1])
        return np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])

    mapped = ListedColormap([_AVOIDED, _STRUCK, _PROVEN, _UNASKED])
    axes.pcolormesh(edges(x), edges(y), colours, cmap=mapped, vmin=-0.5, vmax=3.5)
    axes.set_title(name, fontsize=9.5)
