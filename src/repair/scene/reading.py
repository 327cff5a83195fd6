"""Reading a CommonRoad XML file without trusting it."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

from repair.errors import RepairError, ScenarioError, in_words

__all__ = ["FileContents", "read_file", "read_solution", "read_xml", "require_commonroad"]

_SIZE_MAX = 200_000_000  # bytes
_TIME_STEP = (1e-3, 10.0)  # smallest and largest [s]
_NEEDED = {
    "planningProblem": ("position", "orientation", "velocity", "time"),
    "dynamicObstacle": ("position", "orientation", "time"),
    "staticObstacle": ("position", "orientation"),
}
#: The first release of commonroad-io that lacks what the drivability checker imports.
_COMMONROAD_END = 2026
_KNOWN = frozenset(
    {"location", "scenarioTags", "lanelet", "trafficSign", "trafficLight", "intersection", "obstacle",
     "staticObstacle", "dynamicObstacle", "environmentObstacle", "phantomObstacle", "planningProblem"}
)  # fmt: skip


@dataclass(frozen=True)
class FileContents:
    """A parsed file: CommonRoad objects, what identifies the file, and what commonroad-io left out."""

    path: Path
    benchmark_id: str
    sha256: str
    scenario: Any
    problems: Mapping[int, Any]
    notes: tuple[str, ...] = ()


@lru_cache(maxsize=1)
def require_commonroad() -> None:
    """See that CommonRoad's packages fit each other; looked at once in a process.

    Raises
    ------
    RepairError
        If they are not there, or commonroad-io is one that the drivability checker cannot be used with;
        the sentence says what to install.
    """
    install = f"install one that fits: pip install 'commonroad-io>=2024.3,<{_COMMONROAD_END}'"
    try:
        found = version("commonroad-io")
    except PackageNotFoundError:
        found = ""  # not installed as a package; the import decides
    year = found.partition(".")[0]
    if year.isdigit() and int(year) >= _COMMONROAD_END:
        raise RepairError(
            f"commonroad-io {found} is installed, and the drivability checker cannot be used with it; "
            f"{install}"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # protobuf's
            import commonroad.common.file_reader
            import commonroad.geometry.shape  # noqa: F401  # what 2026.1 removed
    except ImportError as error:
        shown = f"commonroad-io {found or 'of unknown version'} lacks what is needed ({in_words(error)})"
        raise RepairError(f"{shown}; {install}") from error


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
    except ValueError as error:  # a null character in the name, or one that the file system cannot spell
        raise ScenarioError(f"{str(path)!r} is not the name of a file: {error}") from error
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
    except (expat.ExpatError, LookupError, ValueError) as error:  # the latter two: its encoding
        known = "; write it as XML with commonroad-io" if name.endswith(".pb") else ""
        raise ScenarioError(f"{name} is not XML: {error}{known}") from error
    return found[0]


def read_xml(path: Path, *, size_limit: int = _SIZE_MAX) -> tuple[bytes, str, dict[str, str]]:
    """Read a file that has to be XML without document type declarations, and so without entities.

    Returns
    -------
    data, tag, attributes
        The file's bytes, and tag and attributes of its root element.

    Raises
    ------
    ScenarioError
        If it cannot be read, is empty or too large, does not begin as XML, or has a DOCTYPE.
    """
    data = _bytes(path, size_limit)
    return data, *_root(data, path.name)


def read_file(path: Path, *, size_limit: int = _SIZE_MAX) -> FileContents:
    """Read and parse a CommonRoad XML file once.

    Raises
    ------
    ScenarioError
        Whatever is wrong with it, in one sentence that names the file.
    """
    data, tag, attributes = read_xml(path, size_limit=size_limit)
    if tag != "commonRoad":
        raise ScenarioError(f"{path.name} is not a CommonRoad file: its root element is <{tag}>")
    _check_time_step(attributes.get("timeStepSize"), path.name)
    notes = _check_elements(data, path.name)

    require_commonroad()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # commonroad-io's, about the file
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
        notes=notes,
    )


def read_solution(path: Path) -> Any:
    """Read a CommonRoad solution file; returns the ``commonroad.common.solution.Solution``.

    Raises
    ------
    ScenarioError
        Whatever is wrong with it, in one sentence that names the file.
    """
    data = read_xml(path)[0]
    require_commonroad()
    from commonroad.common.solution import CommonRoadSolutionReader

    try:
        return CommonRoadSolutionReader.fromstring(data)
    except Exception as error:  # as above
        cause = " ".join(str(error).split())[:200]
        raise ScenarioError(
            f"{path} is not a CommonRoad solution file: {type(error).__name__} {cause}"
        ) from error


def _check_time_step(text: str | None, name: str) -> None:
    try:
        usable = text is not None and _TIME_STEP[0] <= float(text) <= _TIME_STEP[1]
    except ValueError:
        usable = False
    if not usable:
        raise ScenarioError(
            f"{name}: the time step (timeStepSize) is {text!r}; it has to be a positive number of seconds, "
            f"from {_TIME_STEP[0]:g} to {_TIME_STEP[1]:g}"
        )


def _check_elements(data: bytes, name: str) -> tuple[str, ...]:
    """Refuse what commonroad-io would make up, and note what it would leave out without a word.

    It fills whatever an initial state lacks with zeros, and then no longer reads what follows: a missing
    orientation takes the speed along.
    """
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ScenarioError(f"{name} is not XML: {error}") from error
    for owner in root:
        tag = f"{owner.findtext('role', 'dynamic')}Obstacle" if owner.tag == "obstacle" else owner.tag
        state = owner.find("initialState")
        missing = [c for c in _NEEDED.get(tag, ()) if state is not None and state.find(c) is None]
        if missing:
            raise ScenarioError(
                f"{name}: the initial state of {owner.tag} {owner.get('id')} "
                f"has no {' and no '.join(missing)}"
            )
    unknown = sorted({str(e.tag) for e in root} - _KNOWN)
    return (f"elements that are not CommonRoad's are ignored: {', '.join(unknown)}",) if unknown else ()
