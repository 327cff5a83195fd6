"""What the policy ``graded`` gets of three wishes: ``python -m benchmarks.graded DIR ... [--figure FILE]``.

DIR is what ``repair simulate --out DIR`` wrote; nothing is driven here. Said is for each policy what it
avoids, how often it acts for nothing, and its median peak deceleration: over all files, and over two halves.
What settings are chosen on the one is to be seen on the other. Files of one place (what comes before the
first hyphen) are on one side; places are dealt out in the order of their names, each to the side with fewer
files. With --figure the front is drawn: a point for each folder and policy, with its median peak.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from repair.io.files import write_files
from repair.report.loop.table import groups_of, summary
from repair.simulate.many.run import drives_in
from repair.simulate.measures import SIMULATION
from repair.study.store import Store


def halves(files: Iterable[str]) -> tuple[set[str], set[str]]:
    """Two halves of about as many files, no place on both sides."""
    places: dict[str, list[str]] = defaultdict(list)
    for file in sorted(set(files)):
        places[file.split("-")[0]].append(file)
    one: set[str] = set()
    two: set[str] = set()
    for place in sorted(places):
        (one if len(one) <= len(two) else two).update(places[place])
    return one, two


def rows_in(folder: Path) -> list[dict[str, Any]]:
    with Store(folder, SIMULATION, readonly=True) as store:
        return list(drives_in(store))


def line(name: str, rows: Sequence[dict[str, Any]]) -> str:
    s = summary(rows)
    peak = "–" if s["median_peak_mps2"] is None else f"{s['median_peak_mps2']:.1f}"
    nothing = f"{s['for_nothing']} of {s['negatives']}"
    return f"| {name} | {s['avoided']} of {s['contacts']} | {nothing} | {peak} |"


def front(points: Sequence[tuple[str, str, dict[str, Any]]]) -> Any:
    """Avoided against acted for nothing; a label has the name and the median peak."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from repair.report.style import EGO, OBSTACLE, FigureStyle

    style = FigureStyle()
    with rc_context(style.rc):
        figure = Figure(figsize=(style.width, 0.62 * style.width), layout="constrained")
        axes = figure.add_subplot()
        for k, (folder, policy, s) in enumerate(points):
            ours = policy == "graded"
            axes.plot(
                s["for_nothing"], s["avoided"], marker="o" if ours else "s", color=EGO if ours else OBSTACLE
            )
            label = f"{folder if ours else policy}: {s['median_peak_mps2']:.1f}"
            place = (7, 3) if k % 2 else (7, -10)
            axes.annotate(
                label, (s["for_nothing"], s["avoided"]), place, textcoords="offset points", fontsize=8
            )
        axes.set(
            xlabel="acted for nothing", ylabel="contacts avoided",
            title="beside each point: median peak deceleration [m/s²]",
        )  # fmt: skip
        axes.margins(x=0.25, y=0.15)
    return figure


def main() -> None:
    asked = argparse.ArgumentParser(prog="python -m benchmarks.graded")
    asked.add_argument("folders", type=Path, nargs="+")
    asked.add_argument("--prediction", default="constant_velocity")
    asked.add_argument("--figure", type=Path)
    given = asked.parse_args()
    rows = {folder: rows_in(folder) for folder in given.folders}
    one, two = halves(row["file"] for own in rows.values() for row in own)
    found = {
        (folder.name, policy): own
        for folder, every in rows.items()
        for (prediction, policy), own in groups_of(every).items()
        if prediction == given.prediction and policy != "never"
    }
    print(
        "| folder, policy, files | avoided | for nothing | median peak [m/s²] |",
        "|---|---|---|---|",
        sep="\n",
    )
    for (folder, policy), own in found.items():
        for words, files in (("all", one | two), ("one half", one), ("the other half", two)):
            print(line(f"{folder}, {policy}, {words}", [row for row in own if row["file"] in files]))
    if given.figure is not None:
        from repair.report.style import render

        drawn = front([(folder, policy, summary(own)) for (folder, policy), own in found.items()])
        print(*write_files(given.figure.parent, {given.figure.name: render(drawn)}))


if __name__ == "__main__":
    main()
