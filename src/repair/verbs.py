"""The verbs of the command ``repair``: their arguments, and what they do. Listed in :mod:`repair.cli`."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.errors import RepairError
from repair.scene.bundled import OFFICIAL_FILES, PAPER_SCENARIOS, find_scenario, paper_scenario

if TYPE_CHECKING:
    from repair.config import Config

_SOURCES = ("planner", "constant", "accelerate", "recorded")


class UsageError(RepairError):
    """The command line itself is wrong."""


# -- run -------------------------------------------------------------------------------------------


def _configuration_arguments(parser: argparse.ArgumentParser) -> None:
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
        "--reference", metavar="SOURCE", help=f"{', '.join(_SOURCES)}, or a CommonRoad solution file"
    )


def run_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair run``."""
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO.xml",
        help="CommonRoad file, also by its name in the folder COMMONROAD_SCENARIOS, or scenario_1 or "
        "scenario_2, the bundled reconstructions; by default the paper's Scenario 1, from the official file "
        f"{OFFICIAL_FILES['scenario_1']} where COMMONROAD_SCENARIOS has it, else reconstructed",
    )  # fmt: skip
    _configuration_arguments(parser)
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="write result.json, the solution file and figures"
    )
    parser.add_argument("--json", action="store_true", help="print what result.json holds, and nothing else")
    parser.add_argument("--no-figure", action="store_true", help="leave the figures out")


def _resolve(arguments: argparse.Namespace) -> Config:
    from repair.config import load_config

    overrides = [*_reference_overrides(arguments.reference), *arguments.overrides]
    return load_config(arguments.preset, arguments.config, overrides, backend=arguments.backend)


def _reference_overrides(reference: str | None) -> list[str]:
    if reference is None:
        return []
    if reference in _SOURCES:
        return [f"reference.source={reference}"]
    if not Path(reference).is_file():
        raise UsageError(f"reference {reference!r} is neither one of {', '.join(_SOURCES)} nor a file")
    # Quoted: a path may hold what YAML takes for something else.
    quoted = Path(reference).resolve().as_posix().replace("'", "''")
    return ["reference.source=file", f"reference.file='{quoted}'"]


@contextmanager
def _scenario(arguments: argparse.Namespace) -> Iterator[tuple[Path, Config]]:
    """The scenario's file and the configuration; the paper's scenarios come with their presets."""
    config = _resolve(arguments)
    name = arguments.scenario or config.scenario
    default = arguments.preset if arguments.preset in PAPER_SCENARIOS else PAPER_SCENARIOS[0]
    if arguments.preset is None and (name is None or name in PAPER_SCENARIOS):
        arguments.preset = name or default
        config = _resolve(arguments)
    with paper_scenario(default) if name is None else find_scenario(name) as path:
        yield path, config


class _Interrupts:
    """Remembers that Ctrl-C was pressed: the search swallows it and returns what it has."""

    def __init__(self) -> None:
        self.seen = False

    def __enter__(self) -> _Interrupts:
        def handler(number: int, frame: Any) -> None:
            self.seen = True
            raise KeyboardInterrupt

        try:
            self.before = signal.signal(signal.SIGINT, handler)
        except ValueError:  # not the main thread: whoever runs us handles it
            self.before = None
        return self

    def __exit__(self, *_: object) -> None:
        if self.before is not None:
            signal.signal(signal.SIGINT, self.before)


def run(arguments: argparse.Namespace) -> int:
    """One scenario; the result on stdout, and in files where a folder is given."""
    with _Interrupts() as interrupts, _scenario(arguments) as (path, config):
        from repair.api import repair
        from repair.export import saved, to_dict, to_json
        from repair.report.text import summary

        result = repair(path, config)
        content, problem = to_dict(result), None
        written: list[Path] = []
        if arguments.out is not None:
            try:
                content, written = saved(result, arguments.out, figure=not arguments.no_figure)
            except RepairError as error:
                problem = error
        if arguments.json:
            sys.stdout.write(to_json(content))
        else:
            print(summary(content, arguments.preset, written))
        if problem is not None:
            raise problem
        if interrupts.seen:
            print("repair: interrupted; what was found until then stands above", file=sys.stderr)
            return 130
    return 0


# -- certify, sweep, tables, figures ---------------------------------------------------------------


def certify_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair certify``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="what `repair run --out DIR` wrote")


def certify(arguments: argparse.Namespace) -> int:
    """Exit status 1 where a margin is violated."""
    from repair.certify import certify as recompute
    from repair.certify import format_certificate

    certificate = recompute(arguments.folder)
    print(format_certificate(certificate))
    return 0 if certificate.ok else 1


