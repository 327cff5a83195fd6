"""What a run over many files comes to, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from tests.corpus.moving import CHANGES
from tests.corpus.records import Deviation, Examined

__all__ = ["AGREEMENT", "INVARIANCE", "report", "violated"]

AGREEMENT = 3.0  # of the searches, so many may find nothing where another backend's repair is verified [%]
INVARIANCE = 1.0  # of the searches done again moved, turned or mirrored, so many may end otherwise [%]
_WORDS = (
    "found", "no_conflict", "none_feasible", "already_colliding", "budget_exhausted", "refused", "traceback",
)  # fmt: skip


def _table(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.ljust(w) if k < 2 else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    return "\n".join(line.rstrip() for line in lines)


def _answers(examined: Iterable[Examined]) -> str:
    """How the searches ended, by backend and reference."""
    count: dict[tuple[str, str], Counter[str]] = {}
    for one in examined:
        for row in one.rows:
            own = count.setdefault((row.reference, row.backend), Counter())
            own[row.status] += 1
            own["verified"] += row.verified
    words = [w for w in _WORDS if w in _WORDS[:4] or any(c[w] for c in count.values())]
    rows = [["reference", "backend", *words, "verified"]]
    for (reference, backend), own in count.items():
        rows.append([reference, backend, *(str(own[w]) for w in (*words, "verified"))])
    return _table(rows)


def _shares(examined: Sequence[Examined]) -> dict[str, tuple[int, int, float, float]]:
    """What may happen in few searches only: how often, of how many, share and limit [%]."""
    searches = sum(row.status != "refused" for one in examined for row in one.rows)
    again = sum(one.counts["compared after a change"] for one in examined)
    kinds = Counter(d.kind for one in examined for d in one.deviations if d.told)
    counted = {
        "agreement": (kinds["agreement"], searches, AGREEMENT),
        "invariance": (sum(kinds[name] for name in CHANGES), again, INVARIANCE),
    }
    return {name: (n, of, 100.0 * n / max(of, 1), most) for name, (n, of, most) in counted.items()}


def violated(examined: Sequence[Examined]) -> list[str]:
    """The kinds of what is not as it has to be."""
    kinds = {d.kind for one in examined for d in one.deviations if not d.told}
    kinds |= {name for name, (_, _, share, most) in _shares(examined).items() if share > most}
    return sorted(kinds)


def report(examined: Sequence[Examined]) -> str:
    """The table, what was looked at how often, the shares, and every deviation."""
    counts: Counter[str] = sum((one.counts for one in examined), Counter())
    told = Counter(d.backend for one in examined for d in one.deviations if d.kind == "agreement")
    refused = [one for one in examined if one.refused]
    n, of, share, most = _shares(examined)["agreement"]
    m, again, off, limit = _shares(examined)["invariance"]
    by = ", ".join(f"{backend} {count}" for backend, count in sorted(told.items())) or "none"
    instead = {k: n for k, n in sorted(counts.items()) if k.startswith("by a fallback")}
    lines = [
        _answers(examined),
        "",
        f"Files        {len(examined)}, of which {len(refused)} refused",
        f"Looked at    {counts['contact times']} contact times of references, {counts['road verdicts']} "
        f"verdicts about the road, {counts['official checks']} solution files by CommonRoad's checks",
        f"Agreement    {n} of {of} searches ({share:.1f} %, at most {most:g} %) find nothing where another "
        f"backend's repair is verified ({by}; for {counts['repairable']} one is, "
        f"{sum(instead.values())} of these {', '.join(f'{k}: {n}' for k, n in instead.items()) or '-'})",
        f"Invariance   {m} of {again} searches ({off:.1f} %, at most {limit:g} %) end otherwise when moved, "
        "turned or mirrored"
        + "".join(f"; {counts[f'not {c}']} files not {c}" for c in CHANGES if counts[f"not {c}"]),
    ]
    lines += [f"Refused      {one.refused}" for one in refused]
    deviations = [d for one in examined for d in one.deviations]
    for listed, kind in sorted(
        {(all(e.told for e in deviations if e.kind == d.kind), d.kind) for d in deviations}
    ):
        own = [d for d in deviations if d.kind == kind]
        lines += ["", f"{kind}: {len(own)}" + " (listed)" * listed]
        lines += [f"  {_named(d)}: {d.reason}" for d in own]
    bad = violated(examined)
    lines += ["", f"Violated: {', '.join(bad)}" if bad else "Nothing is violated"]
    return "\n".join(lines)


def _named(deviation: Deviation) -> str:
    return ", ".join(filter(None, (deviation.file, deviation.backend, deviation.reference)))
