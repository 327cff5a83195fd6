"""The driven curves of an outcome as lines to draw: labels, colours, dashes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repair.arrays import Array
from repair.errors import OutputError
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Drawing, Line, Outcome
from repair.report.style import EGO, OBSTACLE, REFERENCE
from repair.timegrid import STEP

__all__ = [
    "Styled", "continuation_lines", "drawing_in", "lateral_acceleration", "reference_line", "repair_lines",
    "title_of",
]  # fmt: skip

_NAMED = 8  # so many times-to-repair have a line each in a legend
_REACH = 0.05  # differences are taken so far to either side [s]
_RESTS = 0.5  # who is slower has no lateral acceleration that could be told from its path [m/s]


@dataclass(frozen=True)
class Styled:
    """A line, and how it is drawn.

    Attributes
    ----------
    line : Line
    label : str
    style : dict
        For matplotlib's ``plot``.
    feasible : bool
        Whether what it shows passed every check.
    """

    line: Line
    label: str
    style: dict[str, Any]
    feasible: bool = True


def drawing_in(outcome: Outcome) -> Drawing:
    """What there is to draw.

    Raises
    ------
    OutputError
        If the outcome was loaded from a folder that holds none.
    """
    if outcome.drawing is None:
        raise OutputError(
            f"the result of {outcome.scenario} holds nothing to draw; repair it again with this version"
        )
    return outcome.drawing


def reference_line(outcome: Outcome) -> Styled:
    """The reference, dotted."""
    return Styled(drawing_in(outcome).lines[0], "reference", {"color": REFERENCE, "lw": 1.4, "ls": ":"})


def repair_lines(outcome: Outcome) -> list[Styled]:
    """The repairs of all visited times-to-repair, by t_rep, in the order of a colour-blind-safe map.

    Dashed is what did not pass a check; the F-TTR is the widest.

    Raises
    ------
    OutputError
        If what there is to draw is not of these times-to-repair.
    """
    import_matplotlib()
    from matplotlib import colormaps

    curves = [line for line in drawing_in(outcome).lines if line.kind == "repair"]
    # Several backends may have been asked at one time, and one of them may have left no curve.
    probes = [p for p in outcome.probes if _has_curve(p, curves)]
    if len(probes) != len(curves):
        raise OutputError(
            f"the result of {outcome.scenario} does not fit what there is to draw: {len(curves)} repairs, "
            f"and {len(probes)} times-to-repair of theirs"
        )
    pairs = sorted(zip(curves, probes, strict=True), key=lambda pair: pair[0].t_rep or 0.0)
    shades: Any = np.linspace(0.08, 0.86, max(len(pairs), 2))[-len(pairs) :] if pairs else []
    made = [
        _styled(outcome, *pair, colormaps["viridis"](shade))
        for pair, shade in zip(pairs, shades, strict=True)
    ]
    return _named(made)


def _named(lines: list[Styled]) -> list[Styled]:
    """Of very many only the first, the best, the one after it and the last are named."""
    if len(lines) <= _NAMED:
        return lines
    best = next((k for k, x in enumerate(lines) if "F-TTR" in x.label), 0)
    kept = {0, best, best + 1, len(lines) - 1}
    others = [k for k in range(len(lines)) if k not in kept]
    labels = dict.fromkeys(others, "_") | {others[0]: f"{len(others)} others between"}
    return [replace(x, label=labels.get(k, x.label)) for k, x in enumerate(lines)]


def _has_curve(probe: dict[str, Any], curves: list[Line]) -> bool:
    left = probe["min_speed_mps"] is not None
    return left and any(abs((line.t_rep or 0.0) - probe["t_rep_s"]) < STEP for line in curves)


def _styled(outcome: Outcome, line: Line, probe: dict[str, Any], colour: Any) -> Styled:
    best = probe["feasible"] and outcome.f_ttr is not None and abs(probe["t_rep_s"] - outcome.f_ttr) < STEP
    verdict = " (F-TTR)" if best else ""
    if not probe["feasible"]:
        verdict = "\n" + ", ".join(probe["reasons"]).replace("_", " ")
    style = {"color": colour, "lw": 2.4 if best else 1.5, "ls": "-" if probe["feasible"] else (0, (4, 2))}
    by = probe.get("backend")
    other = f", {by}" if by and by != outcome.backend else ""
    label = f"$t_{{rep}}$ = {probe['t_rep_s']:g} s{other}{verdict}"
    return Styled(line, label, style, bool(probe["feasible"]))


def lateral_acceleration(line: Line) -> Array:
    """Lateral acceleration (K,) at the samples [m/s²], to the left: speed by the turning rate of the path.

    By differences over about 0.1 s: places are rounded to a tenth of a millimetre.
    """
    count = len(line.t)
    if count < 5:
        return np.zeros(count)
    step = float(line.t[-1] - line.t[0]) / (count - 1)
    reach = int(np.clip(round(_REACH / step), 1, (count - 1) // 4))
    k = np.arange(count)
    before, after = np.maximum(k - reach, 0), np.minimum(k + reach, count - 1)

    def rate(values: Array) -> Array:
        return np.asarray((values[after] - values[before]) / (line.t[after] - line.t[before]))

    dx, dy = rate(line.x), rate(line.y)
    speed = np.hypot(dx, dy)
    heading = np.unwrap(np.arctan2(dy, dx))
    made: Array = np.where(speed > _RESTS, speed * rate(heading), 0.0)
    ends = 2 * reach  # one-sided differences of one-sided differences are no accelerations
    made[:ends], made[-ends:] = made[ends], made[-ends - 1]
    return made


def continuation_lines(outcome: Outcome) -> list[Styled]:
    """The stop after the repair, dash-dotted, red where it fails; what is driven after it; a last resort."""
    found = []
    for line in drawing_in(outcome).lines:
        if line.kind == "continuation":
            colour = OBSTACLE if line.name == "unsafe" else EGO
            label = f"stop after it,\n{line.name.replace('_', ' ')}"
            found.append(Styled(line, label, {"color": colour, "lw": 1.4, "ls": "-."}))
        elif line.kind == "onward":
            label = "on to the goal" if line.name == "goal" else "back to the\nreference"
            found.append(Styled(line, label, {"color": "#009E73", "lw": 1.8}))
        elif line.kind == "mitigation":
            label = "least impact" if line.name != "none" else "nothing touched"
            found.append(Styled(line, label, {"color": "#CC79A7", "lw": 2.4}))
    return found


def title_of(outcome: Outcome) -> str:
    """Scenario, where it comes from if it is a reconstruction, and backend."""
    kind = " (reconstruction)" if outcome.record["provenance"]["kind"] == "reconstruction" else ""
    return f"{outcome.scenario}{kind}, backend {outcome.backend}"