def sweep_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair sweep``."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="folder of CommonRoad files")
    parser.add_argument(
        "--backend", action="extend", nargs="+", metavar="NAME", help="one or more (default: ego)"
    )
    parser.add_argument(
        "--reference", action="extend", nargs="+", choices=_SOURCES, metavar="SOURCE",
        help=f"one or more of {', '.join(_SOURCES)} (default: planner)",
    )  # fmt: skip
    parser.add_argument("--preset", metavar="NAME")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides"
    )
    parser.add_argument("--out", metavar="DIR", type=Path, help="write sweep.csv and sweep.json")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="worker processes")
    parser.add_argument(
        "--timeout", type=float, default=300.0, metavar="S", help="wall time for one file [s]"
    )
    parser.add_argument("--report", metavar="FILE.md", type=Path, help="write a report of the rows")
    parser.add_argument(
        "--certify",
        action="store_true",
        help="recompute every margin from the written files, as `repair certify`",
    )
    parser.add_argument("--no-official", action="store_true", help="leave CommonRoad's own checker out")


def sweep(arguments: argparse.Namespace) -> int:
    """Every file, backend and reference; prints the rows as CSV where no folder is given."""
    from repair.study import COLUMNS, SweepSettings, write_sweep
    from repair.study import sweep as run_sweep

    settings = SweepSettings(
        backends=arguments.backend or ["ego"], references=arguments.reference or ["planner"],
        preset=arguments.preset, overrides=arguments.overrides, official=not arguments.no_official,
        certify=arguments.certify, timeout=arguments.timeout, jobs=arguments.jobs,
    )  # fmt: skip
    rows = run_sweep(arguments.folder, settings)
    if arguments.report is not None:
        from repair.files import write_files
        from repair.report.sweep import sweep_report

        chosen = (("backend", settings.backends), ("reference", settings.references))
        words = [f"--{k} {' '.join(v)}" for k, v in chosen]
        text = sweep_report(rows, f"repair sweep {arguments.folder.name} {' '.join(words)}")
        print(*write_files(arguments.report.parent, {arguments.report.name: text.encode()}))
    if arguments.out is None and arguments.report is None:
        import csv

        table = csv.DictWriter(sys.stdout, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    elif arguments.out is not None:
        for path in write_sweep(rows, arguments.out, settings, arguments.folder):
            print(path)
    return 0


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
    from repair.report import tables

    table = tables.table1(os.environ.get("COMMONROAD_SCENARIOS"), overrides=arguments.overrides)
    sys.stdout.write(getattr(table, f"to_{arguments.format}")())
    return 0


def table2(arguments: argparse.Namespace) -> int:
    """The paper's Table II on this machine."""
    from repair.report import tables
    from repair.report.timing import literal_transcription

    folder = os.environ.get("COMMONROAD_SCENARIOS")
    table = tables.table2(
        folder, runs=arguments.runs, literal=literal_transcription(), overrides=arguments.overrides
    )
    sys.stdout.write(getattr(table, f"to_{arguments.format}")())
    return 0


def sensitivity_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair sensitivity``."""
    parser.add_argument("scenario", choices=PAPER_SCENARIOS, help="one of the paper's scenarios")
    table1_arguments(parser)


def sensitivity(arguments: argparse.Namespace) -> int:
    """What the free choices do to TTC, F-TTR and peak acceleration."""
    from repair.report import sensitivity as report

    number = PAPER_SCENARIOS.index(arguments.scenario) + 1
    folder = os.environ.get("COMMONROAD_SCENARIOS")
    table = report.sensitivity(number, folder, overrides=arguments.overrides)
    sys.stdout.write(getattr(table, f"to_{arguments.format}")())
    return 0


def figures_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair figures``."""
    parser.add_argument("--backend", metavar="NAME", default="ego")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("figures"), help="default: figures")
    parser.add_argument("--format", choices=("png", "pdf", "svg"), default="png")


def figures(arguments: argparse.Namespace) -> int:
    """The paper's Figures 4, 5 and 6."""
    from repair.export import write_files
    from repair.report.figures import paper_figures

    for path in write_files(arguments.out, paper_figures(arguments.backend, arguments.format)):
        print(path)
    return 0


# -- the small verbs -------------------------------------------------------------------------------


def no_arguments(parser: argparse.ArgumentParser) -> None:
    """Takes nothing."""
    del parser


def backends(_: argparse.Namespace) -> int:
    """What there is, and why something is missing."""
    from repair.solvers.registry import available, describe

    for name, missing in available().items():
        print(f"{name:8} {describe(name)}" if missing is None else f"{name:8} not available: {missing}")
    return 0


def presets(_: argparse.Namespace) -> int:
    """Names and first words of the presets."""
    from repair.config import preset_names
    from repair.report.text import preset_summary

    for name in preset_names():
        print(f"{name:12} {preset_summary(name)}")
    return 0


def config_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair config``."""
    _configuration_arguments(parser)
    parser.add_argument(
        "--table", action="store_true", help="every key with its default and meaning, as Markdown"
    )


def config(arguments: argparse.Namespace) -> int:
    """The configuration as it would be used."""
    if arguments.table:
        from repair.report.text import key_table

        print(key_table())
        return 0
    from dataclasses import asdict

    import yaml

    print(yaml.safe_dump(asdict(_resolve(arguments)), sort_keys=False), end="")
    return 0
