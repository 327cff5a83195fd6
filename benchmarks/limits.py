"""How late are searches with a time limit?

    python -m benchmarks.limits                          all files, backends, limits of 1, 10 and 100 ms
    python -m benchmarks.limits --searches 10000         as many searches, spread over all of them
    python -m benchmarks.limits --part 0 2               every other file
    python -m benchmarks.limits --step 0.01              the files resampled to another time step [s]

Every file of COMMONROAD_SCENARIOS (or ``--scenarios FOLDER``) is prepared once for each reference, then
searched by ``repair.api.find`` again and again. Half of the searches are cold: what is kept for the life of
a process (models, NLPs, structures of QPs) is thrown away before. Lateness is what a search took beyond its
limit, by the clock on the wall. The machine's noise is told apart by every search being made twice, the
second time with the processor time of this process as its clock: what is late there is ours, and waiting
for a processor is not. Exit status 1 where p99 by processor time is above 20 ms.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

LIMITS = (0.001, 0.01, 0.1)
BACKENDS = ("ego", "casadi", "qptr")
REFERENCES = ("constant", "accelerate")
ALLOWED = 0.02  # [s]
Key = tuple[str, float, bool]  # backend, limit, cold


def forget() -> None:
    """Throw away what backends keep for the life of a process."""
    from repair.baselines.qptr import axis, structure, time_grid
    from repair.problem import speeds
    from repair.solvers.casadi import model

    for module in (axis, structure, time_grid, model, speeds):
        for value in list(vars(module).values()):
            if hasattr(value, "cache_clear") and not isinstance(value, type):
                value.cache_clear()


def resampled(file: Path, step: float, folder: Path) -> Path:
    """The file with another time step: all times at more steps, and more states to each trajectory."""
    from copy import deepcopy
    from xml.etree import ElementTree

    tree = ElementTree.parse(file)
    root = tree.getroot()
    factor = round(float(root.attrib["timeStepSize"]) / step)
    root.attrib["timeStepSize"] = f"{step:g}"
    for time_ in root.iter("time"):
        for value in time_.iter():
            if value.text and value.text.strip().isdigit():
                value.text = str(int(value.text) * factor)
    for obstacle in root.iter("dynamicObstacle"):
        before = obstacle.find("initialState")
        for trajectory in obstacle.iter("trajectory"):
            states = list(trajectory)
            for after in states:
                trajectory.remove(after)
                for k in range(1, factor + 1):
                    trajectory.append(_between(before, deepcopy(after), k / factor, factor))
                before = after
    tree.write(folder / file.name, encoding="utf-8", xml_declaration=True)
    return folder / file.name


def _between(before: Any, after: Any, share: float, factor: int) -> Any:
    """The state ``after``, moved back to a share of the way from ``before``."""
    import math

    for path in ("time/exact", "position/point/x", "position/point/y", "velocity/exact", "orientation/exact"):
        old, new = before.find(path), after.find(path)
        if old is None or new is None:
            continue
        change = float(new.text) - float(old.text)
        if path.startswith("time"):
            new.text = str(round(float(new.text) - (1.0 - share) * factor))
            continue
        if path.startswith("orientation"):
            change = math.remainder(change, 2.0 * math.pi)
        new.text = repr(float(old.text) + share * change)
    return after


def prepared(files: list[Path], backends: list[str]) -> Iterator[tuple[Any, Any, str]]:
    """Situations with a conflict, and their backends."""
    import repair
    from repair.config import load_config
    from repair.preparation import prepare
    from repair.scene.commonroad import load_scene
    from repair.solvers.registry import make_backend

    for file in files:
        scene = None
        for reference in REFERENCES:
            for backend in backends:
                config = load_config(backend=backend, overrides=[f"reference.source={reference}"])
                try:
                    scene = scene or load_scene(file, config)
                    made = prepare(scene, config)
                except repair.RepairError:
                    continue
                if made.conflict.time < float("inf") and made.conflict.contact_time > 0.0:
                    yield made, make_backend(backend, config), backend


@contextmanager
def by_processor_time(wanted: bool) -> Iterator[None]:
    """Whatever looks at a clock sees the processor time of this process."""
    from repair.search.search import search_f_ttr

    clock, keys = time.perf_counter, search_f_ttr.__kwdefaults__
    if wanted:
        time.perf_counter = keys["clock"] = time.process_time
    try:
        yield
    finally:
        time.perf_counter = keys["clock"] = clock


def _columns(wall: list[float], ours: list[float]) -> tuple[str, float]:
    """The figures of one row, and p99 by processor time [s]."""
    import numpy as np

    p50, p99 = 1e3 * np.percentile(wall, (50, 99))
    own = float(np.percentile(ours, 99))
    text = f"{len(wall) + len(ours):6d}   {p50:15.2f} {p99:7.2f} {1e3 * max(wall):8.2f}"
    return f"{text}   {1e3 * own:10.2f} {1e3 * max(ours):8.2f}", own


def measure(files: list[Path], backends: list[str], limits: list[float], rounds: int) -> int:
    """Search, print the table; 1 where searches are late."""
    import gc

    from repair.api import find
    from repair.search.settings import SearchConfig

    late: dict[Key, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
    status: dict[Key, Counter[str]] = defaultdict(Counter)
    slowest: dict[Key, tuple[float, str]] = {}
    for made, backend, name in prepared(files, backends):
        find(made, backend, settings=SearchConfig(time_limit=0.0))  # imports
        gc.collect()
        ways = itertools.product(limits, (True, False), range(rounds), (False, True))
        for limit, cold, _, processor in ways:
            key = name, limit, cold
            if cold:
                forget()
            with by_processor_time(processor):
                begin = time.perf_counter()
                found = find(made, backend, settings=SearchConfig(time_limit=limit))
                took = time.perf_counter() - begin
            late[key][processor].append(max(took - limit, 0.0))
            status[key][found.status.value] += 1
            if processor:
                slowest[key] = max(slowest.get(key, (0.0, "")), (took - limit, made.scene.id))
    columns = f"{'count':>6}   {'late [ms]: p50':>15} {'p99':>7} {'max':>8}   {'ours: p99':>10} {'max':>8}"
    print(f"{'backend':8} {'limit':>7} {'kept':5} {columns}  {'found':>6}  latest")
    bad = False
    for key in sorted(late):
        text, p99 = _columns(*late[key])
        bad |= p99 > ALLOWED
        found_ = status[key]["found"] / sum(status[key].values())
        kept = "cold" if key[2] else "warm"
        print(f"{key[0]:8} {1e3 * key[1]:4g} ms {kept:5} {text}  {found_:6.0%}  {slowest[key][1]}")
    for backend in backends:
        every = [pair for key, pair in late.items() if key[0] == backend]
        if every:
            joined = (list(itertools.chain.from_iterable(side)) for side in zip(*every, strict=True))
            print(f"{backend:8}     all       {_columns(*joined)[0]}")
    return 1 if bad else 0


def main() -> int:
    import tempfile

    parser = argparse.ArgumentParser(prog="python -m benchmarks.limits", description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", type=Path, default=Path(os.environ.get("COMMONROAD_SCENARIOS", ".")))
    parser.add_argument("--part", type=int, nargs=2, default=(0, 1), metavar=("K", "N"), help="part K of N")
    parser.add_argument("--limits", type=float, nargs="+", default=list(LIMITS), metavar="SECONDS")
    parser.add_argument("--backends", nargs="+", default=list(BACKENDS))
    parser.add_argument("--searches", type=int, default=1000, help="about how many, in all")
    parser.add_argument("--step", type=float, help="another time step for the scenarios [s]")
    arguments = parser.parse_args()
    part, parts = arguments.part
    files = sorted(arguments.scenarios.glob("*.xml"))[part::parts]
    cells = len(files) * len(REFERENCES) * len(arguments.backends) * len(arguments.limits) * 4
    rounds = max(1, round(arguments.searches / max(cells, 1)))
    with tempfile.TemporaryDirectory(prefix="repair-limits-") as folder:
        if arguments.step is not None:
            files = [resampled(file, arguments.step, Path(folder)) for file in files]
        return measure(files, arguments.backends, arguments.limits, rounds)


if __name__ == "__main__":
    import warnings

    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[_name] = "1"
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    sys.exit(main())
