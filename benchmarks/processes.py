"""What needs a process of its own: import time, start-up, memory, peers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks.cases import Context, case
from benchmarks.measure import Report, Row, Spread, Target, Times, row, together

ROOT = Path(__file__).resolve().parent.parent
HEAVY = ("matplotlib", "casadi", "scipy.optimize", "commonroad", "shapely", "omegaconf")


def environment() -> dict[str, str]:
    """This environment with the sources on the path, one thread, and no tracing of our children."""
    keys = {k: v for k, v in os.environ.items() if not k.startswith("COV") and k != "PYTHONPATH"}
    path = [str(ROOT / "src"), str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {**keys, "PYTHONPATH": os.pathsep.join(p for p in path if p), "MPLBACKEND": "Agg"}


def child(code: str, *arguments: str) -> Any:
    """Run Python code in a fresh interpreter; the last line that it prints, as JSON."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code, *arguments],
        env=environment(), capture_output=True, text=True, check=True, timeout=600,
    )  # fmt: skip
    return json.loads(done.stdout.strip().splitlines()[-1])


def _process(*arguments: str) -> Any:
    def run() -> None:
        subprocess.run(
            [sys.executable, "-W", "ignore", *arguments],
            env=environment(),
            stdout=subprocess.DEVNULL,
            check=True,
        )

    return run


def imports(context: Context) -> Report:
    """Start-up of whole processes: wall time, and CPU time of the children."""
    calls = {
        "python -c pass": ("-c", "pass"),
        "import numpy": ("-c", "import numpy"),
        "import repair": ("-c", "import repair"),
        "import numpy, repair": ("-c", "import numpy, repair"),
        "import repair; repair.load_scene, repair.repair": (
            "-c",
            "import repair; repair.load_scene, repair.repair",
        ),
        "repair --help": ("-m", "repair", "--help"),
        "repair presets": ("-m", "repair", "presets"),
    }
    times = _children({name: _process(*call) for name, call in calls.items()}, context.rounds(11, 3))
    report = Report([row("start-up", name, found) for name, found in times.items()])
    more = Spread.of(times["import numpy, repair"].wall).median - Spread.of(times["import numpy"].wall).median
    hand = Spread.of(times["repair --help"].wall).median
    report.targets += [
        Target("import repair, more than import numpy", "< 0.15 s", f"{more:.3f} s", more < 0.15),
        Target("repair --help", "< 0.6 s", f"{hand:.3f} s", hand < 0.6),
    ]
    loaded = child(
        "import json, sys, contextlib, io\n"
        "import repair, repair.cli\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
        "    repair.cli.main(['--help'])\n"
        f"print(json.dumps([m for m in {HEAVY!r} if m in sys.modules]))"
    )
    report.targets.append(
        Target(
            "import repair and repair --help load",
            "none of " + ", ".join(HEAVY),
            ", ".join(loaded) or "none",
            not loaded,
        )
    )
    return report


def _children(calls: dict[str, Any], rounds: int) -> dict[str, Times]:
    """As :func:`together`, for calls whose CPU time is that of their child processes."""
    import resource

    cpu: dict[str, list[float]] = {name: [] for name in calls}
    wall: dict[str, list[float]] = {name: [] for name in calls}
    for k in range(rounds + 1):
        for name, call in calls.items():
            before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
            call()
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if k:  # the first round fills the file cache
                wall[name].append(time.perf_counter() - begin)
                cpu[name].append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return {name: Times(tuple(cpu[name]), tuple(wall[name])) for name in calls}


# A child's ru_maxrss starts at the peak of the process that forked it; VmHWM is its own.
_MEMORY = """
import json, re, resource, sys
def peak():
    try:
        with open("/proc/self/status") as file:
            return int(re.search(r"VmHWM:\\s+(\\d+)", file.read()).group(1)) / 1024.0
    except (OSError, AttributeError):
        unit = 1024.0 if sys.platform == "linux" else 2.0**20
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
import numpy
numpy_only = peak()
from repair.api import search
from repair.config import load_config
from repair.preparation import prepare
from repair.scene.commonroad import load_scene
from repair.solvers.registry import make_backend
name, *overrides = json.loads(sys.argv[2])
config = load_config(backend=name, overrides=overrides)
backend = make_backend(name, config)
imported = peak()
scene = load_scene(sys.argv[1])
loaded = peak()
result = search(prepare(scene, config), backend)
print(json.dumps({
    "numpy": numpy_only, "imported": imported, "loaded": loaded, "searched": peak(),
    "status": result.status.value, "plans": len(result.search.probes), "obstacles": len(scene.obstacles),
}))
"""


