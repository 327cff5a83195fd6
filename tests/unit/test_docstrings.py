"""Every public name says what it is given, in which unit and shape, what it answers, raises, and comes from.

Public are the names of :mod:`repair` and the members of its classes. What ``docs/functions.md`` shows beside
the equations says where it comes from, unless it is our own.
"""

from __future__ import annotations

import ast
import enum
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from dataclasses import Field, fields, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

import repair
from repair import errors

FUNCTIONS = Path(__file__).parents[2] / "docs" / "functions.md"
_SECTION = re.compile(r"^([A-Z]\w+(?: \w+)?)\n-{3,}\n", re.MULTILINE)
_ENTRY = re.compile(r"^(?=\S)", re.MULTILINE)
#: A unit in brackets, or a word for what has none.
_UNIT = re.compile(
    r"\[[^\]]+\]|\b(share|ratio|factor|weight|index|indices|number|count|how many|by name)\b|\b[Ss]hare\b"
)
_SHAPE = re.compile(r"\([^)]*\)")
#: A year, or what the paper calls its parts.
_SOURCE = re.compile(r"\b(19|20)\d\d\b|\bpaper\b|\bEq|\bAlgorithm\b|\bSection\b|\bTable\b|\b[Bb]ook\b")
#: What this project adds, without a source: `docs/method.md` says what it is.
OUR_OWN = {
    "repair.scene.frame.FrenetFrame",
    "repair.problem.passing.open_passings",
    "repair.vehicle.transitions.direct_check",
    "repair.search.again.probe_again",
    "repair.solvers.casadi.backend.CasadiBackend",
    "repair.solvers.casadi.separation.Separation",
    "repair.solvers.casadi.separation.separate",
    "repair.check.checker.Checker",
    "repair.world.collision.CollisionWorld",
    "repair.certify.recompute.certify",
    "repair.terminal.judge.EndJudge",
}
_ERRORS = {name for name, thing in vars(errors).items() if inspect.isclass(thing)}


def shown() -> list[str]:
    """Dotted names of what the page of functions shows."""
    text = FUNCTIONS.read_text(encoding="utf-8")
    return re.findall(r"^\.\. auto(?:function|class):: (\S+)", text, re.MULTILINE)


def named(dotted: str) -> Any:
    """The thing of that name."""
    module, name = dotted.rsplit(".", 1)
    return getattr(importlib.import_module(module), name)


