"""What the page of a study shows of all rows: tables and figures, as plain data."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

__all__ = ["figures_of", "name_of", "performance_profile", "summary_of", "verdict"]

Row = Mapping[str, Any]
_BROKEN = ("crash", "timeout", "memory", "input_error")
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999999")
_LONGEST = 100.0  # ratio of times to which a profile is drawn


def name_of(row: Row) -> str:
    """Backend and variation, as the page names them."""
    return f"{row['backend']}, {row['variation']}" if row.get("variation") else str(row["backend"])


def _groups(rows: Sequence[Row]) -> dict[str, list[Row]]:
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(name_of(row), []).append(row)
    return found


def verdict(rows: Sequence[Row]) -> str:
    """The whole study in a sentence; of one result, what is said below is not said twice."""
    if len(rows) == 1:
        return f"One result: {rows[0]['status']}."
    status = Counter(row["status"] for row in rows)
    broken = sum(status[word] for word in _BROKEN)
    rest = len(rows) - status["found"] - status["no_conflict"] - broken
    scenarios = len({row["file"] for row in rows})
    text = (
        f"{len(rows)} rows of {scenarios} scenarios: {status['found']} repaired, {status['no_conflict']} "
        f"without a conflict, {rest} without a repair, {broken} that could not be run."
    )
    judged = [row for row in rows if row.get("official_feasible") is not None]
    if judged:
        keys = ("official_feasible", "official_collision_free", "official_on_road")
        bad = sum(not all(row[key] for key in keys) for row in judged)
        text += f" CommonRoad's own checker rejected {bad} of {len(judged)} trajectories."
    else:
        text += " CommonRoad's own checker was not asked."
    certified = [row for row in rows if row.get("certificate")]
    if certified:
        bad = sum(row["certificate"] != "ok" for row in certified)
        text += f" {bad} of {len(certified)} certificates have a violated margin."
    return text


def summary_of(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Head and body of the table by backend and variation."""
    head = [
        "backend", "rows", "no conflict", "repaired", "by a fallback", "no repair", "not run",
        "median F-TTR [s]", "median search [ms]", "rejected by CommonRoad's checker",
    ]  # fmt: skip
    body = []
    for name, own in _groups(rows).items():
        status = Counter(row["status"] for row in own)
        broken = sum(status[word] for word in _BROKEN)
        times = [1e3 * row["search_time_s"] for row in own if row["search_time_s"] and row["probes"]]
        reached = [row["f_ttr_s"] for row in own if row["status"] == "found"]
        judged = [row for row in own if row.get("official_feasible") is not None]
        keys = ("official_feasible", "official_collision_free", "official_on_road")
        bad = sum(not all(row[key] for key in keys) for row in judged)
        numbers = (
            len(own), status["no_conflict"], status["found"],
            sum(bool(row.get("by_fallback")) for row in own if row["status"] == "found"),
            len(own) - status["no_conflict"] - status["found"] - broken, broken,
        )  # fmt: skip
        body.append([
            name, *map(str, numbers), f"{median(reached):.2f}" if reached else "",
            f"{median(times):.1f}" if times else "", f"{bad} of {len(judged)}" if judged else "not asked",
        ])  # fmt: skip
    return head, body


