"""Plain-text tables: aligned, with units."""

from __future__ import annotations

from typing import Any

from benchmarks.measure import Report, Row, Spread


def number(x: float) -> str:
    """Three significant digits without an exponent."""
    size = abs(x)
    return (
        f"{x:.0f}" if size >= 100 else f"{x:.1f}" if size >= 10 else f"{x:.2f}" if size >= 0.1 else f"{x:.3f}"
    )


def _range(spread: Spread) -> str:
    return f"{number(spread.q1)}-{number(spread.q3)}" if spread.count > 1 else ""


def _line(r: Row) -> list[str]:
    extremes = f"{number(r.cpu.low)}-{number(r.cpu.high)}" if r.cpu.count > 1 else ""
    wall = number(r.wall.median) if r.wall else ""
    ratio = f"{number(r.ratio.median)} x" if r.ratio else ""
    spread = _range(r.ratio) if r.ratio else ""
    return [
        r.name,
        number(r.cpu.median),
        r.unit,
        _range(r.cpu),
        extremes,
        wall,
        ratio,
        spread,
        r.against,
        r.note,
    ]


HEAD = ["", "median", "", "IQR", "min-max", "wall", "ratio", "IQR", "against", ""]
LEFT = {0, 2, 8, 9}


def aligned(lines: list[list[str]]) -> list[str]:
    """Columns of equal width; empty columns are left out."""
    used = [k for k in range(len(lines[0])) if any(line[k] for line in lines[1:])]
    width = {k: max(len(line[k]) for line in lines) for k in used}
    return [
        "  ".join(line[k].ljust(width[k]) if k in LEFT else line[k].rjust(width[k]) for k in used).rstrip()
        for line in lines
    ]


def print_report(report: Report, machine: dict[str, Any]) -> None:
    """All groups, then what was asked for and whether it holds."""
    loads = [
        "/".join(f"{x:.1f}" for x in machine.get(k) or ()) for k in ("load_average", "load_average_after")
    ]
    print(f"{machine['processor']}, {machine['cores']} core(s), load {loads[0]} before, {loads[1]} after")
    print(f"Python {machine['python']}, " + ", ".join(f"{k} {v}" for k, v in machine["versions"].items()))
    print("BLAS: " + "; ".join(machine["blas"]))
    print(f"CPU time of one thread, medians; ratio: how many times less CPU time than what stands beside it; "
          f"{machine['duration_s']:.0f} s in all")  # fmt: skip
    groups = dict.fromkeys(r.group for r in report.rows)
    for group in groups:
        print(f"\n{group}")
        lines = aligned([HEAD, *(_line(r) for r in report.rows if r.group == group)])
        print("\n".join("  " + line for line in lines))
    for title, entries in (("remarks", report.remarks),):
        if entries:
            print(f"\n{title}")
            print("\n".join(f"  {entry}" for entry in entries))
    if report.targets:
        print("\ntargets")
        lines = [["", "wanted", "measured", "holds"]]
        lines += [[t.name, t.wanted, t.measured, "yes" if t.holds else "NO"] for t in report.targets]
        width = [max(len(line[k]) for line in lines) for k in range(4)]
        for line in lines:
            print("  " + "  ".join(x.ljust(w) for x, w in zip(line, width, strict=True)).rstrip())
