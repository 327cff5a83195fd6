"""What became of every point under every policy, as a table and as rows."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from repair.arrays import Array
from repair.r157.cases import CASES, Flags, Points
from repair.r157.drive import Driven, drive, keep, unavoidable
from repair.r157.models import MODELS
from repair.r157.motion import sight
from repair.report.tables import DASH, Section, Table
from repair.timegrid import INSTANT
from repair.vehicle.parameters import load_vehicle

__all__ = ["AT_SIGHT", "Fate", "Results", "by_models", "contradicted", "rows_of", "table_of"]


#: Added to the name of a repair that begins as soon as there is somebody to react to.
AT_SIGHT = ", at sight"


@dataclass(frozen=True)
class Fate:
    """What becomes of the points of a case under one policy; arrays (N,).

    Attributes
    ----------
    asked : array
        Where it was looked at.
    struck : array
        Whether the ego and another touch, or (for a repair) nothing was found that avoids it.
    sideways : array
        Whether the other drove into the ego's side.
    time, impact : array
        When [s], and with which difference of speeds [m/s]; NaN where not struck or not known.
    peak : array
        Largest deceleration [m/s²]; NaN where not known.
    swerves : bool
        Whether it may leave its path.
    begun : array
        When something else is done than to keep on [s]: for a repair the F-TTR; NaN where nothing is.
    """

    asked: Flags
    struck: Flags
    sideways: Flags
    time: Array
    impact: Array
    peak: Array
    begun: Array
    swerves: bool = False


@dataclass(frozen=True)
class Results:
    """One case.

    Attributes
    ----------
    points : Points
    fates : dict
        By policy, in the order in which they are shown.
    proven : (N,) array or None
        Where it is proven that no speed along the lane avoids it, from when it is to be seen on
        (:func:`repair.r157.drive.unavoidable`); None in the published reading.
    proven_any : (N,) array or None
        Where the bound proves it for every motion of the vehicle, swerves too; None where nobody asked.
    proof_asked : (N,) array or None
        Where such a proof was looked for.
    """

    points: Points
    fates: Mapping[str, Fate] = field(default_factory=dict)
    proven: Flags | None = None
    proven_any: Flags | None = None
    proof_asked: Flags | None = None


def by_models(points: Points, *, published: bool = False) -> Results:
    """Nobody reacting, and each driver model.

    Parameters
    ----------
    points : Points
    published : bool
        In the reading of the published implementation instead of the regulation's.
    """
    fates = {} if published else {"never": _fate(keep(points))}
    for name, model in MODELS.items():
        if points.case.startswith(model.cases):
            fates[name] = _fate(drive(points, model(stated=not published)), model.delay)
    return Results(points, fates, None if published else unavoidable(points, load_vehicle(1).a_max))


def _fate(made: Driven, delay: float = 0.0) -> Fate:
    everywhere = np.ones(len(made.contact), dtype=bool)
    begun = made.first + delay
    return Fate(everywhere, made.contact, made.sideways, made.time, made.impact, made.peak, begun)


def table_of(results: list[Results], title: str) -> Table:
    """A section for each case, a row for each policy."""
    sections = []
    for one in results:
        rows = [_row(name, fate, one) for name, fate in one.fates.items()]
        for name, proven, asked in _proofs(one):
            rows.append((name, f"{int(asked.sum()):,}", f"{int(proven.sum()):,}", *[DASH] * 6))
        heading = f"{CASES[one.points.case]}, {len(one.points):,} points"
        sections.append(Section(heading, _COLUMNS, tuple(rows)))
    return Table(title, tuple(sections), _NOTES)


_COLUMNS = (
    "policy", "looked at", "struck", "ego drove in", "other drove in", "median impact [m/s]",
    "largest impact [m/s]", "median peak deceleration [m/s²]", "avoided though proven unavoidable",
)  # fmt: skip
_NOTES = (
    "struck: the ego touches another, or nothing was found that avoids it",
    "the other drove in: they were side by side when their lanes met",
    "peak decelerations are those at points where keeping on would strike",
    "proven unavoidable: no speed along the lane avoids it that the vehicle can drive from the sight on",
    "proven for any motion, swerves too: by the bound; looked for where it is close, and at a sample",
)


def _row(name: str, fate: Fate, one: Results) -> tuple[str, ...]:
    struck = fate.struck & fate.asked
    known = struck & ~np.isnan(fate.impact)
    impacts = fate.impact[known]
    conflict = one.fates["never"].struck if "never" in one.fates else np.ones_like(fate.struck)
    peaks = fate.peak[conflict & fate.asked & ~np.isnan(fate.peak)]
    wrong = DASH if one.proven is None else str(int(contradicted(one, fate).sum()))
    return (
        name, f"{int(fate.asked.sum()):,}", f"{int(struck.sum()):,}",
        f"{int((known & ~fate.sideways).sum()):,}" if known.any() else DASH,
        f"{int((known & fate.sideways).sum()):,}" if known.any() else DASH,
        f"{np.median(impacts):.1f}" if len(impacts) else DASH,
        f"{impacts.max():.1f}" if len(impacts) else DASH,
        f"{np.median(peaks):.1f}" if len(peaks) and name != "never" else DASH, wrong,
    )  # fmt: skip


def _proofs(one: Results) -> list[tuple[str, Flags, Flags]]:
    """Words, where it is proven, and where that was looked for."""
    found = []
    if one.proven is not None:
        found.append(("proven unavoidable", one.proven, np.ones_like(one.proven)))
    if one.proven_any is not None and one.proof_asked is not None:
        found.append(("proven for any motion", one.proven_any, one.proof_asked))
    return found


def contradicted(one: Results, fate: Fate) -> Flags:
    """Where somebody avoids what is proven unavoidable, and does not begin before it is to be seen.

    Who swerves is held against the proofs for any motion alone.
    """
    proven = np.zeros(len(one.points), dtype=bool)
    if one.proven is not None and not fate.swerves:
        proven |= one.proven
    if one.proven_any is not None:
        proven |= one.proven_any
    early = fate.begun < sight(one.points) - INSTANT
    return np.asarray(proven & fate.asked & ~fate.struck & ~early)


def rows_of(results: list[Results]) -> bytes:
    """A CSV with one row for each point and policy."""
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    write(["case", "ego_kmh", "other_kmh", "distance_m", "lateral_mps", "deceleration_g", "policy", "struck",
           "into", "t_s", "impact_mps", "peak_mps2", "begun_s"])  # fmt: skip
    for one in results:
        points = one.points
        heads = [
            [points.case, *(f"{value:.6g}" for value in values)]
            for values in zip(*points.columns, strict=True)
        ]
        for name, fate in one.fates.items():
            for i in np.flatnonzero(fate.asked).tolist():
                into = ("ego" if fate.sideways[i] else "other") if fate.struck[i] else ""
                numbers = (fate.time[i], fate.impact[i], fate.peak[i], fate.begun[i])
                said = ["" if np.isnan(value) else f"{value:.4f}" for value in numbers]
                write([*heads[i], name, "yes" if fate.struck[i] else "no", into, *said])
        for name, proven, asked in _proofs(one):
            for i in np.flatnonzero(asked).tolist():
                write([*heads[i], name, "yes" if proven[i] else "no", *[""] * 5])
    return text.getvalue().encode()
