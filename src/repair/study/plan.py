"""What a study runs: scenarios, references, backends and variations, resolved into tasks beforehand."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from repair.config import Config, load_config
from repair.errors import ConfigError, RepairError, ScenarioError, in_words
from repair.study.rows import STUDY, Table

__all__ = [
    "NO_MEMORY",
    "Study",
    "Task",
    "Variation",
    "checksum",
    "labels_of",
    "package_version",
    "require_possible",
    "tasks_of",
]

#: What a row says that asked for memory which the machine did not have: no limit of the study.
NO_MEMORY = "there was no memory left"


@dataclass(frozen=True)
class Variation:
    """Settings that are laid over those of the whole study.

    Attributes
    ----------
    name : str
        By which its rows are told apart; empty where nothing varies.
    settings : tuple of (str, value)
        Dotted keys of the configuration.
    """

    name: str = ""
    settings: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True)
class Study:
    """What is run.

    Attributes
    ----------
    files : tuple of Path
        The scenarios.
    backends, references : tuple of str
    variations : tuple of Variation
    preset : str or None
    config : Path or None
        A configuration file.
    settings : mapping
        Dotted keys, for all rows.
    official : bool
        Write each trajectory as a solution file and have CommonRoad's checker judge it.
    certify : bool
        Write each result and recompute its margins from the files.
    timeout : float
        Wall time for one row [s].
    memory : float
        What the process that makes a row may take [MB].
    results : bool
        Keep the whole result of each row, for reports.
    """

    files: tuple[Path, ...]
    backends: tuple[str, ...] = ("ego",)
    references: tuple[str, ...] = ("planner",)
    variations: tuple[Variation, ...] = (Variation(),)
    preset: str | None = None
    config: Path | None = None
    settings: Mapping[str, Any] | Sequence[str] = ()
    official: bool = True
    certify: bool = False
    timeout: float = 300.0
    memory: float = 4000.0
    results: bool = True

    @property
    def varied(self) -> tuple[str, ...]:
        """The keys that vary, in the order in which they are first named."""
        return tuple(dict.fromkeys(key for each in self.variations for key, _ in each.settings))


@dataclass(frozen=True)
class Task:
    """One row to be made; it can be sent to another process.

    Attributes
    ----------
    file : str
        What the scenario is called in the table.
    path : str
    sha256 : str
        Of the file.
    backend, reference, variation : str
    varied : mapping
        The resolved values of the keys that vary in the study.
    config : Config
    official, certify, results : bool
    timeout, memory : float
        See :class:`Study`.
    config_sha256 : str
        Of everything that is asked for: the resolved configuration, and which judges.
    table : Table
        What the row looks like.
    """

    file: str
    path: str
    sha256: str
    backend: str
    reference: str
    variation: str
    varied: Mapping[str, Any]
    config: Config
    official: bool
    certify: bool
    results: bool
    timeout: float
    memory: float
    config_sha256: str
    table: Table = STUDY

    @property
    def key(self) -> str:
        """What the row is stored under: scenario, its name, reference, configuration and package version."""
        parts = (self.file, self.sha256, self.reference, self.config_sha256, package_version())
        return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()

    @property
    def too_late(self) -> str:
        """What a row says that has taken too long."""
        return f"no answer within {self.timeout:g} s"

    @property
    def too_much(self) -> str:
        """What a row says that has taken too much memory."""
        return f"it took more than {self.memory:g} MB"

    def still_lost(self, status: str, detail: str) -> bool:
        """Whether a row that is there would be lost again: no limit that ended it is another one now."""
        said = {"timeout": self.too_late, "memory": self.too_much}.get(status, detail)
        return detail in (said, NO_MEMORY)


def package_version() -> str:
    """Of this package; what another version made is made again."""
    try:
        return version("commonroad-repair")
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "unknown"


def require_possible(study: Study) -> None:
    """See that there is something to do, and time and memory to do it in.

    Raises
    ------
    RepairError
        Naming what is wrong.
    """
    for name, values in (("backends", study.backends), ("references", study.references)):
        if not values:
            raise ConfigError(f"the study names no {name}")
        if len(set(values)) < len(values):
            raise ConfigError(f"the study names one of its {name} twice: {', '.join(values)}")
    if not study.files:
        raise ScenarioError("the study names no scenarios")
    if not study.timeout > 0.0:
        raise RepairError(f"timeout is {study.timeout:g} s; it has to be positive")
    if not study.memory > 0.0:
        raise RepairError(f"memory is {study.memory:g} MB; it has to be positive")


def tasks_of(study: Study) -> list[Task]:
    """Every row of a study, file by file, the settings that share a preparation one after the other.

    Raises
    ------
    RepairError
        If a scenario's file cannot be read, a key is misspelt, a value is out of range, or a backend or
        reference is not known: before any work.
    """
    require_possible(study)
    configured = list(_configured(study))
    files = [(name, path, checksum(path)) for name, path in labels_of(study.files).items()]
    return [
        Task(
            name, str(path), sha256, config.backend, config.reference.source, variation.name, varied,
            config, study.official, study.certify, study.results, study.timeout, study.memory, digest,
        )
        for name, path, sha256 in files
        for variation, config, varied, digest in configured
    ]  # fmt: skip


def labels_of(files: Sequence[Path]) -> dict[str, Path]:
    """What each file is called in the table: by its name, or by its path where others have that name too."""
    known = dict.fromkeys(path.resolve() for path in files)
    names = [path.name for path in known]
    return {path.name if names.count(path.name) == 1 else path.as_posix(): path for path in known}


def _configured(study: Study) -> Iterator[tuple[Variation, Config, dict[str, Any], str]]:
    """The configuration of each row of a file, with the values that vary and its checksum."""
    from repair.config.schema import values_of
    from repair.solvers.registry import make_backend

    common = study.settings
    if not isinstance(common, Mapping):
        common = _as_mapping(common)
    for reference, backend, variation in itertools.product(
        study.references, study.backends, study.variations
    ):
        named = {**common, **dict(variation.settings)}
        for key in ("backend", "reference.source"):
            if key in named:
                raise ConfigError(f"{key} is no setting of a study; it names backends and references itself")
        named["reference.source"] = reference
        config = load_config(study.preset, study.config, named, backend=backend)
        _require_reference(config)
        make_backend(backend, config)
        values = values_of(config)
        yield variation, config, {key: values[key] for key in study.varied}, _digest(config, study)


def _require_reference(config: Config) -> None:
    """Refuse a reference that no row could have."""
    if config.reference.source == "given":
        raise ConfigError("reference given comes from a program's memory; a study has none")
    if config.reference.source == "file" and not config.reference.file:
        raise ConfigError("reference file names no solution file; set reference.file says which")


def _as_mapping(texts: Sequence[str]) -> dict[str, Any]:
    """``key=value`` texts as dotted keys, each value read as YAML."""
    from omegaconf import OmegaConf

    from repair.config.layers import dotted

    found: dict[str, Any] = {}

    def walk(node: Any, prefix: str) -> None:
        for key, value in node.items():
            if isinstance(value, dict):
                walk(value, f"{prefix}{key}.")
            else:
                found[f"{prefix}{key}"] = value

    walk(OmegaConf.to_container(dotted(texts)), "")
    return found


def _digest(config: Config, study: Study) -> str:
    """Checksum of the resolved configuration, the content of files that it names, and who judges."""
    asked: dict[str, Any] = {"official": study.official, "certify": study.certify, **config.to_dict()}
    if config.reference.file is not None:
        asked["reference_sha256"] = checksum(Path(config.reference.file))
    return hashlib.sha256(json.dumps(asked, sort_keys=True, default=str).encode()).hexdigest()


def checksum(path: Path) -> str:
    """Of a file.

    Raises
    ------
    ScenarioError
        If it cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ScenarioError(f"{path} cannot be read: {error.strerror or in_words(error)}") from error
