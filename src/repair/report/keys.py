"""Every configuration key, and the presets, for people."""

from __future__ import annotations

import inspect
import re
from dataclasses import MISSING, dataclass, fields, is_dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

__all__ = ["configuration_keys", "key_table", "preset_summary"]


@dataclass(frozen=True)
class Key:
    """One key of the configuration, as its schema declares it."""

    name: str
    type: str
    default: str
    meaning: str


def configuration_keys() -> list[Key]:
    """All keys in the order of the schema; the meaning is the comment beside the field."""
    from repair.config import Config

    def walk(section: Any, prefix: str) -> list[Key]:
        source = inspect.getsource(section)
        keys = []
        for item in fields(section):
            name = f"{prefix}{item.name}"
            value = item.default if item.default_factory is MISSING else item.default_factory()
            if is_dataclass(value):
                keys += walk(type(value), f"{name}.")
                continue
            line = re.search(rf"^    {item.name}:[^#\n]*(?:#\s*(.*))?$", source, re.MULTILINE)
            meaning = (line.group(1) if line else None) or ""
            default = (
                "null" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
            )
            keys.append(Key(name, str(item.type).replace(" | None", " or null"), default, meaning))
        return keys

    return walk(Config, "")


def key_table() -> str:
    """Every configuration key with default, choices or range, and meaning, as a Markdown table."""
    from repair.config import CHOICES, RANGES

    lines = ["| key | default | possible | meaning |", "|---|---|---|---|"]
    for key in configuration_keys():
        meaning, possible = key.meaning, key.type
        if key.name in CHOICES:
            possible = ", ".join(f"`{c}`" for c in CHOICES[key.name])
            meaning = "" if " | " in meaning and ":" not in meaning else meaning
        elif key.name in RANGES:
            low, high = RANGES[key.name]
            possible = f"{low:g} to {high:g}" + (" or null" if key.type.endswith("null") else "")
        lines.append(
            f"| `{key.name}` | `{key.default}` | {possible} | {meaning.replace('|', chr(92) + '|')} |"
        )
    return "\n".join(lines)


def preset_summary(name: str) -> str:
    """The comment at the head of a preset's file."""
    import repair.config

    lines = (
        (Path(repair.config.__file__).with_name("presets") / f"{name}.yaml").read_text("utf-8").splitlines()
    )
    head = list(takewhile(lambda line: line.startswith("#"), lines))
    return " ".join(line.lstrip("# ") for line in head)
