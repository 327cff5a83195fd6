"""Arguments that several verbs take, and the configuration they make."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.config import Config

__all__ = ["UsageError", "configuration_arguments", "no_arguments", "resolve"]

# For --help alone, which loads no registry; `repair config --table` lists what is registered too.
_USUAL = "planner, constant, accelerate, recorded"


class UsageError(RepairError):
    """The command line itself is wrong."""


def configuration_arguments(parser: argparse.ArgumentParser) -> None:
    """``--backend``, ``--preset``, ``--config``, ``--set`` and ``--reference``."""
    parser.add_argument(
        "--backend", metavar="NAME", help="ego (default), casadi, qptr; see `repair backends`"
    )
    parser.add_argument("--preset", metavar="NAME", help="a published setting; see `repair presets`")
    parser.add_argument(
        "--config", metavar="FILE", type=Path, help="YAML file; see `repair config` for the keys"
    )
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides",
        help="configuration keys, such as search.delta_t=0.1; the last word",
    )  # fmt: skip
    parser.add_argument("--reference", metavar="SOURCE", help=f"{_USUAL}, or a CommonRoad solution file")


def resolve(arguments: argparse.Namespace) -> Config:
    """The configuration that these arguments make."""
    from repair.config import load_config
    from repair.reference.registry import named

    given = {} if arguments.reference is None else named(arguments.reference)
    plain = all(value.isprintable() for value in given.values())
    texts = [f"reference.{key}={_quoted(value)}" for key, value in given.items()] if plain else []
    return load_config(
        arguments.preset, arguments.config, [*texts, *arguments.overrides],
        backend=arguments.backend, reference=None if plain else given,
    )  # fmt: skip


def _quoted(text: str) -> str:
    """A text as YAML: a path may hold what that takes for something else."""
    return "'" + text.replace("'", "''") + "'"


def no_arguments(parser: argparse.ArgumentParser) -> None:
    """Takes nothing."""
    del parser
