"""The picture of the rooms in docs/design.md: ``python docs/draw_rooms.py`` writes docs/images/rooms.png.

One row for each room, in the order of pyproject.toml; an arc from a room to each that it imports from, on the
right if it goes down, on the left if it goes up. On the left there is nothing.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import grimp
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]


def layers() -> list[list[str]]:
    """The rooms from the top down, those of one level together."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    listed = re.search(r"^layers = \[(.*?)^\]", text, re.MULTILINE | re.DOTALL)
    assert listed is not None
    return [level.split(" | ") for level in re.findall(r'"([^"]+)"', listed.group(1))]


def arrows() -> Counter[tuple[str, str]]:
    """How many imports lead from one room to another."""
    graph = grimp.build_graph("repair", cache_dir=None)
    found: Counter[tuple[str, str]] = Counter()
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            rooms = [name.split(".")[1] for name in (importer, imported) if "." in name]
            if len(rooms) == 2 and rooms[0] != rooms[1]:
                found[rooms[0], rooms[1]] += 1
    return found


def main() -> None:
    """Draw it."""
    rows = [room for level in layers() for room in level if room != "__main__"]
    level_of = {room: k for k, level in enumerate(layers()) for room in level}
    place = {room: -k for k, room in enumerate(rows)}
    counted = arrows()
    figure = Figure(figsize=(7.5, 8.6), layout="constrained")
    axes = figure.add_subplot()
    for k, room in enumerate(rows):
        if level_of[room] % 2:
            axes.axhspan(-k - 0.5, -k + 0.5, color="#F1F1F1", lw=0, zorder=0)
        axes.text(-0.15, -k, room, ha="right", va="center", fontsize=10, family="monospace")
        axes.plot(0.0, -k, "o", ms=4.5, color="#0072B2", zorder=3)
    for (importer, imported), count in counted.items():
        if importer not in place or imported not in place:
            continue
        start, end = place[importer], place[imported]
        height = abs(start - end)
        up = end > start
        axes.add_patch(
            Arc(
                (0.0, 0.5 * (start + end)), 0.55 * height, height, theta1=90 if up else -90,
                theta2=270 if up else 90, color="#D55E00" if up else "#0072B2",
                lw=0.4 + 0.35 * count**0.5, alpha=0.95 if up else 0.45,
            )
        )  # fmt: skip
    axes.set(xlim=(-3.2, 0.29 * len(rows)), ylim=(-len(rows) + 0.4, 0.6))
    axes.set_axis_off()
    down = sum(n for (a, b), n in counted.items() if a in place and b in place and place[b] < place[a])
    same = sum(n for (a, b), n in counted.items() if a in place and b in place and level_of[a] == level_of[b])
    up = sum(counted[a, b] for a, b in counted if a in place and b in place and level_of[b] < level_of[a])
    axes.set_title(
        f"{down} imports from room to room lead down, {up} up, {same} stay on their level", fontsize=10
    )
    target = ROOT / "docs" / "images" / "rooms.png"
    figure.savefig(target, dpi=110, metadata={"Software": None})
    with Image.open(target) as drawn:
        few = drawn.convert("RGB").quantize(48)  # a quarter of the size
    few.save(target, optimize=True)
    print(f"{len(rows)} rooms, {down} imports down, {up} up, {same} on the same level")


if __name__ == "__main__":
    main()
