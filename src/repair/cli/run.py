"""``repair run``."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repair.cli.arguments import (
    UsageError,
    configuration_arguments,
    figure_arguments,
    figure_style,
    resolve,
)
from repair.cli.streams import as_json
from repair.errors import RepairError
from repair.paper.bundled import (
    OFFICIAL_FILES,
    PAPER_SCENARIOS,
    find_scenario,
    paper_scenario,
    reconstruction_by,
)

if TYPE_CHECKING:
    from repair.config import Config


def run_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair run``."""
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO.xml",
        help="CommonRoad file, also by its name in the folder COMMONROAD_SCENARIOS, or scenario_1 or "
        "scenario_2, the bundled reconstructions; by default the paper's Scenario 1, from the official file "
        f"{OFFICIAL_FILES['scenario_1']} where COMMONROAD_SCENARIOS has it, else reconstructed",
    )  # fmt: skip
    configuration_arguments(parser)
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="write result.json, the solution file and figures"
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--json", action="store_true", help="print what result.json holds, and nothing else")
    how.add_argument(
        "-q", "--quiet", action="store_true", help="print the answer alone: no table, times, notes"
    )
    parser.add_argument(
        "--bound", action="store_true", help="prove from when on nothing avoids the conflict any more"
    )
    parser.add_argument(
        "--explain", action="store_true",
        help="say what is in the way of a repair, or of a later one, and the least that would help",
    )  # fmt: skip
    parser.add_argument(
        "--mitigate", action="store_true",
        help="where nothing is found: prove that nothing can be, and look for the least impact speed",
    )  # fmt: skip
    parser.add_argument(
        "--to-goal", action="store_true", help="go on until the planning problem's goal is reached"
    )
    parser.add_argument(
        "--trace", action="store_true", help="with --out: also drawtonomy's planning trace and verdict"
    )
    parser.add_argument("--no-figure", action="store_true", help="leave the figures and the page out")
    figure_arguments(parser)


@contextmanager
def _scenario(arguments: argparse.Namespace) -> Iterator[tuple[Path, Config, Any]]:
    """The scenario's file, the configuration, and a reference that a stored result was given.

    The paper's scenarios come with their presets; a stored result with its own scenario.
    """
    if arguments.bound:
        arguments.overrides = [*arguments.overrides, "bound.wanted=true"]
    if arguments.explain:
        arguments.overrides = [*arguments.overrides, "explain.wanted=true"]
    if arguments.mitigate:
        arguments.overrides = [*arguments.overrides, "mitigation.wanted=true"]
    if arguments.to_goal:
        arguments.overrides = [*arguments.overrides, "repair.goal=true"]
    config = resolve(arguments)
    from repair.config.layers import result_in
    from repair.io.result_json import record_in

    if arguments.config is not None and result_in(arguments.config) is not None:
        content = record_in(arguments.config)
        given = content.get("given_reference") if config.reference.source == "given" else None
        with _stored(arguments, content) as path:
            yield path, config, given
        return
    name = arguments.scenario or config.scenario
    default = arguments.preset if arguments.preset in PAPER_SCENARIOS else PAPER_SCENARIOS[0]
    if arguments.preset is None and (name is None or name in PAPER_SCENARIOS):
        arguments.preset = name or default
        config = resolve(arguments)
    with paper_scenario(default) if name is None else find_scenario(name) as path:
        yield path, config, None


@contextmanager
def _stored(arguments: argparse.Namespace, content: dict[str, Any]) -> Iterator[Path]:
    """The scenario of a stored result, unless another one is named."""
    from repair.io.result_json import scenario_of

    if content.get("modes"):
        raise RepairError(
            f"{arguments.config} is of several predictions of one obstacle, which were given from memory; "
            "only a program can run that again"
        )
    origin = content["provenance"]
    if arguments.scenario is not None:
        with find_scenario(arguments.scenario) as path:
            yield path
    elif origin["kind"] == "reconstruction" and not content.get("scenario_file"):
        with reconstruction_by(origin["sha256"]) as path:
            yield path
    else:
        yield scenario_of(arguments.config.parent, content)


class _Interrupts:
    """Remembers that Ctrl-C was pressed: the search swallows it and returns what it has.

    What was found is printed and written whatever comes: after the search Ctrl-C is only remembered. A
    second one while figures are drawn and files are written ends that, not the printing.
    """

    def __init__(self) -> None:
        self.seen = False
        self.ignored = 0.0  # how many more are only remembered

    def found(self, _: object = None) -> None:
        """The search has ended: there is something to lose from now on."""
        self.ignored = float("inf")

    def __enter__(self) -> _Interrupts:
        def handler(number: int, frame: Any) -> None:
            self.seen = True
            if self.ignored:
                self.ignored -= 1.0
                return
            raise KeyboardInterrupt

        try:
            self.before = signal.signal(signal.SIGINT, handler)
        except ValueError:  # not the main thread: whoever runs us handles it
            self.before = None
        return self

    def __exit__(self, *_: object) -> None:
        if self.before is not None:
            signal.signal(signal.SIGINT, self.before)


def _progress(after: float = 2.0) -> Callable[[str], None]:
    """Tells a terminal what an explanation looks at, once it takes longer than ``after`` [s]."""
    begin: list[float] = []

    def tell(words: str) -> None:
        begin.append(time.perf_counter())
        spent = begin[-1] - begin[0]
        if spent > after and sys.stderr.isatty():
            print(f"repair: explaining, {spent:.0f} s: {words}", file=sys.stderr)

    return tell


def run(arguments: argparse.Namespace) -> int:
    """One scenario; the result on stdout, and in files where a folder is given."""
    style = figure_style(arguments)
    if arguments.out is not None:
        from repair.io.destination import require_folder

        require_folder(arguments.out)
    if style is not None and (arguments.out is None or arguments.no_figure):
        raise UsageError("--format, --width and --font-size say how figures are written; they need --out DIR")
    if arguments.trace and arguments.out is None:
        raise UsageError("--trace writes files; it needs --out DIR")
    with _Interrupts() as interrupts, _scenario(arguments) as (path, config, given):
        from repair.api import repair
        from repair.io.result_json import to_json
        from repair.report.text import answer, summary

        result = repair(path, config, on_found=interrupts.found, on_explaining=_progress(), reference=given)
        content, problem = result.to_dict(), None
        written: list[Path] = []
        if arguments.out is not None:
            interrupts.ignored = 1.0
            try:
                figure = style or not arguments.no_figure
                outcome, written = result.saved(arguments.out, figure=figure, trace=arguments.trace)
                content = outcome.record
            except RepairError as error:
                problem = error
            except KeyboardInterrupt:  # the second one
                pass
            interrupts.found()
        if arguments.json:
            sys.stdout.write(as_json(to_json(content)))
        elif arguments.quiet:
            print(answer(content, arguments.preset))
        else:
            print(summary(content, arguments.preset, written))
        if problem is not None:
            raise problem
        if interrupts.seen:
            print("repair: interrupted; what was found until then stands above", file=sys.stderr)
            return 130
    return 0
