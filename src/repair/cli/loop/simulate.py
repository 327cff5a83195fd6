"""``repair simulate``."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from repair.cli.arguments import UsageError

if TYPE_CHECKING:
    from repair.simulate.many.run import Simulation

__all__ = ["simulate", "simulate_arguments"]

_POLICIES = ("f_ttr", "at_once", "graded")
_PREDICTIONS = ("constant_velocity",)


def simulate_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``repair simulate``."""
    parser.add_argument("what", metavar="SCENARIO|DIR", help="a CommonRoad file, or a folder of them")
    parser.add_argument(
        "--policy", action="extend", nargs="+", metavar="NAME",
        help="f_ttr, at_once, ttc, brake, graded, never (default: f_ttr at_once graded)",
    )  # fmt: skip
    parser.add_argument(
        "--prediction", action="extend", nargs="+", metavar="NAME",
        help="recorded, constant_velocity, constant_turn, lane, delayed (default: constant_velocity)",
    )  # fmt: skip
    parser.add_argument(
        "--reference", action="extend", nargs="+", metavar="SOURCE",
        help="the plans: planner, constant, accelerate, recorded (default: constant accelerate)",
    )  # fmt: skip
    parser.add_argument(
        "--shift", action="extend", nargs="+", type=float, metavar="S",
        help="let the traffic begin so much later than recorded [s] (default: 0)",
    )  # fmt: skip
    parser.add_argument("--backend", metavar="NAME")
    parser.add_argument("--preset", metavar="NAME")
    parser.add_argument("--config", metavar="FILE", type=Path)
    parser.add_argument(
        "--set", metavar="KEY=VALUE", action="extend", nargs="+", default=[], dest="overrides"
    )
    parser.add_argument(
        "--out", metavar="DIR", type=Path,
        help="store each drive as it comes (simulation.sqlite); write simulation.csv, .json and report.html",
    )  # fmt: skip
    parser.add_argument("--workers", metavar="N", type=int, help="processes on this machine (default: 1)")
    parser.add_argument("--resume", action="store_true", help="go on with the drives that are in --out DIR")


def simulate(arguments: argparse.Namespace) -> int:
    """Every drive; prints the table."""
    if arguments.resume and arguments.out is None:
        raise UsageError("--resume goes on with what is stored in a folder; name it with --out")
    if arguments.workers is not None and arguments.workers < 1:
        raise UsageError(f"--workers is {arguments.workers}; at least one is needed")
    from repair.io.destination import require_folder
    from repair.reference.registry import names

    for name in arguments.reference or []:
        if name not in (known := names()):
            raise UsageError(f"reference {name!r} is none of {', '.join(known)}")
    if arguments.out is not None:
        require_folder(arguments.out)
    with ExitStack() as kept:
        what = _named(arguments, kept)
        folder = arguments.out or Path(kept.enter_context(TemporaryDirectory(prefix="repair-")))
        return _run(what, folder, arguments)


def _run(what: Simulation, folder: Path, arguments: argparse.Namespace) -> int:
    """Drive what is not there yet; everything that is goes into the table."""
    from repair.report.loop.table import table_of
    from repair.simulate.many.run import drives_in, tasks_of
    from repair.simulate.many.shown import write_simulation
    from repair.simulate.many.task import run_drive
    from repair.simulate.measures import SIMULATION
    from repair.study.engine import LocalLanes
    from repair.study.run import run_study
    from repair.study.store import Store

    tasks = tasks_of(what)
    with Store(folder, SIMULATION) as store:
        if not arguments.resume and store.done():
            raise UsageError(f"{folder} holds drives already; --resume goes on, --out names another folder")
        store.tell(command=f"repair simulate {Path(arguments.what).name}")
        try:
            run_study(tasks, store, LocalLanes(arguments.workers or 1, run_drive))
        except KeyboardInterrupt:
            if arguments.out is None:
                raise
            done = sum(task["done"] for task in store.tasks())
            words = f"repair: interrupted; {done} of {len(tasks)} drives are stored in {store.path}"
            print(f"{words}, and --resume goes on", file=sys.stderr)
            return 130
        drives = list(drives_in(store))
    print(table_of(drives))
    if arguments.out is not None:
        print(*write_simulation(drives, folder), sep="\n")
    return 0


def _named(arguments: argparse.Namespace, kept: ExitStack) -> Simulation:
    """What is driven; a bundled scenario is there as long as ``kept`` is open."""
    from repair.paper.bundled import find_scenario
    from repair.simulate.many.case import simulation_config
    from repair.simulate.many.run import Simulation, files_of

    path = Path(arguments.what)
    if not path.is_dir():
        path = kept.enter_context(find_scenario(arguments.what))
    config = simulation_config(
        arguments.preset, arguments.config, arguments.overrides, backend=arguments.backend
    )
    return Simulation(
        files_of(path), tuple(arguments.policy or _POLICIES), tuple(arguments.prediction or _PREDICTIONS),
        tuple(arguments.reference or ("constant", "accelerate")), tuple(arguments.shift or (0.0,)), config,
    )  # fmt: skip
