"""``repair backends``, ``presets``, ``config``."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from repair.cli.arguments import configuration_arguments, resolve

if TYPE_CHECKING:
    pass


def backends(_: argparse.Namespace) -> int:
    """What there is, and why something is missing."""
    from repair.solvers.registry import available, describe

    for name, missing in available().items():
        print(f"{name:8} {describe(name)}" if missing is None else f"{name:8} not available: {missing}")
    return 0


def presets(_: argparse.Namespace) -> int:
    """Names and first words of the presets."""
    from repair.config.load import preset_names
    from repair.report.keys import preset_summary

    for name in preset_names():
        print(f"{name:12} {preset_summary(name)}")
    return 0


def config_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair config``."""
    configuration_arguments(parser)
    parser.add_argument(
        "--table", action="store_true", help="every key with its default and meaning, as Markdown"
    )


def config(arguments: argparse.Namespace) -> int:
    """The configuration as it would be used."""
    if arguments.table:
        from repair.report.keys import key_table

        print(key_table())
        return 0
    import yaml

    print(yaml.safe_dump(resolve(arguments).to_dict(), sort_keys=False), end="")
    return 0
