"""The configuration as it is with what is handed over beside it: a scene, or a reference."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from repair.config.schema import Config
from repair.errors import ConfigError, in_words
from repair.reference.registry import named
from repair.scene.settings import LOADING, SceneConfig

if TYPE_CHECKING:
    from repair.scene.scene import Scene

__all__ = ["agreed_with", "with_given", "with_named"]


def with_given(config: Config) -> Config:
    """The configuration as it is where the reference is handed over.

    Raises
    ------
    ConfigError
        If it names another source on purpose.
    """
    source = config.reference.source
    if source != "given" and "reference.source" in config.given:
        raise ConfigError(f"a reference is given, and reference.source={source} names another; leave one out")
    agreed = replace(config, reference=replace(config.reference, source="given"))
    agreed.given = config.given
    return agreed


def with_named(config: Config, reference: str) -> Config:
    """The configuration with a source of references, or a solution file, by its name.

    Raises
    ------
    ConfigError
        If it is neither, or the configuration names another one on purpose.
    """
    keys = named(reference)
    source = config.reference.source
    if source != keys["source"] and "reference.source" in config.given:
        raise ConfigError(
            f"the reference is to be {in_words(reference)}, and reference.source={source} names another; "
            "leave one out"
        )
    chosen = replace(config.reference, source=keys["source"], file=keys.get("file"))
    agreed = replace(config, reference=chosen)
    agreed.given = config.given | {f"reference.{key}" for key in keys}
    return agreed


def agreed_with(config: Config, scene: Scene) -> Config:
    """The configuration with what the scene was loaded with.

    Raises
    ------
    ConfigError
        If it asks for something else.
    """
    usual, loaded = SceneConfig(), scene.settings
    for name in LOADING:
        asked, has = getattr(config.scene, name), getattr(loaded, name)
        same = asked == has or (name == "planning_problem" and asked == scene.planning_problem_id)
        if not same and (f"scene.{name}" in config.given or asked != getattr(usual, name)):
            raise ConfigError(
                f"the scene was loaded with scene.{name}={has}, and the configuration asks for {asked}; "
                "load it with the configuration: repair.load_scene(path, config)"
            )
    if all(getattr(config.scene, name) == getattr(loaded, name) for name in LOADING):
        return config
    agreed = replace(config, scene=replace(config.scene, **{name: getattr(loaded, name) for name in LOADING}))
    agreed.given = config.given
    return agreed
