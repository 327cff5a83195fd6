"""The command ``repair``: verbs, arguments, exit statuses. What it prints is made in ``repair.report.text``.

Exit status: 0 for every computed answer (also "no repair exists"), 1 where a verb says no (a certificate
that fails) or something inside broke, 2 for input that cannot be used, 130 after Ctrl-C.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from repair.errors import RepairError

if TYPE_CHECKING:
    from repair.config import Config

__all__ = ["entry", "main"]

OFFICIAL_FILE = "DEU_Flensburg-6_1_T-1.xml"
BUNDLED = "scenario_1"  # name of the reconstruction and of its preset
_SOURCES = ("planner", "constant", "accelerate", "recorded")


class UsageError(RepairError):
    """The command line itself is wrong."""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the usage and ending the process."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see `{self.prog} --help`)")


@dataclass(frozen=True)
class Verb:
    """One row of the dispatch table: heavy imports happen in ``run`` only."""

    name: str
    help: str
    arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


# -- run -------------------------------------------------------------------------------------------


def _configuration_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--backend", metavar="NAME", help="ego (default), casadi, qptr; see `repair backends`")
    parser.add_argument("--preset", metavar="NAME", help="a published setting; see `repair presets`")
    parser.add_argument("--config", metavar="FILE", type=Path, help="YAML file; see `repair config` for the keys")
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides",
        help="configuration keys, such as search.delta_t=0.1; the last word",
    )  # fmt: skip
    parser.add_argument(
        "--reference", metavar="SOURCE", help=f"{', '.join(_SOURCES)}, or a CommonRoad solution file"
    )


def _run_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO.xml",
        help="CommonRoad file, also by its name in COMMONROAD_SCENARIOS; by default the paper's Scenario 1: "
        f"{OFFICIAL_FILE} where COMMONROAD_SCENARIOS has it, else a bundled reconstruction",
    )  # fmt: skip
    _configuration_arguments(parser)
    parser.add_argument("--out", metavar="DIR", type=Path, help="write result.json, the solution file and figures")
    parser.add_argument("--json", action="store_true", help="print what result.json holds, and nothing else")
    parser.add_argument("--no-figure", action="store_true", help="leave the figures out")


def _resolve(arguments: argparse.Namespace, **more: Any) -> Config:
    from repair.config import load_config

    overrides = [*_reference_overrides(arguments.reference), *arguments.overrides]
    keys = {"preset": arguments.preset, "file": arguments.config, "overrides": overrides, "backend": arguments.backend}
    return load_config(**{**keys, **more})


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


def _find(name: str) -> Path:
    """A scenario file by its path, or by its name in the folder COMMONROAD_SCENARIOS."""
    path, folder = Path(name), os.environ.get("COMMONROAD_SCENARIOS")
    if path.is_file() or path.is_absolute():
        return path
    if folder:
        for candidate in (Path(folder) / name, Path(folder) / f"{name}.xml"):
            if candidate.is_file():
                return candidate
        if path.is_dir():
            return path
        raise UsageError(f"{name}: no such file, neither here nor in COMMONROAD_SCENARIOS={folder}")
    return path


@contextmanager
def _default_scenario() -> Iterator[Path]:
    """The official file of Scenario 1 where there is one, else its reconstruction, generated on the spot."""
    folder = os.environ.get("COMMONROAD_SCENARIOS")
    if folder and (Path(folder) / OFFICIAL_FILE).is_file():
        yield Path(folder) / OFFICIAL_FILE
        return
    from repair.scene.synthetic import write_scenario

    with tempfile.TemporaryDirectory(prefix="repair-") as aside:
        yield Path(write_scenario(BUNDLED, Path(aside)))


@contextmanager
def _scenario(arguments: argparse.Namespace) -> Iterator[tuple[Path, Config]]:
    config = _resolve(arguments)
    name = arguments.scenario or config.scenario
    if name is not None:
        yield _find(name), config
        return
    if arguments.preset is None:
        config = _resolve(arguments, preset=BUNDLED)
        arguments.preset = BUNDLED
    with _default_scenario() as path:
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


def _run(arguments: argparse.Namespace) -> int:
    with _Interrupts() as interrupts, _scenario(arguments) as (path, config):
        from repair.api import repair
        from repair.export import saved, to_dict, to_json
        from repair.report.text import summary

        result = repair(path, config)
        content, problem, written = to_dict(result), None, []
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


# -- the small verbs -------------------------------------------------------------------------------


def _no_arguments(parser: argparse.ArgumentParser) -> None:
    del parser


def _backends(_: argparse.Namespace) -> int:
    from repair.solvers.registry import available, describe

    for name, missing in available().items():
        print(f"{name:8} {describe(name)}" if missing is None else f"{name:8} not available: {missing}")
    return 0


def _presets(_: argparse.Namespace) -> int:
    from repair.config import preset_names
    from repair.report.text import preset_summary

    for name in preset_names():
        print(f"{name:12} {preset_summary(name)}")
    return 0


def _config_arguments(parser: argparse.ArgumentParser) -> None:
    _configuration_arguments(parser)
    parser.add_argument("--table", action="store_true", help="every key with its default and meaning, as Markdown")


def _config(arguments: argparse.Namespace) -> int:
    if arguments.table:
        from repair.report.text import key_table

        print(key_table())
        return 0
    from dataclasses import asdict

    import yaml

    print(yaml.safe_dump(asdict(_resolve(arguments)), sort_keys=False), end="")
    return 0


VERBS: tuple[Verb, ...] = (
    Verb("run", "repair one scenario: TTC, F-TTR, a checked trajectory", _run_arguments, _run),
    Verb("backends", "list the backends, and what is missing", _no_arguments, _backends),
    Verb("presets", "list the bundled presets", _no_arguments, _presets),
    Verb("config", "print the resolved configuration as YAML", _config_arguments, _config),
)


# -- entry -----------------------------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="repair", description="Trajectory repair on CommonRoad scenarios.")
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", title="verbs")
    for verb in VERBS:
        own = verbs.add_parser(verb.name, help=verb.help, description=verb.help[0].upper() + verb.help[1:] + ".")
        verb.arguments(own)
        own.set_defaults(run=verb.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit status. Errors of the user's input end as one sentence on stderr."""
    try:
        parser = _parser()
        arguments = parser.parse_args(argv)
        if arguments.version:
            import repair

            print(f"commonroad-repair {repair.__version__}")
            return 0
        if arguments.verb is None:
            parser.print_help()
            return 0
        status: int = arguments.run(arguments)
        sys.stdout.flush()
        return status
    except RepairError as error:
        print(f"repair: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("repair: interrupted before anything was found", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of our output left; what it wanted, it has. Python must not complain when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def entry() -> NoReturn:
    """The console script: :func:`main` without the noise of third parties."""
    import logging
    import warnings

    os.environ.setdefault("OMP_NUM_THREADS", "1")  # more threads slow small dense algebra down
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    logging.getLogger().addHandler(logging.NullHandler())
    try:
        status = main()
    except Exception as error:
        if os.environ.get("REPAIR_DEBUG"):
            raise
        first = (str(error).splitlines() or [""])[0]
        print(
            f"repair: internal error ({type(error).__name__}: {first}); this is a defect of the program, please "
            "report it; REPAIR_DEBUG=1 shows where it happened",
            file=sys.stderr,
        )
        status = 1
    sys.stderr.flush()
    # pycrcc's binding layer reports its own leaks when the interpreter ends.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    sys.exit(status)
