"""Notes for people: those that differ in the obstacle (or lanelet) alone are one line."""

from __future__ import annotations

import re
from collections.abc import Sequence

__all__ = ["grouped"]

_THING = re.compile(r"\b(obstacle|lanelet) (\d+)\b")
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.]*\d)")
_FIGURE = "\0"  # where one was
_SHOWN = 3  # things that are all named; of more, two are
_PLURAL = {"is": "are", "has": "have", "was": "were", "goes": "go", "leaves": "leave", "ends": "end"}


def grouped(notes: Sequence[str]) -> list[str]:
    """Notes in their order, each where the first of its kind stands.

    Parameters
    ----------
    notes : sequence of str
        As the record has them.

    Returns
    -------
    list of str
        Those that name one obstacle and differ only in which, and in figures, say so in one sentence:
        ``obstacles 12, 15 and 9 more are ... from t = 6.3 to 8.8 s``.
    """
    groups: dict[str, list[str]] = {}
    for note in notes:
        groups.setdefault(_template(note), []).append(note)
    return [one[0] if len(set(one)) == 1 else _together(template, one) for template, one in groups.items()]


def _template(note: str) -> str:
    """The note without its figures; whole where it does not name exactly one obstacle or lanelet."""
    if len(_THING.findall(note)) != 1:
        return note
    return _NUMBER.sub(_FIGURE, _nameless(note))


def _nameless(note: str) -> str:
    return _THING.sub(r"\1 @", note)


def _together(template: str, notes: Sequence[str]) -> str:
    ids = list(dict.fromkeys(found[2] for note in notes if (found := _THING.search(note))))
    columns = zip(*(_NUMBER.findall(_nameless(note)) for note in notes), strict=True)
    figures = iter([_range(column) for column in columns])
    text = re.sub(_FIGURE, lambda _: next(figures), template)
    if len(ids) == 1:
        return text.replace(" @", f" {ids[0]}", 1)
    leads = text.startswith(("obstacle @", "lanelet @"))
    text = text.replace(" @", f"s {_named(ids)}", 1)
    if not leads:
        return text
    # They are what the sentence is about: its verbs follow them, until something else is.
    own, semicolon, rest = text.partition(";")
    own = re.sub(r"\b\w+\b", lambda m: _PLURAL.get(m[0], m[0]), own)
    return own + semicolon + re.sub(r"\bit\b", "them", rest)


def _range(column: Sequence[str]) -> str:
    low, high = min(column, key=float), max(column, key=float)
    return low if float(low) == float(high) else f"{low} to {high}"


def _named(ids: Sequence[str]) -> str:
    if len(ids) <= _SHOWN:
        return f"{', '.join(ids[:-1])} and {ids[-1]}"
    return f"{', '.join(ids[:2])} and {len(ids) - 2} more"
