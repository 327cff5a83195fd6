"""What a finer time step costs, and what many different searches leave in memory.

    python -m benchmarks.steps FOLDER --files 12                  searches at steps of 0.1 and 0.01 s
    python -m benchmarks.steps FOLDER --memory 1000               as many different searches in one process

The files are resampled to the finer step (:func:`benchmarks.limits.resampled`); the grid of the search stays.
Times are processor times of warm searches, nobody asked instead (``fallback`` empty). For the memory each
search is another one: file, reference, backend, and the horizon after the conflict, in steps of 0.05 s.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cycle import resident
from benchmarks.limits import REFERENCES, resampled
from repair.api import find
from repair.config import load_config
from repair.errors import RepairError
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.solvers.registry import make_backend

COARSE, FINE = 0.1, 0.01  # [s]
WAYS = {"ego": (), "qptr": (), "casadi": ("casadi.solver=sqpmethod",)}


def prepared(file: Path, reference: str, backend: str, *keys: str) -> Any:
    """Something to search, with its backend; None where there is no conflict that can be avoided."""
    overrides = [f"reference.source={reference}", "fallback=[]", *WAYS[backend], *keys]
    config = load_config(backend=backend, overrides=overrides)
    try:
        made = prepare(load_scene(file, config), config)
    except RepairError:
        return None
    if not np.isfinite(made.conflict.time) or made.conflict.contact_time <= 0.0:
        return None
    return made, make_backend(backend, config)


def seconds(made: Any) -> float:
    """Processor time of a warm search [s]."""
    find(*made)
    begin = time.process_time()
    find(*made)
    return time.process_time() - begin


def finer(files: list[Path], backends: list[str]) -> None:
    """Print by how much longer searches take at the finer step."""
    for backend in backends:
        ratios = []
        with tempfile.TemporaryDirectory(prefix="repair-steps-") as folder:
            for file in files:
                fine = resampled(file, FINE, Path(folder))
                pair = [prepared(f, "constant", backend) for f in (file, fine)]
                if None in pair or abs(pair[0][0].scene.dt - COARSE) > 1e-9:
                    continue
                coarse, took = (seconds(made) for made in pair)
                ratios.append(took / coarse)
                print(f"  {backend} {file.name}: {1e3 * coarse:.1f} ms, {1e3 * took:.1f} ms", flush=True)
        if ratios:
            p50, p95 = np.percentile(ratios, (50, 95))
            print(
                f"{backend}: {len(ratios)} searches, at {FINE} s {p50:.1f} times as long as at {COARSE} s in "
                f"the median, {p95:.1f} at the 95th percentile"
            )


def different(files: list[Path], backends: list[str]) -> Iterator[tuple[Path, str, str, str]]:
    """Searches that are all different."""
    for k in itertools.count():
        for file, reference, backend in itertools.product(files, REFERENCES, backends):
            yield file, reference, backend, f"repair.after_conflict={1.0 + 0.05 * k:g}"


def memory(files: list[Path], backends: list[str], count: int) -> None:
    """Print how much memory the process takes on the way."""
    done, begin = 0, resident()
    for file, reference, backend, key in different(files, backends):
        made = prepared(file, reference, backend, key)
        if made is None:
            continue
        find(*made)
        done += 1
        if done % max(count // 10, 1) == 0:
            print(f"{done} searches: {resident():.0f} MB (at the start {begin:.0f} MB)", flush=True)
        if done >= count:
            return


def main() -> int:
    """Measure, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.steps", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--files", type=int, default=12, help="spread over the folder")
    parser.add_argument("--backend", nargs="+", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--memory", type=int, metavar="SEARCHES")
    arguments = parser.parse_args()
    files = sorted(arguments.folder.glob("*.xml"))
    spread = np.unique(np.linspace(0, len(files) - 1, arguments.files).round().astype(int))
    chosen = [files[k] for k in spread]
    if arguments.memory:
        memory(chosen, arguments.backend, arguments.memory)
    else:
        finer(chosen, arguments.backend)
    return 0


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    sys.exit(main())
