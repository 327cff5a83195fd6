"""Reading a CommonRoad XML file without trusting it."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

from repair.errors import ScenarioError

__all__ = ["FileContents", "read_file"]

_SIZE_MAX = 200_000_000  # bytes


@dataclass(frozen=True)
class FileContents:
    """A parsed file: CommonRoad objects, and what identifies the file."""

    path: Path
    benchmark_id: str
    sha256: str
    scenario: Any
    problems: Mapping[int, Any]


class _Stop(Exception):
    """The root element is reached: the prolog is clean."""


def _bytes(path: Path, limit: int) -> bytes:
    try:
        if path.is_dir():
            raise ScenarioError(f"{path} is a directory, not a CommonRoad file")
        if not path.is_file():
            raise ScenarioError(f"{path}: no such file")
        size = path.stat().st_size
        if size > limit:
            raise ScenarioError(f"{path.name} has {size / 1e6:.0f} MB; at most {limit / 1e6:.0f} MB are read")
        data = path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {error.strerror or error}") from error
    if not data.strip():
        raise ScenarioError(f"{path.name} is empty")
    return data


def _root(data: bytes, name: str) -> tuple[str, dict[str, str]]:
    """Tag and attributes of the root element; refuses document type declarations on the way.

    They can only stand before the root element, and only there can entities be declared.
    """
    found: list[tuple[str, dict[str, str]]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        found.append((tag, attributes))
        raise _Stop

    def doctype(*_: object) -> None:
        raise ScenarioError(f"{name} declares a document type (DOCTYPE); for safety such files are not read")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except _Stop:
        pass
    except expat.ExpatError as error:
        raise ScenarioError(f"{name} is not XML: {error}") from error
    return found[0]


def read_file(path: Path, *, size_limit: int = _SIZE_MAX) -> FileContents:
    """Read and parse a CommonRoad XML file once.

    Raises
    ------
    ScenarioError
        Whatever is wrong with it, in one sentence that names the file.
    """
    data = _bytes(path, size_limit)
    tag, attributes = _root(data, path.name)
    if tag != "commonRoad":
        raise ScenarioError(f"{path.name} is not a CommonRoad file: its root element is <{tag}>")
    _check_time_step(attributes.get("timeStepSize"), path.name)

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # commonroad-io's, about the file, and protobuf's, when imported
            from commonroad.common.file_reader import CommonRoadFileReader
            from commonroad.common.util import FileFormat

            scenario, problems = CommonRoadFileReader(data, FileFormat.XML).open()
    except Exception as error:  # commonroad-io raises whatever the broken part happens to cause
        cause = " ".join(str(error).split())[:200] or "no further explanation"
        raise ScenarioError(
            f"{path.name}: commonroad-io cannot read it ({type(error).__name__}: {cause})"
        ) from error
    return FileContents(
        path=path,
        benchmark_id=attributes.get("benchmarkID") or path.stem,
        sha256=hashlib.sha256(data).hexdigest(),
        scenario=scenario,
        problems=problems.planning_problem_dict,
    )


def _check_time_step(text: str | None, name: str) -> None:
    try:
        positive = text is not None and 0.0 < float(text) < float("inf")
    except ValueError:
        positive = False
    if not positive:
        raise ScenarioError(
            f"{name}: the time step (timeStepSize) is {text!r}; it has to be a positive number"
        )
