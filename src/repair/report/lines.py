"""The driven curves of an outcome as lines to draw: labels, colours, dashes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from repair.errors import OutputError
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Drawing, Line, Outcome
from repair.report.style import EGO, OBSTACLE, REFERENCE
from repair.timegrid import STEP

__all__ = ["Styled", "continuation_lines", "drawing_in", "reference_line", "repair_lines", "title_of"]


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
    return [
        _styled(outcome, *pair, colormaps["viridis"](shade))
        for pair, shade in zip(pairs, shades, strict=True)
    ]


def _has_curve(probe: dict[str, Any], curves: list[Line]) -> bool:
    left = probe["min_speed_mps"] is not None
    return left and any(abs((line.t_rep or 0.0) - probe["t_rep_s"]) < STEP for line in curves)


def _styled(outcome: Outcome, line: Line, probe: dict[str, Any], colour: Any) -> Styled:
    best = probe["feasible"] and outcome.f_ttr is not None and abs(probe["t_rep_s"] - outcome.f_ttr) < STEP
    verdict = " (F-TTR)" if best else ""
    if not probe["feasible"]:
        verdict = "\n" + ", ".join(probe["reasons"]).replace("_", " ")
    style = {"color": colour, "lw": 2.4 if best else 1.5, "ls": "-" if probe["feasible"] else (0, (4, 2))}
    label = f"$t_{{rep}}$ = {probe['t_rep_s']:g} s{verdict}"
    return Styled(line, label, style, bool(probe["feasible"]))


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
