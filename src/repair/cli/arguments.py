"""Arguments that several verbs take, and the configuration they make."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repair.errors import ConfigError, RepairError

if TYPE_CHECKING:
    from repair.config import Config
    from repair.report.style import FigureStyle

__all__ = [
    "UsageError", "configuration_arguments", "figure_arguments", "figure_style", "no_arguments", "resolve",
    "told",
]  # fmt: skip

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
        "--config", metavar="FILE", type=Path,
        help="YAML file, see `repair config` for the keys; or the result.json of a repair",
    )  # fmt: skip
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides",
        help="configuration keys, such as search.delta_t=0.1; the last word",
    )  # fmt: skip
    parser.add_argument("--reference", metavar="SOURCE", help=f"{_USUAL}, or a CommonRoad solution file")


def resolve(arguments: argparse.Namespace) -> Config:
    """The configuration that these arguments make."""
    from repair.config import load_config
    from repair.reference.registry import named

    try:
        given = {} if arguments.reference is None else named(arguments.reference)
    except ConfigError as error:
        raise UsageError(str(error)) from None
    plain = all(value.isprintable() for value in given.values())
    texts = [f"reference.{key}={_quoted(value)}" for key, value in given.items()] if plain else []
    return load_config(
        arguments.preset, arguments.config, [*texts, *arguments.overrides],
        backend=arguments.backend, reference=None if plain else given,
    )  # fmt: skip


def _quoted(text: str) -> str:
    """A text as YAML: a path may hold what that takes for something else."""
    return "'" + text.replace("'", "''") + "'"


def figure_arguments(parser: argparse.ArgumentParser) -> None:
    """``--format``, ``--width`` and ``--font-size``."""
    parser.add_argument("--format", choices=("png", "pdf", "svg"), help="of the figures (default: png)")
    parser.add_argument("--width", type=float, metavar="IN", help="of the figures, in inches (default: 8)")
    parser.add_argument("--font-size", type=float, metavar="PT", help="in the figures (default: 9.5)")


def figure_style(arguments: argparse.Namespace) -> FigureStyle | None:
    """How figures are to be written; None where nothing is said of it."""
    from repair.report.style import FigureStyle

    names = ("format", "width", "font_size")
    said = {name: value for name in names if (value := getattr(arguments, name)) is not None}
    return FigureStyle(**said) if said else None


def no_arguments(parser: argparse.ArgumentParser) -> None:
    """Takes nothing."""
    del parser


def told(verbose: int) -> None:
    """Let the loggers of ``repair`` write to standard error: once what is done, twice each probe as well."""
    if not verbose:
        return
    import logging

    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(name)s: %(message)s"))
    logger = logging.getLogger("repair")
    logger.handlers = [handler]  # one, however often the command is run in this process
    logger.setLevel(logging.DEBUG if verbose > 1 else logging.INFO)
