"""What ``checker.terminal=require`` costs: ``python -m benchmarks.endings FOLDER [OUT.json]``.

Each file is repaired with ``report`` and with ``require``, nobody asked instead (``fallback`` empty). Said is
how many of the repairs that are found with the one are found with the other, how they end, and by how much
earlier the F-TTR is. ``OUT.json`` keeps the rows as they come; what it holds already is not repaired again.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

ASKED = ("report", "require")


def row(file: Path, backend: str, reference: str, asked: str, more: Sequence[str] = ()) -> dict:
    """F-TTR, ending and processor time of one repair."""
    import repair
    from repair.errors import RepairError

    begin = time.process_time()
    keys = [f"reference.source={reference}", f"checker.terminal={asked}", "fallback=[]", *more]
    said = {"file": file.name, "backend": backend, "reference": reference, "asked": asked}
    try:
        result = repair.repair(file, backend=backend, overrides=keys)
    except RepairError as error:
        return {**said, "status": "error", "detail": str(error)}
    probes = [
        f"{p.t_rep:g}:{'+' if p.feasible else '-'.join(('', *p.verdict.reasons))}"
        for p in result.search.probes
    ]
    terminal = result.terminal
    return {
        **said,
        "status": result.status.value,
        "f_ttr": result.f_ttr if np.isfinite(result.f_ttr or 0.0) else None,
        "ending": terminal.ending.value if terminal is not None else "",
        "why": "; ".join(v.detail for v in terminal.violations) if terminal is not None else "",
        "probes": " ".join(probes),
        "seconds": round(time.process_time() - begin, 2),
    }


def tell(rows: list[dict]) -> None:
    """The table, and every repair that is lost or later or earlier."""
    by = {(r["file"], r["backend"], r["reference"], r["asked"]): r for r in rows}
    print("| backend | `checker.terminal` | repaired | safe | safe unless extended | unsafe | processor |")
    print("|---|---|---|---|---|---|---|")
    for backend in dict.fromkeys(r["backend"] for r in rows):
        for asked in ASKED:
            own = [r for r in rows if (r["backend"], r["asked"]) == (backend, asked)]
            found = [r for r in own if r["status"] == "found"]
            ends = Counter(r["ending"] for r in found)
            numbers = [len(found), *(ends[key] for key in ("safe", "safe_unless_extended", "unsafe"))]
            spent = sum(r.get("seconds", 0.0) for r in own)
            print(f"| `{backend}` | `{asked}` | {' | '.join(map(str, numbers))} | {spent:.0f} s |")
        pairs = [
            (by[(*key, "report")], by[(*key, "require")])
            for key in dict.fromkeys((r["file"], r["backend"], r["reference"]) for r in rows)
            if key[1] == backend and all((*key, asked) in by for asked in ASKED)
        ]
        both = [p for p in pairs if all(r["status"] == "found" for r in p)]
        lost = [p for p in pairs if p[0]["status"] == "found" and p[1]["status"] != "found"]
        cost = np.array([a["f_ttr"] - b["f_ttr"] for a, b in both])
        if both:
            later = int((cost < -1e-9).sum())
            print(
                f"{backend}: {len(both)} of {len(both) + len(lost)} still found; F-TTR earlier by "
                f"{np.median(cost):.2f} s in the median, {cost.max():.2f} s at worst, the same in "
                f"{int((np.abs(cost) < 1e-9).sum())}, later in {later}"
            )
        changed = [p for p in both if abs(p[0]["f_ttr"] - p[1]["f_ttr"]) > 1e-9]
        for a, b in lost + changed + [p for p in both if p[0]["ending"] == "unsafe" and p not in changed]:
            to = f"{b['f_ttr']:.1f} s" if b["status"] == "found" else f"{b['status']} ({b['probes']})"
            print(f"  {a['file']}, {a['reference']}: {a['f_ttr']:.1f} s, {a['ending']} ({a['why']}) -> {to}")


def main() -> int:
    """Repair, and print what there is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("out", type=Path, nargs="?")
    parser.add_argument("--backend", nargs="+", default=["casadi"])
    parser.add_argument("--reference", nargs="+", default=["constant", "planner"])
    parser.add_argument("--asked", nargs="+", default=ASKED, choices=ASKED)
    parser.add_argument("--set", nargs="+", default=[], help="further keys")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    kept = given.out is not None and given.out.exists()
    rows: list[dict] = json.loads(given.out.read_text(encoding="utf-8")) if kept else []
    done = {(r["file"], r["backend"], r["reference"], r["asked"]) for r in rows}
    for file in sorted(given.folder.glob("*.xml")):
        for backend in given.backend:
            for reference in given.reference:
                for asked in given.asked:
                    if (file.name, backend, reference, asked) not in done:
                        rows.append(row(file, backend, reference, asked, given.set))
                        if given.out is not None:
                            given.out.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    tell(rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
