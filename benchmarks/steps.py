"""What a finer time step costs, and what many different searches leave in memory.

    python -m benchmarks.steps FOLDER --files 12                  searches at steps of 0.1 and 0.01 s
    python -m benchmarks.steps FOLDER --memory 1000               as many different searches in one process

The files are resampled to the finer step (:func:`benchmarks.limits.resampled`); the grid of the search stays.
Times are processor times of warm searches, nobody asked instead (``fallback`` empty). For the memory each
search is another one: file, reference, backend, and the horizon after the conflict, in steps of 0.05 s. All
backends take turns, and each file is read once.
"""

from __future__ import annotations

import argparse
import itertools
import re
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.limits import REFERENCES, resampled
from repair.api import find
from repair.config import load_config
from repair.errors import RepairError
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.scene.scene import Scene
from repair.solvers.registry import make_backend
from repair.timegrid import INSTANT

COARSE, FINE = 0.1, 0.01  # [s]
# The backend's name, then what it is told.
WAYS = {
    "ego": ("ego",),
    "qptr": ("qptr",),
    "casadi": ("casadi", "casadi.solver=sqpmethod"),
    "ipopt": ("casadi", "casadi.solver=ipopt"),
    "shooting": ("shooting",),
    "portfolio": ("portfolio",),
}
MEASURED = ("ego", "qptr", "casadi", "ipopt")


def prepared(scene: Scene, reference: str, way: str, *keys: str) -> Any:
    """Something to search, with its backend; None where there is no conflict that can be avoided."""
    backend, *told = WAYS[way]
    overrides = [f"reference.source={reference}", "fallback=[]", *told, *keys]
    config = load_config(backend=backend, overrides=overrides)
    try:
        made = prepare(scene, config)
    except RepairError:
        return None
    if not np.isfinite(made.conflict.time) or made.conflict.contact_time <= 0.0:
        return None
    return made, make_backend(backend, config)


def megabytes() -> tuple[int, int]:
    """Memory of this process, now and at most so far [MB]."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    now, most = (re.search(rf"{name}:\s+(\d+)", status) for name in ("VmRSS", "VmHWM"))
    assert now is not None
    assert most is not None
    return int(now[1]) // 1024, int(most[1]) // 1024


def seconds(made: Any) -> float:
    """Processor time of a warm search [s]."""
    find(*made)
    begin = time.process_time()
    find(*made)
    return time.process_time() - begin


def finer(files: list[Path], ways: list[str]) -> None:
    """Print by how much longer searches take at the finer step."""
    ratios: dict[str, list[float]] = {way: [] for way in ways}
    with tempfile.TemporaryDirectory(prefix="repair-steps-") as folder:
        for file in files:
            try:
                scenes = [load_scene(f) for f in (file, resampled(file, FINE, Path(folder)))]
            except RepairError:
                continue
            if abs(scenes[0].dt - COARSE) > INSTANT:
                continue
            for way in ways:
                pair = [prepared(scene, "constant", way) for scene in scenes]
                if None in pair:
                    continue
                coarse, took = (seconds(made) for made in pair)
                ratios[way].append(took / coarse)
                print(f"  {way} {file.name}: {1e3 * coarse:.1f} ms, {1e3 * took:.1f} ms", flush=True)
    for way, found in ratios.items():
        if found:
            p50, p95 = np.percentile(found, (50, 95))
            print(
                f"{way}: {len(found)} searches, at {FINE} s {p50:.1f} times as long as at {COARSE} s in "
                f"the median, {p95:.1f} at the 95th percentile, {max(found):.1f} at most"
            )


def memory(files: list[Path], ways: list[str], count: int) -> None:
    """Print how much memory the process takes on the way."""
    done, begin = 0, megabytes()[0]
    each = -(-count // (len(files) * len(REFERENCES)))
    for number, file in enumerate(files):
        try:
            scene = load_scene(file)
        except RepairError:
            continue
        for reference, k in itertools.product(REFERENCES, range(2 * each)):  # many have no conflict
            way, after = ways[(number + k) % len(ways)], 1.0 + 0.05 * (k + number % 7)
            made = prepared(scene, reference, way, f"repair.after_conflict={after:g}")
            if made is None:
                continue
            find(*made)
            done += 1
            if done % max(count // 20, 1) == 0:
                now, most = megabytes()
                print(f"{done} searches: {now} MB, at most {most} MB (at the start {begin} MB)", flush=True)
            if done == count:
                return
    print(f"{done} searches: no more conflicts in these files")


def main() -> int:
    """Measure, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.steps", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--files", type=int, default=12, help="spread over the folder")
    parser.add_argument("--backend", nargs="+", choices=list(WAYS), help="default: all that are measured")
    parser.add_argument("--memory", type=int, metavar="SEARCHES")
    arguments = parser.parse_args()
    files = sorted(arguments.folder.glob("*.xml"))
    spread = np.unique(np.linspace(0, len(files) - 1, arguments.files).round().astype(int))
    chosen = [files[k] for k in spread]
    if arguments.memory:
        memory(chosen, arguments.backend or list(WAYS), arguments.memory)
    else:
        finer(chosen, arguments.backend or list(MEASURED))
    return 0


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    sys.exit(main())
