"""Standard output and error as they may be: closed, or not able to write every character."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["as_json", "lenient", "opened"]


def opened() -> None:
    """Put the null device where standard input, output or error was closed before we began.

    Otherwise the first file that is opened takes its place, and what libraries print ends up in it.
    """
    while True:
        handle = os.open(os.devnull, os.O_RDWR)
        if handle > 2:
            os.close(handle)
            break
    for number, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "w", encoding="utf-8", closefd=False))  # noqa: SIM115


@contextmanager
def lenient() -> Iterator[None]:
    """Inside of a ``with`` block no character is an error: what cannot be written comes out escaped.

    Where there is no standard output, what is printed goes nowhere.
    """
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        before = {name: getattr(sys, name) for name in ("stdout", "stderr")}
        changed: list[tuple[Any, str]] = []
        for name, stream in before.items():
            if stream is None or getattr(stream, "closed", False):
                setattr(sys, name, nowhere)
            elif hasattr(stream, "reconfigure") and stream.errors == "strict":
                changed.append((stream, stream.errors))
                stream.reconfigure(errors="backslashreplace")
        try:
            yield
        finally:
            for stream, errors in changed:
                if not stream.closed:
                    stream.reconfigure(errors=errors)
            for name, stream in before.items():
                if getattr(sys, name) is nowhere:
                    setattr(sys, name, stream)


def as_json(text: str) -> str:
    """JSON text as standard output can write it: what it has no character for in JSON's own notation."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except (UnicodeEncodeError, LookupError):
        return "".join(c if ord(c) < 128 else json.dumps(c)[1:-1] for c in text)
    return text
