"""The errors a user can act on. Nothing else is meant to leave the library."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

__all__ = [
    "BackendError",
    "ConfigError",
    "OutOfTime",
    "OutputError",
    "ReferenceTrajectoryError",
    "RepairError",
    "ScenarioError",
    "foreign",
    "in_words",
    "kind_of",
    "path_of",
]


class RepairError(Exception):
    """Base of every error raised on purpose: one sentence that says what is wrong with which input."""


class ScenarioError(RepairError):
    """The scenario (file) cannot be used: unreadable, incomplete, or without a usable route."""


class ConfigError(RepairError):
    """A configuration key, value or preset is wrong."""


class ReferenceTrajectoryError(RepairError):
    """No reference trajectory can be had: planner, file or recorded obstacle."""


class BackendError(RepairError):
    """A backend is unknown or cannot be imported, or it was handed a malformed problem."""


class OutputError(RepairError):
    """A result cannot be written."""


class OutOfTime(Exception):
    """The deadline has passed, or what comes next would not end before it.

    It is caught inside of the package. Ours alone: a TimeoutError may come out of a backend, and would be
    its bug.
    """


@contextmanager
def foreign(what: str, error: type[RepairError]) -> Iterator[None]:
    """Whatever a part raises that another program may have brought is an error that names the part.

    Parameters
    ----------
    what : str
        The part, to begin the sentence with: ``check 'comfort'``.
    error : type
        What is raised then.
    """
    try:
        yield
    except (RepairError, OutOfTime):
        raise
    except Exception as raised:
        raise error(f"{what} failed: {type(raised).__name__}: {in_words(raised)}") from raised


def in_words(thing: object, most: int = 200) -> str:
    """A foreign error, or any value, on one line and not too long; its type where it has no words."""
    try:
        text = " ".join((str(thing) if isinstance(thing, BaseException) else repr(thing)).split())
    except Exception:  # a foreign __repr__
        text = ""
    if not text:
        return type(thing).__name__
    return text if len(text) <= most else f"{text[:most]}..."


def kind_of(thing: object) -> str:
    """What something is, for sentences: its type by name."""
    return "None" if thing is None else f"a {type(thing).__name__}"


def path_of(thing: Any, what: str, error: type[RepairError]) -> Path:
    """A path that a user gave.

    Parameters
    ----------
    thing : str or path
    what : str
        What it has to name, to begin the sentence with.
    error : type
        What is raised where it is none.
    """
    if not isinstance(thing, (str, os.PathLike)):
        raise error(f"{what} has to be a path, not {kind_of(thing)}")
    name = os.fspath(thing)
    if not isinstance(name, str):
        raise error(f"{what} has to be a path as text, not as bytes; os.fsdecode makes text of them")
    if "\0" in name:
        raise error(f"{what} is {in_words(name)}; no path holds a null character")
    return Path(name)
