"""Before the first cycle: who may be asked is there, and what nobody will ask is known."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

from repair.api import make
from repair.backend.base import RepairBackend
from repair.config.load import load_config
from repair.config.schema import Config, require_types, wanted_beside
from repair.errors import BackendError, ConfigError, kind_of
from repair.solvers.registry import BACKENDS
from repair.vehicle.commonroad_ks import load_official

__all__ = ["configured", "made_ready", "not_asked"]


def configured(config: Config | None, keys: Mapping[str, Any]) -> Config:
    """The configuration of a Repairer, given as one or by its keys.

    Raises
    ------
    ConfigError
        If it is both, none, or no search for the F-TTR.

    Returns
    -------
    Config
        As it is in cycles.
    """
    if config is not None and keys:
        raise ConfigError("give either a config or configuration keys, not both")
    config = load_config(**keys) if config is None else config
    if not isinstance(config, Config):
        raise ConfigError(f"config has to come from repair.load_config, and is {kind_of(config)}")
    if config.driver != "f_ttr":
        raise ConfigError(f"a Repairer searches for the F-TTR; driver={config.driver} has no effect here")
    require_types(config)
    return _of_cycles(config)


def _of_cycles(config: Config) -> Config:
    """No helpers where none are named: they find later repairs, and one takes longer than a cycle has."""
    there = {item.name for item in fields(config)}  # not those that were registered after it was made
    asking = {name: spec.helpers for name, spec in BACKENDS.items() if isinstance(spec.helpers, str)}
    sections = {
        name: replace(config.section(name), **{key: []})
        for name, key in asking.items()
        if name in there and getattr(config.section(name), key) is None
    }
    made = replace(config, **sections)
    made.given = config.given
    return made


def not_asked(config: Config) -> tuple[str, ...]:
    """Notes of what is wanted and belongs to no cycle."""
    return tuple(
        f"{key} has no effect in a Repairer; repair.repair with the same plan looks at it"
        for key in wanted_beside(config)
    )


def made_ready(config: Config) -> RepairBackend:
    """The backend, with its members, helpers and fallbacks made and what they need imported.

    All of that is made when it is first asked for otherwise, which may be within a deadline.

    Raises
    ------
    BackendError
        If the backend cannot be made.
    """
    made = make(config)
    can = made.capabilities
    _with_helpers(made)
    for others in (can.members, can.fallbacks):
        found = {} if others is None else others()
        for name in found:
            with suppress(BackendError):  # one that cannot be made is an error when it is asked
                _with_helpers(found[name])
    load_official()
    return made


def _with_helpers(backend: RepairBackend) -> None:
    for helper in backend.capabilities.helpers.values():
        with suppress(BackendError):
            helper()