def figures_of(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Figures for Plotly: an id, a title, traces and a layout each."""
    groups = _groups(rows)
    colours = {name: _COLOURS[k % len(_COLOURS)] for k, name in enumerate(groups)}
    made = [_distribution(groups, colours), _profile(rows, colours)]
    if len(groups) > 1:
        made.append(_agreement(groups))
    made += [
        _against(groups, colours, "ttc_s", "TTC"),
        _against(groups, colours, "ttr_s", "TTR"),
        _failures(groups, colours),
    ]
    return [figure for figure in made if figure["data"]]


def _distribution(groups: Mapping[str, Sequence[Row]], colours: Mapping[str, str]) -> dict[str, Any]:
    data = [
        {"type": "box", "name": name, "y": reached, "boxpoints": "all", "jitter": 0.4, "pointpos": 0,
         "marker": {"color": colours[name], "size": 3}}
        for name, own in groups.items()
        if (reached := [row["f_ttr_s"] for row in own if row["status"] == "found"])
    ]  # fmt: skip
    layout = {"yaxis": {"title": {"text": "F-TTR [s]"}}, "xaxis": {"automargin": True}, "showlegend": False}
    return {"id": "distribution", "title": "F-TTR of what was repaired", "data": data, "layout": layout}


def performance_profile(rows: Sequence[Row]) -> dict[str, tuple[list[float], list[float]]]:
    """Share of cases (0 to 1) that are solved within a factor of the fastest search, by backend.

    Dolan and Moré, *Benchmarking optimization software with performance profiles*, Mathematical Programming
    91, 2002. A case is a scenario with a reference in which somebody finds a repair; who finds none never
    solves it, whatever the time.
    """
    cases: dict[tuple[str, str], dict[str, float]] = {}
    names = dict.fromkeys(name_of(row) for row in rows)
    for row in rows:
        if row["status"] == "found" and row["search_time_s"] and not row.get("by_fallback"):
            cases.setdefault((row["file"], row["reference"]), {})[name_of(row)] = row["search_time_s"]
    ratios: dict[str, list[float]] = {name: [] for name in names}
    for times in cases.values():
        fastest = min(times.values())
        for name, spent in times.items():
            ratios[name].append(spent / fastest)
    profile = {}
    for name, found in ratios.items():
        found.sort()
        steps = [(ratio, (k + 1) / len(cases)) for k, ratio in enumerate(found)]
        kept = [
            (1.0, 0.0),
            *steps,
            (max(_LONGEST, found[-1] if found else 0.0), len(found) / max(len(cases), 1)),
        ]
        profile[name] = [x for x, _ in kept], [y for _, y in kept]
    return profile if cases else {}


def _profile(rows: Sequence[Row], colours: Mapping[str, str]) -> dict[str, Any]:
    data = [
        {"type": "scatter", "mode": "lines", "name": name, "x": x, "y": [100.0 * share for share in y],
         "line": {"shape": "hv", "color": colours[name]}}
        for name, (x, y) in performance_profile(rows).items()
    ]  # fmt: skip
    layout = {
        "xaxis": {"type": "log", "title": {"text": "search time, as a multiple of the fastest"}},
        "yaxis": {"title": {"text": "cases solved by itself [%]"}, "range": [0, 101]},
    }
    return {"id": "profile", "title": "Performance profile (Dolan and Moré)", "data": data, "layout": layout}


def _answer(row: Row) -> Any:
    return round(row["f_ttr_s"], 6) if row["status"] == "found" else row["status"]


def _agreement(groups: Mapping[str, Sequence[Row]]) -> dict[str, Any]:
    """How often two give the same answer, and who is later where they do not."""
    answers = {name: {(row["file"], row["reference"]): row for row in own} for name, own in groups.items()}
    shares, words = [], []
    for mine in answers.values():
        line, said = [], []
        for theirs in answers.values():
            both = mine.keys() & theirs.keys()
            same = sum(_answer(mine[case]) == _answer(theirs[case]) for case in both)
            later = sum(_rank(mine[case]) > _rank(theirs[case]) for case in both)
            line.append(round(100.0 * same / len(both), 1) if both else None)
            said.append(f"{same} of {len(both)} alike; the row's later in {later}")
        shares.append(line)
        words.append(said)
    names = list(answers)
    data = [{
        "type": "heatmap", "x": names, "y": names, "z": shares, "text": words, "zmin": 0, "zmax": 100,
        "colorscale": "Blues", "reversescale": True, "texttemplate": "%{z:.0f}",
        "hovertemplate": "%{y} against %{x}: %{text}<extra></extra>",
        "colorbar": {"title": {"text": "%"}},
    }]  # fmt: skip
    layout = {"yaxis": {"autorange": "reversed", "automargin": True}, "xaxis": {"automargin": True}}
    return {"id": "agreement", "title": "Agreement: the same answer [%]", "data": data, "layout": layout}


def _rank(row: Row) -> float:
    if row["status"] == "no_conflict":
        return float("inf")
    return float(row["f_ttr_s"]) if row["status"] == "found" else -1.0


def _against(
    groups: Mapping[str, Sequence[Row]], colours: Mapping[str, str], key: str, word: str
) -> dict[str, Any]:
    data: list[dict[str, Any]] = []
    largest = 0.0
    for name, own in groups.items():
        pairs = [row for row in own if row["status"] == "found" and row[key] is not None]
        if pairs:
            largest = max(largest, *(max(row[key], row["f_ttr_s"]) for row in pairs))
            data.append({
                "type": "scatter", "mode": "markers", "name": name, "x": [row[key] for row in pairs],
                "y": [row["f_ttr_s"] for row in pairs],
                "text": [f"{row['file']}, {row['reference']}" for row in pairs],
                "marker": {"color": colours[name], "size": 6, "opacity": 0.7},
            })  # fmt: skip
    if data:
        data.append({"type": "scatter", "mode": "lines", "name": "equal", "x": [0, largest],
                     "y": [0, largest], "line": {"color": "#999999", "dash": "dot", "width": 1}})  # fmt: skip
    layout = {"xaxis": {"title": {"text": f"{word} [s]"}}, "yaxis": {"title": {"text": "F-TTR [s]"}}}
    return {"id": f"against-{key}", "title": f"F-TTR against {word}", "data": data, "layout": layout}


def _failures(groups: Mapping[str, Sequence[Row]], colours: Mapping[str, str]) -> dict[str, Any]:
    """Why there is no repair: what the first probe failed on, or what kept a row from being run."""
    data = []
    for name, own in groups.items():
        counted: Counter[str] = Counter()
        for row in own:
            if row["status"] in ("found", "no_conflict"):
                continue
            first = (row["probes"] or "").split(" ")[0].partition(":")[2].strip("-")
            counted.update([row["status"]] if row["status"] in _BROKEN or not first else first.split("-"))
        if counted:
            data.append({"type": "bar", "name": name, "x": list(counted), "y": list(counted.values()),
                         "marker": {"color": colours[name]}})  # fmt: skip
    layout = {"barmode": "group", "xaxis": {"automargin": True}, "yaxis": {"title": {"text": "rows"}}}
    return {"id": "failures", "title": "Not repaired, and why", "data": data, "layout": layout}
