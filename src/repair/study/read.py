"""A study's YAML file, read and looked at before anything runs."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from repair.config.layers import read_yaml
from repair.errors import ConfigError, ScenarioError, in_words, kind_of, path_of
from repair.study.plan import Study, Variation

__all__ = ["read_study"]

_KEYS = (
    "scenarios", "references", "backends", "vary", "preset", "config", "set",
    "official", "certify", "timeout", "memory", "results",
)  # fmt: skip
_GLOB = frozenset("*?[")


def read_study(file: str | Path, find: Callable[[str], Path]) -> Study:
    """Read a study.

    Parameters
    ----------
    file : path
        YAML: ``scenarios`` (files, folders, patterns, names), ``references``, ``backends``, ``vary`` (a
        mapping of keys to lists, of which every combination is a variation, or a list of named mappings),
        ``set`` (keys for all rows), ``preset``, ``config`` (a file), ``official``, ``certify``, ``timeout``,
        ``memory``, ``results``; see :class:`repair.study.plan.Study`.
        Paths are relative to the file.
    find : callable
        The file that a name means which is no path.

    Raises
    ------
    RepairError
        Naming the key that is misspelt or has a wrong value, or the scenario that is not there.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    path = path_of(file, "a study", ConfigError)
    try:
        content: Any = OmegaConf.to_container(read_yaml(path), resolve=True)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{path}: {in_words(error)}") from error
    for key in content:
        if key not in _KEYS:
            close = get_close_matches(str(key), _KEYS, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else f"; there are {', '.join(_KEYS)}"
            raise ConfigError(f"{path}: a study has no key {in_words(key)}{hint}")
    read = _Read(path, content)
    known: dict[str, Any] = {item.name: item.default for item in fields(Study)}
    return Study(
        files=read.scenarios(find),
        backends=read.names("backends", ("ego",)),
        references=read.names("references", ("planner",)),
        variations=read.variations(),
        preset=read.text("preset"),
        config=None if (config := read.text("config")) is None else path.parent / config,
        settings=read.mapping("set"),
        official=read.truth("official", known["official"]),
        certify=read.truth("certify", known["certify"]),
        timeout=read.figure("timeout", known["timeout"]),
        memory=read.figure("memory", known["memory"]),
        results=read.truth("results", known["results"]),
    )


class _Read:
    """The keys of a study by type; each error names the file and the key."""

    def __init__(self, path: Path, content: Mapping[str, Any]) -> None:
        self.path, self.content = path, content

    def wrong(self, key: str, wanted: str) -> ConfigError:
        return ConfigError(f"{self.path}: {key} is {in_words(self.content.get(key))}; it has to be {wanted}")

    def names(self, key: str, default: tuple[str, ...]) -> tuple[str, ...]:
        """One name, or a list of them."""
        value = self.content.get(key, list(default))
        value = [value] if isinstance(value, str) else value
        if not isinstance(value, list) or not value or not all(isinstance(each, str) for each in value):
            raise self.wrong(key, "a list of names")
        return tuple(value)

    def text(self, key: str) -> str | None:
        value = self.content.get(key)
        if value is not None and not isinstance(value, str):
            raise self.wrong(key, "a name")
        return value

    def truth(self, key: str, default: bool) -> bool:
        value = self.content.get(key, default)
        if not isinstance(value, bool):
            raise self.wrong(key, "true or false")
        return value

    def figure(self, key: str, default: float) -> float:
        value = self.content.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.wrong(key, "a number")
        return float(value)

    def mapping(self, key: str) -> dict[str, Any]:
        value = self.content.get(key, {})
        if not isinstance(value, dict):
            raise self.wrong(key, "a mapping of configuration keys")
        return _dotted(value)

    def variations(self) -> tuple[Variation, ...]:
        """A grid, or a list of named settings."""
        value = self.content.get("vary", {})
        if isinstance(value, dict):
            return self._grid(_dotted(value))
        if not isinstance(value, list) or not value:
            raise self.wrong("vary", "a mapping of keys to lists of values, or a list of named mappings")
        made = []
        for each in value:
            if not isinstance(each, dict) or not isinstance(each.get("name"), str) or not each["name"]:
                raise ConfigError(
                    f"{self.path}: vary has {in_words(each)}; it needs a name, and keys beside it"
                )
            settings = _dotted({key: one for key, one in each.items() if key != "name"})
            made.append(Variation(each["name"], tuple(settings.items())))
        names = [variation.name for variation in made]
        if len(set(names)) < len(names):
            raise ConfigError(f"{self.path}: vary has a name twice: {', '.join(names)}")
        return tuple(made)

    def _grid(self, axes: Mapping[str, Any]) -> tuple[Variation, ...]:
        for key, values in axes.items():
            if not isinstance(values, list) or not values:
                raise ConfigError(
                    f"{self.path}: vary has {key}: {in_words(values)}; it has to be a list of values"
                )
            if len({repr(value) for value in values}) < len(values):
                raise ConfigError(f"{self.path}: vary has a value of {key} twice: {in_words(values)}")
        if not axes:
            return (Variation(),)
        chosen = (tuple(zip(axes, values, strict=True)) for values in itertools.product(*axes.values()))
        return tuple(Variation(", ".join(f"{k}={_plain(v)}" for k, v in each), each) for each in chosen)

    def scenarios(self, find: Callable[[str], Path]) -> tuple[Path, ...]:
        """Files, those of folders and patterns, and those that names mean; each once."""
        if "scenarios" not in self.content:
            raise ConfigError(f"{self.path} names no scenarios")
        found: dict[Path, None] = {}
        for entry in dict.fromkeys(self.names("scenarios", ())):
            try:
                found.update(dict.fromkeys(self._files(entry, find)))
            except (OSError, ValueError, NotImplementedError) as error:
                raise ScenarioError(
                    f"{self.path}: {in_words(entry)} cannot be read: {in_words(error)}"
                ) from error
        return tuple(found)

    def _files(self, entry: str, find: Callable[[str], Path]) -> list[Path]:
        path = self.path.parent / Path(entry).expanduser()
        if path.is_file():
            return [path.resolve()]
        if path.is_dir():
            files = sorted(path.glob("*.xml"))
        elif _GLOB & set(entry):
            base = Path(path.anchor) if path.is_absolute() else Path()
            files = sorted(p for p in base.glob(str(path.relative_to(path.anchor))) if p.is_file())
        else:
            named = find(entry)
            if not named.is_file():
                raise ScenarioError(
                    f"{self.path}: {in_words(entry)} is no file, folder, pattern or known name"
                )
            return [named.resolve()]
        if not files:
            raise ScenarioError(f"{self.path}: {in_words(entry)} holds no scenario files (*.xml)")
        return [each.resolve() for each in files]


def _dotted(node: Mapping[Any, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as dotted keys."""
    found: dict[str, Any] = {}
    for key, value in node.items():
        if not isinstance(key, str):
            raise ConfigError(f"{in_words(key)} is {kind_of(key)}, and no configuration key")
        if isinstance(value, dict) and value:
            found.update(_dotted(value, f"{prefix}{key}."))
        else:
            found[f"{prefix}{key}"] = value
    return found


def _plain(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "true", False: "false", None: "null"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)
