"""The table of a simulation: how often each policy acts, how often for nothing, and what it avoids."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from statistics import median
from typing import Any

import numpy as np

__all__ = ["HARD", "cycles_of", "groups_of", "interval", "summary", "table_of"]

Row = Mapping[str, Any]
Count = Callable[[Sequence[Row]], int]
HARD = 4.0  # a deceleration from here on is a hard one [m/s²]
_DRAWS = 2000
_OF_WHO_ACTS = "peak_jerk_mps3", "peak_lateral_acceleration_mps2", "deviation_ms"
_HEAD = (
    "prediction", "policy", "drives", "avoided", "struck (not from behind)", "acted", "for nothing, contact",
    "for nothing, margin", "hard for nothing", "precision", "median peak [m/s²]", "ahead [s]",
)  # fmt: skip


def groups_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """Rows that were driven, by prediction and policy, in the order in which they come."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row["status"] == "driven":
            found.setdefault((row["prediction"], row["policy"]), []).append(row)
    return found


def interval(rows: Sequence[Row], count: Count, against: Count | None = None) -> tuple[float, float]:
    """95 % interval of a count, or of its ratio to another one, by bootstrap over files.

    Drives of one file are near-duplicates. Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993,
    ch. 13 (percentiles), with fixed draws.

    Parameters
    ----------
    rows : sequence of mapping
    count, against : callable
        How often something is so in rows: the counts of files add up.
    """
    files: dict[str, list[Row]] = {}
    for row in rows:
        files.setdefault(row["file"], []).append(row)
    own = [files[name] for name in sorted(files)]
    chosen = np.random.default_rng(0).integers(0, len(own), (_DRAWS, len(own)))
    drawn = np.array([count(each) for each in own], dtype=np.float64)[chosen].sum(axis=1)
    if against is not None:
        others = np.array([against(each) for each in own], dtype=np.float64)[chosen].sum(axis=1)
        drawn = drawn[others > 0.0] / others[others > 0.0]
    if not len(drawn):
        return float("nan"), float("nan")
    low, high = np.percentile(drawn, (2.5, 97.5))
    return float(low), float(high)


def _for_nothing(rows: Sequence[Row], policy: str | None = None) -> int:
    """How many act though the plan touches nobody; by one policy, or all."""
    return sum(
        row["plan_contact_s"] is None and bool(row["interventions"])
        for row in rows
        if policy in (None, row["policy"])
    )


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """The measures of one prediction and policy.

    Returns
    -------
    dict
        Counts; ``negatives``: drives whose plan touches nobody, and ``free`` those whose plan does not enter
        a margin either. ``*_of`` are denominators.
    """
    hit = [row for row in rows if row["plan_contact_s"] is not None]
    negatives = [row for row in rows if row["plan_contact_s"] is None]
    free = [row for row in rows if not row["plan_margin"]]
    acted = [row for row in rows if row["interventions"]]
    nothing = [row for row in negatives if row["interventions"]]
    ahead = [
        row["plan_contact_s"] - row["first_intervention_s"]
        for row in acted
        if row["plan_contact_s"] is not None
    ]
    struck = [row for row in rows if row["contact_s"] is not None]
    return {
        "drives": len(rows),
        "contacts": len(hit),
        "contacts_not_from_behind": sum(not row["plan_contact_from_behind"] for row in hit),
        "avoided": sum(row["contact_s"] is None for row in hit),
        "struck": len(struck),
        "struck_not_from_behind": sum(not row["contact_from_behind"] for row in struck),
        "within_verified": sum(bool(row["within_verified"]) for row in rows),
        "acted": len(acted),
        "negatives": len(negatives),
        "for_nothing": len(nothing),
        "free": len(free),
        "for_nothing_margin": sum(bool(row["interventions"]) for row in free),
        "hard_for_nothing": sum(row["peak_deceleration_mps2"] >= HARD for row in nothing),
        "precision": 1.0 - len(nothing) / len(acted) if acted else None,
        "median_peak_mps2": median(row["peak_deceleration_mps2"] for row in acted) if acted else None,
        "median_ahead_s": median(ahead) if ahead else None,
        "median_impact_mps": median(row["impact_speed_mps"] for row in struck) if struck else None,
        **{f"median_{name}": _median(acted, name) for name in _OF_WHO_ACTS},
        **{name: sum(row[name] for row in rows) for name in ("pairs", "jumps", "dissolved", "lost")},
    }


def _median(rows: Sequence[Row], name: str) -> float | None:
    return median(row[name] for row in rows) if rows else None


