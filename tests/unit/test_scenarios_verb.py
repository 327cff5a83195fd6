"""``repair scenarios``: what a folder holds, its conflicts among it, and no more lines than anybody reads."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from tests import roads

from repair.cli.command import main


def gaps(count: int) -> str:
    """A road of pieces, each 0.2 m beyond the end of the one before."""
    ends = np.linspace(-50.0, 400.0, count + 2)
    pieces = []
    for k, (a, b) in enumerate(pairwise(ends), start=1):
        centre = np.array([[x, 0.0] for x in np.linspace(a + 0.2 * (k > 1), b, 12)])
        after, before = [k + 1] if k <= count else [], [k - 1] if k > 1 else []
        pieces.append(roads.strip(k, centre, after=after, before=before))
    return "".join(pieces)


@pytest.fixture
def folder(tmp_path):
    """Return three files: a slower car ahead, one far away, and none that can be read."""
    files = {
        "a.xml": roads.scenario(obstacles=roads.SLOW),
        "b.xml": roads.scenario(obstacles=roads.driving(30, 300.0, 0.0, 15.0)),
        "c.xml": "<x/>",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_each_file_says_its_conflict_and_the_last_line_how_many_there_are(folder, capsys):
    assert main(["scenarios", str(folder), "--reference", "constant"]) == 0
    text = capsys.readouterr().out
    said = {block.splitlines()[0].split()[1]: block for block in text.split("\n\n")[:3]}
    assert "Conflict  margin of obstacle 30 at " in said["a.xml"]
    assert "Conflict  none on the reference constant, until " in said["b.xml"]
    assert "Error     " in said["c.xml"]
    assert text.splitlines()[-1].startswith("3 files, conflict on the reference constant: ")
    assert {"1 margin", "1 none", "1 not usable"} <= set(text.splitlines()[-1].split(": ")[1].split(", "))


def test_a_reference_that_cannot_be_made_is_said(folder, capsys):
    assert main(["scenarios", str(folder / "a.xml"), "--reference", "recorded"]) == 0
    assert "Conflict  not known: " in capsys.readouterr().out


def test_of_many_faults_the_largest_is_named(tmp_path, capsys):
    file = tmp_path / "gaps.xml"
    file.write_text(roads.scenario(road=gaps(6), obstacles=""), encoding="utf-8")
    assert main(["scenarios", str(file)]) == 0
    few = capsys.readouterr().out.partition("\nNote")[0]
    assert main(["scenarios", str(file), "--all"]) == 0
    each = capsys.readouterr().out.partition("\nNote")[0]
    assert few.count("leads over the gap") == 1
    assert "(the largest of 6 of this kind; --all names each)" in few
    assert each.count("leads over the gap") == 6
    assert "--all" not in each
