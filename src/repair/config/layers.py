"""Layers of the configuration: read, laid over each other, and what is wrong with them."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from repair.errors import ConfigError, in_words, kind_of

__all__ = ["Layer", "dotted", "explain", "lay_over", "read_yaml", "require_sections", "result_in"]


class Layer(NamedTuple):
    """One layer: what it is called in sentences, and its OmegaConf node."""

    name: str
    node: Any


def read_yaml(path: Path) -> Any:
    """A YAML file as a node.

    Raises
    ------
    ConfigError
        If it is not there, cannot be read, or holds no mapping.
    """
    from omegaconf import DictConfig, OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    try:
        layer = OmegaConf.load(path)
    except FileNotFoundError as error:
        raise ConfigError(f"configuration file {path} does not exist") from error
    except (OSError, YAMLError, OmegaConfBaseException, ValueError, RecursionError) as error:
        cause = " ".join(str(error).split())[:200] or type(error).__name__
        raise ConfigError(f"configuration file {path} cannot be read: {cause}") from error
    if not isinstance(layer, DictConfig):
        raise ConfigError(f"configuration file {path} must hold a mapping of keys")
    return layer


def result_in(path: Path) -> Mapping[str, Any] | None:
    """What a JSON file holds, where that is the result of a repair; None where it is anything else."""
    if path.suffix != ".json":
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None  # what is wrong with it is said where it is read as settings
    known = isinstance(content, dict) and "status" in content and isinstance(content.get("config"), dict)
    return content if known else None


def dotted(overrides: Iterable[str] | Mapping[str, Any]) -> Any:
    """``key=value`` texts, or a mapping of dotted keys, as a node.

    Raises
    ------
    ConfigError
        Naming what cannot be read.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    if isinstance(overrides, Mapping):
        layer = OmegaConf.create()
        for key, value in overrides.items():
            try:
                OmegaConf.update(layer, key, _plain(value))
            except (OmegaConfBaseException, ValueError, TypeError, AttributeError, RecursionError) as error:
                raise ConfigError(
                    f"overrides: configuration key {in_words(key)} is {in_words(value)}: {_first_line(error)}"
                ) from error
        return layer
    if isinstance(overrides, (str, bytes)):
        raise ConfigError(
            f"overrides are {in_words(overrides)}; they have to be a list of key=value texts, or a mapping"
        )
    try:
        items = list(overrides)
    except TypeError as error:
        raise ConfigError(
            f"overrides are {kind_of(overrides)}; they have to be a list of key=value texts, or a mapping"
        ) from error
    for item in items:
        if not isinstance(item, str) or "=" not in item or not item.split("=", 1)[0].strip():
            raise ConfigError(f"override {in_words(item)} must have the form key=value")
    try:
        return OmegaConf.from_dotlist(items)
    except (OmegaConfBaseException, YAMLError, ValueError, TypeError, RecursionError) as error:
        raise ConfigError(f"overrides {in_words(items)} cannot be read: {_first_line(error)}") from error


def _plain(value: Any) -> Any:
    """NumPy's scalars and arrays as Python's own numbers and lists; OmegaConf refuses them."""
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    if type(value).__module__ == "numpy" and hasattr(value, "tolist"):
        return value.tolist()
    return value


def require_sections(layer: Layer, schema: Any, prefix: str = "", node: Any = None) -> None:
    """Refuse a plain value where the schema has a section: OmegaConf's own error does not name the key."""
    from omegaconf import DictConfig

    node = layer.node if node is None else node
    for key in node:
        expected = schema._get_node(key) if key in schema else None
        if isinstance(expected, DictConfig):
            value = node._get_node(key)
            if not isinstance(value, DictConfig) or value._is_none():
                shown = "empty" if value._is_none() else _short(str(value))
                named = f"{layer.name}: configuration key '{prefix}{key}' is {shown}"
                raise ConfigError(f"{named}; it must hold a mapping of keys")
            if not value._is_interpolation():
                require_sections(layer, expected, f"{prefix}{key}.", value)


def lay_over(name: str, base: Any, *nodes: Any, known: Callable[[], Collection[str]]) -> None:
    """Lay nodes over a node, which is changed: to copy it each time is most of what a configuration costs.

    Parameters
    ----------
    name : str
        Of the layer, for what is said if it does not fit.
    base : DictConfig
    *nodes : DictConfig
    known : callable
        Gives the keys that there are.

    Raises
    ------
    ConfigError
        In the name of the layer, naming the key.
    """
    from omegaconf.errors import OmegaConfBaseException

    try:
        base.merge_with(*nodes)
    except (OmegaConfBaseException, ValueError, TypeError, ArithmeticError, RecursionError) as error:
        raise ConfigError(explain(name, error, known())) from error


def explain(layer: str, error: Exception, known: Collection[str]) -> str:
    """OmegaConf's error as a sentence about a key."""
    key = getattr(error, "full_key", None) or ""
    message = _first_line(error).rstrip(".")
    if "not in" in message and key:
        import difflib

        close = difflib.get_close_matches(key, sorted(known), n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        if key in known:  # in a file its parts are sections
            hint = "; write each part of the name as a mapping of its own"
        return f"{layer}: there is no configuration key {in_words(key)}{hint}"
    return f"{layer}: configuration key {key!r}: {message}" if key else f"{layer}: {message}"


def _first_line(error: Exception) -> str:
    """What a foreign error says first."""
    return _short((str(error).splitlines() or [""])[0]) or type(error).__name__


def _short(text: str, most: int = 200) -> str:
    return text if len(text) <= most else f"{text[:most]}..."
