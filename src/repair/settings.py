"""One key of the configuration: its default, what it may be, and its meaning, in one place.

A section is a dataclass whose fields are made by :func:`setting`. What can be set, the table of all keys
and the errors about wrong values are read off these fields; nothing about a key is written elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from math import isfinite
from numbers import Integral, Real
from typing import Any, Union, get_args, get_origin, get_type_hints

from repair.errors import ConfigError, in_words

__all__ = ["Key", "Setting", "keys_of", "require_sane", "require_type", "setting"]

_ELEMENT = 50.0  # a list of numbers holds none of larger size, unless it says so


@dataclass(frozen=True)
class Setting:
    """What a key may be, and what it means.

    Attributes
    ----------
    says : str
        The meaning, in words, with the unit.
    low, high : float or None
        Smallest and largest value, both allowed; of a list, those of each of its numbers.
    choices : tuple of str or None
        The words that are possible.
    registry : str or None
        The kind of a registry whose names are possible; it lies further up, with what it lists.
    only_with : tuple of (str, tuple) or None
        Another key, and the values of it with which this one has an effect.
    """

    says: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] | None = None
    registry: str | None = None
    only_with: tuple[str, tuple[Any, ...]] | None = None


def setting(
    default: Any = MISSING,
    says: str = "",
    *,
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] | None = None,
    registry: str | None = None,
    only_with: tuple[str, tuple[Any, ...]] | None = None,
    factory: Any = MISSING,
) -> Any:
    """Make a field of a section; see :class:`Setting` for the parameters.

    Parameters
    ----------
    default
        The default value, or ``factory`` makes it.
    """
    known = {"setting": Setting(says, low, high, choices, registry, only_with)}
    if factory is not MISSING:
        return field(default_factory=factory, metadata=known)
    return field(default=default, metadata=known)


@dataclass(frozen=True)
class Key:
    """One key as its section declares it.

    Attributes
    ----------
    name : str
        Dotted, from the top of the configuration.
    type : str
        For people: ``float or null``.
    default
    setting : Setting
    """

    name: str
    type: str
    default: Any
    setting: Setting


def keys_of(section: Any, prefix: str = "") -> Iterator[Key]:
    """All keys of a section (a dataclass type), those of its own sections included, in order."""
    hints = get_type_hints(section)
    for item in fields(section):
        # Not by `is MISSING`: a section that was handed over from another process has a mark of its own.
        made = item.default_factory() if callable(item.default_factory) else item.default
        if is_dataclass(made):
            yield from keys_of(type(made), f"{prefix}{item.name}.")
        else:
            declared = item.metadata.get("setting", Setting())
            yield Key(f"{prefix}{item.name}", _type_name(hints[item.name]), made, declared)


def _type_name(hint: Any) -> str:
    """A type for people, such as ``float or null``."""
    if get_origin(hint) is Union or type(hint).__name__ == "UnionType":
        return " or ".join("null" if part is type(None) else _type_name(part) for part in get_args(hint))
    return (
        hint.__name__ if isinstance(hint, type) and not get_args(hint) else str(hint).replace("typing.", "")
    )


_TYPES: dict[str, tuple[type, ...]] = {
    "null": (type(None),), "bool": (bool,), "int": (Integral,), "float": (Real,), "str": (str,),
    "list": (list,), "dict": (dict,),
}  # fmt: skip


def require_type(key: Key, value: Any) -> None:
    """Refuse a value of another type than the key's: for settings that no schema has seen.

    Raises
    ------
    ConfigError
        Naming the key, what it got and what it expects.
    """
    words = [word.partition("[")[0] for word in key.type.split(" or ")]
    if any(word not in _TYPES for word in words):
        return  # of a backend from elsewhere
    known = tuple(one for word in words for one in _TYPES[word])
    if not isinstance(value, known) or (isinstance(value, bool) and bool not in known):
        raise ConfigError(f"configuration key {key.name!r} is {in_words(value)}; it must be {key.type}")


def require_sane(key: Key, value: Any, words: Sequence[str] | None) -> None:
    """Refuse a value that is out of range, no choice, or no finite number.

    Parameters
    ----------
    words : sequence of str or None
        The choices there are, if there are any.

    Raises
    ------
    ConfigError
        Naming the key, what it got and what it expects.
    """
    named, known = f"configuration key {key.name!r} is", key.setting
    if words is not None and value is not None:
        for one in value if isinstance(value, list) else [value]:
            if one not in words:
                shown = f"{value!r}" if one is value else f"{value}, and {one!r} is unknown"
                raise ConfigError(f"{named} {shown}; it must be one of {', '.join(map(str, words))}")
        return
    if isinstance(value, float) and not isfinite(value):
        raise ConfigError(f"{named} {value}; it must be a finite number")
    # OmegaConf lets a list stand for a number inside of a list.
    if isinstance(value, list) and "float" in key.type:
        low = -_ELEMENT if known.low is None else known.low
        high = _ELEMENT if known.high is None else known.high
        if not all(isinstance(v, float) and low <= v <= high for v in value):
            raise ConfigError(f"{named} {value}; it must be numbers from {low:g} to {high:g}")
        return
    low = -float("inf") if known.low is None else known.low
    high = float("inf") if known.high is None else known.high
    if isinstance(value, (int, float)) and not isinstance(value, bool) and not low <= value <= high:
        raise ConfigError(f"{named} {value}; it must lie in [{low:g}, {high:g}]")
