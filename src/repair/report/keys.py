"""Every configuration key, and the presets, for people."""

from __future__ import annotations

from itertools import takewhile
from typing import Any

from repair.config.load import preset_path
from repair.config.schema import configuration_keys, words_of
from repair.settings import Key

__all__ = ["key_table", "preset_summary"]


def key_table() -> str:
    """Every configuration key with default, choices or range, and meaning, as a Markdown table."""
    lines = ["| key | default | possible | meaning |", "|---|---|---|---|"]
    for key in configuration_keys():
        meaning = key.setting.says.replace("|", "\\|")
        lines.append(f"| `{key.name}` | `{_shown(key.default)}` | {_possible(key)} | {meaning} |")
    return "\n".join(lines)


def _shown(value: Any) -> str:
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _possible(key: Key) -> str:
    words, known = words_of(key), key.setting
    several = "list of " if key.type.startswith("list") else ""
    if words is not None:
        listed = ", ".join(f"`{word}`" for word in words)
        or_null = " or null" if key.type.endswith("null") else ""
        return f"{several}{listed or 'registered names'}{or_null}"
    if known.low is None or known.high is None:
        return key.type
    return f"{several}{known.low:g} to {known.high:g}" + (" or null" if key.type.endswith("null") else "")


def preset_summary(name: str) -> str:
    """The comment at the head of a preset's file."""
    lines = preset_path(name).read_text("utf-8").splitlines()
    return " ".join(line.lstrip("# ") for line in takewhile(lambda line: line.startswith("#"), lines))
