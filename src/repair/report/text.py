"""What ``repair run`` prints: made from the content of ``result.json`` alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from repair.report.notes import grouped
from repair.report.rows.bound import bound_rows
from repair.report.rows.mitigation import mitigation_rows
from repair.report.rows.why import why_rows
from repair.report.timeline import timeline_rows

__all__ = ["answer", "fixed", "headline", "probe_table", "summary"]

_KINDS = {
    "margin": "the safety margin of obstacle {id} is entered",
    "collision": "obstacle {id} is touched",
    "off_road": "the reference leaves the road",
    "limits": "the reference breaks a limit",
    "kinematics": "the reference becomes impossible to drive",
}
_EXTREMES = (
    "peak_deceleration_mps2", "peak_acceleration_mps2", "peak_lateral_acceleration_mps2", "min_speed_mps",
)  # fmt: skip
_PROVENANCE = {
    "official": "official file, sha256 {sha}",
    "reconstruction": "reconstruction by this project from the paper, not an official file",
    "file": "file {name}, sha256 {sha}",
    "memory": "from memory",
}


def summary(content: dict[str, Any], preset: str | None, written: Sequence[Path] = ()) -> str:
    """A readable account of a result.

    Parameters
    ----------
    content : dict
        See :func:`repair.io.result_json.to_dict`.
    preset : str or None
        The preset's name, for the headline.
    written : sequence of Path
        Files that were written.
    """
    lines = [answer(content, preset)]
    if content["probes"]:
        lines += ["", *probe_table(content["probes"])]
    lines += ["", f"Time      {_times(content['time_s'])}"]
    lines += [f"{'Note' if k == 0 else '':9} {note}" for k, note in enumerate(grouped(content["notes"]))]
    if written:
        lines += [f"{'Files' if k == 0 else '':9} {path}" for k, path in enumerate(written)]
        if (why := content.get("report_file_problem")) is not None:
            lines.append(f"{'':9} no report.html: {why}")
    else:
        lines.append(
            "Files     none written; --out DIR writes result.json, the solution file, figures and a page"
        )
    return "\n".join(lines)


def answer(content: dict[str, Any], preset: str | None = None) -> str:
    """The lines of :func:`headline` as text."""
    return "\n".join(f"{name:9} {text}" for name, text in headline(content, preset))


def headline(content: dict[str, Any], preset: str | None = None) -> list[tuple[str, str]]:
    """What is asked first: scenario, backend, status, TTC, F-TTR and what is driven, each with its name."""
    origin = content["provenance"]
    label = _PROVENANCE[origin["kind"]].format(name=origin["name"], sha=(origin["sha256"] or "")[:12])
    rows = [
        ("Scenario", f"{content['scenario']} ({label})"),
        ("Backend", content["backend"] + (f", preset {preset}" if preset else "")),
        ("Status", f"{content['status']}: {content['status_sentence']}"),
        *_decided(content),
        ("TTC", _ttc(content)),
        ("F-TTR", _f_ttr(content)),
        *bound_rows(content),
        *timeline_rows(content),
        *why_rows(content),
        *mitigation_rows(content),
    ]
    if content["peak_deceleration_mps2"] is not None:
        rows.append(("Repair", _extremes(content)))
    if content.get("onward"):
        rows.append(("Onward", content["onward"]["sentence"]))
    if content.get("terminal"):
        rows.append(("After it", _after(content["terminal"])))
    if content.get("metrics"):  # results of earlier versions have none
        rows.append(("Metrics", _metrics(content["metrics"])))
    if not content["complete"]:
        rows.append(("", "The search was stopped early: a later time-to-repair may be feasible."))
    return rows


def _decided(content: dict[str, Any]) -> list[tuple[str, str]]:
    beyond = content.get("prediction_end")
    if not beyond:
        return []
    text = "by the end of a prediction: that of obstacle {obstacle_id} ends at {ends_s:.2f} s; at constant "
    text += "velocity it would be met at {constant_velocity_met_s:.2f} s (scene.after_prediction)"
    return [("Decided", text.format(**beyond))]


def _ttc(content: dict[str, Any]) -> str:
    conflict = content["conflict"]
    if content["ttc_s"] is None:
        return "none: the reference runs into nothing"
    kind = conflict["kind"]
    what = _KINDS.get(kind, kind).format(id=conflict["obstacle_id"])
    if conflict.get("detail"):
        what += f" ({conflict['detail']})"
    touch = content.get("contact_ttc_s")
    same = conflict["obstacle_id"] == conflict.get("contact_obstacle_id")
    if kind == "collision" and touch is not None and same:
        behind = " from behind" if conflict.get("from_behind") else ""
        return f"{content['ttc_s']:.2f} s on the scenario's grid: {what}{behind} at {touch:.2f} s"
    exact = content.get("exact_ttc_s")
    if kind in ("margin", "off_road") and exact is not None and abs(exact - content["ttc_s"]) >= 0.005:
        what += f" at {exact:.2f} s"
    contact = "; nothing is touched" if kind == "margin" else ""
    if touch is not None:
        behind = ", from behind" if conflict.get("from_behind") else ""
        contact = (
            f"; true shapes touch at {touch:.2f} s (obstacle {conflict.get('contact_obstacle_id')}{behind})"
        )
    return f"{content['ttc_s']:.2f} s: {what}{contact}"


def _f_ttr(content: dict[str, Any]) -> str:
    if content["f_ttr_s"] is not None:
        how = f", {content['maneuver'].replace('_', ' ')}" if content["maneuver"] else ""
        if content.get("repaired_by") not in (None, content["backend"]):
            how += f", found by {content['repaired_by']}"
            how += f" ({content['backend']} finds nothing)" if content.get("by_fallback") else ""
        return f"{content['f_ttr_s']:.2f} s{how}"
    return "unlimited: there is nothing to react to" if content["status"] == "no_conflict" else "none"


_STOPS = {
    "stand": "it stands", "brake": "full braking", "swerve_left": "braking and swerving left",
    "swerve_right": "braking and swerving right",
}  # fmt: skip


def _after(terminal: dict[str, Any]) -> str:
    """How safe the end of a repair is, and what shows it."""
    text = str(terminal["ending"]).replace("_", " ")
    if terminal["maneuver"] and terminal["ending"] != "unsafe":
        text += f": {_STOPS.get(terminal['maneuver'], terminal['maneuver'])}"
        text += f", at rest at {fixed(terminal['stands_s'])} s"
    met: dict[str, list[str]] = {}
    for how, one in terminal["extended"].items():
        if one is not None:
            words = f"{one['detail'] or one['reason']} at {fixed(one['t_s'])} s"
            met.setdefault(words, []).append(how.replace("_", " "))
    text += "".join(f"; beyond its prediction ({' or '.join(hows)}): {words}" for words, hows in met.items())
    if terminal["ending"] == "unsafe":
        first = min(terminal["details"], key=lambda one: one["t_s"] or 0.0)
        text += f": of {terminal['tried']} stops none passes every check; full braking fails at "
        text += f"{fixed(first['t_s'])} s, {first['reason'].replace('_', ' ')}"
        text += f": {first['detail']}" if first["detail"] else ""
    return text


def _metrics(metrics: dict[str, Any]) -> str:
    """Each with its value, or with the word that stands in its place."""
    parts = []
    for name, metric in metrics.items():
        unit, value = next((k.removeprefix("value_"), v) for k, v in metric.items() if k.startswith("value_"))
        word = metric["status"].replace("_", " ")
        parts.append(f"{name.upper()} {word if value is None else f'{value:.2f} {unit}'}")
    return ", ".join(parts)


def _extremes(content: dict[str, Any]) -> str:
    """Peaks by their sign: who only accelerates has no peak deceleration."""
    low, high = content["peak_deceleration_mps2"], content.get("peak_acceleration_mps2")
    parts = []
    if low is not None and round(low, 2) < 0.0:
        parts.append(f"peak deceleration {fixed(low)} m/s²")
    if high is not None and (round(high, 2) > 0.0 or not parts):
        parts.append(f"peak acceleration {fixed(max(high, 0.0))} m/s²")
    parts.append(f"peak lateral acceleration {fixed(content['peak_lateral_acceleration_mps2'])} m/s²")
    parts.append(f"minimum speed {fixed(content['min_speed_mps'])} m/s")
    return ", ".join(parts)


def probe_table(probes: list[dict[str, Any]]) -> list[str]:
    """The visited times-to-repair as lines, then what was wrong with each."""
    head = ("t_rep", "verdict", "manoeuvre", "a_min", "a_max", "a_lat", "v_min", "solver", "solve", "check")
    units = ("[s]", "", "", "[m/s²]", "[m/s²]", "[m/s²]", "[m/s]", "", "[ms]", "[ms]")
    table: list[tuple[str, ...]] = [head, units]
    for p in probes:
        table.append(
            (
                f"{p['t_rep_s']:.2f}",
                "feasible" if p["feasible"] else ", ".join(p["reasons"]),
                (p["maneuver"] or "-").replace("_", " "),
                *(fixed(p.get(k)) for k in _EXTREMES),
                f"{p['solver_status']}, {p['iterations']} it.",
                _milliseconds(p["solve_time_s"]),
                _milliseconds(p["check_time_s"]),
            )
        )
    if len({p.get("backend") for p in probes}) > 1:
        names = ["backend", "", *(str(p.get("backend") or "-") for p in probes)]
        table = [(*row[:1], name, *row[1:]) for row, name in zip(table, names, strict=True)]
    shift = len(table[0]) - len(head)
    widths = [max(len(row[k]) for row in table) for k in range(len(head) + shift)]
    numbers = {0, *(k + shift for k in (3, 4, 5, 6, 8, 9))}
    lines = [
        "  ".join(c.rjust(widths[k]) if k in numbers else c.ljust(widths[k]) for k, c in enumerate(row))
        for row in table
    ]
    details = [
        f"  {p['t_rep_s']:.2f} s: {d['reason']} at {d['t_s']:.2f} s"
        + (f": {d['detail']}" if d["detail"] else "")
        for p in probes
        if not p["feasible"]
        for d in p["details"]
        if d["t_s"] is not None
    ]
    details += [  # what the solver calls infeasible may pass every check
        f"  {p['t_rep_s']:.2f} s: solver: {p['solver_detail']}"
        for p in probes
        if p["feasible"] and p["solver_status"] == "infeasible" and p["solver_detail"]
    ]
    return [line.rstrip() for line in lines] + details


def fixed(value: float | None) -> str:
    """Two decimals; a dash where there is no number."""
    return "-" if value is None else f"{round(value, 2) + 0.0:.2f}"  # no -0.00


def _milliseconds(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1e3 * seconds:.1f}"


def _times(seconds: dict[str, float | None]) -> str:
    parts = {name: 1e3 * value for name, value in seconds.items() if value is not None}
    inner = [f"{name} {parts.pop(name):.1f}" for name in ("build", "solve", "check") if name in parts]
    outer = [f"{name} {value:.0f}" for name, value in parts.items() if name != "search"]
    whole = f"search {parts['search']:.1f}" if "search" in parts else ""
    return ", ".join(outer) + (f"; {whole} ms ({', '.join(inner)})" if whole else " ms")
