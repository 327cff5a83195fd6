"""Every link of the pages: what is ours is there, down to the heading, and what is elsewhere is an address.

The site's own build asks the same of what it shows (a target that is missing is a warning, which ends it).
README, CONTRIBUTING and the findings are not among it, and are read on their own.
"""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from tests.docs.pages import PAGES, ROOT

FILES = (*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", ROOT / "findings" / "README.md")

_FENCED = re.compile(r"^(```|~~~).*?^\1", re.M | re.S)
_CODE = re.compile(r"`[^`\n]+`")
_LINK = re.compile(r"\]\(\s*<?([^)\s>]+)>?\s*\)|^\[[^]]+\]:\s+(\S+)", re.M)
_BARE = re.compile(r"(?<![(\w])https?://[^\s)>\]`\"']+")


def text_of(file: Path) -> str:
    """A page without its code."""
    return _FENCED.sub("", file.read_text(encoding="utf-8"))


def links(file: Path) -> list[str]:
    text = _CODE.sub("", text_of(file))
    return [a or b for a, b in _LINK.findall(text)] + _BARE.findall(text)


def anchors(file: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and the site make them."""
    headings = re.findall(r"^#{1,6} +(.+?) *#*$", text_of(file), re.M)
    return {
        re.sub(r"[^\w\- ]", "", heading.replace("`", "").lower()).replace(" ", "-") for heading in headings
    }


def wrong(file: Path, link: str) -> str:
    """What is wrong with a link; empty for nothing."""
    split = urlsplit(link)
    if split.scheme or link.startswith("//"):
        fine = (
            split.scheme == "https"
            and re.fullmatch(r"([a-z\d-]+\.)+[a-z]{2,}", split.netloc)
            and not split.query
        )
        return "" if fine else "no address"
    target = (file.parent / split.path).resolve() if split.path else file
    if not target.exists():
        return "no such file"
    if ROOT not in (target, *target.parents):
        return "outside of the project"
    if split.fragment and target.suffix == ".md" and split.fragment not in anchors(target):
        return "no such heading"
    return ""


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.relative_to(ROOT).as_posix())
def test_a_link_leads_somewhere(file):
    assert {link: why for link in links(file) if (why := wrong(file, link))} == {}


@pytest.mark.parametrize(
    "link, why",
    [
        ("nothing.md", "no such file"),
        ("docs/usage.md#no-such-heading", "no such heading"),
        ("docs/usage.md#repair-certify", ""),
        ("../elsewhere.md", "no such file"),
        ("http://example.org/x", "no address"),
        ("https://example/x", "no address"),
        ("https://arxiv.org/abs/2408.10622", ""),
    ],
)
def test_what_is_wrong_with_a_link_is_seen(link, why):
    assert wrong(ROOT / "README.md", link) == why