def cycles_of(rows: Sequence[Row]) -> dict[str, float]:
    """Processor times of all cycles, and from one to the next at least and at most [ms]."""
    spent = [cycle["ms"] for row in rows for cycle in row["drive"]["cycles"]]
    if not spent:
        return {}
    found = np.percentile(spent, (50, 95, 99, 99.9))
    times = {name: float(v) for name, v in zip(("p50", "p95", "p99", "p99.9"), found, strict=True)}
    begins = ([cycle["t"] for cycle in row["drive"]["cycles"]] for row in rows)
    periods = [round(1e3 * (two - one), 3) for t in begins for one, two in pairwise(t)]
    return {**times, "period_min": min(periods), "period_max": max(periods)} if periods else times


def _of_period(times: Mapping[str, float]) -> str:
    if "period_max" not in times:
        return ""
    low, high = times["period_min"], times["period_max"]
    return f", a period of {low:g} ms" if low == high else f", periods of {low:g} to {high:g} ms"


def table_of(rows: Sequence[Row]) -> str:
    """The table in Markdown, cycle times and the F-TTR's flicker under it."""
    groups = groups_of(rows)
    left_out = [row for row in rows if row["status"] != "driven"]
    cases = {(row["file"], row["reference"], row["shift_s"]) for row in rows if row["status"] == "driven"}
    lines = [
        f"{len(cases)} cases of {len({c[0] for c in cases})} files, "
        f"{len({(r['file'], r['reference'], r['shift_s']) for r in left_out})} left out",
        "", f"| {' | '.join(_HEAD)} |", f"|{'---|' * len(_HEAD)}",
    ]  # fmt: skip
    for (prediction, policy), own in groups.items():
        lines.append(_line(prediction, policy, own))
    lines += ["", *(_below(*name, own) for name, own in groups.items()), *_against(groups)]
    return "\n".join([*lines, *_why_not(left_out)])


def _why_not(left_out: Sequence[Row], most: int = 8) -> list[str]:
    """Why drives were left out: each reason with its number, the most frequent first."""
    if not left_out:
        return []
    counted = Counter(f"{row['status']}: {row.get('detail') or 'without a word'}" for row in left_out)
    lines = [f"left out, {number} drives, {why}" for why, number in counted.most_common(most)]
    rest = len(counted) - len(lines)
    return ["", *lines, *([f"left out for {rest} more reasons"] if rest else [])]


def _line(prediction: str, policy: str, own: Sequence[Row]) -> str:
    s = summary(own)
    low, high = interval(own, _for_nothing)
    cells = (
        prediction, policy, s["drives"], f"{s['avoided']} of {s['contacts']}",
        f"{s['struck']} ({s['struck_not_from_behind']})", s["acted"],
        f"{s['for_nothing']} of {s['negatives']} [{low:.0f}, {high:.0f}]",
        f"{s['for_nothing_margin']} of {s['free']}", s["hard_for_nothing"],
        _shown(s["precision"], 2), _shown(s["median_peak_mps2"], 1), _shown(s["median_ahead_s"], 1),
    )  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"


def _shown(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _below(prediction: str, policy: str, own: Sequence[Row]) -> str:
    s, times = summary(own), cycles_of(own)
    words = [
        f"{name} {value:.1f}" for name, value in times.items() if name.startswith("p") and name[1].isdigit()
    ]
    text = f"{prediction}, {policy}: cycles {', '.join(words)} ms of processor time{_of_period(times)}"
    if s["pairs"]:
        text += (
            f"; of {s['pairs']} pairs of cycles the F-TTR jumps in {s['jumps']}, is lost before it is due in "
            f"{s['lost']}, and the conflict dissolves in {s['dissolved']}"
        )
    if s["within_verified"]:
        count = s["within_verified"]
        text += f"; {count} contact{'s' if count > 1 else ''} within what was verified"
    if s["acted"]:
        jerk, aside, off = (s[f"median_{name}"] for name in _OF_WHO_ACTS)
        text += f"; who acts, in the median: jerk {jerk:.0f} m/s³, {aside:.1f} m/s² aside, {off:.1f} m s "
        text += "off the plan"
    if s["struck"]:
        text += f"; struck with {s['median_impact_mps']:.1f} m/s in the median"
    return text


def _against(groups: Mapping[tuple[str, str], Sequence[Row]]) -> list[str]:
    """Each policy's interventions for nothing as a share of those of at_once, with its interval."""
    lines = []
    for (prediction, policy), own in groups.items():
        others = groups.get((prediction, "at_once"))
        if policy in ("at_once", "never") or others is None:
            continue
        if not (theirs := _for_nothing(others)):
            continue
        counts = (partial(_for_nothing, policy=name) for name in (policy, "at_once"))
        low, high = interval([*own, *others], *counts)
        share = _for_nothing(own) / theirs
        words = f"{prediction}: {policy} acts for nothing {share:.2f} [{low:.2f}, {high:.2f}] times as often"
        lines.append(f"{words} as at_once")
    return ["", *lines] if lines else []
