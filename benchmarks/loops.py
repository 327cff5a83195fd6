"""Is a Repairer as late as a fresh search of everything? ``python -m benchmarks.loops FOLDER``.

Drives of 20 cycles each (:mod:`benchmarks.cycle_traffic`: a new plan and new predictions every cycle) go to
one ``repair.Repairer``, and each cycle's inputs to ``repair.repair()`` with the rule ``scan`` on a scene that
is laid out anew. Where the Repairer's F-TTR is the earlier one, its own frame is scanned as well, to say why.

search
    the scan of that frame finds the later one: behind a time-to-repair that is not feasible, where a search
    that goes on from its last answer does not look;
frame
    it does not: the plan lies in a frame of its own there, and in that of an earlier cycle here, so that the
    spline and the boxes differ by centimetres.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cycle import predictions
from benchmarks.cycle_traffic import Cycle, cycles
from repair.errors import RepairError

PLAIN = ("fallback=[]",)
TENTH = 10  # of the cycles without a conflict one in so many is compared, too


def compared(file: Path, count: int, backend: str, keys: list[str]) -> Counter[str]:
    """Cycles of one file, by how the Repairer's answer stands to the fresh one; differences are printed."""
    import repair

    scene = repair.load_scene(file)
    watch = repair.Repairer(scene, backend=backend, overrides=[*PLAIN, *keys])
    scan = repair.load_config(backend=backend, overrides=[*PLAIN, *keys, "search.rule=scan"])
    found: Counter[str] = Counter()
    for k, cycle in enumerate(itertools.islice(cycles(scene), count)):
        if cycle.now == 0.0:
            watch.reset()
        traffic = predictions(cycle.traffic)
        try:
            own = watch.update(cycle.plan, traffic=traffic, now=cycle.now)
            if not np.isfinite(own.ttc) and k % TENTH:
                found["no conflict, not compared"] += 1
                continue
        except RepairError as error:
            own, said = None, str(error)
        try:
            fresh = anew(scene, cycle, traffic, scan)
        except RepairError as error:
            found["both refuse it" if own is None else "refused by the fresh one alone"] += 1
            if own is not None:
                print(f"  {file.name} cycle {k}: the fresh one alone refuses it: {error}", flush=True)
            continue
        if own is None:
            found["refused by the Repairer alone"] += 1
            print(f"  {file.name} cycle {k}: the Repairer alone refuses it: {said}", flush=True)
            continue
        kind = kind_of(own, fresh, watch, scan)
        found[kind] += 1
        if kind.startswith("earlier") or kind == "another conflict":
            told = (
                f"{k}: {kind}; {own.status.value} {own.f_ttr} of {own.ttc:g} s, fresh "
                f"{fresh.status.value} {fresh.f_ttr} of {fresh.ttc:g} s"
            )
            print(f"  {file.name} cycle {told}", flush=True)
    return found


def anew(scene: Any, cycle: Cycle, traffic: list[Any], scan: Any) -> Any:
    """The same inputs, nothing kept: the scene from where the ego is, and every time-to-repair."""
    import repair
    from repair.scene.commonroad import moved_on
    from repair.scene.scene import InitialState

    ego = cycle.ego
    start = InitialState(ego["x"], ego["y"], ego["yaw"], ego["v"], 0.0, 0.0)
    return repair.repair(moved_on(scene, start), scan, reference=cycle.plan, traffic=traffic)


def kind_of(own: Any, fresh: Any, watch: Any, scan: Any) -> str:
    """How the two stand to each other."""
    from repair.api import find

    mine, other = (-1.0 if r.f_ttr is None else float(r.f_ttr) for r in (own, fresh))
    if abs(own.ttc - fresh.ttc) > 1e-9 and np.isfinite([own.ttc, fresh.ttc]).any():
        return "another conflict"
    if mine == other or abs(mine - other) < 1e-9:
        return f"the same ({fresh.status.value})"
    if mine > other:
        return "later, kept" if own.kept else "later"
    whole = find(own.prepared, watch._backend, settings=scan.search)
    if whole.f_ttr is not None and whole.f_ttr > mine + 1e-9:
        return "earlier: search"
    return "earlier: frame"


def main() -> int:
    """Compare, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loops", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--files", type=int, default=20, help="spread over the folder")
    parser.add_argument("--cycles", type=int, default=200, help="of each file")
    parser.add_argument("--backend", default="ego")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help="for both of them")
    arguments = parser.parse_args()
    files = sorted(arguments.folder.glob("*.xml"))
    chosen = [
        files[k] for k in np.unique(np.linspace(0, len(files) - 1, arguments.files).round().astype(int))
    ]
    total: Counter[str] = Counter()
    for file in chosen:
        begin = time.perf_counter()
        try:
            found = compared(file, arguments.cycles, arguments.backend, arguments.set)
        except RepairError as error:
            print(f"{file.name}: {error}", flush=True)
            continue
        total += found
        words = ", ".join(f"{kind} {n}" for kind, n in sorted(found.items()))
        print(f"{file.name}: {words} ({time.perf_counter() - begin:.0f} s)", flush=True)
    print(
        f"all: {sum(total.values())} cycles, " + ", ".join(f"{kind} {n}" for kind, n in total.most_common())
    )
    return 0


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    sys.exit(main())
