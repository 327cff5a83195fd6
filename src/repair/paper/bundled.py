"""Which file a name means: a path, a name in COMMONROAD_SCENARIOS, or one of the paper's scenarios."""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from repair.errors import ScenarioError, in_words

__all__ = [
    "GENERATED",
    "OFFICIAL_FILES",
    "PAPER_SCENARIOS",
    "find_scenario",
    "paper_scenario",
    "reconstruction_by",
]

#: The paper's scenarios; each has a preset of the same name.
PAPER_SCENARIOS = ("scenario_1", "scenario_2")
#: All that are generated: theirs, and our variation of the first one.
GENERATED = (*PAPER_SCENARIOS, "scenario_1_stops")
#: Those that are published as CommonRoad files.
OFFICIAL_FILES = {"scenario_1": "DEU_Flensburg-6_1_T-1.xml"}


@contextmanager
def find_scenario(name: str) -> Iterator[Path]:
    """The file that ``name`` means; a reconstruction only exists inside of the ``with`` block.

    Parameters
    ----------
    name : str
        A path; a file's name, with or without ``.xml``, in the folder COMMONROAD_SCENARIOS; or one of
        :data:`GENERATED`, which always gives the reconstruction.

    Raises
    ------
    ScenarioError
        If COMMONROAD_SCENARIOS is set and the file is neither there nor here, or no file can have that name.
    """
    path, folder = Path(name), os.environ.get("COMMONROAD_SCENARIOS")
    candidates = [path]
    if folder and not path.is_absolute():
        candidates += [Path(folder) / name, Path(folder) / f"{name}.xml"]
    try:
        existing = next((p for p in candidates if p.is_file()), None)
    except (OSError, ValueError) as error:  # a name that is too long, or cannot be spelt
        raise ScenarioError(f"{in_words(name)} is not the name of a file: {in_words(error)}") from error
    if existing is None and name in GENERATED:
        yield _reconstruction(name)
        return
    if existing is None and folder and not path.is_absolute() and not path.exists():
        raise ScenarioError(f"{name}: no such file, neither here nor in COMMONROAD_SCENARIOS={folder}")
    yield path if existing is None else existing


@contextmanager
def paper_scenario(name: str) -> Iterator[Path]:
    """The official file of a scenario where COMMONROAD_SCENARIOS has it, else its reconstruction."""
    folder, file = os.environ.get("COMMONROAD_SCENARIOS"), OFFICIAL_FILES.get(name)
    if folder and file and (Path(folder) / file).is_file():
        yield Path(folder) / file
        return
    yield _reconstruction(name)


@contextmanager
def reconstruction_by(checksum: str | None) -> Iterator[Path]:
    """The reconstruction that a result was made from, generated again.

    Raises
    ------
    ScenarioError
        If none that this version generates has that SHA-256.
    """
    for name in PAPER_SCENARIOS:
        path = _reconstruction(name)
        if hashlib.sha256(path.read_bytes()).hexdigest() == checksum:
            yield path
            return
    raise ScenarioError(
        "the result was made from a reconstruction that this version does not generate any more"
    )


@cache
def _reconstruction(name: str) -> Path:
    """It stays until the process ends: who saves a result later writes it beside that."""
    from repair.paper.synthetic import write_scenario

    aside = tempfile.mkdtemp(prefix="repair-")
    atexit.register(shutil.rmtree, aside, ignore_errors=True)
    return write_scenario(name, Path(aside))
