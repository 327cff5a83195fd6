"""The bound on the time to react over a folder: how tight, how fast, and whether anything contradicts it.

``python -m benchmarks.bound DIR [--scan] [--shoot]`` prints one line per conflict and a summary. Each proof
is checked by the certificate's own code. ``--scan`` repairs at every point of the grid of 0.1 s with all
backends and counts verified repairs at or after a bound; ``--shoot`` searches for motions there by direct
shooting, and for the latest motion before it.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import repair
from benchmarks.shooting import Shooting
from repair.api import find
from repair.bounds.latest import bound
from repair.bounds.written import PROOF_FILE, proof_bytes
from repair.certify.late.rows import late_rows
from repair.certify.motion import along_curve
from repair.certify.traffic import read_traffic
from repair.errors import RepairError
from repair.scene.reading import read_file
from repair.solvers.registry import make_backend
from repair.timegrid import steps_until

REFERENCES = ("constant", "accelerate")
BACKENDS = ("ego", "casadi", "qptr")
GRID = 0.1


def certified(prepared, path: Path, bounds) -> list:
    """The rows of the certificate about each proof, as it would be written."""
    scene, anew = prepared.scene, read_file(path)
    problem = anew.problems[scene.planning_problem_id]
    traffic = read_traffic(anew.scenario, problem, scene, prepared.config, scene.n_steps)
    states = prepared.checker.drive(prepared.reference, prepared.t_reference)
    until = steps_until(prepared.t_reference, scene.dt) * scene.dt
    start = float(states.orientation[0])
    reference = along_curve(prepared.reference, scene.frame, scene.vehicle, until, scene.dt, start)
    times = {kind: b.time if b.proven else None for kind, b in bounds.items()}
    earliest = min((t for t in times.values() if t is not None), default=None)
    said = {
        "kinds": {kind: {"t_bound_s": t, "status": bounds[kind].status} for kind, t in times.items()},
        "proof_file": PROOF_FILE,
        "t_bound_s": earliest,
        "gap_s": None,
        "proven_optimal": False,
        "proven_too_late_at_start": earliest == 0.0,
    }
    content = {"bound": said, "f_ttr_s": None, "ttc_s": prepared.conflict.time}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / PROOF_FILE).write_bytes(proof_bytes(bounds))
        rows = late_rows(Path(folder), content, prepared, anew.scenario, traffic, reference)
    return [row for row in rows if "too late" in row.name]


def verified(prepared, config) -> dict[str, list[float]]:
    """All times-to-repair on the grid that a backend has a verified repair for."""
    found = {name: find(prepared, make_backend(name, config)) for name in BACKENDS}
    return {name: [p.t_rep for p in result.probes if p.feasible] for name, result in found.items()}


def shot(prepared, kind: str, late) -> tuple[int, int, float]:
    """Motions tried at and after a bound, how many meet nothing, and the latest before it that does."""
    contact = prepared.conflict.contact_time
    end = max(prepared.conflict.time, contact if math.isfinite(contact) else 0.0) + 0.5
    shooting = Shooting(prepared, kind, min(end, prepared.t_end))
    k, last = round(late.time / shooting.h), round(prepared.conflict.time / shooting.h)
    shots = [shooting.best(j * shooting.h) for j in sorted({k, (k + last) // 2, last})]
    before = (j * shooting.h for j in range(k - 1, max(k - 21, -1), -1))
    latest = next((t for t in before if shooting.best(t, rounds=6).free), math.nan)
    return sum(s.tried for s in shots), sum(s.free for s in shots), latest


def measured(path: Path, reference: str, scan: bool, shoot: bool) -> dict | None:
    """One case; None where there is no conflict."""
    config = repair.load_config(
        overrides=[
            f"reference.source={reference}",
            f"search.delta_t={GRID}",
            "search.rule=scan",
            "search.proofs=false",
        ]
    )
    prepared = repair.prepare(repair.load_scene(path, config), config)
    if not 0.0 < prepared.conflict.time < math.inf:
        return None
    bounds = bound(prepared)
    case = {
        "file": path.stem, "reference": reference, "kind": prepared.conflict.kind,
        "ttc": prepared.conflict.time, "bounds": bounds,
    }  # fmt: skip
    case["certified"] = certified(prepared, path, bounds)
    if scan:
        case["verified"] = verified(prepared, config)
    if shoot:
        case["shot"] = {kind: shot(prepared, kind, b) for kind, b in bounds.items() if b.proven}
    return case


def line(case: dict) -> str:
    """A row of the table."""
    cells = [case["file"], case["reference"], case["kind"].replace("_", " "), f"{case['ttc']:.2f}"]
    best = max((t for times in case.get("verified", {}).values() for t in times), default=None)
    cells.append("–" if best is None else f"{best:.1f}")
    for kind, late in case["bounds"].items():
        latest = case.get("shot", {}).get(kind, (0, 0, math.nan))[2]
        cells += [
            f"{late.time:.3f}" if late.proven else late.status,
            "–" if math.isnan(latest) else f"{latest:.3f}",
        ]
    return f"| {' | '.join(cells)} |"


def summary(cases: list[dict], seconds: float) -> list[str]:
    """What comes of all cases together."""
    text = [f"{len(cases)} conflicts, {seconds:.0f} s"]
    for kind in cases[0]["bounds"]:
        lates = [case["bounds"][kind] for case in cases]
        spent = np.array([late.seconds for late in lates])
        below = np.mean([late.proven for late in lates])
        gain = np.mean([case["ttc"] - min(case["ttc"], case["bounds"][kind].time) for case in cases])
        text.append(f"{kind}: proven before the TTC in {100 * below:.0f} %, by {gain:.3f} s on average")
        text.append(
            f"  processor time: median {np.median(spent):.3f}, 90 % {np.quantile(spent, 0.9):.3f}, "
            f"largest {spent.max():.3f} s"
        )
        if "shot" in cases[0]:
            shots = [
                (case["bounds"][kind].time, *case["shot"][kind]) for case in cases if kind in case["shot"]
            ]
            near = [t - latest for t, _, _, latest in shots if not math.isnan(latest)]
            text += [
                f"  {case['file']}, {case['reference']}: a motion at or after it meets nothing"
                for case in cases
                if kind in case["shot"] and case["shot"][kind][1]
            ]
            tried, free = sum(s[1] for s in shots), sum(s[2] for s in shots)
            text.append(f"  {tried} motions at and after it by shooting: {free} meet nothing")
            text.append(
                f"  the latest before it that meets nothing: {np.median(near):.3f} s earlier (median)"
            )
    proofs = [(case, row) for case in cases for row in case["certified"]]
    text.append(f"{sum(row.ok for _, row in proofs)} of {len(proofs)} proofs pass the certificate")
    text += [f"  {case['file']}, {row.name}: {row.unit}" for case, row in proofs if not row.ok]
    if "verified" in cases[0]:
        repairs = [(case, t) for case in cases for times in case["verified"].values() for t in times]
        late = sum(t >= b.time - 1e-9 for case, t in repairs for b in case["bounds"].values())
        words = f"{len(repairs)} verified repairs of {', '.join(BACKENDS)} with rule scan"
        text.append(f"{words}: {late} at or after a bound")
        text += [share(cases, name) for name in (*BACKENDS, "best")]
    return text


def share(cases: list[dict], name: str) -> str:
    """How often the last verified repair is near to the bound (or to the TTC, where nothing is proven)."""
    gaps = []
    for case in cases:
        names = BACKENDS if name == "best" else (name,)
        last = max((t for n in names for t in case["verified"][n]), default=-math.inf)
        gaps.append(min(case["ttc"], *(b.time for b in case["bounds"].values())) - last)
    within = " / ".join(f"{100 * np.mean(np.array(gaps) <= g + 1e-9):.0f}" for g in (0.1, 0.2, 0.4))
    return f"gap of {name} at most 0.1 / 0.2 / 0.4 s: {within} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scan", action="store_true", help="verified repairs of all backends")
    parser.add_argument("--shoot", action="store_true", help="motions by direct shooting")
    parser.add_argument("--only", default="", help="files whose names hold this")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    begin, cases = time.perf_counter(), []
    kinds = "bound (vehicle) | shot | bound (search) | shot"
    print(f"| file | reference | conflict | TTC [s] | last repair [s] | {kinds} |\n|{'---|' * 9}")
    for path in sorted(arguments.folder.glob("*.xml")):
        if arguments.only not in path.name:
            continue
        for reference in REFERENCES:
            try:
                case = measured(path, reference, arguments.scan, arguments.shoot)
            except RepairError as error:
                print(f"| {path.stem} | {reference} | {error} |||||||")
                continue
            if case is not None:
                cases.append(case)
                print(line(case), flush=True)
    if cases:
        print("\n" + "\n".join(summary(cases, time.perf_counter() - begin)))


if __name__ == "__main__":
    main()
