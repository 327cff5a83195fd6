"""The code blocks of the pages: which there are, and how they are run.

A block runs unless a comment right above it says otherwise: ``<!-- not run: why -->``, or ``<!-- slow -->``,
by which it is left to the exhaustive tests; so is a command with a CommonRoad file that is not bundled.
Blocks of one page run in its order, in one folder and one namespace.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))

_FENCE = re.compile(r"(?:^<!-- (?P<mark>.*?) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.M | re.S)
_ELSEWHERE = re.compile(r"^\$ .* [A-Z]{3}_[\w-]+", re.M)
_INDENTED = re.compile(r"(?<=\n\n)(?: {4}.*\n)+", re.M)
# Wall times differ from run to run: a row of probes ends with two, and a line is made of nothing else.
_TIMES = re.compile(r"(\s+\d+\.\d){2}$|^Time .*")


@dataclass(frozen=True)
class Block:
    """One fenced block of a page: where it stands, its language and text, and the mark above it."""

    page: Path
    line: int
    language: str
    text: str
    mark: str

    @property
    def how(self) -> str:
        """``run``, ``slow`` or ``not run``."""
        if self.mark.startswith("not run: "):
            return "not run"
        return "slow" if self.mark == "slow" or _ELSEWHERE.search(self.text) else "run"

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}"

    def commands(self) -> list[tuple[list[str], list[str]]]:
        """The commands of a console block, each with the lines that it is said to print."""
        found: list[tuple[list[str], list[str]]] = []
        for line in self.text.splitlines():
            if line.startswith("$ "):
                found.append((words(line[2:]), []))
            elif line.strip() and found:
                found[-1][1].append(masked(line))
        return found


def words(line: str) -> list[str]:
    """A command's words from `repair` on; without it if it begins with something else."""
    split = shlex.split(line, comments=True)
    return split[3:] if split[:3] == ["env", "-u", "COMMONROAD_SCENARIOS"] else split


def masked(line: str) -> str:
    """A line without what differs from run to run."""
    return _TIMES.sub("", line.rstrip())


def says(printed: str, line: str) -> bool:
    """Whether a printed line is the one that a page shows; a page may end it with three dots."""
    return printed.startswith(line[:-3].rstrip()) if line.endswith("...") else printed == line


def blocks(page: Path) -> list[Block]:
    """The Python and console blocks of a page."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            page,
            text.count("\n", 0, found.start("text")),
            found["language"],
            found["text"],
            found["mark"] or "",
        )
        for found in _FENCE.finditer(text)
        if found["language"] in ("python", "console")
    ]


def shell_lines(page: Path) -> Iterator[tuple[str, list[str]]]:
    """Every `repair ...` in a shell block, fenced or indented: the line and its words after `repair`."""
    text = page.read_text(encoding="utf-8")
    fenced = [found["text"] for found in _FENCE.finditer(text) if found["language"] == "bash"]
    for block in [*fenced, *_INDENTED.findall(text)]:
        for line in re.sub(r"\\\n\s*", "", block).splitlines():
            line = line.partition(" && ")[0]  # what follows is another program's
            split = words(line) if line.strip().startswith(("repair ", "env ")) else []
            if split and split[0] == "repair":
                yield line.strip(), split[1:]
