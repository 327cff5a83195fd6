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
from typing import Any, NoReturn

from repair.cli import info, paper, r157, run, scenarios, study, sweep, written
from repair.cli.arguments import UsageError, no_arguments, told
from repair.cli.loop import simulate
from repair.cli.streams import lenient, opened
from repair.errors import RepairError, in_words

__all__ = ["entry", "main", "parser"]


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence instead of printing the usage and ending the process."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see `{self.prog} --help`)")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """What is left over is an error of the verb it was given to: its help has the options."""
        found, left = self.parse_known_args(args, namespace)
        if left:
            verb = getattr(found, "verb", None)
            help_of = f"{self.prog} {verb}" if verb else self.prog
            raise UsageError(f"unrecognized arguments: {' '.join(left)} (see `{help_of} --help`)")
        return found


@dataclass(frozen=True)
class Verb:
    """One row of the dispatch table: heavy imports happen in ``run`` only."""

    name: str
    help: str
    arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


VERBS: tuple[Verb, ...] = (
    Verb("run", "repair one scenario: TTC, F-TTR, a checked trajectory", run.run_arguments, run.run),
    Verb("certify", "recompute every margin of a written result", written.certify_arguments, written.certify),
    Verb(
        "scenarios",
        "what files hold: ego, traffic, route, and what of the map was bridged",
        scenarios.scenarios_arguments,
        scenarios.scenarios,
    ),
    Verb("study", "repair many scenarios as a file says, resumable", study.study_arguments, study.study),
    Verb("report", "one page of HTML about a study or a result", written.report_arguments, written.report),
    Verb(
        "simulate",
        "drive among recorded traffic, and see when to leave the plan",
        simulate.simulate_arguments,
        simulate.simulate,
    ),
    Verb("animate", "a result as a film", written.animate_arguments, written.animate),
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
    Verb("r157", "UN R157's cut-in, cut-out and deceleration cases", r157.r157_arguments, r157.r157),
    Verb("backends", "list the backends, and what is missing", no_arguments, info.backends),
    Verb("presets", "list the bundled presets", no_arguments, info.presets),
    Verb("completion", "print what a shell needs to complete", info.completion_arguments, info.completion),
    Verb("config", "print the resolved configuration as YAML", info.config_arguments, info.config),
)


def parser() -> argparse.ArgumentParser:
    """All verbs with their options."""
    made = _Parser(prog="repair", description="Trajectory repair on CommonRoad scenarios.")
    made.add_argument("--version", action="store_true", help="print the version and exit")
    added = made.add_subparsers(dest="verb", metavar="VERB", title="verbs")
    for verb in VERBS:
        own = added.add_parser(
            verb.name, help=verb.help, description=verb.help[0].upper() + verb.help[1:] + "."
        )
        verb.arguments(own)
        own.add_argument(
            "-v", "--verbose", action="count", default=0,
            help="say on standard error what is done; -vv: each time-to-repair that is tried",
        )  # fmt: skip
        own.set_defaults(run=verb.run)
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; returns the exit status. Errors of the user's input end as one sentence on stderr."""
    with lenient():
        try:
            return _run(argv)
        except RepairError as error:
            print(f"repair: {' '.join(str(error).split())}", file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            print("repair: interrupted before anything was found", file=sys.stderr)
            return 130
        except BrokenPipeError:
            # The reader of our output left; what it wanted, it has. Python must not complain when it flushes.
            _abandon_stdout()
            return 0
        except OSError as error:
            if error.filename is not None:  # what is printed has no name, and what is saved is an OutputError
                raise
            _abandon_stdout()
            why = error.strerror or in_words(error)
            print(f"repair: standard output cannot be written: {why}", file=sys.stderr)
            return 2


def _run(argv: Sequence[str] | None) -> int:
    known = parser()
    arguments = known.parse_args(argv)
    if arguments.version:
        import repair

        print(f"commonroad-repair {repair.__version__}")
        return 0
    if arguments.verb is None:
        known.print_help()
        return 0
    arguments.parser = known
    told(arguments.verbose)
    try:
        status: int = arguments.run(arguments)
    except UsageError as error:
        text = str(error)
        text += "" if "--help" in text else f" (see `repair {arguments.verb} --help`)"
        raise UsageError(text) from None
    sys.stdout.flush()
    return status


def _abandon_stdout() -> None:
    """Let go of what standard output has not taken: it would be an error again when the interpreter ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def entry() -> NoReturn:
    """The console script: :func:`main` without the noise of third parties."""
    import logging
    import warnings

    opened()
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
        first = (str(error).splitlines() or [""])[0].encode("utf-8", "backslashreplace").decode()
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
