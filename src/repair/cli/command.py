"""The command ``repair``: which verbs there are, exit statuses, and what becomes of errors.

Exit status: 0 for every computed answer (also "no repair exists"), 1 where a verb says no (a certificate
that fails) or something inside broke, 2 for input that cannot be used, 130 after Ctrl-C.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NoReturn

from repair.cli import certify, info, paper, run, sweep
from repair.cli.arguments import UsageError, no_arguments
from repair.errors import RepairError

__all__ = ["entry", "main"]


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


VERBS: tuple[Verb, ...] = (
    Verb("run", "repair one scenario: TTC, F-TTR, a checked trajectory", run.run_arguments, run.run),
    Verb("certify", "recompute every margin of a written result", certify.certify_arguments, certify.certify),
    Verb("sweep", "repair all scenarios of a folder", sweep.sweep_arguments, sweep.sweep),
    Verb("table1", "the paper's Table I, paper and ours", paper.table1_arguments, paper.table1),
    Verb("table2", "the paper's Table II, times on this machine", paper.table2_arguments, paper.table2),
    Verb(
        "sensitivity",
        "what the paper's free choices do to F-TTR and peaks",
        paper.sensitivity_arguments,
        paper.sensitivity,
    ),
    Verb("figures", "draw the paper's Figures 4, 5 and 6", paper.figures_arguments, paper.figures),
    Verb("backends", "list the backends, and what is missing", no_arguments, info.backends),
    Verb("presets", "list the bundled presets", no_arguments, info.presets),
    Verb("config", "print the resolved configuration as YAML", info.config_arguments, info.config),
)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="repair", description="Trajectory repair on CommonRoad scenarios.")
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    added = parser.add_subparsers(dest="verb", metavar="VERB", title="verbs")
    for verb in VERBS:
        own = added.add_parser(
            verb.name, help=verb.help, description=verb.help[0].upper() + verb.help[1:] + "."
        )
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
            f"repair: internal error ({type(error).__name__}: {first}); this is a defect of the program, "
            "please report it; REPAIR_DEBUG=1 shows where it happened",
            file=sys.stderr,
        )
        status = 1
    sys.stderr.flush()
    # pycrcc's binding layer reports its own leaks when the interpreter ends.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    sys.exit(status)
