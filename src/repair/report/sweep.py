"""The report of a sweep: how many were repaired, what the official checker said, and why not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from repair.report.timeline import text_bar

__all__ = ["sweep_report"]

Row = Mapping[str, Any]
_REPAIRED = ("found", "no_conflict")


def sweep_report(rows: Sequence[Row], command: str) -> str:
    """Markdown of the rows of :func:`repair.study.run.sweep`.

    Parameters
    ----------
    rows : sequence of mapping
        With the keys :data:`repair.study.rows.COLUMNS`.
    command : str
        The command that made them, to stand beside the figures.
    """
    backends = list(dict.fromkeys(row["backend"] for row in rows))
    references = list(dict.fromkeys(row["reference"] for row in rows))
    parts = [
        f"Made by `{command}`; search times are those of one run on one machine.",
        "## How many\n\n" + _summary(rows, backends, references),
        "## What CommonRoad's own checker says\n\n" + _official(rows),
        "## How repairs end\n\n" + _endings(rows, backends, references),
        *(["## How late is too late\n\n" + _timelines(late)] if (late := _asked_late(rows)) else []),
        *(["## What hits least hard\n\n" + _impacts(hits)] if (hits := _hits(rows)) else []),
        "## Backends compared\n\n" + _compared(rows, backends),
        "## F-TTR above the TTR\n\n" + _above(rows),
        "## Repaired although braking does not help\n\n" + _beyond_braking(rows),
        "## Not repaired, and why\n\n" + _reasons(rows),
        "## Every file\n\n" + "\n\n".join(_files(rows, backends, reference) for reference in references),
    ]
    return "# Sweep\n\n" + "\n\n".join(parts) + "\n"


def _table(head: Sequence[str], body: Iterable[Sequence[Any]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(_cell(v) for v in row) + " |" for row in body]
    return "\n".join(lines)


def _cell(value: Any) -> str:
    if value is None or value == "":
        return ""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text.replace("|", "/").replace("\n", " ")


def _avoidable(row: Row) -> bool:
    return isinstance(row["ttb_s"], float)


def _kind(row: Row) -> str:
    """What the conflict is; a margin that is entered without any contact is told apart."""
    return "margin only" if row.get("margin_only") else row["conflict"] or ""


def _summary(rows: Sequence[Row], backends: Sequence[str], references: Sequence[str]) -> str:
    body = []
    for reference in references:
        for backend in backends:
            own = [r for r in rows if r["backend"] == backend and r["reference"] == reference]
            status = Counter(r["status"] for r in own)
            without = ("no_conflict", "input_error", "crash", "timeout")
            instead = sum(bool(r.get("by_fallback")) for r in own)
            braking = [r for r in own if r["status"] not in without and _avoidable(r)]
            helped = [r for r in braking if r["status"] in _REPAIRED and not r.get("by_fallback")]
            times = [1e3 * r["search_time_s"] for r in own if r["search_time_s"] is not None and r["probes"]]
            body.append((
                reference, backend, len(own), status["no_conflict"], status["found"] - instead, instead,
                status["none_feasible"], status["unavoidable"],
                len(own) - sum(status[s] for s in ("no_conflict", "found", "none_feasible", "unavoidable")),
                f"{len(helped)} of {len(braking)}",
                round(median(times), 1) if times else None,
                sum(bool(r.get("margin_only")) for r in own),
            ))  # fmt: skip
    head = ("reference", "backend", "files", "no conflict", "repaired", "by a fallback", "none feasible",
            "unavoidable", "other", "repaired by itself of those that braking at 8 m/s² avoids",
            "median search [ms]", "conflicts that are margin only")  # fmt: skip
    return _table(head, body)


_ASKED = {
    "official_solved": "the planning problem is solved (`solved_all_problems`)",
    "official_vehicle_model": "vehicle and model are known, the states are the model's",
    "official_connected": "each state follows the one before",
    "official_start": "start state (`starts_at_correct_state`)",
    "official_feasible": "feasibility (`solution_feasible`)",
    "official_collision_free": "no collision with obstacles (`obstacle_collision`)",
    "official_on_road": "no collision with the road's boundary (`boundary_collision`)",
    "official_egos_apart": "no collision among egos (`ego_collision`)",
    "official_goal": "goal (`goal_reached`)",
    "official_valid": "all of it",
}


def _official(rows: Sequence[Row]) -> str:
    judged = [r for r in rows if r["official_feasible"] is not None]
    keys = ("official_feasible", "official_collision_free", "official_on_road")
    others = ("official_solved", "official_vehicle_model", "official_connected", "official_start",
              "official_egos_apart")  # fmt: skip
    rejected = [r for r in judged if not all(r[k] for k in keys) or any(r.get(k) is False for k in others)]
    methods = ", ".join(f"{k}: {n}" for k, n in Counter(r["road_method"] for r in judged).items())
    text = (
        f"{len(judged)} trajectories (repaired, or the reference where there is no conflict) were written as "
        f"solution files, read back and judged; {len(rejected)} were rejected. "
        f"Road boundary by {methods or '-'}."
    )
    certified = [r for r in rows if r.get("certificate")]
    if certified:
        broken = [r for r in certified if r["certificate"] != "ok"]
        text += (
            f"\n\n{len(certified)} certificates were recomputed from the written files; "
            f"{len(broken)} have a violated margin."
        )
        if broken:
            body = [[r[k] for k in ("file", "backend", "reference", "certificate")] for r in broken]
            text += "\n\n" + _table(("file", "backend", "reference", "violated"), body)
    if any(r.get("official_valid") is not None for r in judged):
        table = [(words, sum(bool(r.get(key)) for r in judged), len(judged)) for key, words in _ASKED.items()]
        text += "\n\n" + _table(("what `valid_solution` asks for", "holds for", "of"), table)
    if rejected:
        body = [[r[k] for k in ("file", "backend", "reference", "status", *keys)] for r in rejected]
        head = ("file", "backend", "reference", "status", "feasible", "no collision", "road")
        text += "\n\n" + _table(head, body)
    return text


def _endings(rows: Sequence[Row], backends: Sequence[str], references: Sequence[str]) -> str:
    """How many repairs end safe, safe unless extended, and unsafe; the unsafe ones by name."""
    asked = [r for r in rows if r.get("ending")]
    if not asked:
        return "Nobody asked (`checker.terminal`)."
    kinds = ("safe", "safe_unless_extended", "unsafe")
    body = []
    for reference in references:
        for backend in backends:
            own = Counter(
                r["ending"] for r in asked if r["backend"] == backend and r["reference"] == reference
            )
            body.append((reference, backend, sum(own.values()), *(own[kind] for kind in kinds)))
    body.append(("all", "", len(asked), *(sum(r["ending"] == kind for r in asked) for kind in kinds)))
    head = ("reference", "backend", "repaired", "safe", "safe unless extended", "unsafe")
    text = _table(head, body)
    unsafe = [r for r in asked if r["ending"] == "unsafe"]
    if unsafe:
        keys = ("file", "reference", "backend", "f_ttr_s", "ending_detail")
        names = ("file", "reference", "backend", "F-TTR [s]", "what full braking fails on")
        text += "\n\n" + _table(names, [[r[k] for k in keys] for r in unsafe])
    return text


def _asked_late(rows: Sequence[Row]) -> list[Row]:
    """Those of which the bound was asked for."""
    return [
        r for r in rows if r.get("ttc_s") and (r.get("t_bound_s") is not None or r.get("gap_s") is not None)
    ]


def _timelines(rows: Sequence[Row]) -> str:
    body = [
        (r["file"], r["reference"], r["backend"], r["f_ttr_s"], r["t_bound_s"], r["gap_s"], r["ttc_s"],
         f"`{text_bar(r['f_ttr_s'], r['t_bound_s'], r['ttc_s'], 30)}`")
        for r in rows
    ]  # fmt: skip
    head = ("file", "reference", "backend", "F-TTR [s]", "bound [s]", "gap [s]", "TTC [s]", "until the TTC")
    words = "From 0 to the TTC: `=` a repair is verified, `?` unknown, `x` proven too late.\n\n"
    return words + _table(head, body)


def _hits(rows: Sequence[Row]) -> list[Row]:
    return [r for r in rows if r.get("impact_speed_mps") is not None]


def _impacts(rows: Sequence[Row]) -> str:
    keys = ("file", "reference", "backend", "status", "impact_speed_mps", "braking_impact_speed_mps")
    head = (*keys[:4], "impact speed [m/s]", "of full braking [m/s]")
    return _table(head, [[r[k] for k in keys] for r in rows])


def _value(row: Row) -> float:
    if row["status"] == "no_conflict":
        return float("inf")
    return float(row["f_ttr_s"]) if row["f_ttr_s"] is not None else -1.0


def _compared(rows: Sequence[Row], backends: Sequence[str]) -> str:
    cases: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        cases.setdefault((row["file"], row["reference"]), {})[row["backend"]] = row
    lines = []
    for other in backends:
        pairs = [c for c in cases.values() if "casadi" in c and other in c]
        if other == "casadi" or not pairs:
            continue
        lower = [c for c in pairs if _value(c["casadi"]) < _value(c[other]) - 1e-9]
        higher = sum(_value(c["casadi"]) > _value(c[other]) + 1e-9 for c in pairs)
        share = 100.0 * (1.0 - len(lower) / len(pairs))
        names = "; ".join(f"{c['casadi']['file']} ({c['casadi']['reference']})" for c in lower)
        lines.append(
            f"- `casadi` against `{other}`: F-TTR not below in {len(pairs) - len(lower)} of {len(pairs)} "
            f"cases ({share:.1f} %), above in {higher}." + (f" Below: {names}." if lower else "")
        )
    return "\n".join(lines) or "One backend only."


def _above(rows: Sequence[Row]) -> str:
    body = []
    for r in rows:
        if r["status"] == "found" and isinstance(r["ttr_s"], float) and r["f_ttr_s"] > r["ttr_s"] + 1e-9:
            harder = r["peak_deceleration_mps2"] is not None and r["peak_deceleration_mps2"] < -8.0
            sideways = r["maneuver"] in ("left", "right")
            why = "swerves" if sideways else "changes speed otherwise"
            if harder:
                why = "brakes and swerves" if sideways else "brakes harder than 8 m/s²"
            body.append((
                r["file"], r["reference"], r["backend"], r["f_ttr_s"], r["ttr_s"], r["maneuver"],
                round(r["peak_deceleration_mps2"], 2), why,
            ))  # fmt: skip
    if not body:
        return "None."
    head = ("file", "reference", "backend", "F-TTR [s]", "TTR [s]", "manoeuvre", "a_min [m/s²]", "how")
    return (
        "The TTR is that of fixed manoeuvres (full braking at 8 m/s², kick-down, steering); a repair may "
        "brake up to its own limits, or combine.\n\n" + _table(head, body)
    )


def _beyond_braking(rows: Sequence[Row]) -> str:
    found = [r for r in rows if r["status"] == "found" and r["ttb_s"] == "-inf"]
    if not found:
        return "None."
    head = ("file", "reference", "backend", "conflict", "TTC [s]", "TTR [s]", "F-TTR [s]", "manoeuvre")
    keys = ("ttc_s", "ttr_s", "f_ttr_s", "maneuver")
    return _table(
        head, [[r["file"], r["reference"], r["backend"], _kind(r), *(r[k] for k in keys)] for r in found]
    )


def _reasons(rows: Sequence[Row]) -> str:
    missed = [r for r in rows if r["status"] not in _REPAIRED]
    if not missed:
        return "Everything was repaired."
    keys = ("file", "reference", "backend", "status", "conflict", "ttc_s", "ttb_s", "detail")
    head = (*keys[:5], "TTC [s]", "TTB [s]", "what was tried, and what it failed on")
    body = [tuple(_kind(r) if k == "conflict" else r[k] for k in keys) for r in missed]
    return _table(head, body)


def _files(rows: Sequence[Row], backends: Sequence[str], reference: str) -> str:
    own: dict[str, dict[str, Row]] = {}
    for row in rows:
        if row["reference"] == reference:
            own.setdefault(row["file"], {})[row["backend"]] = row
    head = ["file", "conflict", "TTC [s]", "TTB [s]", "TTR [s]"]
    for backend in backends:
        head += [f"{backend} F-TTR [s]", "manoeuvre", "ms"]
    body = []
    for file, cases in own.items():
        first = next(iter(cases.values()))
        behind = ", from behind" if first["from_behind"] else ""
        cells: list[Any] = [file, f"{_kind(first)}{behind}"]
        cells += [first[k] for k in ("ttc_s", "ttb_s", "ttr_s")]
        for backend in backends:
            r = cases.get(backend)
            if r is None:
                cells += ["", "", ""]
                continue
            shown = r["f_ttr_s"] if r["status"] == "found" else r["status"]
            spent = None if r["search_time_s"] is None else round(1e3 * r["search_time_s"], 1)
            cells += [shown, r["maneuver"], spent]
        body.append(cells)
    return f"### Reference: {reference}\n\n" + _table(head, body)
