"""A planner's cycle: how long it takes with ``repair.Repairer``, and how late it is with a deadline.

    python -m benchmarks.cycle                                    ego and casadi, 10,000 cycles each
    python -m benchmarks.cycle --cycles 1000 --backend ego        fewer of them
    python -m benchmarks.cycle --before COMMIT                    beside an earlier version, from git
    python -m benchmarks.cycle --deadline 0.002 0.005 0.02        with deadlines [s] instead

The traffic is that of Scenario 1, 24 obstacles, with a new plan and new predictions each cycle
(:mod:`benchmarks.cycle_traffic`), all checks included. Every so many cycles the same inputs go to processes
of their own that build everything anew, CommonRoad objects, scene and ``repair.repair()``, as it is done
without a Repairer. Times are processor times. With deadlines every other cycle has the processor time as its
clock, which tells the machine's noise apart, and each trajectory is held against the predictions by shapely.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import pickle
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
#: What a planner asks for: no other backend where this one has found nothing, which takes far longer.
PLAIN = ("fallback=[]",)
BACKENDS: dict[str, tuple[str, ...]] = {
    "ego": PLAIN,
    "casadi": (*PLAIN, "casadi.solver=sqpmethod"),
    "casadi helped": (*PLAIN, "casadi.solver=sqpmethod", "casadi.helpers=[ego,shooting]"),
    "casadi strict": (*PLAIN, "casadi.solver=sqpmethod", "repair.relax=[]"),
    "qptr": PLAIN,
}


def under(sources: Path, worker: str) -> subprocess.Popen[bytes]:
    """A worker of this folder in a process of its own, with the sources of a folder."""
    env = {**os.environ, "PYTHONPATH": str(sources)}
    command = [sys.executable, "-W", "ignore", str(Path(__file__).with_name(worker))]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env)


class Rebuilding:
    """A process that builds everything anew, under the sources of a folder."""

    def __init__(self, sources: Path, file: Path, backend: str, overrides: list[str]) -> None:
        self._process = under(sources, "rebuild_worker.py")
        self._send((str(file), backend, overrides))

    def _send(self, thing: Any) -> None:
        assert self._process.stdin is not None
        pickle.dump(thing, self._process.stdin)
        self._process.stdin.flush()

    def __call__(self, plan: Any, traffic: list[Any]) -> tuple[Any, float]:
        """Status, TTC and F-TTR, and the processor time [s]."""
        self._send((plan, traffic))
        assert self._process.stdout is not None
        found, (spent, _) = pickle.load(self._process.stdout)
        return found, spent

    def close(self) -> None:
        """Let the process end."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def resident() -> float:
    """Memory of this process [MB]."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    found = re.search(r"VmRSS:\s+(\d+)", status)
    return int(found.group(1)) / 1024.0 if found else float("nan")


def predictions(traffic: list[Any]) -> list[Any]:
    """The same as predictions of the library."""
    import repair

    return [repair.Prediction(name, poses, a, b, kind=kind) for name, kind, a, b, poses in traffic]


def touched(states: Any, vehicle: Any, traffic: list[Any]) -> bool:
    """Whether the driven rectangle meets a predicted one at a step: by shapely alone."""
    import shapely

    def boxes(x: Any, y: Any, yaw: Any, length: float, width: float) -> Any:
        corner = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (0.5 * length, 0.5 * width)
        c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
        px, py = c * corner[:, 0] - s * corner[:, 1], s * corner[:, 0] + c * corner[:, 1]
        return shapely.polygons(np.stack([px + x[:, None], py + y[:, None]], axis=2))

    own = boxes(states.x, states.y, states.orientation, 2.0 * vehicle.half_length, 2.0 * vehicle.half_width)
    for _, _, length, width, poses in traffic:
        count = min(len(own), len(poses))
        known = np.isfinite(poses[:count, 0])
        if known.any():
            others = boxes(*poses[:count][known].T, length, width)
            if shapely.intersects(own[:count][known], others).any():
                return True
    return False


def speed(file: Path, label: str, cycles: int, rebuilds: int, before: Path | None) -> list[str]:
    """Cycles of one backend, with rebuilds of the same inputs in between."""
    import gc

    import repair
    from benchmarks.cycle_traffic import EPISODE
    from benchmarks.cycle_traffic import cycles as made

    backend, overrides = label.split(maxsplit=1)[0], list(BACKENDS[label])
    scene = repair.load_scene(file)
    watch = repair.Repairer(scene, backend=backend, overrides=overrides)
    ways = {"this version": ROOT / "src", **({} if before is None else {"before": before})}
    others = {}
    for name, sources in ways.items():
        # an earlier version has no such keys, and no other backend that it would ask
        keys = [k for k in overrides if name != "before" or not k.startswith(("fallback", "casadi.helpers"))]
        others[name] = Rebuilding(sources, file, backend, keys)
    # filled before it begins: what is measured is not to be this benchmark's own growth
    spent = np.full(cycles, np.nan)
    parts: dict[str, np.ndarray] = defaultdict(lambda: np.full(cycles, np.nan))
    slow: dict[str, list[float]] = {name: [] for name in others}
    memory, every = [], max(cycles // max(rebuilds, 1), 1)
    while math.gcd(every, EPISODE) > 1:  # else only some places of a drive are rebuilt
        every -= 1
    gc.collect()
    for k, cycle in enumerate(itertools.islice(made(scene), cycles)):
        if cycle.now == 0.0:
            watch.reset()
        traffic = predictions(cycle.traffic)
        begin = time.process_time()
        answer = watch.update(cycle.plan, traffic=traffic, now=cycle.now)
        spent[k] = time.process_time() - begin
        for name, seconds in {**answer.prepared.phases, "search": answer.search.wall_time}.items():
            parts[name][k] = seconds
        if k % every == every // 2:
            for name, other in others.items():
                slow[name].append(other(cycle.plan, cycle.traffic)[1])
        if k % max(cycles // 10, 1) == 0 and k:
            memory.append(resident())
    memory.append(resident())
    for other in others.values():
        other.close()
    warm = 1e3 * spent[20:]
    median = float(np.median(warm))
    p99, p999 = np.percentile(warm, (99, 99.9))
    lines = [
        f"{label}: {cycles} cycles, median {median:.2f} ms, p99 {p99:.2f}, p99.9 {p999:.2f} ms "
        f"({p999 / median:.1f} x the median), most {warm.max():.2f} ms; memory grew by "
        f"{memory[-1] - memory[0]:.1f} MB after the first tenth"
    ]
    shares = {name: float(np.nanmedian(values)) for name, values in parts.items()}
    whole = sum(shares.values())
    lines.append("  " + ", ".join(f"{name} {v / whole:.0%}" for name, v in shares.items()))
    for name, values in slow.items():
        built = 1e3 * float(np.median(values[1:] or values))
        lines.append(
            f"  rebuilt, {name}: {built:.1f} ms ({len(values)} of them), {built / median:.1f} x as long"
        )
    return lines


def late(file: Path, label: str, cycles: int, deadline: float) -> list[str]:
    """Cycles with a deadline: how late, how complete, and whether something is touched."""
    import repair
    from benchmarks.cycle_traffic import cycles as made
    from benchmarks.limits import by_processor_time

    scene = repair.load_scene(file)
    watch = repair.Repairer(scene, backend=label.split(maxsplit=1)[0], overrides=list(BACKENDS[label]))
    over: dict[bool, list[float]] = {True: [], False: []}
    found = complete = wrong = 0
    for k, cycle in enumerate(itertools.islice(made(scene), cycles + 20)):
        if cycle.now == 0.0:
            watch.reset()
        traffic, own = predictions(cycle.traffic), k % 2 == 0
        if k == 0:
            watch.warm(cycle.plan, traffic=traffic)
        with by_processor_time(own):
            begin = time.perf_counter()
            answer = watch.update(
                cycle.plan, traffic=traffic, now=cycle.now, deadline=None if k < 20 else deadline
            )
            took = time.perf_counter() - begin
        if k < 20:
            continue
        over[own].append(1e3 * max(took - deadline, 0.0))
        complete += answer.complete
        if answer.status == "found":
            found += 1
            wrong += touched(answer.states, scene.vehicle, cycle.traffic)
    words = []
    for own, name in ((True, "processor time"), (False, "wall")):
        p50, p99, p999 = np.percentile(over[own], (50, 99, 99.9))
        words.append(
            f"{name} late p50 {p50:.2f}, p99 {p99:.2f}, p99.9 {p999:.2f}, most {max(over[own]):.2f} ms"
        )
    return [
        f"{label}, {1e3 * deadline:g} ms: {cycles} cycles, {'; '.join(words)}; "
        f"complete {complete / cycles:.0%}, found {found / cycles:.0%}, of which touch something: {wrong}"
    ]


def earlier(commit: str, folder: Path) -> Path:
    """The sources of a commit, in a folder."""
    packed = subprocess.run(["git", "archive", commit, "src"], cwd=ROOT, capture_output=True, check=True)
    subprocess.run(["tar", "x", "-C", str(folder)], input=packed.stdout, check=True)
    return folder / "src"


def main() -> int:
    """Measure, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cycle", description=__doc__.splitlines()[0])
    parser.add_argument("--cycles", type=int, default=10_000)
    parser.add_argument("--rebuilds", type=int, default=100, help="rebuilt among them, of each version")
    parser.add_argument("--backend", nargs="+", default=["ego", "casadi"], choices=list(BACKENDS))
    parser.add_argument("--before", metavar="COMMIT", help="an earlier version that is rebuilt with, too")
    parser.add_argument("--deadline", type=float, nargs="+", metavar="SECONDS")
    arguments = parser.parse_args()
    from benchmarks.cases import Context

    file = Context().path(1)
    with tempfile.TemporaryDirectory(prefix="repair-cycle-") as folder:
        before = None if arguments.before is None else earlier(arguments.before, Path(folder))
        for label in arguments.backend:
            if arguments.deadline:
                for deadline in arguments.deadline:
                    print("\n".join(late(file, label, arguments.cycles, deadline)), flush=True)
            else:
                lines = speed(file, label, arguments.cycles, arguments.rebuilds, before)
                print("\n".join(lines), flush=True)
    return 0


if __name__ == "__main__":
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[_name] = "1"
    sys.exit(main())
