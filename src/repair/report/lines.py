"""The driven curves of a result as lines to draw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from repair.arrays import Array
from repair.curves.base import Curve, SplicedCurve
from repair.report.style import REFERENCE
from repair.search.result import Probe

if TYPE_CHECKING:
    from repair.api import RepairResult

__all__ = ["Line", "coloured", "line_of", "probe_line", "reference_line", "shown_until", "title_of"]


@dataclass(frozen=True)
class Line:
    """One driven curve: its samples in both frames, and how it is drawn."""

    label: str
    t: Array
    position: Array
    xy: Array
    speed: Array
    acceleration: Array
    style: dict[str, Any]


# -- lines -----------------------------------------------------------------------------------------


def line_of(
    result: RepairResult, curve: Curve, t_rep: float | None, label: str, style: dict[str, Any]
) -> Line:
    """Sample a curve from ``t_rep`` on, or from 0; accelerations as in :mod:`repair.check.peaks`."""
    prepared = result.prepared
    t_end = prepared.t_end if t_rep is not None else prepared.t_reference
    whole = curve if t_rep is None else SplicedCurve(prepared.reference, curve, t_rep)
    samples = whole.sample(prepared.checker.times(t_end))
    path = prepared.scene.frame.cartesian(samples)
    acceleration = np.gradient(path.speed, path.t) if len(path.t) > 2 else np.zeros(len(path.t))
    k = path.t >= (t_rep or 0.0) - 1e-9
    return Line(label, path.t[k], samples.position[k], path.xy[k], path.speed[k], acceleration[k], style)


def reference_line(result: RepairResult) -> Line:
    style = {"color": REFERENCE, "lw": 1.4, "ls": ":"}
    line = line_of(result, result.prepared.reference, None, "reference", style)
    shown = line.t <= shown_until(result) + 1e-9
    names = ("t", "position", "xy", "speed", "acceleration")
    return replace(line, **{name: getattr(line, name)[shown] for name in names})


def shown_until(result: RepairResult) -> float:
    """End of the time axis: that of the repairs, or of the reference where nothing is repaired."""
    prepared = result.prepared
    return prepared.t_end if result.search.probes else prepared.t_reference


def coloured(result: RepairResult) -> list[tuple[Probe, Any]]:
    """The probes that have a curve, by t_rep, each with its colour."""
    from matplotlib import colormaps

    probes = sorted((p for p in result.search.probes if p.solve.curve is not None), key=lambda p: p.t_rep)
    shades: Any = np.linspace(0.08, 0.86, max(len(probes), 2))[-len(probes) :] if probes else []
    return [(p, colormaps["viridis"](shade)) for p, shade in zip(probes, shades, strict=True)]


def probe_line(result: RepairResult, probe: Probe, colour: Any) -> Line:
    assert probe.solve.curve is not None
    best = result.search.best is probe
    verdict = " (F-TTR)" if best else ""
    if not probe.feasible:
        verdict = "\n" + ", ".join(probe.verdict.reasons).replace("_", " ")
    style = {"color": colour, "lw": 2.4 if best else 1.5, "ls": "-" if probe.feasible else (0, (4, 2))}
    return line_of(result, probe.solve.curve, probe.t_rep, f"$t_{{rep}}$ = {probe.t_rep:g} s{verdict}", style)


def title_of(result: RepairResult) -> str:
    from repair.scene.provenance import provenance

    scene, config = result.prepared.scene, result.prepared.config
    kind = " (reconstruction)" if provenance(scene)["kind"] == "reconstruction" else ""
    return f"{scene.id}{kind}, backend {config.backend}"
