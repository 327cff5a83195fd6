"""What is released: one version wherever it stands, and an sdist that the tests pass in."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: What tools and users leave in a checkout.
LEFT = {"build", "dist", "out", "results", "htmlcov"}


def listed(table: str, key: str) -> list[str]:
    """The strings of a list in pyproject.toml (no parser of TOML is in Python 3.10)."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    section = text.partition(f"[{table}]")[2].partition("\n[")[0]
    found = re.search(rf"^{key} = \[(.*?)\]", section, re.M | re.S)
    assert found is not None
    return re.findall(r'"([^"]+)"', found.group(1))


def test_the_sdist_has_every_folder_of_the_checkout():
    """Tests read docs, benchmarks and findings; an sdist without them is one in which they fail."""
    folders = {p.name for p in ROOT.iterdir() if p.is_dir() and not p.name.startswith((".", "_"))} - LEFT
    assert {name.lstrip("/") for name in listed("tool.hatch.build.targets.sdist", "include")} >= folders
    assert {"src", "tests", "docs", "benchmarks"} <= folders


def test_what_the_sdist_names_is_there():
    for name in listed("tool.hatch.build.targets.sdist", "include"):
        assert (ROOT / name.lstrip("/")).exists(), name


@pytest.mark.parametrize(
    "file, pattern",
    [
        ("CITATION.cff", r"^version: (\S+)"),
        ("CHANGELOG.md", r"^## \[(\d\S*)\] - \d{4}-\d{2}-\d{2}$"),
    ],
)
def test_one_version(file, pattern):
    version = re.search(r'^version = "(.+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.M)
    said = re.search(pattern, (ROOT / file).read_text(encoding="utf-8"), re.M)
    assert version is not None
    assert said is not None
    assert said.group(1).strip('"') == version.group(1)
