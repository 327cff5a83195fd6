"""The driven curves of an outcome as lines to draw: labels, colours, dashes, and how far they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from repair.arrays import Array
from repair.errors import OutputError
from repair.io.plotting import import_matplotlib
from repair.outcome.data import Drawing, Line, Outcome
from repair.report.style import EGO, OBSTACLE, REFERENCE
from repair.timegrid import INSTANT, STEP

__all__ = [
    "Along", "Styled", "continuation_lines", "drawing_in", "driven_line", "lateral_acceleration",
    "overlapped", "reference_line", "repair_lines", "title_of",
]  # fmt: skip

_FAR = 50.0  # of more than that, the few metres that decide are nothing to be seen [m]
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


@dataclass(frozen=True)
class Along:
    """How a place along the path is shown.

    Attributes
    ----------
    reference : Line
    start : float
        s of the ego at t = 0 [m].
    half : float
        Half of the ego's length [m].
    moving : bool
        Whether places are shown as seen from the reference.
    """

    reference: Line
    start: float
    half: float
    moving: bool

    @classmethod
    def of(cls, drawing: Drawing) -> Along:
        """That of a drawing: as seen from the reference where that goes far, and something else is driven."""
        reference = drawing.lines[0]
        half = 0.5 * float(np.ptp(np.asarray(drawing.body)[:, 0]))
        far = bool(np.ptp(reference.s) > _FAR) and len(drawing.lines) > 1
        return cls(reference, drawing.start_s, half, far)

    @property
    def label(self) -> str:
        """What stands beside the axis."""
        return "ahead of the reference [m]" if self.moving else "distance driven s [m]"

    def __call__(self, t: Array, s: Array) -> Array:
        """Places (K,) at times (K,) as they are shown [m]; after its end the reference keeps its speed."""
        if not self.moving:
            return np.asarray(s - self.start)
        own = self.reference
        after = np.maximum(t - own.t[-1], 0.0) * own.speed[-1]
        return np.asarray(s - np.interp(t, own.t, own.s) - after)


def driven_line(outcome: Outcome) -> tuple[Line, bool]:
    """The reference, from the F-TTR on the repair; and whether what is driven was found free of contact."""
    lines = drawing_in(outcome).lines
    reference, best = lines[0], outcome.f_ttr
    if outcome.status == "no_conflict":
        return reference, True
    probes = [p for p in outcome.probes if p["feasible"]]
    repairs = [x for x in lines if x.kind == "repair" and best is not None]
    found = [x for x in repairs if abs((x.t_rep or 0.0) - (best or 0.0)) < STEP]
    if not found or not probes:
        return reference, False
    repair = found[-1]  # the later of those of several backends is the one that was kept
    keep = reference.t < repair.t[0] - INSTANT
    columns = ("t", "s", "l", "x", "y", "speed", "acceleration")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(reference, name)[keep], getattr(repair, name)]) for name in columns
    }
    return replace(repair, **joined), True


def overlapped(drawing: Drawing, line: Line, half: float) -> npt.NDArray[np.bool_]:
    """At which samples (K,) of a line the ego's length lies over that of somebody in the reference's way."""
    found = np.zeros(len(line.t), dtype=bool)
    for box in drawing.boxes:
        low, high = (np.interp(line.t, box.t, ends, np.nan, np.nan) for ends in (box.low, box.high))
        with np.errstate(invalid="ignore"):  # who is not there is nowhere
            found |= (line.s + half > low + drawing.s_offset) & (line.s - half < high - drawing.s_offset)
    return found
