"""Presets, files and overrides resolved into a configuration. Unknown keys and wrong types are errors.

Later layers win: defaults < preset < file < ``key=value`` overrides < the ``for_backend`` section of the
chosen backend. A preset uses ``for_backend`` where a published setting belongs to one backend only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from copy import deepcopy
from functools import reduce
from pathlib import Path
from typing import Any

from repair.config.layers import Layer, dotted, explain, lay_over, read_yaml, require_sections, result_in
from repair.config.schema import Config, configuration_keys, key_names, schema, values_of, words_of
from repair.errors import ConfigError, in_words, path_of
from repair.settings import require_sane

__all__ = ["RETIRED", "load_config", "preset_names", "preset_path", "recorded_config"]

_PRESETS = Path(__file__).with_name("presets")
#: Keys that earlier versions wrote into result files, and that never had an effect.
RETIRED = frozenset({"seed"})


def preset_names() -> tuple[str, ...]:
    """Names of the bundled presets."""
    return tuple(sorted(p.stem for p in _PRESETS.glob("*.yaml")))


def preset_path(name: str) -> Path:
    """The file of a bundled preset.

    Raises
    ------
    ConfigError
        If there is none of that name; the sentence lists those that there are.
    """
    if not isinstance(name, str) or name not in preset_names():
        raise ConfigError(f"preset {in_words(name)} is unknown; there are {', '.join(preset_names())}")
    return _PRESETS / f"{name}.yaml"


def load_config(
    preset: str | None = None,
    file: str | Path | None = None,
    overrides: Iterable[str] | Mapping[str, Any] = (),
    **named: Any,
) -> Config:
    """Resolve a configuration.

    Parameters
    ----------
    preset : str, optional
        Name of a bundled preset (see :func:`preset_names`).
    file : path, optional
        YAML file of the same schema, or the ``result.json`` of a repair: the settings that it was made with.
    overrides : iterable of ``"key=value"`` or mapping of dotted keys
        Last word on everything except what ``for_backend`` says.
    **named
        Top-level keys (``backend="casadi"``).

    Returns
    -------
    Config

    Raises
    ------
    ConfigError
        Naming the key, what it got and what it expects.
    """
    layers: list[Layer] = []
    given = frozenset[str]()
    if preset is not None:
        layers.append(Layer(f"preset {preset}", read_yaml(preset_path(preset))))
    if file is not None:
        path = path_of(file, "a configuration file", ConfigError)
        record = result_in(path)
        node = read_yaml(path) if record is None else _recorded(record["config"])
        given = _given_of(record or {})
        if record is not None and preset is not None:
            raise ConfigError(f"preset {preset!r} has no effect: the result {path} holds every key")
        layers.append(Layer(str(path), node))
    own = [Layer("overrides", dotted(overrides)), Layer("overrides", dotted(_named(named)))]
    config = _resolved(layers, own)
    config.given |= given
    _require_effect(config)
    return config


def recorded_config(record: Mapping[str, Any]) -> Config:
    """The configuration that a result was made with, in this version or an earlier one.

    Parameters
    ----------
    record : mapping
        What ``result.json`` holds: ``config``, and ``config_given``, the keys that were set on purpose.

    Raises
    ------
    ConfigError
        Naming a key that there is not any more, or its value.
    """
    config = _resolved([Layer("the configuration of the result", _recorded(record["config"]))], [])
    config.given = _given_of(record)
    return config


def _recorded(values: Mapping[str, Any]) -> Any:
    """The configuration of a result as a node."""
    return dotted({key: value for key, value in values.items() if key not in RETIRED})


def _given_of(record: Mapping[str, Any]) -> frozenset[str]:
    """The keys that were set on purpose when a result was made; earlier versions did not say."""
    given = record.get("config_given")
    return frozenset(map(str, given)) if isinstance(given, list) else frozenset()


def _resolved(layers: list[Layer], own: list[Layer]) -> Config:
    """Layers laid over each other, those that the user gave on purpose last."""
    from omegaconf import OmegaConf

    keys = schema()
    for layer in (*layers, *own):
        require_sections(layer, keys)
    found = deepcopy(keys)
    for layer in (*layers, *own):
        if layer.node:
            lay_over(layer.name, found, layer.node, known=key_names)
    _with_backend_section(found, own)
    config = _validated(found)
    config.given = frozenset(name for layer in own for name in _leaves(OmegaConf.to_container(layer.node)))
    return config


def _named(keys: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in keys.items() if value is not None}


def _leaves(node: Any, prefix: str = "") -> Iterator[str]:
    """Dotted names of everything in nested mappings that is no mapping."""
    for name, value in node.items():
        if isinstance(value, Mapping) and prefix + name != "for_backend":
            yield from _leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def _with_backend_section(found: Any, explicit: list[Layer]) -> None:
    """Lay ``for_backend.<backend>`` over the rest, and what the user said explicitly over that."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    try:
        section = found.for_backend.get(found.backend)
    except OmegaConfBaseException as error:  # an interpolation that leads nowhere
        raise ConfigError(explain("configuration", error, key_names())) from error
    found.for_backend = {}
    if section is None:
        return
    name = f"for_backend.{found.backend}"
    if not OmegaConf.is_dict(section):
        raise ConfigError(f"configuration key {name!r} is {section!r}; it must hold a mapping of keys")
    require_sections(Layer(name, section), schema())
    lay_over(name, found, section, *(layer.node for layer in explicit), known=key_names)


def _validated(found: Any) -> Config:
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    try:
        config: Any = OmegaConf.to_object(found)
    except OmegaConfBaseException as error:
        raise ConfigError(explain("configuration", error, key_names())) from error
    for key, value in zip(configuration_keys(), values_of(config).values(), strict=True):
        words = words_of(key)
        if value == "False" and "off" in (words or ()):  # YAML reads a bare `off` as false
            value, (*sections, name) = "off", key.name.split(".")
            setattr(reduce(getattr, sections, config), name, value)
        require_sane(key, value, words)
    assert isinstance(config, Config)
    return config


def _require_effect(config: Config) -> None:
    """Refuse what names something that is then not looked at; the rest of it becomes notes.

    Raises
    ------
    ConfigError
        If ``reference.file`` or ``reference.obstacle_id`` is set for a source that takes none.
    """
    for key, other, value in config.without_effect():
        if key in ("reference.file", "reference.obstacle_id") and values_of(config)[key] is not None:
            raise ConfigError(
                f"configuration key {key!r} has no effect with {other}={value}; take it out, or set {other}"
            )
