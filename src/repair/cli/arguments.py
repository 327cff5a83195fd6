"""Arguments that several verbs take, and the configuration they make."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.config import Config

__all__ = ["SOURCES", "configuration_arguments", "resolve"]

SOURCES = ("planner", "constant", "accelerate", "recorded")


class UsageError(RepairError):
    """The command line itself is wrong."""


# -- run -------------------------------------------------------------------------------------------


def configuration_arguments(parser: argparse.ArgumentParser) -> None:
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
    parser.add_argument(
        "--reference", metavar="SOURCE", help=f"{', '.join(SOURCES)}, or a CommonRoad solution file"
    )


def resolve(arguments: argparse.Namespace) -> Config:
    from repair.config import load_config

    overrides = [*_reference_overrides(arguments.reference), *arguments.overrides]
    return load_config(arguments.preset, arguments.config, overrides, backend=arguments.backend)


def _reference_overrides(reference: str | None) -> list[str]:
    if reference is None:
        return []
    if reference in SOURCES:
        return [f"reference.source={reference}"]
    if not Path(reference).is_file():
        raise UsageError(f"reference {reference!r} is neither one of {', '.join(SOURCES)} nor a file")
    # Quoted: a path may hold what YAML takes for something else.
    quoted = Path(reference).resolve().as_posix().replace("'", "''")
    return ["reference.source=file", f"reference.file='{quoted}'"]


# -- the small verbs -------------------------------------------------------------------------------


def no_arguments(parser: argparse.ArgumentParser) -> None:
    """Takes nothing."""
    del parser