def memory(context: Context) -> Report:
    """Peak resident memory of a search over the largest shared scenario."""
    from benchmarks.cases import BACKENDS

    path, report = context.largest(), Report()
    group = f"peak memory: {path.stem} ({path.stat().st_size / 1e6:.1f} MB)"
    highest = 0.0
    for label, (name, own) in BACKENDS.items():
        try:
            found = child(_MEMORY, str(path), json.dumps([name, *own]))
        except subprocess.CalledProcessError as error:
            lines = (error.stderr or "").strip().splitlines() or ["no message"]
            report.remarks.append(f"{group}: {label}: {lines[-1]}")
            continue
        highest = max(highest, found["searched"])
        note = (
            f"numpy {found['numpy']:.0f}, all imports {found['imported']:.0f}, "
            f"scene loaded {found['loaded']:.0f}; "
            f"{found['status']}, {found['plans']} plans, {found['obstacles']} obstacles"
        )
        report.rows.append(Row(group, label, "MB", Spread.of([found["searched"]]), note=note))
        rise = found["searched"] - found["imported"]
        report.rows.append(Row(group, f"{label}, rise over the imports", "MB", Spread.of([rise])))
    report.targets.append(
        Target("peak memory, largest scenario", "< 300 MB", f"{highest:.0f} MB", 0.0 < highest < 300.0)
    )
    return report


def peers(context: Context) -> Report:
    """CommonRoad-CriMe's TTR and commonroad-reactive-planner's replan on the file of Scenario 1."""
    import numpy as np

    report, group = Report(), f"peers: {context.title(1)}"
    if context.peers is None:
        report.remarks.append(f"{group}: not run; name their interpreter with --peers PYTHON")
        return report
    made = case(context.path(1), 1, "ego")
    p = made.prepared
    frame, speed, dt = p.scene.frame, float(p.scene.start[1, 0]), p.scene.dt
    s = p.scene.start[0, 0] + speed * dt * np.arange(p.scene.n_steps + 1)
    heading = np.interp(s, frame.s, frame.heading_table)
    ego = np.column_stack(
        [*(np.interp(s, frame.s, frame.points[:, k]) for k in (0, 1)), heading, np.full(len(s), speed)]
    )
    ours = together({"ego": made.search, "literal": made.literal}, context.rounds(9, 3), shortest=0.03)
    slow = Spread.of(ours["literal"].cpu).median
    report.rows.append(
        row(group, "repair: whole search, ego", ours["ego"], ours["literal"], "literal search")
    )
    whole = Spread.of(ours["ego"].cpu).median
    labels = {"crime": "CommonRoad-CriMe: TTR", "reactive-planner": "commonroad-reactive-planner: one replan"}
    for measure, label in labels.items():
        job = {
            "scenario": str(context.path(1)), "measure": measure, "rounds": context.rounds(5, 2),
            "path": frame.points.tolist(), "ego": ego.tolist(),
        }  # fmt: skip
        answer = _peer(context.peers, context.folder / f"{measure}.json", job)
        if "error" in answer:
            report.remarks.append(f"{group}: {label}: {answer['error']}")
            continue
        found = Times(tuple(answer["cpu"]), tuple(answer["wall"]))
        against = Times((slow,) * len(found.cpu), (slow,) * len(found.cpu))
        note = (
            f"{answer['version']}; {answer['note']}; {Spread.of(found.cpu).median / whole:.0f} x our search"
        )
        report.rows.append(row(group, label, found, against, "literal search", note))
    return report


def _peer(python: str, file: Path, job: dict[str, Any]) -> dict[str, Any]:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(job), encoding="utf-8")
    worker = Path(__file__).with_name("peer_worker.py")
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    try:
        # its own folder: some peers write into the working directory
        done = subprocess.run(
            [python, str(worker), str(file)],
            capture_output=True,
            text=True,
            timeout=300,
            cwd=file.parent,
            env=clean,
            check=False,
        )
        return dict(json.loads(done.stdout.strip().splitlines()[-1]))
    except subprocess.TimeoutExpired:
        return {"error": "no answer within 300 s"}
    except (OSError, IndexError, json.JSONDecodeError) as error:
        return {"error": f"{type(error).__name__}: {error}"}