def members(thing: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that a class of this project defines itself."""
    for name, member in vars(thing).items():
        plain = member.__func__ if isinstance(member, (classmethod, staticmethod)) else member
        plain = plain.func if isinstance(plain, cached_property) else plain
        own = isinstance(plain, property) or inspect.isfunction(plain)
        made = not hasattr(plain, "__code__") or plain.__code__.co_filename == inspect.getfile(thing)
        if own and made and not name.startswith("_"):
            yield name, member


def public() -> Iterator[tuple[str, Any]]:
    """Everything that is looked at, with its name."""
    for dotted in (f"repair.{name}" for name in repair.__all__ if not name.startswith("__")):
        thing = named(dotted)
        yield dotted, thing
        if inspect.isclass(thing):
            for name, member in members(thing):
                yield f"{dotted}.{name}", member


def code_of(thing: Any) -> Any:
    """The function behind a method or a property; None of a class."""
    if isinstance(thing, property):
        return thing.fget
    if isinstance(thing, cached_property):
        return thing.func
    thing = getattr(thing, "__func__", thing)
    return thing if inspect.isfunction(thing) else None


def sections(text: str) -> dict[str, str]:
    """A NumPy docstring by its headings; what stands before the first under ""."""
    parts = _SECTION.split(text)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(section: str) -> dict[str, str]:
    """What a section lists, by name: the whole text about it."""
    found = {}
    for part in _ENTRY.split(section):
        head = part.split("\n", 1)[0].split(" : ")[0]
        for name in head.split(","):
            if re.fullmatch(r"\*{0,2}\w+", name.strip()):
                found[name.strip().lstrip("*")] = part
    return found


def raised(code: Any) -> set[str]:
    """Errors of this project that a function raises itself."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(code)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise)]
    made = [call.func for call in calls if isinstance(call, ast.Call)]
    names = [getattr(func, "id", None) or getattr(func, "attr", "") for func in made]
    return {name for name in names if name in _ERRORS}


def is_quantity(kind: str) -> bool:
    """Whether a documented type is that of a number with a unit, or of an array of them."""
    return bool(re.search(r"\bfloats?\b|\barray\b|\bArray\b", kind))


def wrong_entries(listed: dict[str, str]) -> Iterator[str]:
    """Quantities without a unit, arrays without a shape."""
    for name, text in listed.items():
        kind = text.split("\n", 1)[0].partition(" : ")[2]
        if is_quantity(kind) and not _UNIT.search(text):
            yield f"{name} has no unit"
        if re.search(r"\barray\b", kind) and not _SHAPE.search(text):
            yield f"{name} has no shape"


def of_function(code: Any, is_property: bool, text: str) -> Iterator[str]:
    """What is missing about a function."""
    parts = sections(text)
    told = entries(parts.get("Parameters", ""))
    for name in inspect.signature(code).parameters:
        if name not in ("self", "cls", "_") and name not in told and f"``{name}``" not in text:
            yield f"parameter {name}"
    yield from wrong_entries(told)
    answer = str(code.__annotations__.get("return", "None"))
    plain = answer in ("None", "NoReturn", "Self", "bool", "str") or is_property
    if not plain and "Returns" not in parts and "Yields" not in parts and len(told) > 0:
        yield "Returns"
    if answer in ("float", "Array", "float | None", "Array | None") and not _UNIT.search(text):
        yield "the unit of what it gives"
    said = tuple(getattr(errors, name) for name in entries(parts.get("Raises", "")) if name in _ERRORS)
    yield from (f"raises {name}" for name in raised(code) if not issubclass(getattr(errors, name), said))


def _says_itself(one: Field[Any]) -> bool:
    """Whether a field of a configuration has its meaning beside it, or is a section of such fields."""
    section = one.default_factory if isinstance(one.default_factory, type) else None
    return bool(getattr(one.metadata.get("setting"), "says", "")) or is_dataclass(section)


def of_class(thing: type) -> Iterator[str]:
    """What is missing about the parts of a class."""
    told: dict[str, str] = {}
    for base in thing.__mro__:
        parts = sections(inspect.cleandoc(base.__dict__.get("__doc__") or ""))
        told |= {**entries(parts.get("Attributes", "")), **entries(parts.get("Parameters", ""))}
    yield from wrong_entries(told)
    names: list[str] = []
    if is_dataclass(thing):
        names = [one.name for one in fields(thing) if not _says_itself(one)]
    elif issubclass(thing, enum.Enum):
        names = [member.name for member in thing]
    elif "__init__" in vars(thing) and not getattr(thing, "_is_protocol", False):
        names = [name for name in inspect.signature(thing).parameters if name != "self"]
    for name in names:
        if name not in told and not name.startswith("_"):
            yield f"attribute {name}"


def missing(thing: Any) -> list[str]:
    """What a docstring does not say."""
    text = inspect.cleandoc(getattr(code_of(thing) or thing, "__doc__", None) or "")
    if not text:
        return ["docstring"]
    wrong = [] if text.split("\n\n", 1)[0].rstrip().endswith((".", ":")) else ["a first sentence"]
    code = code_of(thing)
    if code is not None:
        wrong += of_function(code, isinstance(thing, (property, cached_property)), text)
    elif inspect.isclass(thing):
        wrong += of_class(thing)
    return wrong


@pytest.mark.parametrize(
    "name, thing", list(public()), ids=lambda value: value if isinstance(value, str) else ""
)
def test_a_public_name_says_what_it_takes_gives_and_raises(name, thing):
    assert missing(thing) == []


@pytest.mark.parametrize("name", shown())
def test_what_comes_from_elsewhere_says_from_where(name):
    thing = named(name)
    module = importlib.import_module(thing.__module__)
    text = (inspect.getdoc(thing) or "") + (module.__doc__ or "")
    assert bool(_SOURCE.search(text)) != (name in OUR_OWN), "a source is due, or the name is one of our own"


def test_what_is_not_said_is_noticed():
    def bare(speed: float) -> float:
        """Something."""
        raise errors.ConfigError("no")

    def whole(speed: float) -> float:
        """Something.

        Parameters
        ----------
        speed : float
            [m/s].

        Returns
        -------
        float
            [m].

        Raises
        ------
        ConfigError
            Always.
        """
        raise errors.ConfigError("no")

    assert missing(bare) == ["parameter speed", "the unit of what it gives", "raises ConfigError"]
    assert missing(whole) == []
