"""``python -m benchmarks``: everything measured, in its own process, on one BLAS thread."""

from __future__ import annotations

import os
import sys

# Before NumPy is loaded: more threads slow small dense algebra down, and disturb what is measured.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ["MPLBACKEND"] = "Agg"

import argparse
import json
import shutil
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

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
            every.append(("search", label, lambda c, n=number, d=delta_t: searches.whole_search(c, n, d)))
    for number in (1, 2):
        for points in (25, 40):
            label = f"one repair, Scenario {number}, {points} points"
            every.append(("repair", label, lambda c, n=number, p=points: searches.one_repair(c, n, p)))
    for number in (1, 2):
        every.append(("phases", f"preparation {number}", lambda c, n=number: phases.preparation(c, n)))
        every.append(("phases", f"single calls {number}", lambda c, n=number: phases.parts(c, n)))
        every.append(("phases", f"NLP build {number}", lambda c, n=number: phases.nlp_build(c, n)))
        for name in BACKENDS:
            every.append(("phases", f"{name} {number}", lambda c, n=number, b=name: phases.shares(c, n, b)))
    every.append(("scaling", "control points", scaling.control_points))
    for near in (False, True):
        every.append(("scaling", f"obstacles, near: {near}", lambda c, k=near: scaling.obstacles(c, k)))
    for name in ("ego", "casadi sqpmethod"):
        every.append(("scaling", f"horizon, {name}", lambda c, b=name: scaling.horizon(c, b)))
    every.append(("peers", "peers", processes.peers))
    return [c for c in every if not only or c[0] in only]


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer rounds: a minute instead of several")
    parser.add_argument("--json", metavar="FILE", type=Path, help="keep everything that was measured")
    parser.add_argument("--only", metavar="NAME", action="append", choices=GROUPS, help=", ".join(GROUPS))
    parser.add_argument("--peers", metavar="PYTHON", help="interpreter in which the peers are installed")
    parser.add_argument("--record", action="store_true", help="write benchmarks/ratios.json for the regression guard")
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
    machine = {**before, "load_average_after": describe()["load_average"], "duration_s": time.perf_counter() - begin}
    print_report(report, machine)
    if arguments.json is not None:
        content = {"machine": machine, "quick": arguments.quick, **report.to_dict()}
        arguments.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        print(f"\nkept in {arguments.json}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
