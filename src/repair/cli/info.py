"""``repair backends``, ``presets``, ``config``, ``completion``."""

from __future__ import annotations

import argparse
from pathlib import Path

from repair.cli.arguments import configuration_arguments, resolve
from repair.errors import RepairError


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


def completion_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair completion``."""
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="whose script is printed")


def completion(arguments: argparse.Namespace) -> int:
    """The script that completes verbs, options and files; made by shtab from the parser itself."""
    try:
        import shtab
    except ImportError as error:
        raise RepairError("completion needs shtab: pip install shtab") from error
    known: argparse.ArgumentParser = arguments.parser
    for verbs in (one for one in known._actions if isinstance(one, argparse._SubParsersAction)):
        for action in (one for own in verbs.choices.values() for one in own._actions):
            if action.type is Path or action.dest == "scenario":
                action.complete = shtab.FILE
    print(shtab.complete(known, arguments.shell))
    return 0
