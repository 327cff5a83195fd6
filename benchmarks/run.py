"""The command line of ``python -m benchmarks``: which cases there are, in which order, and what is kept."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

DESCRIPTION = "Everything measured, in its own process, on one BLAS thread."
GROUPS = ("memory", "import", "search", "repair", "phases", "scaling", "peers")


def cases(only: list[str]) -> list[tuple[str, str, Callable[[Any], Any]]]:
    """(group, label, run) of everything that is to be measured."""
    from benchmarks import phases, processes, scaling, searches
    from benchmarks.cases import BACKENDS

    every: list[tuple[str, str, Callable[[Any], Any]]] = [
        ("memory", "peak memory", processes.memory),
        ("import", "start-up", processes.imports),
    ]
    for number in (1, 2):
        for delta_t in (0.4, 0.1):
            label = f"search, Scenario {number}, {delta_t} s"
            every.append(("search", label, partial(searches.whole_search, number=number, delta_t=delta_t)))
    for number in (1, 2):
        for points in (25, 40):
            label = f"one repair, Scenario {number}, {points} points"
            every.append(("repair", label, partial(searches.one_repair, number=number, n_points=points)))
    for number in (1, 2):
        every.append(("phases", f"preparation {number}", partial(phases.preparation, number=number)))
        every.append(("phases", f"single calls {number}", partial(phases.parts, number=number)))
        every.append(("phases", f"NLP build {number}", partial(phases.nlp_build, number=number)))
        for name in BACKENDS:
            every.append(("phases", f"{name} {number}", partial(phases.shares, number=number, backend=name)))
    every.append(("scaling", "control points", scaling.control_points))
    for near in (False, True):
        every.append(("scaling", f"obstacles, near: {near}", partial(scaling.obstacles, near=near)))
    for name in ("ego", "casadi sqpmethod"):
        every.append(("scaling", f"horizon, {name}", partial(scaling.horizon, backend=name)))
    every.append(("peers", "peers", processes.peers))
    return [c for c in every if not only or c[0] in only]


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=DESCRIPTION)
    parser.add_argument("--quick", action="store_true", help="fewer rounds: a minute instead of several")
    parser.add_argument("--json", metavar="FILE", type=Path, help="keep everything that was measured")
    parser.add_argument("--only", metavar="NAME", action="append", choices=GROUPS, help=", ".join(GROUPS))
    parser.add_argument("--peers", metavar="PYTHON", help="interpreter in which the peers are installed")
    parser.add_argument(
        "--record", action="store_true", help="write benchmarks/ratios.json for the regression guard"
    )
    return parser.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Measure, print, keep. Exit status 1 if a case broke; missed targets are reported, not an error."""
    arguments = _arguments(argv)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    if arguments.record:
        from benchmarks.guard import record

        return record()
    from tqdm import tqdm

    from benchmarks.cases import Context
    from benchmarks.machine import describe
    from benchmarks.measure import Report
    from benchmarks.table import print_report

    context, report, broken = Context(arguments.quick, arguments.peers), Report(), 0
    before, begin = describe(), time.perf_counter()
    try:
        chosen = cases(arguments.only or [])
        with tqdm(total=len(chosen), disable=None, unit="case", leave=False) as bar:
            for _, label, run in chosen:
                bar.set_description(label)
                try:
                    report.add(run(context))
                except Exception as error:  # one broken case must not cost the others
                    broken += 1
                    report.remarks.append(f"{label} broke: {type(error).__name__}: {error}")
                    traceback.print_exc()
                bar.update()
    finally:
        shutil.rmtree(context.folder, ignore_errors=True)
    machine = {
        **before,
        "load_average_after": describe()["load_average"],
        "duration_s": time.perf_counter() - begin,
    }
    print_report(report, machine)
    if arguments.json is not None:
        content = {"machine": machine, "quick": arguments.quick, **report.to_dict()}
        arguments.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        print(f"\nkept in {arguments.json}")
    return 1 if broken else 0
