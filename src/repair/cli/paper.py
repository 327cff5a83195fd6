"""``repair table1``, ``table2``, ``sensitivity``, ``figures``: the paper's own."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from repair.cli.arguments import figure_arguments, figure_style
from repair.paper.bundled import PAPER_SCENARIOS


def table1_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair table1``."""
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides"
    )
    parser.add_argument("--format", choices=("markdown", "json", "latex"), default="markdown")


def table2_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair table2``."""
    table1_arguments(parser)
    parser.add_argument("--runs", type=int, default=100, metavar="N", help="timed searches (default: 100)")


def table1(arguments: argparse.Namespace) -> int:
    """The paper's Table I, and rows that it does not have."""
    from repair.paper import table1 as tables

    table = tables.table1(os.environ.get("COMMONROAD_SCENARIOS"), overrides=arguments.overrides)
    sys.stdout.write(getattr(table, f"to_{arguments.format}")())
    return 0


def table2(arguments: argparse.Namespace) -> int:
    """The paper's Table II on this machine."""
    from repair.paper.table2 import literal_transcription
    from repair.paper.table2 import table2 as timed

    folder = os.environ.get("COMMONROAD_SCENARIOS")
    table = timed(folder, runs=arguments.runs, literal=literal_transcription(), overrides=arguments.overrides)
    sys.stdout.write(getattr(table, f"to_{arguments.format}")())
    return 0


def sensitivity_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair sensitivity``."""
    parser.add_argument("scenario", choices=PAPER_SCENARIOS, help="one of the paper's scenarios")
    table1_arguments(parser)


def sensitivity(arguments: argparse.Namespace) -> int:
    """What the free choices do to TTC, F-TTR and peak acceleration."""
    from repair.paper import sensitivity as report

    number = PAPER_SCENARIOS.index(arguments.scenario) + 1
    folder = os.environ.get("COMMONROAD_SCENARIOS")
    table = report.sensitivity(number, folder, overrides=arguments.overrides)
    sys.stdout.write(getattr(table, f"to_{arguments.format}")())
    return 0


def figures_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair figures``."""
    parser.add_argument("--backend", metavar="NAME", default="ego")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("figures"), help="default: figures")
    figure_arguments(parser)


def figures(arguments: argparse.Namespace) -> int:
    """The paper's Figures 4, 5 and 6."""
    from repair.io.destination import require_folder
    from repair.io.files import write_files
    from repair.paper.figures import paper_figures

    require_folder(arguments.out)
    for path in write_files(arguments.out, paper_figures(arguments.backend, figure_style(arguments))):
        print(path)
    return 0
